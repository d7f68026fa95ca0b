"""Drawing shared by several figures: characteristics in the colours of their phases, the panels of 8 and 10."""

import numpy as np

from paper_figures import oscillator as osc
from pwsmooth.plotting import (
    COLOUR,
    LINEAR_SHADE,
    NONLINEAR_SHADE,
    by_phase,
    direction_arrows,
    phase,
    sticking_regions,
)


def pieces(orbit, count=2000):
    """(segment, times) of every segment of an event-driven orbit, both ends on the segment's own side."""
    found = []
    for segment in orbit.segments:
        # Closer at both ends, where z relaxes.
        times = segment.start + segment.duration * (1 - np.cos(np.linspace(0, np.pi, count))) / 2
        times[-1] = np.nextafter(segment.end, segment.start)
        found.append((segment, times))
    return found


def event_driven_characteristic(ax, orbit, offset=0.0, label=True, **line):
    """mu against v - offset*y, slip and stick in their colours, fast transitions between them dashed."""
    seen = set()
    names = {"right": "slip right", "left": "slip left", "stick": "stick"}
    last = None
    for segment, times in pieces(orbit):
        speed, mu = orbit(times, "v") - offset * orbit(times, "y"), orbit(times, "mu")
        colour = phase(segment.status[0])
        # Wide and below: where phases lie on one another all are seen.
        style = line | (dict(linewidth=3.6, zorder=line.get("zorder", 3) - 0.5) if colour == "stick" else {})
        ax.plot(
            speed,
            mu,
            color=COLOUR[colour],
            label=names[colour] if label and colour not in seen else None,
            **style,
        )
        seen.add(colour)
        if last is not None:
            name = "fast transition" if label and "fast" not in seen else None
            style = dict(line, linestyle=(0, (3, 1.5)), linewidth=1.3)
            ax.plot([last[0], speed[0]], [last[1], mu[0]], color=COLOUR["fast"], label=name, **style)
            seen.add("fast")
        last = speed[-1], mu[-1]
    return ax


def smoothed_status(orbit_v, eps):
    """Phase of a smoothed orbit: stick where |v| <= eps, the width of the layer."""
    return np.where(np.abs(orbit_v) <= eps, 0, np.sign(orbit_v)).astype(int)


def layer_visits(orbit, eps, count=200001):
    """(start, duration) of every stay in |v| <= eps over one period, which is taken as cyclic."""
    times = np.linspace(0, osc.PERIOD, count)[:-1]
    inside = np.abs(orbit(times, "v")) <= eps
    if inside.all() or not inside.any():
        return [(0.0, osc.PERIOD * inside[0])]
    # Begin outside, so that no stay is cut in two.
    shift = int(np.flatnonzero(~inside)[0])
    change = np.flatnonzero(np.diff(np.roll(inside, -shift).astype(int)))
    step = times[1]
    edges = [*change, *([len(inside) - 1] if len(change) % 2 else [])]
    return [((a + 1 + shift) * step % osc.PERIOD, (b - a) * step) for a, b in zip(edges[::2], edges[1::2])]


def smoothed_characteristic(ax, orbit, eps, offset):
    """mu against v - offset*y of a smoothed orbit."""
    times = np.linspace(orbit.t[0], orbit.t[-1], 20001)
    v, y, mu = orbit(times, "v"), orbit(times, "y"), orbit(times, "mu")
    by_phase(ax, smoothed_status(v, eps), v - offset * y, mu, linewidth=1.3)
    direction_arrows(ax, v - offset * y, mu, np.arange(0.07, 1, 0.14))
    ax.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=0)
    return ax


