"""The one style of every chart: a colour per meaning, and plot functions that take and return Axes.

Nothing here solves or chooses parameters; figures, experiments and `Solution.plot` draw with these.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..door import checks
from ..door.documenting import complete

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "COLOUR",
    "by_phase",
    "direction_arrows",
    "new_figure",
    "phase",
    "plot_layer",
    "plot_phase",
    "plot_solution",
    "sticking_regions",
    "style",
]

#: One colour a meaning, the same in every chart (Okabe and Ito's palette, distinct for colour-blind readers).
COLOUR = {
    "right": "#0072B2",  # slip right, lam = +1
    "left": "#D55E00",  # slip left, lam = -1
    "stick": "#009E73",  # sticking, sliding
    "fast": "#CC79A7",  # fast transition through the layer
    "exact": "#000000",  # event-driven, or a closed form
    "smoothed": "#56B4E9",
    "approximation": "#E69F00",  # an asymptotic form
    "velocity": "#7A5195",
    "mark": "#555555",
    "with events": "#0072B2",  # rivals that are told of the events
    "no events": "#D55E00",  # rivals that are not
    "time stepping": "#009E73",
    "SciPy": "#0072B2",
    "heyoka": "#CC79A7",
    "CVODE": "#8C564B",
    "numbalsoda": "#A09000",
    "diffrax": "#7A5195",
    "nosnoc": "#E69F00",
    "solve_nivp": "#D55E00",
}
_POINTS, _A_STEP = 6000, 16  # of a curve, and of each step, which a reader may look at closely
LINEAR_SHADE, NONLINEAR_SHADE = "#BDBDBD", "#E6E6E6"

_RC: Any = {
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.5,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.4,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "figure.dpi": 100,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
    # One font for text and mathematics, and the same one on every machine.
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
}


@complete
@contextlib.contextmanager
def style() -> Iterator[None]:
    """The project's matplotlib settings, for as long as the block lasts.

    Yields
    ------
    None
        It is a context manager.

    Source: Okabe and Ito for the colours.

    >>> with plotting.style():
    ...     plt.rcParams["font.size"]
    9.0
    """
    from matplotlib import rcParams

    # Not rc_context: it would take back the interactive mode of a backend that is loaded within, as in a notebook.
    before = {key: rcParams[key] for key in _RC}
    rcParams.update(_RC)
    try:
        yield
    finally:
        rcParams.update(before)


@checks.door()
def new_figure(width: float = 7.0, height: float = 3.0) -> Figure:
    """An empty figure that needs no display and lays itself out.

    Parameters
    ----------
    width, height : float, in units of inches
        Its size.

    Returns
    -------
    Figure
        Of matplotlib.

    >>> plotting.new_figure(6.0, 2.0).get_size_inches().tolist()
    [6.0, 2.0]
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


@checks.door()
def phase(status: int) -> str:
    """Key of `COLOUR` for the status of a switch.

    Parameters
    ----------
    status : int
        -1, 0 or 1.

    Returns
    -------
    str
        "left", "stick" or "right".

    >>> plotting.phase(0)
    'stick'
    """
    return {1: "right", -1: "left", 0: "stick"}[int(status)]


@checks.door()
def sticking_regions(
    ax: Axes,
    t: np.ndarray,
    linear: tuple[np.ndarray, np.ndarray],
    nonlinear: tuple[np.ndarray, np.ndarray],
    *,
    label: bool = True,
) -> Axes:
    """Shade the displacements at which the contact can stick, linear region dark on the nonlinear one light.

    Parameters
    ----------
    ax : Axes
        Displacement over time.
    t : ndarray, shape (nt,)
        Times, in the unit of the axis.
    linear, nonlinear : (ndarray, ndarray), shapes (nt,)
        Lower and upper bounds of the regions, in the unit of the axis.
    label : bool
        Whether they stand in the legend.

    Source: Jeffrey, On the mathematical basis of solid friction, figure 8.

    >>> ax = plotting.new_figure().subplots()
    >>> t = np.linspace(0, 6, 50)
    >>> narrow, wide = (np.sin(t) - 1, np.sin(t) + 1), (np.sin(t) - 16 / 9, np.sin(t) + 16 / 9)
    >>> len(plotting.sticking_regions(ax, t, narrow, wide).collections)
    2
    """
    names = ("nonlinear sticking", "linear sticking") if label else (None, None)
    for (low, high), shade, name in zip((nonlinear, linear), (NONLINEAR_SHADE, LINEAR_SHADE), names):
        ax.fill_between(t, low, high, color=shade, linewidth=0, label=name, zorder=0)
    return ax


