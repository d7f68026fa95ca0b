r"""
The tip of an atomic force microscope
=====================================

Prandtl's and Tomlinson's model of friction without any friction law: a tip is drawn over a crystal, whose
potential has the period :math:`2\pi`, by a spring that moves at the speed :math:`V`,

.. math::

    \ddot x + c\,\dot x = (V t - x) - \eta \sin x .

**When does smooth creep become stick-slip, and when does the tip jump?** For :math:`\eta < 1` it follows. For
:math:`\eta > 1` it stays behind until the well in which it sits vanishes, in a fold: slowly drawn it jumps from
:math:`\cos x_* = -1/\eta`, past the largest force :math:`\eta`, when the support is at
:math:`x_* + \sqrt{\eta^2 - 1}`. Drawn faster it jumps late, and by :math:`V^{2/3}`: the passage of a fold, as in
the layer of static friction.
"""

# %%
# Where the support is when the tip passes the top of the potential, at ever smaller speeds.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Event, System, solve

t, x, w = sp.symbols("t x w", real=True)
V, eta, c = sp.symbols("V eta c", positive=True)
force = V * t - x
tip = System(
    {x: w, w: force - eta * sp.sin(x) - c * w},
    time=t,
    parameters={V: 0.01, eta: 3, c: 4},
    outputs={"force": force},
    events=[Event(sp.sin(x), direction=-1, name="jump")],
)
leaves = np.arccos(-1 / 3) + np.sqrt(3**2 - 1)


def delay(speed):
    """How far the support is beyond the fold at the third jump."""
    run = solve(tip, (0, 20 / speed), {x: 0, w: 0}, parameters={V: speed})
    return speed * run.event_times(switch="jump")[2] - leaves - 4 * np.pi


speeds = np.geomspace(1e-6, 1e-2, 9)
late = np.array([delay(speed) for speed in speeds])
exponent = np.polyfit(np.log(speeds[:3]), np.log(late[:3]), 1)[0]
print(f"late by V to the power {exponent:.4f}; theory 2/3")

# %%
fig, axes = plt.subplots(1, 2, figsize=(7.4, 3), layout="constrained")
for value, colour in ((0.8, "0.6"), (3, "#0072B2")):
    run = solve(tip, (0, 3000), {x: 0, w: 0}, parameters={eta: value}, dense_output=True)
    times = np.linspace(0, 3000, 6000)
    axes[0].plot(0.01 * times, run(times, "force"), color=colour, label=f"η = {value}")
axes[0].set(xlabel="V t", ylabel="force of the spring", title="V = 0.01")
axes[0].legend(loc="lower right")
axes[1].loglog(speeds, late, "o", color="#0072B2")
axes[1].loglog(speeds, late[0] * (speeds / speeds[0]) ** (2 / 3), color="0.7", label=r"$V^{2/3}$")
axes[1].set(xlabel="V", ylabel="support beyond the fold at the jump")
axes[1].legend()
plt.show()
