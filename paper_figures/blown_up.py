"""The blown-up picture of figures 5 and 6: slip on either side, and between them lam in [-1, 1] on v = 0.

The horizontal coordinate is s = lam on v = 0, and beyond lam = +-1 it goes on with v: the layer, a plane of
(t, y, v), opens into a strip that joins the two regions of slip.
"""

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.drawing import pieces, plain_box
from pwsmooth.plotting import COLOUR, phase

SPEED_SCALE = 0.55  # of v in s: the slip regions are shown narrower than the layer


def unfolded(status, v, multiplier):
    """The coordinate s."""
    return multiplier if status == 0 else status * (1 + SPEED_SCALE * np.abs(v))


def manifold(ax, span, strength=3.0, fold=2 / 3):
    """B: attracting sheet full, repelling sheets pale, folds as lines."""
    times = np.linspace(*span, 81)
    for low, high, alpha in ((-1, -fold, 0.22), (fold, 1, 0.22), (-fold, fold, 0.55)):
        multiplier = np.linspace(low, high, 25)
        T, L = np.meshgrid(times, multiplier)
        surface = osc.root_displacement(T, L, strength)
        ax.plot_surface(
            L,
            T,
            surface,
            color=COLOUR["stick"],
            alpha=alpha,
            linewidth=0,
            shade=False,
            rcount=25,
            ccount=81,
            zorder=2,
        )
    for edge in (-fold, fold):
        rim = osc.root_displacement(times, edge, strength)
        ax.plot(np.full_like(times, edge), times, rim, color=COLOUR["stick"], linewidth=1.4, zorder=3)
    return ax


def fold_shadows(ax, span, floor, fold=2 / 3):
    """The folds of B on the floor of the picture."""
    for edge in (-fold, fold):
        ax.plot([edge] * 2, span, [floor] * 2, ":", color=COLOUR["mark"], linewidth=0.9, zorder=1)
    return ax


def slip_planes(ax, span, heights):
    """The planes v = 0- and v = 0+ where slip meets the layer."""
    corners = np.array([[span[0], span[1]], [span[0], span[1]]], dtype=float)
    rise = np.array([[heights[0]] * 2, [heights[1]] * 2], dtype=float)
    for side in (-1, 1):
        ax.plot_surface(
            np.full((2, 2), float(side)),
            corners,
            rise,
            color=COLOUR[phase(side)],
            alpha=0.10,
            linewidth=0,
            zorder=1,
        )
        outline = np.array([0, 1, 1, 0, 0]), np.array([0, 0, 1, 1, 0])
        ax.plot(
            np.full(5, float(side)),
            np.asarray(span)[outline[0]],
            np.asarray(heights)[outline[1]],
            color=COLOUR[phase(side)],
            linewidth=0.7,
            zorder=1,
        )
    return ax


def fibre(ax, time, displacement, start, strength=3.0, **line):
    """A fast fibre at constant (t, y) from lam = start to where the layer ends; returns that lam."""
    multiplier = np.linspace(-1, 1, 20001)
    drift = osc.root_displacement(time, multiplier, strength) - displacement
    direction = np.sign(np.interp(start, multiplier, drift)) or 1.0
    ahead = multiplier[(multiplier - start) * direction > 0]
    against = ahead[np.interp(ahead, multiplier, drift) * direction <= 0]
    end = direction if not against.size else (against.min() if direction > 0 else against.max())
    arrow_line(ax, (start, time, displacement), (end, time, displacement), at=0.5, **line)
    if abs(end) < 1:
        ax.plot([end], [time], [displacement], "o", markersize=2.5, color=COLOUR["fast"], zorder=5)
    return float(end)


def arrow_line(ax, start, end, *, colour=COLOUR["fast"], double=True, at=0.6, zorder=4, linewidth=1.1):
    """A straight line with a head; a double head marks the fast time scale."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    ax.plot(*np.stack([start, end], axis=1), color=colour, linewidth=linewidth, zorder=zorder)
    length = np.linalg.norm(end - start)
    if length < 0.15:
        return ax
    for shift in (0.0, 0.09) if double else (0.0,):
        head(ax, start + (at - shift / length) * (end - start), (end - start) / length, colour, zorder)
    return ax


def head(ax, tip, direction, colour, zorder=5, size=0.075):
    """An arrow head in space: strokes in the horizontal plane and in the vertical one."""
    tip, direction = np.asarray(tip, float), np.asarray(direction, float)
    for across in (np.array([0, 1.6, 0]), np.array([0, 0, 0.5])):
        # Perpendicular enough at these aspect ratios; a true cone would need the projection.
        wings = [tip - size * direction + sign * size * across * 0.8 for sign in (1, -1)]
        ax.plot(*np.stack([wings[0], tip, wings[1]], axis=1), color=colour, linewidth=1.1, zorder=zorder)
    return ax


def orbit_in_layer(ax, orbit, window, reach, *, floor=None, linewidth=2.2, zorder=6):
    """Slip up to the speed `reach`, fast transitions and sticking of a slaved orbit inside a window of time.

    With a `floor` its shadow there tells the depth of the picture.
    """
    last = None
    for segment, times in pieces(orbit, 1200):
        inside = (times >= window[0]) & (times <= window[1]) & (np.abs(orbit(times, "v")) <= reach)
        if not inside.any():
            continue
        times = times[inside]
        y, v, multiplier = orbit(times, "y"), orbit(times, "v"), orbit(times, "lam")
        s = unfolded(segment.status[0], v, multiplier)
        if last is not None:
            arrow_line(ax, last, (s[0], times[0], y[0]), zorder=zorder, linewidth=linewidth * 0.8)
        if floor is not None:
            seen = (s, times) if last is None else (np.append(last[0], s), np.append(last[1], times))
            ax.plot(*seen, np.full(len(seen[0]), floor), color="#BBBBBB", linewidth=1.6, zorder=1)
        wide = linewidth * (1.5 if segment.status[0] == 0 else 1)
        ax.plot(s, times, y, color=COLOUR[phase(segment.status[0])], linewidth=wide, zorder=zorder)
        last = s[-1], times[-1], y[-1]
    return ax


def dress(ax, span, heights, reach, time_ticks):
    """Axes, ticks, names of the regions and view; `reach` is the largest speed shown."""
    edge = 1 + SPEED_SCALE * reach
    ax.set(xlim=(-edge, edge), ylim=span, zlim=heights)
    ax.set_xticks(
        [-edge, -1, 0, 1, edge],
        [rf"$v=-{reach:g}$", r"$\lambda=-1$", "0", r"$\lambda=1$", rf"$v={reach:g}$"],
    )
    ax.tick_params(axis="x", pad=-1)
    ax.set_yticks(*time_ticks)
    ax.set_ylabel(r"$t$", labelpad=1)
    ax.set_zlabel(r"$y$", labelpad=4)
    ax.set_xlabel(r"layer on $v=0$", labelpad=3)
    plain_box(ax)
    ax.view_init(elev=24, azim=-66)
    ax.set_box_aspect((1.75, 1.25, 1.0), zoom=1.04)
    above = heights[1] + 0.04 * (heights[1] - heights[0])
    ax.text(-1.05, span[0], above, "left slip", color=COLOUR["left"], ha="right", fontsize=9, zorder=9)
    ax.text(1.05, span[1], above, "right slip", color=COLOUR["right"], ha="left", fontsize=9, zorder=9)
    return ax
