r"""
Genes that regulate each other
==============================

Two genes make proteins at rates that depend on which concentrations are above their thresholds 1, and each
decays. With :math:`Z_i = 1` above and 0 below (Plahte and Kjøglum's example)

.. math::

    \dot x_1 = Z_1 + Z_2 - 2 Z_1 Z_2 - \gamma_1 x_1, \qquad
    \dot x_2 = 1 - Z_1 Z_2 - \gamma_2 x_2, \qquad Z_i = H(x_i - 1).

Biologists use Hill functions, :math:`Z_i = x_i^n/(1 + x_i^n)`; the jump is their limit :math:`n \to \infty`.

**Where does the network settle?** None of the four boxes has a rest state. One lies on the second threshold
alone, :math:`Z_1 = 1`, :math:`Z_2 = 1 - \gamma_2`. Another is held at the crossing of both by the *product* of two
switches: there :math:`Z_1 + Z_2 - 2Z_1Z_2 = \gamma_1` and :math:`1 - Z_1Z_2 = \gamma_2` give the roots of
:math:`Z^2 - (\gamma_1 + 2 - 2\gamma_2) Z + 1 - \gamma_2`, two states, of which the layer attracts one.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import System, solve
from pwsmooth.analysis.equilibria import equilibria

x1, x2 = sp.symbols("x1 x2", positive=True)
gamma_1, gamma_2 = 0.6, 0.9
Z1, Z2 = sp.Heaviside(x1 - 1), sp.Heaviside(x2 - 1)
genes = System(
    {x1: Z1 + Z2 - 2 * Z1 * Z2 - gamma_1 * x1, x2: 1 - Z1 * Z2 - gamma_2 * x2},
    outputs={"Z1": Z1, "Z2": Z2},
)
half = (gamma_1 + 2 - 2 * gamma_2) / 2
roots = half + np.array([-1, 1]) * np.sqrt(half**2 - (1 - gamma_2))
print(equilibria(genes, {x1: (0, 2), x2: (0, 2)}))
sol = solve(genes, (0, 40), {x1: 0.3, x2: 0.2}, dense_output=True)
print(sol.itinerary)
print(f"Z1 = {sol['Z1'][-1]:.9f}, Z2 = {sol['Z2'][-1]:.9f}; by hand {roots}")


# %%
# The same with Hill functions of finite steepness, by SciPy: the concentrations settle where the limit says.
def hill(steepness):
    def rates(_, x):
        above = 1 / (1 + x ** -float(steepness))
        return [
            above.sum() - 2 * above.prod() - gamma_1 * x[0],
            1 - above.prod() - gamma_2 * x[1],
        ]

    return solve_ivp(rates, (0, 40), [0.3, 0.2], method="Radau", rtol=1e-8, atol=1e-10)


fig, axes = plt.subplots(1, 2, figsize=(7.4, 3.3), layout="constrained")
ends = {}
for steepness, grey in ((10, "0.8"), (40, "0.65"), (200, "0.45")):
    run = hill(steepness)
    axes[0].plot(*run.y, color=grey, label=f"Hill, n = {steepness}")
    ends[steepness] = 1 / (1 + run.y[:, -1] ** -float(steepness))
smooth = sol.sample()
axes[0].plot(smooth["x1"], smooth["x2"], color="#0072B2", label="limit, exact")
axes[0].set(xlabel="x1", ylabel="x2")
axes[0].legend()
for i, marker in ((0, "o"), (1, "s")):
    axes[1].plot(
        list(ends), [end[i] for end in ends.values()], marker, color="0.45", label=f"Z{i + 1}"
    )
    axes[1].axhline(sol[f"Z{i + 1}"][-1], color="#0072B2", linewidth=0.8)
axes[1].set(xscale="log", xlabel="Hill exponent n", ylabel="regulation at rest")
axes[1].legend()
plt.show()
