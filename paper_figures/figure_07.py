"""Figure 7: friction characteristic of the discontinuous oscillator, against v and against v - eps y."""

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.drawing import event_driven_characteristic, pieces
from paper_figures.sources import solid_friction
from pwsmooth.plotting import COLOUR, direction_arrows, new_figure, phase

NAME = "7"
TITLE = "Friction characteristic of the discontinuous system"
CAPTION = """
mu = lam (1 + rho z) along one period of the event-driven solution (rho = 3, beta = 0.01, parameters of figure
8 otherwise; none are printed), (i) against v, (ii) against v - eps y with eps = 0.1 assumed. Grey: the mirror
image, the other orbit of the pair. In (i) the stick (wide), the fast transition (dashed) and the spike lie on one
another at v = 0. Reproduced: the spike where sticking ends, and none where slip reverses.
With beta > 0 sticking ends only at lam = 1, so the spike is higher than the source's mu_s, which is its limit
for slow change. The source's sketch has a spike on either side; the equations give an asymmetric pair of
orbits with one spike each. Everything is dimensionless (m = N = omega = 1).
"""
BETA, EPS = 0.01, 0.1


def claims(orbit):
    """What section 6 says of the figure."""
    (stick,) = osc.sticks(orbit)
    times = dict((id(s), times) for s, times in pieces(orbit, 4001))
    during = orbit(times[id(stick)], "mu")
    slipping = [np.abs(orbit(times[id(s)], "mu")).max() for s in orbit.segments if s.status[0] == -1]
    first, height = during[0], during.max()
    sticks, crossings = len(osc.sticks(orbit)), len(orbit.event_times("crossing"))
    return [
        Claim(
            "the spikes' height is mu_s of (17)",
            "16/9 = 1.77778",
            f"{height:.5f}, reached at lam = {orbit(stick.end - 1e-12, 'lam'):.4f}",
            abs(height - osc.MU_S) < 0.01,
            "at frozen z there is no fold: sticking ends at lam = 1, after z has run away within O(beta)",
            **solid_friction("section 6, figure 7"),
        ),
        Claim(
            "entering stick or reversing slip, mu goes directly between its kinetic values",
            "|mu| <= 1",
            f"arrives at mu = {first:.5f} in sticking; |mu| <= {max(slipping):.6f} in left slip",
            abs(first) <= 1 and max(slipping) < 1.0001,
            "an overshoot is seen",
            **solid_friction("section 6, figure 7"),
        ),
        Claim(
            "the static friction response is hysteretic",
            "spike on leaving, none on entering",
            f"mu leaves at {during[-1]:.5f}, enters at {first:.5f}",
            during[-1] > 1.5 and abs(first) <= 1,
            "no hysteresis is seen",
            **solid_friction("section 6, figure 7"),
        ),
        Claim(
            "the characteristic has peaks at both ends (sketch)",
            "two spikes",
            f"{sticks} stick a period, {crossings} crossing",
            sticks == 2,
            "for eps << beta it sticks once a period and crosses directly once; the mirror image coexists",
            **solid_friction("section 6, figure 7"),
        ),
    ]


def draw(fast):
    """Both panels."""
    orbit = osc.settled(osc.oscillator(beta=BETA), osc.RELAXING_START, periods=20 if fast else 60)
    figure = new_figure(5.6, 3.2)
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, offset in ((left, 0.0), (right, EPS)):
        for _, times in pieces(orbit):
            speed = orbit(times, "v") - offset * orbit(times, "y")
            ax.plot(-speed, -orbit(times, "mu"), color="#BBBBBB", linewidth=0.9, zorder=1)
        event_driven_characteristic(ax, orbit, offset, label=offset == 0, zorder=3)
        ax.set_xlim(-0.35, 0.35)
        for sign in (1, -1):
            ax.axhline(sign * osc.MU_S, color=COLOUR["mark"], linewidth=0.7, linestyle=":", zorder=0)
        ax.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=0)
        for segment, times in pieces(orbit):
            curve = orbit(times, "v") - offset * orbit(times, "y"), orbit(times, "mu")
            direction_arrows(ax, *curve, (0.6,), colour=COLOUR[phase(segment.status[0])])
    left.text(-0.34, osc.MU_S - 0.05, r"$\mu_s=\frac{16}{9}$", va="top")
    left.set(xlabel=r"$v$", ylabel=r"$\mu$", ylim=(-2.15, 2.15))
    left.set_title(r"(i) against $v$")
    right.set_xlabel(rf"$\bar v$,  $\varepsilon={EPS:g}$")
    right.set_title(r"(ii) against $\bar v=v-\varepsilon y$")
    handles = dict(zip(*reversed(left.get_legend_handles_labels())))
    order = ("slip right", "slip left", "stick", "fast transition")
    figure.legend(
        [handles[name] for name in order], order, loc="outside lower center", ncols=4, handlelength=1.8
    )
    return figure, claims(orbit)