def three_panels(figure, orbit, eps, *, nonlinear_label="nonlinear sticking"):
    """Layout of figures 8 and 10: characteristic, trajectory in (t, y, v), and y, v against t."""
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.1))
    top, bottom = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    space = figure.add_subplot(grid[:, 1], projection="3d", computed_zorder=False)
    smoothed_characteristic(top, orbit, eps, eps)
    top.set(xlabel=r"$\bar v=v-\varepsilon y$", ylabel=r"$\mu$")
    phase_legend(top, loc="lower right", handlelength=1.4)
    top.set_title("friction characteristic")

    times = np.linspace(0, osc.PERIOD, 4001)
    y, v = orbit(times, "y"), orbit(times, "v")
    linear, nonlinear = osc.sticking_bounds(times)
    sticking_regions(bottom, times, linear, nonlinear, label=False)
    for name, shade in ((nonlinear_label, NONLINEAR_SHADE), ("linear sticking", LINEAR_SHADE)):
        bottom.fill_between([], [], [], color=shade, label=name)
    bottom.plot(times, y, color=COLOUR["exact"], label=r"$y$")
    bottom.plot(times, v, color=COLOUR["velocity"], linestyle="--", label=r"$v$")
    bottom.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=1)
    period_axis(bottom)
    low, high = min(y.min(), v.min(), nonlinear[0].min()), max(y.max(), v.max(), nonlinear[1].max())
    bottom.set(ylim=(low - 0.15, high + 1.9), ylabel=r"$y,\ v$")
    bottom.legend(
        loc="upper center", ncols=2, handlelength=1.2, columnspacing=1.0, borderaxespad=0.1, fontsize=7.5
    )
    bottom.set_title("displacement and velocity")

    trajectory_space(space, times, y, v, smoothed_status(v, eps), linear, nonlinear)
    return top, bottom, space


def phase_legend(ax, **options):
    """Colours and widths of a smoothed orbit's phases."""
    for name, label in (("right", "slip right"), ("left", "slip left"), ("stick", r"$|v|\leq\varepsilon$")):
        ax.plot([], [], color=COLOUR[name], linewidth=2.2 if name == "stick" else 1.3, label=label)
    return ax.legend(**options)


def period_axis(ax):
    """Time over one period in multiples of pi/2, with its unit."""
    ax.set_xlim(0, osc.PERIOD)
    ax.set_xticks(np.pi / 2 * np.arange(5), ["0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$"])
    ax.set_xlabel(r"$t$  (in units of $1/\omega$)")
    return ax


def strip(ax, times, low, high, height, **style):
    """The region low <= y <= high at one height, as a surface of a 3-D Axes."""
    edge = np.linspace(0, 1, 2)[:, None]
    return ax.plot_surface(
        np.broadcast_to(times, (2, len(times))),
        low + edge * (high - low),
        np.full((2, len(times)), height),
        **style,
    )


def trajectory_space(ax, times, y, v, status, linear, nonlinear):
    """An orbit in (t, y, v) over the sticking regions in the plane v = 0."""
    sparse = slice(None, None, 40)
    for (low, high), shade in ((nonlinear, NONLINEAR_SHADE), (linear, LINEAR_SHADE)):
        strip(
            ax, times[sparse], low[sparse], high[sparse], 0.0, color=shade, alpha=0.85, linewidth=0, shade=False
        )
    by_phase(ax, status, times, y, v, linewidth=2.0)
    ax.set(xlabel=r"$t$", ylabel=r"$y$", zlabel=r"$v$", xlim=(0, osc.PERIOD))
    ax.set_xticks(np.pi * np.arange(3), ["0", r"$\pi$", r"$2\pi$"])
    ax.set_yticks([-1, 0, 1])
    plain_box(ax)
    ax.view_init(elev=30, azim=-60)
    ax.set_box_aspect((1.35, 1, 1.25), zoom=0.86)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.labelpad = 4 if axis is ax.xaxis else 0
    return ax


def plain_box(ax):
    """White panes and thin grid lines for a 3-D Axes."""
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1, 1, 1, 0))
        axis._axinfo["grid"].update(color="#E5E5E5", linewidth=0.5)
    return ax
