"""pwsmooth explore without a browser: what the page is told, how a state answers, maps against the package, doors.

Guards: explorer/, results/layers.py.
"""

import asyncio
import base64
import functools
import http.client
import importlib.resources
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import matplotlib.pyplot
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Kicks, Return, Strobe, System, basins, solve
from pwsmooth.explorer import (
    bundle,
    describe,
    export,
    frames,
    live,
    maps,
    opening,
    presets,
    processes,
    state,
    subject,
    worker,
)
from pwsmooth.explorer.code import figure, script
from pwsmooth.explorer.server import PAGES, Server
from pwsmooth.laws.friction import LuGre, MaxwellSlip, StribeckFriction
from pwsmooth.scenes import assemble, friction_oscillator
from pwsmooth.studies import orbit_diagram
from pwsmooth.studies.study import StudyError, known_scenes

t, x, y, v, w, z = sp.symbols("t x y v w z", real=True)
k = sp.Symbol("k", positive=True)


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A busy machine is no fault of a page's: its bound on the time of a run is not what is tested here."""
    monkeypatch.setitem(describe.LIMITS, "seconds", 300.0)


@pytest.fixture(scope="module")
def oscillator():
    return presets.subject_of_preset("figure-8")


named = functools.cache(subject.named_subject)


def asked(scene, **more):
    known = describe.describe(scene)
    names = [*known["states"][:4], *known["outputs"], *known["characteristic"]]
    return {"names": names, "phase": known["phase"], **more}


# ---- what the page is told


@pytest.mark.parametrize("name", [n for n in known_scenes()])
def test_every_scene_is_described_in_json(name):
    scene = named(name)
    known = json.loads(json.dumps(describe.describe(scene), allow_nan=False))
    assert known["states"] and set(known["start"]) == set(known["states"])
    # Members with one value for all are one slider.
    assert {c["name"] for c in known["controls"]} <= {
        p.name for p in scene.system.parameters
    } | scene.system.groups.keys()
    assert all(c["min"] < c["max"] and (not c["log"] or c["min"] > 0) for c in known["controls"])
    assert known["map"]["ok"] == (scene.period is not None)


def test_a_meaning_and_a_unit_come_from_the_law(oscillator):
    known = {c["name"]: c for c in describe.describe(oscillator)["controls"]}
    assert known["beta"]["unit"] == "s" and known["rho"]["meaning"] == "strength of static friction"


def test_the_members_of_a_family_are_one_slider():
    law = MaxwellSlip(kappa=(2.0, 2.0, 2.0), strength=(0.1, 0.2, 0.3))
    known = {c["name"]: c for c in describe.describe(subject.subject_of(friction_oscillator(law)))["controls"]}
    assert known["kappa"]["each"] == 3 and known["kappa"]["value"] == 2.0
    assert sorted(c["value"] for n, c in known.items() if n.startswith("strength")) == [0.1, 0.2, 0.3]


def test_the_period_follows_the_parameter_that_makes_it(oscillator):
    assert oscillator.period_at({"omega": 2.0}) == pytest.approx(np.pi, rel=1e-15)
    assert oscillator.period_at({"omega": 0.0}) is None


def test_a_frame_comes_back_as_it_went():
    values = np.array([[1.5, np.nan], [-2.0, 0.25]])
    late = 1e6 + np.linspace(0, 1e-3, 5)
    header, arrays = frames.unpack(frames.pack(
        {"kind": "a", "bad": float("nan")},
        {"values": values, "status": np.array([-1, 0, 1], np.int8), "cell": np.arange(3), "t": late},
    ))  # fmt: skip
    assert header == {"kind": "a", "bad": None}
    np.testing.assert_array_equal(arrays["values"], values)
    assert arrays["status"].astype(np.int8).tolist() == [-1, 0, 1] and arrays["cell"].tolist() == [0, 1, 2]
    # Times that float32 alone would make one: 1e6 has a spacing of 0.06 there.
    np.testing.assert_allclose(arrays["t"], late, atol=1e-9)


# ---- how a state answers

CHUA = System(
    {x: 15.6 * (y - x + 0.714 * x + 0.215 * (sp.Abs(x + 1) - sp.Abs(x - 1))), y: x - y + z, z: -k * y},
    parameters={k: 28},
)


def systems():
    """Five systems that are no scene: (System, start, span)."""
    from pwsmooth import Event

    table = Event(x, direction=-1, update={v: -0.8 * v}, name="bounce")
    chain = {x: v, v: -k * x - (x - y) - sp.sign(v) / 4 + sp.cos(t), y: w, w: -k * y - (y - x) - sp.sign(w) / 4}
    left = StribeckFriction().attach(velocity=v - sp.Rational(1, 5))
    slip, start, _ = assemble({x: v, v: -k * x - left.force}, left, x0={x: 0.0, v: 0.0}, parameters={k: 1})
    return {
        "Chua": (CHUA, {x: 0.1, y: 0, z: 0}, (0, 20)),
        "ball on a table": (System({x: v, v: -k}, parameters={k: 1}, events=[table]), {x: 1, v: 0}, (0, 8)),
        "relay": (System({x: y, y: -k * y - sp.sign(x + y / 2)}, parameters={k: 0.2}), {x: 1, y: 0}, (0, 20)),
        "two blocks": (System(chain, time=t, parameters={k: 1}), {x: 1, v: 0, y: 0, w: 0}, (0, 20)),
        "stick-slip": (slip, start, (0, 20)),
    }


@pytest.mark.parametrize("name", ["Chua", "ball on a table", "relay", "two blocks", "stick-slip"])
def test_a_system_that_is_no_scene_answers_without_code_for_the_page(name):
    system, start, span = systems()[name]
    scene = subject.subject_of(system, start, t_span=span)
    current = live.Live(scene)
    header, arrays = current.orbit(asked(scene, p={"k": 1.01 * float(system.parameters[k])}))
    assert header["kind"] == "orbit" and header["ok"], header
    assert arrays["values"].shape == (len(header["names"]), len(arrays["t"]))
    assert current.sentence()[0]["said"]
    for switch in describe.describe(scene)["switches"]:
        assert np.isfinite(current.layer({"switch": switch, "t": 1.0})[1]["g"]).all()


