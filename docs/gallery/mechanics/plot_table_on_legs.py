r"""
A table on four legs
====================

A table is pushed to and fro at a corner. Each leg rubs with a quarter of the weight,

.. math::

    m\,\ddot x = F_x(t) - \tfrac14\mu m g\sum_k \lambda_{k,x}, \qquad
    I\,\ddot\varphi = M(t) - \tfrac14\mu m g\sum_k r_k\times\lambda_k,

with :math:`\lambda_k` in its disc, along the velocity of leg *k* where it slips. **When does it slip? Does it walk?**
The eight forces hold more than the three motions of the table, so that nobody can say what they are while it rests; the
motion is unique, and ends exactly at rest.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Disc, System, solve
from pwsmooth.plotting import COLOUR

t, x, y, a, u, v, w = sp.symbols("t x y varphi u v omega", real=True)
LEGS = np.array([(0.6, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.6, -0.4)])  # m
GRIP, INERTIA = 1.0, 0.2  # of a leg, m/s^2; about the middle, m^2: both for a mass of 1
push = sp.Rational(9, 2) * sp.sin(t), sp.Rational(1, 2), -sp.Rational(4, 5) * sp.sin(t)
force, moment = [push[0], push[1]], push[2]
for k, (px, py) in enumerate(LEGS.tolist()):
    rx, ry = px * sp.cos(a) - py * sp.sin(a), px * sp.sin(a) + py * sp.cos(a)
    lam = Disc(f"lam{k}", (u - w * ry, v + w * rx))
    force = [f - GRIP * component for f, component in zip(force, lam, strict=True)]
    moment -= GRIP * (rx * lam[1] - ry * lam[0])
table = System({x: u, y: v, a: w, u: force[0], v: force[1], w: moment / INERTIA}, time=t)
run = solve(table, (0, 4 * np.pi), [0] * 6, rtol=1e-10, atol=1e-12, dense_output=True)
print(run.message)
print(*run.ambiguities[:1])
for event in run.events[:8]:
    print(event)

# %%
# Left, where the middle and the legs go, and the table at first and at last: the steady part of the push lets it walk.
# Right, the speeds of the legs, zero together where the table rests.
times = np.linspace(0, run.t[-1], 4000)
states = run(times)
turn = np.exp(1j * states[2])
middle = states[0] + 1j * states[1]
corners = [middle + turn * complex(*leg) for leg in LEGS]
speeds = [
    np.abs(states[3] + 1j * states[4] + 1j * states[5] * (corner - middle)) for corner in corners
]
fig, (left, right) = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
for k, corner in enumerate(corners):
    left.plot(corner.real, corner.imag, color=COLOUR["right"], linewidth=0.8)
    right.plot(times, speeds[k], linewidth=0.8, label=f"leg {k + 1}")
left.plot(middle.real, middle.imag, color=COLOUR["mark"], linewidth=0.8)
for moment_at in (0, -1):
    outline = np.array([corner[moment_at] for corner in (*corners, corners[0])])
    left.plot(outline.real, outline.imag, "o-", color=COLOUR["left"], markersize=3, linewidth=0.8)
left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="table, at first and at last")
right.set(xlabel="t (s)", ylabel="speed (m/s)", title="legs")
right.legend(fontsize=7)
plt.show()

# %%
# At rest nothing creeps: the largest speed of a leg in the first half second, and when the table gives way.
print(f"{max(speed[times < 0.5].max() for speed in speeds):.0e} m/s, gives way at t = {run.events[0].time:.9f}")
