"""E4: the source's propositions 1 to 5 and its jump at a fold, as numerical checks with measured exponents.

Every proposition says that something tends to a limit as eps or beta -> 0. Here each is a sequence of solutions, and
the order is the slope of log(distance) over log(eps or beta) at its small end.

    1  slip:          z to O(beta, eps) of 0 where |v| >> eps             expected: z = Gamma = (eps/v)^2, order 2
    2  static mode:   z to O(beta) of gamma(lam) while sticking           expected: order 1
    3  manifolds:     |g| while sticking is O(eps), away from folds       expected: order 1 (g = v' + c v, v = eps u)
    4  sticking flow: the smoothed state to the sliding one               expected: 1 while it sticks, and 4/5 after
                      leaving by |lam| = 1 with the algebraic sigmoid (a tail 1/u^2 ends the stick)
    5  rest:          survives up to A = N mu_s (k y = 0) as beta -> 0; transversally attracting for |lam| < lam_s
                      expected: excess of A of order beta (a parabolic maximum passes a fold: x' = -a + t^2 + x^2 in
                      units beta); the eigenvalue's sign changes at lam_s = 2/3 + O(eps)
    6  jump:          delayed past the fold by O(eps^(2/3)) where eps/beta is fixed, and in the relaxing regime, where
                      the layer has no fold, by O(beta^(2/3))

Usage: python experiments/propositions.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.optimize import brentq
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Strobe, System, find_orbit, follow, solve
from pwsmooth.analysis.continuation import Steps
from pwsmooth.paths.derivatives.linearised import linearise
from pwsmooth.plotting import COLOUR, new_figure

MU_S, LAM_S = 16 / 9, 2 / 3
# A stick of the slaved orbit (computed apart): y, and a time inside it.
Y, BEGIN, END = -1.17358823, 1.9, 2.6
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
FINE = {"rtol": 1e-9, "atol": 1e-13}


@dataclass(frozen=True)
class Config:
    """log10 ranges of eps and beta, and how many values."""

    log_eps: tuple[float, float, int] = (-2.0, -5.0, 7)
    log_beta: tuple[float, float, int] = (-1.5, -4.5, 7)


def grid(axis):
    return 10 ** np.linspace(*axis)


def force(t):
    """q'' - k y in the stick."""
    return -2.4 * np.sin(t) - 3.1 * Y


def resting(t, eps):
    """The state that sticks at equilibrium: v = eps u with F = lam (1 + 3 (1 - lam^2)), z = gamma."""
    lam = brentq(lambda x: x * (4 - 3 * x * x) - force(t), 0, LAM_S)
    return {"y": Y, "v": eps * lam / np.sqrt(1 - lam**2), "z": 1 - lam**2}


# tests/reference/rest.py: the fold of the period map of z, beta -> A.
LISTED = {0.1: 1.881548086, 0.5: 2.242949539, 1.0: 2.414439560, 3.0: 2.501319610}
STRIPS = (0.4, 1.2, 1.6)  # amplitudes of the shaking
FOLD = brentq(lambda t: force(t) - MU_S, BEGIN, END)


def slip(eps):
    """Proposition 1: z after half a unit of time of slip at v of order 1, and v there; beta = eps."""
    run = solve(osc.oscillator(beta=eps).smoothed(eps=eps), (0, 0.5), {"y": 0, "v": 1.5, "z": 0.5}, **FINE)
    return run.x[2, -1], run.x[1, -1]


def static(beta):
    """Proposition 2: |z - gamma(lam)| in the middle of the stick, where lam still moves."""
    run = solve(osc.oscillator(beta=beta), (BEGIN, 2.1), resting(BEGIN, 0.0), **TIGHT)
    return abs(run.x[2, -1] - (1 - run.mult[0, -1] ** 2))


def manifold(eps):
    """Proposition 3: |g| = |q'' - k y - N Lambda (1 + rho z)| in the stick at beta = 0.1."""
    run = solve(osc.oscillator(beta=0.1).smoothed(eps=eps), (BEGIN, 2.1), resting(BEGIN, eps), **FINE)
    y, mu = run.x[0, -1], run["mu"][-1]
    return abs(-2.4 * np.sin(2.1) - 3.1 * y - mu)


def flow(eps, end):
    """Proposition 4: distance of the smoothed state from the sliding one, at beta = 0.1."""
    exact = solve(osc.oscillator(beta=0.1), (BEGIN, end), resting(BEGIN, 0.0), **TIGHT)
    smooth = solve(osc.oscillator(beta=0.1).smoothed(eps=eps), (BEGIN, end), resting(BEGIN, eps), **FINE)
    return np.abs(exact.x[[0, 2], -1] - smooth.x[[0, 2], -1]).max()


def rest_end(beta, *, A=0.0, offset=0.0, over="A", to=3.0):
    """Proposition 5: (where rest ends, how, range of z there), followed over A or over the offset k y0.

    At rest under q'' = A sin t the flow is that of z alone. Its periodic orbit is followed to its end: a fold, or,
    where that is canard-like (multipliers beyond every power), the last value from which trajectories return; unless
    |lam| reaches 1 before.
    """
    size, shift, memory = sp.symbols("A offset beta", real=True)
    held = (size * sp.sin(osc.t) - shift) / (1 + 3 * osc.z)
    rest = System(
        {osc.z: (1 - held**2 - osc.z) / memory},
        time=osc.t,
        parameters={size: A, shift: offset, memory: beta},
        outputs={"lam": held},
    )
    options = dict(seen=Strobe(2 * sp.pi), rtol=1e-11, atol=1e-13)

    def seen(orbit):
        """(largest |lam|, least z, largest z) of an orbit."""
        runs = orbit.runs(dense_output=True)  # of a canard in segments, from which trajectories leave it
        times = [np.linspace(run.t[0], run.t[-1], 4001) for run in runs]
        z, lam = (
            np.concatenate([run(at, name) for run, at in zip(runs, times, strict=True)])
            for name in ("z", "lam")
        )
        return [float(value) for value in (np.abs(lam).max(), z.min(), z.max())]

    first = find_orbit(rest, {osc.z: 0.8}, transient=20, **options)
    branch = follow(first, {over: to}, steps=Steps(shortest=1e-10, max_points=80))
    last = int(np.argmax(branch.values))  # where it turns
    rising = [seen(orbit) for orbit in branch.points[: last + 1]]
    slips = next((i for i, (lam, _, _) in enumerate(rising) if lam > 1), None)
    if slips is not None:  # before the periodic z ends
        near = branch.points[slips - 1].x

        def beyond(value):
            return seen(find_orbit(rest.with_parameters({over: value}), near, **options))[0] - 1

        value = brentq(beyond, branch.values[slips - 1], branch.values[slips], xtol=1e-9)
        return float(value), "|lam| = 1", rising[slips - 1][1:]
    folds = branch.of_kind("fold")
    value = folds[0].parameter if folds else branch.values[last]
    return float(value), "fold" if folds else "runs away", rising[last][1:]


def strip(A):
    """Largest |k y0| at which the slaved block rests under q'' = A sin t, by bisection of runs."""
    view = osc.oscillator(sigma=A).layered({osc.z: sp.oo})

    def rests(offset):
        # From where the force offset - A sin t is least: there the layer has one root.
        begin = np.arcsin(min(1.0, offset / A))
        run = solve(view, (begin, begin + 4 * np.pi), {"y": -offset / 3.1, "v": 0.0}, rtol=1e-10)
        return not any(e.kind.startswith("slip") for e in run.events)

    low, high = 0.0, 2.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(middle) else (low, middle)
    return low


def z_at_touch():
    """Least z = gamma(lam) over a period of rest at y = 0 just below N mu_s = max|q''|, z slaved."""
    view = osc.oscillator(sigma=MU_S * (1 - 1e-9)).layered({osc.z: sp.oo})
    run = solve(view, (0, 2 * np.pi), {"y": 0.0, "v": 0.0}, dense_output=True, rtol=1e-10)
    return float((1 - run(np.linspace(0, 2 * np.pi, 4001), "lam") ** 2).min())


def saddle_amplitude():
    """Largest sigma with a whole sticking orbit on a branch lam_s < lam <= 1, by the layer's roots."""
    times = np.linspace(0, 2 * np.pi, 721)

    def there(sigma):
        middle = (1 + MU_S) / 2  # the best k y0, by symmetry of the interval of forces
        roots = np.array([np.roots([-3.0, 0.0, 4.0, -f]) for f in middle + sigma * np.sin(times)])
        real = np.abs(roots.imag) < 1e-9
        return bool(np.all(np.any(real & (roots.real > LAM_S) & (roots.real <= 1 + 1e-9), axis=1)))

    low, high = 0.1, 1.0
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if there(middle) else (low, middle)
    return low


