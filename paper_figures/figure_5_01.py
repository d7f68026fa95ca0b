"""Figure 5.1 of the thesis: force-indentation curves of contact models, from the equations."""

import numpy as np
import sympy as sp

from paper_figures.claims import Claim
from paper_figures.contact import COLOUR, contact_curves
from paper_figures.sources import EXPECTED, IDENTITY, friction_thesis
from pwsmooth.laws.contact import HuntCrossley, KelvinVoigt, LinearResidual, ResidualIndentation
from pwsmooth.plotting import direction_arrows, new_figure
from pwsmooth.scenes import free_impact, pressed_block, t

NAME = "5.1"
TITLE = "Force-indentation curves of contact laws"
CAPTION = """
Force over indentation in one contact of a unit mass (K = 1000, speed 1 m/s at touch-down, SI units). (a) The source
sketches measured data here; in place of them stands the law R1 (beta = 0.02 s, gamma = 30/s, exponent 1.5), a
reconstruction of the nonlinear law with residual indentation whose text was not available. (b) Kelvin-Voigt (5.1),
b1 = 0.02 s. (c) Hunt-Crossley (5.2), b2 = 1 s/m, exponent 1.5: solid with nothing else acting, dashed pulled off from
t = 0.08 s on by a force that grows by 3000 N/s. (d) The linear law (5.3), beta1 = 0.02 s, gamma = 500/s. The
parameters are ours; the source's drawing has no scales. Dots: touch-down and loss of contact.
"""


MIDDLE = (0.2, 0.4, 0.6, 0.8)


def curves():
    """Panel -> (indentation, force)."""
    free = {
        "a": ResidualIndentation(K=1000, beta=0.02, gamma=30),
        "b": KelvinVoigt(K=1000, b=0.02),
        "c": HuntCrossley(K=1000, b=1.0),
        "d": LinearResidual(K=1000, beta=0.02, gamma=500),
    }
    found = {panel: contact_curves(free_impact(law), names=("p", "force"))[1:] for panel, law in free.items()}
    fast = ResidualIndentation(K=1000, beta=0.02, gamma=500)
    found["fast"] = contact_curves(free_impact(fast), names=("p", "force"))[1:]
    pulled = pressed_block(free["c"], -3000 * sp.Max(0, t - 0.08), t_span=(0, 0.4))
    found["pulled"] = contact_curves(pulled, names=("p", "force"), x0={"p": 0.0, "v": 1.0})[1:]
    return found


def exponents(p, force):
    """d ln F/d ln p while loading, at MIDDLE of the largest indentation."""
    loading = slice(1, int(p.argmax()))
    slope = np.gradient(np.log(force[loading]), np.log(p[loading]))
    return [float(np.interp(share * p.max(), p[loading], slope)) for share in MIDDLE]