def test_what_is_drawn_lies_on_the_solution_and_keeps_the_ends_of_sticks(oscillator):
    current = live.Live(oscillator)
    header, arrays = current.orbit(asked(oscillator))
    row = dict(zip(header["names"], arrays["values"]))
    exact = current.solution(arrays["t"], "y")
    inside = ~np.isin(arrays["t"], current.solution.t)  # at an event there are two sides
    np.testing.assert_allclose(row["y"][inside], exact[inside], atol=1e-12)
    sticks = [s for s in current.solution.segments if s.status == (0,)]
    assert [h[:2] for h in header["held"]] == [[s.start, s.end] for s in sticks] and sticks
    for s in sticks:
        during = (arrays["t"] > s.start) & (arrays["t"] < s.end)
        assert (arrays["status"][:, during] == 0).all() and np.abs(row["v"][during]).max() < 1e-12


def test_the_layer_at_the_cursor_has_the_folds_of_the_hidden_term(oscillator):
    current = live.Live(oscillator)
    current.orbit(asked(oscillator))
    header, arrays = current.layer({"switch": "lam", "t": 10.0})
    p = {s.name: float(value) for s, value in oscillator.system.parameters.items()}
    at = current.solution(10.0)
    drive = -p["amplitude"] * np.sin(10.0) - p["spring"] * at[0] - p["damper"] * at[1]
    lam = arrays["lam"]
    np.testing.assert_allclose(arrays["slaved"], drive - lam * (1 + p["rho"] * (1 - lam**2)), atol=1e-12)
    np.testing.assert_allclose(arrays["g"], drive - lam * (1 + p["rho"] * at[2]), atol=1e-12)


@pytest.mark.parametrize(
    "part, words",
    [
        ({"p": {"__class__": 1.0}}, "__class__"),
        ({"p": {"rho": "3"}}, "give a number"),
        ({"p": {"rho": True}}, "give a number"),
        ({"p": {"rho": float("nan")}}, "rho"),
        ({"p": {"beta": 0.0}}, "beta"),
        ({"p": {"mass": -1.0}}, "mass"),
        ({"x0": {"q": 1.0}}, "q"),
        ({"t_span": [0, 1e9]}, "t_span"),
        ({"t_span": [1, 0]}, "t_span"),
        ({"names": ["nothing"]}, "nothing"),
    ],
)
def test_what_is_no_state_is_refused_with_a_sentence(oscillator, part, words):
    header, arrays = live.Live(oscillator).orbit({**asked(oscillator), **part})
    assert header["kind"] == "refused" and words in header["why"] and not arrays


@pytest.mark.parametrize(
    "part, field, view",
    [
        ({"p": {"mass": 0.0}}, "mass", False),  # the rate of 'v' divides by it, and v has a field, too
        ({"p": {"omega": 2.0, "mass": -1.0}}, "mass", False),
        ({"p": {"damper": -1.0}}, "damper", False),
        ({"p": {"rho": 2.0, "beta": 0.0}}, "beta", True),  # z is slaved in that view, which has no beta
        ({"x0": {"y": 0.1, "v": float("nan")}}, "x0.v", False),
        ({"t_span": [0, 1e9], "p": {"rho": 2.0}}, "t_span", False),
    ],
)
def test_a_refusal_marks_its_own_field_and_offers_a_view_that_helps(oscillator, part, field, view):
    header, _ = live.Live(oscillator).orbit({**asked(oscillator), **part})
    assert header["kind"] == "refused" and header["field"] == field
    assert [text for text, _ in header["remedies"]] == ["Take the layered view"] * view


def test_a_run_that_dies_at_its_start_has_pictures_and_no_remedy_that_cannot_help(oscillator):
    current = live.Live(oscillator)
    header, arrays = current.orbit({**asked(oscillator), "p": {"mass": 1e-300}})
    assert header["stopped"] == 0 and not header["remedies"] and arrays["t"].tolist() == [0.0]
    assert current.layer({"switch": "lam", "t": 3.0})[0]["t"] == 0 and current.sentence()[0]["said"]


def test_what_stops_at_a_bound_of_the_page_is_told_in_its_words(oscillator, monkeypatch):
    monkeypatch.setitem(describe.LIMITS, "steps", 20)
    header, _ = live.Live(oscillator).orbit(asked(oscillator))
    assert "after 20 steps, the most of a picture" in header["said"] and "max_steps" not in header["said"]
    assert [text for text, _ in header["remedies"]] == ["Shorter span", "Smoothed view"]
    two_fold = presets.subject_of_preset("two-fold")
    header, _ = live.Live(two_fold).orbit(asked(two_fold))
    assert [text for text, _ in header["remedies"]] == ["Smoothed view"], "a shorter span ends there as well"
    assert set(describe.describe(two_fold)["views"]) == {"time", "phase"}


@pytest.mark.parametrize("law", ["LuGre", "Dahl", "BoucWen"])
def test_a_stiff_law_has_its_orbit_and_its_maps_at_the_bound_of_the_page(law):
    scene = subject.named_subject("friction_oscillator", law)
    header, _ = live.Live(scene).orbit(asked(scene))
    assert header["ok"] and live.method_of(scene, {}) == {"method": "stiff"}
    told = {"parameter": "omega", "range": [1.0, 1.1], "columns": 2, "keep": 3}
    found = [arrays for _, arrays in maps.diagram(scene, told)]
    assert np.isfinite(np.concatenate([a["points"] for a in found])).all()
    line = script(scene, {**told, "for": "diagram"})
    assert "method='stiff'" in line and "method" not in script(
        presets.subject_of_preset("figure-8"), {"for": "time"}
    )
    assert live.method_of(presets.subject_of_preset("figure-8"), {}) == {}


