"""Dry friction in loops: bodies on a line that rub the ground and each other, several joints on one motion among them.

    m_i dv_i/dt = b_i(t) - sum_k J_ki F_k lambda_k,      b linear in time but for two instants at which it jumps

The oracle knows no lambda: accelerations are those of a box-constrained least-squares problem, speeds are parabolas,
and what sticks does so until a linear program finds no forces that hold it any more. In the system some surfaces have
factors that depend on places, so that their switches are not one.
Chain: judging.py -> loops.py (here) -> __main__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy as sp
from scipy.optimize import linprog, lsq_linear

from pwsmooth import Event, Switch, System

from . import judging
from .judging import REFUSED, RIGHT, UNDECIDED, WRONG, Played, Verdict

TITLE = "friction in loops"
BREAKS, END = (0.0, 2.0, 4.0), 6.0
_AT_REST, _STILL, _SOON = 1e-9, 1e-9, 1e-6  # of speeds, accelerations, times
_EVENTS = 400
_EXACT = dict(primal_feasibility_tolerance=1e-10, dual_feasibility_tolerance=1e-10)


@dataclass
class Model:
    """Bodies and joints; J (joints, bodies)."""

    J: np.ndarray

    def system(self):
        """The System of it, its numbers being parameters."""
        count, bodies = self.J.shape
        t = sp.Symbol("t", real=True)
        x, v, b, s = (sp.symbols(f"{name}0:{bodies}", real=True) for name in "xvbs")
        m, F = sp.symbols(f"m0:{bodies}", positive=True), sp.symbols(f"F0:{count}", positive=True)
        J = self.J.astype(int).tolist()
        grip = [0] * bodies
        for k, row in enumerate(J):
            factor = 2 + sp.cos(x[k % bodies]) if k % 3 == 1 else 1
            lam = Switch(f"lam{k}", factor * sum(c * u for c, u in zip(row, v, strict=True)))
            grip = [g + F[k] * c * lam for g, c in zip(grip, row, strict=True)]
        rates = dict(zip(x, v, strict=True))
        rates |= {v[i]: (b[i] - grip[i]) / m[i] for i in range(bodies)}
        rates |= dict(zip(b, s, strict=True)) | dict.fromkeys(s, 0)
        loads = sp.symbols(f"c0:{4 * bodies}", real=True)
        events = [
            Event(at=[at], update=dict(zip((*b, *s), loads[2 * bodies * k :], strict=False)))
            for k, at in enumerate(BREAKS[1:])
        ]
        parameters = dict.fromkeys((*m, *F, *loads), 1)
        return System(rates, time=t, events=events, parameters=parameters), {p.name for p in parameters}


@dataclass
class Case:
    """Masses, strengths, loads (3, bodies) and their rates, speeds at the start."""

    mass: np.ndarray
    F: np.ndarray
    load: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    options: dict

    @property
    def parameters(self) -> dict:
        """As solve() takes them."""
        later = np.concatenate(
            [np.concatenate([b, c]) for b, c in zip(self.load[1:], self.rate[1:], strict=True)]
        )
        named = {"m": self.mass, "F": self.F, "c": later}
        return {f"{name}{i}": float(u) for name, values in named.items() for i, u in enumerate(values)}

    @property
    def start(self) -> list[float]:
        """As solve() takes it."""
        return [*np.zeros(len(self.mass)), *self.speed, *self.load[0], *self.rate[0]]


def structure(seed):
    """A chain with the ground under all, at both ends, or at some, perhaps closed to a ring; joints may stand twice."""
    r = np.random.default_rng([61, seed])
    bodies = int(r.integers(1, 6))
    joints = [(i, i + 1) for i in range(bodies - 1)]
    kind = r.integers(3)
    if kind == 0:
        joints += [(i, -1) for i in range(bodies)]
    elif kind == 1:
        joints += [(0, -1), (bodies - 1, -1)]
    else:
        joints += [(0, bodies - 1)] * (bodies > 2)
        joints += [(int(r.integers(bodies)), -1) for _ in range(r.integers(1, 4))]
    for _ in range(r.integers(0, 3)):
        i, j = (int(u) for u in r.integers(bodies, size=2))
        joints += [(i, j)] * (i != j)
    J = np.zeros((len(joints), bodies))
    for k, (i, j) in enumerate(joints):
        J[k, i] = 1
        if j >= 0:
            J[k, j] = -1
    return Model(J)


def case(M, seed):
    """Random numbers for it; three in ten begin at rest."""
    r = np.random.default_rng([62, seed])
    count, bodies = M.J.shape
    speed = r.normal(0, 1, bodies) * (r.random() < 0.7)
    return Case(
        r.uniform(0.5, 2, bodies), r.uniform(0.2, 1.5, count), r.normal(0, 1.5, (3, bodies)),
        r.normal(0, 1.5, (3, bodies)), speed, {"rtol": 10 ** -r.uniform(8, 12), "atol": 1e-12},
    )  # fmt: skip


def _accelerations(M, one, b, side, still):
    """(joints of `still` that stick, the sides to which the others slip) under the load b."""
    J, F, mass = M.J, one.F, one.mass
    rest = b - J.T @ (F * side * ~still)
    at = np.flatnonzero(still)
    root = 1 / np.sqrt(mass)
    found = lsq_linear(
        (J[at].T * F[at]) * root[:, None], rest * root, (-1, 1), "bvls", tol=1e-14, max_iter=1000
    )
    rates = J[at] @ ((rest - J[at].T @ (F[at] * found.x)) / mass)
    sides = np.where(np.abs(rates) < _STILL, 0.0, np.sign(rates))
    return at[sides == 0], dict(zip(at, sides, strict=True))


def reference(M, one):
    """Places and speeds at the end, or None where the oracle does not know how to go on."""
    J, F, mass, bodies = M.J, one.F, one.mass, M.J.shape[1]
    x, v, t = np.zeros(bodies), one.speed.copy(), 0.0
    side, stuck = np.sign(J @ v), np.zeros(len(J), bool)
    for k, end in enumerate((*BREAKS[1:], END)):
        for _ in range(_EVENTS):
            still = stuck | (np.abs(J @ v) < _AT_REST)
            if still.any():
                sticks, sides = _accelerations(
                    M, one, one.load[k] + one.rate[k] * (t + _SOON - BREAKS[k]), side, still
                )
                stuck[:] = False
                stuck[sticks] = True
                for joint, way in sides.items():
                    side[joint] = way
            b = one.load[k] + one.rate[k] * (t - BREAKS[k]) - J.T @ (F * side * ~stuck)
            # All that moves without the joints that stick.
            _, sizes, ways = np.linalg.svd(J[stuck]) if stuck.any() else (None, np.zeros(0), np.eye(bodies))
            free = ways[(sizes > 1e-10).sum() :].T
            share = (
                free @ np.linalg.solve(free.T @ (mass[:, None] * free), free.T)
                if free.size
                else np.zeros((bodies,) * 2)
            )
            a, jerk = share @ b, share @ one.rate[k]
            left, ends = end - t, True
            if stuck.any():
                # The longest time until which forces in the bounds hold what sticks.
                A = np.hstack([(one.rate[k] - mass * jerk)[:, None], -(J[stuck].T * F[stuck])])
                bounds = [(0, left)] + [(-1, 1)] * int(stuck.sum())
                aim = [-1, *np.zeros(int(stuck.sum()))]
                found = linprog(
                    aim, A_eq=A, b_eq=mass * a - b, bounds=bounds, method="highs-ds", options=_EXACT
                )
                if found.status != 0:
                    return None
                if found.x[0] < left - 1e-9:
                    left, ends = found.x[0], False
            for joint in np.flatnonzero(~stuck):
                rows = [0.5 * J[joint] @ jerk, J[joint] @ a, J[joint] @ v]
                if abs(rows[2]) < _AT_REST:
                    rows = rows[:2]  # it has just left
                for root in np.roots(rows):
                    if abs(root.imag) < 1e-12 and _SOON * (len(rows) == 2) < root.real < left:
                        left, ends = root.real, False
            x = x + v * left + a * left**2 / 2 + jerk * left**3 / 6
            v = v + a * left + jerk * left**2 / 2
            t += left
            if ends:
                break
        else:
            return None
    return np.concatenate([x, v])


def compiled(module, key):
    """The structure of this key."""
    M = structure(key)
    return Played(module, M, *M.system())


def play(played, seed):
    """The verdict on one case."""
    M = played.model
    one = case(M, seed)
    expected = reference(M, one)
    if expected is None:
        return Verdict(UNDECIDED, "linear program")
    try:
        found = judging.solve(played.system, (0, END), one.start, parameters=one.parameters, max_steps=judging.STEPS,
                              **one.options)  # fmt: skip
    except Exception as error:
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])
    if not found.success:
        return Verdict(REFUSED, found.outcome.name)
    error = float(np.abs(found.x[: len(expected), -1] - expected).max())
    # The oracle's linear programs are exact to 1e-9 in time, its least squares to 1e-9 of an acceleration.
    allowed = 1e-6 + 1e3 * one.options["rtol"]
    return Verdict(RIGHT, error=error) if error < allowed else Verdict(WRONG, f"off by {error:.1e}", error)


def script(number, seed):
    """The case as a program."""
    M = structure(number)
    return f"J = {M.J.tolist()}\n# {case(M, seed)}\n"
