r"""
Rocking block
=============

A slender block rocks about one corner and then the other; at each change it loses angular velocity
(Housner's model):

.. math::

    \ddot\theta = p^2\,(\theta - \alpha \operatorname{sign}\theta), \qquad
    \dot\theta^+ = r\,\dot\theta^- \;\text{ at } \theta = 0, \qquad r = 1 - \tfrac32 \sin^2\alpha

It is tilted by :math:`\theta_0` and let go. **After which time does it stand still?** There are infinitely
many impacts: a quarter period from the amplitude :math:`\varphi\alpha` takes
:math:`\operatorname{artanh}\sqrt{\varphi(2 - \varphi)}/p`, and the next amplitude :math:`\varphi^+` follows
from the energy, :math:`1 - \varphi^+ = \sqrt{1 - r^2\,\varphi\,(2 - \varphi)}`; the times add up to a
finite sum.
"""

# %%
# The impact is an event on the very surface at which the moment of the weight changes its sign.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Event, System, solve

theta, w = sp.symbols("theta w", real=True)
alpha, p = 0.25, 2.0  # rad, 1/s
r = 1 - 1.5 * np.sin(alpha) ** 2
block = System(
    {theta: w, w: p**2 * (theta - alpha * sp.sign(theta))},
    events=[Event(theta, update={w: r * w}, name="impact")],
)
sol = solve(block, (0, 16), {theta: 0.24, w: 0}, dense_output=True)
print(f"{sol.outcome.name}; at rest from {sol.events[-1].time:.10f} s")

# %%
# The sum, until nothing is added:
phi, exact, quarters = 0.24 / alpha, 0.0, 1
while phi > 1e-26:
    exact += quarters * np.arctanh(np.sqrt(phi * (2 - phi))) / p
    phi = -np.expm1(np.log1p(-(r**2) * phi * (2 - phi)) / 2)
    quarters = 2
print(f"closed form             {exact:.10f} s")

# %%
times = np.linspace(0, 16, 4000)
fig, ax = plt.subplots(figsize=(7, 3))
ax.plot(times, np.degrees(sol(times, "theta")), color="#0072B2")
ax.axvline(exact, color="#D55E00", linestyle=":")
ax.set(xlabel="t (s)", ylabel="tilt (degrees)", xlim=(0, 16))
plt.show()
