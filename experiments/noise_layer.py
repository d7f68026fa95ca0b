"""What theory says of a stuck contact under noise, at a constant force F between N and N mu_s (rho = 3, N = 1).

    u' = F - L(u)(1 + rho z),   z' = r (G(u) - z),     L = u/sqrt(1 + u^2),  G = 1 - L^2,  r = eps/beta

The stuck state and the saddle are the roots of F = lam (1 + rho (1 - lam^2)). A kick of size kappa moves u by
kappa/eps; it leads out if it passes the stable manifold of the saddle at the stuck z. A diffusion D acts in u through
s^2 = D^2/eps. With z slaved there is a potential, U' = -(F - L (1 + rho G)), and the mean time to a far point has a
closed form (two integrals) with Kramers' formula as its limit; with z frozen there is no saddle, and with a finite r
no potential.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.integrate import cumulative_trapezoid, quad, solve_ivp
from scipy.optimize import brentq
from scipy.stats import laplace, norm, uniform

RHO = 3.0
LAM_FOLD = math.sqrt((1 + RHO) / (3 * RHO))
MU_S = 2 * RHO * LAM_FOLD**3
LAWS = {  # of standard deviation 1, and the size that Kicks takes for it
    "uniform": (uniform(-math.sqrt(3), 2 * math.sqrt(3)), math.sqrt(3)),
    "normal": (norm(), 1.0),
    "laplace": (laplace(scale=math.sqrt(0.5)), 1.0),
}
RATIO = 1.5  # of mean times, with static friction over without, at which it counts as gone


def place(lam):
    """u(lambda)."""
    return lam / math.sqrt(1 - lam * lam)


@functools.cache
def roots(force):
    """u of the stuck state and of the saddle."""

    def excess(lam):
        return lam * (1 + RHO * (1 - lam * lam)) - force

    return place(brentq(excess, 0.0, LAM_FOLD)), place(brentq(excess, LAM_FOLD, 1.0 - 1e-15))


@functools.cache
def way_out(force, ratio=1.0):
    """How far a kick has to move the stuck u: to the saddle's stable manifold at the stuck z."""
    stuck, saddle = roots(force)
    z0 = 1 / (1 + stuck * stuck)

    def leaves(u):
        def rates(_, w):
            root = math.sqrt(1 + w[0] * w[0])
            return [force - w[0] / root * (1 + RHO * w[1]), ratio * (1 / root**2 - w[1])]

        def out(_, w):
            return w[0] - (saddle + 30)

        def back(_, w):
            return abs(w[0] - stuck) + abs(w[1] - z0) - 0.02 * (saddle - stuck)

        out.terminal = back.terminal = True
        run = solve_ivp(rates, (0, 1e5), [u, z0], method="LSODA", rtol=1e-9, atol=1e-12, events=(out, back))
        return run.t_events[0].size > 0

    low, high = stuck + 0.1 * (saddle - stuck), saddle + 20.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if leaves(middle) else (middle, high)
    return 0.5 * (low + high) - stuck


def one_kick(force, kappa, law, ratio=1.0):
    """Probability that one kick of size kappa (in units of eps) leads out of the stuck state."""
    share = way_out(force, ratio) / kappa
    if law == "uniform":
        return max(0.0, 0.5 * (1 - share))
    return float(norm.sf(share))


def slope(u, force):
    """U'(u) of the slaved layer."""
    lam = u / np.sqrt(1 + u * u)
    return lam * (1 + RHO * (1 - lam * lam)) - force


def mean_exit_time(force, s2, far):
    """Mean layer time from the stuck state to u = far, z slaved: 2/s^2 int e^(2U/s^2) int e^(-2U/s^2)."""
    stuck, _ = roots(force)
    # To the left of the well the inner integrand falls like exp(-2 (1 + F)|u|/s^2).
    u = np.linspace(stuck - 4 - 20 * s2, far, 20_001)
    step = u[1] - u[0]
    potential = cumulative_trapezoid(slope(u, force), u, initial=0.0)
    growth = np.exp(2 / s2 * np.diff(potential)).tolist()
    # w = e^(2U/s^2) int e^(-2U/s^2) step by step: neither factor by itself stays within the range of numbers.
    w, values = 0.0, [0.0]
    for g in growth:
        w = w * g + 0.5 * step * (g + 1)
        values.append(w)
    return 2 / s2 * float(np.trapezoid(np.where(u >= stuck, values, 0.0), u))


def kramers(force, s2):
    """Kramers' mean time over the saddle: 2 pi/sqrt(U''(stuck)|U''(saddle)|) exp(2 dU/s^2)."""
    stuck, saddle = roots(force)
    step = 1e-5

    def bend(u):
        return (slope(u + step, force) - slope(u - step, force)) / (2 * step)

    height = quad(slope, stuck, saddle, args=(force,))[0]
    return 2 * math.pi / math.sqrt(bend(stuck) * -bend(saddle)) * math.exp(2 * height / s2)


def excess(ratio):
    """Of a ratio of mean times: nearly a straight line over the logarithm of the noise."""
    return np.log(np.log(np.maximum(ratio, 1.02)))


def crossing(sd, values, errors, level, line, near):
    """[sd, standard error] at which values fall to a level, by a weighted line through line(values) over log sd.

    The points are those around the first fall below the level that lie within `near`, and one beyond on each side;
    what comes later may rise again. None where nothing falls below it.
    """
    order = np.argsort(sd)
    sd, values, errors = (np.array(a, float)[order] for a in (sd, values, errors))
    below = np.flatnonzero(values < level)
    if not below.size or below[0] == 0:
        return None
    left, right = below[0] - 1, below[0]
    while left > 0 and values[left] < near[1]:
        left -= 1
    while right + 1 < len(sd) and values[right] > near[0]:
        right += 1
    x, y = np.log(sd[left : right + 1]), values[left : right + 1]
    step = 1e-4 * y + 1e-9
    errors = np.abs(line(y + step) - line(y - step)) / (2 * step) * errors[left : right + 1]
    # An error of 0, of shares that were 0 or 1 throughout, or beyond the line's own bounds, says nothing.
    weights = np.where(errors > 0, 1 / np.maximum(errors, 1e-3) ** 2, 1e-2)
    A = np.column_stack([x, np.ones_like(x)])
    covariance = np.linalg.inv(A.T @ (weights[:, None] * A))
    slope, offset = covariance @ (A.T @ (weights * line(y)))
    at = (float(line(level)) - offset) / slope
    gradient = np.array([-at / slope, -1 / slope])
    return [float(np.exp(at)), float(np.exp(at) * math.sqrt(gradient @ covariance @ gradient))]
