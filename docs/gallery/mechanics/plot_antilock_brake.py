r"""
Antilock brake
==============

A quarter of a car with the speed :math:`v` and a wheel of circumferential speed :math:`u` brakes on dry
asphalt. The force of the tyre is largest at a slip :math:`s = 1 - u/v` of 0.17 (Burckhardt's curve); the
brake is dry friction, which can hold the wheel still:

.. math::

    m\dot v = -m g\,\mu(s), \qquad j\,\dot u = m g\,\mu(s) - B \operatorname{sign} u, \qquad
    \mu(s) = 1.28\,(1 - e^{-24 s}) - 0.52\,s

An antilock valve lets the brake force :math:`B` rise until :math:`s > 0.25` and fall until :math:`s < 0.1`.
**How much shorter does the car stop than with locked wheels?**
"""

# %%
# The valve is a memory that two events turn; without a rate of change it does nothing.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Event, Memory, System, solve

x, v, u, B = sp.symbols("x v u B", real=True)
rate = sp.Symbol("rate", nonnegative=True)
m, j, g = 400.0, 10.0, 9.81  # kg, kg (inertia over radius squared), m/s^2
slip = 1 - u / v
force = m * g * (1.28 * (1 - sp.exp(-24 * slip)) - 0.52 * slip)
valve = Memory("valve", 1)
car = System(
    {
        x: v,
        v: -force / m,
        u: (force - B * sp.sign(u)) / j,
        B: valve * rate,
    },
    parameters={rate: 20e3},  # N/s
    outputs={"slip": slip},
    events=[
        Event(slip - 0.25, direction=1, update={valve: -1}, name="release"),
        Event(slip - 0.1, direction=-1, update={valve: 1}, name="apply"),
        Event(v - 1, direction=-1, terminal=True, name="stop"),
    ],
)
start = {x: 0, v: 30, u: 30}
antilock = solve(car, (0, 9), {**start, B: 0}, dense_output=True)
locked = solve(
    car, (0, 9), {**start, B: 6e3}, parameters={rate: 0}, dense_output=True
)
for name, run in (("antilock", antilock), ("locked", locked)):
    print(f"{name:9}{run['x'][-1]:.4f} m in {run.t[-1]:.4f} s")

# %%
# A locked wheel is a stick: :math:`u` is exactly 0, and from then on the car stops at the constant
# :math:`g\,\mu(1)`. The distance with the valve is that of SciPy's DOP853, restarted at each event; without
# it, by hand:
lock = locked.event_times("stick")[0]
speed = locked(lock, "v")
exact = locked(lock, "x") + (speed**2 - 1) / (
    2 * g * (0.76 - 1.28 * np.exp(-24))
)
print(f"locked after {lock:.4f} s; by hand {exact:.4f} m")

# %%
fig, axes = plt.subplots(1, 2, figsize=(7.5, 3), sharey=True)
for ax, run, name in zip(axes, (antilock, locked), ("antilock", "locked")):
    table = run.sample()
    ax.plot(table.t, table["v"], color="#000000", label="car")
    ax.plot(table.t, table["u"], color="#0072B2", label="wheel")
    ax.set(xlabel="t (s)", xlim=(0, 4), title=f"{name}: {run['x'][-1]:.1f} m")
axes[0].set_ylabel("speed (m/s)")
axes[1].legend()
plt.show()
