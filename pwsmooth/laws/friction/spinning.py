"""Friction of a contact that slides and spins: force and moment share one bound (Contensou 1963, Erismann 1954).

    (F_x, F_y, M) = integral over the contact of mu p (v + omega x r)/|v + omega x r|,    velocity = (v_x, v_y, omega)

With lambda of h = (v_x, v_y, R omega), A = lambda_x^2 + lambda_y^2 = a^2 and B = lambda_z^2 = b^2, A + B = 1 in slip,
F = F_c phi(B) (lambda_x, lambda_y) and M = F_c R psi(B) lambda_z. phi and psi are complete elliptic integrals of A/B or
of B/A (Farkas, Bartels, Unger, Wolf, PRL 90, 2003, 248302); here both come from one arithmetic-geometric mean:

    w = min(A, B),   I = pi/(2 agm(max(a, b), sqrt(|A - B|))),   J = I (1 - w - T)
    T = sum_{n>=2} 2^(n-1) c_n^2,   c_1^2 = w,   c_{n+1} = c_n^2/(4 a_{n+1})
    disc   F = 2/(3 pi a B) (J - (A - B)^2 I),    M = 4/(9 pi b B) ((A - B)^2 I + (2 B - A) J)
    ring   F = (J + (A - B) I)/(pi a),            M = (J + (B - A) I)/(pi b)

Where a ring rubs by tilt |F|/F_c more in front than behind, F also has tilt lambda_z X times itself across the slide:

    X = <W cos^2/|v + omega x r|>/W = 2/3 (I' - S),  I' = 2 I/pi = <1/|.|>,  S = (I' - M/b)/(2 A) = (I' - F/a)/(2 B)

They are analytic but for e = A - B = 0, where the centre of rotation crosses the rim. What the equations get is

    P(e) + e^2 Q(e) log(e^2 + delta^2)/2,  of F and M of the ring e Q(e) in the place of e^2 Q(e),

with polynomials P and Q fitted to these values when the law is first used. As the singularity has this form they
converge like a series: measured against elliptic integrals, 1e-12 F_c of the disc and 1e-8 F_c of the ring, of which
delta, the width that lets steps through e = 0, makes the second. In stick lambda is inside its ball and (F, M) inside
the limit surface: at every lambda_z the force grows with |(lambda_x, lambda_y)| up to it, and delta^2 has a share of
(1 - lambda.lambda)^2. The ellipsoid that is often taken for that surface is beside it, `LimitEllipsoid`.
"""

import functools

import numpy as np
import sympy as sp

from ...definition.primitives import Disc
from ..contract import Law, Pieces, law, parameter

_DEGREES = 18, 14  # of P and Q: four more change nothing
_DELTA = 1e-7
_INSIDE = 1e-3  # of (1 - lambda.lambda)^2 in the logarithm: more would fold the map of the ball


def exact_factors(shape, e):
    """phi and psi at e = A - B, of what is "across" X; shape (n,) each, without cancellation; e is not 0."""
    A, B = (1 + e) / 2, (1 - e) / 2
    w, most = np.minimum(A, B), np.maximum(A, B)
    a, b = np.sqrt(most), np.sqrt(np.abs(e))
    rest, weight, total = 1.0, 1.0, 0.0  # c_n^2/w; total is T/w^2
    for _ in range(8):
        ratio, weight = rest / (2 * (a + b)), 2 * weight
        total = total + weight * ratio**2
        rest = w * ratio**2
        a, b = (a + b) / 2, np.sqrt(a * b)
    mean = np.pi / (2 * a)
    # w/A and w/B are B/most and A/most; what cancels at A = 0 or at B = 0 is gone by hand.
    if shape != "disc":
        phi, psi = (
            mean / np.pi * (1 + np.maximum(0, 1 - other / one) - total * w * other / most)
            for one, other in ((A, B), (B, A))
        )
        if shape == "ring":
            return phi, psi
        inverse = 2 * mean / np.pi
        return (2 / 3 * (inverse - (inverse - np.where(A > B, psi, phi)) / (2 * most)),)
    phi = 2 * mean / (3 * np.pi) * (3 - w / most * (1 + total))
    turned = np.where(B > A, (2 * B - A) * (B - A) / B**2, 0)
    psi = 4 * mean / (9 * np.pi) * (1 + (A - 2 * B) * total * (A / most) ** 2 + turned)
    return phi, psi


