"""Dry friction in loops: bodies on a line that rub the ground and each other, several joints on one motion among them.

    m_i dv_i/dt = b_i(t) - sum_k J_ki F_k lambda_k,      h_k = sum_i J_ki v_i - u_k(t)

b is linear in time but for two instants at which it jumps, u a parabola: how what a joint rubs is driven. Not all u
agree with one motion, at once or later, so that joints of a loop may not stay together.
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
_LINEAR = 1e-4
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
        d, e = sp.symbols(f"d0:{count}", real=True), sp.symbols(f"e0:{count}", real=True)
        grip = [0] * bodies
        for k, row in enumerate(J):
            factor = 2 + sp.cos(x[k % bodies]) if k % 3 == 1 else 1
            speed = sum(c * u for c, u in zip(row, v, strict=True)) - d[k] * t - e[k] * t**2 / 2
            lam = Switch(f"lam{k}", factor * speed)
            grip = [g + F[k] * c * lam for g, c in zip(grip, row, strict=True)]
        rates = dict(zip(x, v, strict=True))
        rates |= {v[i]: (b[i] - grip[i]) / m[i] for i in range(bodies)}
        rates |= dict(zip(b, s, strict=True)) | dict.fromkeys(s, 0)
        loads = sp.symbols(f"c0:{4 * bodies}", real=True)
        events = [
            Event(at=[at], update=dict(zip((*b, *s), loads[2 * bodies * k :], strict=False)))
            for k, at in enumerate(BREAKS[1:])
        ]
        parameters = dict.fromkeys((*m, *F, *d, *e, *loads), 1)
        return System(rates, time=t, events=events, parameters=parameters), {p.name for p in parameters}


@dataclass
class Case:
    """Masses, strengths, loads (3, bodies) and their rates, speeds at the start, u' and u'' at the start."""

    mass: np.ndarray
    F: np.ndarray
    load: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    d: np.ndarray
    e: np.ndarray
    options: dict

    @property
    def parameters(self) -> dict:
        """As solve() takes them."""
        later = np.concatenate(
            [np.concatenate([b, c]) for b, c in zip(self.load[1:], self.rate[1:], strict=True)]
        )
        named = {"m": self.mass, "F": self.F, "d": self.d, "e": self.e, "c": later}
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
    one = Case(
        r.uniform(0.5, 2, bodies), r.uniform(0.2, 1.5, count), r.normal(0, 1.5, (3, bodies)),
        r.normal(0, 1.5, (3, bodies)), speed, *np.zeros((2, count)), {"rtol": 10 ** -r.uniform(8, 12), "atol": 1e-12},
    )  # fmt: skip
    if r.random() < 0.6:
        # The frame of all is driven, or some joints on their own, from the first or the second derivative on.
        one.d, one.e = M.J @ r.normal(0, 0.3, bodies), M.J @ r.normal(0, 0.3, bodies)
        alone = r.normal(0, 0.3, count) * (r.random(count) < 0.3)
        one.d += alone * (r.random() < 0.5)
        one.e += alone
    return one


def _accelerations(M, one, b, d, side, still):
    """(joints of `still` that stick, the sides to which the others slip) under the load b, with u' = d."""
    J, F, mass = M.J, one.F, one.mass
    rest = b - J.T @ (F * side * ~still)
    at = np.flatnonzero(still)
    root = 1 / np.sqrt(mass)
    # The last row adds sum F d lambda to what is minimised, and a curvature that vanishes as lambda settles.
    A, lam = np.vstack([(J[at].T * F[at]) * root[:, None], -_LINEAR * F[at] * d[at]]), np.zeros(len(at))
    for _ in range(4 if d[at].any() else 1):
        y = np.append(rest * root, A[-1] @ lam + 1 / _LINEAR)
        lam = lsq_linear(A, y, (-1, 1), "bvls", tol=1e-25, max_iter=300).x
    rates = J[at] @ ((rest - J[at].T @ (F[at] * lam)) / mass) - d[at]
    sides = np.where(np.abs(rates) < _STILL, 0.0, np.sign(rates))
    return at[sides == 0], dict(zip(at, sides, strict=True))


def _moving(J, mass, load, d):
    """Accelerations of all under a load, where J a = d; None where there is none."""
    size = len(mass)
    A = np.block([[np.diag(mass), J.T], [J, np.zeros((len(J),) * 2)]])
    found = np.linalg.lstsq(A, np.concatenate([load, d]), rcond=1e-10)[0]
    return found[:size] if np.abs(J @ found[:size] - d).max(initial=0.0) < _STILL else None


def reference(M, one):
    """Places and speeds at the end, or None where the oracle does not know how to go on."""
    J, F, mass, bodies = M.J, one.F, one.mass, M.J.shape[1]
    x, v, t = np.zeros(bodies), one.speed.copy(), 0.0
    side, stuck = np.sign(J @ v), np.zeros(len(J), bool)
    for k, end in enumerate((*BREAKS[1:], END)):
        for _ in range(_EVENTS):
            speed, d = J @ v - one.d * t - one.e * t**2 / 2, one.d + one.e * t
            still = stuck | (np.abs(speed) < _AT_REST)
            if still.any():
                soon = one.load[k] + one.rate[k] * (t + _SOON - BREAKS[k])
                sticks, sides = _accelerations(M, one, soon, d + one.e * _SOON, side, still)
                stuck[:] = False
                stuck[sticks] = True
                for joint, way in sides.items():
                    side[joint] = way
            b = one.load[k] + one.rate[k] * (t - BREAKS[k]) - J.T @ (F * side * ~stuck)
            a, jerk = (_moving(J[stuck], mass, load, of[stuck]) for load, of in ((b, d), (one.rate[k], one.e)))
            if a is None or jerk is None:
                return None
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
                rows = [0.5 * (J[joint] @ jerk - one.e[joint]), J[joint] @ a - d[joint], speed[joint]]
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
