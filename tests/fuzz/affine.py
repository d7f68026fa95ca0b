"""Piecewise-affine systems with one to three switches: crossing, sliding on one and on several, exits.

Linear rates and forces in lambda, products of two multipliers, multipliers times states, |h| and max(h, 0); surfaces
that are a state, a sum, move with time, are an instant, or bend.
Chain: models.py, judging.py -> affine.py (here) -> __main__.py.
"""

from __future__ import annotations

import numpy as np

from .models import Case, Model

TITLE = "piecewise affine, 1 to 3 switches"


def structure(seed):
    """A random Model."""
    r = np.random.default_rng([1, seed])
    n, m = int(r.integers(1, 5)), int(r.choice([1, 2, 3], p=[0.35, 0.4, 0.25]))
    M = Model(n, [[] for _ in range(n)])
    M.surfaces = [None] * m
    x = range(n)
    forced = r.random() < 0.5
    for j in range(m):
        kind = r.choice(["state", "sum", "moving", "instant", "bent"], p=[0.4, 0.3, 0.17, 0.05, 0.08])
        i = int(r.integers(n))
        row = [M.term(1, i, parameter=False)]
        if kind == "instant":
            row = [M.term(1, M.T, parameter=False)]
        if kind in ("sum", "moving") and n > 1:
            k = int(r.choice([q for q in x if q != i]))
            row.append(M.term(1, k))
        if kind == "moving" and forced:
            row.append(M.term(1, M.S))
        if kind == "bent":
            k = int(r.integers(n))
            row.append(M.term(0.5, k, k))
        if kind == "instant" or r.random() < 0.6:
            row.append(M.term(1))
        if any(_same(row, other) for other in M.surfaces[:j]):
            row.append(M.term(1))  # one surface twice is one switch: invariance.py has these
        M.surfaces[j] = row
    M.notation = [str(r.choice(["Switch", "sign"])) for _ in range(m)]
    for i in x:
        for k in x:
            if r.random() < 0.65:
                M.rates[i].append(M.term(1, k))
        M.rates[i].append(M.term(1))
        if forced and r.random() < 0.5:
            M.rates[i].append(M.term(1, M.S))
        for j in range(m):
            if r.random() < 0.7 or any(i in powers for _, _, powers in M.surfaces[j]):
                M.rates[i].append(M.term(1, M.lam(j)))
            if r.random() < 0.08:
                M.rates[i].append(M.term(0.5, M.lam(j), int(r.integers(n))))
        if m > 1 and r.random() < 0.3:
            j, k = r.choice(m, 2, replace=False)
            M.rates[i].append(M.term(0.7, M.lam(int(j)), M.lam(int(k))))
    for j in range(m):
        if not any(M.lam(j) in powers for row in M.rates for _, _, powers in row):
            M.rates[int(r.integers(n))].append(M.term(1, M.lam(j)))
    if r.random() < 0.25:
        j = int(r.integers(m))
        M.kinks.append((int(r.integers(n)), 0.6, M.new(), j, str(r.choice(["Abs", "Max"]))))
    return M


def _same(row, other):
    """Whether the rows can vanish together for ever."""
    return len(row) == len(other) == 1 and row[0][2] == other[0][2]


def case(M, seed, options=True):
    """Random numbers for it."""
    r = np.random.default_rng([2, seed])
    p = r.uniform(-1.5, 1.5, M.parameters)
    # Mostly each multiplier opposes its surface, so that there is something to slide on.
    for j, surface in enumerate(M.surfaces):
        slope = 0.0
        own = [(q, powers) for row in M.rates for _, q, powers in row if powers == {M.lam(j): 1}]
        for number, q, powers in surface:
            if len(powers) == 1:
                (v,) = powers
                if v < M.n:
                    k = number * (1 if q is None else p[q])
                    slope += sum(k * p[u] for _, u, powers in M.rates[v] if powers == {M.lam(j): 1})
        if slope > 0 and r.random() < 0.8:
            for q, _ in own:
                p[q] *= -1
    if r.random() < 0.5:
        # Damped: longer runs stay small.
        for i, row in enumerate(M.rates):
            for _, q, powers in row:
                if powers == {i: 1}:
                    p[q] = -abs(p[q])
    start = r.uniform(-2, 2, M.n)
    on = []
    if r.random() < 0.1:
        for j, surface in enumerate(M.surfaces):
            if len(surface) == 1 and surface[0][2].keys() < set(range(M.n)) and r.random() < 0.5:
                start[next(iter(surface[0][2]))] = 0.0
                on.append(j)
    t0 = float(r.choice([0.0, 0.0, r.uniform(-5, 5)]))
    end = float(r.uniform(0.5, 6))
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    return Case(p, float(r.uniform(0.5, 3)), float(r.uniform(0, 6)), start, t0, instants, on=tuple(on),
                options=draw_options(r) if options else {})  # fmt: skip


def draw_options(r):
    """Tolerances, method and step of a run, at random."""
    options = {}
    if r.random() < 0.6:
        options["rtol"] = float(10 ** r.uniform(-12, -6))
        if r.random() < 0.5:
            options["atol"] = options["rtol"] * float(10 ** r.uniform(-3, 0))
    if r.random() < 0.2:
        options["method"] = "rk"
        options["rtol"] = max(options.get("rtol", 1e-9), 1e-12)  # the pair has its precision for a bound
    if r.random() < 0.1:
        options["max_step"] = float(r.uniform(0.02, 0.5))
    return options
