"""E15: what the text of the source on solid friction says beside its figures and propositions, checked one by one.

The statements of sections 1 to 6 and of appendix A that no figure shows: the exponent of (10), the bounds (6) and
(7), the peaks at larger rho, the expansion (39), (40), conditions for sticking, irreversibility, hysteresis from
beta, and the misprints of sections 3, 6 and 7, each by a computation that does not use the formula in question.

Usage: python experiments/statements_solid_friction.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.special import erf
from studytools import Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from paper_figures.figure_01 import prescribed
from paper_figures.figure_02 import contact_coefficient
from pwsmooth import Strobe, Switch, System, find_orbit, solve
from pwsmooth.paths.derivatives.linearised import linearise
from pwsmooth.plotting import COLOUR, new_figure

MU_S, LAM_S = 16 / 9, 2 / 3


@dataclass(frozen=True)
class Config:
    """Strengths rho of the phase, and times beta of the memory."""

    rhos: tuple[float, ...] = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0)
    betas: tuple[float, ...] = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


SIGMOIDS = {"algebraic": lambda u: u / np.sqrt(1 + u * u), "tanh": np.tanh, "erf": erf}


def exponents():
    """(10): d ln Lambda'/d ln(1 - Lambda^2) of each sigmoid at u = 0.2, 0.5, 1, 2, by differences."""
    found, u, h = {}, np.array([0.2, 0.5, 1.0, 2.0]), 1e-4
    for name, value in SIGMOIDS.items():
        slope = lambda x, f=value: (f(x + h) - f(x - h)) / (2 * h)  # noqa: E731
        gamma = lambda x, f=value: 1 - f(x) ** 2  # noqa: E731
        found[name] = (np.log(slope(u + h) / slope(u - h)) / np.log(gamma(u + h) / gamma(u - h))).tolist()
    return found


def extrema(rho):
    """Heights of the peaks and dips of mu for u > 0 that differ by 1 % or more from 1, by a search on a grid."""
    u = np.linspace(0, 12, 240_001)
    mu = contact_coefficient(u, rho)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(mu)))) + 1
    return [float(mu[k]) for k in turns if abs(mu[k] - 1) > 0.01]


def expansion(rho=1.5, far=12.0):
    """(40): L = (mu - Lambda)/(rho Gamma) far out and near 0, and its printed leading term -b_1/(rho Lambda^2)."""
    value = SIGMOIDS["algebraic"]
    L = lambda u: (contact_coefficient(u, rho) - value(u)) / (rho * (1 - value(u) ** 2))  # noqa: E731
    return {"far": float(L(far)), "printed": float(-0.5 / (rho * value(far) ** 2)), "zero": float(L(1e-6))}


def holds_at(force, z):
    """Whether a contact at rest with frozen z sticks under a force (units of N)."""
    run = solve(osc.oscillator(beta=1e9, sigma=0.0), (0, 1e-3), {"y": -force / 3.1, "v": 0.0, "z": z})
    return run.segments[-1].status == (0,)


def edge(z):
    """Largest force at which it sticks, by bisection of runs."""
    low, high = 0.0, 10.0
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds_at(middle, z) else (low, middle)
    return low


def hysteresis(beta, eps=1e-3):
    """Largest difference of |mu| between arriving at v = 0 and leaving it at the same |v|, under v = sin t."""
    run = prescribed(eps, beta)
    away = np.geomspace(1e-7, math.pi / 2, 20_000)
    return float(np.abs(run(3 * math.pi - away, "mu") + run(3 * math.pi + away, "mu")).max())


