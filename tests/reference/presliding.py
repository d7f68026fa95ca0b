"""The multistate law and GMS under prescribed motion, with SciPy: what figures 4.8 to 4.11 are held against.

    tau_d s' = g(v) - s,   a_i' = (f_i - kappa_i a_i)/sigma_i,   f_i = clip(kappa_i a_i + sigma_i v, share_i s)

and f = sum f_i; of GMS kappa_i z_i' = kappa_i v (stick) or C (share_i sgn v - kappa_i z_i/g(v)) (slip), from stick to
slip where |kappa_i z_i| reaches share_i g(v), back where v crosses zero. Units um, N, s.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

KAPPA = 2.5 / np.arange(1, 11)
SHARE = 0.1


def stribeck(v):
    """g(v) = 1 + exp(-(v/8)^2)."""
    return 1 + np.exp(-((v / 8) ** 2))


def multistate(velocity, end, *, sigma=0.01, tau_d=0.02, step=1e-3):
    """LSODA in pieces of `step`: times, forces, numbers in presliding, and the work int f v dt so far."""

    def parts(t, x):
        v = velocity(t)
        trial = KAPPA * x[1:11] + sigma * v
        return v, trial, np.clip(trial, -SHARE * x[0], SHARE * x[0])

    def rate(t, x):
        v, _, f = parts(t, x)
        return np.concatenate([[(stribeck(v) - x[0]) / tau_d], (f - KAPPA * x[1:11]) / sigma, [f.sum() * v]])

    times = np.linspace(0, end, round(end / step) + 1)
    start = np.concatenate([[stribeck(velocity(0.0))], np.zeros(11)])
    run = solve_ivp(rate, (0, end), start, "LSODA", t_eval=times, rtol=1e-10, atol=1e-13, max_step=step)
    seen = [parts(t, x) for t, x in zip(times, run.y.T)]
    force = np.array([f.sum() for _, _, f in seen])
    count = np.array([np.sum(np.abs(trial) <= SHARE * x[0]) for (_, trial, _), x in zip(seen, run.y.T)])
    return times, force, count, run.y[11]


def gms(velocity, end, *, sigma=0.01, C=50.0):
    """DOP853 between the instants at which the number in presliding changes: (largest |force| after 0.2 s, these)."""
    z, slip, t = np.zeros(10), np.zeros(10), 0.0
    largest, changes = 0.0, []

    def rate(t, z):
        v = velocity(t)
        return np.where(slip == 0, v, C / KAPPA * SHARE * (slip - KAPPA * z / (SHARE * stribeck(v))))

    def force(t, z):
        return float(np.sum(KAPPA * z + sigma * rate(t, z)))

    while t < end:
        stuck = np.flatnonzero(slip == 0)

        def full(t, z, stuck=stuck):
            return float(np.max(np.abs(KAPPA * z)[stuck] / (SHARE * stribeck(velocity(t))), initial=0.0)) - 1

        def turn(t, z):
            return velocity(t)

        full.terminal = turn.terminal = True
        full.direction = 1
        run = solve_ivp(rate, (t, end), z, "DOP853", events=(full, turn), rtol=1e-10, atol=1e-13, max_step=1e-3)
        late = run.t > 0.2
        largest = max([largest, *(abs(force(a, b)) for a, b in zip(run.t[late], run.y.T[late]))])
        t, z = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            break
        if run.t_events[1].size and slip.any():
            slip = np.zeros(10)
            changes.append(t)
        elif run.t_events[0].size:
            at = stuck[np.argmax(np.abs(KAPPA * z)[stuck])]
            slip = slip.copy()
            slip[at] = np.sign(z[at])
            changes.append(t)
        t = np.nextafter(t, np.inf)
    return largest, np.array(changes)
