"""Contact figure 4: force-indentation and velocity-indentation curves of the laws with a restitution."""

from paper_figures.claims import Claim
from paper_figures.contact import COLOUR, DASH, contact_curves
from paper_figures.sources import IDENTITY, clearance_joint, closed_form
from pwsmooth.laws.contact import (
    BaiImpact,
    HertzImpact,
    LiuImpact,
    composite_modulus,
    journal_stiffness,
    maximal_indentation,
)
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import free_impact

NAME = "c4"
TITLE = "Impacts of a journal in its bearing, for three restitutions"
CAPTION = """
Force (top) and speed (bottom) over indentation, for c_r = 0.3, 0.5, 0.9: unit mass, 0.3 m/s, steel, clearance 0.5 mm,
R_B = 10 mm, joint length 15 mm. The laws of the source's list, and Flores's: Hertz (elastic, the same in each column),
Hunt-Crossley, Lankarani-Nikravesh and Flores with Hertz's stiffness; Wang-Liu 2015 (reconstructed: Lankarani and
Nikravesh's damping) and Wang-Liu-Ma with Liu's, Bai with its tangent. The source (Wang, Liu, Ma 2016) shows such curves
without radii and length, so only their shape can be compared. Dotted: the speed -c_r v0 that each law aims at.
"""
SPEED, CLEARANCE = 0.3, 5e-4
RESTITUTIONS = (0.3, 0.5, 0.9)


def laws():
    """Name -> law."""
    E = composite_modulus(207e9, 0.3)
    K = journal_stiffness(E, 0.01, 0.01 - CLEARANCE)
    return {
        "Hertz": HertzImpact(K=K, c_r=1.0),
        "Hunt-Crossley": HertzImpact(K=K, eta="hunt-crossley"),
        "Wang-Liu 2015": LiuImpact(E_star=E, clearance=CLEARANCE, eta="lankarani-nikravesh"),
        "Lankarani-Nikravesh": HertzImpact(K=K, eta="lankarani-nikravesh"),
        "Flores": HertzImpact(K=K, eta="flores"),
        "Wang-Liu-Ma": LiuImpact(E_star=E, clearance=CLEARANCE),
        "Bai": BaiImpact(E_star=E, clearance=CLEARANCE),
    }


def curves():
    """(law's name, c_r) -> (p, v, force)."""
    found = {}
    for name, law in laws().items():
        scene = free_impact(law, speed=SPEED, t_span=(0, 2e-3))
        for c_r in RESTITUTIONS:
            found[name, c_r] = contact_curves(
                scene, parameters={"c_r": 1.0 if name == "Hertz" else c_r}, atol=[1e-17, 1e-14, 1e-14]
            )[1:]
    return found


def _stiffness(speed):
    """(indentation, force over its power 3/2) of the new law at rest in the deepest point of an elastic impact."""
    law = LiuImpact(E_star=composite_modulus(207e9, 0.3), clearance=CLEARANCE, c_r=1.0)
    _, p, _, force = contact_curves(free_impact(law, speed=speed, t_span=(0, 4e-3)), atol=[1e-17, 1e-14, 1e-14])
    deepest = p.argmax()
    return p[deepest], force[deepest] / p[deepest] ** 1.5


def _falls(stiff):
    """How K falls between two indentations, over how 1/sqrt(c + delta) does."""
    (p, K), (q, L) = stiff
    return L / K * ((CLEARANCE + q) / (CLEARANCE + p)) ** 0.5


