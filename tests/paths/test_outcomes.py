"""Numerical failures are outcomes: the text says what to try, the partial solution is kept, nothing is raised.

And what a run may stop at or must say: terminal events, ambiguities, layers that never come to rest.

Guards: kernels/outcome.py, kernels/instant/other_motions.py, kernels/instant/twofolds.py,
kernels/surface/layer.py, paths/words.py.
"""

import inspect
import math
import re

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Memory, Outcome, Switch, System, Unilateral, solve

t, x, y, v, z = sp.symbols("t x y v z", real=True)
l1, l2 = Switch("l1", x), Switch("l2", y)
BREAKDOWNS = Outcome.NOT_FINITE, Outcome.STEP_UNDERFLOW
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


def stopped(solution, outcome):
    """The solution ended as said, and is whole up to there."""
    assert solution.outcome is outcome
    assert solution.success == (outcome >= 0)
    assert len(solution.t) >= 1 and np.isfinite(solution.x).all()
    assert np.all(np.diff(solution.t) >= 0)
    named = re.search(
        "goes to infinity|rate of .* is .* at t = ", solution.message
    )  # a breakdown with a known cause
    assert outcome.text in solution.message or (outcome in BREAKDOWNS and named)
    assert repr(solution) and solution.segments
    return solution


# ---- the right-hand side fails


@METHODS
def test_a_right_hand_side_that_ceases_to_be_defined_keeps_what_came_before(method):
    # x' = -1 - sqrt(x) reaches 0 at t = 2 - 2 ln 2, from int dx/(1 + sqrt x) over [0, 1]
    solution = stopped(
        solve(System({x: -1 - sp.sqrt(x)}), (0, 5), {x: 1}, method=method), Outcome.SINGULAR_POINT
    )
    assert solution.t[-1] == pytest.approx(2 - 2 * math.log(2), abs=1e-6)
    assert solution.x[0, 0] == 1.0 and abs(solution.x[0, -1]) < 1e-6


@METHODS
def test_a_right_hand_side_that_is_not_defined_at_the_start_gives_the_start(method):
    solution = stopped(solve(System({x: sp.sqrt(x)}), (0, 5), {x: -1}, method=method), Outcome.SINGULAR_POINT)
    assert solution.t.tolist() == [0.0] and solution.x.tolist() == [[-1.0]]


def test_a_division_by_zero_at_the_start_is_no_exception():
    stopped(solve(System({x: 1 / x}), (0, 5), {x: 0}), Outcome.SINGULAR_POINT)


@METHODS
def test_a_blow_up_in_finite_time_is_a_step_underflow_at_that_time(method):
    # x = 1/(1 - t); an error rtol in x moves the pole by about rtol
    solution = stopped(solve(System({x: x**2}), (0, 5), {x: 1}, method=method), Outcome.STEP_UNDERFLOW)
    assert solution.t[-1] == pytest.approx(1.0, abs=1e-8)
    middle = solution.t < 0.9
    assert solution.x[0, middle] == pytest.approx(1 / (1 - solution.t[middle]), rel=1e-8)
    assert solution.cost["steps"] < 1000


def test_a_blow_up_of_a_smoothed_view_is_a_step_underflow():
    # x' = x^2 + 1: x = tan(t + pi/4), with a pole at pi/4
    view = System({x: x**2 + sp.sign(x)}).smoothed(1e-6)
    solution = stopped(solve(view, (0, 5), {x: 1}), Outcome.STEP_UNDERFLOW)
    assert solution.t[-1] == pytest.approx(math.pi / 4, abs=1e-7)


@pytest.mark.parametrize("wanted", [[0.25, 0.5, 2, 3], [2, 3]])
def test_wanted_times_that_were_not_reached_give_way_to_where_it_stopped(wanted):
    solution = stopped(solve(System({x: x**2}), (0, 5), {x: 1}, t_eval=wanted), Outcome.STEP_UNDERFLOW)
    assert solution.t[:-1].tolist() == [w for w in wanted if w < 1]
    assert solution.t[-1] == pytest.approx(1.0, abs=1e-8) and solution.x[0, -1] > 1e6


