r"""
Chua's circuit
==============

The simplest circuit with chaos: linear but for one resistor, whose characteristic is made of three straight
lines.

.. math::

    \dot x = \alpha\,(y - x - f(x)), \quad \dot y = x - y + z, \quad \dot z = -\beta\,y, \qquad
    f(x) = m_1 x + \tfrac12 (m_0 - m_1)\,\bigl(|x + 1| - |x - 1|\bigr)

with :math:`\alpha = 9`, :math:`\beta = 100/7`, :math:`m_0 = -8/7`, :math:`m_1 = -5/7`. **Is the double
scroll chaotic, and how much?**
"""

# %%
# ``Abs`` is written as it stands; :math:`|x| = 1` are the two borders of the linear pieces, and every
# passage is located. Until chaos has grown over the tolerances they are where SciPy's DOP853, restarted at
# each, has them.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.analysis.lyapunov import lyapunov_exponents

x, y, z = sp.symbols("x y z", real=True)
m0, m1 = sp.Rational(-8, 7), sp.Rational(-5, 7)
f = m1 * x + (m0 - m1) / 2 * (sp.Abs(x + 1) - sp.Abs(x - 1))
chua = System({x: 9 * (y - x - f), y: x - y + z, z: -sp.Rational(100, 7) * y})
sol = solve(chua, (0, 200), {x: 0.1, y: 0, z: 0}, dense_output=True)
print(f"{len(sol.events)} passages, {sol.cost['steps']} steps")

# %%
# The exponents come from the fundamental matrix with its saltation matrices: one is positive (chaos), one
# vanishes (along the orbit). Their sum is the mean divergence of the field, :math:`-1 - \alpha\,(1 + f')`,
# which is known from the share of the time that is spent in the middle piece.
start = {x: 0.1, y: 0, z: 0}
found = lyapunov_exponents(chua, start, 2000, transient=100, count=3)
for exponent, error in zip(found.exponents, found.errors):
    print(f"exponent {exponent:8.4f} +- {error:.4f}")

long = solve(chua, (0, 5000), start, t_eval=np.linspace(100, 5000, 200_001))
middle = np.mean(np.abs(long["x"]) < 1)
divergence = -1 - 9 * (1 + float(m1) + middle * float(m0 - m1))
print(f"sum {found.exponents.sum():.3f}, mean divergence {divergence:.3f}")

# %%
times = np.linspace(20, 200, 20000)
fig, ax = plt.subplots(figsize=(7, 3.6))
ax.plot(sol(times, "x"), sol(times, "y"), linewidth=0.6, color="#0072B2")
for border in (-1, 1):
    ax.axvline(border, color="0.6", linestyle=":", linewidth=1)
ax.set(xlabel="x", ylabel="y")
plt.show()
