r"""
Adhesion, and a load that comes and goes
========================================

Two surfaces that attract each other rub even without a load: :math:`F = \mu\,(N + N_a)`. A block lies on a
table that shakes up and down, :math:`N(t) = N_0 (1 + q \sin \omega t)`, with :math:`q > 1`: for a part of each
period it is pulled, not pressed. A constant force :math:`P` drives it.

.. math::

    m \dot v = P - \lambda\,\mu\,\max\bigl(0,\; N(t) + N_a\bigr), \qquad \lambda \in \operatorname{Sgn} v

**How far does it get in a period, and what adhesion holds it for good?** It slips while
:math:`P > \mu (N + N_a)` and until what it has gained is lost again, so it moves unless

.. math::

    N_a \ge P/\mu + N_0\,(q - 1),

and where :math:`N + N_a` stays positive the instant of the first slip has
:math:`\sin\omega t = (P/\mu - N_a - N_0)/(q N_0)`.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Switch, System, solve

t, x, v = sp.symbols("t x v", real=True)
P, mu, N_0, q, omega, N_a = sp.symbols("P mu N_0 q omega N_a", nonnegative=True)
load = N_0 * (1 + q * sp.sin(omega * t))
lam = Switch("lam", v)
block = System(
    {x: v, v: P - lam * mu * sp.Max(0, load + N_a)},
    time=t,
    parameters={P: 0.3, mu: 0.5, N_0: 1, q: 1.2, omega: 2, N_a: 0.3},
    outputs={"hold": mu * sp.Max(0, load + N_a)},
)
run = solve(block, (0, 4 * np.pi), {x: 0, v: 0}, dense_output=True)
begins = next(e.time for e in run.events if e.kind.startswith("slip"))
exact = (np.pi - np.arcsin((0.3 / 0.5 - 0.3 - 1) / 1.2)) / 2
print(run.itinerary)
print(f"slips from t = {begins:.12f}, by hand {exact:.12f}")

# %%
# Distance in a period against adhesion: it ends where the formula says.
adhesions = np.linspace(0, 1, 101)
far = np.array([
    solve(block, (0, 2 * np.pi), {x: 0, v: 0}, parameters={N_a: a})["x"][-1] / 2 for a in adhesions
])  # fmt: skip
holds = 0.3 / 0.5 + 1.2 - 1
fig, axes = plt.subplots(1, 2, figsize=(7.4, 3), layout="constrained")
times = np.linspace(0, 4 * np.pi, 2000)
axes[0].plot(times, run(times, "hold"), color="0.6", label="what friction can hold")
axes[0].axhline(0.3, color="0.8", linewidth=0.8)
run.plot("v", axes=[axes[0]])
axes[0].set(xlabel="t", ylabel="force, speed")
axes[0].legend(loc="upper right")
axes[0].set_ylim(-0.05, 1.6)
axes[1].plot(adhesions, far, color="#0072B2")
axes[1].axvline(holds, color="#009E73", linewidth=0.8)
axes[1].set(xlabel="adhesion N_a", ylabel="distance in a period")
plt.show()
