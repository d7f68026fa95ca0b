r"""
Predators, prey and a refuge
============================

Prey :math:`x` that are rare hide: below :math:`x = h` predators :math:`y` find none of them and live,
poorly, on something else.

.. math::

    \dot x = r x\,\bigl(1 - \tfrac xK\bigr) - u\,a\,x\,y, \qquad
    \dot y = e\,u\,a\,x\,y + (1 - u)\,b\,y - m\,y, \qquad u = \begin{cases} 1 & x > h \\ 0 & x < h \end{cases}

**Where do the two settle?** With :math:`h` above the rest state :math:`x = m/(ea)` of a world without
refuge they slide along :math:`x = h`, where predators hunt for a part of the time, :math:`u = \varrho/(ay)`
with :math:`\varrho = r(1 - h/K)`. What is left, :math:`\dot y = \varrho\,(eh - b/a) - (m - b)\,y`, is
linear and ends at a *pseudo-equilibrium*, which neither side has.
"""

# %%
import matplotlib.pyplot as plt
import sympy as sp

from pwsmooth import System, solve

x, y = sp.symbols("x y", positive=True)
r, K, a, e, m, b = 1.0, 4.0, 1.0, 0.5, 0.4, 0.1
h = sp.Symbol("h", positive=True)
u = sp.Heaviside(x - h)
world = System(
    {
        x: r * x * (1 - x / K) - u * a * x * y,
        y: e * u * a * x * y + (1 - u) * b * y - m * y,
    },
    parameters={h: 1.0},
    outputs={"u": u},
)
sol = solve(world, (0, 100), {x: 2.5, y: 0.3}, dense_output=True)
rho = r * (1 - 1 / K)
exact = rho * (e - b / a) / (m - b)
print(sol.itinerary)
print(f"y = {sol['y'][-1]:.9f}, by hand {exact:.9f}")
print(f"hunting {sol['u'][-1]:.6f} of the time, by hand {rho / a / exact:.6f}")

# %%
# The phase portrait: from everywhere the paths come to the threshold, and then along it. Without the refuge
# (grey) they spiral in to the other rest state.
fig, ax = plt.subplots(figsize=(7, 3.8))
open_world = solve(
    world, (0, 100), {x: 2.5, y: 0.3}, parameters={h: 1e-6}, dense_output=True
)
free = open_world.sample()
ax.plot(free["x"], free["y"], color="0.75", linewidth=1)
for start in ((2.5, 0.3), (0.2, 1.8), (3.5, 1.2), (0.5, 0.4)):
    run = solve(world, (0, 60), start, dense_output=True)
    run.plot(phase=("x", "y"), axes=[ax])
ax.plot(1, exact, "o", color="#000000")
ax.annotate(
    "pseudo-equilibrium", (1, exact), (2, 0.95), arrowprops={"arrowstyle": "-"}
)
ax.set(xlabel="prey x", ylabel="predators y")
plt.show()
