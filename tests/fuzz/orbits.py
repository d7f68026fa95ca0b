"""Periodic orbits that are known, with their multipliers, of unstable systems made around them.

    x' = p_s'(t) + A_s (x - p_s(t)),   s = sign x_1,   p_s,1 = (1 + s d) sin t,   p_s,j random in sin t and cos t
    at x_1 = 0:   nothing (p_+ and p_- meet there), or a reset x -> R x + r that takes one to the other

x = p_s(t) is an orbit of period 2 pi, with crossings at 0 and pi. Its fundamental matrix is

    exp(A_- pi) S_pi exp(A_+ pi) S_0,    S = R + (p_s' - R p_-s') e_1^T / p_-s,1'

the eigenvalues of which are computed with so many digits that none is lost (mpmath). Searched for from a point beside
it: `python -m tests.fuzz.orbits --cases 100`.

right          found, with every multiplier to 1e-8 and roundings of what a segment shrinks most
refused        not found, and said so
another        another orbit was found: the system has more than one
WRONG          a wrong multiplier
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter

import mpmath
import numpy as np
import sympy as sp

from pwsmooth import Event, Strobe, System, find_orbit
from tests.fuzz.judging import REFUSED, RIGHT, WRONG, Verdict

ANOTHER = "another"
PHASE = 0.23  # of the section: away from the crossings at 0 and 1/2

t = sp.Symbol("t", real=True)


class Planted:
    """A system with its orbit; `growth` is the largest rate of A."""

    def __init__(self, seed: int, resets: bool, growth: float) -> None:
        rng = np.random.default_rng(seed)
        n = self.n = int(rng.integers(2, 5))
        self.states = sp.symbols(f"x1:{n + 1}", real=True)
        self.A = {s: _matrix(rng, n, growth) for s in (1, -1)}
        d, sine, cosine = 0.3 * rng.uniform(), sp.sin(t), sp.cos(t)
        self.p, common = {}, [rng.normal(size=2).round(3) for _ in range(n)]
        for s in (1, -1):
            rows = [(1 + s * d) * sine]
            for j in range(1, n):
                a, b = common[j] if not resets else rng.normal(size=2).round(3)
                # Without resets both pieces meet at 0 and pi.
                rows.append(a * cosine + b * sine + s * round(rng.normal(), 3) * sine)
            self.p[s] = sp.Matrix(rows)
        self.R, self.r = {}, {}
        events = []
        for s, at in ((1, 0), (-1, sp.pi)):  # to the side s
            R = np.eye(n)
            if resets:
                R[1:] = rng.normal(size=(n - 1, n)).round(3)
            before, after = (np.array(self.p[side].subs(t, at), float).ravel() for side in (-s, s))
            r = after - R @ before
            r[0] = 0.0
            self.R[s], self.r[s] = R, r
            if resets:
                update = {
                    x: sum(c * y for c, y in zip(R[j], self.states)) + r[j]
                    for j, x in enumerate(self.states) if j
                }  # fmt: skip
                events.append(Event(self.states[0], direction=s, update=update, name=f"to{s}"))
        side = sp.sign(self.states[0])
        rates = {}
        x = sp.Matrix(self.states)
        fields = {s: self.p[s].diff(t) + sp.Matrix(self.A[s]) * (x - self.p[s]) for s in (1, -1)}
        for j, state in enumerate(self.states):
            rates[state] = (fields[1][j] + fields[-1][j]) / 2 + side * (fields[1][j] - fields[-1][j]) / 2
        self.system = System(rates, time=t, events=events)

    def at(self, time: float) -> np.ndarray:
        s = 1 if np.sin(time) > 0 else -1
        return np.array(self.p[s].subs(t, time), float).ravel()

    def multipliers(self) -> np.ndarray:
        """Largest first, to all digits of a float."""
        with mpmath.workdps(80):
            total = mpmath.eye(self.n)
            for s, at in ((1, sp.Integer(0)), (-1, sp.pi)):
                before, after = (mpmath.matrix(self.p[side].diff(t).subs(t, at).evalf(60)) for side in (-s, s))
                R = mpmath.matrix(self.R[s].tolist())
                jump = after - R * before
                S = R.copy()
                for i in range(self.n):
                    S[i, 0] += jump[i] / before[0]
                total = mpmath.expm(mpmath.matrix(self.A[s].tolist()) * mpmath.pi) * S * total
            values = mpmath.eig(total, left=False, right=False)
        found = np.array([complex(value) for value in values])
        return found[np.argsort(-np.abs(found))]


def _matrix(rng: np.random.Generator, n: int, growth: float) -> np.ndarray:
    """Real eigenvalues between -growth and growth, the eigenvectors not too near to each other."""
    V = np.eye(n) + 0.5 * rng.normal(size=(n, n)) / np.sqrt(n)
    return (V @ np.diag(rng.uniform(-growth, growth, n)) @ np.linalg.inv(V)).round(3)


def play(seed: int, resets: bool, growth: float) -> tuple[Verdict, np.ndarray]:
    """The verdict on one system, and its multipliers."""
    planted, rng = Planted(seed, resets, growth), np.random.default_rng([1, seed])
    x, exact = planted.at(2 * np.pi * PHASE), planted.multipliers()
    orbit = find_orbit(planted.system, x + 1e-6 * rng.normal(size=len(x)), seen=Strobe(2 * sp.pi, phase=PHASE))
    if not orbit.success:
        return Verdict(REFUSED), exact
    if np.abs(orbit.x - x).max() > 1e-8:
        return Verdict(ANOTHER), exact
    # What fifty roundings of a segment's matrix do to the direction that it shrinks most.
    matrices = [orbit.jacobian] if orbit.segments is None else orbit.segments.matrices
    slack = np.abs(exact) * (1e-8 + 1e-14 * max(np.linalg.cond(one) for one in matrices))
    off = np.array([np.abs(orbit.multipliers - one).min() for one in exact])
    error = float((off / np.abs(exact)).max())
    return Verdict(RIGHT if (off <= slack).all() else WRONG, "a multiplier", error), exact


def main(arguments: list[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args(arguments)
    counts: Counter[str] = Counter()
    largest = 0.0
    for k in range(given.first, given.first + given.cases):
        verdict, exact = play(k // 2, bool(k % 2), (0.5, 1.5, 3.0, 5.0)[k // 2 % 4])
        counts[verdict.kind] += 1
        if verdict.kind == RIGHT:
            largest = max(largest, float(np.abs(exact).max()))
        if verdict.kind == WRONG:
            print(f"seed {k // 2}, resets {bool(k % 2)}: error {verdict.error:.2g}", flush=True)
    print(dict(counts), f"largest multiplier of those found {largest:.2g}")
    return 1 if counts[WRONG] else 0


if __name__ == "__main__":
    sys.exit(main())