def _power(shape):
    """Of e beside the logarithm."""
    return 1 if shape == "ring" else 2


@functools.cache
def _fitted(shape):
    """The coefficients of P and Q, of each factor."""
    near = np.concatenate(
        [0.5 * (1 - np.cos(np.pi * (np.arange(150) + 0.5) / 150)), 10.0 ** -np.linspace(0.5, 7, 80)]
    )
    e = np.concatenate([-near, near])
    power = _power(shape)
    columns = [np.vander(e, _DEGREES[0] + 1, increasing=True),
               np.vander(e, _DEGREES[1] + 1, increasing=True) * (e**power * np.log(np.abs(e)))[:, None]]  # fmt: skip
    both = np.linalg.lstsq(np.hstack(columns), np.transpose(exact_factors(shape, e)), rcond=None)[0]
    return [(c[: _DEGREES[0] + 1].tolist(), c[_DEGREES[0] + 1 :].tolist()) for c in both.T]


def factors(shape, B, square=1):
    """The factors of exact_factors, of B = lambda_z^2 and of lambda.lambda, as expressions."""
    e = 1 - 2 * B
    singular = e ** _power(shape) * sp.log(e**2 + _DELTA**2 + _INSIDE * (1 - square) ** 2) / 2

    def polynomial(coefficients):
        # By powers, which all four share: the Taylor series of a power is a product, that of a sum is none.
        return sp.Add(*(c * e**k for k, c in enumerate(coefficients)))

    return tuple(polynomial(P) + singular * polynomial(Q) for P, Q in _fitted(shape))


class SpinningLaw(Law):
    """A law of a flat contact that slides and spins; steady without the spin, it is Coulomb's."""

    kind = "friction"
    in_plane = spins = True

    def steady(self, v, p):
        return p.F_c * sp.sign(v)