@checks.door()
def by_phase(ax: Any, status: np.ndarray, *coordinates: np.ndarray, **line: Any) -> Any:
    """Draw one curve in the colours of its phases, sticking thicker than slip, which grey print shows too.

    Parameters
    ----------
    ax : Axes
        With two or three dimensions.
    status : ndarray of int8, shape (nt,)
        Of the switch at the points; dimensionless.
    *coordinates : ndarray, shape (nt,)
        Two or three, in the units of the axes.
    **line
        For matplotlib's `plot`.

    Returns
    -------
    Axes
        Where it was drawn.

    >>> x, v = sp.symbols("x v", real=True)
    >>> solution = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0})
    >>> ax = plotting.by_phase(plotting.new_figure().subplots(), solution.status[0], solution["x"], solution["v"])
    >>> len(ax.lines) == len(solution.segments)
    True
    """
    status = np.asarray(status)
    # Each piece keeps the first point of the next one, so that the curve stays connected.
    changes = (np.flatnonzero(np.diff(status)) + 1).tolist()
    for first, end in zip([0, *changes], [*changes, len(status)]):
        (drawn,) = ax.plot(
            *(c[first : end + 1] for c in coordinates), color=COLOUR[phase(status[first])], **line
        )
        if status[first] == 0:
            drawn.set_linewidth(1.7 * drawn.get_linewidth())
    return ax


@checks.door()
def direction_arrows(
    ax: Axes,
    x: np.ndarray,
    y: np.ndarray,
    at: Sequence[float],
    *,
    colour: str = COLOUR["mark"],
    size: float = 9,
) -> Axes:
    """Arrow heads along a curve.

    Parameters
    ----------
    ax : Axes
        With its limits set.
    x, y : ndarray, shape (n,)
        The curve, in the units of the axes.
    at : sequence of float, any length, dimensionless
        Fractions of the length that the limits show.
    colour : str
        Of the heads.
    size : float, in units of points
        Of the heads.

    >>> ax = plotting.new_figure().subplots()
    >>> angle = np.linspace(0, 6, 100)
    >>> _ = ax.plot(np.cos(angle), np.sin(angle))
    >>> len(plotting.direction_arrows(ax, np.cos(angle), np.sin(angle), at=[0.2, 0.7]).texts)
    2
    """
    (left, right), (bottom, top) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    seen = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    pieces = np.hypot(np.diff(x) / (right - left), np.diff(y) / (top - bottom))
    length = np.concatenate([[0.0], np.cumsum(np.where(seen[1:] & seen[:-1], pieces, 0.0))])
    for fraction in at:
        i = int(np.clip(np.searchsorted(length, fraction * length[-1]), 1, len(x) - 1))
        # A head needs a visible direction: walk back until the points are one hundredth of the axes apart.
        j = i - 1
        while j > 0 and length[i] - length[j] < 0.01:
            j -= 1
        head = dict(arrowstyle="-|>", color=colour, mutation_scale=size, shrinkA=0, shrinkB=0, linewidth=0)
        ax.annotate("", (x[i], y[i]), (x[j], y[j]), arrowprops=head, zorder=5)
    return ax


class _Run(Protocol):
    """What is drawn of a Solution, which itself calls these."""

    t: np.ndarray
    status: np.ndarray
    dense: Any
    course: Any
    tolerances: Any

    @property
    def _shown(self) -> Any: ...
    @property
    def segments(self) -> Any: ...
    @property
    def model(self) -> Any: ...
    def _holds(self, status: Any) -> Any: ...
    def _layer(self, switch: Any, t: float | None) -> Any: ...
    def __getitem__(self, name: Any) -> np.ndarray: ...
    def sample(self, points: int = ..., names: Any = None) -> Any: ...


