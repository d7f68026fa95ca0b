"""Films of a run: the shapes of a sketch, moved frame by frame, with curves below them if wanted.

A sketch is asked for `describe()`, its shapes in words and sizes, and `pose(solution, times)`, where they are; nothing
else of it is known here.

Chain: scenes/sketch.py -> Solution.animate -> **films**, in the style of plotting/__init__.py.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import COLOUR, NONLINEAR_SHADE, phase, style

WRITERS = {".gif": "pillow", ".html": "html", ".mp4": "ffmpeg"}
_WIDTH, _CURVE = 6.4, 1.1  # of a picture, and height of a curve, in inches
_MOVES = Callable[[np.ndarray, str], None]  # places of a shape at a frame, and the colour of its phase


def writer_of(path: Path) -> str:
    """What writes a film to this path; ValueError for another ending, and where ffmpeg is needed and not found."""
    from matplotlib import animation

    kind = WRITERS.get(path.suffix.lower())
    if kind is None:
        raise ValueError(f"`path` is {str(path)!r}; give one that ends in {', '.join(WRITERS)}.")
    if kind == "ffmpeg" and not animation.writers.is_available("ffmpeg"):
        raise ValueError(
            f"`path` is {str(path)!r}, which ffmpeg writes, and none is found; install it, or give a path that ends in "
            ".gif or .html."
        )
    return kind


def film(solution: Any, sketch: Any, times: np.ndarray, fps: int, names: Sequence[str]) -> Any:
    """The matplotlib animation of a solution at these times, a frame each."""
    from matplotlib import animation, pyplot

    shapes, poses = sketch.describe(), sketch.pose(solution, times)
    bounds = sketch.bounds or _around(shapes, poses)
    colours = {
        shape["phase"]: _phases(solution, shape["phase"], times) for shape in shapes if shape.get("phase")
    }
    tall = _WIDTH * (bounds[3] - bounds[2]) / (bounds[1] - bounds[0])
    tall = float(np.clip(tall, 1.0, 4.8))
    with style():
        fig = pyplot.figure(figsize=(_WIDTH, tall + 0.5 + _CURVE * len(names)), layout="constrained")
        above, *below = np.atleast_1d(
            fig.subplots(1 + len(names), 1, gridspec_kw={"height_ratios": [tall, *[_CURVE] * len(names)]})
        )
        above.set(xlim=bounds[:2], ylim=bounds[2:], aspect="equal")
        above.set_axis_off()
        clock = above.set_title("")
        if sketch.note:
            above.text(0.5, 0, sketch.note, transform=above.transAxes, ha="center", va="top", size="small",
                       color=COLOUR["mark"])  # fmt: skip
        unit = max(bounds[1] - bounds[0], bounds[3] - bounds[2])
        moves = [_ARTISTS[shape["kind"]](above, shape, unit, k) for k, shape in enumerate(shapes)]
        cursors = [_curve(ax, solution, name, times) for ax, name in zip(below, names)]
        for ax in below[:-1]:
            ax.tick_params(labelbottom=False)
        if below:
            below[-1].set_xlabel(str(solution.model.time))

    def draw(frame: int) -> list[Any]:
        for shape, move in zip(shapes, moves):
            of = colours.get(shape.get("phase", ""))
            move(poses[shape["name"]][:, frame], of[frame] if of is not None else "")
        for cursor in cursors:
            cursor(frame)
        clock.set_text(f"{solution.model.time} = {times[frame]:.4g}")
        return []

    return animation.FuncAnimation(fig, draw, len(times), interval=1000 / fps, repeat=True)


def write(made: Any, path: Path, fps: int) -> None:
    """Write a film; an older file is replaced as a whole."""
    from matplotlib import animation, pyplot, rc_context

    kind = writer_of(path)
    handle, scratch = tempfile.mkstemp(suffix=path.suffix.lower(), dir=path.parent, prefix=f".{path.stem}-")
    os.close(handle)
    try:
        if kind == "html":
            with rc_context({"animation.embed_limit": 2000}):
                Path(scratch).write_text(made.to_jshtml(fps=fps), encoding="utf-8")
        else:
            made.save(scratch, writer=animation.writers[kind](fps=fps), dpi=100)
        os.chmod(scratch, 0o666 & ~_umask())
        os.replace(scratch, path)
    finally:
        Path(scratch).unlink(missing_ok=True)
        pyplot.close(made._fig)


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now


def _phases(solution: Any, name: str, times: np.ndarray) -> list[str]:
    """Key of COLOUR at each instant, of the switch or contact of this name; none of a system without it."""
    if name not in solution.multipliers:
        return [""] * len(times)
    at, course = solution.course or (solution.t, solution.status)
    status = course[solution.multipliers.index(name)]
    column = np.clip(np.searchsorted(at, times, side="right") - 1, 0, None)
    return [COLOUR[phase(int(np.sign(s)))] for s in status[column]]


def _around(shapes: Sequence[Mapping[str, Any]], poses: Mapping[str, np.ndarray]) -> tuple[float, ...]:
    """Bounds within which all shapes stay."""
    xs, ys = [], []
    for shape in shapes:
        rows = dict(zip(shape["places"], poses[shape["name"]]))
        off_x = shape.get("radius") or max(shape.get("width", 0), shape.get("height", 0)) / 2
        for key, row in rows.items():
            off = off_x if shape["kind"] in ("block", "ball", "joint", "clearance") else 0
            if key[0] in "xy":
                (xs if key[0] == "x" else ys).extend([row.min() - off, row.max() + off])
        if "dx" in rows:
            xs += [(rows["x"] + rows["dx"]).min(), (rows["x"] + rows["dx"]).max()]
            ys += [(rows["y"] + rows["dy"]).min(), (rows["y"] + rows["dy"]).max()]
    edge = 0.04 * max(max(xs) - min(xs), max(ys) - min(ys), 1e-300)
    return min(xs) - edge, max(xs) + edge, min(ys) - 1.5 * edge, max(ys) + edge


def _curve(ax: Any, solution: Any, name: str, times: np.ndarray) -> Callable[[int], None]:
    """A curve against time, and what moves a dot along it."""
    drawn = solution.sample(names=[name])
    inside = (drawn.t >= times[0]) & (drawn.t <= times[-1])
    ax.plot(drawn.t[inside], drawn[name][inside], color=COLOUR["mark"], linewidth=0.9)
    ax.set_ylabel(name)
    ax.margins(x=0)
    values = solution(times, name)
    (dot,) = ax.plot([], [], "o", color=COLOUR["left"], markersize=5, clip_on=False)

    def move(frame: int) -> None:
        dot.set_data(times[frame : frame + 1], values[frame : frame + 1])

    return move


# ---- kinds of shapes: each draws itself, and gives what moves it


def _block(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.patches import Polygon

    w, h = shape["width"] / 2, shape["height"] / 2
    corners = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    patch = ax.add_patch(Polygon(corners, closed=True, facecolor=NONLINEAR_SHADE, edgecolor="black", zorder=k))

    def move(places: np.ndarray, colour: str) -> None:
        x, y, angle = places
        c, s = np.cos(angle), np.sin(angle)
        patch.set_xy(corners @ np.array([[c, s], [-s, c]]) + [x, y])
        _paint(patch, colour)

    return move


def _ball(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.patches import Circle

    r = shape["radius"]
    patch = ax.add_patch(Circle((0, 0), r, facecolor=NONLINEAR_SHADE, edgecolor="black", zorder=k))
    (mark,) = ax.plot([], [], color=COLOUR["mark"], linewidth=1, zorder=k + 0.5)

    def move(places: np.ndarray, colour: str) -> None:
        x, y, angle = places
        patch.center = x, y
        mark.set_data([x, x + r * np.cos(angle)], [y, y + r * np.sin(angle)])
        _paint(patch, colour)

    return move


def _paint(patch: Any, colour: str) -> None:
    if colour:
        patch.set_facecolor((colour, 0.35))
        patch.set_edgecolor(colour)


def _spring(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    (line,) = ax.plot([], [], color=COLOUR["mark"], linewidth=1.2, zorder=k, solid_joinstyle="round")
    along = np.array([0, 0.12, *np.linspace(0.12, 0.88, 17), 1])
    across = np.array([0, 0, *(shape["width"] / 2 * np.tile([0, 1, 0, -1], 5)[:17]), 0])

    def move(places: np.ndarray, colour: str) -> None:
        line.set_data(*_on(places, along, across))

    return move


def _on(places: np.ndarray, along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points at fractions of the way between two places, and so far to its left."""
    x_1, y_1, x_2, y_2 = places[:4]
    way = np.array([x_2 - x_1, y_2 - y_1])
    left = np.array([-way[1], way[0]]) / (np.hypot(*way) or 1.0)
    return x_1 + along * way[0] + across * left[0], y_1 + along * way[1] + across * left[1]


