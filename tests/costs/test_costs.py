"""Gradients of costs, backward through the events of a run: closed forms, differences, an optimum.

Guards: costs/reading.py, kernels/tangent/reverse.py.
"""

import numpy as np
import pytest
import scipy.optimize
import sympy as sp

from pwsmooth import Event, Memory, Switch, System, Unilateral, sweep
from pwsmooth.costs import (
    Objective,
    at,
    at_event,
    duration,
    event_time,
    final,
    integral,
    largest,
    misfit,
    smallest,
    value_and_gradient,
)  # fmt: skip
from pwsmooth.costs import objective as objectives
from pwsmooth.paths.derivatives.of_solution import NoDerivative
from pwsmooth.paths.event_driven import EventDriven
from pwsmooth.studies import Cost

t, x, y, v, w, z = sp.symbols("t x y v w z", real=True)
e, g, rho, beta, sigma, omega = sp.symbols("e g rho beta sigma omega", positive=True)
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
LAM = Switch("lam", v)
TIMES = np.linspace(0.5, 11.5, 30)


def friction(cost, until=12):
    system = System(
        {
            y: v,
            v: -2.4 * sp.sin(omega * t) - sigma * y - v / 10 - LAM * (1 + z),
            z: (rho * (1 - LAM**2) - z) / beta,
        },
        time=t,
        parameters={rho: 3, beta: 0.1, sigma: 3.1, omega: 1},
    )
    quantities = [rho, sigma, omega, "y", "z", "t0"]
    return Objective(system, cost, (0, until), {y: 0.5, v: 0.3, z: 0}, quantities, **TIGHT)


GROUND = Unilateral(x, restitution=e, name="R")
BALL = System({x: w, w: -g + GROUND.reaction}, parameters={g: 9.8, e: 0.8})


def ball(cost):
    return Objective(BALL, cost, (0, 9), {x: 50, w: 0}, ["x", g, e], **TIGHT)


def by_differences(objective, h=1e-4):
    columns = []
    for k in range(len(objective.start)):
        step = np.zeros(len(objective.start))
        step[k] = h

        def central(s):
            return (objective(objective.start + s).value - objective(objective.start - s).value) / 2

        columns.append((4 * central(step / 2) * 2 - central(step)) / (3 * h))
    return np.array(columns)


@pytest.mark.parametrize(
    "cost",
    [
        integral(y**2 + LAM * v),
        final(y * v * rho),
        at(LAM * (1 + z) + sp.sin(omega * t), 7.123),
        event_time("lam", "stick"),
        at_event(y * t * omega, LAM, "stick"),
        largest(y),
        smallest(y * v),
        largest(v, 1, 3),
        duration(LAM),
        misfit(y + v * rho / 10, TIMES, np.where(TIMES < 6, np.sin(TIMES), np.nan), 0.3),
        rho**2 * integral(v**2) * final(y) + sigma * largest(y, 2.0, 5.0) - sp.exp(-event_time(LAM, number=2)),
    ],
    ids=lambda cost: str(cost)[:30],
)
def test_every_quantity_of_a_hidden_friction_oscillator(cost):
    objective = friction(cost)
    value, gradient = objective(objective.start)
    expected = by_differences(objective)
    assert np.isfinite(value) and np.abs(expected).max() > 1e-3
    assert gradient == pytest.approx(expected, abs=3e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    "cost",
    [
        at_event(w, "R", after=True), at_event(w**2 * g, "R"), largest(x, 3.5, 8.2), event_time("R", number=1),
        integral(x * w**2), smallest(x * w),
    ],
    ids=str,
)  # fmt: skip
def test_every_quantity_of_a_bouncing_ball(cost):
    objective = ball(cost)
    _, gradient = objective(objective.start)
    assert gradient == pytest.approx(by_differences(objective), rel=2e-7, abs=1e-7)


def test_closed_forms_of_the_ball():
    fall = np.sqrt(2 * 50 / 9.8)
    value, gradient = value_and_gradient(
        BALL, event_time("R", number=1), (0, 9), {x: 50, w: 0}, by=["x", g, e], **TIGHT
    )
    assert value == pytest.approx(2.6 * fall, rel=1e-13)
    assert gradient == pytest.approx([2.6 * fall / 100, -2.6 * fall / 19.6, 2 * fall], rel=1e-12)
    for sign, extreme in ((1, largest), (-1, smallest)):
        highest, slopes = ball(extreme(sign * x, 4.0, 8.0))([50, 9.8, 0.8])
        assert sign * highest == pytest.approx(0.64 * 50, rel=1e-13)
        assert sign * slopes == pytest.approx([0.64, 0.0, 2 * 0.8 * 50], rel=1e-11, abs=1e-11)


def test_an_optimum_through_the_switching():
    # x' in 2 - sgn x: 3 below 0, 1 above. From x0 < 0 it crosses at -x0/3, ends in 2 + x0/3, and the cost
    # (2 + x0/3 - 5/3)**2 + |x0|**3/9 + (2 + x0/3)**3/3 has its only stationary point in [-2, -1] where
    # 2/3 (1/3 + x0/3) - x0**2/3 + (2 + x0/3)**2/3 = 0, that is 8 x0**2 - 18 x0 - 42 = 0.
    best = (18 - np.sqrt(18**2 + 4 * 8 * 42)) / 16
    system = System({x: 2 - sp.sign(x)})
    cost = (final(x) - sp.Rational(5, 3)) ** 2 + integral(x**2)
    for start in (-2.0, -1.0):
        objective = Objective(system, cost, (0, 2), {x: start}, ["x"], **TIGHT)
        calls = []

        def both(q, objective=objective, calls=calls):
            calls.append(q)
            return objective(q)

        found = scipy.optimize.minimize(
            both, [start], jac=True, bounds=[(-2, -1)], method="L-BFGS-B", options={"ftol": 0, "gtol": 1e-12}
        )
        assert found.x[0] == pytest.approx(best, abs=1e-10) and len(calls) <= 15


