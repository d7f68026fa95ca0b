"""The smoothed oscillator under random kicks by fixed steps of Runge-Kutta's method, many seeds at once.

    y' = v,   v' = -2.4 sin t - 3.1 y - 0.1 v - L (1 + 3 z),   eps z' = 1 - L^2 - z,   L = u/sqrt(1 + u^2), u = v/eps

eps = 0.001; after every 1/500 of a period y and v each get an independent kick. What counts is mu = L (1 + 3 z).
"""

import numpy as np

EPS = 1e-3


def largest_mu(kappa, law, *, seeds=60, periods=2, steps=64, seed=0):
    """Largest |mu| while |v| <= 2 eps in each half period but the first two: (at all steps, just before kicks).

    `steps` between kicks, of a fifth of eps: the layer's fastest rate is 4/eps.
    """
    random = np.random.default_rng(seed)
    every = 2 * np.pi / 500
    h = every / steps
    x = np.tile([[0.78], [-1.03], [0.0]], seeds)

    def parts(x):
        u = x[1] / EPS
        multiplier = u / np.sqrt(1 + u * u)
        return multiplier, multiplier * (1 + 3 * x[2])

    def rate(t, x):
        multiplier, mu = parts(x)
        force = -2.4 * np.sin(t) - 3.1 * x[0] - 0.1 * x[1] - mu
        return np.stack([x[1], force, (1 - multiplier**2 - x[2]) / EPS])

    always, before = np.zeros((2, 2 * periods, seeds))
    for kick in range(500 * periods):
        half = kick // 250
        for step in range(steps):
            t = kick * every + step * h
            k1 = rate(t, x)
            k2 = rate(t + h / 2, x + h / 2 * k1)
            k3 = rate(t + h / 2, x + h / 2 * k2)
            k4 = rate(t + h, x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            mu = np.where(np.abs(x[1]) <= 2 * EPS, np.abs(parts(x)[1]), 0)
            always[half] = np.maximum(always[half], mu)
        before[half] = np.maximum(before[half], mu)
        drawn = random.uniform(-1, 1, (2, seeds)) if law == "uniform" else random.standard_normal((2, seeds))
        x[:2] += kappa * drawn
    return always[2:].ravel(), before[2:].ravel()
