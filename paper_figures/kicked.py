"""The oscillator of figure 8 at eps = beta = 0.001 under kicks: what figures 11 to 13 share.

After every 1/500 of a period y and v each get an independent displacement of size kappa: uniform on
[-kappa, kappa], or normal with standard deviation kappa. Stuck is a state that has come back to |v| <= 2 eps just
before the next kick (the layer's roots lie at |v| <= 0.9 eps); nonlinear sticking is that with |k y - q''| > N. The
friction coefficient has two measures: just before each kick, when the layer has forgotten the one before, and at all
times with |v| <= 2 eps: right after a kick lam has jumped and z has not, so that |mu| goes up to 1 + 3 z.
"""

import functools
import math

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.drawing import period_axis
from pwsmooth import Kicks, solve
from pwsmooth.plotting import COLOUR, sticking_regions

EPS = 1e-3
KICKS = 500  # a period
EVERY = osc.PERIOD / KICKS
LAWS = ("uniform", "normal")
ON = ("y", "v")
LAW_COLOUR = {"uniform": COLOUR["smoothed"], "normal": COLOUR["approximation"]}


@functools.cache
def free_orbit(rho=3.0):
    """One period of the noise-free orbit of the smoothed system, symmetric with two sticks for rho = 3."""
    view = osc.oscillator(beta=EPS, rho=rho).smoothed(eps=EPS)
    return osc.settled(view, {osc.y: 0.78, osc.v: -1.03, osc.z: 0}, periods=30)


def kicked_orbit(orbit, kappa, law, seed, periods, **options):
    """The run from the free orbit's start under kicks."""
    start = dict(zip(orbit.states, orbit.x[:, 0]))
    noise = Kicks(kappa, EVERY, on=ON, law=law, seed=seed)
    return solve(orbit.system, (0, periods * osc.PERIOD), start, noise=noise, **options)


def before_kicks(periods):
    """Times just before every kick."""
    return (np.arange(KICKS * periods) + 0.999) * EVERY


# Shares of the time between kicks, finest where lam and z relax, within some eps = 0.08 of it.
BETWEEN = np.array([1e-3, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 0.999])


