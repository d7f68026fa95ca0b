r"""
A decision that is not taken at once
====================================

A relay of neurons weighs evidence :math:`I(t)` for (+) or against (-) a choice. Undecided it holds its activity
:math:`x` at the threshold 0, by feedback of the sign of :math:`x`; and while it hesitates, an effort
:math:`\rho\,(1 - \lambda^2)` that exists only at the threshold makes it hold on longer:

.. math::

    \tau \dot x = -x + I(t) - w\,\lambda\,\bigl(1 + \rho\,(1 - \lambda^2)\bigr), \qquad \lambda = \operatorname{sgn} x .

**How much evidence does it take to decide, and how much to change one's mind?** Without the hidden term as much
as :math:`w` both times. With it the decision falls when the evidence reaches the largest value of the bracket,

.. math::

    I_d = w\,\tfrac{2}{3\sqrt3}\,\frac{(1 + \rho)^{3/2}}{\rho^{1/2}} \quad (\rho > \tfrac12),

and the mind, once made up, is changed as if there were none: the term acts on the threshold alone.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Switch, System, solve

t, x, w, rho, tau, top = sp.symbols("t x w rho tau top", real=True)
lam = Switch("lam", x)
evidence = top * sp.sin(t / 20)
mind = System(
    {x: (-x + evidence - w * lam * (1 + rho * (1 - lam**2))) / tau},
    time=t,
    parameters={w: 1, rho: 3, tau: 0.5, top: 2.5},
)
runs = {r: solve(mind, (0, 150), {x: 0}, parameters={rho: r}, dense_output=True) for r in (0, 3)}


def needed(r):
    return 1.0 if r <= 0.5 else 2 / (3 * np.sqrt(3)) * (1 + r) ** 1.5 / np.sqrt(r)


decided = {r: run.events[0].time for r, run in runs.items()}
for r, time in decided.items():
    print(
        f"rho = {r}: decides with evidence {2.5 * np.sin(time / 20):.12f}, by hand {needed(r):.12f}"
    )
for r, run in runs.items():
    again = [round(s.start, 3) for s in run.segments if s.status[0] == 0][1:]
    print(f"rho = {r}: hesitates again from t = {again}")

# %%
# Hesitation (green) and evidence. The decision with the hidden term comes later and with a jump of the rate.
fig, axes = plt.subplots(2, 1, figsize=(7.2, 4), sharex=True, layout="constrained")
times = np.linspace(0, 150, 4000)
for ax, (r, run) in zip(axes, runs.items()):
    ax.plot(times, 2.5 * np.sin(times / 20), color="0.7", label="evidence")
    run.plot("x", axes=[ax])
    for level in (-needed(r), needed(r)):
        ax.axhline(level, color="0.85", linewidth=0.8, zorder=0)
    ax.set(ylabel=f"activity, rho = {r}", xlabel="t" if r else "")
axes[0].legend(loc="lower left")
plt.show()