@pytest.mark.parametrize("options", [{"max_step": 1e-300}, {"rtol": 1e-300, "atol": 0, "max_steps": 1000}])
def test_demands_that_no_step_can_meet_end_soon(options):
    solution = solve(System({x: v, v: -x}), (0, 5), {x: 1, v: 0}, **options)
    assert solution.outcome in (Outcome.STEP_UNDERFLOW, Outcome.TOO_MANY_STEPS) and not solution.success


# ---- bounds and stops


@METHODS
def test_the_bound_on_steps_stops_with_that_many(method):
    system = System({x: v, v: -x - sp.sign(v) / 10})
    solution = stopped(solve(system, (0, 50), {x: 5, v: 0}, max_steps=7, method=method), Outcome.TOO_MANY_STEPS)
    assert solution.cost["steps"] == 7 and 0 < solution.t[-1] < 50


def test_a_clock_that_ticks_more_often_than_the_bound_on_steps_does_not_fill_the_memory():
    system = System({x: 1}, events=[Event(every=1e-12)])
    solution = stopped(solve(system, (0, 1e6), {x: 0}, max_steps=100), Outcome.TOO_MANY_STEPS)
    assert len(solution.events) == 100


@METHODS
def test_a_terminal_event_is_a_success_and_the_last_column_is_its_state(method):
    system = System({x: v, v: -x}, events=[Event(x, terminal=True, update={v: 0}, name="zero")])
    solution = stopped(solve(system, (0, 50), {x: 5, v: 0}, method=method), Outcome.TERMINATED)
    assert solution.success
    assert [(e.kind, e.switch) for e in solution.events] == [("terminal", "zero")]
    assert solution.t[-1] == pytest.approx(math.pi / 2, abs=1e-8)
    # before and after its update
    assert solution.x[1, -2:] == pytest.approx([-5.0, 0.0], abs=1e-7)


def test_a_terminal_event_ends_the_wanted_times_with_its_state():
    system = System({x: v, v: -x}, events=[Event(x, terminal=True)])
    solution = solve(system, (0, 50), {x: 5, v: 0}, t_eval=[0.5, 1, 2, 3])
    assert solution.t == pytest.approx([0.5, 1, math.pi / 2], abs=1e-9)
    assert solution.x[0] == pytest.approx([5 * math.cos(0.5), 5 * math.cos(1), 0], abs=1e-8)


# ---- chattering


def test_events_that_fire_each_other_for_ever_are_a_loop():
    a, b = Memory("a", 0), Memory("b", 0)
    half = sp.Rational(1, 2)
    loop = [
        Event(x - 1, update={a: 1 - a}),
        Event(a - half, update={b: 1 - b}),
        Event(b - half, update={a: 1 - a}),
    ]
    solution = stopped(solve(System({x: 1}, events=loop), (0, 5), {x: 0}), Outcome.EVENT_LOOP)
    assert solution.t[-1] == pytest.approx(1.0, abs=1e-12) and len(solution.events) < 200


def test_an_event_that_undoes_every_rebound_is_a_loop():
    # Whenever the ball leaves the floor the event throws it back onto it.
    v = sp.Symbol("v", real=True)
    floor = Unilateral(x, restitution=sp.Rational(1, 2))
    back = Event(v, direction=1, update={v: -1})
    ball = System({x: v, v: -1 + floor.reaction}, events=[back])
    solution = stopped(solve(ball, (0, 5), {x: 1, v: 0}), Outcome.EVENT_LOOP)
    assert solution.t[-1] == pytest.approx(math.sqrt(2), abs=1e-12) and len(solution.events) < 200