def half_periods(orbit, kappa, law, seed, periods):
    """Of every half period of one seed: nonlinear stick time, its longest unbroken part, and the largest |mu| while
    stuck, just before kicks and at all times."""
    instants = ((np.arange(KICKS * periods)[:, None] + BETWEEN) * EVERY).ravel()
    # 1e-6 moves a stick's end by far less than a kick does, and halves the time of the run.
    run = kicked_orbit(orbit, kappa, law, seed, periods, t_eval=instants, rtol=1e-6)
    if not run.success:
        raise RuntimeError(f"The kicked run did not finish: {run.message}")
    inside = (np.abs(run["v"]) <= 2 * EPS).reshape(-1, len(BETWEEN))
    mu = np.where(inside, np.abs(run["mu"]).reshape(inside.shape), 0)
    last = len(BETWEEN) - 1
    held = inside[:, last] & (np.abs(osc_force(instants, run["y"])).reshape(inside.shape)[:, last] > 1)
    rows = held.reshape(2 * periods, KICKS // 2)
    peaks = [m.reshape(2 * periods, -1).max(axis=1) for m in (mu[:, last], mu)]
    return np.column_stack([rows.sum(axis=1) * EVERY, [longest(row) * EVERY for row in rows], *peaks])


def osc_force(times, y):
    """k y - q'' in units of N: what friction has to hold."""
    return 3.1 * y + 2.4 * np.sin(times)


def longest(row):
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


@functools.cache
def statistics(kappa, seeds, periods):
    """Law -> `half_periods` of all seeds, one under the other; and those of the free orbit under None."""
    orbit = free_orbit()
    found = {
        law: np.concatenate([half_periods(orbit, kappa, law, seed, periods) for seed in range(seeds)])
        for law in LAWS
    }
    return found | {None: half_periods(orbit, 0.0, "uniform", 0, 1)}


def effort(fast):
    """(seeds, periods a seed)."""
    return (6, 5) if fast else (60, 20)


SHOWN = 20  # seeds in the pictures: one alone may be a lucky one


def panels(figure, orbit, kappa, found, seed=1):
    """Time series, the layer during one stick, and the nonlinear stick times of all seeds."""
    grid = figure.add_gridspec(2, 2, width_ratios=(1.3, 1), height_ratios=(1.15, 1))
    series, layer = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    spread = figure.add_subplot(grid[:, 1])
    runs = [kicked_orbit(orbit, kappa, "uniform", number, 1) for number in range(seed, seed + SHOWN)]
    _series(series, orbit, runs)
    _layer(layer, orbit, runs)
    _spread(spread, found)
    return runs[0]


def _series(ax, orbit, runs):
    times = np.linspace(0, osc.PERIOD, 4001)
    sticking_regions(ax, times, *osc.sticking_bounds(times))
    for name, colour, dash in (("y", COLOUR["exact"], "-"), ("v", COLOUR["velocity"], "--")):
        for run in runs:
            ax.plot(run.t, run[name], color=COLOUR["smoothed"], linewidth=0.5, alpha=0.6, zorder=1)
        ax.plot(times, orbit(times, name), dash, color=colour, linewidth=1.2, label=f"${name}$, no noise")
    ax.plot([], [], color=COLOUR["smoothed"], label="with noise")
    period_axis(ax)
    ax.set(ylim=(-2.1, 4.2), ylabel=r"$y,\ v$")
    ax.legend(loc="upper center", ncols=2, handlelength=1.6, columnspacing=1.0, borderaxespad=0.1, fontsize=7.5)
    ax.set_title(f"displacement and velocity, {len(runs)} seeds")


def _layer(ax, orbit, runs):
    """v/eps during the stick of the free orbit that begins first, with half its length on either side."""
    times = np.linspace(0, osc.PERIOD, 20001)
    inside = np.flatnonzero(np.abs(orbit(times, "v")) <= 2 * EPS)
    first = inside[0]
    last = inside[np.append(np.diff(inside) > 1, True)][0]
    a, b = times[first], times[last]
    window = (a - 0.35 * (b - a), b + 0.6 * (b - a))
    times = np.linspace(*window, 4001)
    ax.axhspan(-2, 2, color=COLOUR["stick"], alpha=0.15, linewidth=0)
    for run in runs:
        part = (run.t >= window[0]) & (run.t <= window[1])
        ax.plot(run.t[part], run["v"][part] / EPS, color=COLOUR["smoothed"], linewidth=0.5, alpha=0.7)
    ax.plot([], [], color=COLOUR["smoothed"], label="noise")
    ax.plot(times, orbit(times, "v") / EPS, color=COLOUR["exact"], label="no noise")
    ax.set_yscale("symlog", linthresh=2, linscale=1.2)
    ax.set(xlim=window, xlabel=r"$t$  (in units of $1/\omega$)", ylabel=r"$v/\varepsilon$")
    ax.set_yticks(
        [-1000, -100, -10, 0, 10, 100, 1000], ["$-10^3$", "$-10^2$", "$-10$", "0", "10", "$10^2$", "$10^3$"]
    )
    ax.minorticks_off()
    ax.legend(loc="lower right")
    ax.set_title(r"in the layer; shaded: $|v|\leq 2\varepsilon$")


def _spread(ax, found):
    """Share of the half periods whose nonlinear stick is longer than t."""
    free = found[None][:, 0].mean()
    for law in LAWS:
        times = np.sort(found[law][:, 0])
        share = 1 - np.arange(len(times)) / len(times)
        dash = "-" if law == "uniform" else (0, (5, 1.5))
        ax.step(times, share, where="post", color=LAW_COLOUR[law], linestyle=dash, label=f"{law} kicks")
    ax.axvline(free, color=COLOUR["exact"], linewidth=1.0, linestyle=":", label="no noise")
    least = min(found[law][:, 0].min() for law in LAWS)
    ax.set(xlim=(0.9 * least if least > free / 2 else 0, 0.68), ylim=(0, 1.02),
           xlabel=r"time x stuck with $|ky-\ddot q|>N$" "\nin a half period (1/ω)",
           ylabel="P(stick time > x)")  # fmt: skip
    ax.legend(loc="upper right", frameon=True, facecolor="white", edgecolor="none", framealpha=1)
    ax.set_title("nonlinear sticking, all seeds")


def summary(found, column):
    """(text, mean ratio to the free orbit by law) of one of the columns of `half_periods`."""
    free = found[None][:, column].mean()
    ratios, parts = {}, []
    for law in LAWS:
        values = found[law][:, column]
        ratios[law] = values.mean() / free
        error = values.std() / math.sqrt(len(values))
        parts.append(f"{law} {values.mean():.4f} +- {error:.4f} ({100 * ratios[law]:.0f} %)")
    return f"{'; '.join(parts)}; no noise {free:.4f}", ratios
