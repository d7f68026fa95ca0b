"""Events of one instant that set a state and add to it: `Event(together=...)`, and two networks in which that decides.

The automaton of Olami, Feder and Christensen is written out here; the pulse-coupled oscillators of Mirollo and Strogatz
have their volleys by exact jumps from firing to firing.

Guards: kernels/firing.py, kernels/instant/firing.py.
"""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, System, solve

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
x, y, t = sp.symbols("x y t", real=True)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("together", "value"), [("add", 0.25), ("set", 0.0)])
def test_what_is_set_and_what_is_added_do_not_depend_on_the_order(together, value, order):
    events = [
        Event(at=[1], update={x: 0, y: y + x / 4}, together=together, name="a"),
        Event(at=[1], update={y: 0, x: x + y / 4}, together=together, name="b"),
    ]
    run = solve(System({x: 0, y: 0}, time=t, events=events[::order]), (0, 2), {x: 1, y: 1})
    assert run.x[:, -1].tolist() == [value, value] and not run.ambiguities


@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_what_two_set_otherwise_is_recorded_all_the_same(method):
    events = [Event(at=[1], update={x: k}, together="add", name=f"to {k}") for k in (2, 3)]
    run = solve(System({x: 0}, time=t, events=events), (0, 2), {x: 1}, method=method)
    assert [a.kind for a in run.ambiguities] == ["conflicting updates"]


def test_where_it_is_not_known_it_is_refused():
    event = Event(x - 1, update={x: 0}, together="add", name="fire")
    system = System({x: 1}, events=[event])
    with pytest.raises(
        ValueError, match=r"derivatives of a system with `together` in its events \(fire\) are not"
    ):
        solve(system, (0, 2), {x: 0}, by=["x"])
    with pytest.raises(ValueError, match=r"implicit steps of a system with `together`"):
        solve(system, (0, 2), {x: 0}, method="stiff")
    with pytest.raises(ValueError, match="`together` of an Event"):
        Event(x - 1, update={x: 0}, together="both")
    assert "beside others add" in repr(system)


def lattice(n):
    """Sites under a uniform drive; one that reaches 1 is emptied and hands 0.4 of it to both neighbours."""
    family = Family(n)
    (F,) = family.symbols("F")
    given = {family.neighbour(F, side): family.neighbour(F, side) + F * 2 / 5 for side in (1, -1)}
    topple = Event(F - 1, direction=1, update={F: 0} | given, together="add", name="topple")
    return System({F: 1}, events=[topple])


def automaton(loads, most):
    """Olami, Feder and Christensen's in one dimension, in exact numbers: all that are full topple together, generation
    by generation; the time, topplings and sizes of the first avalanches."""
    F, now, sizes = list(loads), Fraction(0), []
    while len(sizes) < most:
        step = 1 - max(F)
        F, now = [f + step for f in F], now + step
        sizes.append(0)
        while full := [i for i, f in enumerate(F) if f >= 1]:
            given = [F[i] for i in full]
            for i in full:
                F[i] = Fraction(0)
            for i, f in zip(full, given, strict=True):
                for k in (i - 1, i + 1):
                    if 0 <= k < len(F):
                        F[k] += f * Fraction(2, 5)
            sizes[-1] += len(full)
    return float(now), sizes, [float(f) for f in F]


@pytest.mark.parametrize("local", [True, False])
def test_an_automaton_of_toppling_sites_by_events(local):
    n, avalanches = 64, 2000 if local else 300
    loads = [Fraction((37 * i * i + 11 * i) % 101, 101) for i in range(n)]
    end, sizes, left = automaton(loads, avalanches)
    run = solve(
        lattice(n), (0, end + 1e-9), {"F": [float(f) for f in loads]}, local=local, t_eval=[end + 1e-9], **TIGHT
    )
    assert run.success and not run.ambiguities
    assert len(run.events) == sum(sizes)
    assert run.events[-1].time == pytest.approx(end, abs=1e-11)
    assert run.x[:, -1] == pytest.approx(left, abs=2e-9)


def oscillators(n, eps):
    """All to all: u = (1 - exp(-phase))/(1 - 1/e), reset at 1; each that fires adds eps to all that do not."""
    family = Family(n)
    (u,) = family.symbols("u")
    links = family.links([[k for k in range(1, n + 1) if k != i] for i in range(1, n + 1)])
    others = [links.neighbour(u, j) for j in range(1, n)]
    fire = Event(u - 1, direction=1, update={u: 0} | {v: v + eps for v in others}, together="set", name="fire")
    return System({u: 1 / (1 - sp.exp(-1)) - u}, events=[fire])


def volleys(start, eps, end):
    """Times of the volleys and how many fire in each: those that a volley carries beyond 1 fire with it."""
    u, now, found, top = np.array(start), 0.0, [], 1 / (1 - np.exp(-1))
    while True:
        wait = np.log((top - u) / (top - 1)).min()
        if now + wait > end:
            return found
        now += wait
        u = top - (top - u) * np.exp(-wait)
        due = fired = u >= 1 - 1e-13
        while due.any():
            u = np.where(fired, 0, u + eps * due.sum())
            due = ~fired & (u >= 1 - 1e-13)
            u[due], fired = 0, fired | due
        found.append((now, int(fired.sum())))


@pytest.mark.parametrize("local", [True, False])
def test_pulse_coupled_oscillators_fire_in_volleys_until_all_do_together(local):
    """Numbers of the first three volleys and of the 63rd, in which all ten fire, are those of an exact jump map."""
    start = [0.98 * ((5**0.5 - 1) / 2 * (i + 1) % 1) for i in range(10)]
    run = solve(oscillators(10, 0.02), (0, 10.6), {"u": start}, local=local, **TIGHT)
    assert run.success and not run.ambiguities
    times = run.event_times()
    jumps = np.flatnonzero(np.diff(times, prepend=-1) > 1e-9)
    known = volleys(start, 0.02, 10.6)
    assert times[jumps] == pytest.approx([time for time, _ in known], abs=1e-10)
    assert np.diff(jumps, append=len(times)).tolist() == [count for _, count in known]
    assert times[jumps[:3]] == pytest.approx([0.120629708626, 0.216138387415, 0.367622718156], abs=1e-11)
    assert known[62][1] == 10 and times[jumps[62]] == pytest.approx(10.3222090534, abs=1e-9)


@pytest.mark.parametrize(("phase", "together"), [(0.155, True), (0.162, False)])
def test_two_oscillators_are_absorbed_below_the_phase_of_mirollo_and_strogatz(phase, together):
    """The phase below which they are is 0.1585650787 for g = 1, eps = 0.1."""
    second = (1 - np.exp(-phase)) / (1 - np.exp(-1))
    run = solve(oscillators(2, 0.1), (0, 1.5), {"u": [0, second]}, **TIGHT)
    times = run.event_times()
    assert bool(abs(times[0] - times[1]) < 1e-12) is together
