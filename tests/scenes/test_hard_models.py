"""Models that a single switch cannot say, solved and compared with values from elsewhere."""

import math

import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Event, Family, Memory, System, solve

t = sp.Symbol("t", real=True)


def gms(n):
    """n generalised Maxwell-slip elements (Al-Bender, Lampaert, Swevers 2005) under v = 10 cos(2 pi t) um/s."""
    F_c, F_s, v_s, C = sp.symbols("F_c F_s v_s C", positive=True)
    elements = Family(n)
    (z,) = elements.symbols("z")
    kappa, share = elements.symbols("kappa share", positive=True)
    stuck = elements.memory("stuck", 1)
    v = 10 * sp.cos(2 * sp.pi * t)
    threshold = share * (F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2)))
    slip_rate = C / kappa * (share * sp.sign(v) - share * kappa * z / threshold)
    return System(
        {z: sp.Piecewise((v, sp.Eq(stuck, 1)), (slip_rate, True))},
        time=t,
        parameters={F_c: 1, F_s: 2, v_s: 8, C: 50, share: 0.1, kappa: [2.5 / i for i in range(1, n + 1)]},
        events=[
            Event(sp.Abs(kappa * z) - threshold, direction=1, update={stuck: 0}, name="slip",
                  when=sp.And(sp.Eq(stuck, 1), z * v > 0)),
            Event(v, when=sp.Eq(stuck, 0), update={stuck: 1}, name="stick"),
        ],
    )  # fmt: skip


def test_gms_elements_stick_together_and_slip_one_by_one():
    # The elements differ in stiffness only and do not see each other, so that two of the ten suffice. Instants
    # at which the second and later ones of ten slip: an independent fixed-step simulation, to 1e-4.
    solution = solve(gms(2), (0, 0.4), {"z": 0})
    resets = [(e.time, e.switch) for e in solution.events if e.kind == "reset" and e.time > 0.2]
    assert [name for _, name in resets] == ["stick 1", "stick 2", "slip 1", "slip 2"]
    assert [time for time, _ in resets[:2]] == pytest.approx([0.25, 0.25], abs=1e-12)
    assert [time for time, _ in resets[2:]] == pytest.approx([0.3187, 0.3458], abs=1e-4)


def hertz(eta):
    """A free mass that meets a Hertz contact, damped in proportion to its latched impact speed."""
    p, w = sp.symbols("p w", real=True)
    K, damping = sp.symbols("K eta", positive=True)
    speed = Memory("speed", 1, positive=True)
    force = sp.Piecewise((K * p ** sp.Rational(3, 2) * (1 + damping * w / speed), p > 0), (0, True))
    return System(
        {p: w, w: -force},
        parameters={K: 1e5, damping: eta},
        events=[
            Event(p, direction=1, update={speed: w}, name="touch-down"),
            Event(p, direction=-1, terminal=True, name="lift-off"),
        ],
    )


def restitution(eta):
    """e of a force g(delta)(1 + eta s), s = speed over impact speed: the work of both halves cancels."""
    return brentq(lambda e: eta * (1 + e) - math.log((1 + eta) / (1 - eta * e)), 1e-3, min(1, 1 / eta) - 1e-12)


def test_a_latched_hertz_contact_returns_its_closed_form_speed():
    # Independent of stiffness and impact speed: 2.5 instead of the memory's initial 1 shows that it is latched.
    solution = solve(hertz(1.0).smoothed(1e-9), (0, 1), {"p": -0.1, "w": 2.5}, rtol=1e-9)
    assert solution.events[-1].switch == "lift-off"
    assert solution.x[1, -1] == pytest.approx(-2.5 * restitution(1.0), rel=1e-6)


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("eta", [0.1, 1.0])
def test_an_exact_hertz_contact_passes_the_branch_point_of_its_force_at_both_ends(eta, method):
    # delta^1.5 has no Taylor series at touch-down and release; e is the closed form above.
    for rtol in (1e-8, 1e-12):
        solution = solve(hertz(eta), (0, 1), {"p": -0.1, "w": 2.5}, rtol=rtol, atol=1e-3 * rtol, method=method)
        assert [e.switch for e in solution.events if e.kind != "crossing"] == ["touch-down", "lift-off"]
        assert solution.events[0].time == pytest.approx(0.04, abs=1e-15)
        assert solution.x[1, -1] == pytest.approx(-2.5 * restitution(eta), abs=100 * rtol)
        assert solution.cost["steps"] < 100


def test_a_contact_with_memory_of_its_indentation_loses_force_where_its_table_says():
    # Unilateral standard linear solid: force and creep switch on one surface, written in two ways.
    p, w, a = sp.symbols("p w a", real=True)
    K, gamma, beta = sp.symbols("K gamma beta", positive=True)
    pressed = p + beta * gamma * (p - a)
    system = System(
        {p: w, w: -K * sp.Max(0, pressed), a: sp.Max(-gamma * a / (1 + gamma * beta), gamma * (p - a))},
        parameters={K: 1000, gamma: 500, beta: 0.02},
        events=[Event(pressed, direction=-1, terminal=True, name="loss of force")],
    )
    assert len(system.switches) == 1
    solution = solve(system, (0, 1), {"p": 0, "w": 1, "a": 0})
    # End of contact, indentation and speed there: computed independently, to half a unit of the last digit.
    assert solution.t[-1] == pytest.approx(0.081396, abs=5e-7)
    assert solution.x[:2, -1] == pytest.approx([0.0089263, -0.44826], abs=5e-6)
    # p* = beta gamma a/(1 + beta gamma), where the force vanishes
    assert solution.x[0, -1] == pytest.approx(10 / 11 * solution.x[2, -1], rel=1e-9)
