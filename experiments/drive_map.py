"""E7: which orbit does a drive of frequency omega and amplitude sigma lead to, with and without static friction?

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N lam (1 + rho z),   k = 3.1, c = 0.1, N = 1

rho = 0 (Coulomb) and rho = 3 slaved (z = 1 - lam^2, static friction 16/9), event-driven, every point of a grid from one
start, by one sweep each. An orbit is named by its itinerary over one period of the motion: S stick, R and L slip;
mirror images (R for L) share a name.

Expected: nothing moves for ever below sigma = N, as friction takes N per unit of travel and the drive gives at
most sigma; the static friction of rho = 3 acts at rest only, so that this bound stays, but away from the resonance
sqrt(k) = 1.76 rest now reaches up to sigma = N mu_s = 16/9. Near rest the last slips shrink as 1/n (the excess e of
the force over N moves the contact by e^2 a period): a creep that never repeats. Above: two sticks a period (S R S L);
near and above the resonance slip only (R L); at low frequency ever more sticks a half period, as the spring
unloads in jerks. Static friction takes room from R L and makes room for orbits that break the symmetry.

Usage: python experiments/drive_map.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import coulomb, hidden, omega, z

from pwsmooth import sweep
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.sweep import Itinerary, Period

NAMED = {
    "S": ("at rest", "#BDBDBD"),
    "creep": ("creeping to rest", "#E3E3E3"),
    "R L": ("R L: slip only", COLOUR["right"]),
    "S R L": ("S R L: one stick, asymmetric", "#F0E442"),
    "S R S L": ("S R S L: two sticks", COLOUR["stick"]),
    "S R S R S L S L": ("S R S R S L S L: four sticks", COLOUR["approximation"]),
    "more": ("six sticks and more, symmetric", COLOUR["left"]),
    "other": ("other of period 1", COLOUR["fast"]),
    "subharmonic": ("period 2 to 6", COLOUR["smoothed"]),
    "aperiodic": ("none found", "#000000"),
}
LETTER = dict(zip(NAMED, "0123456789"))


@dataclass(frozen=True)
class Config:
    """Grid of the drive, start, and how long the transient may take."""

    omegas: tuple[float, float, int] = (0.2, 4.0, 153)
    sigmas: tuple[float, float, int] = (0.525, 5.975, 110)
    start: tuple[float, float] = (0.5, 0.3)
    transient: int = 150
    periods: int = 12
    tol: float = 1e-6
    creep: float = 0.02  # the largest one-sided displacement over the window that counts as creep


def mirrored(word: str) -> str:
    """The name that an orbit shares with its mirror image: the one with R first."""
    letters = word.split()
    if not set(letters) <= set("SRL"):
        return word
    order = {"S": 0, "R": 1, "L": 2}
    turned = []
    for one in (letters, [{"R": "L", "L": "R"}.get(letter, letter) for letter in letters]):
        turned += [one[i:] + one[:i] for i in range(len(one))]
    return " ".join(min(turned, key=lambda w: [order[letter] for letter in w]))


def kind(word: str, period: int) -> str:
    """Key of NAMED."""
    if period != 1:
        return "aperiodic" if period <= 0 else "subharmonic"
    if word in NAMED:
        return word
    letters = word.split()
    half = len(letters) // 2
    swapped = [{"R": "L", "L": "R"}.get(letter, letter) for letter in letters]
    symmetric = len(letters) % 2 == 0 and letters[half:] + letters[:half] == swapped
    return "more" if symmetric and letters.count("S") >= 6 else "other"


def run(config: Config) -> dict:
    maps = {}
    axes = {"sigma": np.linspace(*config.sigmas), "omega": np.linspace(*config.omegas)}
    for name, system in (("rho = 0", coulomb()), ("rho = 3, slaved", hidden().layered({z: sp.oo}))):
        found = sweep(
            system, axes, start=dict(zip("yv", config.start)), period=2 * sp.pi / omega, transient=config.transient,
            periods=config.periods, measures=[Itinerary(), Period(longest=6, tol=config.tol), "points(y)", "sticks"],
        )  # fmt: skip
        words = np.vectorize(mirrored)(found.itinerary.values.astype(object))
        kinds = np.vectorize(kind)(words, found.period.values).astype(object)
        moved = np.diff(found.y_points.values, axis=-1)
        one_sided = (moved >= -config.tol).all(axis=-1) | (moved <= config.tol).all(axis=-1)
        mostly_stuck = found.stick_time.values > 0.6 * 2 * np.pi / found.omega.values
        creeps = one_sided & mostly_stuck & (np.abs(moved.sum(axis=-1)) < config.creep)
        # One-sided slips move the contact: what seems to repeat creeps by less than the tolerance.
        kinds[creeps & (kinds == "aperiodic") | (words == "S R")] = "creep"
        failed = found.outcome.values < 0
        maps[name] = {
            "kinds": ["".join(LETTER[k] for k in row) for row in kinds],
            "words": Counter(words.ravel().tolist()).most_common(24),
            "failed": int(failed.sum()),
            "highest rest": float(found.sigma.values[(kinds == "S").any(axis=1)].max()),
            "lowest motion": float(found.sigma.values[~np.isin(kinds, ("S", "creep")).all(axis=1)].min()),
            "periods": Counter(found.period.values.ravel().tolist()),
        }
    return {"sigma": axes["sigma"], "omega": axes["omega"], "maps": maps}


def shares(one: dict) -> dict[str, float]:
    text = "".join(one["kinds"])
    return {key: text.count(letter) / len(text) for key, letter in LETTER.items()}


def claims(data: dict) -> list[Claim]:
    plain, static = data["maps"]["rho = 0"], data["maps"]["rho = 3, slaved"]
    a, b = shares(plain), shares(static)
    return [
        claim(
            "Nothing moves for ever below sigma = N, at rho = 0 and at rho = 3",
            "N = 1",
            f"the lowest motion is at sigma = {plain['lowest motion']:.3f} and {static['lowest motion']:.3f}",
            min(plain["lowest motion"], static["lowest motion"]) >= 1,
            "motion below the bound of the energy",
        ),
        claim(
            "From this start rest reaches up to N mu_s, and no higher",
            "1 at rho = 0, 16/9 at rho = 3",
            f"the highest rest is at sigma = {plain['highest rest']:.3f} and {static['highest rest']:.3f}",
            plain["highest rest"] <= 1 and 1 < static["highest rest"] <= 16 / 9,
            "rest above the threshold, or none near it",
        ),
        claim(
            "Static friction takes room from slipping without a stick",
            "a smaller share of the map",
            f"{100 * a['R L']:.1f} % of it at rho = 0, {100 * b['R L']:.1f} % at rho = 3",
            b["R L"] < a["R L"],
            "slip only gained room",
        ),
        claim(
            "Static friction makes room for asymmetric orbits",
            "S R L only at rho = 3",
            f"{100 * a['S R L']:.2f} % at rho = 0, {100 * b['S R L']:.2f} % at rho = 3",
            a["S R L"] < b["S R L"],
            "no more of them than without",
        ),
        claim(
            "No point is lost", "0 failed", f"{plain['failed']} and {static['failed']} failed runs",
            plain["failed"] + static["failed"] == 0, "runs failed; their outcomes are recorded",
        ),
    ]  # fmt: skip


def _numbers(ax, omegas, sigmas, image, least=60):
    """The number of a kind in each of its regions but the smallest, for readers who do not tell the colours apart."""
    from matplotlib.patheffects import withStroke
    from scipy.ndimage import label

    for kind in np.unique(image):
        regions, count = label(image == kind)
        for region in range(1, count + 1):
            cells = np.argwhere(regions == region)
            if len(cells) >= least:
                i, j = cells[np.argmin(np.hypot(*(cells - cells.mean(axis=0)).T))]
                ax.text(omegas[j], sigmas[i], str(kind), ha="center", va="center", fontsize=8,
                        path_effects=[withStroke(linewidth=2, foreground="white")])  # fmt: skip


def draw(data: dict):
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    fig = new_figure(7.4, 4.4)
    axes = fig.subplots(1, 2, sharey=True)
    colours = ListedColormap([colour for _, colour in NAMED.values()])
    norm = BoundaryNorm(np.arange(len(NAMED) + 1) - 0.5, len(NAMED))
    omegas, sigmas = np.array(data["omega"]), np.array(data["sigma"])
    seen = set()
    for ax, (name, one), mu in zip(axes, data["maps"].items(), (1.0, 16 / 9)):
        image = np.array([[int(letter) for letter in row] for row in one["kinds"]])
        seen |= set(image.ravel().tolist())
        ax.pcolormesh(omegas, sigmas, image, cmap=colours, norm=norm, shading="nearest", rasterized=True)
        _numbers(ax, omegas, sigmas, image)
        ax.axhline(mu, color="white", linewidth=1.2, linestyle=(0, (4, 2)))
        ax.axvline(np.sqrt(3.1), color="white", linewidth=0.8, linestyle=":")
        ax.set(title=name.replace("rho", "ρ"), xlabel="drive frequency ω", xlim=(omegas[0], omegas[-1]))
    axes[0].set(ylabel="drive amplitude σ", ylim=(sigmas[0], sigmas[-1]))
    handles = [
        Patch(color=c, label=f"{i}  {label}") for i, (label, c) in enumerate(NAMED.values()) if i in seen
    ]
    # White lines in the maps, grey here to be seen on paper.
    handles.append(Line2D([], [], color="#999999", linewidth=1.2, linestyle=(0, (4, 2)), label="σ = N μₛ"))
    handles.append(Line2D([], [], color="#999999", linewidth=0.8, linestyle=":", label="resonance, ω = √k"))
    fig.legend(handles=handles, loc="outside lower center", ncols=3, handlelength=1.2)
    return fig


STUDY = Study(
    name="drive_map",
    question="Which orbit does a drive of frequency omega and amplitude sigma lead to, with or without stiction?",
    expected="no motion below N, no rest above N mu_s; two sticks, slip only from the resonance on, more sticks at low "
    "frequency; static friction takes room from slip only and breaks the symmetry of some orbits",
    full=Config(),
    fast=Config(omegas=(0.2, 4.0, 39), sigmas=(0.5, 6.0, 23), transient=80, periods=12),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
