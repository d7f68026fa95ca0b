r"""
Two masses on a moving belt
===========================

Two coupled blocks on a belt of speed :math:`V`, with friction that falls with the relative speed :math:`w_i
= V - \dot x_i`; a classical model of stick-slip in two degrees of freedom (Popp's, also Galvanetto's two
blocks of a fault):

.. math::

    \ddot x_1 = -x_1 - \kappa\,(x_1 - x_2) + \mu(w_1), \quad
    \ddot x_2 = -x_2 - \kappa\,(x_2 - x_1) + \beta\mu(w_2), \qquad
    \mu(w) = \frac{\operatorname{sign} w}{1 + \gamma |w|}

**How slow may the belt be for a regular motion, in which each block sticks once a period?**
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Return, System, find_orbit, follow
from pwsmooth.studies import orbit_diagram

x1, v1, x2, v2 = sp.symbols("x1 v1 x2 v2", real=True)
V = sp.Symbol("V", positive=True)
kappa, beta, gamma = 1.2, 1.3, 3.0


def mu(w):
    return sp.sign(w) / (1 + gamma * sp.Abs(w))


blocks = System(
    {
        x1: v1,
        v1: -x1 - kappa * (x1 - x2) + mu(V - v1),
        x2: v2,
        v2: -x2 - kappa * (x2 - x1) + beta * mu(V - v2),
    },
    parameters={V: 0.36},
)

# %%
# The regular orbit at a fast belt, followed down. Where its multiplier is -1 it begins to alternate; it
# exists below too, unstable.
orbit = find_orbit(blocks, [0.5, 0, 0.2, 0], seen=Return(x1 - x2), transient=200)
branch = follow(orbit, {V: 0.1})
(flip,) = branch.of_kind("flip")
print(orbit)
print(f"period doubling at V = {flip.parameter:.8f}")

# %%
# The return map, computed with SciPy's DOP853 restarted at every stick and slip, has the multiplier -1 at
# the same speed: the page's test. What the blocks do there instead: the returns to :math:`x_1 = x_2`, over
# the speed of the belt.
speeds = np.linspace(0.36, 0.1, 261)
diagram = orbit_diagram(
    blocks,
    V,
    speeds,
    orbit.x0,
    seen=Return(x1 - x2),
    transient=100,
    keep=30,
    carry=True,
)
fig, ax = plt.subplots(figsize=(7, 3.6))
diagram.plot(ax, x1)
ax.plot(branch.values, branch.x[0], color="#D55E00", label="regular orbit")
ax.axvline(flip.parameter, color="#D55E00", linestyle=":")
ax.set(xlabel="belt speed V", ylabel="$x_1 = x_2$ at a return")
ax.legend()
plt.show()
