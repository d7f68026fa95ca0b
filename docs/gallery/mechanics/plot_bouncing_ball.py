r"""
Bouncing ball on a vibrating table
==================================

A ball falls on a table that moves as :math:`\Gamma \sin t`, in units in which gravity and the frequency are
1 (:math:`\Gamma = A\omega^2/g`), and returns a part :math:`e` of the relative speed:

.. math::

    \ddot s = -1 + R, \qquad 0 \le s - \Gamma \sin t \;\perp\; R \ge 0, \qquad
    \dot h^+ = -e\,\dot h^-, \quad h = s - \Gamma \sin t

One bounce a period exists for :math:`\Gamma > \pi(1 - e)/(1 + e)`. **Where does it lose stability?** Its
linear map has determinant :math:`e^2` and a multiplier -1 at

.. math::

    \Gamma_{\rm flip}^2 = \pi^2 \Bigl(\frac{1 - e}{1 + e}\Bigr)^2 + 4\, \frac{(1 + e^2)^2}{(1 + e)^4} .
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Strobe, System, Unilateral, find_orbit, follow
from pwsmooth.studies import orbit_diagram

t, s, v = sp.symbols("t s v", real=True)
Gamma, e = sp.symbols("Gamma e", positive=True)
table = Unilateral(s - Gamma * sp.sin(t), restitution=e)
ball = System(
    {s: v, v: -1 + table.reaction},
    time=t,
    parameters={Gamma: 1.4, e: 0.5},
)

# %%
# The orbit is found by Newton's method on the stroboscopic map, and followed until it flips.
orbit = find_orbit(ball, {s: 3.3, v: -2.3}, seen=Strobe(2 * sp.pi), transient=40)
branch = follow(orbit, {Gamma: 1.7})
flip = branch.of_kind("flip")[0]
exact = np.sqrt((np.pi / 3) ** 2 + 4 * 1.25**2 / 1.5**4)
print(f"flip at Gamma = {flip.parameter:.12f}")
print(f"closed form     {exact:.12f}")

# %%
# What comes after it is a cascade to chaos; each run begins at the orbit above.
values = np.linspace(1.3, 1.9, 301)
diagram = orbit_diagram(
    ball, Gamma, values, orbit.x0, Strobe(2 * sp.pi), transient=80, keep=60
)
fig, ax = plt.subplots(figsize=(7, 3.6))
diagram.plot(ax, v)
ax.plot(
    branch.values, branch.x[1], color="#D55E00", label="one bounce a period"
)
ax.axvline(exact, color="#D55E00", linestyle=":", label="flip, closed form")
ax.set(xlabel=r"$\Gamma = A\omega^2/g$", ylim=(-3.4, -1.2))
ax.set_ylabel(r"velocity at $t = 2\pi k$")
ax.legend(loc="upper left")
plt.show()