@law
class Contensou(SpinningLaw):
    """Coulomb friction of a flat contact that slides and spins, exactly: Contensou's force and moment.

    A spin weakens the friction against the slide, and a slide that against the spin. At the velocity (v_x, v_y, omega)
    of the centre the force is (F_x, F_y, M): two forces and a moment. Without a spin |F| = F_c; without a slide |M| is
    2/3 F_c R of a disc under uniform pressure and F_c R of a ring.

    Slides, spins and their stops are followed to the last digits. A rest under a load that changes is not yet: such a
    run may end as singular or not finite, with what came before; `LimitEllipsoid` follows it.

    A ring that its own friction presses down in front, at the height h of its centre of mass, rubs more there: by
    2 mu h/R, its `tilt`. Then the force is not against the slide, and the path bends: with a spin to the left to the
    right, as a glass on a table does. A curling stone, which melts the ice where it presses, rubs less in front, and
    bends to the left.

    A disc (of mass 1, F_c = R = 1) that slides and spins stops both at once:

    >>> v_x, v_y, spin = sp.symbols("v_x v_y spin", real=True)
    >>> contact = Contensou(F_c=1.0, R=1.0).attach(velocity=(v_x, v_y, spin))
    >>> F_x, F_y, M = contact.force
    >>> disc = System({v_x: -F_x, v_y: -F_y, spin: -2 * M}, parameters=contact.parameters)
    >>> thrown = solve(disc, (0, 2), {v_x: 1, v_y: 0, spin: 0.25})
    >>> print(thrown.itinerary[-1], f"{thrown.events[-1].time:.9f}")
    stick (lam sliding) 1.040528902
    """

    source = (
        "Contensou 1963; closed form of Farkas, Bartels, Unger, Wolf, PRL 90 (2003) 248302; derived here as means, "
        "with the tilt, whose sign on ice is that of Penner, Am. J. Phys. 69 (2001) 332"
    )
    F_c: float = parameter(1.0, "N", "Coulomb force")
    R: float = parameter(1.0, "m", "radius of the contact")
    shape: str = parameter(
        "disc", "1", "Where the pressure is: all over a disc, or on its rim", choices=("disc", "ring")
    )
    tilt: float = parameter(
        0.0,
        "1",
        "by how much more a ring rubs in front than on its sides, over |F|/F_c",
        "real",
        structural=True,
    )

    def check(self):
        if self.tilt and self.shape != "ring":
            raise ValueError(
                f"`tilt` = {self.tilt!r} is that of a ring; give shape='ring', or tilt=0 for a disc."
            )
        if abs(self.tilt) > 1:
            raise ValueError(
                f"`tilt` = {self.tilt!r} would press less than nothing in front or behind; give one between -1 and 1."
            )

    def pieces(self, at, p):
        first, second, spin = at.v
        surfaces = (first, second, p.R * spin)
        lam = Disc(at.label("lam"), surfaces)
        phi, psi = factors(self.shape, lam[2] ** 2, lam.square)
        along = lam[0], lam[1]
        if self.tilt:
            (across,) = factors("across", lam[2] ** 2, lam.square)
            bend = self.tilt * across * lam[2]
            along = lam[0] - bend * lam[1], lam[1] + bend * lam[0]
        force = *(p.F_c * phi * part for part in along), p.F_c * p.R * psi * lam[2]
        return Pieces(force=force, surfaces=surfaces)


@law
class LimitEllipsoid(SpinningLaw):
    """Friction of a contact that slides and spins, with an ellipsoid for the limit surface of force and moment.

    (|F|/F_c)^2 + (M/(k F_c R))^2 = 1, and the motion is its normal (the most dissipation): h = (v_x, v_y, k R omega),
    force F_c (lambda_x, lambda_y) and moment k F_c R lambda_z. It meets Contensou's surface in pure slide and pure spin
    and is within 7 percent of it between for a disc (k = 2/3), but the end of a motion is another: the slide of a
    spinning disc with I = m R^2/2 dies out before the spin, where in truth the two stop together.

    Examples
    --------
    The disc of `Contensou`: at the end it spins only.

    >>> v_x, v_y, spin = sp.symbols("v_x v_y spin", real=True)
    >>> contact = LimitEllipsoid(F_c=1.0, R=1.0).attach(velocity=(v_x, v_y, spin))
    >>> F_x, F_y, M = contact.force
    >>> disc = System({v_x: -F_x, v_y: -F_y, spin: -2 * M}, parameters=contact.parameters)
    >>> thrown = solve(disc, (0, 2), {v_x: 1, v_y: 0, spin: 0.25}, dense_output=True)
    >>> end = thrown.events[-1].time
    >>> [round(float(thrown(end - d, "v_x") / thrown(end - d, "spin")), 2) for d in (1e-2, 1e-8)]
    [2.39, 0.48]
    """

    source = "Howe, Cutkosky, Int. J. Robotics Research 15 (1996) 557; k = 2/3 of a disc under uniform pressure"
    F_c: float = parameter(1.0, "N", "Coulomb force")
    R: float = parameter(1.0, "m", "radius of the contact")
    k: float = parameter(2 / 3, "1", "moment of a pure spin over F_c R")

    def pieces(self, at, p):
        first, second, spin = at.v
        surfaces = (first, second, p.k * p.R * spin)
        lam = Disc(at.label("lam"), surfaces)
        return Pieces(force=(p.F_c * lam[0], p.F_c * lam[1], p.k * p.R * p.F_c * lam[2]), surfaces=surfaces)
