"""Models of the stiff path, lowered by hand."""

import numpy as np
import sympy as sp

from pwsmooth.definition.model import Model

SIGMOIDS = {"algebraic": lambda u: u / sp.sqrt(1 + u**2), "tanh": sp.tanh, "erf": sp.erf}
PERIOD = 2 * np.pi


def friction(sigmoid="algebraic"):
    """The smoothed friction oscillator; states (y, v, z)."""
    t, y, v, z = sp.symbols("t y v z", real=True)
    names = sp.symbols("rho beta k c N sigma omega eps", nonnegative=True)
    rho, beta, k, c, N, sigma, omega, eps = names
    lam = SIGMOIDS[sigmoid](v / eps)
    rates = (v, -sigma * sp.sin(omega * t) - k * y - c * v - N * lam * (1 + rho * z), (1 - lam**2 - z) / beta)
    return Model(t, (y, v, z), names, rates, smoothing=((v, eps),), sigmoid=sigmoid)


def values(eps, beta, rho=3.0, k=3.1, sigma=2.4):
    """Parameters in the order of `friction`."""
    return np.array([rho, beta, k, 0.1, 1.0, sigma, 1.0, eps])


def two_blocks(sigmoid="tanh"):
    """Two blocks and a belt: surfaces that are no states, one of them moving with time; two widths."""
    t, x1, v1, x2, v2 = sp.symbols("t x1 v1 x2 v2", real=True)
    e1, e2 = sp.symbols("e1 e2", positive=True)
    h1, h2 = v1 - sp.Rational(1, 2) - sp.cos(t) / 5, v2 - v1
    lam1, lam2 = SIGMOIDS[sigmoid](h1 / e1), SIGMOIDS[sigmoid](h2 / e2)
    rates = (v1, x2 - 2 * x1 - lam1 + lam2 / 2, v2, x1 - x2 - lam2 / 2)
    return Model(t, (x1, v1, x2, v2), (e1, e2), rates, smoothing=((h1, e1), (h2, e2)), sigmoid=sigmoid)


def slowed_chain(n):
    """n masses, each rubbing smoothly on the ground: 2n states, a banded Jacobian."""
    t, eps = sp.Symbol("t"), sp.Symbol("eps", positive=True)
    x, v = sp.symbols(f"x:{n}"), sp.symbols(f"v:{n}")
    wall = (0, *x, 0)
    rates = [
        wall[i] - 2 * wall[i + 1] + wall[i + 2] - sp.tanh(v[i] / eps) / 4 + sp.sin(t) / (i + 1)
        for i in range(n)
    ]
    return Model(t, x + v, (eps,), (*v, *rates), smoothing=tuple((s, eps) for s in v), sigmoid="tanh")


def dense_relaxation(n):
    """Every state in every rate: too full for an elimination written out."""
    t, a = sp.symbols("t a")
    x = sp.symbols(f"x:{n}")
    total = sum(x)
    return Model(t, x, (a,), tuple(a * (sp.cos(t) - s) - sp.sin(total) / (i + 2) for i, s in enumerate(x)))