def test_a_long_chain_of_events_at_one_instant_is_no_loop():
    f, n = Memory("f", 0), 80
    steps = [Event(f - i + sp.Rational(1, 2), update={f: i + 1}) for i in range(1, n)]
    solution = solve(System({x: 1}, events=[Event(x - 1, update={f: 1}), *steps]), (0, 2), {x: 0})
    assert solution.success and len(solution.events) == n
    assert solution["f"][-1] == n


def test_resets_at_shrinking_intervals_never_hang():
    # to 1 - 1e-6 again and again: a million events a unit of time, none lost
    system = System({x: 1}, events=[Event(x - 1, update={x: x - sp.Rational(1, 10**6)})])
    solution = stopped(solve(system, (0, 5), {x: 0}, max_steps=1000), Outcome.TOO_MANY_STEPS)
    assert np.max(solution.x) <= 1 + 1e-12
    assert solution.event_times()[-1] == pytest.approx(1 + 999e-6, abs=1e-9)


@pytest.mark.parametrize("e", [0.5, 0.9, 0.98])
def test_a_ball_that_an_event_bounces_stops_at_the_limit_of_its_bounces(e):
    ball = System({x: v, v: -9.81}, events=[Event(x, direction=-1, update={v: -e * v}, name="bounce")])
    solution = stopped(solve(ball, (0, 100), {x: 1, v: 0}), Outcome.EVENTS_ACCUMULATE)
    assert solution.t[-1] == pytest.approx(math.sqrt(2 / 9.81) * (1 + 2 * e / (1 - e)), rel=1e-9)
    assert solution.events[-1].kind == "accumulation" and solution.events[-1].switch == "bounce"
    assert np.min(solution.x[0]) > -1e-12


def test_events_that_accumulate_with_a_contact_are_passed_with_it():
    apexes = Memory("apexes", 0)
    ball = System(
        {x: v, v: -9.81 + Unilateral(x, restitution=0.5).reaction},
        events=[Event(v, direction=-1, update={apexes: apexes + 1})],
    )
    solution = solve(ball, (0, 5), {x: 1, v: 0})
    assert solution.outcome is Outcome.FINISHED and solution["apexes"][-1] > 20
    assert solution.x[:2, -1] == pytest.approx([0, 0], abs=1e-9)


def test_switchings_that_spiral_into_a_corner_accumulate_and_rest_there():
    # |x| + |y| shrinks by 3 at every crossing; the corner is reached at t = 1/6 + 1/3
    l1, l2 = Switch("l1", x), Switch("l2", y)
    solution = solve(System({x: -2 * l2 - l1, y: 2 * l1 - l2}), (0, 2), {x: 0.5, y: 0.5})
    assert solution.outcome is Outcome.FINISHED
    assert solution.x[:, -1] == pytest.approx([0, 0], abs=1e-9)
    assert solution.event_times("accumulation") == pytest.approx([0.5, 0.5], abs=1e-9)
    crossings = solution.event_times("crossing")[:8]
    # 1/6, then intervals 2/9, 2/27, ...
    assert crossings == pytest.approx(1 / 6 + np.append(0, np.cumsum(2 / 9 / 3.0 ** np.arange(7))), abs=1e-9)


# ---- layers without rest


def test_two_coupled_switches_without_an_attracting_root_are_a_hidden_oscillation():
    # In the corner's layer the focus near lambda = 0 repels, and every quadrant leads inwards.
    l1, l2 = Switch("l1", x), Switch("l2", y)
    system = System({x: -2 * l2 + l1 * (1 - 2 * l1**2) + sp.Rational(1, 10), y: 2 * l1 + l2 * (1 - 2 * l2**2)})
    solution = stopped(solve(system, (0, 2), {x: 0, y: 0}), Outcome.LAYER_UNSETTLED)
    (record,) = solution.ambiguities
    assert (record.kind, record.taken) == ("hidden oscillation", "stopped")