def claims(found):
    """What the caption and section 5.1 say of the curves."""
    first = {panel: force[0] for panel, (_, force) in found.items()}
    low = {panel: force.min() for panel, (_, force) in found.items()}
    left = {panel: p[-1] for panel, (p, _) in found.items()}
    deepest = {panel: p.max() for panel, (p, _) in found.items()}
    slopes, fast = (exponents(*found[panel]) for panel in ("a", "fast"))
    return [
        Claim(
            "(b) Kelvin-Voigt: discontinuous force at touch-down",
            "jumps",
            f"F(0+) = {first['b']:.4g} N = K b1 v0",
            bool(abs(first["b"] - 20) < 1e-6),
            "the jump differs from K b1 v0 = 20 N",
            **IDENTITY,
        ),
        Claim(
            "(b) and a sticky force before release",
            "sticky",
            f"min F = {low['b']:.4g} N",
            bool(low["b"] < -1),
            "none",
            **friction_thesis("section 5.1, (5.1)"),
        ),
        Claim(
            "(c) Hunt-Crossley: continuous, and force and indentation vanish together",
            "zero indentation",
            f"F(0) = {first['c']:.2g} N; p = {left['c']:.1e} m at the end",
            bool(first["c"] == 0 and abs(left["c"]) < 1e-9),
            "it does not",
            **friction_thesis("chapter 5 and figure 5.1 (c)"),
        ),
        Claim(
            "(c) with an external pull a sticky force appears",
            "sticky (dashed)",
            f"free: min F = {low['c']:.2g} N; pulled: {low['pulled']:.3g} N",
            bool(low["c"] >= 0 and low["pulled"] < -0.02 * found["c"][1].max()),
            "it does not",
            **friction_thesis("figure 5.1 (c)"),
        ),
        Claim(
            "(d) the linear law: continuous, never sticky, non-zero indentation when the force is lost",
            "non-zero indentation",
            f"F(0) = {first['d']:.2g}, min F = {low['d']:.1g} N, p* = {left['d']:.5f} m",
            bool(first["d"] == 0 and low["d"] > -1e-9 and left["d"] > 1e-3),
            "it differs",
            **friction_thesis("section 5.1, (5.4)"),
        ),
        Claim(
            "(a) typical data: continuous, Hertz-like, non-zero indentation when the force is lost",
            "features (i) to (iii)",
            f"R1: F(0) = {first['a']:.2g}; while loading d ln F/d ln p is {', '.join(f'{x:.2f}' for x in slopes)} at "
            f"{', '.join(f'{x:g}' for x in MIDDLE)} of the largest p; p* = {left['a']:.5f} m = "
            f"{left['a'] / deepest['a']:.2f} of it",
            bool(first["a"] == 0 and left["a"] > 1e-3 and min(slopes) > 1),
            "loading is not convex",
            **friction_thesis("figure 5.1 (a)", origin="reconstruction"),
        ),
        Claim(
            "(a) R1 is Hertz-like only where it is slow: with gamma = 500/s its loading branch is concave",
            "exponents below 1",
            f"{', '.join(f'{x:.2f}' for x in fast)} at the same places",
            max(fast) < 1,
            "it is convex too",
            **EXPECTED,
        ),
    ]


def draw(fast):
    """Four panels."""
    found = curves()
    figure = new_figure(5.8, 4.8)
    titles = {
        "a": "(a) R1, in place of the source's sketch",
        "b": "(b) Kelvin-Voigt (5.1)",
        "c": "(c) Hunt-Crossley (5.2)",
        "d": "(d) linear, residual indentation (5.3)",
    }
    colours = {"a": COLOUR["R1"], "b": COLOUR["Kelvin-Voigt"], "c": COLOUR["Hunt-Crossley"],
               "d": COLOUR["linear residual"]}  # fmt: skip
    for ax, (panel, title) in zip(figure.subplots(2, 2, sharey=True).ravel(), titles.items()):
        p, force = found[panel]
        if panel == "b":
            ax.plot([0, 0], [0, force[0]], color=colours[panel], linewidth=0.9, linestyle=":")
            ax.plot([p[-1], 0], [force[-1], 0], color=colours[panel], linewidth=0.9, linestyle=":")
        label = "no outside force" if panel == "c" else None
        ax.plot(1e3 * p, force, color=colours[panel], label=label)
        ax.plot(1e3 * p[[0, -1]], force[[0, -1]], "o", color=colours[panel], markersize=3.5)
        ax.axhline(0, color="#999999", linewidth=0.6, zorder=0)
        direction_arrows(ax, 1e3 * p, force, (0.3, 0.75), colour=colours[panel])
        if panel == "c":
            p, force = found["pulled"]
            ax.plot(1e3 * p, force, color=colours[panel], linestyle="--", label="pulled off")
            ax.legend(loc="upper left")
        ax.set(xlabel="indentation (mm)", ylabel="force (N)" if panel in "ac" else "")
        ax.set_title(title, fontsize=8.5)
    return figure, claims(found)
