r"""
Spiking neurons that synchronise
================================

Integrate-and-fire neurons with a common synapse: each charges towards :math:`I > 1`, fires at 1 and starts
anew at 0; its spike raises the synaptic current of all:

.. math::

    \dot v_i = I - v_i + s, \quad \dot s = -s/\tau, \qquad v_i = 1: \;\; v_i \to 0, \;\; s \to s + \varepsilon/n

**Do they find a common beat, and which?** If they do, its period is the root of

.. math::

    1 = I\,(1 - e^{-T}) + \frac{\varepsilon}{1 - e^{-T/\tau}}\,\frac{e^{-T} - e^{-T/\tau}}{1/\tau - 1} .
"""

# %%
# One element of the family has one event; what several spikes of one instant add to the synapse adds up.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Event, Family, System, solve

I, epsilon, tau = 1.1, 0.4, 0.05


def network(n):
    """n neurons; states v and s."""
    neurons = Family(n, name="neuron")
    (v,) = neurons.symbols("v")
    s = sp.Symbol("s", real=True)
    spike = Event(
        v - 1, direction=1, update={v: 0, s: s + epsilon / n}, name="spike"
    )
    return System({v: I - v + s, s: -s / tau}, events=[spike])


n = 50
rng = np.random.default_rng(0)
start = {"v": list(np.sort(rng.uniform(0, 1, n))), "s": 0}
sol = solve(network(n), (0, 400), start)
print(f"{len(sol.events)} spikes, {sol.cost['steps']} steps")

# %%
# The beat of one neuron at the end, and the root:
beat = np.diff(sol.event_times(switch="spike 1"))[-1]


def common(T):
    rest, fast = np.exp([-T, -T / tau])
    return I * (1 - rest) + epsilon / (1 - fast) * (rest - fast) / (
        1 / tau - 1
    )


exact = brentq(lambda T: common(T) - 1, 0.5, 5, xtol=1e-14)
print(f"period {beat:.9f}, by hand {exact:.9f}")

# %%
# That every single spike is in its place was seen on six neurons, whose charging is a sum of exponentials.
# Groups form, grow and swallow each other.
when = sol.event_times()
who = np.array([int(e.switch.split()[1]) for e in sol.events])
fig, ax = plt.subplots(figsize=(7, 3.2))
ax.plot(when, who, ".", color="#0072B2", markersize=2)
ax.set(xlabel="t", ylabel="neuron", xlim=(0, 60))
plt.show()
