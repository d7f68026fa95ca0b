"""Sketches: parts stand where the equations say, and films show them.

Guards: plotting/films.py.
"""

import functools
import json

import matplotlib.animation
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Family, System, solve
from pwsmooth.laws.contact import RigidImpact
from pwsmooth.laws.friction import Coulomb, HiddenStatic
from pwsmooth.scenes import (
    Sketch,
    block_on_belt,
    chain_of_blocks,
    falling_ball,
    friction_oscillator,
    impact_oscillator,
    slider_crank,
)
from pwsmooth.scenes.sketch import Arrow, Ball, Block, Ground

matplotlib.use("Agg")
x, v = sp.symbols("x v", real=True)
SCENES = {
    "oscillator": lambda: friction_oscillator(HiddenStatic(rho=3.0, beta=0.1), t_span=(0, 20)),
    "belt": lambda: block_on_belt(Coulomb(), t_span=(0, 20)),
    "stop": lambda: impact_oscillator(RigidImpact(e=0.8), t_span=(0, 20)),
    "ball": lambda: falling_ball(RigidImpact(e=0.8), height=1.0),
    "crank": lambda: slider_crank(RigidImpact(e=0.5), None, clearance=1e-3),
}


@functools.cache
def shown(name):
    """(solution, sketch, times, pose)."""
    scene = SCENES[name]()
    solution = scene.solve(dense_output=True)
    times = np.linspace(*scene.t_span, 101)
    return solution, scene.sketch, times, scene.sketch.pose(solution, times)


def test_the_block_stands_at_its_displacement_and_its_spring_reaches_it():
    solution, sketch, times, pose = shown("oscillator")
    np.testing.assert_array_equal(pose["block"][0], solution(times, "y"))
    width = next(shape.width for shape in sketch.shapes if shape.name == "block")
    np.testing.assert_allclose(pose["spring"][2], pose["block"][0] - width / 2, atol=1e-12)
    assert np.ptp(pose["spring"][0]) == 0 and np.all(np.diff(pose["spring"][[0, 2]], axis=0) > 0)


def test_a_block_that_sticks_moves_with_the_belt():
    solution, sketch, times, pose = shown("belt")
    (way,) = np.diff(pose["belt"][[0, 2]], axis=0)
    travel = np.sign(way) * pose["belt"][4]
    stuck = np.array([solution.status[0][np.searchsorted(solution.t, t, side="right") - 1] == 0 for t in times])
    both = stuck[1:] & stuck[:-1]
    assert both.sum() > 10
    np.testing.assert_allclose(np.diff(pose["block"][0])[both], np.diff(travel)[both], atol=1e-9)


def test_the_block_does_not_enter_the_stop_and_the_ball_not_the_ground():
    solution, sketch, times, pose = shown("stop")
    right = pose["block"][0] + next(shape.width for shape in sketch.shapes if shape.name == "block") / 2
    np.testing.assert_allclose(right, solution(times, "x"), atol=1e-12)
    assert np.all(right <= pose["stop"][0] + 1e-9)
    solution, sketch, times, pose = shown("ball")
    np.testing.assert_allclose(pose["ball"][1] - sketch.shapes[1].radius, solution(times, "height"), atol=1e-12)


def test_links_keep_their_lengths_and_the_journal_stays_in_its_enlarged_bearing():
    solution, sketch, times, pose = shown("crank")
    sizes = {shape.name: shape for shape in sketch.shapes}
    np.testing.assert_allclose(np.hypot(*(pose["crank"][2:] - pose["crank"][:2])), 0.05, rtol=1e-12)
    gap = sizes["bearing"].radius - sizes["journal"].radius
    factor = gap / 1e-3
    assert sketch.note == f"clearance drawn {factor:.3g} times too large" and factor > 10
    # The rod ends in the middle of the bearing; it is long by what the drawn gap is too wide for.
    np.testing.assert_array_equal(pose["rod"][2:], pose["bearing"])
    assert np.abs(np.hypot(*(pose["rod"][2:] - pose["rod"][:2])) - 0.3).max() <= (factor - 1) * 1.1e-3
    off = np.hypot(*(pose["journal"][:2] - pose["bearing"]))
    np.testing.assert_allclose(
        off / gap, np.hypot(solution(times, "e_x"), solution(times, "e_y")) / 1e-3, atol=1e-9
    )