def beyond_fold(beta):
    """Time for which a stick goes on beyond lam_s, on what is a repelling branch at z = gamma."""
    run = solve(osc.oscillator(beta=beta), (BEGIN, END + 0.5), resting(BEGIN, 0.0), dense_output=True, **TIGHT)
    end = run.event_times("slip")[0]
    times = np.linspace(BEGIN, end - 1e-9, 20001)
    return float(end - times[np.argmax(run(times, "lam") > LAM_S)])


def saddle_begins(eps):
    """Proposition 5: lam at which the state at rest becomes a saddle (no drive, beta = eps)."""
    view = osc.oscillator(beta=eps, sigma=0.0).smoothed(eps=eps)
    line, p = linearise(view.model), np.array(view.parameter_values)

    def determinant(lam):
        y = -lam * (4 - 3 * lam**2) / 3.1
        x = np.array([[y], [eps * lam / np.sqrt(1 - lam**2)], [1 - lam**2]])
        block = line.blocks(np.zeros(1), x, np.zeros((0, 1)), p).f_w[0, 1:, 1:]
        return np.linalg.det(block) * eps**2

    return brentq(determinant, 0.5, 0.8, xtol=1e-14)


def jump_of_layer(eps):
    """Proposition 6 at eps/beta = 1: (delay past the fold until lam = 0.95, time from lam = lam_s to there)."""
    run = solve(
        osc.oscillator(beta=eps).smoothed(eps=eps), (BEGIN, END), resting(BEGIN, eps), dense_output=True, **FINE
    )
    passed = []
    for lam in (LAM_S, 0.95):
        level = eps * lam / np.sqrt(1 - lam**2)
        k = int(np.flatnonzero(run.x[1] > level)[0])
        passed.append(brentq(lambda t, at=level: float(run(t, "v")) - at, run.t[k - 1], run.t[k], xtol=1e-14))
    return passed[1] - FOLD, passed[1] - passed[0]


