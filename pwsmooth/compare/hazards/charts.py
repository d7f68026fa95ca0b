"""Maps of hazards: a band a method, the rows of the map inside it, one colour and one letter a way of failing."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...plotting import new_figure
from .failures import HARMLESS, KINDS

GAP = 0.18  # between two bands, in bands
# For readers who do not tell the colours apart.
LETTER = {"recorded": "r", "inaccurate": "i", "missed event": "m", "wrong itinerary": "w", "creep in stick": "c",
          "drift": "d", "energy growth": "e", "blow-up": "b", "stall": "s", "step collapse": "x"}  # fmt: skip


def plot_map(map_: Any, axes: Any = None, *, small: bool = False) -> Any:
    """Draw a StabilityMap; returns the Axes.

    Every method is a band, the first on top. Inside it the rows of the map go upwards. A cell has the colour of the
    most frequent failure there, paler where some of its runs are right, and every failure of a band has its letter.
    The black line is the border that theory draws. Without `axes` on a figure of its own; `small`, for a page of many,
    has no second axis and fewer words.
    """
    if axes is None:
        figure = new_figure(7.0, 1.3 + 0.55 * len(map_.methods))
        axes = figure.subplots()
        legend(figure, [map_])
    edges = _edges(np.array(map_.x.values))
    n_rows = len(map_.rows)
    names = map_.rows.words or tuple(f"{v:.5g}" for v in map_.rows.values)
    places = []
    for band, method in enumerate(reversed(map_.methods)):
        low = band * (1 + GAP)
        heights = low + np.linspace(0.0, 1.0, n_rows + 1)
        axes.pcolormesh(edges, heights, _colours(map_, method), linewidth=0, rasterized=True)
        _letters(axes, map_, method, heights, edges)
        _border(axes, map_.border[method], heights, edges)
        places.append(low + 0.5)
        if not small and n_rows > 1:
            for row in (0, n_rows - 1):
                axes.annotate(
                    names[row], (1.0, low + (row + 0.5) / n_rows), xycoords=("axes fraction", "data"), va="center",
                    xytext=(3, 0), textcoords="offset points", fontsize=6.5, color="#555555",
                )  # fmt: skip
    axes.set(
        xscale="log" if _is_log(map_.x.values) else "linear",
        xlim=(edges.min(), edges.max()),
        ylim=(-GAP, len(map_.methods) * (1 + GAP)),
    )
    axes.set_yticks(places, list(reversed(map_.methods)))
    axes.tick_params(labelsize=7 if small else 8)
    axes.tick_params(axis="y", length=0)
    axes.set_title(textwrap.fill(map_.title, 36) if small else map_.title, fontsize=8 if small else 9.5)
    if map_.x.words:
        axes.set_xticks(map_.x.values, map_.x.words)
    told = map_.x.name
    if n_rows > 1:
        told += f";  up, {map_.rows.name}: {names[0]} … {names[-1]}"
        told = textwrap.fill(told, 38 if small else 64)
    axes.set_xlabel(told, fontsize=7 if small else 8.5)
    axes.spines[["left", "bottom"]].set_visible(False)
    return axes


def legend(figure: Any, maps: Sequence[Any]) -> None:
    """One entry for every way of failing that occurs in the maps, one for what was not run, and one for the border."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = {kind for found in maps for counts in found.counts.values() for kind in counts}
    handles: list[Any] = [
        Patch(
            facecolor=colour,
            edgecolor="#999999",
            linewidth=0.4,
            label=f"{LETTER[kind]}  {kind}" if kind in LETTER else kind,
        )
        for kind, colour in KINDS.items()
        if kind in seen
    ]
    if any((found.total(method) == 0).any() for found in maps for method in found.methods):
        handles.append(Patch(facecolor="white", edgecolor="#999999", linewidth=0.4, label="not run"))
    if any(np.isfinite(edge).any() for found in maps for edge in found.border.values()):
        handles.append(Line2D([], [], color="black", linewidth=1.4, label="border by theory"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=7.5)


def page(maps: Sequence[Any], columns: int = 2) -> Any:
    """All maps on one page of two columns' width; returns the Figure."""
    rows = -(-len(maps) // columns)
    heights = [
        0.75 + 0.19 * max(len(m.methods) for m in maps[r * columns : (r + 1) * columns]) for r in range(rows)
    ]
    figure = new_figure(3.5 * columns, sum(heights) + 0.5)
    grid = figure.subplots(rows, columns, squeeze=False, gridspec_kw={"height_ratios": heights})
    for axes, found in zip(grid.flat, maps):
        plot_map(found, axes, small=True)
    for axes in grid.flat[len(maps) :]:
        axes.axis("off")
    legend(figure, maps)
    return figure


def _letters(axes: Any, map_: Any, method: str, heights: np.ndarray, edges: np.ndarray) -> None:
    """The letter of each way of failing at that of its cells which is nearest to their middle."""
    from matplotlib.patheffects import withStroke

    failed = map_.failed(method)
    shown = np.where(
        failed,
        np.array(_failures())[_order(map_, method, _failures())],
        np.array(HARMLESS)[_order(map_, method, HARMLESS)],
    )
    for kind, letter in LETTER.items():
        cells = np.argwhere((shown == kind) & (map_.total(method) > 0))
        if len(cells) == 0:
            continue
        size = np.array(failed.shape)
        i, j = cells[np.argmin(np.hypot(*((cells - cells.mean(axis=0)) / size).T))]
        middle = np.sqrt(edges[j] * edges[j + 1]) if _is_log(map_.x.values) else (edges[j] + edges[j + 1]) / 2
        axes.text(
            middle, heights[: -1][i] / 2 + heights[1:][i] / 2, letter, ha="center", va="center", fontsize=6.5,
            path_effects=[withStroke(linewidth=1.6, foreground="white")], zorder=4,
        )  # fmt: skip


def _failures() -> list[str]:
    return [kind for kind in KINDS if kind not in HARMLESS]


def _colours(map_: Any, method: str) -> np.ndarray:
    """RGB of every cell, white where nothing was run."""
    total, failed = map_.total(method), map_.failed(method)
    share = failed / np.maximum(total, 1)
    # A single failure among many still shows: from a third of the full colour on.
    weight = np.where(failed, 0.35 + 0.65 * share, 0.0)[..., None]
    calm = _most_frequent(map_, method, HARMLESS)
    worst = _most_frequent(map_, method, _failures())
    return np.where(total[..., None], (1 - weight) * calm + weight * worst, 1.0)


def _most_frequent(map_: Any, method: str, kinds: Sequence[str]) -> np.ndarray:
    """RGB of the most frequent of these ways of failing in every cell."""
    from matplotlib.colors import to_rgb

    return np.array([to_rgb(KINDS[kind]) for kind in kinds])[_order(map_, method, kinds)]


def _order(map_: Any, method: str, kinds: Sequence[str]) -> np.ndarray:
    """Place among these ways of failing of the most frequent one in every cell."""
    none = np.zeros((len(map_.rows), len(map_.x)), int)
    return np.argmax([map_.counts[method].get(kind, none) for kind in kinds], axis=0)


def _border(axes: Any, border: np.ndarray, heights: np.ndarray, edges: np.ndarray) -> None:
    inside = np.isfinite(border) & (border >= edges.min()) & (border <= edges.max())
    for i in np.flatnonzero(inside):
        axes.plot(
            [border[i], border[i]], heights[i : i + 2], color="black", linewidth=1.2, solid_capstyle="butt"
        )
        if i + 1 < len(border) and inside[i + 1]:
            axes.plot(border[i : i + 2], [heights[i + 1]] * 2, color="black", linewidth=0.8)


def _is_log(values: Sequence[float] | np.ndarray) -> bool:
    """Whether the values are positive, and their steps nearer to equal in the logarithm."""
    v = np.array(values)
    if v.min() <= 0:
        return False
    if len(v) < 3:
        return bool(v.max() / v.min() > 5)
    return bool(np.ptp(np.diff(np.log(v))) < np.ptp(np.diff(v)) / np.abs(v).max() * 3)


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges of the cells around the values, which increase or decrease."""
    if len(values) == 1:
        return values[0] * np.array([0.5, 2.0]) if values[0] > 0 else values[0] + np.array([-0.5, 0.5])
    logarithmic = _is_log(values)
    v = np.log(values) if logarithmic else values
    middle = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate([[2 * v[0] - middle[0]], middle, [2 * v[-1] - middle[-1]]])
    return np.exp(edges) if logarithmic else edges