@pytest.mark.parametrize(
    "span, words",
    [
        ((0.0, 400.0), r"Repeats every drive period \(6.28 s\); 1 stick of [\d.]+ s, \d+ events each time."),
        (
            (0.0, 60.0),
            r"No period found from 0 to 60 s: still settling, or none. \d sticks \(.* s.*\), \d+ events.",
        ),
        ((0.0, 0.1), r"No period found from 0 to 0.1 s: still settling, or none. No stick, 0 events."),
    ],
)
def test_a_sentence_says_what_the_orbit_comes_to(oscillator, span, words):
    run = oscillator.solve(span, oscillator.start, {})
    said = live.said_of(run, 2 * np.pi, " s")
    assert re.fullmatch(words, said), said


def test_a_run_that_stops_is_drawn_to_where_it_stopped():
    blows = subject.subject_of(System({x: k * x**2}, parameters={k: 1}), {x: 1}, t_span=(0, 2))
    header, arrays = live.Live(blows).orbit(asked(blows))
    assert not header["ok"] and header["stopped"] == pytest.approx(1, abs=1e-3) and header["said"]
    assert arrays["t"][-1] == pytest.approx(header["stopped"], rel=1e-12) and header["asked"] == [0, 2]


@pytest.mark.parametrize("name", presets.PRESETS)
def test_the_script_of_a_preset_gives_the_orbit_bit_for_bit(name):
    scene = presets.subject_of_preset(name)
    changed = {p.name: float(value) * 1.01 for p, value in list(scene.system.parameters.items())[:2]}
    state = asked(scene, p=changed)
    current = live.Live(scene)
    assert current.orbit(state)[0]["ok"] == (name != "two-fold"), "it ends where no solution is distinguished"
    text = script(scene, {**state, "for": "phase"})
    names = {}
    exec(compile(text, "script", "exec"), names)  # what the page gives to be run
    np.testing.assert_array_equal(names["solution"].x, current.solution.x)
    np.testing.assert_array_equal(names["solution"].t, current.solution.t)
    matplotlib.pyplot.close("all")


@pytest.mark.parametrize("view", ["", "smoothed"])
@pytest.mark.parametrize("drawn", ["time", "phase", "layer", "diagram", "basins"])
def test_the_script_of_a_system_runs_and_shows_its_plot(view, drawn, monkeypatch):
    shown = []
    monkeypatch.setattr(matplotlib.pyplot, "show", lambda: shown.append(matplotlib.pyplot.get_fignums()))
    system = System({x: v, v: sp.cos(t) - k * x - sp.sign(v) / 4}, time=t, parameters={k: 2})
    seen = presets.in_view(
        subject.subject_of(system, {x: 1, v: 0}, t_span=(0, 9), seen=Strobe(2 * sp.pi)), view
    )
    state = asked(seen, p={"k": 2.5}, switch="sgn(v)", cursor=3.0, parameter="k", range=[2.0, 2.1], columns=3,
                  axes=["x", "v"], ranges=[[0, 1], [0, 1]], cells=2)  # fmt: skip
    if view and drawn == "layer":
        return  # it has none
    names = {"system": system}
    exec(compile(script(seen, {**state, "for": drawn}), "script", "exec"), names)
    np.testing.assert_array_equal(names["solution"].x, seen.solve((0, 9), seen.start, {"k": 2.5}).x)
    assert len(shown) == 1 and shown[0]
    matplotlib.pyplot.close("all")


@pytest.mark.parametrize("what", ["scene", "system"])
def test_the_script_of_a_file_makes_its_system(tmp_path, monkeypatch, what):
    monkeypatch.setattr(matplotlib.pyplot, "show", lambda: None)
    (tmp_path / "own.py").write_text(
        "import sympy as sp\nfrom pwsmooth import System\nfrom pwsmooth.scenes import Scene\n"
        "x, v = sp.symbols('x v', real=True)\nsystem = System({x: v, v: -x - sp.sign(v)})\n"
        "def scene():\n    return Scene('own', system, {'x': 3.5, 'v': 0.0}, (0, 10))\n"
    )
    study = tmp_path / "study.toml"
    study.write_text(f't_span = [0, 10]\nmeasures = ["extremes(x)"]\nx0 = {{x = 3.5, v = 0.0}}\n[axes]\nx = [1.0]\n'
                     f'[system]\nobject = "own.py:{what}"\n')  # fmt: skip
    opened = [subject.subject_of_study(study, allow_code=True)]
    if what == "scene":
        opened.append(subject.named_subject("own.py:scene", folder=tmp_path))
    for made in opened:
        names = {}
        exec(compile(script(made, {"names": ["x"]}), "script", "exec"), names)
        np.testing.assert_array_equal(names["solution"].x, made.solve(made.t_span, made.start, {}).x)
    matplotlib.pyplot.close("all")


def test_presets_of_the_paper_have_its_numbers():
    from paper_figures import figure_04, figure_05, kicked
    from paper_figures import oscillator as osc

    theirs = {s.name: float(value) for s, value in osc.PARAMETERS.items()}
    renamed = {"k": "spring", "c": "damper", "sigma": "amplitude", "N": "F_c"}
    other = {"figure-4": {"sigma": 0.0}, "figure-7": {"beta": 0.01}, "figure-13": {"beta": kicked.EPS}}
    for name in ("figure-4", "figure-5", "figure-6", "figure-7", "figure-8", "figure-13", "fold"):
        made = presets.subject_of_preset(name)
        mine = {s.name: float(value) for s, value in made.system.parameters.items()}
        known = {renamed.get(n, n): value for n, value in (theirs | other.get(name, {})).items()}
        if "layered" in made.name:  # whose relaxation takes no time
            del known["beta"]
        assert known.items() <= mine.items(), name
    start = {s.name: float(value) for s, value in osc.RELAXING_START.items()}
    assert dict(presets.PRESETS["figure-7"].x0) == start
    assert (figure_04.K, figure_04.N) == (theirs["k"], theirs["N"])
    piece = presets.PRESETS["figure-5"]
    assert (1, piece.t_span[0], *piece.x0.values()) in figure_05.ARRIVING
    noisy = presets.subject_of_preset("figure-13")
    assert (noisy.eps, noisy.noise.every, noisy.noise.on) == (kicked.EPS, kicked.EVERY, kicked.ON)
    assert noisy.noise.size == kicked.EPS / 5


