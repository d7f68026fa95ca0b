r"""
Sticking, layers and hidden terms
=================================

A block on a shaken plate: spring, damper, drive, and dry friction that is stronger at rest than in motion,

.. math::

    \dot y = v, \qquad \dot v = -\sigma \sin t - k y - c v - \mu, \qquad
    \mu = \lambda\,\bigl(1 + \rho\,(1 - \lambda^2)\bigr), \quad \lambda = \operatorname{sign} v .

In slip :math:`\lambda = \pm 1`, so that :math:`1 - \lambda^2 = 0` and :math:`\mu = \pm 1`: the term with :math:`\rho`
cannot be seen. On :math:`v = 0` it is all there is to static friction. It is a *hidden term*, and whether a solver
keeps it decides what the block does.
"""

# %%
# Two readings of one definition
# ------------------------------
# The multiplier is written as a :class:`~pwsmooth.Switch`, a symbol that knows its surface,
# because a formula nonlinear in :math:`\lambda` means something. ``convention="filippov"``
# reads the same equations as a Filippov solver does: on the surface it takes the convex
# combination of the two sides, which knows nothing of :math:`\rho`.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Switch, System, solve

t, y, v, z = sp.symbols("t y v z", real=True)
k, c, sigma, rho, beta = sp.symbols("k c sigma rho beta", positive=True)
lam = Switch("lam", v)
mu = lam * (1 + rho * (1 - lam**2))
rates = {y: v, v: -sigma * sp.sin(t) - k * y - c * v - mu}
given = dict(
    time=t,
    parameters={k: 3.1, c: 0.1, sigma: 2.4, rho: 3},
    outputs={"mu": mu},
)
block = System(rates, **given)
filippov = System(rates, convention="filippov", **given)
block

# %%
PERIOD = 2 * np.pi
start = {y: 0.78, v: -1.03}
kept = solve(block, (0, 40 * PERIOD), start, dense_output=True)
dropped = solve(filippov, (0, 40 * PERIOD), start, dense_output=True)

fig, axes = plt.subplots(
    3, 2, sharex=True, sharey="row", figsize=(7.5, 5), layout="constrained"
)
last = (38 * PERIOD, 40 * PERIOD)
for column, (sol, title) in enumerate(
    ((kept, "hidden term kept"), (dropped, "convex combination"))
):
    sol.plot(["y", "v", "mu"], axes=axes[:, column])
    axes[0, column].set(title=title, xlim=last)
for ax in axes[:, 1]:
    ax.set_ylabel("")
plt.show()

# %%
# The same block, the same equations in slip. With the hidden term it sticks twice a period
# (shaded); without it, it never sticks at all.
for name, sol in (("kept", kept), ("dropped", dropped)):
    print(f"{name:8}", " | ".join(sol.itinerary[-5:]))
# sphinx_gallery_start_ignore
# What the text says, checked.
late = [
    [s.name for s in sol.segments if s.start > last[0]]
    for sol in (kept, dropped)
]
assert sum("stick" in name for name in late[0]) == 4
assert not any("stick" in name for name in late[1])
# sphinx_gallery_end_ignore

# %%
# What happens inside the surface
# -------------------------------
# At :math:`v = 0` the multiplier is an unknown with a dynamics of its own, infinitely fast.
# This is the *layer system*,
#
# .. math::
#
#    \lambda' = g(\lambda) = F - \mu(\lambda), \qquad F = -\sigma \sin t - k y ,
#
# with time and state frozen. It starts at the side from which the block arrives. If it meets an
# attracting root of :math:`g`, the block sticks; if it runs through to the other side, the
# block crosses.
fig, ax = plt.subplots(figsize=(6.5, 3), layout="constrained")
lambdas = np.linspace(-1, 1, 401)
strength = lambdas * (1 + 3 * (1 - lambdas**2))
for force, style in ((1.3, "-"), (16 / 9, "--"), (2.1, ":")):
    ax.plot(lambdas, force - strength, style, label=f"F = {force:.3g}")
ax.axhline(0, color="0.6", linewidth=0.8)
ax.set(xlabel="λ", ylabel="λ' = F − μ(λ)", title="The layer system for ρ = 3")
ax.legend()
plt.show()

