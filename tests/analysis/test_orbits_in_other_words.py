"""One orbit in other words: other units, names, orders, times and starts give the same orbit, or the same refusal.

Each family is one model whose units of length L and of time W are parameters: x' = v/W, v' = L f(x/L, v/L, t/W)/W. So
nothing of the exact motion depends on them but its size. Values are random, the seeds are fixed.

Guards: analysis/orbits/, analysis/maps/scales.py, studies/attractors.py, studies/kinds.py.
"""

import functools

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Return, Strobe, System, Unilateral, basins, find_orbit

UNITS = [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e-6, 1e6)]
SEEDS = range(8)
L, W = sp.symbols("L W", positive=True)
a, b, c, d, t0 = sp.symbols("a b c d t0", real=True)
t = sp.Symbol("t", real=True)


def driven(x, v, extra=0):
    """f of a forced oscillator with dry friction, on a spring that hardens."""
    return a * sp.cos((t - t0) / W) - x - b * x**3 - c * v - d * sp.sign(v - sp.Rational(1, 5))


FAMILIES = {
    # name: (number of states, f in units of 1, section of an autonomous one in units of 1, ranges of a, b, c, d, start)
    "dry friction": (
        2,
        lambda x, v: (v, driven(x, v)),
        None,
        [(0.8, 2), (0, 1), (0.1, 0.4), (0.1, 0.5)],
        (0.5, 0.3),
    ),
    "relay": (
        3,
        lambda x, v, z: (v, z, -a * z - (1 + b) * v - c * x - sp.sign(x - d / 10 * v)),
        lambda x, v, z: x,
        [(1.0, 2.0), (0.5, 1.5), (0.1, 0.3), (0, 1)],
        (0.4, 0.2, 0.1),
    ),
    "self-excited": (
        2,
        lambda x, v: (v, a * (1 - x**2) * v - x - b * sp.Abs(x) - c / 10 * sp.sign(v)),
        lambda x, v: x - sp.Rational(1, 10),
        [(0.5, 2.0), (-0.3, 0.3), (0.1, 0.5), (0, 1)],
        (2.0, 0.5),
    ),
    "impacts": (2, None, None, [(0.5, 1.5), (0, 1), (0.2, 0.6), (0, 1)], (0.0, 0.2)),
}


@functools.cache
def model(family, names="x v z", turned=False):
    """A system of a family with these names, its states turned round or not; its states and its section."""
    number, f, section, _, start = FAMILIES[family]
    states = sp.symbols(names, real=True)[:number]
    inside = [s / L for s in states]
    if family == "impacts":
        x, v = states
        stop = Unilateral(L - x, restitution=sp.Rational(3, 5), name="R")
        whole = [v / W, (L * (a * sp.cos((t - t0) / W)) - x - c * v) / W - stop.reaction]
    else:
        whole = [L * e / W for e in f(*inside)]
    pairs = list(zip(states, whole))
    time = {} if section else {"time": t}
    given = {p: 1.0 for p in (a, b, c, d, L, W, t0)}
    used = set().union(*(e.free_symbols for e in whole)) & given.keys() | {L, W}
    system = System(
        dict(pairs[::-1] if turned else pairs), parameters={p: 1.0 for p in given if p in used}, **time
    )
    return system, states, None if section is None else section(*inside)


def values_of(family, seed):
    rng = np.random.default_rng([sorted(FAMILIES).index(family), seed])
    return dict(zip((a, b, c, d), [float(rng.uniform(*pair)) for pair in FAMILIES[family][3]]))


def found(family, seed, *, length=1.0, time=1.0, later=0.0, start=None, transient=40, **how):
    """The orbit of a family's member in units of 1: what of it does not depend on words."""
    system, states, section = model(family, **how)
    given = values_of(family, seed) | {L: length, W: time, t0: later}
    system = system.with_parameters({p: value for p, value in given.items() if p in system.parameters})
    begin = FAMILIES[family][4] if start is None else start
    begin = {s: value * length for s, value in zip(states, begin)}
    if section is None:
        orbit = find_orbit(
            system, begin, seen=Strobe(2 * sp.pi * W, phase=later / (2 * np.pi * time)), transient=transient
        )
    else:
        orbit = find_orbit(system, begin, seen=Return(section), transient=transient)
    order = [list(system.states).index(s) for s in states]
    return orbit, orbit.x[order] / length, orbit.period / time


def same(one, other):
    (first, x, period), (second, y, other_period) = one, other
    assert first.success == second.success
    if not first.success:
        return
    assert first.map.count == second.map.count and first.stable == second.stable
    assert other_period == pytest.approx(period, rel=1e-8)
    if first.map.count == 1:  # of a longer orbit another of its points is as good
        assert y == pytest.approx(x, abs=1e-7)
    mu, nu = (np.sort(np.abs(orbit.multipliers)) for orbit in (first, second))
    assert nu == pytest.approx(mu, abs=1e-6, rel=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_an_orbit_is_the_same_in_other_units_names_orders_times_and_from_other_starts(family):
    several = 0
    for seed in SEEDS:
        here = found(family, seed)
        several += here[0].success
        for length, time in UNITS:
            same(here, found(family, seed, length=length, time=time))
        same(here, found(family, seed, names="q p r", turned=True))
        if FAMILIES[family][2] is None:
            same(here, found(family, seed, later=1.3))
        elif here[0].success:
            beside = here[0].solution()(0.3 * here[2])
            same(here, found(family, seed, start=beside, transient=0))
    assert several >= len(SEEDS) // 2


@pytest.mark.parametrize("seed", range(3))
def test_basins_are_the_same_in_other_units_and_names(seed):
    starts, grids = np.random.default_rng(seed).uniform(-1.5, 1.5, (2, 3)), []
    for length, time, how in [
        (1.0, 1.0, {}),
        *((*unit, {}) for unit in UNITS[:3]),
        (1.0, 1.0, dict(names="q p r")),
    ]:
        system, (x, v), _ = model("dry friction", **how)
        given = values_of("dry friction", seed) | {L: length, W: time, t0: 0.0}
        system = system.with_parameters({p: value for p, value in given.items() if p in system.parameters})
        grid = {x: starts[0] * length, v: starts[1] * length}
        grids.append(basins(system, grid, Strobe(2 * sp.pi * W), transient=60))
        first = grids[0], 1.0
        assert grids[-1].kinds.tolist() == grids[0].kinds.tolist()
        ends, others = (
            sorted([*orbit.x / size] for orbit in one.attractors) for one, size in (first, (grids[-1], length))
        )
        assert np.array(others) == pytest.approx(np.array(ends), abs=1e-7)