def test_a_run_in_parts_gives_what_the_whole_one_gives(monkeypatch):
    """Long runs keep checkpoints alone, and are run again part by part on the way back."""
    times = np.linspace(0.0, 300.0, 301)
    cost = (
        integral(y**2 + LAM * v) / 100 + final(y * v * rho) + at(LAM * (1 + z), 250.3) - event_time("lam", "stick", 40)
        + at_event(y * t * omega, LAM, "crossing", 35) / 100 + largest(y) + smallest(v, 100, 211)
        + duration(LAM) / 100 + misfit(y + v * rho / 10, times, np.sin(times), 30.0)
    )  # fmt: skip
    whole = friction(cost, 300)
    value, gradient = whole(whole.start)
    cut, begun = objectives._Cut, []
    monkeypatch.setattr(objectives, "_MOST", 0)
    monkeypatch.setattr(objectives, "_Cut", lambda *given: begun.append(cut(*given)) or begun[-1])
    parts = friction(cost, 300)
    monkeypatch.setattr(EventDriven, "first_record", lambda self, times=None: self._record(150))
    found = parts(parts.start)
    assert len(begun[0].begun) > 8
    assert found.value == pytest.approx(value, rel=1e-13)
    assert np.abs(found.gradient - gradient).max() <= 1e-11 * np.linalg.norm(gradient)
    ambiguous = System({x: sp.cos(t), w: sp.sign(x + 1)}, time=t)  # touches its surface every period
    with pytest.raises(NoDerivative, match=r"t = 4\.71"):
        value_and_gradient(ambiguous, final(w), (0, 900), {x: 0, w: 0}, by=["x"])


def test_a_sweep_measures_costs():
    times = np.linspace(0, 12, 13)
    cost = rho * integral(y**2 + LAM * v) + largest(y) + duration(LAM) - event_time("lam", "stick") + at(v, 5.0)
    cost = cost + misfit(y, times, np.sin(times)) + final(z)
    objective = friction(cost)
    system = objective._system
    measures = [Cost("J", cost), "extremes(y)"]
    found = sweep(
        system, {"sigma": [3.1, 3.2]}, x0={"y": 0.5, "v": 0.3, "z": 0} | dict.fromkeys(system.states[3:], 0.0),
        t_span=(0, 12), measures=measures, **TIGHT,
    )  # fmt: skip
    start = objective.start
    expected = [objective.value(np.where(np.array(objective.names) == "sigma", s, start)) for s in (3.1, 3.2)]
    assert found["J"].values == pytest.approx(expected, rel=1e-12)
    assert objective(start).value == expected[0]
    # Equal names, other data: another sweep.
    assert repr(Cost("J", misfit(y, times, times))) != repr(Cost("J", misfit(y, times, 2 * times)))
    with pytest.raises(ValueError, match="reads nothing of the run"):
        Cost("J", x + 1)
    running = objective.solve(start)["integral(lam*v + y**2)"]
    assert running[0] == 0 and running[-1] == pytest.approx(
        friction(integral(y**2 + LAM * v)).value(start), rel=1e-12
    )


def test_a_memory_is_named_by_itself_or_as_a_state():
    m = Memory("m", 0.2)
    system = System({x: -x + m}, events=[Event(at=[1], update={m: m + x})])
    gradients = [
        value_and_gradient(system, final(x) * final(of), (0, 2), {x: 1}, by=["x", "m"]).gradient
        for of in (m, system.states[-1])
    ]
    assert np.array_equal(*gradients) and gradients[0].all()


def test_what_has_no_gradient_says_so():
    objective = friction(event_time("lam", "stick", 7))
    with pytest.raises(NoDerivative, match="does not happen"):
        objective(objective.start)
    corner = System({x: -1, y: -1, z: sp.sign(x) + sp.sign(x + y) * sp.sign(y)})
    with pytest.raises(NoDerivative, match="several surfaces"):
        value_and_gradient(corner, final(z), (0, 3), {x: 1, y: 1, z: 0}, by=["x"], **TIGHT)
    held = System({x: -2 * sp.sign(x) + y, y: -y})
    with pytest.raises(NoDerivative, match="x leads out"):
        value_and_gradient(held, final(y), (0, 1), {x: 0, y: 1}, by=["x"], **TIGHT)


@pytest.mark.parametrize(
    ("cost", "message"),
    [(x**2, "names x"), (sp.Integer(3), "reads nothing"), ("final", "cost")],
)
def test_costs_are_refused_at_the_door(cost, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Objective(System({x: -sp.sign(x)}), cost, (0, 1), {x: 1}, ["x"])


def test_data_are_refused_at_the_door():
    with pytest.raises(ValueError, match="one length"):
        misfit(x, [0, 1], [1.0])
    with pytest.raises(ValueError, match="one length"):
        misfit(x, [1, 0], [1.0, 2.0])
    with pytest.raises(ValueError, match="positive"):
        misfit(x, [0, 1], [1.0, 2.0], 0.0)
    with pytest.raises(ValueError, match="outside the span"):
        friction(at(y, 13.0))([3, 3.1, 1, 0.5, 0, 0])
