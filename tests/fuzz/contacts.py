"""Impacts and contacts: one to three bodies, fixed and moving walls, walls between bodies, accumulation, release.

What jumps at closed contacts: forces (a switch of time or of another body), velocities (kicks at instants, impacts of a
neighbour), the wall's speed (a body without forces that is kicked). Restitution 0 to 0.8; dry friction of the bodies.
Chain: models.py, judging.py -> contacts.py (here) -> __main__.py.
"""

from __future__ import annotations

import numpy as np

from .affine import draw_options
from .models import Case, Event, Model
from .oracle import sensitivity_of_row

TITLE = "impacts and contacts"


def structure(seed):
    """A random Model: body i has position 2 i and velocity 2 i + 1."""
    r = np.random.default_rng([3, seed])
    bodies = int(r.choice([1, 2, 3], p=[0.45, 0.4, 0.15]))
    M = Model(2 * bodies, [[] for _ in range(2 * bodies)])
    light = [M.new() for _ in range(bodies)]  # 1/mass
    # A wall that moves is a body on which no force acts: its speed may be kicked.
    wall = bodies - 1 if bodies > 1 and r.random() < 0.3 else None
    forces = [i for i in range(bodies) if i != wall]
    forced = r.random() < 0.4
    jumps = r.random() < 0.5  # a force that jumps at an instant, or where another body passes a point
    frictional = [i for i in forces if r.random() < 0.2]
    M.surfaces = [
        [M.term(1, M.T if r.random() < 0.7 or bodies == 1 else 0, parameter=False), M.term(1)]
    ] * jumps
    M.surfaces += [[M.term(1, 2 * i + 1, parameter=False)] for i in frictional]
    M.notation = [str(r.choice(["Switch", "sign"])) for _ in M.surfaces]
    pairs = []
    for i in forces:
        if r.random() < 0.8 or not pairs:
            pairs.append((i, None, 1 if r.random() < 0.75 else -1))
        if bodies > 1 and r.random() < 0.6:
            k = int(r.choice([q for q in range(bodies) if q != i]))
            if (k, i) not in [(a, b) for a, b, _ in pairs]:
                pairs.append((i, k, 1))
    pairs = pairs[:3]
    M.gaps = [None] * len(pairs)
    for i in range(bodies):
        M.rates[2 * i].append(M.term(1, 2 * i + 1, parameter=False))
        if i == wall:
            continue
        force = M.rates[2 * i + 1]
        force.append(M.term(1))
        for v, chance in ((2 * i, 0.5), (2 * i + 1, 0.4), (M.S if forced else None, 0.5)):
            if v is not None and r.random() < chance:
                force.append(M.term(1, v))
        if bodies > 1 and r.random() < 0.3:
            force.append(M.term(0.5, 2 * int(r.integers(bodies))))
        if jumps and (r.random() < 0.6 or i == forces[0]):
            force.append(M.term(1, M.lam(0)))
    for q, i in enumerate(frictional):
        M.rates[2 * i + 1].append(M.term(-0.5, M.lam(jumps + q)))
    for k, (i, other, side) in enumerate(pairs):
        gap = [(float(side), None, {2 * i: 1})]
        if other is not None:
            gap.append((-1.0, None, {2 * other: 1}))
        elif r.random() < 0.3:
            gap.append(M.term(0.3, M.S))
        if other is None or r.random() < 0.5:
            gap.append(M.term(1))
        M.gaps[k] = gap
        M.restitution.append(M.new())
        M.rates[2 * i + 1].append((float(side), light[i], {M.reaction(k): 1}))
        if other is not None and other != wall:
            M.rates[2 * other + 1].append((-1.0, light[other], {M.reaction(k): 1}))
    for _ in range(int(r.choice([0, 1, 2], p=[0.45, 0.4, 0.15]))):
        i = int(r.integers(bodies)) if wall is None else wall
        M.events.append(Event([M.term(1, M.T, parameter=False), M.term(1)], {2 * i + 1: [M.term(1)]}))
    return M


def case(M, seed, options=True):
    """Random numbers for it: weights press on the walls, some bodies begin at rest in contact."""
    r = np.random.default_rng([4, seed])
    for _ in range(50):
        drawn = _draw(M, r, options)
        if _possible(M, drawn):
            break
    return drawn


def _draw(M, r, options):
    p = r.uniform(-1.2, 1.2, M.parameters)
    p[: M.n // 2] = r.uniform(0.5, 2, M.n // 2)
    for q in M.restitution:
        p[q] = 0.0 if r.random() < 0.35 else r.uniform(0.1, 0.8)
    for i, row in enumerate(M.rates):
        for number, q, powers in row:
            if q is None:
                continue
            if not powers:
                p[q] = r.uniform(-2, 0.4)
            elif i in powers or i - 1 in powers:
                p[q] = -abs(p[q])  # damping and stiffness
            elif number == -0.5:
                p[q] = abs(p[q])  # friction
    t0 = float(r.choice([0.0, 0.0, r.uniform(-3, 3)]))
    end = float(r.uniform(1, 6))
    for row in [*M.surfaces, *(e.surface for e in M.events)]:
        if row[0][2].keys() == {M.T}:
            p[row[1][1]] = -(t0 + end * r.uniform(0.1, 0.9))
    start = r.uniform(-1, 1, M.n)
    closed = []
    w, a = float(r.uniform(0.5, 3)), float(r.uniform(0, 6))
    rest = r.random() < 0.4
    if rest:
        start[1::2] = 0.0
    for k, gap in enumerate(M.gaps):
        # Offsets that open the gap at the start, or close it exactly.
        value = sum(n * (1 if q is None else p[q]) * _at(M, start, powers, w * t0 + a) for n, q, powers in gap)
        offset = [q for _, q, powers in gap if not powers]
        moves = any(M.S in powers for _, _, powers in gap)
        if offset:
            p[offset[0]] -= value
            if rest and not moves and r.random() < 0.6:
                exact = sum(n * (1 if q is None else p[q]) * _at(M, start, powers, 0.0) for n, q, powers in gap)
                if exact == 0.0:
                    closed.append(k)
                    continue
            p[offset[0]] += r.uniform(0.2, 1.5)
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    return Case(p, w, a, start, t0, instants, tuple(closed), options=draw_options(r) if options else {})


def _at(M, start, powers, angle):
    values = [*start, np.sin(angle)]
    return float(np.prod([values[v] for v in powers])) if powers else 1.0


def _possible(M, case):
    """Whether all gaps are open or closed at the start, and the closed ones constrain different motions."""
    D, v = M.tables(case.p, case.w), np.zeros(M.n + 3 + len(M.surfaces) + len(M.gaps))
    pushes = [[sensitivity_of_row(D, D.m + i, v, D.m + k) for k in case.closed] for i in case.closed]
    if case.closed and np.linalg.matrix_rank(pushes) < len(case.closed):
        return False
    for k, gap in enumerate(M.gaps):
        value = sum(
            n * (1 if q is None else case.p[q]) * _at(M, case.start, powers, case.w * case.t0 + case.a)
            for n, q, powers in gap
        )
        if not (k in case.closed or value > 1e-3):
            return False
    return True