def test_blocks_of_a_family_stand_in_a_row_and_take_the_colours_of_their_switches():
    blocks = Family(3)
    y, w = blocks.symbols("y w")
    chain = System({y: w, w: blocks.neighbour(y, 1) - 2 * y - sp.sign(w - sp.Rational(1, 10)) / 4})
    run = solve(chain, (0, 5), {y: [0.1, 0.0, -0.1], w: 0}, dense_output=True)
    sketch = chain_of_blocks(["y_1", "y_2", "y_3"], spacing=2, switches=run.multipliers)
    pose = sketch.pose(run, [0.0, 5.0])
    assert [pose[f"block {k}"][0, 0] for k in (1, 2, 3)] == [0.1, 2.0, 3.9]
    assert [s.phase for s in sketch.shapes if isinstance(s, Block)] == list(run.multipliers)
    with pytest.raises(ValueError, match="`positions` has 2 names and `switches` 1"):
        chain_of_blocks(["a", "b"], switches=["lam"])


@pytest.mark.parametrize("name", SCENES)
def test_a_sketch_is_told_in_json_and_posed_by_samples_as_by_times(name):
    solution, sketch, _, _ = shown(name)
    told = json.loads(json.dumps(sketch.describe()))
    for shape, part in zip(told, sketch.shapes):
        assert shape["name"] == part.name and shape["places"] == list(part.places)
    names = [n for n in sketch.names if n in (*solution.states, *solution.outputs)]
    drawn = solution.sample(200, names)
    # Where no event is solution(t) and the sample are one.
    once = np.append(np.diff(drawn.t) > 0, True) & np.append(True, np.diff(drawn.t) > 0)
    fast, slow = sketch.pose(solution, drawn), sketch.pose(solution, drawn.t)
    for part in slow:
        np.testing.assert_allclose(fast[part][:, once], slow[part][:, once], rtol=1e-9, atol=1e-9)


def test_films_are_written_as_gif_and_html_with_as_many_frames_as_asked_for(tmp_path):
    image = pytest.importorskip("PIL.Image")
    solution = shown("oscillator")[0]
    solution.animate(path=tmp_path / "film.gif", fps=5, seconds=1, names=["y"])
    with image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 5
        frames = []
        for k in range(5):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB")).copy())
    assert all((one != other).any() for one, other in zip(frames, frames[1:]))
    solution.animate(path=tmp_path / "film.html", fps=2, seconds=1, t_span=(5, 10))
    text = (tmp_path / "film.html").read_text()
    assert text.count("data:image/png;base64") == 2 and sorted(p.name for p in tmp_path.iterdir()) == [
        "film.gif",
        "film.html",
    ]


def test_all_kinds_of_shapes_are_drawn():
    for name in SCENES:
        film = shown(name)[0].animate(fps=1, seconds=2)
        film._draw_was_started = True  # else it warns that nobody has seen it
        film._draw_frame(1)
        matplotlib.pyplot.close(film._fig)


def test_what_no_film_can_be_made_of_is_refused_at_the_door(tmp_path, monkeypatch):
    solution, sketch, *_ = shown("ball")
    monkeypatch.setattr(matplotlib.animation.writers, "is_available", lambda name: False)
    for given, message in (
        ({"path": tmp_path / "film.mp4"}, "ffmpeg.*none is found; install it"),
        ({"path": tmp_path / "film.avi"}, "ends in .gif, .html, .mp4"),
        ({"fps": 100, "seconds": 100}, "10000 frames"),
        ({"t_span": (0, 9)}, "`t_span` is"),
        ({"names": ["q"]}, "`names` has 'q'"),
    ):
        with pytest.raises(ValueError, match=message):
            solution.animate(**given)
    plain = solve(System({x: -x}), (0, 1), {x: 1}, dense_output=True)
    with pytest.raises(TypeError, match="`sketch` is None; give a pwsmooth.scenes.Sketch"):
        plain.animate()
    with pytest.raises(ValueError, match="the sketch uses 'p'"):
        plain.animate(sketch)
    with pytest.raises(ValueError, match="dense_output=True"):
        solve(System({x: -x}), (0, 1), {x: 1}).animate(sketch)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Sketch([]), ValueError, "`shapes` are named nothing"),
        (lambda: Sketch([Ball("a", 0, 0, 1), Ball("a", 1, 0, 1)]), ValueError, "named a, a"),
        (lambda: Sketch([1]), TypeError, "`shapes` contains 1"),
        (lambda: Sketch([Ball("a", 0, 0, 1)], bounds=(0, 0, 0, 1)), ValueError, "`bounds` is"),
        (lambda: Ball("a", 0, 0, -1), ValueError, "`radius` of Ball is -1"),
        (lambda: Ground("a", "x", 0, 0, 0), TypeError, "`x_1` of Ground is 'x'"),
        (lambda: Arrow("a", 0, 0, sp.nan, 0), ValueError, "`dx` of Arrow is nan"),
    ],
)
def test_bad_shapes_are_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()
