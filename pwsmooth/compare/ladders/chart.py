"""The chart of a ladder: distance from the richest rung with its error bar, and cost, a row a rung.

Chain: result.py -> **chart**.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...plotting import COLOUR, LINEAR_SHADE, new_figure, style

VERDICT_COLOUR = {
    "within": COLOUR["stick"],
    "outside": COLOUR["left"],
    "undecided": COLOUR["approximation"],
    "richest": COLOUR["exact"],
    "failed": COLOUR["mark"],
}
VERDICT_MARK = {"within": "o", "outside": "X", "undecided": "s", "richest": "<"}  # apart in grey too


def plot_ladder(ladder: Any, axes: Any = None) -> Any:
    """Draw a Ladder on two Axes, poorest rung at the bottom; returns them.

    Without `axes` on a new figure, whose rows carry the rungs' names once.
    """
    from matplotlib.ticker import NullFormatter

    if axes is None:
        with style():
            figure = new_figure(7.5, 1.3 + 0.28 * len(ladder.steps))
            axes = figure.subplots(1, 2, width_ratios=(3, 2))
    left, right = axes
    seen = [s.distance for s in ladder.steps if np.isfinite(s.distance) and s.distance > 0]
    seen += [s.bar for s in ladder.steps if np.isfinite(s.bar) and s.bar > 0] + [ladder.tolerance]
    # Three decades below the tolerance nothing is decided any more.
    low = max(min(seen) / 3, ladder.tolerance * 1e-3)
    high = max(max(seen) * 3, ladder.tolerance * 3)
    left.axvspan(low, ladder.tolerance, color=LINEAR_SHADE, alpha=0.35, linewidth=0, zorder=0)
    left.axvline(ladder.tolerance, color=COLOUR["mark"], linestyle="--", linewidth=1)
    for row, step in enumerate(ladder.steps):
        colour = VERDICT_COLOUR[step.verdict]
        if step.verdict == "failed" or not np.isfinite(step.distance):
            left.text(high, row, "failed " if step.failure else "does not occur ", color=colour, ha="right",
                      va="center", fontsize=8)  # fmt: skip
        elif step.verdict == "richest":
            left.plot([low, max(step.bar, low)], [row, row], color=colour, linewidth=1.2)
            left.plot(low, row, VERDICT_MARK["richest"], color=colour, markersize=5, clip_on=False)
        else:
            ends = [max(step.distance - step.bar, low), max(step.distance + step.bar, low)]
            left.plot(ends, [row, row], color=colour, linewidth=1.2)
            mark = "<" if step.distance < low else VERDICT_MARK[step.verdict]
            left.plot(max(step.distance, low), row, mark, color=colour, markersize=5, clip_on=False)
        if step.seconds > 0:
            chosen = step.name == ladder.recommended
            right.plot(
                step.seconds * 1e3,
                row,
                "D" if chosen else VERDICT_MARK.get(step.verdict, "."),
                color=colour,
                markersize=6 if chosen else 5,
            )
    left.text(ladder.tolerance, len(ladder.steps) - 0.55, "tolerance ", ha="right", va="top", fontsize=7,
              color=COLOUR["mark"])  # fmt: skip
    names = [s.name for s in ladder.steps]
    for ax, labels in ((left, names), (right, [""] * len(names))):
        ax.set_yticks(range(len(names)), labels)
        ax.set(xscale="log", ylim=(-0.6, len(names) - 0.4))
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.grid(axis="y", linewidth=0.4, color=LINEAR_SHADE)
    for label in left.get_yticklabels():
        label.set_fontweight("bold" if label.get_text() == ladder.recommended else "normal")
    right.tick_params(axis="y", length=0)
    costs = np.log10([s.seconds * 1e3 for s in ladder.steps if s.seconds > 0] or [1.0])
    unit = f" ({ladder.observable.unit})" if ladder.observable.unit != "1" else ""
    left.set(
        xlim=(low, high), xlabel=f"distance from the richest rung{unit}",
        title=f"{ladder.title}: {ladder.observable.name}",
    )  # fmt: skip
    right.set(
        xlim=(10 ** (np.floor(costs.min()) - 0.1), 10 ** (np.ceil(costs.max()) + 0.1)),
        xlabel="processor time of a run (ms)",
    )
    return np.array([left, right])