def claims(found):
    """What the source says of the curves, and the closed form of the depth."""
    off = {key: abs(-v[-1] / SPEED / key[1] - 1) for key, (_, v, _) in found.items()}
    K, law = journal_stiffness(composite_modulus(207e9, 0.3), 0.01, 0.01 - CLEARANCE), "Lankarani-Nikravesh"
    depth = maximal_indentation(K, 1.5, 1.0, SPEED, 0.75 * (1 - 0.5**2))
    show = ", ".join(f"{off['Wang-Liu-Ma', c]:.1%} against {off[law, c]:.1%}" for c in RESTITUTIONS)
    listed = ("Hunt-Crossley", "Wang-Liu 2015", law, "Bai")
    nearest = all(off["Wang-Liu-Ma", c] <= off[name, c] + 1e-9 for c in RESTITUTIONS for name in listed)
    shown = "; ".join(
        f"{name} " + ", ".join(f"{off[name, c]:.1%}" for c in RESTITUTIONS) for name in (*listed, "Flores")
    )
    stiff = [_stiffness(v) for v in (0.01, SPEED)]
    hertz = max(abs(-found["Hertz", c][1][-1] / SPEED - 1) for c in RESTITUTIONS)
    return [
        Claim(
            "the new law's restitution is nearer to c_r than Lankarani and Nikravesh's, most of all for small c_r",
            "3.46 % against 45.06 % at c_r = 0.5",
            f"c_r = 0.3, 0.5, 0.9: {show}",
            all(off["Wang-Liu-Ma", c] < off[law, c] for c in RESTITUTIONS)
            and off[law, 0.3] - off["Wang-Liu-Ma", 0.3] > off[law, 0.9] - off["Wang-Liu-Ma", 0.9],
            "it is not",
            **clearance_joint("Tables 1 and 2"),
        ),
        Claim(
            "of the laws in the comparison the new one's restitution is the nearest",
            "the nearest",
            shown,
            nearest,
            "another is nearer",
            **clearance_joint("section 5, figures"),
        ),
        Claim(
            "Hertz's law is purely elastic, without loss of energy",
            "no loss",
            f"the rebound is as fast as the impact within {hertz:.1e}",
            hertz < 1e-6,
            "energy is lost",
            **IDENTITY,
        ),
        Claim(
            "the stiffness K_i depends on the indentation",
            "it does",
            "; ".join(f"{K:.5g} N/m^1.5 at {1e6 * p:.3g} um" for p, K in stiff)
            + f"; as 1/sqrt(c + delta) within {abs(_falls(stiff) - 1):.0e}",
            stiff[1][1] < 0.999 * stiff[0][1] and abs(_falls(stiff) - 1) < 1e-6,
            "it is constant",
            **clearance_joint("section 5"),
        ),
        Claim.number(
            "largest indentation of Lankarani-Nikravesh, c_r = 0.5, against the closed form (um)",
            1e6 * depth,
            1e6 * float(found[law, 0.5][0].max()),
            1e-5 * 1e6 * depth,
            **closed_form(),
        ),
        Claim(
            "damping force is zero at both ends: force and indentation vanish together",
            "closed loops through 0",
            f"largest end force {max(abs(f[[0, -1]]).max() for _, _, f in found.values()):.1e} N",
            max(abs(f[[0, -1]]).max() / f.max() for _, _, f in found.values()) < 1e-6,
            "they do not",
            **IDENTITY,
        ),
    ]


def draw(fast):
    """Three columns."""
    found = curves()
    figure = new_figure(6.0, 4.6)
    axes = figure.subplots(2, 3, sharex="col", sharey="row")
    for column, c_r in zip(axes.T, RESTITUTIONS):
        for name in laws():
            p, v, force = found[name, c_r]
            style = dict(color=COLOUR[name], linestyle=DASH[name], label=name, linewidth=1.3)
            column[0].plot(1e6 * p, 1e-3 * force, **style)
            column[1].plot(1e6 * p, v, **style)
        column[0].set_title(rf"$c_r={c_r:g}$")
        column[1].axhline(-c_r * SPEED, color="#555555", linewidth=0.9, linestyle=":")
        column[1].axhline(0, color="#999999", linewidth=0.6, zorder=0)
        column[1].set_xlabel(r"indentation ($\mu$m)")
    axes[0, 0].set(ylabel="force (kN)", ylim=(0, None))
    axes[1, 0].set_ylabel("speed (m/s)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, handlelength=2.6
    )
    return figure, claims(found)
