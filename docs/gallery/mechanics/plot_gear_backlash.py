r"""
Gear backlash
=============

A pair of gears with play, in the coordinate of the transmission error and in units of half the play. The
mesh is a spring with a dead zone, preloaded by the mean torque and shaken by its ripple:

.. math::

    \ddot x + 2\zeta\dot x + g(x) = F_m + F_a \cos\omega t, \qquad
    g(x) = \begin{cases} x - 1 & x > 1\\ 0 & |x| \le 1\\ x + 1 & x < -1\end{cases}

**When do the teeth lose contact, and what then?** As long as they touch, the motion is linear with the
amplitude :math:`F_a / \sqrt{(1 - \omega^2)^2 + (2\zeta\omega)^2}`; contact is lost where that exceeds
:math:`F_m`.
"""

# %%
# The orbit of period :math:`2\pi/\omega` is followed from high frequencies to low ones, on a section where
# nothing switches.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Strobe, System, find_orbit, follow

t, x, v = sp.symbols("t x v", real=True)
omega = sp.Symbol("omega", positive=True)
zeta, F_m, F_a = 0.05, 0.1, 0.05
g = sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
gears = System(
    {x: v, v: F_m + F_a * sp.cos(omega * t) - 2 * zeta * v - g},
    time=t,
    parameters={omega: 1.5},
)
orbit = find_orbit(
    gears,
    {x: 1.1, v: 0},
    seen=Strobe(2 * sp.pi / omega, phase=0.25),
    transient=100,
)
branch = follow(orbit, {omega: 0.4})
for found in branch.specials:
    print(f"omega = {found.parameter:.8f}: {found.kind}")

# %%
# By hand: the linear amplitude is :math:`F_m` at two frequencies.
b = 1 - 2 * zeta**2
exact = np.sqrt(
    b + np.array([1, -1]) * np.sqrt(b**2 - 1 + (F_a / F_m) ** 2)
)
print("contact is lost at", exact)


# %%
# The resonance leans to lower frequencies, since a mesh that opens is softer. Between the two folds there
# are two stable motions, with and without loss of contact, and the gears jump from one to the other.
def size(orbit):
    return np.ptp(orbit.solution().sample(400)["x"]) / 2


sizes = np.array([size(orbit) for orbit in branch.points])
fig, ax = plt.subplots(figsize=(7, 3.4))
ax.plot(branch.values, sizes, ":", color="#D55E00", label="unstable")
ax.plot(
    branch.values,
    np.where(branch.stable, sizes, np.nan),
    color="#0072B2",
    label="stable",
)
ax.plot(exact, [F_m, F_m], "o", color="#009E73", label="contact is lost")
ax.set(xlabel=r"frequency $\omega$", ylabel="amplitude of $x$")
ax.legend()
plt.show()
