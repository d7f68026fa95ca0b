r"""
Thermostat with hysteresis
==========================

A room loses heat to the outside at :math:`T_0`, and a heater goes on below :math:`T_{\rm low}` and off
above :math:`T_{\rm high}`:

.. math::

    \dot T = -\frac{T - T_0}{\tau} + q\,\frac{P}{C}, \qquad
    q \to 1 \text{ at } T = T_{\rm low}\!\downarrow, \quad q \to 0 \text{ at } T = T_{\rm high}\!\uparrow

**How often does the heater switch, and what does it cost?** Both follow from two exponentials. What does
not is a house: here the outside gets warm and cold over the day.
"""

# %%
# The state of the heater changes only in events: it is a ``Memory``.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Event, Memory, System, solve

t, T = sp.symbols("t T", real=True)
mean, swing = sp.symbols("mean swing", real=True)
q = Memory("q", 1)  # 1: the heater is on
low, high, tau, heating = 19.0, 21.0, 8.0, 5.0  # C, C, h, C/h
outside = mean + swing * sp.cos(2 * sp.pi * (t - 15) / 24)
room = System(
    {T: -(T - outside) / tau + heating * q},
    time=t,
    parameters={mean: 4, swing: 0},
    outputs={"outside": outside},
    events=[
        Event(T - low, direction=-1, update={q: 1}, name="on"),
        Event(T - high, direction=1, update={q: 0}, name="off"),
    ],
)

# %%
# At a constant 4 degrees outside, against the closed form:
steady = solve(room, (0, 48), {T: 19})
period = np.diff(steady.event_times(switch="on"))[-1]
ends = 4 + tau * heating, 4  # what the room tends to, heated and not
exact = tau * (
    np.log((ends[0] - low) / (ends[0] - high))
    + np.log((high - ends[1]) / (low - ends[1]))
)
print(f"a cycle takes {period:.12f} h")
print(f"closed form   {exact:.12f} h")

# %%
# And over a day:
sol = solve(room, (0, 48), {T: 19}, parameters={swing: 6}, dense_output=True)
times = np.linspace(0, 48, 2000)
fig, ax = plt.subplots(figsize=(7, 3))
ax.plot(times, sol(times, "T"), color="#0072B2", label="room")
ax.plot(times, sol(times, "outside"), color="0.5", label="outside")
ax.fill_between(
    times,
    0,
    2 * sol(times, "q"),
    step="post",
    color="#D55E00",
    lw=0,
    label="heater",
)
ax.set(xlabel="t (h)", ylabel="temperature (°C)", xlim=(0, 48), ylim=(-3, 27))
ax.legend(ncols=3, loc="upper center")
plt.show()
