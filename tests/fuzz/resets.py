"""Events: resets to a place, beyond the own surface, kicks, reversals, latches, several at one instant.

Smooth rates between, sometimes with a switch; surfaces that are a state, a sum or an instant.
Chain: models.py, judging.py -> resets.py (here) -> __main__.py.
"""

from __future__ import annotations

import numpy as np

from .affine import draw_options
from .models import Case, Event, Model

TITLE = "resets, kicks, latches, simultaneous events"


def structure(seed):
    """A random Model; its last state is a Memory: a latch or a counter that stands in the rates."""
    r = np.random.default_rng([5, seed])
    n = int(r.integers(2, 5))
    M = Model(n, [[] for _ in range(n)], bare=(n - 1,))
    latch = n - 1
    oscillates = n > 2 and r.random() < 0.7
    if r.random() < 0.35:
        M.surfaces = [[M.term(1, 0, parameter=False), M.term(1)]]
        M.notation = ["sign"]
    for i in range(latch):
        if oscillates and i < 2:
            M.rates[i].append(M.term(1, 1, parameter=False) if i == 0 else M.term(-1, 0))
        else:
            M.rates[i].append(M.term(1))
        for k in range(latch):
            if r.random() < 0.3:
                M.rates[i].append(M.term(0.5, k))
        if r.random() < 0.3:
            M.rates[i].append(M.term(1, M.S))
        if r.random() < 0.3:
            M.rates[i].append(M.term(0.7, latch))
        if M.surfaces and (i == 0 or r.random() < 0.3):
            M.rates[i].append(M.term(0.5, M.lam(0)))
    for _ in range(int(r.choice([1, 2, 3], p=[0.45, 0.4, 0.15]))):
        i = int(r.integers(latch))
        kind = r.choice(["state", "sum", "instant"], p=[0.65, 0.2, 0.15])
        surface = [M.term(1, M.T if kind == "instant" else i, parameter=False), M.term(1)]
        if kind == "sum" and latch > 1:
            surface.append(M.term(1, (i + 1) % latch))
        update = {}
        for s in {i, int(r.integers(latch))}:
            how = r.choice(["to", "kick", "reverse", "none"], p=[0.35, 0.25, 0.25, 0.15])
            if how == "to":
                update[s] = [M.term(1), (-1.0, None, {s: 1})]
            elif how == "kick":
                update[s] = [M.term(0.5)]
            elif how == "reverse":
                update[s] = [M.term(-1, s), (-1.0, None, {s: 1})]
        if r.random() < 0.6:
            q = r.random()
            update[latch] = [(-2.0, None, {latch: 1})] if q < 0.4 else [(0.25, None, {})]
        M.events.append(Event(surface, update, int(r.choice([0, 1, -1], p=[0.6, 0.2, 0.2]))))
        if r.random() < 0.15:
            # A second event at the same instants: increments of both count.
            s = int(r.integers(latch))
            taken = update.get(s)
            if taken is None or all(not powers for _, _, powers in taken):
                M.events.append(Event(surface, {s: [M.term(0.3)]}, M.events[-1].direction))
    if not any(latch in powers for row in M.rates for _, _, powers in row):
        M.rates[0].append(M.term(0.7, latch))
    return M


def case(M, seed, options=True):
    """Random numbers for it."""
    r = np.random.default_rng([6, seed])
    p = r.uniform(-1.5, 1.5, M.parameters)
    for i, row in enumerate(M.rates):
        for number, q, powers in row:
            if q is not None and i in powers and number == 0.5:
                p[q] = -abs(p[q])
            if number == -1 and 0 in powers:
                p[q] = abs(p[q]) + 0.5  # the oscillator's stiffness
    for e in M.events:
        for row in e.update.values():
            for number, q, _ in row:
                if number == -1 and q is not None:
                    p[q] = r.uniform(0.2, 0.95)
    t0 = float(r.choice([0.0, 0.0, r.uniform(-3, 3)]))
    end = float(r.uniform(1, 6))
    for e in M.events:
        if M.T in e.surface[0][2]:
            p[e.surface[1][1]] = -(t0 + end * r.uniform(0.1, 0.9))
    start = r.uniform(-1.5, 1.5, M.n)
    start[-1] = 1.0
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    return Case(p, float(r.uniform(0.5, 3)), float(r.uniform(0, 6)), start, t0, instants,
                options=draw_options(r) if options else {})  # fmt: skip
