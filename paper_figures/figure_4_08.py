"""Figure 4.8 of Xiong's thesis: the hysteresis loop grows with the amplitude, and loops are nested."""

import numpy as np
import sympy as sp

from paper_figures import friction as fr
from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, computed, friction_thesis
from pwsmooth.plotting import COLOUR, new_figure

NAME = "4.8"
TITLE = "Presliding hysteresis of the multistate law: loops grow with the amplitude and are nested"
CAPTION = f"""
(a) Four positions p = A sin(2 pi 0.25 t) and (b) the forces f of the multistate friction law, sigma_i = 0.01
N s/um, tau_d = 0.02 s; dashed: the quasi-static loop of Maxwell-slip elements of strength lambda_i F_s. Each loop
closes after the first quarter of a cycle (faint). {fr.NOTE}
"""
AMPLITUDES = (0.25, 0.5, 0.75, 1.0)
SHADES = ("#0072B2", "#009E73", "#E69F00", "#D55E00")
# tests/reference/presliding.py (LSODA, tolerance 1e-10), last 4 s: losses at two sigma_i, largest forces.
LOSS = {
    0.001: (0.218583, 1.061668, 2.517729, 4.442235),
    0.01: (0.243374, 1.143173, 2.660931, 4.628571),
}
LARGEST = (1.285319, 1.799489, 1.987708, 1.999916)
TIMES = np.linspace(4, 8, 8001)


def loops(sigma):
    """Amplitude -> solution over 8 s."""
    scene = fr.rig(
        fr.MultistateXKY(sigma=sigma), position=fr.SIZE * sp.sin(sp.pi * fr.t / 2), t_span=(0, 8), size=1.0
    )
    return {A: fr.run(scene, size=A) for A in AMPLITUDES}


def claims(slow, usual):
    """Numbers of the reconstruction, and what the source's figure shows."""
    found = []
    for sigma, runs in ((0.001, slow), (0.01, usual)):
        for A, listed in zip(AMPLITUDES, LOSS[sigma]):
            loss = fr.work(runs[A](TIMES, "force"), runs[A](TIMES, "position"))
            what = f"loss of the loop, A = {A} um, sigma_i = {sigma} N s/um (N um; reconstruction)"
            found.append(
                Claim.number(
                    what, listed, loss, 1e-4 * listed, digits=7, **computed("tests/reference/presliding.py")
                )
            )
    for A, listed in zip(AMPLITUDES, LARGEST):
        largest = float(np.abs(usual[A](TIMES, "force")).max())
        found.append(
            Claim.number(
                f"largest force, A = {A} um (N; reconstruction)",
                listed,
                largest,
                1e-4 * listed,
                **computed("tests/reference/presliding.py"),
            )
        )
    losses = [fr.work(usual[A](TIMES, "force"), usual[A](TIMES, "position")) for A in AMPLITUDES]
    found.append(
        Claim(
            "the loop's area grows with the amplitude",
            "it grows",
            ", ".join(f"{w:.3f}" for w in losses),
            bool(np.all(np.diff(losses) > 0)),
            "it does not",
            **friction_thesis("figure 4.8", origin="reconstruction"),
        )
    )
    out = {f"{a} in {b}": sticks_out(usual[a], usual[b]) for a, b in zip(AMPLITUDES, AMPLITUDES[1:])}
    found.append(
        Claim(
            "each loop lies inside the next one",
            "nested",
            "; ".join(
                f"{pair}: {'out by' if x > 0 else 'inside by'} {abs(x):.4f} N" for pair, x in out.items()
            ),
            max(out.values()) <= 0,
            "the tip of A = 0.75 um sticks out of the largest loop, which passes there at 1 um/s, where the Stribeck "
            "curve is 0.8 % below F_s; all else is nested",
            **EXPECTED,
        )
    )
    closure = max(
        float(np.abs(usual[A](TIMES[:4001], "force") + usual[A](TIMES[4000:], "force")).max())
        for A in AMPLITUDES
    )
    found.append(
        Claim(
            "loops are closed (half a cycle later the force is the opposite one)",
            "closed",
            f"largest difference {closure:.1e} N",
            closure < 1e-3,
            "they drift",
            **friction_thesis("chapter 4, conclusion", origin="reconstruction"),
        )
    )
    return found


def sticks_out(small, large):
    """How far the loop of `small` leaves the area between the branches of `large` (N); negative: not at all."""
    inner_p, inner_f = small(TIMES, "position"), small(TIMES, "force")
    outer_p, outer_f = large(TIMES, "position"), large(TIMES, "force")
    rising = large(TIMES, "velocity") > 0

    def branch(which):
        order = np.argsort(outer_p[which])
        return np.interp(inner_p, outer_p[which][order], outer_f[which][order])

    return float(max((inner_f - branch(rising)).max(), (branch(~rising) - inner_f).max()))


def draw(fast):
    """Positions over time, forces over position."""
    slow, usual = loops(0.001), loops(0.01)
    figure = new_figure(5.8, 3.2)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
    times = np.linspace(0, 8, 801)
    for A, colour in zip(AMPLITUDES, SHADES):
        left.plot(times, usual[A](times, "position"), color=colour, label=f"A = {A} µm")
        right.plot(
            usual[A](times, "position"), usual[A](times, "force"), color=colour, alpha=0.35, linewidth=0.8
        )
        right.plot(usual[A](TIMES, "position"), usual[A](TIMES, "force"), color=colour)
        quasi = masing_loop(A)
        right.plot(
            *quasi,
            color=COLOUR["exact"],
            linewidth=0.7,
            linestyle=(0, (4, 2)),
            label=r"quasi-static, $\sigma_i=0$" if A == 1 else None,
        )
    left.set(xlabel="time (s)", ylabel="position p (µm)", xlim=(0, 8))
    left.set_title("(a) input")
    right.set(xlabel="position p (µm)", ylabel="friction force f (N)", ylim=(-2.3, 2.9))
    right.set_title("(b) force")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    right.legend(loc="upper left")
    return figure, claims(slow, usual)


def masing_loop(A):
    """(position, force) of the closed quasi-static loop, by Masing's rule from the virgin curve."""
    kappa, strength = 2.5 / np.arange(1, 11), 0.2

    def virgin(x):
        return np.minimum(np.multiply.outer(x, kappa), strength).sum(axis=-1)

    x = np.linspace(0, 2 * A, 201)
    down = virgin(np.array(A)) - 2 * virgin(x / 2)
    return np.concatenate([A - x, x - A]), np.concatenate([down, -down])