def jump_of_memory(beta):
    """Proposition 6, relaxing regime: delay of the slip past the time at which F = N mu_s."""
    run = solve(osc.oscillator(beta=beta), (BEGIN, END + 0.2), resting(BEGIN, 0.0), **TIGHT)
    return run.event_times("slip")[0] - FOLD


def run(config):
    """All sequences."""
    eps, beta = grid(config.log_eps), grid(config.log_beta)
    slips, jumps = [slip(e) for e in eps], [jump_of_layer(e) for e in eps]
    ends = {str(b): rest_end(b, A=1.5) for b in LISTED}
    return {
        "eps": eps,
        "beta": beta,
        "slip": [z for z, _ in slips],
        "slip_over_gamma": [z / (e / v) ** 2 for e, (z, v) in zip(eps, slips)],
        "static": [static(b) for b in beta],
        "manifold": [manifold(e) for e in eps],
        "sticking": [flow(e, 2.1) for e in eps],
        "after": [flow(e, 3.6) for e in eps],
        "rest": [rest_end(b, A=1.7)[0] - MU_S for b in beta],
        "rest_ends": {b: {"A": end[0], "by": end[1]} for b, end in ends.items()},
        "strip": {"slaved": {str(A): strip(A) for A in STRIPS}}
        | {str(b): {str(A): rest_end(b, A=A, over="offset")[:2] for A in STRIPS} for b in (0.1, 1.0)},
        "z_at_rest": rest_end(0.01, A=1.2, over="offset")[2],
        "z_at_touch": z_at_touch(),
        "saddle_amplitude": saddle_amplitude(),
        "beyond_fold": {str(b): beyond_fold(b) for b in (0.1, 0.01, 0.001)},
        "saddle": [abs(saddle_begins(e) - LAM_S) for e in eps],
        "jump_layer": [delay for delay, _ in jumps],
        "jump_time": [time for _, time in jumps],
        "jump_memory": [jump_of_memory(b) for b in beta],
    }


