r"""
The least effort
================

A block on a table with dry friction is to be moved by a unit of length within five units of time, and to rest at the
end:

.. math::

    \dot x = v, \qquad \dot v = u(t) - \mu\,\mathrm{sgn}\,v, \qquad \int_0^5 u^2\,dt \to \min

**Which force moves it with the least effort, and for how long?** Friction stops the block and holds it for nothing. So
the force may end early; when it does is a part of the question.
"""

# %%
# An input that can be varied
# ---------------------------
# A :class:`~pwsmooth.Control` is a polynomial on each piece of a grid. Its coefficients are parameters of the system,
# and with ``movable=True`` so are the inner times of the grid. Here it is a broken line: the first guess falls to 0.5
# at t = 2.5 and to 0 at the end.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Control, System
from pwsmooth.costs import final, integral, largest, minimise

x, v = sp.symbols("x v", real=True)
mu = sp.Symbol("mu", positive=True)
u = Control("u", [0, 2.5, 5], [1.5, 0.5, 0], degree=1, continuous=True, movable=True)
block = System({x: v, v: u - mu * sp.sign(v)}, parameters={mu: 0.5})
block

# %%
# The search
# ----------
# The cost is made of quantities of the run, and so are the constraints. What is varied is named: here the first two
# values of the input and the time between its pieces; its last value stays 0.
arrives = sp.Eq(final(x), 1)
start = {x: 0, v: 0}
found = minimise(
    block, integral(u**2), (0, 5), start, ["u_0", "u_1", "u_t1"], constraints=[arrives]
)
found

# %%
# Every run gives the cost, the place where the block ends, and exact slopes of both, through the instant at which it
# sticks. The answer is known: while the block moves, the best force is a straight line; the least of
# :math:`12/T^3 + \mu^2 T` over the time :math:`T` of the motion is at :math:`T = \sqrt{6/\mu}`, where the line falls
# from :math:`2\mu` to 0.
T = np.sqrt(6 / 0.5)
print(f"effort {found.cost:.9f}, in closed form {4 / 3 * 0.5**2 * T:.9f}")
print(f"the force ends at {found.values['u_t1']:.6f}, in closed form {T:.6f}")

# %%
# A limit
# -------
# Inequalities are written as they are said. If the block must not move faster than 0.35, the force holds it at that
# speed for a while, as large as friction: a grid of more pieces, whose times all move.
several = Control(
    "u", [0, 1, 2, 4, 5], [1, 0.5, 0.5, 0, 0], degree=1, continuous=True, movable=True
)
slow = System({x: v, v: several - mu * sp.sign(v)}, parameters={mu: 0.5})
limited = minimise(
    slow,
    integral(several**2),
    (0, 5),
    start,
    ["u_0", *several.instants],
    constraints=[arrives, largest(v) <= 0.35],
)
limited

# %%
# This one is known too: :math:`\mu^2/V + 8\mu V/3` for the speed :math:`V`.
print(f"effort {limited.cost:.9f}, in closed form {0.25 / 0.35 + 4 / 3 * 0.35:.9f}")

# %%
# In the picture the block sticks where the axes are shaded.
figure, axes = plt.subplots(2, 2, figsize=(8, 4.2), sharex=True, sharey="row", layout="constrained")
for column, (title, result) in enumerate({"free": found, "v <= 0.35": limited}.items()):
    run = result.solution
    t = np.linspace(0, 5, 600)
    for ax, name, label in ((axes[0, column], "u", "force u"), (axes[1, column], "v", "velocity v")):
        ax.plot(t, run(t, name), color="#0072b2")
        ax.set_ylabel(label if column == 0 else "")
        for segment in run.segments:
            if segment.status[0] == 0:
                ax.axvspan(segment.start, segment.end, color="0.9", linewidth=0)
    axes[0, column].set_title(f"{title}: effort {result.cost:.4f}")
    axes[1, column].set_xlabel("t")
plt.show()

# %%
# When it does not go well
# ------------------------
# * ``success`` and ``message`` say how the search ended; Ctrl-C ends it too, with the best until then.
# * The minimum is a local one. Begin elsewhere, with ``by={"u_0": 2, ...}``, or give ``bounds``.
# * ``refused`` counts points that had no derivative, such as a grazing, or no cost, such as an event that does not
#   happen; the search goes on beside them, and ``problem`` says what the first was.
# * A constraint that a stuck block fulfils has no slope there: ``final(v) = 0`` says nothing about how to come to rest.
#   Let friction do it, as here, or ask for the time of the stop.

# What the text says, checked.
assert found.success and abs(found.cost - 4 / 3 * 0.5**2 * T) < 1e-8
assert abs(found.values["u_t1"] - T) < 1e-4
assert limited.success and abs(limited.cost - 0.25 / 0.35 - 4 / 3 * 0.35) < 1e-6
