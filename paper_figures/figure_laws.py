"""Every friction law on the same axes: its hysteresis loops, and its steady curve."""

import numpy as np
import sympy as sp
from matplotlib.lines import Line2D

from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, IDENTITY, closed_form
from pwsmooth.laws import friction
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import force_driven, prescribed_motion, t

NAME = "laws"
TITLE = "Friction laws side by side: loops and steady curves"
CAPTION = """
Each law of the package under the slow position A sin(2 pi t/10 s), A = 5, 14 and 40 um (blue, green, orange; the
last period, force against position) and its steady force at constant velocity (black, inset, -5 to 5 mm/s; none
where the force depends on the position). All are scaled to a Coulomb force of 1 N, a static friction of 1.5 N where
there is one, and a stiffness of 1e5 N/m; the stick-slip elements of Maxwell-slip, GMS and the multistate law are
the reference set's, scaled. The last panel shows what the loops of laws without a spring hide: friction before and
after break-away under a growing force. Modified Dahl, Masing, the multistate law and the acceleration-dependent law
are reconstructed, Bouc-Wen's parameters chosen.
"""
SIZES = ((5e-6, COLOUR["right"]), (1.4e-5, COLOUR["stick"]), (4e-5, COLOUR["approximation"]))
A = sp.Symbol("size", positive=True)
PERIOD = 10
SETTLED = 10  # periods; bristles forget their start by exp(-4 A kappa/F_s) a period, exp(-1.3) at the least
KAPPA = tuple(1e5 / i for i in range(1, 11))  # the elements give way at 1.5 um i
SHARE = (0.1,) * 10
LAWS = {
    "Coulomb": friction.Coulomb(),
    "static and kinetic": friction.StaticKinetic(),
    "Stribeck": friction.StribeckFriction(),
    "hidden static": friction.HiddenStatic(rho=2.31),
    "modified Coulomb": friction.ModifiedCoulomb(v_0=1e-6, v_1=1e-5),
    "Dahl": friction.Dahl(),
    "modified Dahl": friction.ModifiedDahl(slope=5e3),
    "Bouc-Wen": friction.BoucWen(),
    "Bliman-Sorine": friction.BlimanSorine(f_1=3.0, f_2=2.0, epsilon=1.2e-5, eta=0.5),
    "Maxwell-slip": friction.MaxwellSlip(kappa=tuple(2 * k / 3 for k in KAPPA), strength=(0.1,) * 10),
    "Masing": friction.Masing(k=5e3),
    "LuGre": friction.LuGre(),
    "elastoplastic": friction.Elastoplastic(),
    "GMS": friction.GMS(F_s=1.5, v_s=1e-3, kappa=KAPPA, share=SHARE, sigma=0.0, C=50.0, sigma2=0.4),
    "XKY": friction.XKY(),
    "multistate XKY": friction.MultistateXKY(
        F_s=1.5, v_s=1e-3, kappa=KAPPA, share=SHARE, sigma=300.0, sigma2=0.4
    ),
    "acceleration-dependent": friction.Wojewoda(a_1=4.0, a_2=1e-5),
}
# Without a spring: their force depends on velocity and acceleration alone.
RIGID = {
    "Coulomb",
    "static and kinetic",
    "Stribeck",
    "hidden static",
    "modified Coulomb",
    "acceleration-dependent",
}


def loops(law, fast):
    """Size -> (position, force) over the last period, and how far the force was from there a period before (N)."""
    end = SETTLED * PERIOD
    scene = prescribed_motion(
        law, position=A * sp.sin(2 * sp.pi * t / PERIOD), t_span=(0, end), parameters={A: 1e-5}
    )
    found, apart = {}, 0.0
    for size, _ in SIZES:
        run = scene.solve(
            dense_output=True, parameters={A: size}, rtol=1e-7, max_steps=200_000
        )  # for a picture
        if not run.success:
            raise RuntimeError(f"{type(law).__name__}: {run.message}")
        # Both sides of every event, so that jumps are drawn upright.
        edges = np.unique([e.time for e in run.events] or [0.0])
        times = np.concatenate([np.linspace(end - PERIOD, end, 401 if fast else 2001), edges, edges - 1e-9])
        times = np.unique(times[(times >= end - PERIOD) & (times <= end)])
        found[size] = run(times, "position"), run(times, "force")
        between = end - PERIOD * (np.arange(400) + 0.37) / 400  # off the instants at which forces jump
        apart = max(apart, float(np.abs(run(between, "force") - run(between - PERIOD, "force")).max()))
    return found, apart