def misprints():
    """Number of each formula as printed -> (what it should vanish to, what it is)."""
    t = osc.t
    x, q, k, c, N, mu = sp.Function("x")(t), sp.Function("q")(t), *sp.symbols("k c N mu", positive=True)
    y = x - q
    total = -(x - q) * k - (x - q).diff(t) * c - mu * N  # (11), (14), m = 1
    should = sp.simplify(total - q.diff(t, 2) - (-q.diff(t, 2) - k * y - c * y.diff(t) - N * mu))
    printed = sp.simplify(total - q.diff(t, 2) - (q.diff(t, 2) - k * y - c * y.diff(t) - N * mu))
    u = sp.Symbol("u", real=True)
    Lam = u / sp.sqrt(1 + u**2)
    Gam = 1 - Lam**2
    lam = sp.Symbol("lam", real=True)
    lam, fold = sp.Symbol("lam", real=True), sp.Rational(2, 3)
    eigen = float(sp.diff(-lam * (1 + 3 * (1 - lam**2)), lam).subs(lam, fold))
    as_printed = float(-(1 + 3 * (1 - lam**2)).subs(lam, fold))
    # d lam/d tau over v' for tau = t gamma^q/eps, from d lam/dt = v' d Lambda/du/eps
    rates = {power: float((sp.diff(Lam, u) / Gam**power).subs(u, 1)) for power in (1, sp.Rational(3, 2))}
    return {
        "(15)": {"printed": str(printed), "corrected": str(should)},
        "(20)": {"printed": rates[1], "corrected": rates[sp.Rational(3, 2)]},
        "proof 3": {"slope": float(sp.diff(Lam, u).subs(u, 1)), "printed": float(Gam.subs(u, 1))},
        "proof 5": {"true": eigen, "printed": as_printed},
    }


def relaxation_in_fast_time(eps=1e-3, beta=0.1):
    """(21): d z/d tau in the layer, tau = t gamma^(3/2)/eps, in a smoothed run, beside (gamma - z)/beta."""
    view = osc.oscillator(beta=beta, sigma=0.0).smoothed(eps=eps)
    step = 1e-3 * eps
    run = solve(view, (0, step), {"y": -0.5 / 3.1, "v": 0.3 * eps, "z": 0.2}, rtol=1e-12, atol=1e-16)
    gamma = 1 / (1 + 0.3**2)
    rate = (run["z"][-1] - 0.2) / (step * gamma**1.5 / eps)
    return {
        "slow": float((run["z"][-1] - 0.2) / step),
        "measured": float(rate),
        "printed": (gamma - 0.2) / beta,
        "with_eps": (gamma - 0.2) / beta * eps / gamma**1.5,
    }


def lowest_degree():
    """Lowest degree of an even polynomial gamma with gamma(+-1) = 0 that is not 0 throughout."""
    lam = sp.Symbol("lam", real=True)
    for degree in range(6):
        c = sp.symbols(f"c:{degree + 1}")
        gamma = sum(value * lam**k for k, value in enumerate(c))
        wanted = [gamma.subs(lam, 1), gamma.subs(lam, -1), *(value for k, value in enumerate(c) if k % 2)]
        if any(value != 0 for value in (gamma.subs(one) for one in sp.solve(wanted, c, dict=True))):
            return degree
    return None


def release(convention, beta=1e-4):
    """Force (N) at which a contact at rest gives way while the force rises by 1 a unit of time."""
    t, v, z = osc.t, osc.v, osc.z
    lam = Switch("lam", v)
    contact = System(
        {v: t - lam * (1 + 3 * z), z: (1 - lam**2 - z) / beta}, time=t, convention=convention
    )  # fmt: skip
    run = solve(contact, (0, 3), {"v": 0.0, "z": 1.0 if convention == "hidden" else 0.0})
    return run.event_times("slip")[0]


def stiffness(eps):
    """Largest size of an eigenvalue of the smoothed system in the layer, v = 0.3 eps, and at v = 1."""
    view = osc.oscillator(beta=0.1).smoothed(eps=eps)
    line, p = linearise(view.model), np.array(view.parameter_values)
    return [
        float(np.abs(np.linalg.eigvals(line.blocks(np.zeros(1), np.array([[0.0], [v], [0.5]]), np.zeros((0, 1)), p)
                                       .f_w[0])).max())
        for v in (0.3 * eps, 1.0)
    ]  # fmt: skip


def touching():
    """v' on either side of v = 0 where rest at y = 0 touches the sticking boundary, sigma = N mu_s: at pi/2, 3 pi/2."""
    found = {}
    for name, at in (("pi/2", math.pi / 2), ("3 pi/2", 1.5 * math.pi)):
        for side, slip in (("right", 1), ("left", -1)):
            run = solve(osc.oscillator(sigma=MU_S), (at, at + 1e-9), {"y": 0.0, "v": slip * 1e-6, "z": 0.0})
            found[f"{side}, {name}"] = float((run["v"][-1] - slip * 1e-6) / (run.t[-1] - at))
    return found