def test_presets_of_laws_have_the_numbers_of_their_figures():
    from paper_figures import figure_4_08, figure_c1, figure_c2, figure_c3, figure_c4, figure_c5, figure_lugre
    from pwsmooth.laws import contact

    def made(name):
        preset = presets.PRESETS[name]
        return getattr(contact, preset.law)(**preset.law_values), preset.arguments

    assert presets.PRESETS["figure-c1"].law_values == figure_c1.BASE
    assert made("figure-c2") == (figure_c2.LAWS["R1"], {"t_span": (0.0, figure_c2.END)})
    assert made("figure-c3")[0] == contact.HertzImpact(K=5e9, c_r=0.5) and 0.5 in {r[2] for r in figure_c3.ROWS}
    law, rest = made("figure-c4")
    assert law == replace(figure_c4.laws()["Wang-Liu-Ma"], c_r=figure_c4.RESTITUTIONS[1])
    assert rest["speed"] == figure_c4.SPEED
    assert presets.PRESETS["figure-c5"].arguments["clearance"] == figure_c5.CLEARANCES[0]
    loops = presets.subject_of_preset("figure-4.8")
    theirs = figure_4_08.loops(0.01)[1.0]
    mine = loops.solve(theirs.t[[0, -1]], loops.start, {"size": 1.0})
    np.testing.assert_allclose(mine(figure_4_08.TIMES, "force"), theirs(figure_4_08.TIMES, "force"), atol=1e-9)
    slow = presets.PRESETS["lugre-presliding"].arguments["force"]
    swing = figure_lugre.swing(
        1.425, [(0, 0), (10, 1.425), (15, 1.425), (35, -1.425), (40, -1.425), (60, 1.425)]
    )
    assert all(
        float(slow.subs(t, s)) == pytest.approx(float(swing.subs(t, s)), abs=1e-15) for s in range(0, 60, 3)
    )


def test_another_law_keeps_the_mechanism_and_where_it_is():
    hidden = presets.subject_of_preset("figure-7")
    other = presets.as_asked(hidden, {"law": "LuGre"})
    # z of the one law is no z of the other.
    assert other.start == {"y": 0.6, "v": -1.07, "z": 0.0} and hidden.moving == ("y", "v")
    expected = friction_oscillator(LuGre()).solve((0, 20), other.start)
    np.testing.assert_array_equal(other.solve((0, 20), other.start, {}).x, expected.x)
    assert "friction_oscillator(LuGre())" in script(other, {"p": {}})
    shaped = presets.as_asked(hidden, {"law": "Dahl", "values": {"alpha": 2.0}})
    assert describe.describe(shaped)["law"]["shape"][0]["value"] == 2.0


@pytest.mark.parametrize(
    "asked, words",
    [
        ({"law": "Hertz"}, "law"),  # of contact
        ({"law": "os.system"}, "law"),
        ({"law": 1}, "law"),
        ({"law": "Dahl", "values": {"alpha": "1"}}, "give a number"),
        ({"law": "Dahl", "values": {"alpha": -1.0}}, "alpha"),
        ({"view": "turned"}, "layered"),
    ],
)
def test_no_other_law_or_view_is_made_than_there_are(asked, words):
    with pytest.raises((ValueError, TypeError), match=words):
        presets.as_asked(presets.subject_of_preset("figure-8"), asked)


def test_laws_that_are_offered_fit_their_scene():
    for scene, count in (("friction_oscillator", 23), ("impact_oscillator", 11), ("spinning_disc", 2)):
        known = named(scene)
        offered = describe.describe(known)["law"]["all"]
        assert len(offered) == count and known.made.law in offered
        for law in offered[::5]:
            assert subject.with_law(known, law).made.law == law
    assert not describe.describe(named("slider_crank"))["law"]


def test_the_band_in_the_phase_plane_is_the_sticking_region():
    from paper_figures import oscillator as osc

    scene = presets.subject_of_preset("fold")
    current = live.Live(scene)
    current.orbit(asked(scene))
    for when in (4.0, 9.0):
        question = {"switch": "lam", "t": when, "phase": ["y", "v"], "box": [[-2.5, 2.5], [-1, 1]]}
        ((x0, y0, x1, y1),) = current.layer(question)[0]["sliding"]
        _, (low, high) = osc.sticking_bounds(np.array([when]))
        # lambda is looked at 1/80 apart, and mu has its top at a fold: it is missed by 6 (1/160)^2 at the most.
        assert y0 == y1 == 0 and abs(x0 - low[0]) < 3e-4 and abs(x1 - high[0]) < 3e-4
    assert not current.layer({**question, "phase": ["y", "friction"]})[0]["sliding"]


@pytest.mark.parametrize("view", ["time", "phase", "characteristic", "layer", "diagram"])
def test_a_saved_figure_is_a_picture_with_its_script(oscillator, view):
    state = asked(oscillator, characteristic=["v", "friction"], switch="lam", cursor=9.0, parameter="rho",
                  range=[1.0, 2.0], columns=3)  # fmt: skip
    picture = figure(oscillator, {**state, "for": view, "format": "png"})
    assert picture.startswith(b"\x89PNG") and b"scene = friction_oscillator" in picture


# ---- maps


def test_a_finished_diagram_is_that_of_the_package(oscillator):
    state = {"parameter": "rho", "range": [0.5, 7.0], "columns": 9}
    found, last = {}, None
    for header, arrays in maps.diagram(oscillator, state):
        last = header
        for column, points in zip(arrays.get("column", ()), arrays.get("points", ())):
            found[int(column)] = points
    assert last["finished"] and sorted(found) == list(range(9))
    values = np.linspace(0.5, 7.0, 9)
    known = orbit_diagram(
        oscillator.system, "rho", values, oscillator.start, Strobe(oscillator.period), transient=150, keep=50
    )
    for column, points in found.items():
        for point in points:
            off = np.abs(known.points[column] - point).max(axis=1).min()
            assert off < 1e-5, (column, off)  # ten times what a column's strobes may differ by


