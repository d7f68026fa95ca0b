r"""
A sliding bearing under two-axis ground motion
==============================================

A building stands on sliding bearings: friction :math:`\mu g` in the plane, a weak restoring force, ground that
accelerates in both directions,

.. math::

    \dot u = -k x - \mu g\,\lambda - a(t), \qquad \lambda = \frac{u}{\lvert u\rvert}, \;\lvert\lambda\rvert \le 1
    \text{ at rest.}

**What does one friction law for each axis get wrong?** It has the force :math:`\sqrt 2\,\mu g` along a diagonal, so
that it slips later there and comes to rest elsewhere. The record is synthetic: three sines in each direction under an
envelope.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.laws.friction import Coulomb
from pwsmooth.plotting import COLOUR

t, x, y, u, v = sp.symbols("t x y u v", real=True)
k, strength = sp.symbols("k strength", positive=True)
envelope = (t / 4) ** 2 * sp.exp(2 - t / 2)
ground = [
    strength * envelope * sum(a * sp.sin(w * t + phase) for a, w, phase in waves)
    for waves in (
        ((1.0, 3.1, 0.3), (0.7, 5.3, 1.1), (0.5, 8.7, 2.0)),
        ((0.9, 2.7, 1.9), (0.8, 4.6, 0.2), (0.4, 9.4, 0.7)),
    )
]


def bearing(fx, fy, values):
    """The building over the ground, under these friction forces a unit of mass."""
    rates = {x: u, y: v, u: -k * x - fx - ground[0], v: -k * y - fy - ground[1]}
    return System(rates, time=t, parameters={k: 0.6, strength: 1.5, **values})


vector = Coulomb(F_c=0.6).attach(velocity=(u, v))
first, second = (Coulomb(F_c=0.6).attach(velocity=w, name=str(w)) for w in (u, v))
models = {
    "vector law": bearing(*vector.force, vector.parameters),
    "a law for each axis": bearing(first.force, second.force, {**first.parameters, **second.parameters}),
}
rest = {x: 0, y: 0, u: 0, v: 0}
runs = {name: solve(model, (0, 30), rest, dense_output=True) for name, model in models.items()}
for name, run in runs.items():
    far = np.hypot(*(run(np.linspace(0, 30, 5000), c) for c in "xy"))
    print(f"{name:20} farthest {far.max():.4f}, left at rest {far[-1]:.4f}, {len(run.event_times('stick'))} stops")

# %%
# How far the building goes, against the strength of the ground motion.
strengths = np.linspace(0.5, 2.5, 41)
times = np.linspace(0, 30, 1500)
farthest = {
    name: [
        np.hypot(*solve(model, (0, 30), rest, t_eval=times, parameters={strength: s}).x[:2]).max()
        for s in strengths
    ]
    for name, model in models.items()
}
fig, axes = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
for (name, run), colour in zip(runs.items(), (COLOUR["right"], COLOUR["left"]), strict=True):
    path = np.linspace(0, 30, 4000)
    axes[0].plot(run(path, "x"), run(path, "y"), color=colour, linewidth=1, label=name)
    axes[0].plot(run["x"][-1], run["y"][-1], "o", color=colour, markersize=4)
    axes[1].plot(strengths, farthest[name], color=colour, linestyle="-" if "vector" in name else "--", label=name)
axes[0].set(xlabel="x", ylabel="y", aspect="equal")
axes[1].set(xlabel="strength of the ground motion", ylabel="farthest from the middle")
axes[1].legend()
plt.show()

# %%
# In a slip the building turns into the force that acts on it, which no law of one axis can say.
