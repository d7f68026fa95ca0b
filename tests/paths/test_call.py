"""A call of solve() is checked once, and the first path that serves it runs; behind the door nothing is checked again.

Guards: paths/call.py, solving.py.
"""

import ast
import copy
import inspect
import math
import pickle
import sys

import family_models
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Kicks, Strobe, System, find_orbit, follow, solve
from pwsmooth.analysis.continuation import Steps
from pwsmooth.costs import event_time, final, value_and_gradient
from pwsmooth.costs import objective as objectives
from pwsmooth.families import Recorder
from pwsmooth.noise import diffusion_path
from pwsmooth.paths import backward, event_driven, functions, local, smoothed, stiff_events, stiffness
from pwsmooth.solving import PATHS, behind_the_door, call_with, path_for

t, x, v = sp.symbols("t x v", real=True)
F = sp.Symbol("F", positive=True)
START = {x: 1, v: 0.5}


def block():
    return System({x: v, v: sp.sin(2 * t) - x - F * sp.sign(v)}, time=t, parameters={F: 0.3})


def entered(function, file):
    """Calls into one of the package's files while a function runs."""
    found = []

    def look(frame, event, _):
        if event == "call" and frame.f_code.co_filename.endswith(file):
            found.append(frame.f_code.co_name)

    sys.setprofile(look)
    try:
        function()
    finally:
        sys.setprofile(None)
    return found


SPRING = System({x: v, v: -x})  # without switches: implicit steps may suit it
CASES = [
    (block, {}, event_driven),
    (lambda: SPRING, {}, stiffness),
    (lambda: SPRING, {"method": "taylor"}, event_driven),
    (lambda: SPRING, {"method": "stiff"}, stiff_events),
    (lambda: block().smoothed(0.1), {}, smoothed),
    (lambda: block().smoothed(0.1), {"noise": Diffusion({v: 0.1}, step=0.1)}, diffusion_path),
    (lambda: block().smoothed(0.1), {"noise": Diffusion({v: 0}, step=0.1)}, smoothed),
    (block, {"noise": Kicks(0.1, every=1, on="v")}, event_driven),
    (lambda: System.from_functions(lambda t, x, lam, p: (-x[0],), "x"), {}, functions),
]


@pytest.mark.parametrize(("system", "options", "path"), CASES)
def test_the_first_path_that_serves_is_the_one_meant(system, options, path):
    system = system()
    call = call_with(system, options)
    assert path_for(call) is path
    first = PATHS.index(path)
    assert all(other.why_not(system.model, call) for other in PATHS[:first])  # each says why


def test_a_span_that_decreases_and_a_large_family_have_paths_of_their_own():
    call = call_with(block(), {}).changed(span=(1.0, 0.0))
    assert path_for(call) is backward
    chain, *_ = family_models.both("slip_stick", 6)
    assert path_for(call_with(chain, {})) is not local
    assert path_for(call_with(chain, {"local": True})) is local


def test_what_a_path_does_not_have_is_refused_by_it_and_no_other_path_takes_the_call():
    view = block().smoothed(0.1)
    for options, words in (
        ({"record": Recorder()}, "`record` is given, but a smoothed view takes the whole system"),
        ({"local": True}, "`local` is True, but a smoothed view takes the whole system"),
        ({"strict": True}, "`order` and `strict` belong to Taylor steps"),
    ):
        with pytest.raises(ValueError, match=words):
            solve(view, (0, 1), START, **options)


def test_solve_itself_hardly_branches():
    tree = ast.parse(inspect.getsource(inspect.unwrap(solve)))
    kinds = ast.If, ast.IfExp, ast.For, ast.While, ast.BoolOp, ast.Try
    assert sum(isinstance(node, kinds) for node in ast.walk(tree)) <= 3


@pytest.mark.parametrize(("system", "options"), [(block, {}), (block, {"dense_output": True}),
                                                 (lambda: block().smoothed(0.1), {"rtol": 1e-8})])  # fmt: skip
def test_runs_behind_the_door_have_the_bits_of_solve(system, options):
    system = system()
    run = behind_the_door(system, **options)
    for force in (0.3, 0.5):
        changed = system.with_parameters({F: force})
        for start in ([1.0, 0.5], [0.2, -0.1]):
            inside, outside = run(changed, (0.0, 4.0), start), solve(changed, (0, 4), start, **options)
            assert inside.t.tobytes() == outside.t.tobytes() and inside.x.tobytes() == outside.x.tobytes()
            assert inside.tolerances == outside.tolerances and inside.cost == outside.cost


def test_behind_the_door_nothing_is_checked_again():
    system = block()
    run = behind_the_door(system)
    run(system, (0.0, 4.0), [1.0, 0.5])
    assert entered(lambda: run(system, (0.0, 5.0), [0.5, 0.1]), "door/checks.py").count("whole") == 0
    assert not [
        name
        for name in entered(lambda: run(system, (0.0, 5.0), [0.5, 0.1]), "door/checks.py")
        if name not in ("called",)  # doors of Solution and its log
    ]


def test_a_branch_followed_again_goes_through_no_door_of_solve():
    orbit = find_orbit(block(), START, seen=Strobe(sp.pi))
    follow(orbit, {F: 0.5}, steps=Steps(first=0.1))
    assert entered(lambda: follow(orbit, {F: 0.5}, steps=Steps(first=0.1)), "pwsmooth/solving.py") == []


def test_a_start_that_needs_a_look_gets_one_behind_the_door_too():
    level = sp.Symbol("level", nonnegative=True)
    swing = System({level: v, v: -level})
    run = behind_the_door(swing)
    assert run(swing, (0.0, 1.0), [-7e-18, 1.0])["level"][0] == 0
    with pytest.raises(ValueError, match="declared nonnegative"):
        run(swing, (0.0, 1.0), [-1.0, 1.0])
    for start in ([math.nan, 1.0], [math.inf, -math.inf]):
        with pytest.raises(ValueError, match="finite number"):
            behind_the_door(block())(block(), (0.0, 1.0), start)
    with pytest.raises(ValueError, match="`t_span` is"):
        run(swing, (1.0, 1.0), [1.0, 1.0])


def test_a_map_is_pickled_and_copied_without_what_it_has_prepared():
    orbit = find_orbit(block(), START, seen=Strobe(sp.pi))
    assert orbit.map._inner
    again = pickle.loads(pickle.dumps(orbit.map))
    assert not again._inner and np.array_equal(again(orbit.x), orbit.map(orbit.x))
    assert copy.deepcopy(orbit.map)._inner is orbit.map._inner


def test_a_cost_is_lowered_once_for_a_system_at_any_values(monkeypatch):
    mu = sp.Symbol("mu", positive=True)
    body = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})
    lowered, lower = [], objectives._lowered
    monkeypatch.setattr(objectives, "_lowered", lambda *given: lowered.append(given) or lower(*given))
    stop = event_time("sgn(v)", "stick")
    for friction, speed in ((2.0, 4.0), (1.0, 3.0)):
        changed = body.with_parameters({mu: friction})
        value, gradient = value_and_gradient(changed, stop, (0, 9), {x: 0, v: speed}, by=[mu, "v"])
        assert value == pytest.approx(speed / friction)
        assert gradient == pytest.approx([-speed / friction**2, 1 / friction])
    assert len(lowered) == 1
    value_and_gradient(body, final(x), (0, 9), {x: 0, v: 4}, by=[mu])
    assert len(lowered) == 2
    pickle.loads(pickle.dumps(body))  # without what this process keeps of it
