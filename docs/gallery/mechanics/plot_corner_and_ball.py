r"""
Around a corner, and a ball with side spin
==========================================

Two classical paths of friction in the plane. A light block on a spring whose end goes around a corner follows on a
**tractrix**: with :math:`L = \mu N/k`, the tangent of half the angle between spring and path falls as
:math:`\mathrm e^{-s/L}`. **How light must it be?** And a ball that is thrown with a spin slides on a **parabola**
(Coriolis, 1835), because the slip keeps its direction while friction wears it down; then it rolls straight on,

.. math::

    v_{\text{rolling}} = v - \tfrac27\,(v + \omega\times r), \qquad \text{after the time}\quad
    \frac{2\,\lvert v + \omega\times r\rvert}{7\,\mu g} ,

where nothing resists the rolling. **Where does it stand where something does?**
"""

# %%
import math

import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.laws.friction import Coulomb, RollingResistance
from pwsmooth.plotting import COLOUR
from pwsmooth.scenes import billiard_ball, pulled_block, t

fig, axes = plt.subplots(1, 2, figsize=(7.4, 3), layout="constrained", width_ratios=(1.6, 1))
angle = 1.5
start = (-math.sin(angle), -math.cos(angle))
s = np.linspace(0, 3, 200)
after = 2 * np.arctan(math.tan(angle / 2) * np.exp(-s))
axes[0].plot([0, 3], [0, 0], color=COLOUR["mark"], linewidth=1, label="end of the spring")
axes[0].plot(s - np.cos(after), -np.sin(after), color=COLOUR["exact"], linewidth=2.5, alpha=0.3, label="tractrix")
misses = {}
for m, dash in ((1.0, ":"), (0.1, "--"), (1e-3, "-")):
    run = pulled_block(Coulomb(), (0, t), start=start, m=m, t_span=(0, 3)).solve(dense_output=True)
    path = run(s, "x"), run(s, "y")
    misses[m] = float(np.hypot(path[0] + np.sin(after), path[1] - s + np.cos(after)).max())
    axes[0].plot(*path[::-1], dash, color=COLOUR["right"], label=f"mass {m:g}")
axes[0].set(xlabel="y/L", ylabel="x/L", aspect="equal", title="around a corner", ylim=(-1.1, 0.1))
axes[0].legend(loc="lower right", fontsize=7)
print("farthest from the tractrix:", ", ".join(f"{miss:.3f} at the mass {m:g}" for m, miss in misses.items()))

# A cue ball of radius 28 mm, with side spin and back spin, on cloth with some rolling resistance.
radius, mu = 0.028, 0.2
for spins, colour in (((0, 0), "mark"), ((60, -40), "right"), ((-60, -90), "left")):
    scene = billiard_ball(
        Coulomb(F_c=mu), velocity=(0.8, 0.4), spins=spins, radius=radius, m=0.17, inertia=0.4 * 0.17 * radius**2,
        rolling=RollingResistance(M_c=0.02 * radius), t_span=(0, 6),
    )  # fmt: skip
    run = scene.solve(dense_output=True)
    times = np.linspace(0, 6, 1500)
    rolls = run.event_times("stick")[0]
    axes[1].plot(run(times, "x"), run(times, "y"), color=COLOUR[colour], label=f"spins {spins[0]}, {spins[1]} rad/s")
    axes[1].plot(run(rolls, "x"), run(rolls, "y"), "o", color=COLOUR[colour], markersize=4)
    axes[1].plot(run["x"][-1], run["y"][-1], "s", color=COLOUR[colour], markersize=3)
    print(f"spins {spins}: rolls from {rolls:.4f} s, stands at ({run['x'][-1]:.3f}, {run['y'][-1]:.3f}) m")
axes[1].set(xlabel="x (m)", ylabel="y (m)", title="cue ball", aspect="equal")
axes[1].legend(fontsize=7, loc="upper right")
axes[1].set_xlim(-0.2, 2.6)
plt.show()

# %%
# Circles: from here the ball rolls; squares: where it stands. A ball that rolls is one vector switch at rest and
# another one, of the rolling resistance, in slip.
