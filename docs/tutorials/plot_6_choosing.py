r"""
Which method, which model
=========================

Two choices precede every study: how to solve the equations, and how much model the question needs. Both
can be measured, on your scene, before the study.
"""

# %%
# Which method
# ------------
# :func:`~pwsmooth.compare.work_precision` runs methods on scenes whose answer is
# known by an independent path and reports error against work. Besides the package's own paths
# there are SciPy's integrators, restarted at located events as a careful user would or stepping
# through the switch with a bare ``sign``, time stepping, and others where they are installed.
# Here, with few settings each: the oscillator with static friction as a hidden term.
from dataclasses import replace

import matplotlib.pyplot as plt

from pwsmooth.compare import METHODS, work_precision
from pwsmooth.compare.efficiency.charts import plot_work

chosen = {
    "event-driven": (1e-6, 1e-9, 1e-12),
    "smoothed, algebraic": (
        (1e-2, 1e-3),
        (1e-4, 1e-5),
        (1e-6, 1e-7),
        (1e-8, 1e-9),
    ),
    "DOP853, restarted": (1e-3, 1e-6, 1e-9),
    "DOP853, bare sign": (1e-3,),
}
methods = [
    replace(METHODS[name], settings=few) for name, few in chosen.items()
]
points = work_precision(["hidden"], methods, repeats=3)
row = "{:30}{:>16}{:>10}{:>11}{:>14}  {}".format
print(row("method", "setting", "error", "ms", "evaluations", "itinerary"))
for p in points:
    ms = f"{1e3 * p.seconds:.2f}"
    print(
        row(
            p.method,
            str(p.setting),
            f"{p.error:.1e}",
            ms,
            p.evaluations,
            p.itinerary,
        )
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
        name,
        (p.seconds, p.error),
        (6, 2),
        textcoords="offset points",
        fontsize=8,
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
# A law of ten states and a law of none may give the same amplitude, or the law of ten states
# may be the only one that gives the loss. :func:`~pwsmooth.compare.ladder` runs the models of
# growing fidelity on a scene, takes the richest as the measure of the others, and names the
# cheapest that is near enough for *one* observable and tolerance. Poorer models take their
# parameters from the richest by rules, which it prints; nothing is tuned.
from pwsmooth.compare import ladder

belt = ladder("belt", "period", "3%")
print(belt)
# sphinx_gallery_start_ignore
assert belt.recommended == "Stribeck curve"
# sphinx_gallery_end_ignore

# %%
# A block on a belt: Coulomb's law does not stick and slip at all, a static coefficient gives
# the period roughly, and the Stribeck curve is near enough for a tolerance of three per cent.
# The error bars are numerical, from a run at a tighter tolerance.
fig, axes = plt.subplots(1, 2, figsize=(7.8, 3.6), layout="constrained")
belt.chart(axes)
plt.show()

# %%
# Ask differently, and the answer differs. An oscillator that never sticks needs no more than
# Coulomb; for the loss in a small loop of presliding nothing short of the richest law will do.
questions = {
    "oscillator": ("forced oscillator", "amplitude", "1%"),
    "presliding": ("presliding", "loss", "2%"),
}
for name, question in questions.items():
    found = ladder(*question)
    print(f"{name:12}", found.reason)
    # sphinx_gallery_start_ignore
    assert (
        found.recommended
        == {"oscillator": "Coulomb", "presliding": None}[name]
    )
    # sphinx_gallery_end_ignore

# %%
# Scenes, observables and rungs are listed by ``pwsmooth ladder --list``; a scene of your own is
# an argument like the built-in ones. How to read the result: :doc:`/ladder`.