def claims(curves, apart):
    """What the page is meant to show."""
    loss = {
        name: {size: float(np.trapezoid(f, x)) for size, (x, f) in found.items()}
        for name, found in curves.items()
    }
    dissipate = all(w > -1e-12 for each in loss.values() for w in each.values())
    presliding = {name for name in curves if loss[name][5e-6] < 0.5 * loss["Coulomb"][5e-6]}
    springs = set(LAWS) - RIGID
    X = 4e-5
    dahl = 4 * X - 4e-5 * np.tanh(4)
    return [
        Claim(
            "every loop is closed: the force is what it was a period before",
            "within 1e-4 N",
            f"the least closed is that of {max(apart, key=apart.get)}, open by {max(apart.values()):.1e} N",
            max(apart.values()) < 1e-4,
            "one drifts, or depends on a decision within rounding",
            **EXPECTED,
        ),
        Claim(
            "no law gives energy in a slow cycle",
            "loss >= 0",
            "all losses >= 0",
            dissipate,
            "one gives energy",
            **EXPECTED,
        ),
        Claim(
            "laws with a spring or bristle have a presliding regime: at 5 um less than half of Coulomb's loss",
            "all of them",
            f"{len(springs & presliding)} of {len(springs)}",
            springs <= presliding,
            "not " + ", ".join(sorted(springs - presliding)),
            **EXPECTED,
        ),
        Claim.number(
            "loss of Dahl's loop at 40 um (J, closed form)", dahl, loss["Dahl"][X], 1e-3 * dahl, **closed_form()
        ),
        Claim.number(
            "loss of Coulomb's loop at 40 um, 4 F_c A (J)", 4 * X, loss["Coulomb"][X], 1e-3 * X, **IDENTITY
        ),
    ]


def break_away(ax):
    """Friction under a force that grows by 1 N/s: what slow loops of laws without a spring do not show."""
    looks = {"Coulomb": ("-", "right"), "static and kinetic": ("--", "left"), "hidden static": (":", "exact")}
    times = np.linspace(0, 2.4, 2401)
    for name, (dash, colour) in looks.items():
        run = force_driven(LAWS[name], t, t_span=(0, 2.4)).solve(dense_output=True)
        if not run.success:
            raise RuntimeError(f"{name}: {run.message}")
        ax.plot(times, run(times, "friction"), dash, color=COLOUR[colour], linewidth=1.3, label=name)
    ax.set(xlabel="time (s)", xlim=(0, 2.4), ylim=(-3.6, 2.0), yticks=(0, 1))
    ax.set_title("break-away, force 1 N/s", fontsize=8.5)
    ax.legend(loc="lower right", borderaxespad=0, handlelength=1.2)


def draw(fast):
    """One panel a law."""
    run = {name: loops(law, fast) for name, law in LAWS.items()}
    curves, apart = ({name: pair[i] for name, pair in run.items()} for i in (0, 1))
    figure = new_figure(6.4, 9.2)
    panels = figure.subplots(6, 3)
    speeds = np.linspace(-5e-3, 5e-3, 401)
    for ax, (name, found) in zip(panels.flat, curves.items()):
        for size, colour in SIZES:
            x, force = found[size]
            # Closed: a force that jumps at the loop's first instant jumps upright.
            ax.plot(*(np.append(line, line[0]) for line in (1e6 * x, force)), color=colour, linewidth=1.1)
        ax.set_title(name, fontsize=8.5)
        ax.set(xlim=(-44, 44), ylim=(-3.9, 1.9), xticks=(-40, 0, 40), yticks=(-1, 0, 1))
        try:
            steady = LAWS[name].steady_force(speeds)
        except NotImplementedError:
            continue
        small = ax.inset_axes([0.24, 0.13, 0.70, 0.24])
        small.plot(1e3 * speeds, np.broadcast_to(steady, speeds.shape), color=COLOUR["exact"], linewidth=0.9)
        small.set(ylim=(-1.8, 1.8), xlim=(-5, 5), xticks=[-5, 5], yticks=[-1, 1])
        small.tick_params(labelsize=6, length=2, pad=1)
        small.spines[["top", "right"]].set_visible(True)
    for ax in panels[-1, :2]:
        ax.set_xlabel("position (µm)")
    for ax in panels[:, 0]:
        ax.set_ylabel("force (N)")
    break_away(panels.flat[-1])
    handles = [Line2D([], [], color=colour, label=f"A = {1e6 * size:.0f} µm") for size, colour in SIZES]
    handles.append(
        Line2D([], [], color=COLOUR["exact"], linewidth=0.9, label="inset: steady force (N) over mm/s")
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure, claims(curves, apart)