def test_the_first_picture_is_spread_over_the_whole_range(oscillator):
    state = {"parameter": "rho", "range": [0.5, 7.0], "columns": 800}
    next(maps.diagram(oscillator, state))  # compiles, as a page's process does before it is asked
    _, arrays = next(maps.diagram(oscillator, state))
    assert np.diff([0, *np.sort(arrays["column"]), 799]).max() <= 2 * 800 / 32


def test_columns_that_are_carried_on_are_those_of_the_package(oscillator):
    state = {"parameter": "rho", "range": [4.0, 7.0], "columns": 6, "keep": 4, "carry": -1}
    found, header = {}, {}
    for header, arrays in maps.diagram(oscillator, state):  # noqa: B007
        found |= dict(zip(arrays["column"].tolist(), arrays["points"]))
    values = np.linspace(4.0, 7.0, 6)[::-1]
    seen = Strobe(oscillator.period)
    known = orbit_diagram(
        oscillator.system, "rho", values, oscillator.start, seen, carry=True, keep=4, transient=100
    )
    assert header["finished"]
    np.testing.assert_allclose([found[k] for k in range(6)], known.points[::-1], atol=1e-6)


def test_finished_basins_are_those_of_the_package(oscillator):
    state = {"axes": ["y", "v"], "ranges": [[-2, 2], [-2, 2]], "cells": 9}
    label = np.zeros(9 * 9, int)
    header = {}
    for header, arrays in maps.basins(oscillator, state):  # noqa: B007
        label[arrays["cell"]] = arrays["label"]
    assert header["finished"] and header["done"] == 9 * 9
    grid = np.linspace(-2, 2, 9)
    known = basins(oscillator.system, {"y": grid, "v": grid}, Strobe(oscillator.period), x0={"z": 0.0})
    starts = [orbit.x for orbit in known.attractors]
    for row in range(9):
        for column in range(9):
            mine = header["cycles"][label[row * 9 + column] - 3]["x"]
            np.testing.assert_allclose(mine, starts[known.labels[column, row]], atol=1e-6)


def test_basins_are_computed_at_their_borders_first():
    known = np.full((65, 65), maps._UNKNOWN)
    order, done = maps._borders_first(known), []
    for k in order:
        done.append(k)
        row, column = divmod(k, 65)
        known[row, column] = int(column > 20 + row / 4)  # what a start comes to
    assert sorted(done) == list(range(65 * 65))
    row, column = np.divmod(done, 65)
    near = np.abs(column - 20 - row / 4) < 2
    assert np.flatnonzero(near).max() < 0.5 * len(done)


def test_paths_under_noise_are_those_of_solve():
    noisy = presets.subject_of_preset("figure-13")
    state = {"names": ["friction"], "seed": 3, "t_span": [0.0, 0.5]}
    paths = maps.noise(noisy, state)
    for k in (0, 1):
        header, arrays = next(paths)
        kicks = Kicks(1e-3 / 5, 2 * np.pi / 500, on=("y", "v"), seed=3, trajectory=k)
        run = noisy.scene.solve((0.0, 0.5), noisy.start, noise=kicks, t_eval=arrays["t"])
        np.testing.assert_array_equal(arrays["values"][0], run["friction"])
        # Both sides of every kick are among the times.
        assert all(np.abs(arrays["t"] - at).min() < 1e-5 * kicks.every for at in run.event_times("reset"))
    assert header["done"] == 2 and header["of"] == 20
    with pytest.raises(ValueError, match="noise"):
        next(maps.noise(presets.subject_of_preset("coulomb"), state))
    noise = Diffusion({x: 0.1}, step=0.05)
    diffused = subject.subject_of(System({x: -x}), {x: 1}, t_span=(0, 1), noise=noise)
    _, arrays = next(maps.noise(diffused, {"names": ["x"], "seed": 3}))
    np.testing.assert_allclose(arrays["t"], 0.05 * np.arange(21), atol=1e-15)  # where its path is given
    assert np.isfinite(arrays["values"]).all()


def test_an_autonomous_system_has_maps_by_a_section():
    pol = System({x: v, v: k * (1 - x**2) * v - x}, parameters={k: 1})
    scene = subject.subject_of(pol, {x: 1, v: 0}, t_span=(0, 20))
    with pytest.raises(ValueError, match="no period"):
        next(maps.diagram(scene, {"parameter": "k", "range": [0.5, 2], "columns": 3}))
    state = {"parameter": "k", "range": [0.5, 2.0], "columns": 3, "section": ["v", -1]}
    found = {}
    for _, arrays in maps.diagram(scene, state):
        found |= dict(zip(arrays["column"].tolist(), arrays["points"]))
    known = orbit_diagram(
        pol, k, [0.5, 1.25, 2.0], {x: 1, v: 0}, seen=Return(v, direction=-1), transient=100, keep=1
    )
    np.testing.assert_allclose([found[c][-1, 0] for c in range(3)], known["x"][:, 0], atol=1e-7)
    assert "Return('v', -1)" in script(scene, {**state, "for": "diagram"})


def test_a_section_repeats_where_the_orbit_does(oscillator):
    points = np.concatenate([arrays["points"] for _, arrays in maps.section(oscillator, {})])
    assert np.abs(points[-2] - points[-3]).max() < 1e-8 and len(points) < 1000


# ---- what a link brings


