"""Figure 5: the three subsystems of the discontinuous oscillator: slip, fast transition, sticking on B."""

import numpy as np
import sympy as sp

from paper_figures import oscillator as osc
from paper_figures.blown_up import SPEED_SCALE, dress, fibre, head, manifold, slip_planes
from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth import System, solve
from pwsmooth.plotting import COLOUR, new_figure

NAME = "5"
TITLE = "Slip, fast transition and sticking of the discontinuous system"
CAPTION = """
The discontinuous oscillator with z at its equilibrium (rho = 3), its switching surface v = 0 opened into lam
in [-1, 1]. Blue and vermilion: right and left slip (trajectories of the solver), with the planes where they
meet the layer; purple, double arrows: fast fibres at constant t and y; green: the manifold B, attracting
between its folds at lam = +-2/3 (full), repelling beyond (pale). Reproduced: branches, folds and the
directions of the fast flow. Everything is dimensionless (m = N = omega = 1).
"""
SPAN, HEIGHTS, REACH = (0.0, np.pi), (-1.7, 1.0), 1.0
# (side, time, displacement, speed) of pieces of slip
ARRIVING = [
    (-1, 0.1, -0.2, 0.9),
    (-1, 1.0, -0.95, 0.9),
    (-1, 2.2, -0.9, 0.9),
    (1, 0.1, 0.3, 0.9),
    (1, 1.1, 0.1, 0.9),
    (1, 2.3, 0.1, 0.9),
]
LEAVING = [(1, 0.4, -1.35, 0.01), (-1, 1.9, 0.45, 0.01)]


def claims():
    """Section 6 on the branches of B, checked on the layer's right-hand side."""
    strength = 3.0
    lam = np.linspace(-1, 1, 200001)
    slope = np.gradient(-lam * (1 + strength * (1 - lam**2)), lam)
    change = lam[1:][np.diff(np.sign(slope)) != 0]
    sides = {side: _sticks_from(side) for side in (-1, 1)}
    return [
        Claim(
            "B attracts over |lam| < min(lam_s, 1) and repels beyond, with turning points at +-lam_s",
            "lam_s = 2/3",
            "turning points at " + ", ".join(f"{x:+.4f}" for x in change),
            bool(len(change) == 2 and np.allclose(np.abs(change), 2 / 3, atol=2e-5)),
            "turning points lie elsewhere",
            **solid_friction("section 6"),
        ),
        Claim(
            "inside the region (19) the fast system collapses to B, outside it switches between lam = +-1",
            "N mu_s",
            f"the solver's runs stick for opposing forces up to {sides[-1]:.6f} N (from v < 0) "
            f"and {sides[1]:.6f} N (from v > 0)",
            max(abs(force - osc.MU_S) for force in sides.values()) < 1e-5,
            "capture stops elsewhere",
            **solid_friction("section 6, (19)"),
        ),
    ]


def _sticks_from(side):
    """Largest opposing force at which a slaved block slipping on `side` is captured, by bisection of runs."""
    force = sp.Symbol("force", real=True)
    block = System(
        {osc.v: force - osc.lam * (1 + 3 * osc.z), osc.z: (osc.GAMMA - osc.z) / osc.beta},
        time=osc.t,
        parameters={force: side * -1.5, osc.beta: 0.1},
    ).layered({osc.z: sp.oo})
    low, high = 1.2, 2.2
    while high - low > 1e-6:
        middle = (low + high) / 2
        # v' = force + side there: the start reaches v = 0 after a time of 1.
        speed = side * (1 + middle)
        run = solve(block, (0, 1.5), {osc.v: speed}, parameters={force: -side * middle})
        if run.segments[-1].status == (0,):
            low = middle
        else:
            high = middle
    return (low + high) / 2


def draw(fast):
    """The blown-up phase space, without a particular orbit."""
    figure = new_figure(5.8, 4.6)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    slip_planes(ax, SPAN, HEIGHTS)
    manifold(ax, SPAN)
    # One that crosses, and two that end on B, from either side or one, at two times.
    for time, shifts in ((0.35, (-0.8, 0.1)), (2.35, (-0.5, 0.1))):
        middle = -2.4 * np.sin(time) / 3.1
        for shift in shifts:
            for start in (-1.0, 1.0):
                drift = osc.root_displacement(time, start) - (middle + shift)
                if drift * start < 0:  # slip on that side arrives here
                    fibre(ax, time, middle + shift, start, linewidth=0.9)
    view = osc.oscillator().layered({osc.z: sp.oo})
    for side, time, y0, speed in ARRIVING + LEAVING:
        _slip(ax, view, side, time, y0, speed)
    dress(
        ax, SPAN, HEIGHTS, REACH, ([np.pi / 4, np.pi / 2, 3 * np.pi / 4], [r"$\pi/4$", r"$\pi/2$", r"$3\pi/4$"])
    )
    ax.text(-0.3, 3.0, 0.3, r"$\mathcal{B}$", color="#00523B", fontsize=15, zorder=9)
    told = (
        r"right, left slip ($\lambda=\pm1$):  $\dot y=v,\ \ \dot v=\ddot q-ky-cv\mp N$"
        "\n"
        r"layer ($v=0$):  $\varepsilon\dot\lambda\propto\ddot q-ky-N\lambda(1+\rho\gamma(\lambda))$,  $\dot y=0$"
    )
    ax.text2D(0.0, 0.99, told, transform=ax.transAxes, fontsize=8, va="top")
    return figure, claims()


def _slip(ax, view, side, time, y0, speed, length=1.0):
    """A piece of slip, until it arrives at v = 0, reaches the largest speed shown, or `length` has passed."""
    run = solve(view, (time, min(time + length, SPAN[1])), {osc.y: y0, osc.v: side * speed}, dense_output=True)
    first = run.segments[0]
    times = np.linspace(first.start, np.nextafter(first.end, first.start), 400)
    v = run(times, "v")
    beyond = np.flatnonzero(np.abs(v) > REACH)
    times = times[: beyond[0]] if beyond.size else times
    y, s = run(times, "y"), side * (1 + SPEED_SCALE * np.abs(run(times, "v")))
    colour = COLOUR["right" if side > 0 else "left"]
    ax.plot(s, times, y, color=colour, linewidth=1.4, zorder=5)
    i = int(0.6 * len(times))
    step = np.array([s[i + 1] - s[i], times[i + 1] - times[i], y[i + 1] - y[i]])
    head(ax, (s[i], times[i], y[i]), step / np.linalg.norm(step), colour)
