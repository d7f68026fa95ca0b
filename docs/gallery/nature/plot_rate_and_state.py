r"""
Rate-and-state friction of one slider
=====================================

Rock that slides keeps a memory of its contacts' age :math:`\theta`. A slider of mass :math:`m` is pulled at the
speed :math:`V` by a spring of stretch :math:`u`; per unit of normal load

.. math::

    \dot u = V - v, \quad m \dot v = k u - \mu_0 - a \ln \tfrac{v}{V} - b \ln \tfrac{V \theta}{L}, \quad
    \dot\theta = \begin{cases} 1 - v\theta/L & \text{aging law (Dieterich)} \\
    -(v\theta/L) \ln(v\theta/L) & \text{slip law (Ruina)} \end{cases}

**How soft may the spring be for the slider to creep?** Both laws are the same near steady sliding, whose
characteristic polynomial :math:`m\lambda^3 + (mV/L + a/V)\lambda^2 + (k - (b - a)/L)\lambda + kV/L` has a
pair on the imaginary axis at

.. math::

    k_c = \frac{b - a}{L} \Bigl(1 + \frac{m V^2}{a L}\Bigr), \qquad \omega^2 = \frac{k_c V/L}{mV/L + a/V} .

Below it, it slips in jerks: earthquakes of one block.
"""

# %%
# The Hopf point, found on the branch of equilibria over the stiffness.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import System, find_equilibrium, follow, solve

u, k = sp.symbols("u k", real=True)
v, theta = sp.symbols("v theta", positive=True)
mu_0, a, b, L, V, m = 0.6, 0.01, 0.016, 1.0, 1.0, 0.002
worn = v * theta / L
laws = {"aging": 1 - worn, "slip": -worn * sp.log(worn)}
friction = mu_0 + a * sp.log(v / V) + b * sp.log(V * theta / L)
sliders = {
    name: System(
        {u: V - v, v: (k * u - friction) / m, theta: rate}, parameters={k: 0.02}
    )
    for name, rate in laws.items()
}
k_c = (b - a) / L * (1 + m * V**2 / (a * L))
omega = np.sqrt(k_c * V / L / (m * V / L + a / V))
found = {}
for name, slider in sliders.items():
    steady = find_equilibrium(slider, {u: mu_0 / 0.02, v: V, theta: L / V})
    (found[name],) = follow(steady, {k: 0.004}).specials
    print(f"{name}: {found[name].kind} at k = {found[name].parameter:.12f}")
print(f"by hand at k = {k_c:.12f}, with frequency {omega:.9f}")

# %%
# Softer by a fifth the two laws differ: contacts of the aging law heal at rest, and its swings grow on; those of
# the slip law heal only as they slip, and it ends on a small cycle.
fig, axes = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
for (name, slider), colour in zip(sliders.items(), ("#0072B2", "#D55E00")):
    start = {u: mu_0 / (0.8 * k_c), v: 1.05 * V, theta: L / V}
    run = solve(
        slider, (0, 160), start, parameters={k: 0.8 * k_c}, dense_output=True
    )
    t = np.linspace(0, 160, 6000)
    axes[0].semilogy(t, run(t, "v"), color=colour, label=f"{name} law")
    late = t > 100
    axes[1].semilogx(
        run(t[late], "v"), 0.8 * k_c * run(t[late], "u"), color=colour
    )
axes[0].set(xlabel="t V/L", ylabel="v/V", title=r"$k = 0.8\,k_c$")
axes[0].legend()
axes[1].set(xlabel="v/V", ylabel="spring force per load")
plt.show()
