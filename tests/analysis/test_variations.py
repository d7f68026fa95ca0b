"""Fundamental matrices, saltation matrices included, against differences of the flow itself.

Guards: analysis/maps/, paths/derivatives/linearised.py, paths/derivatives/collocation.py, kernels/tangent/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z

from pwsmooth import Algebraic, Event, Family, Memory, Switch, System, Unilateral, solve
from pwsmooth.analysis.maps.first_order import variations

T = 2 * math.pi
TIGHT = dict(rtol=1e-12, atol=1e-14)
STEP = 1e-5
# Central differences: truncation STEP**2 |P'''|/6 and, larger, the flow's own error of some 1e-13 over STEP.
# A hundred of those are left for derivatives of size 10 and third ones of size 1e3.
DIFFERENCE = 1e-6

t, x, u, w = sp.symbols("t x u w", real=True)
a, b = sp.symbols("a b", positive=True)


def differences(system, span, start, names, **options):
    """d x(end)/d x(start) and d x(end)/d q by central differences of solve()."""

    def end(at, values=None):
        solution = solve(system, span, list(at), parameters=values, **TIGHT | options)
        assert solution.success
        return solution.x[:, -1]

    def slope(high, low):
        return (high - low) / (2 * STEP)

    values = {str(p): value for p, value in system.parameters.items()}
    start = np.array(start, float)
    by_state = [slope(end(start + STEP * e), end(start - STEP * e)) for e in np.eye(len(start))]
    by_parameter = [slope(end(start, {q: values[q] + STEP}), end(start, {q: values[q] - STEP})) for q in names]
    return np.array(by_state).T, np.array(by_parameter).reshape(len(names), len(start)).T


def agree(system, span, start, names=(), *, kinds=None, **options):
    solution = solve(system, span, list(start), dense_output=True, **TIGHT | options)
    if kinds is not None:
        assert [e.kind for e in solution.events] == kinds
    moved = variations(solution, names)
    by_state, by_parameter = differences(system, span, start, names, **options)
    scale = 1 + np.abs(by_state).max() + np.abs(by_parameter).max(initial=0)
    assert np.abs(moved.matrix - by_state).max() < DIFFERENCE * scale
    if len(names):
        assert np.abs(moved.by_parameter - by_parameter).max() < DIFFERENCE * scale
    return moved


def test_crossings():
    agree(coulomb(), (0, T), (0.5, 0.3), ("sigma", "k", "omega"), kinds=["crossing"] * 3)


def test_a_stick_left_by_tangency_in_the_relaxing_regime():
    kinds = ["stick", "slip by tangency", "crossing"]
    moved = agree(hidden(), (0, T), (0.6, -1.07, 0.01), ("sigma", "rho", "beta", "omega"), kinds=kinds)
    # The stick has taken one direction away: the two others come from y and z alone.
    assert np.linalg.svd(moved.matrix)[1][-1] < 1e-12


def test_sticks_left_by_folds():
    slaved = hidden().layered({z: sp.oo})
    kinds = ["stick", "slip by fold"] * 2
    agree(slaved, (0, T), (0.78, -1.03), ("sigma", "rho", "omega"), kinds=kinds)


def test_the_two_stage_limit():
    agree(hidden().layered({z: 0}), (0, T), (0.6, -1.07), ("sigma", "rho"))


def test_jumps_from_one_sliding_branch_to_another():
    # mu(lam) has its folds at lam = 0.4 and 0.7 and rises to 6.2: a force of 3 drives it through both, and back.
    lam = Switch("lam", x)
    mu = 100 * (lam**5 / 5 - sp.Rational(65, 300) * lam**3 + sp.Rational(784, 10000) * lam)
    system = System({x: 3 * sp.sin(a * t) + w / 5 - mu, w: lam - w / 5}, time=t, parameters={a: 1.0})
    moved = agree(system, (0, 6), (0.1, 0.2), ("a",))
    assert [s.kinds for s in moved.saltations].count(("sliding to sliding",)) == 4


@pytest.mark.parametrize("restitution", [0.8, 0.0])
def test_impacts(restitution):
    wall = Unilateral(x + sp.Rational(3, 10) * a, restitution=restitution, name="R")
    system = System({x: u, u: -x - u / 10 + sp.cos(b * t) + wall.reaction}, time=t, parameters={a: 1.0, b: 1.3})
    agree(system, (0, 5), (0.1, -0.5), ("a", "b"))


def test_chattering_to_rest_takes_both_directions_of_the_contact_away():
    floor = Unilateral(x - a * sp.sin(t), restitution=sp.Rational(1, 2), name="R")
    system = System({x: u, u: -5 + floor.reaction}, time=t, parameters={a: 1.5})
    moved = agree(system, (0, 6), (0.6, 0.0), ("a",))
    assert any("accumulation" in s.kinds for s in moved.saltations)
    assert np.abs(moved.matrix).max() < 1e-10 and moved.degenerate == []


def test_an_algebraic_unknown():
    force = sp.Symbol("force", real=True)
    law = Algebraic(force, force + a * sp.tanh(force) * sp.exp(-(u**2)) + x - sp.cos(t))
    agree(System({x: u, u: force}, time=t, parameters={a: 0.3}, algebraic=[law]), (0, 5), (0.3, 0.2), ("a",))


def test_a_looped_family():
    elements = Family(9)
    (f,) = elements.symbols("f")
    stiffness, strength = elements.symbols("stiffness strength", positive=True)
    relay = stiffness * u - sp.sign(f - strength) / 10
    system = System(
        {f: relay, x: u, u: sp.cos(2 * t) - x - elements.sum(f)},
        time=t,
        parameters={stiffness: [0.5 / i for i in range(1, 10)], strength: 0.05},
    )
    moved = agree(system, (0, 3), [0.02 * i for i in range(9)] + [0.3, 0.1])
    assert any(kinds in (("crossing",), ("stick",)) for kinds in (s.kinds for s in moved.saltations))


def test_resets_and_memories_carry_their_deviation():
    latch = Memory("latch", 0.3)
    system = System(
        {x: u, u: -x - a * latch}, time=t, parameters={a: 0.4, b: 0.2},
        events=[Event(x - b * latch, direction=1, update={latch: u / 2 + b, u: sp.Rational(9, 10) * u})],
    )  # fmt: skip
    agree(system, (0, 9), (0.5, 0.1, 0.3), ("a", "b"), kinds=["reset"] * 2)


def test_the_instants_of_a_clock_move_with_its_period():
    system = System(
        {x: u, u: -x}, time=t, parameters={a: 0.7, b: 0.2},
        events=[Event(every=a, update={u: u * (1 - b) + b * x * t})],
    )  # fmt: skip
    agree(system, (0, 3), (0.5, 0.1), ("a", "b"))


def test_branches_that_do_not_exist_on_the_other_side_stay_out_of_the_derivative():
    depth = sp.Max(0, -x)
    system = System({x: u, u: -1 + a * depth ** sp.Rational(3, 2)}, time=t, parameters={a: 50.0})
    agree(system, (0, 4), (1.0, 0.0), ("a",))


def test_several_switches_one_of_them_sliding_when_the_other_crosses():
    system = System(
        {x: u, u: -x - sp.sign(u) + 2 * sp.cos(t) + w / 2, w: x - a * sp.sign(w + x)},
        time=t, parameters={a: 0.6},
    )  # fmt: skip
    moved = agree(system, (0, 8), (0.7, 0.2, 0.4), ("a",))
    assert len({s.kinds for s in moved.saltations}) >= 2


@pytest.mark.parametrize("sigmoid", ["algebraic", "tanh"])
@pytest.mark.parametrize("eps", [0.1, 1e-3])
def test_the_smoothed_system(eps, sigmoid):
    system = hidden().smoothed(eps=eps, sigmoid=sigmoid)
    agree(system, (0, T), (0.5, 0.3, 0.0), ("sigma", "rho"))


def test_a_start_that_sticks_moves_along_its_surface_only():
    moved = variations(solve(hidden(), (1.8, 2.0), {y: -1.0, v: 0, z: 0.5}, dense_output=True))
    assert np.array_equal(moved.matrix[:, 1], np.zeros(3))
    assert np.abs(moved.matrix[1]).max() < 10 * np.finfo(float).eps
    assert moved.matrix[0] == pytest.approx([1, 0, 0], abs=1e-15)


def test_two_switchings_at_one_instant_are_said_to_have_no_derivative():
    system = System({x: -sp.sign(x) - 2, u: -sp.sign(u) - 2})
    moved = variations(solve(system, (0, 1), {x: 1, u: 1}, dense_output=True))
    assert len(moved.degenerate) == 1 and "corner" in moved.degenerate[0]


RINGS = {x: sp.cos(t) - x / 5, u: x / 4 - u / 3}


@pytest.mark.parametrize(
    "events",
    [
        [Event(every=1, update={x: x / 2 + u / 3}), Event(every=1, update={u: u / 2 - x / 4})],
        [
            Event(x - sp.Rational(1, 2), update={x: x - u}),
            Event(x - sp.Rational(1, 2), update={u: u * x / 2 + 1}),
        ],
        # The first one's jump fires the second, which reads what it has left.
        [
            Event(x - sp.Rational(1, 2), direction=1, update={x: x * u / 3, u: u + 2}),
            Event(u - 2, direction=1, update={u: u * x - 1}),
        ],
    ],
    ids=["clock", "one surface", "one after the other"],
)
def test_events_of_one_round_act_on_the_values_before_it(events):
    moved = agree(System(RINGS, time=t, events=events), (0.5, 2.5), (0.45, 0.8))
    assert any(s.kinds.count("reset") == 2 for s in moved.saltations) and not moved.degenerate


@pytest.mark.parametrize(
    ("system", "start"),
    [
        (
            System(
                {x: 1, u: 1}, events=[Event(x - 1, update={x: u / 2 - 1}), Event(u - 1, update={u: -x / 3})]
            ),
            (0.2, 0.2),
        ),
        (
            System({x: 1 + sp.Heaviside(u - 1), u: 1}, time=t, events=[Event(every=1, update={x: x / 2 - 1})]),
            (0.2, 0.5),
        ),
    ],
    ids=["two surfaces", "a clock and a surface"],
)
def test_events_that_meet_by_chance_are_a_corner_also_when_they_jump(system, start):
    span = (0.5, 1.7) if system.model.events[0].every is not None else (0, 1.2)
    moved = variations(solve(system, span, list(start), dense_output=True))
    assert len(moved.degenerate) == 1 and "corner" in moved.degenerate[0]


def test_updates_whose_joint_effect_is_not_known_have_no_derivative_or_the_right_one():
    events = [Event(every=1, update={x: x + u}), Event(every=1, update={x: x + 2 * u})]
    system = System(RINGS, time=t, events=events)
    moved = variations(solve(system, (0.5, 1.5), [0.45, 0.8], dense_output=True, **TIGHT))
    by_state, _ = differences(system, (0.5, 1.5), (0.45, 0.8), ())
    assert moved.degenerate or np.abs(moved.matrix - by_state).max() < DIFFERENCE


def test_fifty_events_at_one_instant_are_gone_through_in_no_time():
    events = [Event(every=1, update={x: x + u / k}) for k in range(1, 51)]
    run = solve(System(RINGS, time=t, events=events), (0.5, 1.5), [0.45, 0.8], dense_output=True)
    assert len(variations(run).saltations[0].kinds) == 50


def latched():
    """A clock, a reset, a memory and an impact."""
    held, wall = (
        Memory("held", 0.3),
        Unilateral(x + sp.Rational(4, 5), restitution=sp.Rational(7, 10), name="R"),
    )
    return System(
        {x: u, u: -x - a * held + sp.cos(t) + wall.reaction}, time=t, parameters={a: 0.4, b: 0.9},
        events=[Event(every=b, update={held: x / 2}), Event(x - a, direction=-1, update={u: u - b * x})],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("system", "start", "names"),
    [
        (hidden(), (0.6, -1.07, 0.01), ("sigma", "rho", "beta", "omega")),
        (hidden().layered({z: sp.oo}), (0.78, -1.03), ("sigma", "omega")),
        (latched(), (0.5, 0.1, 0.3), ("a", "b")),
    ],
    ids=["sticks", "folds", "jumps"],
)
def test_a_tape_and_collocation_on_the_dense_output_agree(system, start, names):
    run = solve(system, (0, 2 * T), list(start), dense_output=True, **TIGHT)
    played = variations(run, names)
    run.tape = None
    collocated = variations(run, names)
    # They linearise the same run: what differs is rounding, of some 1e2 steps.
    for one, other in ((played.matrix, collocated.matrix), (played.by_parameter, collocated.by_parameter)):
        assert np.abs(one - other).max() < 1e-12 * (1 + np.abs(other).max())
    assert played.rates.tolist() == collocated.rates.tolist() and not played.degenerate


def test_wanted_times_make_no_difference():
    system, span, start = hidden(), (1.8, 8), (-1.0, 0, 0.5)  # begins in a stick
    plain = variations(solve(system, span, start, dense_output=True), ("sigma",))
    asked = solve(system, span, start, dense_output=True, t_eval=[3, 4])
    moved = variations(asked, ("sigma",))
    for name in ("matrix", "by_parameter", "first_rates", "rates"):
        assert np.array_equal(getattr(moved, name), getattr(plain, name))
    asked.tape = None
    with pytest.raises(ValueError, match="t_eval"):
        variations(asked)


def test_a_run_by_the_pair_has_no_series_to_play_and_moves_the_same():
    moved = agree(coulomb(), (0, T), (0.5, 0.3), ("sigma",), kinds=["crossing"] * 3, method="rk")
    assert [s.kinds for s in moved.saltations] == [("crossing",)] * 3


def test_a_solution_without_step_polynomials_is_refused():
    with pytest.raises(ValueError, match="dense_output=True"):
        variations(solve(coulomb(), (0, 1), {y: 0.5, v: 0.3}))
    with pytest.raises(ValueError, match="'nonsense'"):
        variations(solve(coulomb(), (0, 1), {y: 0.5, v: 0.3}, dense_output=True), ("nonsense",))