def test_a_layered_state_can_keep_one_switch_from_an_attracting_root():
    # layer: u' = 1/10 - w + 2 lam - 3 lam^3, w' = (2 lam - w)/2; its root lam = 0.25 has the trace 1/2 > 0
    w = sp.Symbol("w", real=True)
    tau = sp.Symbol("tau", positive=True)
    lam = Switch("lam", x)
    system = System(
        {x: sp.Rational(1, 10) - w + 2 * lam - 3 * lam**3, w: (2 * lam - w) / tau}, parameters={tau: 1}
    )
    solution = stopped(solve(system.layered({w: 0.5}), (0, 2), {x: 0.3}), Outcome.LAYER_UNSETTLED)
    # x' = 1/10 - 2 + 2 - 3 = -2.9 on the way in
    assert solution.t[-1] == pytest.approx(0.3 / 2.9, abs=1e-12)
    assert solution.x[0, -1] == 0.0
    assert [a.kind for a in solution.ambiguities] == ["hidden oscillation"]


# ---- ambiguities


@METHODS
def test_repelling_sliding_names_what_was_taken_among_what_was_possible(method):
    solution = solve(System({x: sp.sign(x)}), (0, 1), {x: 0}, method=method)
    (record,) = solution.ambiguities
    assert (record.kind, record.time, record.switch) == ("repelling sliding", 0.0, "sgn(x)")
    assert record.taken in record.continuations and len(record.continuations) == 3
    assert {"leave to +1": 1.0, "leave to -1": -1.0, "stay on the surface": 0.0}[record.taken] == pytest.approx(
        solution.x[0, -1], abs=1e-12
    )


@pytest.mark.parametrize(
    ("rates", "repels"),
    [
        ((l1 + l2 / 2, l2 + l1 / 2), True),  # a node: both eigenvalues of dg/dlam positive
        ((l1 + l2 / 10, l1 / 10 - l2), True),  # a saddle
        ((l1 - 2 * l2, 2 * l1 + l2), True),  # a focus
        ((-l1 + l2 / 2, l1 / 2 - l2), False),
        ((-l1 + 2 * l2, -2 * l1 - l2), False),
    ],
)
def test_a_start_on_a_joint_rest_state_of_two_layers_that_repels_is_recorded(rates, repels):
    solution = solve(System(dict(zip((x, y), rates, strict=True))), (0, 1), {x: 0, y: 0})
    assert [a.kind for a in solution.ambiguities] == ["repelling sliding"] * repels
    assert solution.success and np.all(solution.x == 0)


@METHODS
def test_strict_stops_at_the_first_ambiguity(method):
    solution = stopped(
        solve(System({x: sp.sign(x)}), (0, 1), {x: 0}, strict=True, method=method), Outcome.AMBIGUITY
    )
    assert solution.t.tolist() == [0.0] and len(solution.ambiguities) == 1


def test_strict_changes_nothing_where_the_solution_is_unique():
    system = System({x: v, v: -x - sp.sign(v)})
    free, strict = (solve(system, (0, 40), {x: 12, v: 6}, strict=s) for s in (False, True))
    assert strict.success and np.array_equal(free.t, strict.t) and np.array_equal(free.x, strict.x)


@pytest.mark.parametrize("side", [1, -1])
def test_rest_under_exactly_the_largest_friction_is_rest(side):
    # x'' = -x - sign x' at |x| = 1: lambda = -+1 keeps the balance for ever
    solution = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: side, v: 0})
    assert solution.success and solution.x[:, -1].tolist() == [side, 0.0]
    assert solution["sgn(v)"][-1] == -side


# ---- the machine's memory