# name, over which variable, expected order, how near, what it is, where the order comes from
SEQUENCES = (
    ("slip", "eps", 2, 0.05, "1: z while slipping", "z = Gamma"),
    ("static", "beta", 1, 0.05, "2: |z - gamma| while sticking", "proposition 2"),
    ("manifold", "eps", 1, 0.05, "3: distance from the manifold", "proposition 3"),
    ("sticking", "eps", 1, 0.05, "4: smoothed flow, while sticking", "section 7, after (36)"),
    ("after", "eps", 0.8, 0.05, "4: smoothed flow, after the stick", "tail 1/u^2 of the sigmoid"),
    ("rest", "beta", 1, 0.05, "5: A at rest beyond N mu_s", "parabolic passage of a fold"),
    ("saddle", "eps", 1, 0.05, "5: saddle begins, from lam_s", "regular perturbation"),
    ("jump_layer", "eps", 2 / 3, 0.05, "6: delay past the fold, eps/beta = 1", "section 7, Eckhaus"),
    ("jump_memory", "beta", 2 / 3, 0.05, "6: delay past the fold, relaxing", "passage of a fold"),
)


WORDS = {"mu_s": "$\\mu_s$", "lam_s": "$\\lambda_s$", "gamma": "$\\gamma$", "eps/beta": "$\\varepsilon/\\beta$"}


def order(data, name, over):
    """Slope at the small end: the last two values."""
    x, d = np.array(data[over], float), np.array(data[name], float)
    return float(np.log(d[-1] / d[-2]) / np.log(x[-1] / x[-2]))


def origin(where):
    """Of an order: printed in the source where a place is named, else derived."""
    printed = where.startswith(("proposition", "section"))
    return (
        {"origin": "printed", "where": f"solid friction, {where}"}
        if printed
        else {"origin": "derived", "where": where}
    )


