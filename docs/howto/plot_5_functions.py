r"""
Run a model that is Python code
===============================

Some models are no formulas: a table, a loop, code of other people. :meth:`System.from_functions
<pwsmooth.System.from_functions>` takes them as functions that numba compiles,

.. math::

    \dot x = f(t, x, \lambda, p), \qquad \lambda_j = \operatorname{sign} h_j(t, x, p) \text{ off } h_j = 0, \qquad
    \lambda_j \in [-1, 1] \text{ on it,}

and runs them in the same loop as systems of formulas: slips, sticks, hidden terms and their folds, events that are
located and not stepped over.
"""

# %%
# A block on a belt
# -----------------
# Its friction has a static level that acts on the surface alone, :math:`\lambda\,(1 + \rho\,(1 - \lambda^2))`, and the
# spring that holds it stiffens. ``x``, ``lam`` and ``p`` are arrays, in the order of the names.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Event, Switch, System, solve


def f(t, x, lam, p):
    y, v = x
    spring = y + p[2] * y**3
    friction = p[0] * lam[0] * (1 + p[1] * (1 - lam[0] ** 2))
    return v, -spring - friction


def slip(t, x, p):
    return x[1] - p[3]


values = {"N": 0.5, "rho": 1.5, "stiffening": 0.3, "belt": 0.2}
block = System.from_functions(f, "y v", surfaces={"lam": slip}, parameters=values)
run = solve(block, (0, 40), {"y": 0, "v": 0}, rtol=1e-11, dense_output=True)
print(run.events)

# %%
# The same in symbols, where they can be had:
y, v = sp.symbols("y v", real=True)
N, rho, stiffening, belt = sp.symbols("N rho stiffening belt", real=True)
lam = Switch("lam", v - belt)
formulas = System(
    {y: v, v: -y - stiffening * y**3 - N * lam * (1 + rho * (1 - lam**2))}, parameters=values
)
reference = solve(formulas, (0, 40), {"y": 0, "v": 0}, rtol=1e-11)
apart = max(abs(a.time - b.time) for a, b in zip(run.events, reference.events, strict=True))
print(f"all {len(reference.events)} events agree to {apart:.0e}")

# %%
times = np.linspace(0, 40, 2000)
fig, ax = plt.subplots(figsize=(7, 3))
ax.plot(times, run(times, "y"), color="#0072B2", label="y")
ax.plot(times, run(times, "lam"), color="#D55E00", linewidth=0.9, label=r"$\lambda$")
ax.set(xlabel="t", xlim=(0, 40))
ax.legend(loc="center right", bbox_to_anchor=(1, 0.45), ncols=2, frameon=False)
plt.show()

# %%
# Events
# ------
# :class:`~pwsmooth.Event` takes functions too. ``update`` returns the whole state after it.


def fall(t, x, lam, p):
    return x[1], -9.81 - p[0] * x[1] * abs(x[1])


bounce = Event(lambda t, x, p: x[0], direction=-1, update=lambda t, x, p: (x[0], -0.7 * x[1]), name="floor")
slow = Event(lambda t, x, p: x[0], when=lambda t, x, p: abs(x[1]) < 0.5, terminal=True, name="slow")
ball = System.from_functions(fall, "height speed", parameters={"drag": 0.02}, events=[bounce, slow])
dropped = solve(ball, (0, 20), {"height": 2, "speed": 0})
print(dropped.events)

# %%
# What it cannot do
# -----------------
# * Only :func:`~pwsmooth.solve` runs such a system, forward, on the explicit pair of order 8(5,3): no Taylor steps,
#   and none for stiff models. A fold that is touched to the last digit, which Taylor steps record, is passed in
#   silence, and a two-fold is told as a fold.
# * No views (``smoothed``, ``layered``), contacts, memories, unknowns, families, drives and outputs; no noise, no
#   derivatives, no runs backward in time; no sweeps, orbits, equilibria and fits, and no files: all of them need
#   formulas, and are refused.
# * Nothing is found in the code: each surface is named, a kink of ``f`` that is none shortens the steps, and no sign,
#   unit or class of switch is checked. No multiplier stands in a surface.
# * A surface is smooth, and compiled for complex numbers too, by which its slopes are taken exactly: numpy's functions
#   and arithmetic, no ``abs``, no comparison, not ``math``.
# * ``f`` exists a little beyond :math:`\lambda = \pm 1`. Where it raises, it counts as nan.
# * Code is compiled in every process anew, for some seconds.
