r"""
A first switching system: it just slides
========================================

.. math::

    \dot x = \begin{cases} -2 & x > y\\ \;\;\,2 & x \le y\end{cases}
    \qquad
    \dot y = \begin{cases} -3 & y > x\\ \;\;\,\tfrac32 & y \le x\end{cases}

Two lines, and most solvers hang on them. On both sides of :math:`x = y` the motion points at :math:`x = y`: the
solution arrives there and stays, and a method that steps through the surface jumps back and forth across it for ever.
Ten minutes with this page bring you from the two lines to the exact solution. Type it into a notebook, or run the
file at the foot of the page; a script shows what stands alone in a line only with ``print(...)``.
"""

# %%
# Write it as it stands
# ---------------------
# Ordinary notation is enough: a ``Piecewise``, a ``sign`` or an ``Abs`` is found and becomes a
# *switch*, a multiplier :math:`\lambda` that is +1 on one side of its surface, -1 on the other,
# and anything between *on* it.
import matplotlib.pyplot as plt
import sympy as sp

from pwsmooth import System, solve

x, y = sp.symbols("x y", real=True)
pair = System(
    {
        x: sp.Piecewise((-2, x > y), (2, True)),
        y: sp.Piecewise((-3, y > x), (sp.Rational(3, 2), True)),
    }
)
pair

# %%
# ``x > y`` and ``y > x`` were written separately and are one surface; the package says so, and
# that the surface can *slide*: :math:`\lambda` stands in the rate of :math:`x - y`.
#
# Solve it
# --------
sol = solve(pair, (0, 1), {x: 1.5, y: 1}, dense_output=True)
sol

# %%
# The run met one event, the start of sliding, and from there on it moves along :math:`x = y`.
# By hand: the surface is reached at :math:`t = 1/7`; there :math:`\dot x = \dot y` needs
# :math:`-2\lambda = -\tfrac34 + \tfrac94\lambda`, so :math:`\lambda = 3/17`, and both slide
# with :math:`-6/17`.
event = sol.events[0]
name = sol.multipliers[0]
print(f"{'':10}{'computed':>20}{'exact':>20}")
for what, found, exact in (
    ("t of stick", event.time, 1 / 7),
    ("lambda", sol[name][-1], 3 / 17),
    ("x(1)", sol["x"][-1], 31 / 34),
    ("x - y", sol["x"][-1] - sol["y"][-1], 0.0),
):
    print(f"{what:10}{found:20.15f}{exact:20.15f}")
# sphinx_gallery_start_ignore
# What the text says, checked.
assert abs(event.time - 1 / 7) < 1e-14 and abs(sol[name][-1] - 3 / 17) < 1e-14
assert sol.x[0, -1] == sol.x[1, -1] and len(sol.events) == 1
# sphinx_gallery_end_ignore

# %%
# ``plot`` takes states, multipliers and outputs by name, and shades the time in which a
# multiplier is solved.
sol.plot(["x", "y", name])
plt.show()

# %%
# What step-through solvers do
# ----------------------------
# SciPy gets the same two lines, and a budget of 50 000 evaluations. A method that knows nothing
# of the surface sees a right-hand side that jumps at every step, and answers in the only way it
# has: with ever smaller steps.
import time

import numpy as np
from scipy import integrate

BUDGET = 50_000


def rates(t, state):
    a, b = state
    return [-2 if a > b else 2, -3 if b > a else 1.5]


def step_through(method, rtol=1e-6):
    """Time reached, evaluations, seconds and how it ended, within the budget."""
    begin = time.process_time()
    run = method(rates, 0, np.array([1.5, 1.0]), 1, rtol=rtol, atol=rtol / 100)
    while run.status == "running" and run.nfev < BUDGET:
        run.step()
    end = {"running": "out of budget", "failed": "step too small"}
    took = time.process_time() - begin
    return run.t, run.nfev, took, end.get(run.status, "finished")


begin = time.process_time()
solve(pair, (0, 1), {x: 1.5, y: 1})
took = time.process_time() - begin
row = "{:10}{:>12}{:>10.4f}{:>11.4f}   {}".format
print(f"{'method':10}{'evaluations':>12}{'seconds':>10}{'reached t':>11}")
print(row("pwsmooth", sol.cost["jets"], took, sol.t[-1], "finished"))
for name in ("RK45", "DOP853", "LSODA", "BDF", "Radau"):
    with np.errstate(all="ignore"):
        reached, calls, took, end = step_through(getattr(integrate, name))
    print(row(name, calls, took, reached, end))
    # sphinx_gallery_start_ignore
    assert end != "finished", (
        f"{name} passes the surface: the text says that none does"
    )
    # sphinx_gallery_end_ignore

# %%
# An evaluation of ours is a *jet*, one Taylor polynomial of the right-hand side, and there is
# one for each smooth piece: both pieces are straight lines. SciPy's own remedy is an event
# function. It ends the run at the surface, and then the user has to know what holds there:
# which fields slide, with which :math:`\lambda`, and until when. That knowledge is what the
# package is for.
#
# Change something
# ----------------
# Numbers belong in ``parameters``, so that nothing is derived or compiled again. Here the
# pull :math:`a` to the right, left of the surface, fades in time, and sliding has an end: where
# :math:`\lambda` reaches -1 the field on that side has become tangent to the surface, and then
# leads away from it.
t, a = sp.symbols("t a", real=True)
fading = System(
    {
        x: sp.Piecewise((-2, x > y), (a - 2 * t, True)),
        y: sp.Piecewise((-3, y > x), (sp.Rational(3, 2), True)),
    },
    time=t,
    parameters={a: 2},
)
for value in (2, 3):
    run = solve(fading, (0, 5), {x: 1.5, y: 1}, parameters={a: value})
    print(f"a = {value}: " + ", ".join(str(e) for e in run.events))
    # sphinx_gallery_start_ignore
    assert (
        abs(run.event_times("slip by tangency")[0] - (value + 3) / 2) < 1e-12
    )
    # sphinx_gallery_end_ignore

# %%
# Left of the surface :math:`\dot x - \dot y = a - 2t + 3`, zero at :math:`t = (a + 3)/2`: 2.5
# and 3.

# %%
# Look while you change it
# ------------------------
# A solve takes less than a millisecond, so that a parameter can have a slider (``pwsmooth
# explore`` gives one to each, of any system). Here a block on a spring is shaken over a rough
# floor. Where it sticks, it slides on :math:`v = 0` as above, and is shaded. Move
# :math:`\rho`, the strength of its static friction: 0 is Coulomb's law.
#
# .. explorer:: figure-8
#    :over: rho=0..6/41
#    :views: time, mechanism, phase
#    :height: 760

# %%
# The static part acts while :math:`v = 0` only: neither of the fields beside the surface knows of
# it.
#
# Next: :ref:`what happens inside the surface <sphx_glr_auto_tutorials_plot_2_hidden_terms.py>`.
