"""The largest shaking under which a stuck block with a relaxing hidden term rests, from the period map of z by SciPy.

At rest A sin t is held by lam = A sin t/(1 + 3 z), with beta z' = 1 - lam^2 - z of period pi. Solutions of a scalar
equation do not cross, so that the map P rises, and there is a periodic z as long as P(z) >= z somewhere.
"""

import math

from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar


def rest_limit(beta, low=1.79, high=2.6):
    """A at which max over z of P(z) - z is 0: there the periodic z ends, in a saddle-node."""

    def gain(z, A):
        def rate(t, x):
            return [(1 - (A * math.sin(t) / (1 + 3 * x[0])) ** 2 - x[0]) / beta]

        def lost(t, x):
            return x[0] + 0.3

        lost.terminal = True
        run = solve_ivp(rate, (0, math.pi), [z], "DOP853", events=lost, rtol=1e-11, atol=1e-13)
        # One that runs away counts the less the earlier it does, so that a search finds the others.
        return run.t[-1] - math.pi - 1 if run.status == 1 else float(run.y[0, -1]) - z

    def most(A):
        return -float(
            minimize_scalar(lambda z: -gain(z, A), bounds=(0, 1), method="bounded", options={"xatol": 1e-9}).fun
        )

    return brentq(most, low, high, xtol=1e-8)
