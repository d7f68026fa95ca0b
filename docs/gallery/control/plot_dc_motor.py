r"""
DC motor with dry friction under PWM
====================================

A bridge puts :math:`+U` on the armature for a part :math:`d` of the period :math:`T` and :math:`-U` for the
rest; dry friction holds the shaft:

.. math::

    L\,\frac{di}{dt} = \pm U - R\,i - k\,\omega, \qquad J\,\dot\omega = k\,i - b\,\omega - M_c \operatorname{sign}\omega

**From which duty ratio on does the motor turn?** The mean torque exceeds :math:`M_c` where :math:`k\,U\,(2d
- 1)/R > M_c`; but the current has a ripple, and its peak breaks the shaft loose earlier.
"""

# %%
# The clock is the fractional part of :math:`t/T`. SI units.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Strobe, System, find_orbit, follow, sweep
from pwsmooth.studies import Work

t, i, w = sp.symbols("t i omega", real=True)
d = sp.Symbol("d", positive=True)
U, R, L, k, J, b, M_c = 12.0, 1.0, 2e-3, 0.05, 1e-4, 1e-4, 0.15
T = 1e-3
motor = System(
    {
        i: (U * sp.sign(d - sp.frac(t / T)) - R * i - k * w) / L,
        w: (k * i - b * w - M_c * sp.sign(w)) / J,
    },
    time=t,
    parameters={d: 0.52},
)

# %%
# The locked motor is a periodic orbit like any other. Followed in :math:`d` it ends to stick where the peak
# of the current reaches :math:`M_c/k`, a bifurcation that is located; by hand the peak is :math:`\frac
# UR\,\frac{1 - 2a + c}{1 - c}` with :math:`a = e^{-dTR/L}`, :math:`c = e^{-TR/L}`.
locked = find_orbit(motor, {i: 0, w: 0}, seen=Strobe(T, phase=0.3), transient=20)
branch = follow(locked, {d: 0.6})
loose = branch.specials[0]


def peak(d):
    a, c = np.exp([-d * T * R / L, -T * R / L])
    return U / R * (1 - 2 * a + c) / (1 - c)


exact = brentq(lambda d: k * peak(d) - M_c, 0.5, 0.7)
print(loose.kind)
print(f"breaks loose at d = {loose.parameter:.10f}, by hand {exact:.10f}")

# %%
# Between there and the value that averages tell, the motor creeps: it slips a little in every period.
duty = np.linspace(0.5, 0.7, 81)
found = sweep(
    motor,
    {d: duty},
    x0={i: 0, w: 0},
    seen=Strobe(T),
    transient=400,
    periods=10,
    measures=["statistics(omega)"],
    work=Work(progress=False),
)
average = (k * U * (2 * duty - 1) / R - M_c) / (b + k**2 / R)
fig, ax = plt.subplots(figsize=(7, 3.2))
ax.semilogy(duty, found["omega_mean"], color="#0072B2", label="exact")
ax.plot(
    duty,
    np.where(average > 0, average, np.nan),
    "--",
    color="0.5",
    label="averaged voltage",
)
ax.axvline(exact, color="#D55E00", linestyle=":", label="breaks loose")
ax.set(xlabel="duty ratio d", ylabel="mean speed (rad/s)", ylim=(1e-4, 50))
ax.legend()
plt.show()
