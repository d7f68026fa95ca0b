r"""
Which method, which model
=========================

Two choices precede every study: how to solve the equations, and how much model the question needs. Both
can be measured, on your scene, before the study.
"""

# %%
# Which method
# ------------
# :func:`~pwsmooth.compare.measuring.work_precision` runs methods on scenes whose answer is
# known by an independent path and reports error against work. Besides the package's own paths
# there are SciPy's integrators, restarted at located events as a careful user would or stepping
# through the switch with a bare ``sign``, time stepping, and others where they are installed.
# Here, with few settings each: the oscillator with static friction as a hidden term.
from dataclasses import replace

import matplotlib.pyplot as plt

from pwsmooth.compare import METHODS, work_precision
from pwsmooth.compare.charts import plot_work

chosen = {
    "event-driven": (1e-6, 1e-9, 1e-12),
    "smoothed, algebraic": ((1e-2, 1e-3), (1e-4, 1e-5), (1e-6, 1e-7), (1e-8, 1e-9)),
    "DOP853, restarted": (1e-3, 1e-6, 1e-9),
    "DOP853, bare sign": (1e-3,),
}
methods = [replace(METHODS[name], settings=few) for name, few in chosen.items()]
points = work_precision(["hidden"], methods, repeats=3)
row = "{:30}{:>16}{:>10}{:>11}{:>14}  {}".format
print(row("method", "setting", "error", "ms", "evaluations", "itinerary"))
for p in points:
    ms = f"{1e3 * p.seconds:.2f}"
    print(
        row(p.method, str(p.setting), f"{p.error:.1e}", ms, p.evaluations, p.itinerary)
    )

# sphinx_gallery_start_ignore
for p in points:
    assert p.itinerary == ("wrong" if "bare" in p.method else "right"), p
# sphinx_gallery_end_ignore

# %%
fig, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
plot_work(points, ax, label=False)
for name in chosen:
    p = next(p for p in points if p.method == name)
    ax.annotate(
        name, (p.seconds, p.error), (6, 2), textcoords="offset points", fontsize=8
    )
ax.set_xlim(right=1)
ax.set_title("Error against processor time; open: wrong itinerary")
plt.show()

# %%
# Read it from the right column: a method with a wrong *itinerary*, another sequence of sticks
# and slips, has no error worth the name, however small its steps. The methods that see only
# :math:`\lambda = \pm 1` cannot know the hidden term and converge to another system. Smoothing
# knows it, and pays with an error of the order :math:`\varepsilon^{2/3}` that no tolerance
# removes. The full study, with more scenes and methods, is in the gallery of experiments
# (``work_precision``).
#
# Which model
# -----------
# A block on a belt, again. Is Coulomb friction with a static coefficient enough, or does it
# take bristles? Decide by the quantity that the question is about, here the largest slip
# velocity and the period of stick-slip, and measure it up the ladder of laws. The simpler laws
# take their parameters from the richest one, by *its* steady curve.
import numpy as np

from pwsmooth.laws.friction import Coulomb, LuGre, StaticKinetic, StribeckFriction
from pwsmooth.scenes import block_on_belt

richest = LuGre(F_s=1.5, sigma2=0.0)
ladder = {
    "Coulomb": Coulomb(F_c=richest.F_c),
    "static and kinetic": StaticKinetic(F_c=richest.F_c, F_s=richest.F_s),
    "Stribeck": StribeckFriction(
        F_c=richest.F_c, F_s=richest.F_s, v_s=richest.v_s, sigma2=0.0
    ),
    "bristles (LuGre)": richest,
}
# sphinx_gallery_start_ignore
fastest, steps = {}, {}
# sphinx_gallery_end_ignore
print(f"{'model':20}{'largest v (m/s)':>17}{'period (s)':>13}{'steps':>9}")
for name, law in ladder.items():
    sol = block_on_belt(law).solve(t_eval=np.linspace(0, 35, 35001))
    speed = sol["v"]
    starts = sol.t[1:][(speed[1:] > 0.05) & (speed[:-1] <= 0.05)]
    period = f"{starts[-1] - starts[-2]:.4f}" if len(starts) > 1 else "none"
    print(f"{name:20}{speed.max():>17.5f}{period:>13}{sol.cost['steps']:>9}")
    # sphinx_gallery_start_ignore
    fastest[name], steps[name] = speed.max(), sol.cost["steps"]
rich = "bristles (LuGre)"
assert all(abs(fastest[name] / fastest[rich] - 1) < 0.04 for name in list(ladder)[1:])
assert steps[rich] > 1000 * steps["static and kinetic"]
# sphinx_gallery_end_ignore

# %%
# Under Coulomb's law the block does not stick and slip: it keeps swinging with the period of its
# spring. A static coefficient gives stick-slip, with period and speed within a few per cent of
# those of the bristles; the Stribeck velocity hardly changes that, and the bristles cost a thousand
# times the steps. If a few per cent will do, take the second rung. Ask another question of the same
# scene, such as how far the block creeps before it breaks away, and only the bristles have an
# answer.
