"""Folds of a sliding root that are touched, just missed or just passed: right, or recorded; never silently wrong.

    v' = A w - lambda (1 + rho (1 - lambda^2)),   w = sin t

The largest hold is mu_s = (2/3)(1 + rho) sqrt((1 + rho)/(3 rho)), so that A breaks the stick if and only if
A^2 > (4/9)(1 + rho)^3/(3 rho): decided here in exact fractions.

Guards: definition/folds.py, kernels/step/arc.py, kernels/instant/folds.py.
"""

import math
from fractions import Fraction

import friction_oscillator
import numpy as np
import pytest
import sympy as sp
from family_models import template_from

from pwsmooth import Event, Family, Outcome, Switch, System, solve

t, v, w, A, rho = sp.symbols("t v w A rho", real=True)
lam = Switch("lam", v)
hold = lam * (1 + rho * (1 - lam**2))
FORCED = System({v: A * sp.sin(t) - hold}, time=t, parameters={A: 1.0, rho: 3.0})
THROUGH_A_STATE = System({v: A * w - hold, w: sp.cos(t)}, time=t, parameters={A: 1.0, rho: 3.0})
RESOLVED = 1e-13  # relative; rounding of A w and of the hold are 1e-15


def breaks(force, strength):
    f, r = Fraction(force), Fraction(strength)
    return f * f > Fraction(4, 9) * (1 + r) ** 3 / (3 * r)


def largest_hold(strength):
    return 2 / 3 * (1 + strength) * math.sqrt((1 + strength) / (3 * strength))


# At rtol 1e-6 lambda is known to 1e-8, and the excess over the fold to the square of that.
@pytest.mark.parametrize(("rtol", "nearest"), [(1e-12, -17), (1e-9, -17), (1e-6, -15)])
def test_a_stick_near_its_fold_is_right_or_recorded(rtol, nearest):
    draw, counts = np.random.default_rng(5), {"recorded": 0, "broken": 0, "held": 0}
    for _ in range(150):
        strength, side, distance = draw.uniform(1, 6), draw.choice([-1, 1]), 10 ** draw.uniform(nearest, -6)
        force = largest_hold(strength) * (1 + side * distance)
        solution = solve(
            FORCED, (0, math.pi), [0.0], parameters={A: force, rho: strength}, rtol=rtol, atol=1e-14
        )
        slips, folds = solution.event_times("slip"), [a for a in solution.ambiguities if a.kind == "fold"]
        if folds:
            counts["recorded"] += 1
            assert distance < RESOLVED
        else:
            counts["broken" if breaks(force, strength) else "held"] += 1
            assert solution.success and len(slips) == breaks(force, strength)
        # The excess A sin t - mu_s is positive for |t - pi/2| < sqrt(2 d) only.
        for time in (*slips, *(a.time for a in folds)):
            assert abs(time - math.pi / 2) < 1.01 * math.sqrt(2 * distance) + 1e-6
    assert min(counts.values()) > 5, counts


def test_the_stick_beyond_a_touch_is_on_the_attracting_branch():
    # lambda retraces its way: lambda(pi - t) = lambda(t)
    force = largest_hold(3.0)
    solution = solve(
        FORCED, (0, math.pi), [0.0], parameters={A: force * (1 - 4e-16)}, t_eval=[1.0, math.pi - 1.0]
    )
    assert [a.kind for a in solution.ambiguities] == ["fold"] and solution.success
    assert solution.ambiguities[0].taken == "touch and stay on the surface"
    assert solution["lam"][1] == pytest.approx(solution["lam"][0], abs=1e-9)
    # its root of A sin 1 = lambda (4 - 3 lambda^2) below the fold at 2/3
    roots = np.roots([-3, 0, 4, -force * math.sin(1.0)])
    assert np.min(np.abs(roots - solution["lam"][0])) < 1e-9 and 0 < solution["lam"][0] < 2 / 3