# %%
# At :math:`F = 1.3` there is an attracting root, where the graph falls through zero: sticking.
# As the force grows the root moves right, and meets a repelling one where :math:`\mu` is
# largest. There the stick ends, not at :math:`|\lambda| = 1` but in a *fold*.
# :func:`~pwsmooth.analysis.sticking.fold` finds it for any hidden term, and the solver's events
# say the same.
from pwsmooth.analysis.sticking import fold

top = fold(1 - lam**2, lam, 3)
print(
    f"fold at lambda_s = {top.lam_s}, height mu_s = {top.mu_s} = {float(top.mu_s):.9f}"
)
ends = kept.event_times("slip by fold")
force = np.abs(2.4 * np.sin(ends) + 3.1 * kept(ends, "y"))
print(f"{len(ends)} sticks ended in a fold, farthest from mu_s by", end=" ")
print(f"{np.abs(force - 16 / 9).max():.1e}")
# sphinx_gallery_start_ignore
# What the text says, checked.
assert np.abs(force - 16 / 9).max() < 1e-9 and len(ends) > 70
# sphinx_gallery_end_ignore

# %%
# The layer at every instant of the motion, for other strengths of the hidden term: drag the
# line in the time series, and see the roots meet where a stick ends.
#
# .. explorer:: fold
#    :over: rho=0.2..6/30
#    :views: time, layer, characteristic
#    :height: 780

# %%
# How fast does static friction build up?
# ---------------------------------------
# So far the hidden term acted at once. If it takes a time :math:`\beta` to build up, it is a
# state of its own,
#
# .. math::
#
#    \mu = \lambda\,(1 + \rho z), \qquad \beta \dot z = 1 - \lambda^2 - z ,
#
# and whether a slipping block is *captured* becomes a race between the layer, of width
# :math:`\varepsilon`, and :math:`\beta`. The limits :math:`\varepsilon \to 0` and :math:`\beta
# \to 0` do not commute. :meth:`~pwsmooth.System.layered` takes them in any order: ``{z: oo}``
# slaves :math:`z`, a number is :math:`\varepsilon/\beta`, ``{z: 0}`` lets the layer go first.
relaxing = System(
    {
        y: v,
        v: -sigma * sp.sin(t) - k * y - c * v - lam * (1 + rho * z),
        z: (1 - lam**2 - z) / beta,
    },
    time=t,
    parameters={k: 3.1, c: 0.1, sigma: 2.4, rho: 3, beta: 0.1},
)
begin = {y: 0.6, v: -1.07}
views = {
    "beta = 0.1": (relaxing, {**begin, z: 0}),
    "eps/beta = 0": (relaxing.layered({z: 0}), begin),
    "eps/beta = 0.3": (relaxing.layered({z: 0.3}), begin),
    "slaved": (relaxing.layered({z: sp.oo}), begin),
}
print(f"{'':16}sticks a period   their duration")
counts = []
for name, (system, at) in views.items():
    sol = solve(system, (0, 60 * PERIOD), at)
    late = [s for s in sol.segments if s.start > 50 * PERIOD]
    sticks = [s.duration for s in late[:-1] if s.name.startswith("stick")]
    counts.append(round(len(sticks) / 10))
    print(f"{name:16}{counts[-1]:10}{sticks[-1]:23.9f}")
# sphinx_gallery_start_ignore
# What the text says, checked.
assert counts == [1, 1, 2, 2]
# sphinx_gallery_end_ignore

# %%
# Four views, two kinds of motion: static friction that is slower than the layer captures the
# block once a period, one that keeps up with it twice. The border between them is a number that
# the package computes: the largest opposing force at which a slipping contact is captured.
from pwsmooth.analysis.sticking import capture_threshold, critical_ratio

for ratio in (0, 0.01, 0.1, 0.3, 0.6, 1):
    print(
        f"eps/beta = {ratio:<5} captured up to F = {capture_threshold(3, ratio):.6f}"
    )
print(f"reaches mu_s = 16/9 at eps/beta = {critical_ratio(3):.4f}")

# %%
# Which of these is true of a given contact is for the experiment to say. The definition is the
# same; only the view changes. The terms are defined in :doc:`/theory/index`; that none of this
# is an artefact of the limit is :ref:`the next page
# <sphx_glr_auto_tutorials_plot_3_smoothing_and_noise.py>`.
