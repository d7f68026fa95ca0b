"""Figure 2: the contact coefficient as an integral over oscillating forces, and its asymptotic form.

    mu(v) = c int_0^{v/eps} a(k) cos theta(k) dk,   c such that mu -> 1 as v -> inf     (eq. 3)

With a = exp(-k**2/2), theta = rho k: mu = Re erf((v/eps - i rho)/sqrt 2), since the integral tends to
exp(-rho**2/2) sqrt(pi/2) (the prefactor 1/sqrt(2 pi) of eq. 3 leaves exp(-rho**2/2)/2).
"""

import math

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import erf, wofz

from paper_figures.claims import Claim
from paper_figures.sources import IDENTITY, solid_friction
from pwsmooth.plotting import COLOUR, new_figure

NAME = "2"
TITLE = "The contact coefficient of a continuum of oscillating forces"
CAPTION = """
(i) Exact integral for a Gaussian envelope and linear phase 3k/2 (full curve) and the first term of its
asymptotic form (dotted), which leaves the frame near v = 0. (ii) The same for smaller eps: a step whose
spikes keep their height. (iii) Other envelopes and the mixed phases that the source names, each tending to 1. (iv) How
far the curves of the mixed phases cos(r1 k) cos(r2 k) and cos(r1 k) sin(r2 k)/k rise above 1, Gaussian envelope: below
a line their peak is lower than that; slow phases have none. Not reproduced: the printed peak height, the coefficients
C_nm of (37), the sign in (38), peaks of slow mixed phases, see the claims.
"""
RHO = 1.5


def contact_coefficient(u, rho=RHO):
    """mu at u = v/eps for the Gaussian envelope (eq. 37, first line)."""
    return erf((u - 1j * rho) / math.sqrt(2)).real


def first_term(u, rho=RHO):
    """The first line's leading asymptotic form (eq. 37, last line)."""
    size = np.abs(u)
    wave = np.exp((rho**2 - size**2) / 2) * np.cos(rho * size) / size
    return np.sign(u) * (1 - math.sqrt(2 / math.pi) * wave)


def deficit(u, rho=RHO):
    """(1 - mu) exp(u**2/2), without cancellation at large u."""
    z = (u - 1j * rho) / math.sqrt(2)
    return math.exp(rho**2 / 2) * (np.exp(1j * rho * u) * wofz(1j * z)).real


def deficit_series(u, coefficient, orders=8, rho=RHO):
    """The same from the second line of eq. (37) with the coefficients C_nm given, n + m < orders."""
    total = sum(
        (1j * rho) ** m * coefficient(n, m) / u ** (2 * n + 1 + m)
        for n in range(orders)
        for m in range(orders - n)
    )
    return math.sqrt(2 / math.pi) * math.exp(rho**2 / 2) * (np.exp(1j * rho * u) * total).real


def printed_coefficient(n, m):
    """C_nm as printed: (-1)**n (2n-1)!! binom(2n+1, m)."""
    return (-1) ** n * _double_factorial(2 * n - 1) * math.comb(2 * n + 1, m)


def expanded_coefficient(n, m):
    """C_nm from expanding 1/(u - i rho)**(2n+1): (-1)**n (2n-1)!! binom(2n+m, m)."""
    return (-1) ** n * _double_factorial(2 * n - 1) * math.comb(2 * n + m, m)


def _double_factorial(n):
    return math.prod(range(n, 0, -2))


MIXED = (1.0, 0.75)
# Integrand, and its integral to infinity.
ENVELOPES = {
    r"$e^{-k^2/2}\,\cos\frac{3}{2}k$": (
        lambda k: np.exp(-k * k / 2) * np.cos(1.5 * k),
        math.sqrt(math.pi / 2) * math.exp(-(1.5**2) / 2),
    ),
    r"$\cos\frac{3}{2}k\,/(1+k^2)$": (
        lambda k: np.cos(1.5 * k) / (1 + k * k),
        math.pi / 2 * math.exp(-1.5),
    ),
    r"$\mathrm{sech}^2k\,\cos\frac{3}{2}k$": (
        lambda k: np.cos(1.5 * k) / np.cosh(k) ** 2,
        0.75 * math.pi / math.sinh(0.75 * math.pi),
    ),
}