def test_a_link_brings_what_the_system_knows_and_names_the_rest(oscillator):
    known = describe.describe(oscillator)
    asked = {
        "p": {"rho": 2.5, "n": 1, "mass": "x"}, "x0": {"y": float("nan")}, "t_span": [3, 1], "names": ["y", "friction"],
        "phase": ["y"], "section": ["q", 1], "noise": {"name": "y", "seed": -1}, "ranges": {"rho": [1, 4], "n": [0, 1]},
        "basins": {"axes": ["v", "y"], "ranges": [[-1, 1], [0, 2]]}, "diagram": 7, "cursor": [], "odd": 1,
    }  # fmt: skip
    own, (found, left) = state.first_state(known, {}), state.restored(known, asked)
    taken = {
        "p": {**own["p"], "rho": 2.5},
        "names": asked["names"],
        "basins": asked["basins"],
        "ranges": {"rho": [1, 4]},
    }
    assert found == own | taken
    assert left == ["odd", "n", "mass", "y"]
    again = state.decoded(base64.urlsafe_b64encode(json.dumps(found).encode()).decode().rstrip("="))
    assert state.restored(known, again) == (found, [])


# ---- files without Python


STATIC = importlib.resources.files(bundle.__package__).joinpath("static")
LOADED = ("plot.js", "views.js", "explorer.js", "main.js", "style.css")


def test_a_browser_loads_61_kb_of_module_and_style():
    assert sum(len(bundle.static(name)) for name in LOADED) <= 61_000


def test_what_is_delivered_has_every_text_of_the_source():
    for name in (*LOADED, "file.js"):
        source = STATIC.joinpath(name).read_text(encoding="utf-8")
        code = re.sub(r"^\s*//.*|/\*.*?\*/", "", source, flags=re.M)
        for text in re.findall(r'"[^"\n]*"|`[^`]*`', code):
            assert text in bundle.static(name).decode(), f"{name} lost {text}"


def test_no_rule_of_the_style_begins_a_part_with_a_colon():
    # rcssmin takes "a :is(b)" inside a rule for a declaration, and makes it "a:is(b)".
    for line in STATIC.joinpath("style.css").read_text(encoding="utf-8").splitlines():
        assert not re.search(r"[\w)\]] :", line.partition("{")[0]), line


