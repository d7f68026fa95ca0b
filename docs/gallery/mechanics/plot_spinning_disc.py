r"""
A disc that slides and spins
============================

Thrown with a spin, a disc slides farther: each point of it rubs against its own velocity, and the force of all of them
is less than that of a disc that only slides. Force and moment are those of Contensou,

.. math::

    F = \frac{\mu N}{\pi R^2}\int \frac{v + \omega\times r}{\lvert v + \omega\times r\rvert}\,\mathrm dA, \qquad
    M = \frac{\mu N}{\pi R^2}\int \frac{r\times(v + \omega\times r)}{\lvert v + \omega\times r\rvert}\,\mathrm dA,

two elliptic integrals of :math:`u = \lvert v\rvert/(R\omega)`. **Which of the two stops first?** Neither: whatever the
start, a uniform disc ends at :math:`u = 0.653` with both at once (Farkas, Bartels, Unger and Wolf, 2003), a thin ring
at :math:`u = 1`. Robotics takes an ellipsoid for the limit surface of force and moment instead. It is never off by more
than 7 %, **and gets the end wrong**: its disc stops sliding and goes on to spin.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.laws.friction import Contensou, LimitEllipsoid
from pwsmooth.plotting import COLOUR
from pwsmooth.scenes import gripped_bar, spinning_disc, t

LAWS = {
    "disc": (Contensou(), 0.5, "right", "-"),
    "ring": (Contensou(shape="ring"), 1.0, "left", "-"),
    "disc by an ellipsoid": (LimitEllipsoid(), 0.5, "right", "--"),
}
fig, axes = plt.subplots(1, 3, figsize=(7.4, 2.8), layout="constrained")
ends = {}
for name, (law, inertia, colour, dash) in LAWS.items():
    for spin in (0.25, 4.0):
        run = spinning_disc(law, velocity=(1, 0), spin=spin, inertia=inertia).solve(rtol=1e-12, dense_output=True)
        stop = run.event_times("stick")[0]
        before = stop * np.geomspace(1, 1e-7, 400)
        ratio = run(stop - before, "v_x") / run(stop - before, "spin")
        ends[name, spin] = stop, run["x"][-1], ratio[-1]
        axes[0].loglog(before, ratio, dash, color=COLOUR[colour], label=name if spin == 4 else None)
axes[0].axhline(0.653001789205597639, color=COLOUR["exact"], linewidth=0.6)
axes[0].invert_xaxis()
axes[0].set(xlabel="time before the stop", ylabel=r"$u = v/(R\omega)$", title="the end", ylim=(0.05, 8))
axes[0].legend(fontsize=7)
for (name, spin), (stop, far, last) in ends.items():
    print(f"{name:21} spin {spin:4.2f}: stops after {stop:.4f} at {far:.4f}, last ratio {last:.4f}")

# The farther the more it spins.
spins = np.linspace(0, 6, 25)
for law, inertia, colour, dash in LAWS.values():
    far = [
        spinning_disc(law, velocity=(1, 0), spin=float(s), inertia=inertia, t_span=(0, 20)).solve()["x"][-1]
        for s in spins
    ]
    axes[1].plot(spins, far, dash, color=COLOUR[colour])
axes[1].set(xlabel=r"$R\omega/v$ at the start", ylabel=r"distance, $v^2/(\mu g)$", title="how far")

# A gripper holds a bar beside its centre of mass and opens slowly: the grip at which it slips, for an ellipsoidal limit
# surface, against the closed form.
arms = np.array([0.005, 0.01, 0.02, 0.035, 0.05])
pad = LimitEllipsoid(F_c=0.5, R=0.03)
runs = [gripped_bar(pad, 80 - 20 * t, arm=float(a), t_span=(0, 3.2)).solve(dense_output=True) for a in arms]
grips = [80 - 20 * run.events[0].time for run in runs]
fine = np.linspace(0, 0.055, 100)
axes[2].plot(1e3 * fine, 9.81 / 0.5 * np.hypot(1, fine / 0.02), color=COLOUR["exact"], linewidth=1)
axes[2].plot(1e3 * arms, grips, "o", color=COLOUR["right"], markersize=4)
axes[2].set(xlabel="arm of the weight (mm)", ylabel="grip at which it slips (N)", title="gripper", ylim=(0, 60))
plt.show()

# %%
# **How much does a stone curl?** A curling stone stands on a narrow ring. If its friction pressed it down in front, it
# would rub more there, and bend to the right when it turns to the left, as a glass does that is pushed over a table. On
# ice it bends the other way: where it presses the ice melts, and it rubs less in front (Penner, 2001). ``tilt`` is one
# or the other; as long as the spin is slow, :math:`R\omega\ll v`, the stone ends
#
# .. math:: y = -\mathit{tilt}\,\frac{R\,\omega\,v}{4\mu g\,(1 + m R^2/2I)}
#
# aside. **Even a front that does not rub at all bends it by 0.4 m in 20 m**, less than half of what players see.

m, inertia, mu, R, v, omega = 19.0, 0.186, 0.012, 0.065, 2.2, 1.5
fig, ax = plt.subplots(figsize=(7.4, 2.2), layout="constrained")
stones = {}
for tilt, colour in ((-1.0, "left"), (-0.5, "approximation"), (0.5, "right")):
    ice = Contensou(F_c=mu * m * 9.81, R=R, shape="ring", tilt=tilt)
    stone = spinning_disc(ice, velocity=(v, 0), spin=omega, m=m, inertia=inertia, t_span=(0, 30))
    run = stone.solve(t_eval=np.linspace(0, 30, 300))
    slow = -tilt * R * omega * v / (4 * mu * 9.81 * (1 + m * R**2 / (2 * inertia)))
    stones[tilt] = run["y"][-1], slow
    ax.plot(run["x"], run["y"], color=COLOUR[colour], label=f"tilt {tilt:+.1f}")
    ax.plot(run["x"][-1], slow, "+", color=COLOUR["exact"], label="slow spin" if tilt > 0 else None)
    print(f"tilt {tilt:+.1f}: {run['y'][-1]:+.4f} m aside, slow spin {slow:+.4f} m")
ax.set(xlabel="along the sheet (m)", ylabel="aside (m)", title="a curling stone that turns to the left")
ax.legend(fontsize=7)
plt.show()