def mixed_phase(kind, rates, u):
    """mu of a = exp(-k**2/2) with cos(r1 k) cos(r2 k) ("cos") or cos(r1 k) sin(r2 k)/k ("sin").

    The first is half the sum of the phases r1 - r2 and r1 + r2, the second half their integral over the rates between.
    """
    low, high = rates[0] - rates[1], rates[0] + rates[1]
    if kind == "cos":
        nodes, weights = np.array([low, high]), np.ones(2)
    else:
        nodes, weights = np.polynomial.legendre.leggauss(40)
        nodes = low + (high - low) * (nodes + 1) / 2
    weights = weights * np.exp(-(nodes**2) / 2)
    return contact_coefficient(np.asarray(u, float)[..., None], nodes) @ (weights / weights.sum())


def peak_of_mixed(kind, rates):
    """The largest mu: it lies at a zero of the integrand."""
    zeros = [np.pi * (np.arange(40) + 0.5) / rates[0]]
    zeros.append(np.pi * (np.arange(40) + (0.5 if kind == "cos" else 1)) / rates[1])
    u = np.concatenate(zeros)
    return float(mixed_phase(kind, rates, u[u < 12]).max())  # beyond, what is missing to 1 is below 1e-31


def border(kind, r2, height):
    """The rate r1 at which the peak of a mixed phase is as high (of the symmetric one that above r2)."""
    low = max(r2, 0.3) if kind == "cos" else 0.3
    return brentq(lambda r1: peak_of_mixed(kind, (r1, r2)) - height, low, 8, xtol=1e-8)


def normalised_integral(integrand, whole, u):
    """int_0^u over the integral to infinity, on an increasing grid that starts at 0."""
    pieces = [quad(integrand, a, b, epsabs=1e-13)[0] for a, b in zip(u[:-1], u[1:])]
    return np.concatenate([[0.0], np.cumsum(pieces)]) / whole


