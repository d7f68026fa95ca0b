"""System.from_functions: the same models in Python code and in symbols, and what it refuses.

Guards: codegen/functions.py, definition/functions.py, paths/functions.py.
"""

import math

import numba
import numpy as np
import pytest
import sympy as sp
from friction_oscillator import VALUES, coulomb, hidden, z

from pwsmooth import Event, Kicks, Outcome, Switch, System, find_equilibrium, solve, sweep

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
NAMED = {str(p): value for p, value in VALUES.items()}  # rho, beta, k, c, N, sigma, omega
t, x, v, w = sp.symbols("t x v w", real=True)


def speed(t, x, p):
    return x[1]


def coulomb_rates(t, x, lam, p):
    _, _, k, c, N, sigma, omega = p
    return x[1], -sigma * np.sin(omega * t) - k * x[0] - c * x[1] - N * lam[0]


def hidden_rates(t, x, lam, p):
    rho, beta, k, c, N, sigma, omega = p
    y, v, z = x
    return (
        v,
        -sigma * np.sin(omega * t) - k * y - c * v - N * lam[0] * (1 + rho * z),
        (1 - lam[0] ** 2 - z) / beta,
    )


def slaved_rates(t, x, lam, p):
    rho, _, k, c, N, sigma, omega = p
    friction = N * lam[0] * (1 + rho * (1 - lam[0] ** 2))
    return np.array([x[1], -sigma * np.sin(omega * t) - k * x[0] - c * x[1] - friction])


def relay_rates(t, x, lam, p):
    return (1 - 2 * lam[0],)


def stacked_rates(t, x, lam, p):
    """Two blocks, one on the other: friction between them and below."""
    return 3 * np.sin(t) - lam[0], 0.6 * lam[0] - 0.45 * lam[1]


def coupled_rates(t, x, lam, p):
    """Two relays that act on each other and slide together."""
    return -lam[0] + 0.3 * lam[1] + 0.5, -lam[1] - 0.3 * lam[0] + 0.2


def falling(t, x, lam, p):
    return x[1], -9.81


def tank(t, x, lam, p):
    if x[0] < 0:
        raise ValueError("no tank")
    return (-np.sqrt(x[0]),)


def rebound(t, x, p):
    return x[0], -0.8 * x[1]


def stops(t, x, p):
    return abs(x[1]) < 2.0


def formulas_of_two(a, b, surfaces):
    names = [Switch(f"lam{k}", h) for k, h in enumerate(surfaces, 1)]
    return System({v: a(*names), w: b(*names)}, time=t)


height = Event(lambda t, x, p: x[0], direction=-1, update=rebound, name="floor")
CASES = {
    "Coulomb": (
        lambda: System.from_functions(coulomb_rates, "y v", surfaces={"lam": speed}, parameters=NAMED),
        lambda: coulomb(), (0, 60), {"y": 0.5, "v": 0.3},
    ),
    "hidden static friction": (
        lambda: System.from_functions(hidden_rates, "y v z", surfaces={"lam": speed}, parameters=NAMED),
        lambda: hidden(), (0, 60), {"y": 0.5, "v": 0.3, "z": 0},
    ),
    "hidden static friction, slaved: folds": (
        lambda: System.from_functions(slaved_rates, "y v", surfaces={"lam": speed}, parameters=NAMED),
        lambda: hidden().layered({z: sp.oo}), (0, 60), {"y": 0.5, "v": 0.3},
    ),
    "relay": (
        lambda: System.from_functions(relay_rates, "x", surfaces={"lam": lambda t, x, p: x[0] - 2}),
        lambda: System({x: 1 - 2 * Switch("lam", x - 2)}, time=t), (0, 5), {"x": 0},
    ),
    "two switches": (
        lambda: System.from_functions(
            stacked_rates, "v w", surfaces=[lambda t, x, p: x[0] - x[1], lambda t, x, p: x[1]]
        ),
        lambda: formulas_of_two(
            lambda a, b: 3 * sp.sin(t) - a, lambda a, b: 0.6 * a - 0.45 * b, (v - w, w)
        ),
        (0, 20), {"v": 1, "w": 0.2},
    ),
    "two that slide together": (
        lambda: System.from_functions(
            coupled_rates, "v w", surfaces=[lambda t, x, p: x[0], lambda t, x, p: x[1]]
        ),
        lambda: formulas_of_two(
            lambda a, b: -a + 0.3 * b + 0.5, lambda a, b: -b - 0.3 * a + 0.2, (v, w)
        ),
        (0, 4), {"v": 1, "w": -0.4},
    ),
    "bouncing ball": (
        lambda: System.from_functions(
            falling, "x v",
            events=[height, Event(lambda t, x, p: x[0], when=stops, terminal=True, name="rest")],
        ),
        lambda: System(
            {x: v, v: -9.81},
            events=[Event(x, direction=-1, update={v: -0.8 * v}, name="floor"),
                    Event(x, when=sp.Abs(v) < 2, terminal=True, name="rest")],
        ),
        (0, 9), {"x": 1, "v": 0},
    ),
    "a clock that kicks": (
        lambda: System.from_functions(
            lambda t, x, lam, p: (x[1], -x[0] - p[0] * lam[0]), ["x", "v"], surfaces={"lam": speed},
            parameters={"F": 0.2}, events=[Event(every=1.5, update=lambda t, x, p: (x[0], x[1] + 0.7))],
        ),
        lambda: System(
            {x: v, v: -x - sp.Symbol("F", real=True) * Switch("lam", v)}, parameters={"F": 0.2},
            events=[Event(every=1.5, update={v: v + 0.7})],
        ),
        (0, 12), {"x": 1, "v": 0},
    ),
}  # fmt: skip


