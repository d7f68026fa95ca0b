r"""
Buck converter: pulse-width modulation and its period doubling
==============================================================

A switch feeds an LC filter and a load from a source :math:`E`. It conducts while an amplified error is
below a ramp that a clock resets every :math:`T = 0.4` ms (naturally sampled pulse-width modulation, PWM):

.. math::

    C \dot v = i - \frac vR, \qquad L \frac{di}{dt} = -v +
    \begin{cases} E & A (v - V_{\rm ref}) < r \\ 0 & \text{else} \end{cases}, \qquad
    r = V_L + (V_U - V_L)\,\operatorname{frac}\frac tT

The average of :math:`v` does what the designer wants. **At which input voltage does the ripple double its
period?**
"""

# %%
# The ramp is written as it stands; units are ms, mA, V.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Strobe, System, find_orbit, follow
from pwsmooth.studies import orbit_diagram

T = 0.4  # ms
t, v, i = sp.symbols("t v i", real=True)
E, R, L, C = sp.symbols("E R L C", positive=True)
error = 8.4 * (v - 11.3)
ramp = 3.8 + (8.2 - 3.8) * sp.frac(t / T)
buck = System(
    {
        v: (i / 1000 - v / R) / C,
        i: (sp.Piecewise((E, error < ramp), (0, True)) - v) / L * 1000,
    },
    time=t,
    parameters={E: 20, R: 22, L: 20, C: 0.047},  # V, Ohm, mH, mF
)

# %%
# The orbit with one pulse a period, followed in :math:`E`. The section lies half a period after the clock,
# where nothing switches.
orbit = find_orbit(buck, {v: 12, i: 550}, seen=Strobe(T, phase=0.5), transient=200)
branch = follow(orbit, {E: 28})
(flip,) = branch.of_kind("flip")
print(f"period doubling at E = {flip.parameter:.8f} V")

# %%
# The circuit is linear between its switchings. Matrix exponentials of the two pieces, with the saltation
# matrix at the switching between them, give a multiplier of -1 at the same voltage to eight digits; that
# computation is the page's test.
#
# The diagram is drawn upwards in :math:`E`, each run from where the last one ended.
values = np.linspace(20, 33.5, 400)
diagram = orbit_diagram(
    buck, E, values, orbit.x0, Strobe(T), transient=100, keep=60, carry=True
)
fig, ax = plt.subplots(figsize=(7, 3.4))
diagram.plot(ax, i)
ax.axvline(flip.parameter, color="#D55E00", linestyle=":")
ax.annotate(
    "period doubling",
    (flip.parameter - 0.15, 500),
    ha="right",
    color="#D55E00",
)
ax.set(xlabel="input voltage E (V)", ylabel="current at the clock (mA)")
plt.show()