def _bar(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.patches import Polygon

    patch = ax.add_patch(Polygon(np.zeros((4, 2)), facecolor="#C9CED6", edgecolor=COLOUR["mark"], zorder=k))
    half = shape["width"] / 2

    def move(places: np.ndarray, colour: str) -> None:
        patch.set_xy(np.column_stack(_on(places, np.array([0, 1, 1, 0]), half * np.array([1, 1, -1, -1]))))

    return move


def _ground(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.collections import LineCollection

    strokes = ax.add_collection(LineCollection([], colors=COLOUR["mark"], linewidths=0.7, zorder=k))
    (line,) = ax.plot([], [], color=COLOUR["mark"], linewidth=1.4, zorder=k)

    def move(places: np.ndarray, colour: str) -> None:
        length = np.hypot(places[2] - places[0], places[3] - places[1])
        at = np.linspace(0, 1, max(3, int(length / (0.025 * unit))))
        high = np.column_stack(_on(places, at, 0 * at))
        low = np.column_stack(_on(places, at - 0.015 * unit / (length or 1.0), -0.022 * unit + 0 * at))
        strokes.set_segments(np.stack([high, low], axis=1)[1:])
        line.set_data(places[[0, 2]], places[[1, 3]])

    return move


def _belt(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    (loop,) = ax.plot([], [], color="black", linewidth=1.6, zorder=k)
    (marks,) = ax.plot([], [], "|", color="black", markersize=5, zorder=k)
    rollers = [ax.plot([], [], color=COLOUR["mark"], linewidth=1, zorder=k)[0] for _ in range(2)]
    turn = np.linspace(0, np.pi, 24)

    def move(places: np.ndarray, colour: str) -> None:
        length, travel = np.hypot(places[2] - places[0], places[3] - places[1]), places[4]
        r = 0.03 * unit
        side = -1 if places[2] > places[0] else 1  # the belt hangs below its upper side
        ends = np.array([1 + r / length * np.sin(turn), -r / length * np.sin(turn)])
        drop = side * r * np.array([1 - np.cos(turn), 1 + np.cos(turn)])
        along, across = np.append(ends.ravel(), 1), np.append(drop.ravel(), 0)
        loop.set_data(*_on(places, np.insert(along, 0, 0), np.insert(across, 0, 0)))
        at = (np.arange(0, length, shape["mark"]) + travel) % length / length
        marks.set_data(*_on(places, at, side * 0.006 * unit + 0 * at))
        whole = np.linspace(0, 2 * np.pi, 40)
        for roller, end in zip(rollers, (0.0, 1.0)):
            circle = end + 0.7 * r / length * np.cos(whole), side * r * (1 + 0.7 * np.sin(whole))
            roller.set_data(*_on(places, *circle))

    return move


def _joint(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.patches import Circle

    patch = ax.add_patch(
        Circle((0, 0), shape["radius"], facecolor="white", edgecolor="black", linewidth=1.1, zorder=k)
    )

    def move(places: np.ndarray, colour: str) -> None:
        patch.center = tuple(places)

    return move


def _arrow(ax: Any, shape: Mapping[str, Any], unit: float, k: int) -> _MOVES:
    from matplotlib.patches import FancyArrowPatch

    patch = FancyArrowPatch((0, 0), (1, 1), arrowstyle="-|>", mutation_scale=11, color=COLOUR["fast"], linewidth=1.6,
                            shrinkA=0, shrinkB=0, zorder=k)  # fmt: skip
    ax.add_patch(patch)

    def move(places: np.ndarray, colour: str) -> None:
        x, y, dx, dy = places
        patch.set_positions((x, y), (x + dx, y + dy))
        patch.set_visible(bool(np.hypot(dx, dy) > 0.01 * unit))

    return move


_ARTISTS: dict[str, Callable[..., _MOVES]] = {
    "arrow": _arrow, "ball": _ball, "bar": _bar, "belt": _belt, "block": _block, "clearance": _joint,
    "ground": _ground, "joint": _joint, "spring": _spring,
}  # fmt: skip