def statuses(solution):
    """The itinerary in statuses: formulas know slip velocities by name, functions do not."""
    return [tuple(segment.status) for segment in solution.segments]


@pytest.mark.parametrize("case", CASES)
def test_a_model_runs_alike_in_functions_and_in_symbols(case):
    ours, theirs, span, start = CASES[case]
    run = solve(ours(), span, start, **TIGHT)
    reference = solve(theirs(), span, start, **TIGHT)
    assert run.outcome == reference.outcome
    assert statuses(run) == statuses(reference)
    assert [(e.switch, e.kind) for e in run.events] == [(e.switch, e.kind) for e in reference.events]
    assert len(run.events) > 1 or case == "relay"
    assert np.allclose([e.time for e in run.events], [e.time for e in reference.events], rtol=0, atol=1e-9)
    assert np.allclose(run.x[:, -1], reference.x[:, -1], rtol=0, atol=1e-9)


def test_a_curved_surface_is_slid_on():
    """x' = pushed on to the circle |x| = 1, along which it turns with speed 1."""

    def rates(t, x, lam, p):
        return -x[1] - lam[0] * x[0], x[0] - lam[0] * x[1]

    circle = System.from_functions(rates, "x y", surfaces=[lambda t, x, p: x[0] ** 2 + x[1] ** 2 - 1])
    run = solve(circle, (0, 3), [2, 0], **TIGHT)
    assert run.event_times("stick") == pytest.approx([np.log(2)], abs=1e-11)  # |x| = 2 exp(-t)
    assert np.abs(run["x"] ** 2 + run["y"] ** 2 - 1)[run.t > 1].max() < 1e-14
    assert run.x[:, -1] == pytest.approx([np.cos(3), np.sin(3)], abs=1e-10)


def test_a_surface_that_moves_with_time_is_slid_on():
    drift = System.from_functions(
        lambda t, x, lam, p: (-p[0] * lam[0],),
        "x",
        surfaces=[lambda t, x, p: x[0] - np.sin(t)],
        parameters={"a": 2},
    )
    run = solve(drift, (0, 7), [1.5], t_eval=np.linspace(2, 7, 40), **TIGHT)
    assert np.allclose(run["x"], np.sin(run.t), atol=1e-14)
    assert np.allclose(run["lam"], -np.cos(run.t) / 2, atol=1e-12)


def test_numbas_own_functions_serve_and_parameters_change_nothing_compiled():
    block = System.from_functions(
        numba.njit(coulomb_rates), "y v", surfaces=[numba.njit(speed)], parameters=NAMED
    )
    pushed = solve(block, (0, 20), [0.5, 0.3], parameters={"sigma": 0.2}, **TIGHT)
    reference = solve(coulomb(sigma=0.2), (0, 20), [0.5, 0.3], **TIGHT)
    assert pushed.t[-1] == reference.t[-1] and np.allclose(pushed.x[:, -1], reference.x[:, -1], atol=1e-9)
    assert block.with_parameters({"sigma": 0.2}).model.functions is block.model.functions


def test_what_solutions_show_is_shown():
    block = System.from_functions(coulomb_rates, "y v", surfaces=[speed], parameters=NAMED)
    run = solve(block, (0, 5), [0.5, 0.3], dense_output=True)
    assert "System of functions with states y, v" in repr(block)
    assert run(2.0)[1] == pytest.approx(run(2.0, "v"))
    assert "lam" in run.to_dataset() and len(run.plot()) >= 2