def test_strict_stops_at_a_touched_fold():
    force = largest_hold(3.0)
    solution = solve(FORCED, (0, math.pi), [0.0], parameters={A: force}, strict=True)
    assert solution.outcome is Outcome.AMBIGUITY
    assert solution.t[-1] == pytest.approx(math.pi / 2, abs=1e-6)


def test_forces_known_through_a_state_are_decided_down_to_their_accuracy():
    # at rtol 1e-12 the state w is sin t to some 1e-15
    draw = np.random.default_rng(6)
    for _ in range(60):
        side, distance = draw.choice([-1, 1]), 10 ** draw.uniform(-14, -8)
        force = largest_hold(3.0) * (1 + side * distance)
        solution = solve(
            THROUGH_A_STATE, (0, math.pi), [0.0, 0.0], parameters={A: force}, rtol=1e-12, atol=1e-14
        )
        broken = len(solution.event_times("slip"))
        assert solution.ambiguities or broken == breaks(force, 3.0), distance


def test_a_root_is_followed_from_and_through_its_inflection():
    # lambda^3 = sin(t)/2: dlambda/dt is infinite at t = 0, pi, 2 pi, and the run begins at the first
    x, total = sp.symbols("x total", real=True)
    mu = Switch("mu", x)
    cubic = System({x: sp.sin(t) / 2 - mu**3, total: mu}, time=t)
    solution = solve(cubic, (0, 7.0), [0.0, 0.0], t_eval=[1.0, 2.0, 4.0, 6.0, 7.0])
    assert solution.success and not solution.events and np.all(solution["x"] == 0.0)
    assert solution["mu"] == pytest.approx(np.cbrt(np.sin(solution.t) / 2), abs=1e-9)
    # integral of sin^(1/3) over a half wave, by the beta function: sqrt(pi) Gamma(2/3)/Gamma(7/6)
    half = solve(cubic, (0, math.pi), [0.0, 0.0])["total"][-1]
    assert half == pytest.approx(
        math.sqrt(math.pi) * math.gamma(2 / 3) / math.gamma(7 / 6) / 2 ** (1 / 3), abs=1e-9
    )


@pytest.mark.parametrize("tick", [0.5, 0.9, 1.0, 1.06])
def test_a_clock_that_ends_a_step_near_a_fold_meets_no_surface_that_comes_later(tick):
    # t = lambda (2 - lambda^2) has its fold at 1.0887, which one step would reach: it ends at the stroke before
    y, z, level = sp.symbols("y z level", real=True)
    ticks = Event(every=tick, update={z: z + 1})
    rates = {v: t - lam * (2 - lam**2), y: -sp.sign(y + level), z: 0}
    clocked = System(rates, time=t, events=[ticks], parameters={level: 1.0})
    for reached in (1.01, 1.03, 1.07, 1.08):
        run = solve(clocked, (0, 1.1), {v: 0, y: 0, z: 0}, parameters={level: reached})
        assert run.event_times("stick") == pytest.approx([reached], abs=1e-12)
        assert run["y"][-1] == pytest.approx(-reached, abs=1e-12)


def test_a_fold_at_the_bound_is_left():
    # F_s = F_c: lambda (3 - lambda^2)/2 has its fold at lambda = 1 itself, where the force is 1
    x = sp.Symbol("x", real=True)
    mu = Switch("mu", x)
    block = System({x: t / 10 - mu * (3 - mu**2) / 2}, time=t)
    solution = solve(block, (0, 20), [0.0])
    assert solution.success and solution["x"][-1] == pytest.approx(5.0, abs=1e-8)  # (t - 10)^2/20
    assert [e.time for e in solution.events] == pytest.approx([10.0], abs=1e-8)


# ---- far from a fold: where lambda stands still


