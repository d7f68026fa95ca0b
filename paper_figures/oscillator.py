"""The friction oscillator of the paper, its views and its settled orbits: what most figures draw.

    y' = v,   v' = q'' - k y - c v - N lam (1 + rho z),   beta z' = gamma(lam) - z     (eq. 25)

with q'' = -sigma sin(omega t) in the printed sign, gamma = 1 - lam**2, and the parameters of figure 8.
"""

import math

import numpy as np
import sympy as sp

from pwsmooth import Switch, System, solve
from pwsmooth.analysis.sticking import linear_sticking, nonlinear_sticking

t, y, v, z = sp.symbols("t y v z", real=True)
rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
lam = Switch("lam", v)
GAMMA = 1 - lam**2
PARAMETERS = {rho: 3, beta: 0.1, k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1}
DRIVE = -sigma * sp.sin(omega * t)
PERIOD = 2 * math.pi
MU_S = 16 / 9
# Starts at t = 0 that lead to the slaved orbit, and to the one of the mirror pair whose long stick comes first.
SLAVED_START = {y: 0.78, v: -1.03}
RELAXING_START = {y: 0.6, v: -1.07, z: 0}


def oscillator(**changes):
    """The system with other values for some parameters, by name."""
    values = {**PARAMETERS, **{s: changes[s.name] for s in PARAMETERS if s.name in changes}}
    return System(
        {y: v, v: DRIVE - k * y - c * v - N * lam * (1 + rho * z), z: (GAMMA - z) / beta},
        time=t,
        parameters=values,
        outputs={"mu": lam * (1 + rho * z)},
    )


def settled(view, start, *, periods=60, span=1, **options):
    """`span` periods of the orbit that `start` leads to, after `periods` periods, counted from t = 0 again."""
    transient = solve(view, (0, periods * PERIOD), start, **options)
    if not transient.success:
        raise RuntimeError(f"The transient did not finish: {transient.message}")
    state = dict(zip(transient.states, transient.x[:, -1]))
    orbit = solve(view, (0, span * PERIOD), state, dense_output=True, **options)
    if not orbit.success:
        raise RuntimeError(f"The orbit did not finish: {orbit.message}")
    return orbit


def sticks(orbit):
    """Segments that stick."""
    return [s for s in orbit.segments if s.status == (0,)]


def sticking_bounds(times):
    """Displacements (low, high) of the linear and of the nonlinear sticking region of figure 8."""
    numbers = {symbol: value for symbol, value in PARAMETERS.items() if symbol is not rho}
    drive = DRIVE.subs(numbers)
    regions = (
        linear_sticking(drive, numbers[k], numbers[N]),
        nonlinear_sticking(drive, numbers[k], numbers[N], GAMMA, lam, 3),
    )
    return tuple(
        tuple(np.broadcast_to(sp.lambdify(t, bound)(times), np.shape(times)) for bound in region.bounds)
        for region in regions
    )


def root_displacement(times, multiplier, strength=3.0):
    """y on the sticking manifold B at z = gamma(lam): (q'' - N lam (1 + rho gamma))/k."""
    return (-2.4 * np.sin(times) - multiplier * (1 + strength * (1 - multiplier**2))) / 3.1
