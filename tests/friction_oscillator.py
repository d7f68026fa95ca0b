"""The friction oscillator in the package's notation, for the tests that compare it with the references."""

import sympy as sp

from pwsmooth import Switch, System

t, y, v, z = sp.symbols("t y v z", real=True)
rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
lam = Switch("lam", v)

VALUES = {rho: 3, beta: 0.1, k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1}


def hidden(**values):
    """With the hidden term: gamma = 1 - lam^2, z relaxes in the time beta."""
    system = System(
        {
            y: v,
            v: -sigma * sp.sin(omega * t) - k * y - c * v - N * lam * (1 + rho * z),
            z: (1 - lam**2 - z) / beta,
        },
        time=t,
        parameters=VALUES,
        outputs={"mu": lam * (1 + rho * z)},
    )
    return system.with_parameters(values)


def coulomb(**values):
    """Without it: rho = 0, and no z."""
    system = System(
        {y: v, v: -sigma * sp.sin(omega * t) - k * y - c * v - N * lam},
        time=t,
        parameters={p: VALUES[p] for p in (k, c, N, sigma, omega)},
    )
    return system.with_parameters(values)