def claims():
    """What the source says of this figure and of its appendix A, against the integral itself."""
    exact_peak = math.pi / (2 * RHO)
    u = np.linspace(0.01, 6, 60001)
    found_peak = u[np.argmax(contact_coefficient(u))]
    height = contact_coefficient(exact_peak)
    printed_height = 1 + math.sqrt(2 / math.pi) * 4 * RHO**3 / math.pi**2 * math.exp(
        -(math.pi**2) / (8 * RHO**2)
    )
    by_quadrature = quad(next(iter(ENVELOPES.values()))[0], 0, 2.0, epsabs=1e-14)[0]
    as_printed = by_quadrature / math.sqrt(2 * math.pi)
    factor = 2 * math.exp(RHO**2 / 2)
    far = 12.0
    remainder = {
        name: abs(deficit_series(far, coefficient) / deficit(far) - 1)
        for name, coefficient in (("printed", printed_coefficient), ("expanded", expanded_coefficient))
    }
    sigmoid_tail = (10 / math.sqrt(101) - 1) * 2 * 100
    heights = [contact_coefficient(np.linspace(0, 1, 200001) / eps).max() for eps in (0.1, 0.01, 0.001)]
    others, far_off = {}, {}
    tail = np.linspace(8, 24, 161)
    for name, (integrand, whole) in zip(("1/(1+k^2)", "sech^2 k"), list(ENVELOPES.values())[1:]):
        # cos 3k/2 changes its sign at k = pi/3: there the integral is largest.
        others[name] = normalised_integral(integrand, whole, np.array([0, exact_peak]))[-1]
        far_off[name] = normalised_integral(integrand, whole, np.concatenate([[0], tail]))[1:] - 1
    phases = {"cos cos": "cos", "cos sin/k": "sin"}
    far_off |= {name: mixed_phase(kind, MIXED, tail) - 1 for name, kind in phases.items()}
    decay = {name: float((tail * np.abs(off)).max()) for name, off in far_off.items()}
    rates = ((1, 0.75), (1.5, 0.75), (2, 1), (1.5, 0.25))
    risen = {kind: [peak_of_mixed(kind, pair) for pair in rates] for kind in phases.values()}
    edges = ", ".join(f"{border('cos', r2, 1.01):.3f} (r2 = {r2:g})" for r2 in (0.25, 0.5, 0.75, 1))
    return [
        Claim(
            "(3) equals Re Erf((v/eps - i rho)/sqrt 2), (37)",
            "equal",
            f"{as_printed:.9f} and {contact_coefficient(2.0):.9f} at v/eps = 2: equal after "
            f"multiplying (3) by 2 exp(rho^2/2), {factor * as_printed:.9f}",
            abs(as_printed - contact_coefficient(2.0)) < 1e-6,
            "(3) as printed tends to exp(-rho^2/2)/2, not to 1: the normalisation is left to N",
            **solid_friction("(3), (37)"),
        ),
        Claim.number(
            "peak lies at v = pi eps/(2 rho), rho = 3/2: v/eps",
            exact_peak,
            found_peak,
            1e-4,
            **solid_friction("appendix A"),
        ),
        Claim.number(
            "height of the peak at rho = 3/2",
            printed_height,
            height,
            5e-6,
            reason="it takes the first asymptotic term at v/eps = 1.05, where that does not apply",
            **solid_friction("section 2 and appendix A"),
        ),
        Claim(
            "the peak's height does not depend on eps",
            "independent",
            ", ".join(f"{h:.5f}" for h in heights) + " at eps = 0.1, 0.01, 0.001",
            max(heights) - min(heights) < 1e-4,
            "differs between eps",
            **IDENTITY,
        ),
        Claim(
            "other envelopes and mixed phases have the same asymptotic form (2): sign(v) + O(eps/v)",
            "O(eps/v)",
            "|mu - 1| v/eps is at most "
            + ", ".join(f"{size:.2g} ({name})" for name, size in decay.items())
            + " for 8 < v/eps < 24",
            max(decay.values()) < 1,
            "it decays more slowly",
            **solid_friction("appendix A"),
        ),
        Claim(
            "other envelopes tend to a curve with peaks mu_s",
            "peak above 1",
            "heights " + ", ".join(f"{height:.5f} ({name})" for name, height in others.items()),
            min(others.values()) > 1.01,
            "one has none",
            **solid_friction("appendix A"),
        ),
        Claim(
            "mixed phases tend to a curve with peaks mu_s",
            "peak above 1",
            f"(r1, r2) = {', '.join(map(str, rates))}: cos cos "
            + ", ".join(f"{height:.4f}" for height in risen["cos"])
            + "; cos sin/k "
            + ", ".join(f"{height:.4f}" for height in risen["sin"]),
            min(map(min, risen.values())) > 1.01,
            "only fast phases do: the phase has to turn within the envelope. The peak of cos cos is 1 % high at r1 = "
            + edges,
            **solid_friction("appendix A"),
        ),
        Claim(
            "C_nm of (37): (-1)^n (2n-1)!! (2n+1)!/((2n+1-m)! m!)",
            "binom(2n+1, m)",
            f"binom(2n+m, m): at v/eps = {far:g} eight orders are then off by {remainder['expanded']:.1e} of "
            f"1 - mu, with the printed ones by {remainder['printed']:.1e}",
            remainder["printed"] <= remainder["expanded"],
            "1/(v/eps - i rho)^(2n+1) expands with binom(2n+m, m); the printed ones belong to a positive power",
            **solid_friction("(37)"),
        ),
        Claim(
            "(38): Lambda_eps = sign(v) - sum b_n/(i v/eps)^(2n), b_1 = sign(v)/2",
            "1 + eps^2/(2 v^2) + ...",
            f"1 - {-sigmoid_tail:.3f} eps^2/(2 v^2) at v/eps = 10",
            abs(sigmoid_tail - 1) < 0.05,
            "the sign of the sum is wrong: a sigmoid below 1 cannot have a tail above it",
            **solid_friction("(38)"),
        ),
    ]


WORDS = {
    "cos": r"$e^{-k^2/2}\cos k\,\cos\frac{3}{4}k$",
    "sin": r"$e^{-k^2/2}\cos k\,\sin(\frac{3}{4}k)/k$",
}
PHASES = {"cos": r"$\cos r_1k\,\cos r_2k$", "sin": r"$\cos r_1k\,\sin(r_2k)/k$"}