@checks.door()
def plot_solution(sol: _Run, names: Sequence[Any] | None = None, axes: Any = None) -> np.ndarray:
    """Draw states (or `names`) against time, one Axes each, with the intervals shaded in which a multiplier is solved.

    With dense output the curves are smooth, and with `t_eval` they join its instants. Without either the ends of the
    steps are marked, which are far apart at high order, and a thin broken line joins them.

    Parameters
    ----------
    names : sequence of str or Symbol, optional
        States, multipliers or outputs.
    axes : sequence of Axes, optional
        One for each name; a new figure without.

    Returns
    -------
    ndarray of Axes
        One for each name.

    Raises
    ------
    ValueError
        Another number of Axes than of names.

    >>> x, v = sp.symbols("x v", real=True)
    >>> solution = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)
    >>> len(plotting.plot_solution(solution, ["x", "v"]))
    2
    """
    wanted = list(names) if names is not None else list(sol._shown)
    panels = axes_for(
        axes, len(wanted), (7.0, 0.6 + 1.5 * len(wanted)), f"{len(wanted)} names; give one for each"
    )
    held = [s for s in sol.segments if sol._holds(s.status)]
    t, curves, _ = _drawn(sol, wanted)
    for ax, name, curve in zip(panels, wanted, curves):
        for segment in held:
            ax.axvspan(segment.start, segment.end, color=LINEAR_SHADE, alpha=0.5, linewidth=0, zorder=0)
        ax.plot(t, curve, color=COLOUR["exact"], **_line(sol))
        ax.set_ylabel(str(name))
        ax.margins(x=0)
    _say_what_is_joined(sol, panels[0])
    panels[-1].set_xlabel(str(sol.model.time))
    return panels


@checks.door()
def plot_phase(sol: _Run, names: Sequence[Any], axes: Any = None) -> np.ndarray:
    """Draw two names against each other, in the colours of the first switch or contact that changes.

    What is joined is as in `plot_solution`.

    Parameters
    ----------
    names : (str or Symbol, str or Symbol)
        States, multipliers or outputs, the horizontal one first.
    axes : Axes or sequence of one, optional
        A new figure without.

    Returns
    -------
    ndarray of Axes, shape (1,)
        Where it was drawn.

    Raises
    ------
    ValueError
        Not two names, or not one Axes.

    >>> x, v = sp.symbols("x v", real=True)
    >>> solution = solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)
    >>> (ax,) = plotting.plot_phase(solution, ("x", "v"))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('x', 'v')
    """
    pair = [str(name) for name in names] if not isinstance(names, str) else [names]
    if len(pair) != 2:
        raise ValueError(f"`phase` is {names!r}; give two names, the horizontal one first.")
    panels = axes_for(axes, 1, (4.5, 3.6), "one phase portrait; give one")
    _, curves, statuses = _drawn(sol, pair)
    changing = [status for status in statuses if np.ptp(status)]
    if changing:
        by_phase(panels[0], np.sign(changing[0]), *curves, **_line(sol))
    else:
        panels[0].plot(*curves, color=COLOUR["exact"], **_line(sol))
    _say_what_is_joined(sol, panels[0])
    panels[0].set(xlabel=pair[0], ylabel=pair[1])
    return panels


@checks.door()
def plot_layer(sol: _Run, switch: Any = None, t: float | None = None, ax: Any = None) -> Axes:
    """Draw the field in which a multiplier moves through its layer: what decides whether a solution crosses or stays.

    Attracting roots are full circles, repelling ones are open; an arrow leads from the multiplier before to that after.
    With one state as fast as the layer (`System.layered`) the flow of both is drawn, and where each stands still.

    Parameters
    ----------
    switch : Switch, Symbol or str, optional
        The first that meets its surface, without.
    t : float, in the unit of the model's time, optional
        The event of the switch nearest to it; the first one without.

    Raises
    ------
    ValueError
        A switch that does not meet its surface, a solution without a column at that instant, a family.

    Notes
    -----
    lambda' = Lambda'(u) g(lambda), g = dh/dt on the surface h = 0, with time and states frozen.

    Source: Jeffrey, On the mathematical basis of solid friction, for the layer system.

    >>> x, v = sp.symbols("x v", real=True)
    >>> lam = Switch("lam", v)
    >>> static = System({x: v, v: -x - lam * (1 + 3 * (1 - lam**2))})
    >>> solution = solve(static, (0, 10), {x: 3.5, v: 0})
    >>> plotting.plot_layer(solution, t=10).get_title()
    'layer of lam at t = 3.14159'
    """
    layer = sol._layer(switch, t)
    (ax,) = axes_for(ax, 1, (4.5, 3.2), "one layer; give one")
    if layer.z is None:
        ax.axhline(0, color=COLOUR["mark"], linewidth=0.8)
        ax.plot(layer.lam, layer.g, color=COLOUR["exact"])
        for i in np.flatnonzero(np.diff(np.sign(layer.g))):
            a, b = layer.g[i : i + 2]
            root = layer.lam[i] - a * (layer.lam[i + 1] - layer.lam[i]) / (b - a)
            fill = "full" if b < a else "none"
            ax.plot(root, 0, "o", color=COLOUR["stick"], fillstyle=fill, clip_on=False)
        if layer.after != layer.before:
            arrow = dict(arrowstyle="-|>", color=COLOUR["fast"], linewidth=1.6, shrinkA=0, shrinkB=0)
            ax.annotate("", (layer.after, 0), (layer.before, 0), arrowprops=arrow, zorder=4)
        ax.set_ylabel("dh/dt")
    else:
        ax.streamplot(
            layer.lam, layer.z, layer.dlam, layer.dz, color=COLOUR["fast"], linewidth=0.7, arrowsize=0.8
        )
        for speed, colour in ((layer.dlam, "stick"), (layer.dz, "approximation")):
            if np.ptp(np.sign(speed)):
                ax.contour(layer.lam, layer.z, speed, [0], colors=COLOUR[colour])
        ax.set_ylabel(layer.state)
    ax.set(xlabel=layer.switch, xlim=(-1, 1), title=f"layer of {layer.switch} at t = {layer.time:.6g}")
    return ax