@pytest.mark.parametrize(
    ("system", "end", "begin"),
    [
        (System({x: v, v: -x - sp.sign(v + 3) / 8}), 2e4, {x: 1, v: 0}),
        (System({x: v, v: -x - sp.sign(v)}).smoothed(eps=1.0), 1e6, {x: 1, v: 0}),
    ],
    ids=["event-driven", "smoothed"],
)
def test_steps_that_do_not_fit_into_memory_end_the_run(system, end, begin, monkeypatch):
    from pwsmooth.paths import memory

    monkeypatch.setattr(memory, "_SMALL", 0)
    monkeypatch.setattr(memory, "available", lambda: 4e6)
    solution = stopped(
        solve(system, (0, end), begin, dense_output=True, max_step=0.01, max_steps=200_000),
        Outcome.OUT_OF_MEMORY,
    )
    # The first buffers, of 1024 points with those of events, are there without asking.
    assert 9.0 < solution.t[-1] < 0.99 * 0.01 * 200_000
    # What was kept is whole.
    assert np.isfinite(solution(np.linspace(0, solution.t[-1], 100))).all()


def test_available_memory_is_what_the_system_says():
    from pwsmooth.paths import memory

    assert memory.available() > 2**20
    assert memory.fits(1.0) and (memory.available() == math.inf or not memory.fits(1e18))


@pytest.mark.parametrize(
    "options", [{}, {"t_eval": [2.5]}, {"dense_output": True}], ids=["steps", "times", "dense"]
)
def test_a_run_without_a_root_at_its_start_ends_with_its_start(options):
    a, x = sp.symbols("a x", real=True)
    # a^2 + 1 + x^2 = 0 has no real root.
    run = solve(System({x: a}, algebraic=[Algebraic(a, a**2 + 1 + x**2)]), (2, 3), [1.5], **options)
    assert not run.success
    assert run.t.tolist() == [2] and run.x.tolist() == [[1.5]] and np.isnan(run.mult).all()
    assert "x = 1.5" in repr(run) and len(run.segments) == 1


# ---- what the texts say


def test_a_motion_that_goes_to_infinity_is_said_to_whatever_the_method():
    """x' = x^2 from 1 is 1/(1 - t); backward x' = -x^2 ends at t = -1: no option leads past a pole."""
    quadratic = System({x: x**2})
    runs = [
        solve(quadratic, (0, 2), {x: 1}, **given) for given in ({}, {"method": "rk"}, {"t_eval": [0.5, 1.5]})
    ]
    for run in (*runs, solve(System({x: -(x**2)}), (0, -2), {x: 1})):
        assert re.search(r"x goes to infinity: it is .* at t = -?1\. The motion has a singularity", run.message)
        assert "rtol" not in run.message and "method" not in run.message


def test_a_start_too_fast_for_any_step_says_which_rate_is():
    m = sp.Symbol("m", positive=True)
    run = solve(System({x: v, v: -x / m}, parameters={m: 1}), (0, 5), {x: 1, v: 1}, parameters={m: 1e-300})
    assert re.search(r"the rate of v is -1e\+300 at t = 0, where the run begins, too fast", run.message)
    assert run.t.tolist() == [0.0]


def test_a_run_that_ends_at_its_start_has_the_values_of_its_start():
    m = sp.Symbol("m", positive=True)
    system = System({x: v, v: -x / m}, parameters={m: 1})
    run = solve(system, (0, 5), {x: 1, v: 2}, parameters={m: 1e-300}, dense_output=True)
    assert run(0.0).tolist() == [1.0, 2.0] and run([0.0, 0.0], "v").tolist() == [2.0, 2.0]
    with pytest.raises(ValueError, match="leaves the solved span"):
        run(1.0)
    assert len(run.sample()["x"]) >= 1


def test_every_argument_that_a_text_names_is_one_of_solve_or_stands_beside_what_has_it():
    options = inspect.signature(solve).parameters
    owners = {"eps_ratio": "layered", "ambiguities": "the solution's", "when": "`Event`"}
    for outcome in Outcome:
        for name in re.findall(r"`([a-z_]+)`", outcome.text):
            assert name in options or owners[name] in outcome.text, (outcome, name)