def rank(view, start):
    """Product of the multipliers of the periodic orbit that a start leads to, and their sizes."""
    orbit = find_orbit(view, start, seen=Strobe(2 * sp.pi), transient=60)
    sizes = np.abs(orbit.multipliers)
    # What slip and crossings alone leave: exp(-c T), and v' behind over v' before v = 0 of each crossing.
    run = orbit.solution()
    forces = [abs(-2.4 * np.sin(at) - 3.1 * run(at, "y")) for at in run.event_times("crossing")]
    left = math.exp(-0.1 * 2 * math.pi) * math.prod((force - 1) / (force + 1) for force in forces)
    return {"product": float(np.prod(sizes)), "expected": float(left)}


def stick_path():
    """lam along the stick of the slaved orbit, from where it is captured."""
    view = osc.oscillator().layered({osc.z: sp.oo})
    orbit = osc.settled(view, osc.SLAVED_START, periods=20)
    stick = osc.sticks(orbit)[0]
    times = np.linspace(stick.start, stick.end, 402)[1:-1]
    return np.abs(orbit(times, "lam")).tolist()


def run(config):
    """All computations."""
    slaved = osc.oscillator().layered({osc.z: sp.oo})
    forces = (0.5, 1.5, 1.9)
    roots = [np.roots([-3.0, 0.0, 4.0, -f]) for f in forces]
    return {
        "exponents": exponents(),
        "at_eps": float(1 - SIGMOIDS["algebraic"](1.0)),
        "gamma_u": float(max(x / (1 + x * x) for x in np.geomspace(1, 1e4, 2001))),
        "rhos": config.rhos,
        "extrema": [extrema(rho) for rho in config.rhos],
        "expansion": expansion(),
        "edges": {str(z): edge(z) for z in (0.0, 0.3, 1.0)},
        "roots": [int(np.sum((np.abs(r.imag) < 1e-9) & (np.abs(r.real) <= 1))) for r in roots],
        "rank": {
            "stick": rank(slaved, osc.SLAVED_START),
            "slip": rank(osc.oscillator(rho=0).layered({osc.z: sp.oo}), osc.SLAVED_START),
        },
        "stick_path": stick_path(),
        "betas": config.betas,
        "hysteresis": [hysteresis(beta) for beta in config.betas],
        "misprints": misprints(),
        "degree": lowest_degree(),
        "release": {convention: release(convention) for convention in ("hidden", "filippov")},
        "stiffness": {str(eps): stiffness(eps) for eps in (1e-2, 1e-3, 1e-4)},
        "touching": touching(),
        "fast_time": relaxation_in_fast_time(),
    }