def claims(data):
    """Expected orders beside measured ones, and what appendix B says of rest."""
    B = {"origin": "printed", "where": "solid friction, appendix B"}
    result = [
        Claim.number(
            f"order of proposition {text}", expected, order(data, name, over), near, digits=3, **origin(where)
        )
        for name, over, expected, near, text, where in SEQUENCES
    ]
    ratios = np.array(data["slip_over_gamma"])
    slopes = {name: order(data, name, over) for name, over in (("slip", "eps"), ("sticking", "eps"), ("after", "eps"),
                                                                 ("jump_time", "eps"))}  # fmt: skip
    ends, strips = data["rest_ends"], data["strip"]
    widths = {A: (MU_S - float(A)) for A in strips["slaved"]}
    off = max(abs(strips["slaved"][A] - width) for A, width in widths.items())
    low, high = data["z_at_rest"]
    beyond = data["beyond_fold"]
    result += [
        claim("proposition 1: z lies within O(beta, eps) of 0 where |v| >> eps", "order 1 or more",
              f"order {slopes['slip']:.3f}; z is {ratios[-1]:.5f} of (eps/v)^2",
              slopes["slip"] > 1 and abs(ratios[-1] - 1) < 0.01, "it is farther away",
              origin="printed", where="solid friction, proposition 1"),
        claim("simulations of (26) lie eps-close to the discontinuous system", "order 1",
              f"order {slopes['sticking']:.3f} while it sticks, {slopes['after']:.3f} after the stick",
              min(slopes["sticking"], slopes["after"]) > 0.95,
              "where sticking ends by |lam| = 1 the sigmoid's tail 1/u^2 lets go earlier: eps^(4/5)",
              origin="printed", where="solid friction, section 7, after (36)"),
        claim("the jump takes a time O(eps^(1/3))", "order 1/3 or more", f"order {slopes['jump_time']:.3f}: not sharp",
              slopes["jump_time"] > 1 / 3, "it takes longer",
              origin="printed", where="solid friction, section 7, Eckhaus"),
        *(
            Claim.number(f"rest at y = 0 survives up to A, beta = {beta}", LISTED[float(beta)], end["A"], 1e-7,
                         digits=9, origin="independent", where="tests/reference/rest.py")
            for beta, end in ends.items()
        ),
        claim("for N mu_s < |q''| there no longer exist pure sticking periodic orbits", "A <= 1.77778",
              "there are up to " + ", ".join(f"A = {end['A']:.5f} (beta = {beta})" for beta, end in ends.items()),
              all(end["A"] <= MU_S for end in ends.values()),
              "z lags behind and holds on through the maximum: rest is lost in a saddle-node of the periodic z", **B),
        claim("proposition 5, z slaved: orbits at rest fill the strip k |y0| <= N mu_s - max|q''|",
              ", ".join(f"{width:.5f} at A = {A}" for A, width in widths.items()),
              ", ".join(f"{width:.5f}" for width in strips["slaved"].values()) + f"; off by at most {off:.1e}",
              off < 1e-6, "the strip has another width", **B),
        claim("proposition 5, beta > 0: the same strip", "the same",
              "; ".join(f"beta = {beta}: " + ", ".join(f"{w:.5f} ({how})" for w, how in strips[beta].values())
                        for beta in strips if beta != "slaved"),
              all(abs(strips[beta][A][0] - width) < 1e-3 for beta in strips if beta != "slaved"
                  for A, width in widths.items()),
              "it is wider: z need not follow the force", **B),
        claim("the orbits of proposition 5 have a fixed z", "z fixed",
              f"{low:.3f} <= z <= {high:.3f} at the strip's edge (beta = 0.01, A = 1.2)",
              high - low < 1e-6, "y and v are fixed; z follows gamma(lam(t)) as the force changes", **B),
        claim("corollary: at N mu_s = |q''| the one sticking orbit has z = 0", "{0, 0, 0}",
              f"z = gamma(lam) is {data['z_at_touch']:.4f} or more",
              data["z_at_touch"] < 0.01, "z = 0 belongs to slip; on v = 0 gamma > 0", **B),
        Claim.number("whole sticking orbits of saddle type exist up to sigma = N (mu_s - 1)/2", (MU_S - 1) / 2,
                     data["saddle_amplitude"], 1e-5, origin="derived", where="forces between N and N mu_s"),
        claim("relaxing: sticks go on beyond lam_s, canard-like, for a time that falls with beta", "falls",
              ", ".join(f"{time:.4f} (beta = {beta})" for beta, time in beyond.items()),
              list(beyond.values()) == sorted(beyond.values(), reverse=True) and min(beyond.values()) > 0,
              "it does not"),
    ]  # fmt: skip
    return result


def draw(data):
    """One panel for the sequences in eps, one for those in beta."""
    figure = new_figure(7.0, 5.6)
    panels = dict(zip(("eps", "beta"), figure.subplots(1, 2)))
    colours = [
        COLOUR[k] for k in ("right", "left", "stick", "fast", "smoothed", "approximation", "velocity", "exact")
    ]
    for over, ax in panels.items():
        own = [s for s in SEQUENCES if s[1] == over]
        for colour, mark, (name, _, expected, _, text, _) in zip(colours, "os^Dv<>P", own):
            x, d = np.array(data[over], float), np.array(data[name], float)
            ax.loglog(x, d, mark, color=colour, markersize=4)
            power = {2 / 3: "2/3", 0.8: "4/5"}.get(expected, f"{expected:g}")
            for word, sign in WORDS.items():
                text = text.replace(word, sign)
            label = f"{text}\n   expected {power}, measured {order(data, name, over):.3f}"
            ax.loglog(x, d[-1] * (x / x[-1]) ** expected, color=colour, linewidth=1)
            ax.plot([], [], "-" + mark, color=colour, linewidth=1, markersize=4, label=label)
        letter = {"eps": "\\varepsilon", "beta": "\\beta"}[over]
        ax.set(xlabel=f"${letter}$", ylabel="distance from the limit", title=f"As ${letter}$ falls")
        ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.17), fontsize=7, labelspacing=0.7)
    return figure


STUDY = Study(
    name="propositions",
    question="Do the source's propositions 1 to 5 and its jump at a fold hold, and with which orders?",
    expected="Orders 2, 1, 1, 1 (4/5 after the stick), 1 and 2/3.",
    full=Config(),
    fast=Config(log_eps=(-3.0, -4.0, 3), log_beta=(-2.5, -3.5, 3)),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
