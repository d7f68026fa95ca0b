"""The event-driven friction oscillator against its references: published orbits, and random ones."""

import math

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z
from reference.coulomb_oscillator import KIND_NAMES, ensemble, solve_closed_form, trajectory
from reference.relaxing import relaxing_orbit, segments_of

from pwsmooth import solve
from pwsmooth.analysis.sticking.capture import capture_threshold

TWO_PI = 2 * math.pi
TIGHT = dict(rtol=1e-12, atol=1e-14)
HALF_DIGIT = 0.5e-9  # of the nine decimals that the table prints


def mu_s(rho):
    """Static friction coefficient of gamma = 1 - lam^2, rho > 1/2."""
    return 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5


def last_cycle(system, start, periods, length):
    """[(kind, duration, start phase)] of the last `length` segments after `periods` drive periods."""
    solution = solve(system, (0, periods * TWO_PI), start, **TIGHT)
    assert solution.success
    return segments_of([(e.time, e.kind) for e in solution.events])[-length:]


# ---- the published orbits (segments: duration, start phase modulo 2 pi)


@pytest.mark.parametrize(
    ("rho", "stick", "phases", "slip"),
    [
        (3, 0.539389027, (1.755610496, 4.897203149), 2.602203627),
        (2, 0.350778709, (1.789548342, 1.789548342 + math.pi), 2.790813945),
        (1, 0.070676656, (1.813524584, 1.813524584 + math.pi), 3.070915998),
    ],
)
def test_slaved_orbit_sticks_twice_a_period_and_leaves_by_the_fold(rho, stick, phases, slip):
    system = hidden(rho=rho).layered({z: sp.oo})
    cycle = last_cycle(system, {y: 0.78, v: -1.03}, 400, 4)
    assert sorted(kind for kind, *_ in cycle) == ["slip by fold", "slip by fold", "stick", "stick"]
    sticks = sorted((phase, duration) for kind, duration, phase in cycle if kind == "stick")
    assert [d for _, d in sticks] == pytest.approx([stick, stick], abs=HALF_DIGIT)
    assert [p for p, _ in sticks] == pytest.approx(phases, abs=HALF_DIGIT)
    slips = [d for kind, d, _ in cycle if kind != "stick"]
    assert slips == pytest.approx([slip, slip], abs=HALF_DIGIT)


def test_without_the_hidden_term_the_orbit_only_crosses():
    cycle = last_cycle(coulomb(), {y: 0.5, v: 0.3}, 400, 2)
    assert [kind for kind, *_ in cycle] == ["crossing", "crossing"]
    assert sorted(p for *_, p in cycle) == pytest.approx([1.815342325, 4.956934979], abs=HALF_DIGIT)


@pytest.mark.parametrize(
    ("beta", "periods", "stick", "start", "slips"),
    [
        (0.1, 60, 1.179049648, 1.612048372, (2.291769134, 2.812366526)),
        (0.01, 40, 0.888623966, 1.716272629, (2.407164737, 2.987396603)),
        (0.001, 40, 0.804906892, 1.736283187, (2.457046934, 3.021231481)),
        (0, 60, 0.778356050, 1.741745156, (2.474350118, 3.030479140)),
    ],
)
@pytest.mark.parametrize("mirrored", [False, True])
def test_relaxing_orbits_are_asymmetric_and_come_in_mirror_images(beta, periods, stick, start, slips, mirrored):
    system = hidden(beta=beta) if beta else hidden().layered({z: 0})
    # the mirror image is (y, v, t) -> (-y, -v, t + pi)
    sign, begin = (-1, math.pi) if mirrored else (1, 0.0)
    state = {y: sign * 0.6, v: sign * -1.07} | ({z: 0} if beta else {})
    solution = solve(system, (begin, begin + periods * TWO_PI), state, **TIGHT)
    found = {kind: (duration, phase) for kind, duration, phase in _cycle(solution)}
    shift = math.pi if mirrored else 0.0
    leave = next(kind for kind in found if kind.startswith("slip"))
    assert leave == ("slip by tangency" if beta else "slip by fold")
    assert found["stick"] == pytest.approx((stick, start + shift), abs=HALF_DIGIT)
    assert found[leave][0] == pytest.approx(slips[0], abs=HALF_DIGIT)
    assert found["crossing"] == pytest.approx((slips[1], (start + shift + stick + slips[0]) % TWO_PI), abs=3e-9)


def _cycle(solution):
    return segments_of([(e.time, e.kind) for e in solution.events])[-3:]


def test_every_event_time_of_a_relaxing_orbit_agrees_with_an_event_by_event_integration():
    solution = solve(hidden(), (0, 30), {y: 0.6, v: -1.07, z: 0}, **TIGHT)
    events, end = relaxing_orbit(0.1, t_end=30.0)
    assert [e.kind for e in solution.events] == [kind for _, kind in events]
    assert [e.time for e in solution.events] == pytest.approx([time for time, _ in events], abs=1e-9)
    assert solution.x[:, -1] == pytest.approx(end, abs=1e-9)