def areas(
    axes: Mapping[str, np.ndarray], labels: np.ndarray, names: Mapping[int, str], ax: Any, colours: Any
) -> Axes:
    """Labels over the first two axes: -2 white, -1 grey, others in colours; what is there has an entry for a legend."""
    from matplotlib.colors import ListedColormap

    new, (ax,) = ax is None, axes_for(ax, 1, (6.5, 4.0), "one picture; give one")
    chosen = colours or [COLOUR[k] for k in ("right", "left", "stick", "fast", "smoothed", "approximation")]
    paint = ["white", LINEAR_SHADE, *(chosen[k % len(chosen)] for k in range(max(1, labels.max() + 1)))]
    (x, at), (y, others) = [*axes.items(), ("", np.array([0.0, 1.0]))][:2]
    shown = labels.reshape(*labels.shape[:2], -1)[:, :, 0] if labels.ndim > 1 else np.stack([labels, labels], 1)
    ax.pcolormesh(
        at, others, shown.T, cmap=ListedColormap(paint), vmin=-2.5, vmax=len(paint) - 2.5, rasterized=True
    )
    for label in np.unique(shown)[::-1]:
        square = dict(color=paint[label + 2], markeredgecolor=COLOUR["mark"], markeredgewidth=0.5)
        ax.plot([], [], "s", label=names[int(label)], **square)
    if new:
        ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
    ax.set(xlabel=x, ylabel=y)
    if labels.ndim == 1:
        ax.set_yticks([])
    return ax


def axes_for(axes: Any, count: int, size: tuple[float, float], purpose: str) -> np.ndarray:
    """So many Axes, one below the other in a new figure of this size where none are given."""
    if axes is None:
        from matplotlib import pyplot

        with style():
            _, axes = pyplot.subplots(count, 1, sharex=True, figsize=size, layout="constrained")
    panels = np.atleast_1d(np.asarray(axes, dtype=object))
    if len(panels) != count:
        raise ValueError(f"`axes` holds {len(panels)} Axes for {purpose}.")
    return panels


def _drawn(sol: _Run, names: Sequence[Any]) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Times, values and statuses (m, nt): with dense output of points between steps, else of the columns."""
    if sol.dense is None or len(sol.t) < 2:
        return sol.t, [sol[name] for name in names], sol.status
    drawn = sol.sample(max(_POINTS, _A_STEP * len(sol.t)), names)
    return drawn.t, list(drawn.values.T), drawn.status[None]


def _ends_of_steps(sol: _Run) -> bool:
    """Whether nothing is known between columns far apart; the steps of a diffusion, without tolerances, are short."""
    return sol.dense is None and sol.course is None and "rtol" in sol.tolerances


def _line(sol: _Run) -> dict[str, Any]:
    return {"linestyle": "--", "linewidth": 0.5, "marker": ".", "markersize": 5} if _ends_of_steps(sol) else {}


def _say_what_is_joined(sol: _Run, ax: Axes) -> None:
    if _ends_of_steps(sol):
        said = "at steps only: solve with dense_output=True or t_eval"
        ax.set_title(said, loc="right", size="small", color=COLOUR["mark"])
