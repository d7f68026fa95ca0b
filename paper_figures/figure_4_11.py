"""Figure 4.11 of Xiong's thesis: transitions of the GMS model and of the multistate law."""

import numpy as np
import sympy as sp

from paper_figures import friction as fr
from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, IDENTITY, closed_form, computed
from pwsmooth.plotting import COLOUR, new_figure

NAME = "4.11"
TITLE = "Leaving and entering presliding: the multistate law is continuous, GMS jumps by sigma_i |v|"
CAPTION = f"""
(a) Velocity v = 10 cos 2 pi t um/s; (b-d) force over velocity of GMS (orange) and of the multistate law (blue) for
three micro-dampings sigma_i; (e-h) force (left axis) and number of elements in presliding (right axis, green) around
the reversal at 0.25 s; grey lines where the number changes. GMS with C = F_c/tau_d. Its elements return to presliding
all at once at v = 0, those of the multistate law one by one before it. {fr.NOTE}
"""
SIGMAS = (0.001, 0.01, 0.03)
WINDOW = (0.2, 0.4)
# tests/reference/presliding.py: largest force of GMS, instants at which the count changes in the window.
RANGE = {0.001: 1.893227, 0.01: 1.949153, 0.03: 2.239645}
GMS_TIMES = (0.25000, 0.31868, 0.34575, 0.36629, 0.38368, 0.39923)
NEW_TIMES = (
    0.21808,
    0.22134,
    0.22471,
    0.22824,
    0.23191,
    0.23568,
    0.23941,
    0.24289,
    0.24592,
    0.24832,
    0.31632,
    0.34055,
    0.35787,
    0.37171,
    0.38339,
    0.39358,
)
TIMES = np.linspace(0.2, 1.2, 40001)


def jumps(solution, kind=""):
    """(instants, size of the force's jump) at the events of a kind after 0.2 s, from the columns on both sides."""
    force, times = solution["force"], solution.t
    at = np.unique([e.time for e in solution.events if e.time > 0.2 and e.switch.startswith(kind)])
    first, last = np.searchsorted(times, at), np.searchsorted(times, at, side="right") - 1
    return at, np.abs(force[last] - force[first])


def claims(gms, new):
    """Numbers of the reconstruction, and what the source says of the figure."""
    found = []
    for sigma in SIGMAS:
        largest = float(np.abs(gms[sigma]["force"][gms[sigma].t > 0.2]).max())
        found.append(
            Claim.number(
                f"largest force of GMS, sigma_i = {sigma} (N; reconstruction)",
                RANGE[sigma],
                largest,
                1e-4 * RANGE[sigma],
                **computed("tests/reference/presliding.py"),
            )
        )
    for sigma in SIGMAS:
        at, size = jumps(gms[sigma], "slip")
        defect = float(np.abs(size - sigma * np.abs(10 * np.cos(2 * np.pi * at))).max())
        found.append(
            Claim(
                f"the force of GMS jumps by sigma_i |v| where an element slips, sigma_i = {sigma}",
                "sigma_i |v|",
                f"up to {size.max():.4f} N; off by at most {defect:.1e} N",
                defect < 1e-6,
                "the jump has another size",
                **closed_form(),
            )
        )
        _, size = jumps(new[sigma])
        found.append(
            Claim(
                f"the force of the multistate law is continuous, sigma_i = {sigma}",
                "no jump",
                f"largest jump {size.max():.1e} N",
                size.max() < 1e-6,
                "it jumps",
                **IDENTITY,
            )
        )
    for name, run, listed in (("GMS", gms[0.01], GMS_TIMES), ("multistate law", new[0.01], NEW_TIMES)):
        times, counts = fr.events_between(run, *WINDOW)
        text = ", ".join(f"{x:.4f}" for x in times)
        close = len(times) == len(listed) and bool(np.all(np.abs(times - listed) < 2e-5))
        found.append(
            Claim(
                f"instants at which the number in presliding changes, {name} (s; reconstruction, 0.02 ms)",
                ", ".join(map(str, listed)),
                text,
                close,
                "they lie elsewhere",
                **computed("tests/reference/presliding.py"),
            )
        )
        back = counts[times <= 0.2501]
        at_once = len(back) == 1
        found.append(
            Claim(
                f"return to presliding at the reversal, {name}",
                "at once" if name == "GMS" else "gradual, before v = 0",
                f"{len(back)} step{'s' * (len(back) > 1)}, done at {times[times <= 0.2501].max():.4f} s",
                at_once == (name == "GMS"),
                "it is not so",
                **EXPECTED,
            )
        )
    return found


def draw(fast):
    """Eight panels, as the source's."""
    velocity = 10 * sp.cos(2 * sp.pi * fr.t)
    scenes = [fr.rig(law, velocity=velocity, t_span=(0, 1.2)) for law in (fr.GMS(), fr.MultistateXKY())]
    gms, new = ({s: fr.run(scene, sigma=s) for s in SIGMAS} for scene in scenes)
    figure = new_figure(6.0, 8.2)
    panels = figure.subplots(4, 2).reshape(2, 4)
    times = np.linspace(0, 1.2, 601)
    panels[0, 0].plot(times, gms[0.01](times, "velocity"), color=COLOUR["mark"])
    panels[0, 0].axvspan(*WINDOW, color="#E6E6E6", linewidth=0)
    panels[0, 0].set(xlabel="time (s)", ylabel="velocity (µm/s)", xlim=(0, 1.2))
    panels[0, 0].set_title("(a) input; shaded: panels e-h")
    for ax, sigma, letter in zip(panels[0, 1:], SIGMAS, "bcd"):
        for runs, colour, name, width in (
            (gms, COLOUR["left"], "GMS", 0.9),
            (new, COLOUR["right"], "multistate", 1.8),
        ):
            ax.plot(
                runs[sigma](TIMES, "velocity"),
                runs[sigma](TIMES, "force"),
                color=colour,
                label=name,
                linewidth=width,
            )
        ax.set(xlabel="velocity (µm/s)", ylabel="force (N)", ylim=(-2.4, 2.4))
        ax.set_title(rf"({letter}) $\sigma_i$ = {sigma} N s/µm")
    panels[0, 1].legend(loc="center", handlelength=1.0)
    cases = [(gms, s, "GMS", COLOUR["left"]) for s in SIGMAS[1:]]
    cases += [(new, s, "multistate law", COLOUR["right"]) for s in SIGMAS[1:]]
    window = np.linspace(*WINDOW, 8001)
    for ax, (runs, sigma, name, colour), letter in zip(panels[1], cases, "efgh"):
        for change in fr.events_between(runs[sigma], *WINDOW)[0]:
            ax.axvline(change, color="#BDBDBD", linewidth=0.6, zorder=0)
        ax.plot(window, runs[sigma](window, "force"), color=colour)
        ax.set(xlabel="time (s)", ylabel="force (N)", ylim=(-2.4, 2.4), xlim=WINDOW)
        ax.set_title(rf"({letter}) {name}, $\sigma_i$ = {sigma} N s/µm")
        count = ax.twinx()
        count.step(window, runs[sigma](window, "presliding"), color=COLOUR["stick"], linewidth=1.0)
        count.set(ylim=(-1, 11), yticks=(0, 5, 10))
        count.tick_params(colors=COLOUR["stick"])
        count.spines["right"].set(visible=True, color=COLOUR["stick"])
        count.set_ylabel("in presliding", color=COLOUR["stick"])
    return figure, claims(gms, new)