def test_the_slip_only_orbit_attracts_in_the_relaxing_regime_too():
    # |F| = 1.04008 > N at its crossings: the relaxing oscillator never captures it.
    *_, (y_end, v_end) = solve_closed_form(3.1, 2.4, t_end=400 * TWO_PI, room=4000)
    # a start near it, so that attraction is seen and not only persistence
    solution = solve(hidden(), (0, 100 * TWO_PI), {y: y_end + 0.01, v: v_end, z: 0}, **TIGHT)
    assert {e.kind for e in solution.events} == {"crossing"}
    assert solution.x[:2, -1] == pytest.approx((y_end, v_end), abs=1e-9)
    force = 2.4 * math.sin(solution.events[-1].time) + 3.1 * position_at(solution, solution.events[-1].time)
    assert abs(force) == pytest.approx(1.04008, abs=0.5e-5)


def test_a_start_in_a_stick_is_left_once():
    # y = -1 rests until -sigma sin t - k y = N: sin t = (3.1 - 1)/2.4 on the falling side
    solution = solve(coulomb(), (1.9, 3.6), {y: -1.0, v: 0}, **TIGHT)
    assert solution.success
    assert [e.kind for e in solution.events] == ["slip by tangency"]
    assert solution.events[0].time == pytest.approx(math.pi - math.asin(2.1 / 2.4), abs=1e-12)


# ---- random orbits


def random_orbits(n, seed):
    """Parameters and starts of n orbits, with events and ends by the closed form."""
    rng = np.random.default_rng(seed)
    ks, sigmas = rng.uniform(1.5, 5, n), rng.uniform(0.6, 3, n)
    y0, v0 = np.full(n, 0.5), np.full(n, 0.3)
    times, kinds = np.empty((n, 200)), np.zeros((n, 200), np.int64)
    counts, final = np.zeros(n, np.int64), np.empty((n, 2))
    ensemble(ks, sigmas, 0.1, 1.0, 1.0, 1.0, 1.0, y0, v0, 20 * TWO_PI, times, kinds, counts, final)
    return ks, sigmas, times, kinds, counts, final


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-12])
def test_ten_thousand_random_orbits_have_every_event_and_no_other(rtol):
    ks, sigmas, times, kinds, counts, final = random_orbits(10_000, 12345)
    system = coulomb()
    start = {y: 0.5, v: 0.3}
    wrong, late, ill, off = [], 0.0, 0, 0.0
    for i in range(len(ks)):
        solution = solve(
            system.with_parameters({"k": ks[i], "sigma": sigmas[i]}),
            (0, 20 * TWO_PI),
            start,
            rtol=rtol,
            atol=1e-2 * rtol,
        )
        expected = [KIND_NAMES[kind] for kind in kinds[i, : counts[i]]]
        if not solution.success or [e.kind for e in solution.events] != expected:
            wrong.append((ks[i], sigmas[i]))
            continue
        off = max(off, np.max(np.abs(solution.x[:, -1] - final[i])))
        found = solution.events.times
        for j in np.flatnonzero(np.abs(found - times[i, : counts[i]]) >= 1e-9):
            gap = abs(found[j] - times[i, j])
            # A contact captured while it all but grazes: v falls through 0 with the slope |F| - N alone; a
            # rounding of v (some 1e-14) over that slope is all that the time can be known to.
            slope = 1 - abs(sigmas[i] * math.sin(times[i, j]) + ks[i] * position_at(solution, times[i, j]))
            if expected[j] == "stick" and gap * slope < 1e-14:
                ill += 1
            else:
                late = max(late, gap)
    assert wrong == []
    if rtol == 1e-12:
        assert late == 0.0
        assert ill <= 3
        assert off < 1e-9


def position_at(solution, time):
    """y at the recorded point next to a time."""
    return solution.x[0, np.argmin(np.abs(solution.t - time))]


@pytest.mark.parametrize("ratio", [0, 0.1, 0.5, sp.oo])
def test_random_layered_orbits_are_captured_below_the_threshold_and_released_at_the_fold(ratio):
    # z = 0 in every slip phase: only the two thresholds of the closed form depend on the ratio.
    static = mu_s(3)
    capture = {0: 1.0, sp.oo: static}.get(ratio) or capture_threshold(3, float(ratio))
    rng = np.random.default_rng(8)
    system = hidden().layered({z: ratio})
    room = np.empty(200), np.zeros(200, np.int64)
    for _ in range(300):
        k, sigma = rng.uniform(1.5, 5), rng.uniform(0.6, 3)
        y0, v0 = rng.uniform(-2, 2, 2)
        n, *end = trajectory(k, sigma, 0.1, 1.0, 1.0, capture, static, 0.0, y0, v0, 5 * TWO_PI, *room)
        solution = solve(
            system.with_parameters({"k": k, "sigma": sigma}), (0, 5 * TWO_PI), {y: y0, v: v0}, **TIGHT
        )
        found = [e.kind for e in solution.events]
        expected = [KIND_NAMES[kind].replace("tangency", "fold") for kind in room[1][:n]]
        assert found == expected, (k, sigma, y0, v0)
        assert [e.time for e in solution.events] == pytest.approx(room[0][:n], abs=1e-9)
        assert solution.x[:, -1] == pytest.approx(end, abs=1e-9)
