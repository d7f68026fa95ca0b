"""Pictures of diagrams and bifurcation sets: one colour and one mark for every kind of bifurcation, in all of them.

Chain: plotting/__init__.py -> **drawing** -> result.py, sets.py.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..plotting import COLOUR, LINEAR_SHADE
from .searching import IN_A_SET, NOWHERE

#: Mark and colour of a kind; others take the rest in the order in which they come.
_KINDS = {
    "fold": ("s", COLOUR["left"]),
    "flip": ("D", COLOUR["right"]),
    "symmetry breaking": ("^", COLOUR["stick"]),
    "torus": ("o", COLOUR["fast"]),
    "branch point": ("P", COLOUR["velocity"]),
    "Hopf": ("o", COLOUR["smoothed"]),
    "grazing impact": ("v", COLOUR["approximation"]),
    "grazing": ("v", COLOUR["approximation"]),
    "grazing-sliding": ("v", COLOUR["approximation"]),
    "crossing-sliding": ("X", COLOUR["velocity"]),
    "switching-sliding": ("<", COLOUR["smoothed"]),
    "adding-sliding": (">", COLOUR["CVODE"]),
    "exit by a fold": ("*", COLOUR["fast"]),
}
_REST = ("h", "p", "d", "H", "8", "1", "2", "3", "4")
_COLOURS = ("mark", "numbalsoda", "CVODE", "velocity", "smoothed")
LINE = {"stable": "-", "unstable": (0, (4, 2)), "virtual": ":"}


def marks(kinds: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Mark and colour of each kind."""
    rest = zip(itertools.cycle(_REST), itertools.cycle(_COLOURS))
    return {
        kind: _KINDS[kind] if kind in _KINDS else (mark, COLOUR[colour])
        for kind, (mark, colour) in (
            (k, ("", "mark") if k in _KINDS else next(rest)) for k in dict.fromkeys(kinds)
        )
    }


def draw_diagram(diagram: Any, k: int, ax: Any) -> None:
    """Branches, the orbit diagram behind them, special points, and where no attractor is known."""
    low, high = diagram.range
    for number, (a, b) in enumerate(diagram.gaps):
        label = "no attractor known" if not number else None
        ax.axvspan(a, b, color=LINEAR_SHADE, alpha=0.35, linewidth=0, zorder=0, label=label)
    if diagram.ends is not None:
        fates = {"orbit diagram": "smoothed", "in a set of orbits": "stick", "on no branch": "approximation"}
        codes = diagram.explained.clip(max=0)
        for (label, colour), code in zip(fates.items(), (0, IN_A_SET, NOWHERE)):
            q, y = _ends(diagram, k, codes == code)
            if q.size:
                ax.plot(
                    q, y, ".", color=COLOUR[colour], markersize=3, label=label, rasterized=True, zorder=2.5,
                    markeredgewidth=0,
                )  # fmt: skip
    drawn: set[str] = set()
    for branch in diagram.branches:
        for piece, style in branch.pieces():
            for name in ("points", "mirrored"):
                rows = branch.arrays.get(name)
                for turn in range(branch.count) if rows is not None else ():
                    label = style if style not in drawn else None
                    drawn.add(style)
                    ax.plot(
                        branch.values[piece], rows[piece, turn, k], linestyle=LINE[style], color=COLOUR["exact"],
                        linewidth=1.2 if style == "stable" else 0.9, label=label, zorder=2,
                    )  # fmt: skip
    found = diagram._located
    for kind, (mark, colour) in marks(b["kind"] for b in found).items():
        at = [(b["parameter"], y) for b in found if b["kind"] == kind for y in _both(b)[:, k]]
        ax.plot(*zip(*at), mark, color=colour, fillstyle="none", markersize=5, label=kind, zorder=3)
    ax.set(xlim=(low, high), xlabel=diagram.parameter, ylabel=_what(diagram, k))


def _both(b: dict[str, Any]) -> np.ndarray:
    """Points of a special point's orbit and of its mirror image."""
    return np.concatenate([np.asarray(b[key]) for key in ("points", "mirrored") if b[key] is not None])


def _what(diagram: Any, k: int) -> str:
    return diagram.states[k] + (f", once a {diagram.strobed_by}" if diagram.strobed_by else "")


def _ends(diagram: Any, k: int, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    ends = diagram.ends
    points = ends.points[which][:, :, k]
    q = np.broadcast_to(ends.values[:, None], which.shape)[which]
    return np.repeat(q, points.shape[1]), points.ravel()


def draw_set(found: Any, ax: Any) -> None:
    """Curves in the plane, solid where they are admissible, and their points of codimension 2."""
    shown = marks(curve.kind for curve in found.curves)
    labelled: set[str] = set()
    for curve in found.curves:
        colour = shown[curve.kind][1]
        label = curve.kind if curve.kind not in labelled else None
        labelled.add(curve.kind)
        known = np.where(curve.admissible, curve.values, np.nan)
        ax.plot(*known, "-", color=colour, label=label, zorder=2)
        if not curve.admissible.all():
            ax.plot(
                *curve.values,
                ":",
                color=colour,
                zorder=1,
                label="virtual" if "virtual" not in labelled else None,
            )
            labelled.add("virtual")
    specials = found.specials
    for kind, mark in zip(dict.fromkeys(one.kind for one in specials), itertools.cycle("osD^vP*X<>hp")):
        at = [tuple(one.values.values()) for one in specials if one.kind == kind]
        ax.plot(*zip(*at), mark, color=COLOUR["mark"], fillstyle="none", markersize=5, label=kind, zorder=3)
    (p, q), ranges = found.parameters, found.ranges
    ax.set(xlim=ranges[0], ylim=ranges[1], xlabel=p, ylabel=q)
