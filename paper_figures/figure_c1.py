"""Contact figure 1: what the parameters of the residual-indentation law do."""

import numpy as np

from paper_figures.claims import Claim
from paper_figures.contact import contact_curves
from paper_figures.sources import EXPECTED
from pwsmooth.laws.contact import ResidualIndentation
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import free_impact

NAME = "c1"
TITLE = "Parameters of the contact law with residual indentation"
CAPTION = """
Force over indentation of the law R1, F = K max(0, p + beta gamma (p - a))^n, in one contact of a unit mass (K = 1000,
speed 1 m/s at touch-down, SI units; the others beta = 0.02 s, gamma = 500/s, n = 1.5). R1 is a reconstruction: of the
source (J. Appl. Mech. 81(2) 021003) only the abstract was available, so this is no reproduction of its figures.
e is the restitution, speed when the force is lost over speed at touch-down; the mark and the length in mm are the
indentation left there, which is not monotone in beta.
"""
BASE = dict(K=1000.0, beta=0.02, gamma=500.0, n=1.5)
SWEEPS = {
    "beta": ((0.005, 0.02, 0.05, 0.1), "damping", r"$\beta=%g$ s"),
    "gamma": ((20.0, 100.0, 500.0, 5000.0), "rate of the internal state", r"$\gamma=%g$ s$^{-1}$"),
    "n": ((1.2, 1.5, 2.0, 2.5), "exponent", r"$n=%g$"),
}


def curves():
    """Parameter -> list of (value, p, force, restitution, time of the largest force)."""
    found = {}
    for name, (values, _, _) in SWEEPS.items():
        found[name] = []
        for value in values:
            scene = free_impact(ResidualIndentation(**(BASE | {name: value})))
            times, p, v, force = contact_curves(scene)
            found[name].append((value, p, force, -v[-1], times[force.argmax()]))
    return found


def _falls(values):
    return bool(np.all(np.diff(values) < 0))


def claims(found):
    """The statements of the specification on the parameters' effects."""
    e = {name: [row[3] for row in rows] for name, rows in found.items()}
    deep = [row[1].max() for row in found["beta"]]
    peak = [row[2].max() for row in found["beta"]]
    late = [row[4] for row in found["n"]]
    show = lambda values: ", ".join(f"{x:.3g}" for x in values)  # noqa: E731
    return [
        Claim(
            "more beta: lower restitution, smaller indentation",
            "falls",
            f"e = {show(e['beta'])}; p_max = {show(deep)} m",
            _falls(e["beta"]) and _falls(deep),
            "it does not",
            **EXPECTED,
        ),
        Claim(
            "more beta: higher peak force",
            "rises",
            f"F_max = {show(peak)} N",
            bool(np.all(np.diff(peak) > 0)),
            "up to beta = 0.05 s the peak falls: of a nearly elastic contact damping takes more from the largest "
            "indentation than it adds to the force",
            **EXPECTED,
        ),
        Claim(
            "less gamma: more elastic; more gamma: towards a limit",
            "e falls, then saturates",
            f"e = {show(e['gamma'])}",
            _falls(e["gamma"]) and e["gamma"][2] - e["gamma"][3] < 0.2 * (e["gamma"][1] - e["gamma"][2]),
            "it does not saturate",
            **EXPECTED,
        ),
        Claim(
            "more exponent: softer, later peak",
            "later",
            f"at {show(late)} s",
            bool(np.all(np.diff(late) > 0)),
            "it is not later",
            **EXPECTED,
        ),
    ]


def draw(fast):
    """A panel for each parameter."""
    found = curves()
    figure = new_figure(6.4, 4.9)
    shades = ("#9ECAE1", "#4292C6", "#08519C", "#08204A")
    for ax, (name, (_, title, label)) in zip(figure.subplots(1, 3), SWEEPS.items()):
        for colour, mark, (value, p, force, e, _) in zip(shades, "os^D", found[name]):
            text = label % value + f":\n$e={e:.2f}$, {1e3 * p[-1]:.0f} mm"
            ax.plot(
                1e3 * p,
                force,
                color=colour,
                label=text,
                marker=mark,
                markevery=[-1],
                markersize=4,
                clip_on=False,
            )
        ax.axhline(0, color="#999999", linewidth=0.6, zorder=0)
        ax.set(title=title, xlabel="indentation (mm)", ylim=(0, None))
        ax.legend(loc="upper center", bbox_to_anchor=(0.45, -0.18), handlelength=1.2)
        if name == "beta":
            ax.set_ylabel("force (N)")
    return figure, claims(found)