@pytest.mark.parametrize("force", [0.5, 0.968, 1.5])
@pytest.mark.parametrize("off", [0, 1e-13, -1e-13, 1e-10, -1e-10, 1e-8, 1e-6, -1e-6, 1e-4, 1e-2])
def test_a_stick_may_begin_beside_the_turn_of_its_force(force, off):
    # lambda' is almost 0 there, lambda'' is not, which beside a fold means that it is near.
    stuck = System({v: force * sp.cos(t) - hold}, time=t, parameters={rho: 3})
    run = solve(stuck, (off, 1), {v: 0})
    assert run.success and not run.events and run.cost["steps"] < 20
    lam_at_end = run["lam"][-1]
    assert lam_at_end * (1 + 3 * (1 - lam_at_end**2)) == pytest.approx(force * math.cos(1), abs=1e-8)


def test_a_stick_begins_beside_flat_points_of_random_forces():
    """Force f_0 + f_n t^n + higher terms, far below the hold, from within 10^-14 to 10^-2 of t = 0."""
    c = sp.symbols("c0:7", real=True)
    stuck = System({v: sum(a * t**k for k, a in enumerate(c)) - hold}, time=t,
                   parameters={rho: 3.0, **dict.fromkeys(c, 0.0)})  # fmt: skip
    random = np.random.default_rng(8)
    for _ in range(200):
        values = np.zeros(7)
        values[0] = random.uniform(-1.2, 1.2)
        n = random.integers(2, 6)
        values[n:] = random.uniform(-0.05, 0.05, 7 - n) * 10.0 ** random.uniform(-2, 0)
        off = random.choice([-1, 1]) * 10.0 ** random.uniform(-14, -2)
        run = solve(stuck, (off, 1), {v: 0}, parameters=dict(zip(c, values)))
        assert run.success and not run.events, (values, off, run.outcome)
        last = run["lam"][-1]
        assert last * (1 + 3 * (1 - last**2)) == pytest.approx(values.sum(), abs=1e-8)


LATE = [(5.325, 0.2, 120), (5.325, 0.2, 400), (5.975, 0.75, 1500)]


@pytest.mark.parametrize(("strength", "frequency", "periods"), LATE)
def test_a_stick_ends_at_its_fold_however_late(strength, frequency, periods):
    # After 110 periods of 31 a step ends one rounding of the time, 5e-13, from a fold: 9e-8 of lambda.
    late = friction_oscillator.hidden(sigma=strength, omega=frequency).layered({friction_oscillator.z: sp.oo})
    run = solve(
        late, (0, periods * 2 * math.pi / frequency), [0.5, 0.3], t_eval=[periods * 2 * math.pi / frequency]
    )
    assert run.success, run.message


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("n", [2, 4])
def test_members_that_stand_at_their_folds_together_leave_together(method, n):
    def oscillator(y, v):
        lam = Switch("lam", v)
        rate = -level * sp.sin(t) - sp.Rational(31, 10) * y - v / 10 - lam * (1 + 3 * (1 - lam**2))
        return System({y: v, v: rate}, time=t, parameters={level: 2.4})

    level = sp.Symbol("level", positive=True)
    options = {"rtol": 1e-11, "atol": 1e-13, "method": method}
    alone = solve(oscillator(*sp.symbols("y v", real=True)), (0, 7), [0.5, 0.3], **options, by=[level])
    # the first members move alike, the last one a little later
    start = [0.5] * (n - 1) + [0.501] + [0.3] * n
    with template_from(4):
        many = oscillator(*Family(n).symbols("y v"))
    run = solve(many, (0, 7), start, **options)
    with_slopes = solve(many, (0, 7), start, **options, by=[level])
    for together in (run, with_slopes):
        assert together.success and len(together.event_times("slip by fold")) == n * 2
        assert together.x[: n - 1, -1] == pytest.approx(alone.x[0, -1], abs=1e-8)
    slopes = with_slopes.derivatives.x[: n - 1, 0, -1]
    assert slopes == pytest.approx(alone.derivatives.x[0, 0, -1], abs=1e-5)