def claims(data):
    """What the source says beside what was found."""

    def said(statement, source, ours, holds, otherwise, place):
        return claim(
            statement, source, ours, holds, otherwise, origin="printed", where=f"solid friction, {place}"
        )

    p = {name: np.array(values) for name, values in data["exponents"].items()}
    counts = [len(found) for found in data["extrema"]]
    first = [max(found, default=1.0) for found in data["extrema"]]
    far = data["expansion"]
    edges = {float(z): edge for z, edge in data["edges"].items()}
    path, wrong = np.array(data["stick_path"]), data["misprints"]
    time, stiff, touch = data["fast_time"], data["stiffness"], data["touching"]
    stick, slip = data["rank"]["stick"], data["rank"]["slip"]
    return [
        said("Lambda = u/sqrt(1 + u^2) gives (10) with p = 3/2", "3/2 at every u",
             f"algebraic {p['algebraic'].min():.6f} to {p['algebraic'].max():.6f}; tanh {p['tanh'].min():.3f} to "
             f"{p['tanh'].max():.3f}", np.abs(p["algebraic"] - 1.5).max() < 1e-5, "another exponent", "(10)"),
        said("every sigmoid has a p with (10): eps d Lambda/dv = Gamma^p + O(eps/v)", "some p > 0",
             f"erf: {', '.join(f'{x:.3f}' for x in p['erf'])} at u = 0.2, 0.5, 1, 2", np.ptp(p["erf"]) < 1e-3,
             "of erf the exponent varies with u: Lambda' is no power of 1 - Lambda^2", "(10)"),
        said("(6): Lambda_eps is sign(v) + O(eps) where |v| > eps", "O(eps)",
             f"at |v| = eps it is off by {data['at_eps']:.3f}, whatever eps is", data["at_eps"] < 0.01,
             "it is sign(v) + O((eps/v)^2): O(eps^2) at fixed v, O(1) at |v| of order eps", "(6)"),
        said("(7): Gamma_eps is O(eps/v) where |v| > eps", "O(eps/v)", f"Gamma v/eps <= {data['gamma_u']:.3f}",
             data["gamma_u"] <= 1, "it is larger", "(7)"),
        said("without oscillation, rho = 0, there are no peaks", "none",
             f"{counts[0]} extrema 1 % off 1", counts[0] == 0, "there are some", "appendix A"),
        said("for larger rho there are several peaks and dips, which grow", "more and higher with rho",
             "; ".join(f"rho = {rho:g}: {n}, up to {top:.3g}" for rho, n, top in zip(data["rhos"], counts, first)),
             counts == sorted(counts) and counts[-1] >= 3 and first == sorted(first), "they do not", "appendix A"),
        said("(40): L tends to -b_1/(rho Lambda^2) where q has died out", f"{far['printed']:.4f} at v/eps = 12",
             f"{far['far']:.4f}", abs(far["far"] - far["printed"]) < 0.01,
             "the sign of b_n is that of (38): it tends to +b_1/rho", "(39), (40)"),
        said("L is finite at v = 0", "finite", f"{far['zero']:.1e}", abs(far["zero"]) < 1, "it is not", "(40)"),
        said("at frozen z sticking lasts while |k y - q''| < (1 + rho z) N", "1 + 3 z",
             ", ".join(f"{edge:.6f} at z = {z:g}" for z, edge in edges.items()),
             max(abs(edge - 1 - 3 * z) for z, edge in edges.items()) < 1e-5, "other bounds", "section 5"),
        said("sticking may have several solutions where rho is not 0", "several",
             f"equilibria of the layer at F = 0.5, 1.5, 1.9: {', '.join(map(str, data['roots']))}",
             data["roots"] == [1, 2, 0], "another number", "section 5"),
        said("stick-slip cannot be undone: once it sticks, when it slipped before cannot be told",
             "information is lost",
             f"product of the orbit's multipliers {stick['product']:.1e} with sticks; without, "
             f"{slip['product']:.5e}, of damping and crossings alone {slip['expected']:.5e}",
             stick["product"] < 1e-12 and abs(slip["product"] / slip["expected"] - 1) < 1e-5, "it can be", "section 1"),
        said("sticking orbits move towards or away from the extrema of B", "monotone",
             f"|lam| from {path[0]:.4f} to {path[-1]:.4f}, extremum at 0.6667",
             np.all(np.diff(path) > 0) or np.all(np.diff(path) < 0), "lam turns on the way", "section 6, figure 5"),
        said("beta introduces hysteresis, on the time scale of beta", "none for beta -> 0",
             ", ".join(f"{gap:.3g} (beta = {beta:g})" for gap, beta in zip(data["hysteresis"], data["betas"]))
             + ": gap in |mu| between arriving and leaving, eps = 0.001",
             data["hysteresis"][0] < 0.01 and max(data["hysteresis"]) > 0.3, "it does not", "section 3"),
        said("(15): v' = +q'' - k y - c v - N mu for y = x - q", "+q''",
             f"the difference to (11), (14) is {wrong['(15)']['printed']}; with -q'' {wrong['(15)']['corrected']}",
             wrong["(15)"]["printed"] == "0", "y = x - q gives -q'', a shift by half a period of the drive", "(15)"),
        said("(20): lam evolves on the time scale tau = t gamma/eps", "lam' = v'",
             f"lam'/v' = {wrong['(20)']['printed']:.4f} at u = 1; with gamma^p {wrong['(20)']['corrected']:.4f}",
             abs(wrong["(20)"]["printed"] - 1) < 1e-9, "tau = t gamma^p/eps is meant", "(20), (21)"),
        said("(21): beta z' = gamma - z on the fast time", f"z' = {time['printed']:.4g}",
             f"z' = {time['measured']:.4g} in a run (eps = 0.001, beta = 0.1)",
             abs(time["measured"] / time["printed"] - 1) < 0.01,
             "a factor eps/gamma^p is missing, which (36) has: z stands still", "(21)"),
        said("(24): beta z' = gamma - z, with the prime of the fast time", f"z' = {time['printed']:.4g}",
             f"z' = {time['measured']:.4g} in that run, and dz/dt = {time['slow']:.4g}",
             abs(time["measured"] / time["printed"] - 1) < 0.01,
             "a slip of notation: it is the derivative by t that is (gamma - z)/beta", "(24)"),
        said("to produce peaks gamma, even and 0 at lam = +-1, is at least of quadratic order", "2",
             f"{data['degree']}, by the coefficients of polynomials", data["degree"] == 2, "another order",
             "section 5"),
        said("event detection as it is common neglects the hidden terms", "static friction is lost",
             f"with the convex combination of both sides rest gives way at {data['release']['filippov']:.5f} N, with "
             f"the hidden term at {data['release']['hidden']:.5f} N",
             abs(data["release"]["filippov"] - 1) < 1e-3 and abs(data["release"]["hidden"] - MU_S) < 0.01,
             "it is kept", "section 7"),
        said("the smoothed system is stiff near |v| <= eps for small eps", "eigenvalues of order 1/eps",
             "; ".join(f"eps = {eps}: {inside:.4g} at v = 0.3 eps, {outside:.3g} at v = 1"
                       for eps, (inside, outside) in stiff.items()),
             np.ptp([float(eps) * inside for eps, (inside, _) in stiff.items()]) < 0.05
             and all(float(eps) * inside > 1 and outside < 20 for eps, (inside, outside) in stiff.items()),
             "it is not", "section 8"),
        said("corollary: there right slip has v' = 0 at t = pi/(2 omega)", "0",
             ", ".join(f"{value:.4f} ({name})" for name, value in touch.items() if name.endswith(", pi/2")),
             abs(touch["right, pi/2"]) < 1e-3,
             "v' of slip vanishes where |k y - q''| = N; on the boundary of nonlinear sticking it is lam that has no "
             "root any more", "appendix B"),
        said("corollary: there right slip has v' = 0 at t = 3 pi/(2 omega)", "0",
             ", ".join(f"{value:.4f} ({name})" for name, value in touch.items() if name.endswith(", 3 pi/2")),
             abs(touch["right, 3 pi/2"]) < 1e-3, "nor does that of left slip, which is meant by symmetry",
             "appendix B"),
        said("proof of proposition 3: d Lambda/du = Gamma", f"{wrong['proof 3']['printed']:.4f} at u = 1",
             f"{wrong['proof 3']['slope']:.4f}", abs(wrong["proof 3"]["slope"] - wrong["proof 3"]["printed"]) < 1e-9,
             "it is Gamma^p; its sign, which the proof needs, is the same", "section 7"),
        said("proof of proposition 5: d lam'/d lam = -N (1 + rho gamma)", f"{wrong['proof 5']['printed']:.4f} at lam_s",
             f"{wrong['proof 5']['true']:.4f}", abs(wrong["proof 5"]["true"] - wrong["proof 5"]["printed"]) < 1e-9,
             "the term rho lam d gamma/d lam is missing, which makes it vanish at lam_s", "appendix B"),
    ]  # fmt: skip


