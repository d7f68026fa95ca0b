r"""
Relay feedback: oscillations that slide
=======================================

A relay :math:`u = -\operatorname{sign} y` in the loop makes a process oscillate; controllers are tuned by
that. Here the process

.. math::

    G(s) = \frac{(s + \rho)^2}{(s^2 + 2\zeta\omega s + \omega^2)(s + \kappa)}

is hardly damped, and has zeros in the right half plane (:math:`\rho < 0`). On :math:`y = 0` the relay can
take any mean value in :math:`[-1, 1]`: the loop slides along it as the zeros want, away from rest, until
the relay is saturated. **Up to which zeros does an oscillation of two swings and two slides in each half
period exist?**
"""

# %%
# In observer form the output is :math:`x_1`. A section through the zero of another state finds the orbit.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Return, System, find_orbit, follow

x1, x2, x3 = sp.symbols("x1 x2 x3", real=True)
rho = sp.Symbol("rho", real=True)
zeta, omega, kappa = 0.05, 10.0, 0.05
u = -sp.sign(x1)
loop = System(
    {
        x1: x2 - (2 * zeta * omega + kappa) * x1 + u,
        x2: x3 - (2 * zeta * omega * kappa + omega**2) * x1 + 2 * rho * u,
        x3: -(omega**2) * kappa * x1 + rho**2 * u,
    },
    parameters={rho: -2.5},
    outputs={"u": u},
)
orbit = find_orbit(loop, {x1: 0.1, x2: 0.5, x3: 0.3}, seen=Return(x2), transient=60)
orbit

# %%
# Its largest multiplier is below 1; the others vanish, since a slide forgets how it began. Followed in
# :math:`\rho` it meets an unstable one and both are gone.
branch = follow(orbit, {rho: -2})
(fold,) = branch.of_kind("fold")
print(f"the orbit ends in a fold at rho = {fold.parameter:.9f}")

# %%
# A slide ends at :math:`x_2 = \pm 1`, so that the return is a map of one number, :math:`x_3` there. Built
# from matrix exponentials it is tangent to the diagonal at the same :math:`\rho`; that is the page's test.
fig, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.2))
run = orbit.solution()
run.plot(["x1"], [left])
left.set(xlabel="t", ylabel="output y", title="Two swings, two slides")
periods = np.array([o.period for o in branch.points])
right.plot(branch.values, periods, ":", color="#D55E00", label="unstable")
right.plot(
    branch.values,
    np.where(branch.stable, periods, np.nan),
    color="#0072B2",
    label="stable",
)
right.set(xlabel=r"$\rho$ (both zeros are at $-\rho$)", ylabel="period")
right.legend()
plt.show()
