"""Figure 2: the contact coefficient as an integral over oscillating forces, and its asymptotic form.

    mu(v) = c int_0^{v/eps} a(k) cos theta(k) dk,   c such that mu -> 1 as v -> inf     (eq. 3)

With a = exp(-k**2/2), theta = rho k: mu = Re erf((v/eps - i rho)/sqrt 2), since the integral tends to
exp(-rho**2/2) sqrt(pi/2) (the prefactor 1/sqrt(2 pi) of eq. 3 leaves exp(-rho**2/2)/2).
"""

import math

import numpy as np
from scipy.integrate import quad
from scipy.special import erf, wofz

from paper_figures.sources import IDENTITY, solid_friction
from pwsmooth.figures import Claim
from pwsmooth.plotting import COLOUR, new_figure

NAME = "2"
TITLE = "The contact coefficient of a continuum of oscillating forces"
CAPTION = """
(i) Exact integral for a Gaussian envelope and linear phase 3k/2 (full curve) and the first term of its
asymptotic form (dotted), which leaves the frame near v = 0. (ii) The same for smaller eps: a step whose
spikes keep their height. (iii) Other envelopes and a mixed phase named by the source, each tending to 1. Not
reproduced: the printed peak height, the coefficients C_nm of (37), the sign in (38), see the claims.
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
    r"$e^{-k^2/2}\cos k\,\cos\frac{3}{4}k$": (
        lambda k: np.exp(-k * k / 2) * np.cos(k) * np.cos(0.75 * k),
        math.sqrt(math.pi / 2) * (math.exp(-(1.75**2) / 2) + math.exp(-(0.25**2) / 2)) / 2,
    ),
}


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
    factor = 2 * math.exp(RHO**2 / 2) / math.sqrt(2 * math.pi)
    far = 12.0
    remainder = {
        name: abs(deficit_series(far, coefficient) / deficit(far) - 1)
        for name, coefficient in (("printed", printed_coefficient), ("expanded", expanded_coefficient))
    }
    sigmoid_tail = (1 - 10 / math.sqrt(101)) * 2 * 100
    heights = [contact_coefficient(np.linspace(0, 1, 200001) / eps).max() for eps in (0.1, 0.01, 0.001)]
    others = {}
    grid = np.linspace(0, 6, 61)
    plain = ("1/(1+k^2)", "sech^2 k", "cos k cos 3k/4")
    for name, (integrand, whole) in zip(plain, list(ENVELOPES.values())[1:]):
        others[name] = normalised_integral(integrand, whole, grid).max()
    return [
        Claim(
            "(3) equals Re Erf((v/eps - i rho)/sqrt 2), (37)",
            "equal",
            f"equal after multiplying (3) by 2 exp(rho^2/2) (at v/eps = 2: {factor * by_quadrature:.9f} and "
            f"{contact_coefficient(2.0):.9f})",
            False,
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
            "other envelopes and mixed phases tend to the same kind of curve, with a peak",
            "peak above 1",
            "heights " + ", ".join(f"{height:.3f} ({name})" for name, height in others.items()),
            min(others.values()) > 1.01,
            "a mixed phase this slow leaves no peak: the phase has to turn within the envelope",
            **solid_friction("appendix A"),
        ),
        Claim(
            "C_nm of (37): (-1)^n (2n-1)!! (2n+1)!/((2n+1-m)! m!)",
            "binom(2n+1, m)",
            f"binom(2n+m, m): at v/eps = {far:g} eight orders are then off by {remainder['expanded']:.1e} of "
            f"1 - mu, with the printed ones by {remainder['printed']:.1e}",
            False,
            "1/(v/eps - i rho)^(2n+1) expands with binom(2n+m, m); the printed ones belong to a positive power",
            **solid_friction("(37)"),
        ),
        Claim(
            "(38): Lambda_eps = sign(v) - sum b_n/(i v/eps)^(2n), b_1 = sign(v)/2",
            "1 + eps^2/(2 v^2) + ...",
            f"1 - {sigmoid_tail:.3f} eps^2/(2 v^2) at v/eps = 10",
            False,
            "the sign of the sum is wrong: a sigmoid below 1 cannot have a tail above it",
            **solid_friction("(38)"),
        ),
    ]


def draw(fast):
    """The three panels."""
    figure = new_figure(9.6, 3.2)
    left, middle, right = figure.subplots(1, 3)
    u = np.linspace(-6, 6, 1201)
    left.plot(u, contact_coefficient(u), color=COLOUR["exact"], label="exact integral")
    for side in (u[u < -0.3], u[u > 0.3]):
        label = "asymptotic,\nfirst term" if side[0] > 0 else None
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
    left.legend(loc="upper left", handlelength=1.6, borderaxespad=0)

    v = np.linspace(-1, 1, 4001)
    for eps, colour in zip((0.2, 0.05, 0.005), ("#BDBDBD", "#7F7F7F", COLOUR["exact"])):
        middle.plot(
            v, contact_coefficient(v / eps), color=colour, linewidth=1.1, label=rf"$\varepsilon={eps:g}$"
        )
    middle.set(xlim=(-1, 1), ylim=(-2.1, 2.1), xlabel=r"$v$", ylabel=r"$\mu$")
    middle.set_title(r"(ii) smaller $\varepsilon$: a step with spikes")
    middle.legend(loc="lower right", handlelength=1.6)

    half = np.linspace(0, 8, 81 if fast else 321)
    for (name, (integrand, whole)), dash in zip(ENVELOPES.items(), ("-", "--", "-.", ":")):
        values = normalised_integral(integrand, whole, half)
        both = np.concatenate([-values[:0:-1], values])
        right.plot(
            np.concatenate([-half[:0:-1], half]), both, dash, color=COLOUR["exact"], linewidth=1.1, label=name
        )
    right.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=0)
    right.set(xlim=(-8, 8), ylim=(-1.9, 2.6), xlabel=r"$v/\varepsilon$", ylabel=r"$\mu$, normalised")
    right.set_title("(iii) other envelopes and phases")
    right.legend(loc="upper left", handlelength=2.0, fontsize=7, borderaxespad=0)
    return figure, claims()