def draw(fast):
    """The four panels."""
    figure = new_figure(6.4, 7.0)
    (left, middle), (right, plane) = figure.subplots(2, 2)
    u = np.linspace(-6, 6, 1201)
    left.plot(u, contact_coefficient(u), color=COLOUR["exact"], label="exact integral")
    for side in (u[u < -0.3], u[u > 0.3]):
        label = "asymptotic, first term" if side[0] > 0 else None
        left.plot(side, first_term(side), ":", color=COLOUR["approximation"], linewidth=2, label=label)
    peak = math.pi / (2 * RHO)
    for sign in (1, -1):
        left.plot(sign * peak, sign * contact_coefficient(peak), "o", markersize=4, color=COLOUR["mark"])
    left.annotate(
        r"$\frac{\pi}{2\rho},\ \mu=1.486$",
        (peak, contact_coefficient(peak)),
        (2.0, 1.75),
        arrowprops=dict(arrowstyle="-", color=COLOUR["mark"], linewidth=0.8),
    )
    left.set(xlim=(-6, 6), ylim=(-2.1, 2.1), xlabel=r"$v/\varepsilon$", ylabel=r"$\mu$")
    left.set_title(r"(i) Gaussian envelope, $\rho=3/2$")
    below = dict(loc="upper center", bbox_to_anchor=(0.45, -0.24), handlelength=2.0, labelspacing=0.3)
    left.legend(**below)

    v = np.linspace(-1, 1, 4001)
    for eps, colour, dash in zip((0.2, 0.05, 0.005), ("#999999", "#666666", COLOUR["exact"]), (":", "--", "-")):
        middle.plot(
            v, contact_coefficient(v / eps), dash, color=colour, linewidth=1.1, label=rf"$\varepsilon={eps:g}$"
        )
    middle.set(xlim=(-1, 1), ylim=(-2.1, 2.1), xlabel=r"$v$", ylabel=r"$\mu$")
    middle.set_title(r"(ii) smaller $\varepsilon$: a step with spikes")
    middle.legend(loc="lower right", handlelength=1.6)

    half = np.linspace(0, 8, 81 if fast else 321)
    for (name, (integrand, whole)), dash in zip(ENVELOPES.items(), ("-", "--", "-.")):
        values = normalised_integral(integrand, whole, half)
        both = np.concatenate([-values[:0:-1], values])
        right.plot(
            np.concatenate([-half[:0:-1], half]), both, dash, color=COLOUR["exact"], linewidth=1.1, label=name
        )
    for kind, colour, dash in (("cos", COLOUR["left"], ":"), ("sin", COLOUR["right"], (0, (5, 1, 1, 1, 1, 1)))):
        u = np.linspace(-8, 8, 641)
        right.plot(
            u, mixed_phase(kind, MIXED, u), color=colour, linestyle=dash, linewidth=1.4, label=WORDS[kind]
        )
    right.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=0)
    right.set(
        xlim=(-8, 8),
        xticks=range(-8, 9, 4),
        ylim=(-2.1, 2.1),
        xlabel=r"$v/\varepsilon$",
        ylabel=r"$\mu$, normalised",
    )
    right.set_title("(iii) other envelopes and phases")
    right.legend(**below)

    r2 = np.linspace(0.1, 1.5, 8 if fast else 29)
    for kind, colour, mark in (("cos", COLOUR["left"], "s"), ("sin", COLOUR["right"], "^")):
        for height, dash in ((1.01, "-"), (1.1, "--")):
            edge = [border(kind, x, height) for x in r2]
            plane.plot(
                r2,
                edge,
                dash + mark,
                color=colour,
                markersize=4,
                markevery=max(1, len(r2) // 5),
                label=f"{PHASES[kind]}: height {height:g}",
            )
    plane.plot(MIXED[1], MIXED[0], "o", markersize=4, color=COLOUR["mark"], label="phases of (iii)")
    plane.set(xlabel=r"$r_2$", ylabel=r"$r_1$", xlim=(0, 1.5), ylim=(0, 3))
    plane.set_title("(iv) mixed phases that have a peak")
    plane.legend(**below)
    return figure, claims()
