r"""
Super-twisting control
======================

The super-twisting algorithm needs no rate: a root and an integral of a sign bring :math:`s` and what acts
on it to zero in finite time.

.. math::

    \dot s = -k_1 \sqrt{|s|}\,\operatorname{sign} s + w, \qquad \dot w = -k_2 \operatorname{sign} s + \delta(t)

**When is** :math:`s = 0` **reached?** With :math:`\delta = 0` and :math:`\zeta = \sqrt{|s|}` the equations
between two switchings are linear in a time :math:`\tau` of their own: :math:`\zeta'' + k_1\zeta' +
2k_2\zeta = 0`. From one switching to the next :math:`w` is multiplied by :math:`-q`, with :math:`q =
\exp\bigl(-\pi k_1/\sqrt{8k_2 - k_1^2}\bigr)`, and from :math:`s = 0,\ w = w_0` all of them take

.. math::

    T = \frac{w_0}{k_2}\,\frac{1 + q}{1 - q} .
"""

# %%
# The root is written as it stands; it has no slope where the path goes through :math:`s = 0`, and the steps
# know.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import System, solve

t, s, w = sp.symbols("t s w", real=True)
size = sp.Symbol("size", real=True)
k1, k2 = 1.5, 1.1
delta = size * sp.cos(t)
control = System(
    {
        s: -k1 * sp.sqrt(sp.Abs(s)) * sp.sign(s) + w,
        w: -k2 * sp.sign(s) + delta,
    },
    time=t,
    parameters={size: 0},
)
sol = solve(control, (0, 8), {s: 0, w: 1}, dense_output=True)
q = np.exp(-np.pi * k1 / np.sqrt(8 * k2 - k1**2))
exact = (1 + q) / (1 - q) / k2
reached = sol.event_times("accumulation")[-1]
print(f"s = w = 0 from {reached:.9f}")
print(f"closed form    {exact:.9f}")

# %%
# A disturbance whose rate is bounded is compensated exactly: :math:`s` stays at 0, and :math:`w` with it.
run = solve(
    control, (0, 8), {s: 0, w: 1}, parameters={size: 0.5}, dense_output=True
)
fig, ax = plt.subplots(figsize=(7, 3.2))
for name, result, colour in (
    ("no disturbance", sol, "#0072B2"),
    ("disturbed", run, "#D55E00"),
):
    table = result.sample(names=["s"])
    ax.plot(table.t, table["s"], color=colour, label=f"s, {name}")
ax.set(xlabel="t", ylabel="s")
ax.legend()
plt.show()