def test_without_the_libraries_files_are_delivered_as_they_are_written(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(bundle, "import_module", missing)
    for name in (*LOADED, "file.js"):
        source = STATIC.joinpath(name)
        assert bundle.static.__wrapped__(name) == source.read_bytes()
    assert "\nimport " not in bundle.module.__wrapped__() and "const mount" in bundle.module.__wrapped__()


def test_a_file_has_a_frame_for_every_value_near_the_orbit_and_asks_nothing_of_the_network(
    oscillator, tmp_path
):
    values = np.linspace(1, 4, 4)
    opening.Explorer(oscillator).export(tmp_path / "a.html", {"rho": values}, diagram=True)
    text = (tmp_path / "a.html").read_text()
    assert "default-src 'none'" in text and " src=" not in text and '<link rel="stylesheet' not in text
    data = json.loads(text.partition('<script type="application/json" id="data">')[2].partition("</script>")[0])
    assert data["values"] == values.tolist() and len(data["frames"]) == 4 and data["diagram"]
    header, arrays = frames.unpack(base64.b64decode(data["frames"][2]))
    exact = oscillator.solve(oscillator.t_span, oscillator.start, {"rho": 3.0})
    row = arrays["values"].reshape(len(header["names"]), -1)[header["names"].index("y")]
    # A thousandth of the range, and where time is off by a step of its 16 bits the slope's share.
    off = np.abs(row - exact(np.clip(arrays["t"], 0, 60), "y"))
    assert off.max() < 1e-3 * np.ptp(row) + 60 / 65000 * np.abs(exact["v"]).max()


def test_a_file_that_would_be_too_large_says_how_many_values_fit(oscillator, monkeypatch):
    monkeypatch.setattr(export, "MOST", 250_000)
    with pytest.raises(ValueError, match=r"\d+ values fit"):
        export.standalone(oscillator, {"rho": np.linspace(1, 4, 20)}, views=["time"])
    with pytest.raises(ValueError, match="one slider"):
        export.standalone(oscillator, {"rho": [1, 2], "beta": [1, 2]})


# ---- doors


@pytest.fixture(scope="module")
def served(oscillator):
    server = Server(oscillator)
    server.start()
    yield server
    server.stop()


def answer(server, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in ({"Host": f"127.0.0.1:{server.port}"} | headers).items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    reply = connection.getresponse()
    reply.read()
    return reply


UPGRADE = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
           "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA=="}  # fmt: skip


def test_the_server_answers_its_own_page_alone(served):
    own = f"http://127.0.0.1:{served.port}"
    page = answer(served)
    assert page.status == 200 and "script-src 'self'" in page.headers["Content-Security-Policy"]
    assert page.headers["X-Content-Type-Options"] == "nosniff" and not page.headers.get(
        "Access-Control-Allow-Origin"
    )
    assert answer(served, Host="evil.example").status == 403
    assert answer(served, Host=f"127.0.0.1:{served.port + 1}").status == 403
    for path in ("/../server.py", "/%2e%2e/server.py", "/static/style.css", "//etc/passwd", "/style.css/"):
        assert answer(served, path).status == 404
    for origin in (
        None,
        "http://evil.example",
        f"{own}.evil.example",
        f"https://127.0.0.1:{served.port}",
        "null",
    ):
        headers = UPGRADE | ({} if origin is None else {"Origin": origin})
        assert answer(served, "/socket", **headers).status == 403
    assert answer(served, "/socket", **UPGRADE, Origin=own).status == 101


def socket(server, token):
    from websockets.sync.client import connect

    made = connect(
        f"ws://127.0.0.1:{server.port}/socket", origin=f"http://127.0.0.1:{server.port}", max_size=None
    )
    made.__enter__()  # closed by the test
    made.send(json.dumps({"token": token}))
    return made


def heard(made, kind, seconds=120):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        header, arrays = frames.unpack(made.recv(timeout=seconds))
        if header["kind"] == kind:
            return header, arrays
    raise AssertionError(f"no {kind}")


@pytest.mark.parametrize(
    "change", [lambda s: "", lambda s: s[:-1], lambda s: s + "a", lambda s: s.swapcase(), lambda s: 1]
)
def test_another_token_is_refused(served, change):
    from websockets.exceptions import ConnectionClosed

    made = socket(served, change(served.token))
    with pytest.raises(ConnectionClosed) as closed:
        made.recv(timeout=10)
    assert closed.value.rcvd.code == 4403 and not served.pages


def test_a_page_gets_answers_the_newest_of_each_and_its_processes_end_with_it(served, oscillator):
    made = socket(served, served.token)
    scene, _ = heard(made, "scene")
    assert scene["title"] == "friction oscillator, HiddenStatic"
    heard(made, "ready")
    state = asked(oscillator)
    for seq in range(1, 41):
        made.send(json.dumps({"kind": "orbit", "seq": seq, **state, "p": {"rho": 3 + seq / 100}}))
    answered = []
    while not answered or answered[-1] < 40:
        answered.append(heard(made, "orbit")[0]["seq"])
    assert answered == sorted(answered) and len(answered) < 40
    made.send(
        json.dumps({"kind": "basins", "job": 1, "axes": ["y", "v"], "ranges": [[-2, 2], [-2, 2]], "cells": 300})
    )
    heard(made, "basins")
    made.send(json.dumps({"kind": "diagram", "job": 2, "parameter": "rho", "range": [1, 2], "columns": 4}))
    made.send(json.dumps({"kind": "stop", "job": 3}))
    made.send(json.dumps({"kind": "section", "job": 4}))
    jobs = []
    while not (jobs and jobs[-1] == ("section", True)):
        header, _ = frames.unpack(made.recv(timeout=60))
        if "job" in header:
            jobs.append((header["kind"], bool(header.get("finished"))))
    assert ("basins", True) not in jobs  # it was ended
    (page,) = served.pages
    processes = [page.workers.live.process, page.workers.maps.process]
    made.close()
    until = time.monotonic() + 5
    while time.monotonic() < until and (served.pages or any(p.poll() is None for p in processes)):
        time.sleep(0.05)
    assert not served.pages and not any(p.poll() is None for p in processes)


def test_a_page_that_only_looks_changes_nothing(oscillator, monkeypatch):
    sent = []

    class Nothing:
        def __init__(self, target, subject, heard): ...

        def send(self, message, awaited=True):
            sent.append(message)

    monkeypatch.setattr(processes, "Process", Nothing)
    state = (
        base64.urlsafe_b64encode(json.dumps({"p": {"rho": 2.0}, "x0": {"y": 0.1}}).encode())
        .decode()
        .rstrip("=")
    )
    fixed = replace(opening.stated(oscillator, state), read_only=True)
    workers = processes.Workers(fixed, lambda frame: None)
    workers.message({"kind": "orbit", "p": {"rho": 7.0}, "x0": {"y": 1.0}, "t_span": [0, 9], "names": ["y"]})
    workers.message({"kind": "view", "law": "LuGre", "view": "layered"})
    workers.message({"kind": "diagram", "parameter": "rho", "range": [1, 2], "columns": 3, "p": {"rho": 7.0}})
    assert sent == [
        {"kind": "orbit", "names": ["y"]}, {"kind": "view", "view": "layered"}, {"kind": "view", "view": "layered"},
        {"kind": "diagram", "parameter": "rho", "range": [1, 2], "columns": 3},
    ]  # fmt: skip
    p, x0, span = live.state_of(fixed, sent[0])
    assert describe.describe(fixed)["read_only"] and (x0["y"], span) == (0.1, oscillator.t_span)
    assert {c["name"]: c["value"] for c in describe.describe(fixed)["controls"]}["rho"] == 2.0
    for wrong in ("e30", "W10", "____"):
        if wrong == "e30":
            assert opening.stated(oscillator, wrong).start == oscillator.start
        else:
            with pytest.raises(ValueError, match="--state"):
                opening.stated(oscillator, wrong)


def test_a_law_may_take_longer_to_compile_than_a_picture(oscillator, monkeypatch):
    """What waits behind it was taken for late, and the process ended in the midst of it."""
    started = []

    class Slow:
        def __init__(self, target, subject, heard):
            self.asked, self.alive = None, True
            started.append(self)

        def send(self, message, awaited=True):
            self.asked = time.monotonic() - 1000 if awaited else None

        def end(self): ...

    monkeypatch.setattr(processes, "Process", Slow)
    told = []
    workers = processes.Workers(oscillator, told.append)
    workers._from_live(frames.pack({"kind": "ready"}))
    live = workers.live
    workers.message({"kind": "view", "law": "LuGre"})
    workers._from_live(frames.pack({"kind": "opening"}))
    workers.message({"kind": "sentence"})
    workers.watch()
    assert workers.live is live and b"opening" not in told[-1]
    for end in ({"kind": "scene", "states": ["y"]}, {"kind": "refused", "why": "no", "seq": 3, "to": "view"}):
        workers.opening = True
        workers._from_live(frames.pack(end))
        assert not workers.opening
    workers.watch()  # and now it is late
    assert workers.live is not live and b"did not answer within" in told[-1]


def test_four_pages_are_the_most(served):
    from websockets.exceptions import ConnectionClosed

    made = [socket(served, served.token) for _ in range(PAGES)]
    until = time.monotonic() + 10
    while len(served.pages) < PAGES and time.monotonic() < until:
        time.sleep(0.05)
    fifth = socket(served, served.token)
    with pytest.raises(ConnectionClosed) as closed:
        fifth.recv(timeout=10)
    assert closed.value.rcvd.code == 4429
    for each in made:
        each.close()


def test_ctrl_c_ends_everything_with_code_0(tmp_path):
    command = [sys.executable, "-u", "-m", "pwsmooth", "explore", "--preset", "coulomb", "--no-browser"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    line = run.stdout.readline()
    assert "http://127.0.0.1:" in line and "#t=" in line
    run.send_signal(signal.SIGINT)
    assert run.wait(10) == 0


SCRIPT = """import sympy as sp
from pwsmooth import Kicks, System, explore
{}
x, y = sp.symbols("x y", real=True)
relay = System({{x: y, y: -x / 5 - sp.sign(x + y / 2)}})
{}explore(relay, {{x: 1, y: 0}}, t_span=(0, 20), noise={})"""
OWN = "class Mine(Kicks): pass"  # what a process of the page has to run the script for


def page_of(folder, text, way):
    """The process of a script with a page, run as a file, as `python -c` or from its input; and the lines it prints."""
    path = folder / "own.py"
    path.write_text(text)
    arguments, given = {"file": ([path], None), "-c": (["-c", text], None), "input": (["-"], path.open())}[way]
    pipes = dict(stdin=given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    environment = {**os.environ, "BROWSER": "true"}
    return subprocess.Popen([sys.executable, "-u", *arguments], **pipes, cwd=folder, env=environment)


def first_answers(run):
    """What a page of this process hears until it is ready or is told that it ends."""
    from websockets.sync.client import connect

    host, token = re.search(r"http://(\S+)/#t=(\S+)", run.stdout.readline()).groups()
    with connect(f"ws://{host}/socket", origin=f"http://{host}", max_size=None) as made:
        made.send(json.dumps({"token": token, "state": ""}))
        kinds = []
        while not kinds or kinds[-1] not in ("ready", "killed"):
            kinds.append(frames.unpack(made.recv(timeout=120))[0]["kind"])
    run.send_signal(signal.SIGINT)
    said, trouble = run.communicate(timeout=20)
    return kinds, said, trouble


@pytest.mark.parametrize("way", ["file", "-c", "input"])
def test_a_script_without_a_guard_has_one_page_that_answers(tmp_path, way):
    kinds, said, trouble = first_answers(page_of(tmp_path, SCRIPT.format("", "", None), way))
    assert kinds == ["scene", "ready"] and "http" not in said and not trouble


def test_a_script_is_run_again_for_what_it_defines_and_must_guard_its_page(tmp_path):
    noise = "Mine(1e-3, 1.0, on=('y',), seed=1)"
    guarded = SCRIPT.format(OWN, 'if __name__ == "__main__": ', noise)
    assert first_answers(page_of(tmp_path, guarded, "file"))[0] == ["scene", "ready"]
    kinds, said, trouble = first_answers(page_of(tmp_path, SCRIPT.format(OWN, "", noise), "file"))
    assert kinds == ["killed"] and "http" not in said
    assert "RuntimeError: explore() is called by a process" in trouble and "__name__ ==" in trouble
    for way in ("-c", "input"):  # where there is no file to run
        _, trouble = page_of(tmp_path, SCRIPT.format(OWN, "", noise), way).communicate(timeout=60)
        assert "ValueError" in trouble and "define it in a module" in trouble


def test_where_an_event_loop_runs_the_page_is_served_beside_it(monkeypatch, capsys):
    opened = []
    monkeypatch.setattr(opening.webbrowser, "open", opened.append)
    system = System({x: y, y: -x})

    async def cell():
        return opening.explore(system, {x: 1, y: 0}, t_span=(0, 1))

    explorer = asyncio.run(cell())
    assert opened == [explorer.open()] and opened[0] in capsys.readouterr().out
    explorer.close()


def test_a_fault_at_one_state_does_not_end_what_answers_the_others(oscillator, monkeypatch, capsys):
    heard, asked_for = [], iter([{"kind": "sentence", "seq": 1}, {"kind": "nothing", "seq": 2}])
    monkeypatch.setattr(live.Live, "sentence", lambda self: [][len(heard)])
    pipe = SimpleNamespace(send_bytes=lambda frame: heard.append(frames.unpack(frame)[0]), poll=lambda: False,
                           recv_bytes=lambda: json.dumps(next(asked_for)).encode())  # fmt: skip
    with pytest.raises((StopIteration, RuntimeError)):
        worker.live(pipe, oscillator, {})
    assert heard[-2]["kind"] == "refused" and "IndexError" in heard[-2]["why"] and heard[-1]["kind"] == "pong"
    assert "IndexError" in capsys.readouterr().err


def test_without_the_extra_the_command_names_it(monkeypatch):
    monkeypatch.setattr(opening.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="pip install 'websockets"):
        opening.command("friction_oscillator", None, None, "", 0, False, False, print)


def test_bad_input_is_refused_at_the_door():
    system = System({x: v, v: -k * x}, parameters={k: 1})
    for arguments, words in (
        ((system,), "x0"),
        ((system, {x: 1}), "v"),
        ((system, {x: 1, v: 0}, {"t_span": (1, 0)}), "t_span"),
        ((system, {x: 1, v: 0}, {"t_span": (0, 1), "ranges": {"q": (0, 1)}}), "q"),
        ((system, {x: 1, v: 0}, {"t_span": (0, 1), "seen": -1}), "seen"),
        (("block",), "system"),
    ):
        *positional, more = (
            arguments if isinstance(arguments[-1], dict) and len(arguments) == 3 else (*arguments, {})
        )
        with pytest.raises((ValueError, TypeError), match=words):
            subject.subject_of(*positional, **more)
    with pytest.raises(StudyError, match="scenes are"):
        subject.named_subject("no_scene")
    with pytest.raises(ValueError, match="presets are"):
        presets.preset_of("figure-99")


def test_an_explorer_gives_the_state_the_solution_and_its_script(oscillator):
    explorer = opening.Explorer(oscillator, {"p": {"rho": 2.0}})
    again = solve(oscillator.system, oscillator.t_span, oscillator.start, parameters={"rho": 2.0}, dense_output=True,
                  atol=[oscillator.atol.get(s, 1e-12) for s in ("y", "v", "z")])  # fmt: skip
    np.testing.assert_array_equal(explorer.solution.x, again.x)
    assert "'rho': 2.0" in explorer.code() and explorer.state["x0"] == oscillator.start


def test_a_page_that_ends_with_a_refused_value_leaves_the_state_before(oscillator):
    explorer = opening.Explorer(oscillator, {"p": {"rho": 2.0}})
    explorer._server = SimpleNamespace(state={"p": {"beta": 0}}, stop=lambda: None)
    explorer.close()
    assert explorer.state["p"]["rho"] == 2.0
