"""LuGre's scenes, and laws that do not drift, by SciPy's LSODA: what figure "lugre" is held against. SI units, 1 kg."""

import numpy as np
from scipy.integrate import solve_ivp

S0, S1, S2 = 1e5, np.sqrt(1e5), 0.4


def stribeck(v):
    """g(v) in N."""
    return 1 + 0.5 * np.exp(-((v / 1e-3) ** 2))


def lugre(z, v):
    """(z', force)."""
    rate = v - S0 * abs(v) / stribeck(v) * z
    return rate, S0 * z + S1 * rate + S2 * v


def elastoplastic(z, v, z_ba=13e-6, z_max=15e-6):
    """(z', force) of Dupont's law with fixed bounds."""
    share = 0.0
    if z * v > 0 and abs(z) > z_ba:
        share = (
            0.5 * np.sin(np.pi * (abs(z) - (z_max + z_ba) / 2) / (z_max - z_ba)) + 0.5
            if abs(z) < z_max
            else 1.0
        )
    rate = v * (1 - share * np.sign(v) * z * S0 / stribeck(v))
    return rate, S0 * z + S1 * rate + S2 * v


def xky(a, v):
    """(a', force) of the law of one state."""
    force = np.clip(S0 * a + S1 * v, -stribeck(v), stribeck(v))
    return (force - S0 * a) / S1, force + S2 * v


def driven(law, force, times, *, max_step):
    """(x, v) at `times` of a mass that starts at rest under force(t, x, v)."""

    def rate(t, s):
        bristle, friction = law(s[2], s[1])
        return [s[1], force(t, s[0], s[1]) - friction, bristle]

    run = solve_ivp(
        rate, (0, times[-1]), [0.0] * 3, "LSODA", t_eval=times, rtol=1e-9, atol=1e-14, max_step=max_step
    )
    return run.y[0], run.y[1]


def ramps(t):
    """The slow force of the presliding scene, +-1.425 N."""
    return float(np.interp(t, [0, 10, 15, 35, 40, 60, 65], [0, 1.425, 1.425, -1.425, -1.425, 1.425, 1.425]))


def hunting(times):
    """x under u = -6 v - 3 (x - 1) - 4 int (x - 1)."""

    def rate(t, s):
        bristle, friction = lugre(s[2], s[1])
        return [s[1], -6 * s[1] - 3 * (s[0] - 1) - 4 * s[3] - friction, bristle, s[0] - 1]

    run = solve_ivp(
        rate, (0, times[-1]), [0.0] * 4, "LSODA", t_eval=times, rtol=1e-9, atol=1e-14, max_step=0.01
    )
    return run.y[0]
