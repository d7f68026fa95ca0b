"""E7: to which orbits does a drive of frequency omega and amplitude sigma lead, with and without static friction?

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N lam (1 + rho z),   k = 3.1, c = 0.1, N = 1

rho = 0 (Coulomb) and rho = 3 slaved (z = 1 - lam^2, static friction 16/9), event-driven, every point of a grid from one
start, by one sweep each, and of a coarser grid from three more. An orbit is named by its itinerary over one period of
the motion: S stick, R and L slip; mirror images (R for L) share a name. Where starts lead to different orbits, the
basins of four drives over the plane of starts (pwsmooth.basins: attractors by Newton's method, with multipliers).

Expected: nothing moves for ever below sigma = N, as friction takes N per unit of travel and the drive gives at
most sigma; the static friction of rho = 3 acts at rest only, so that this bound stays, but away from the resonance
sqrt(k) = 1.76 rest now reaches up to sigma = N mu_s = 16/9. Near rest the last slips shrink as 1/n (the excess e of
the force over N moves the contact by e^2 a period): a creep that never repeats. Above: two sticks a period (S R S L);
near and above the resonance slip only (R L); at low frequency ever more sticks a half period, as the spring
unloads in jerks. Static friction takes room from R L and makes room for orbits that break the symmetry. Between N and
N mu_s it leaves two futures to rho = 3, rest and motion; without it (N = N mu_s) there is one. An orbit that breaks the
symmetry has a mirror image, so that there are two of them with basins of their own. What has not settled after 150
periods is slow, or of a long period, and not chaotic: led on for 3000 periods it repeats.

Changed after the run: several futures were expected at more than half of the drives between N and N mu_s. Four starts
find them at fewer; the claim now says that there are such drives, and how many, no more.

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

from pwsmooth import Strobe, basins, sweep
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.studies import Itinerary, Period, Work

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
    others: tuple[tuple[float, float], ...] = ((0.0, 0.0), (1.5, 0.0), (-0.3, -1.9))  # starts (y, v)
    coarser: int = 2  # every so many-th frequency and amplitude, for these
    led_on: int = 3000  # periods
    drives: tuple[tuple[float, float], ...] = (
        (1.5, 0.8),
        (1.6, 1.8),
        (4.0, 0.93),
        (3.35, 0.3),
    )  # (sigma, omega)
    starts: int = 61  # by as many, of each basin


def mirrored(word: str) -> str:
    """The name that an orbit shares with its mirror image: the one with R first."""
    letters = word.split()
    if not letters or not set(letters) <= set("SRL"):
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


SYSTEMS = {"rho = 0": coulomb(), "rho = 3, slaved": hidden().layered({z: sp.oo})}


def named(system, config, start, transient, periods, longest, **where):
    """(dataset of the sweep, words, the keys of NAMED that its points have)."""
    found = sweep(
        system, x0=dict(zip("yv", start)), seen=Strobe(2 * sp.pi / omega), transient=transient, periods=periods,
        measures=[Itinerary(), Period(max_count=longest, tol=config.tol), "points(y)", "sticks"],
        work=Work(progress=False),
        **where,
    )  # fmt: skip
    words = np.vectorize(mirrored)(found.itinerary.values.astype(object))
    kinds = np.vectorize(kind)(words, found.period.values).astype(object)
    moved = np.diff(found.y_points.values, axis=-1)
    one_sided = (moved >= -config.tol).all(axis=-1) | (moved <= config.tol).all(axis=-1)
    mostly_stuck = found.stick_time.values > 0.6 * 2 * np.pi / found.omega.values
    creeps = one_sided & mostly_stuck & (np.abs(moved.sum(axis=-1)) < config.creep)
    # One-sided slips move the contact: what seems to repeat creeps by less than the tolerance.
    kinds[creeps & (kinds == "aperiodic") | (words == "S R")] = "creep"
    return found, words, kinds


def run(config: Config) -> dict:
    maps = {}
    axes = {"sigma": np.linspace(*config.sigmas), "omega": np.linspace(*config.omegas)}
    few = {name: values[:: config.coarser] for name, values in axes.items()}
    for name, system in SYSTEMS.items():
        look = (config.transient, config.periods, 6)
        found, words, kinds = named(system, config, config.start, *look, axes=axes)
        others = [named(system, config, start, *look, axes=few)[2] for start in config.others]
        failed = found.outcome.values < 0
        maps[name] = {
            "kinds": letters(kinds),
            "others": [letters(other) for other in others],
            "words": Counter(words.ravel().tolist()).most_common(24),
            "failed": int(failed.sum()),
            "highest rest": float(found.sigma.values[(kinds == "S").any(axis=1)].max()),
            "lowest motion": float(found.sigma.values[~np.isin(kinds, ("S", "creep")).all(axis=1)].min()),
            "periods": Counter(found.period.values.ravel().tolist()),
            "led on": led_on(system, config, axes, kinds),
        }
    few = {name: values.tolist() for name, values in few.items()}
    return {"sigma": axes["sigma"], "omega": axes["omega"], "few": few, "maps": maps,
            "basins": [basin(*drive, config) for drive in config.drives]}  # fmt: skip


def letters(kinds):
    return ["".join(LETTER[k] for k in row) for row in kinds]


def led_on(system, config, axes, kinds):
    """What becomes of those that had not settled: how many come to which kind, or fail."""
    i, j = np.nonzero(kinds == "aperiodic")
    points = {"sigma": axes["sigma"][i], "omega": axes["omega"][j]}
    if not i.size:
        return {"count": 0, "kinds": {}, "failed": 0, "left": []}
    found, _, later = named(system, config, config.start, config.led_on, 64, 32, points=points)
    ended = found.outcome.values < 0
    still = (later == "aperiodic") & ~ended
    left = []
    for k in np.flatnonzero(still):
        values = {name: float(points[name][k]) for name in ("sigma", "omega")}
        start, period = dict(zip("yv", config.start)), 2 * np.pi / values["omega"]
        found = lyapunov_exponents(
            system.with_parameters(values), start, 1000 * period, transient=1000 * period
        )
        left.append({**values, "exponent": float(found.exponents[0]), "error": float(found.errors[0])})
    return {
        "count": int(i.size), "kinds": Counter(later[~ended & ~still].tolist()), "failed": int(ended.sum()),
        "left": left,
    }  # fmt: skip


def basin(strength, frequency, config):
    """Basins at rho = 3, slaved, over starts at t = 0."""
    system = SYSTEMS["rho = 3, slaved"].with_parameters({"sigma": strength, "omega": frequency})
    axes = {"y": np.linspace(-2, 2, config.starts), "v": np.linspace(-3, 3, config.starts)}
    found = basins(system, axes, Strobe(2 * sp.pi / omega), transient=100)
    resting = np.array([reason.startswith("rest:") for reason in found.reasons.ravel()])
    resting = resting.reshape(found.labels.shape)
    orbits = []
    for orbit in found.attractors:
        half = orbit.solution()(orbit.period / 2)
        orbits.append({
            "word": word_of(orbit), "x": orbit.x, "half": half, "multiplier": float(max(abs(orbit.multipliers))),
        })  # fmt: skip
    return {
        "sigma": strength, "omega": frequency, **axes, "labels": np.where(resting, len(orbits), found.labels),
        "orbits": orbits, "shares": found.shares, "rest": float(resting.mean()),
        "other": float(((found.labels < 0) & ~resting).mean()),
    }  # fmt: skip


def word_of(orbit):
    """Its itinerary over a period, from the first stick on: the same letters as in the maps."""
    names = [{0: "S", 1: "R", -1: "L"}[segment.status[0]] for segment in orbit.solution().segments]
    if len(names) > 1 and names[0] == names[-1]:
        names.pop()  # one phase, cut by the start of the period
    first = names.index("S") if "S" in names else names.index("R")
    return " ".join(names[first:] + names[:first])


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
        *more_claims(data),
    ]  # fmt: skip


def unlike(data: dict, name: str) -> np.ndarray:
    """Of the coarser grid: how many kinds of motion the starts lead to; those that creep or have not settled rest."""
    one = data["maps"][name]
    rows = [np.searchsorted(data[key], data["few"][key]) for key in ("sigma", "omega")]
    first = np.array([list(row) for row in one["kinds"]])[np.ix_(*rows)]
    seen = np.array([first, *(np.array([list(row) for row in other]) for other in one["others"])])
    seen[(seen == LETTER["creep"]) | (seen == LETTER["aperiodic"])] = LETTER["S"]
    return np.array([[len(set(seen[:, i, j])) for j in range(seen.shape[2])] for i in range(seen.shape[1])])


def more_claims(data: dict) -> list[Claim]:
    strengths = np.array(data["few"]["sigma"])
    between, above = (strengths > 1) & (strengths < 16 / 9), strengths > 1
    several = {name: unlike(data, name) > 1 for name in data["maps"]}
    two = several["rho = 3, slaved"][between].mean()
    rests = [b for b in data["basins"] if b["sigma"] < 16 / 9]
    mirrored_ = [b for b in data["basins"] if len(b["orbits"]) == 2 and b["orbits"][0]["word"] != b["orbits"][1]["word"]
                 and mirrored(b["orbits"][0]["word"]) == mirrored(b["orbits"][1]["word"])]  # fmt: skip
    off = max(
        (abs(p + q) for b in mirrored_ for p, q in zip(b["orbits"][0]["half"], b["orbits"][1]["x"])),
        default=np.inf,
    )
    led = [one["led on"] for one in data["maps"].values()]
    count, failed, left = (sum(x) for x in zip(*((o["count"], o["failed"], len(o["left"])) for o in led)))
    kinds = Counter()
    for one in led:
        kinds.update(one["kinds"])
    told = ", ".join(
        f"{n} {NAMED[k][0] if k != 'subharmonic' else 'of period 2 to 32'}" for k, n in kinds.items()
    )
    return [
        claim(
            "Between N and N mu_s static friction leaves a drive several futures; without it there is one above N",
            "several kinds of motion at some drives (at first expected: most) at rho = 3, at none at rho = 0",
            f"four starts lead to several kinds at {100 * two:.0f} % of the drives there at rho = 3, and above N at "
            f"{100 * several['rho = 0'][above].mean():.1f} % at rho = 0",
            two > 0 and not several["rho = 0"][above].any(), "no coexistence, or at rho = 0 too",
        ),
        claim(
            "There rest and one orbit that moves share the starts", "rest and one attractor, and nothing else",
            "; ".join(
                f"sigma = {b['sigma']:g}, omega = {b['omega']:g}: rest {100 * b['rest']:.1f} %, "
                + ", ".join(f"{o['word']} {100 * s:.1f} %" for o, s in zip(b["orbits"], b["shares"]))
                for b in rests
            ),
            all(len(b["orbits"]) == 1 and b["rest"] > 0.01 and b["other"] == 0 for b in rests) and len(rests) > 0,
            "others too",
        ),
        claim(
            "An asymmetric orbit and its mirror image attract side by side",
            "equal after half a period with the sign changed",
            "; ".join(
                f"sigma = {b['sigma']:g}, omega = {b['omega']:g}: "
                + ", ".join(
                    f"{o['word']} {100 * s:.1f} % (multiplier {o['multiplier']:.3f})"
                    for o, s in zip(b["orbits"], b["shares"])
                )
                for b in mirrored_
            ) + f"; apart by {off:.1e}",
            len(mirrored_) > 0 and off < 1e-8, "not found",
        ),
        claim(
            "What has not settled after the transient repeats later", "all of it",
            f"of {count}: {told}; {failed} failed"
            + "".join(
                f"; sigma = {x['sigma']:.3f}, omega = {x['omega']:.3f} does not, exponent {x['exponent']:.1e} +- "
                f"{x['error']:.0e}" for one in led for x in one["left"]
            ),
            left == 0 and failed == 0, "the others are slower yet, or of longer periods",
        ),
        claim(
            "No point is lost", "0 failed",
            f"{sum(one['failed'] for one in data['maps'].values())} failed runs",
            not any(one["failed"] for one in data["maps"].values()), "runs failed; their outcomes are recorded",
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
        i, j = np.nonzero(unlike(data, name) > 1)
        ax.plot(
            np.array(data["few"]["omega"])[j],
            np.array(data["few"]["sigma"])[i],
            ".",
            color="black",
            markersize=0.8,
        )
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
    handles.append(
        Line2D([], [], color="black", marker=".", markersize=2, linestyle="", label="other starts elsewhere")
    )
    fig.legend(handles=handles, loc="outside lower center", ncols=3, handlelength=1.2)
    return {"": fig, "basins": draw_basins(data)}


def draw_basins(data):
    """The plane of starts of each drive, in the colours of the maps; of mirror images the second is paler."""
    from matplotlib.colors import ListedColormap, to_rgb
    from matplotlib.patches import Patch

    rows = -(-len(data["basins"]) // 2)
    fig = new_figure(7.4, 3.3 * rows)
    for ax, b in zip(fig.subplots(rows, 2, sharex=True, sharey=True).ravel(), data["basins"]):
        names, colours, used = [], [], set()
        for orbit in b["orbits"]:
            label, colour = NAMED[kind(mirrored(orbit["word"]), 1)]
            rgb = np.array(to_rgb(colour))
            paler = label in used
            used.add(label)
            colours.append(tuple(0.45 * rgb + 0.55) if paler else tuple(rgb))
            names.append(orbit["word"] + (": its mirror image" if paler else ""))
        names, colours = [*names, "at rest", "unsettled"], [*colours, to_rgb(NAMED["S"][1]), (0, 0, 0)]
        labels = np.array(b["labels"])
        labels = np.where(labels < 0, len(b["orbits"]) + 1, labels)
        ax.pcolormesh(b["y"], b["v"], labels.T, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(names) - 0.5,
                      shading="nearest", rasterized=True)  # fmt: skip
        for orbit in b["orbits"]:
            ax.plot(*orbit["x"], "+", color="black", markersize=7)
        shown = [k for k in range(len(names)) if (labels == k).any()]
        told = [Patch(color=colours[k], label=f"{names[k]}, {100 * (labels == k).mean():.1f} %") for k in shown]
        ax.legend(
            handles=told, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=7, handlelength=1
        )
        ax.set_title(f"σ = {b['sigma']:g}, ω = {b['omega']:g}", pad=20)
    for ax in fig.axes[-2:]:
        ax.set_xlabel("start y")
    for ax in fig.axes[::2]:
        ax.set_ylabel("start v")
    return fig


STUDY = Study(
    name="drive_map",
    question="To which orbits does a drive of frequency omega and amplitude sigma lead, with or without stiction?",
    expected="no motion below N, no rest above N mu_s; two sticks, slip only from the resonance on, more sticks at low "
    "frequency; static friction takes room from slip only, breaks the symmetry of some orbits, and leaves several "
    "futures to one drive",
    full=Config(),
    fast=Config(
        omegas=(0.2, 4.0, 39),
        sigmas=(0.5, 6.0, 23),
        transient=80,
        led_on=600,
        coarser=1,
        drives=((1.6, 1.8), (4.0, 0.93)),
        starts=13,
    ),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