def draw(data):
    """Peaks over rho, the path of a stick, hysteresis over beta."""
    figure = new_figure(3.5, 7.4)
    left, middle, right = figure.subplots(3, 1)
    u = np.linspace(0, 6, 601)
    for rho, shade, dash in zip((1.0, 1.5, 2.0), ("#4292C6", "#08519C", "#08204A"), (":", "--", "-")):
        left.plot(u, contact_coefficient(u, rho), dash, color=shade, label=rf"$\rho={rho:g}$")
    left.set(xlabel=r"$v/\varepsilon$", ylabel=r"$\mu$", title="peaks and dips grow")
    left.legend(loc="upper right")
    path = np.array(data["stick_path"])
    middle.plot(np.linspace(0, 1, len(path)), path, color=COLOUR["stick"])
    middle.axhline(LAM_S, color=COLOUR["mark"], linewidth=0.8, linestyle=":")
    middle.set(xlabel="share of the stick's time", ylabel=r"$|\lambda|$", title="a stick runs to the fold")
    right.loglog(data["betas"], data["hysteresis"], "o-", color=COLOUR["exact"], markersize=4)
    right.set(xlabel=r"$\beta$", ylabel=r"gap in $|\mu|$", title=r"hysteresis over $\beta$")
    return figure


STUDY = Study(
    name="statements_solid_friction",
    question="Which statements of the text on solid friction, beside figures and propositions, do its equations bear?",
    expected="Those of the model; not the misprints, nor bounds that hold at fixed speed only.",
    full=Config(),
    fast=Config(betas=(1e-6, 1e-4, 1e-2)),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
