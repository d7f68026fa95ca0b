"""Grazing: a trajectory that touches a surface is decided down to 1e-12 of its scale, and recorded below."""

import math

import pytest
import sympy as sp

from pwsmooth import Event, Switch, System, solve

t, x = sp.symbols("t x", real=True)
lam = Switch("lam", x)
# x = (t - 1)^2 + a above the surface; below it x falls at once.
system = System({x: 2 * (t - 1) + lam - 1}, time=t)


@pytest.mark.parametrize("dip", [1e-3, 1e-9, 2e-12])
def test_a_dip_that_stays_clear_of_the_surface_is_no_event(dip):
    solution = solve(system, (0, 2), {x: 1 + dip})
    assert len(solution.events) == 0 and solution.ambiguities == []
    assert solution.x[0, -1] == pytest.approx(1 + dip, abs=1e-13)


@pytest.mark.parametrize("dip", [1e-3, 1e-9, 1e-11])
def test_a_dip_through_the_surface_is_a_crossing_at_its_first_root(dip):
    solution = solve(system, (0, 2), {x: 1 - dip})
    assert [event.kind for event in solution.events] == ["crossing"]
    assert solution.events[0].time == pytest.approx(1 - dip**0.5, abs=1e-16 / dip**0.5 + 1e-14)
    assert solution.ambiguities == []


@pytest.mark.parametrize("dip", [1e-14, 0, -1e-14])
def test_exact_grazing_is_recorded_and_stops_a_strict_run(dip):
    solution = solve(system, (0, 2), {x: 1 + dip})
    assert [a.kind for a in solution.ambiguities] == ["grazing"]
    assert solution.ambiguities[0].time == pytest.approx(1, abs=0.1)
    assert solution.ambiguities[0].taken == ("cross" if len(solution.events) else "touch and stay on this side")
    stopped = solve(system, (0, 2), {x: 1 + dip}, strict=True)
    assert stopped.outcome.name == "AMBIGUITY" and stopped.t[-1] == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_dip_within_rounding_is_recorded_by_both_methods(method, side):
    # h = cos t + 1 +- d, whose least value is +- d at t = pi; size 2
    y, w, s, d = sp.symbols("y w s d", real=True)
    system = System({y: w, w: -(y - 1), s: sp.sign(y + d)}, parameters={d: 0.0})
    for k in (14, 15, 16):
        got = solve(system, (0, 5), [2.0, 0.0, 0.0], parameters={d: side * 10.0**-k}, method=method,
                    rtol=1e-12, atol=1e-14)  # fmt: skip
        assert [a.kind for a in got.ambiguities] == ["grazing"]
        assert got.ambiguities[0].time == pytest.approx(math.pi, abs=1e-5)
    for k in (5, 7):
        got = solve(system, (0, 5), [2.0, 0.0, 0.0], parameters={d: side * 10.0**-k}, method=method,
                    rtol=1e-12, atol=1e-14)  # fmt: skip
        assert not got.ambiguities and len(got.event_times("crossing")) == (0 if side > 0 else 2)


def test_each_of_two_surfaces_grazed_in_one_step_is_recorded():
    # x = (t - 1)^2 and y = (t - 1.2)^2: one polynomial step from 0 to 2
    y = sp.Symbol("y", real=True)
    two = System({x: 2 * (t - 1) + lam - 1, y: 2 * (t - 1.2) + Switch("mu", y) - 1}, time=t)
    solution = solve(two, (0, 2), {x: 1, y: 1.44})
    assert sorted(a.kind for a in solution.ambiguities) == ["grazing", "grazing"]
    assert sorted(a.switch for a in solution.ambiguities) == ["lam", "mu"]
    assert sorted(a.time for a in solution.ambiguities) == pytest.approx([1, 1.2], abs=0.15)
    stopped = solve(two, (0, 2), {x: 1, y: 1.44}, strict=True)
    assert stopped.t[-1] == pytest.approx(1, abs=0.15) and len(stopped.ambiguities) == 1


def test_an_event_that_is_grazed_later_hides_no_grazed_surface():
    late = Event(surface=(t - sp.Rational(3, 2)) ** 2, name="late")
    solution = solve(System({x: 2 * (t - 1) + lam - 1}, time=t, events=[late]), (0, 2), {x: 1})
    assert [(a.kind, a.switch) for a in solution.ambiguities] == [("grazing", "lam")]
