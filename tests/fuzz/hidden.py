"""Hidden terms: polynomials in lambda to degree six on one surface or two, driven through folds.

The first root on lambda's way decides arrivals, a double root ends a slide; both from all real roots of the polynomial.
Chain: models.py, judging.py -> hidden.py (here) -> __main__.py.
"""

from __future__ import annotations

import numpy as np

from .affine import draw_options
from .models import Case, Model

TITLE = "hidden polynomials in lambda"


def structure(seed):
    """A random Model; states 0 (and 1) slip, others only follow."""
    r = np.random.default_rng([7, seed])
    m = 1 if r.random() < 0.75 else 2
    n = m + int(r.integers(0, 3))
    M = Model(n, [[] for _ in range(n)])
    for j in range(m):
        surface = [M.term(1, j, parameter=False)]
        if r.random() < 0.3 and n > m:
            surface.append(M.term(0.5, n - 1))
        if r.random() < 0.25:
            surface.append(M.term(0.5, M.S))
        if r.random() < 0.4:
            surface.append(M.term(1))
        M.surfaces.append(surface)
        M.notation.append("Switch")
    for i in range(n):
        row = M.rates[i]
        row.append(M.term(1))
        row += [M.term(1, k) for k in range(n) if r.random() < 0.4]
        if i < m or r.random() < 0.3:
            row.append(M.term(2, M.S))
        if i < m:
            degree = int(r.integers(2, 7))
            row += [M.term(1, *[M.lam(i)] * q) for q in range(1, degree + 1)]
            if m == 2 and r.random() < 0.5:
                row.append(M.term(0.4, M.lam(1 - i)))
        else:
            row += [M.term(1, *[M.lam(0)] * q) for q in (1, 2, 3) if r.random() < 0.5]
    return M


def case(M, seed, options=True):
    """Random numbers for it."""
    r = np.random.default_rng([8, seed])
    p = r.uniform(-1.5, 1.5, M.parameters)
    for i, row in enumerate(M.rates):
        for _, q, powers in row:
            if powers == {i: 1}:
                p[q] = -abs(p[q])
            if i < len(M.surfaces) and powers == {M.lam(i): 1} and r.random() < 0.85:
                p[q] = -abs(p[q]) - 0.3
    start = r.uniform(-1, 1, M.n)
    t0 = float(r.choice([0.0, 0.0, r.uniform(-3, 3)]))
    end = float(r.uniform(1, 6))
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    return Case(p, float(r.uniform(0.5, 3)), float(r.uniform(0, 6)), start, t0, instants,
                options=draw_options(r) if options else {})  # fmt: skip