BAD = {
    "no function": (dict(f=3), TypeError, r"`f` is 3; give a function of \(t, x, lam, p\)"),
    "arguments": (dict(f=lambda t, x: (x[0],)), TypeError, r"`f` is no function of \(t, x, lam, p\)"),
    "too few rates": (dict(f=lambda t, x, lam, p: (x[0], 1.0), states="a b c"), ValueError, "2 values for 3 states"),
    "no vector": (dict(f=lambda t, x, lam, p: x[0]), TypeError, "`f` returns float64; give a tuple of 1"),
    "not numba's": (dict(f=lambda t, x, lam, p: (str(x[0]).nothing,)), TypeError, "cannot be compiled by numba"),
    "writes": (dict(f=lambda t, x, lam, p: (x.fill(0.0), 1.0)), TypeError, "cannot be compiled by numba"),
    "a surface of math": (
        dict(surfaces=[lambda t, x, p: math.sin(x[0])]), TypeError, "does not compile for complex numbers",
    ),
    "a surface that compares": (
        dict(surfaces=[lambda t, x, p: x[0] if x[0] > 0 else 2 * x[0]]), TypeError, "without abs, comparisons",
    ),
    "a surface of abs": (dict(surfaces=[lambda t, x, p: abs(x[0])]), TypeError, "leave out abs, real"),
    "a surface with abs": (
        dict(surfaces=[lambda t, x, p: x[0] * abs(x[0])]), ValueError, "other slopes by a complex step",
    ),
    "a vector for a surface": (dict(surfaces=[lambda t, x, p: (x[0], 1.0)]), TypeError, "returns UniTuple.* a number"),
    "names": (dict(states="x x"), ValueError, "x is given twice"),
    "no names": (dict(states=""), ValueError, "`states` is empty"),
    "a formula": (dict(events=[Event(x, update={x: 1})]), TypeError, "is a formula"),
    "an update": (
        dict(events=[Event(every=1, update=lambda t, x, p: (1.0, 2.0))]), ValueError, "2 values for 1 states",
    ),
    "an index beyond": (dict(surfaces=[speed]), ValueError, "not fit the lengths of its arguments, 1 in x, 0 in p"),
    "an unpacking": (dict(f=coulomb_rates, states="y v"), ValueError, "lengths of its arguments, 2 in x, 0 in lam"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_functions_are_refused_with_what_is_wrong(case):
    given, error, words = BAD[case]
    good = dict(f=lambda t, x, lam, p: (-x[0],), states="x")
    with pytest.raises(error, match=words):
        System.from_functions(**(good | given))


# What compiled code raises is told and goes no further.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_what_is_not_finite_at_the_start_is_refused_and_later_an_outcome():
    root = System.from_functions(lambda t, x, lam, p: (1 - 2 * np.sqrt(x[0] - t),), "x")
    with pytest.raises(ValueError, match="the rate of x is nan at the start, t = 0"):
        solve(root, (0, 1), [-1])
    with pytest.raises(ValueError, match=r"`f` raises ValueError\('no tank'.*\) at the start"):
        solve(System.from_functions(tank, "level"), (0, 1), [-1])
    emptied = solve(System.from_functions(tank, "level"), (0, 4), [1])
    assert not emptied.success and emptied.t[-1] == pytest.approx(2, abs=1e-5)
    run = solve(System.from_functions(lambda t, x, lam, p: (x[0] ** 2,), "x"), (0, 2), [1])
    assert run.outcome in (Outcome.STEP_UNDERFLOW, Outcome.NOT_FINITE)
    assert run.t[-1] == pytest.approx(1, abs=1e-6)
    with pytest.raises(ValueError, match="returns 2 rates for 1 states"):
        solve(System.from_functions(lambda t, x, lam, p: np.array([x[0], x[0]]), "x"), (0, 1), [1])


def test_what_needs_formulas_is_refused_by_name():
    block = System.from_functions(coulomb_rates, "y v", surfaces=[speed], parameters=NAMED)
    start = {"y": 0.5, "v": 0.3}
    for options, words in (
        ({"method": "stiff"}, "`method` is 'stiff'"),
        ({"method": "taylor"}, "`method` is 'taylor'"),
        ({"noise": Kicks(0.1, every=1, on="v")}, "`noise` is given"),
        ({"by": ["k"]}, "`by` is given"),
    ):
        with pytest.raises(ValueError, match=words + " for a system of functions"):
            solve(block, (0, 1), start, **options)
    with pytest.raises(ValueError, match="`t_span` decreases for a system of functions"):
        solve(block, (1, 0), start)
    for ask in (
        lambda: block.smoothed(1e-3),
        lambda: block.layered({"v": 1}),
        lambda: block.hidden_terms,
        lambda: find_equilibrium(block, start),
        lambda: sweep(block, {"k": [1.0]}, x0=start, t_span=(0, 1), measures=["counts"]),
        lambda: solve(block, (0, 1), start).save("nowhere.zip"),
    ):
        with pytest.raises(TypeError, match="made of functions"):
            ask()
    with pytest.raises(TypeError, match="belongs to System.from_functions"):
        System({x: 1}, events=[height])
