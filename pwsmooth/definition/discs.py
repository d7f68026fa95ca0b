"""Vector surfaces: the multiplier of a `Disc` in the lowered model.

A disc of d surfaces is 1 + d multipliers. Its own, with the name of the disc, is 1 in slip and in stick, where it is
solved for, lambda . lambda: its bound is the friction circle. The components are those of lambda, in stick solved for,

    dh_i/dt (t, x, lambda) = 0,   i = 1..d

and in slip the direction h/|h|, as an expression of the state.
Chain: lifting.py -> discs (here) -> lowering.py, views.py.
"""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from .model import Held, Model, Multiplier
from .pointwise import draw, value

_POINTS, _BENT = 3, 1e-3


class LiftedDisc(NamedTuple):
    """A disc with its surfaces lifted, all symbols plain."""

    symbol: sp.Symbol  # lambda . lambda
    components: tuple[sp.Symbol, ...]
    surfaces: tuple[sp.Expr, ...]

    @property
    def square(self) -> sp.Expr:
        """|h|^2."""
        return sp.Add(*(h**2 for h in self.surfaces))

    def map(self, change):
        """With `change` applied to the surfaces."""
        return self._replace(surfaces=tuple(map(change, self.surfaces)))

    def direction(self) -> dict[sp.Symbol, sp.Expr]:
        """Component -> its value in slip."""
        size = sp.sqrt(self.square)
        return {lam: h / size for lam, h in zip(self.components, self.surfaces, strict=True)}

    def shown(self, e: sp.Expr) -> sp.Expr:
        """`e` with the direction of slip in the place of lambda, off h = 0; hidden terms vanish there identically."""
        if e.free_symbols.isdisjoint(self.components):
            return e
        direction = self.direction()
        if is_affine(e, self.components):
            return e.xreplace({lam: Held(self.symbol, n, lam) for lam, n in direction.items()})
        return Held(self.symbol, on_sphere(e, self.components).xreplace(direction), e)


def discs_of(model: Model) -> list[list[Multiplier]]:
    """The multipliers of each disc of a lowered model, its own and those of its components."""
    found: list[list[Multiplier]] = []
    for m in model.multipliers:
        if m.kind == "disc":
            found.append([m])
        elif m.kind == "component":
            found[-1].append(m)
    return found


def is_affine(e: sp.Expr, components) -> bool:
    """Whether `e` is affine in the components of one lambda."""
    left = []
    for i, lam in enumerate(components):
        slope = e.diff(lam)
        for other in components[i:]:
            bend = slope.diff(other)
            # A number that is not 0 answers at once, where nested polynomials take minutes.
            points = ({s: draw(s, k) for s in bend.free_symbols} for k in range(_POINTS))
            if any(abs(value(bend, point)) > _BENT for point in points):
                return False
            left.append(bend)
    return all(sp.expand(bend) == 0 for bend in left)


def on_sphere(e: sp.Expr, components) -> sp.Expr:
    """`e` with 1 for lambda . lambda, also within its functions."""
    if components[0] not in e.free_symbols:
        return e  # the sphere is divided out by its first component
    # To look is cheap, while `as_poly` multiplies out even what is none.
    if e.is_polynomial(*components) and (polynomial := e.as_poly(*components)) is not None:
        sphere = sp.Poly(sum(lam**2 for lam in components) - 1, *components)
        _, rest = sp.reduced(polynomial, [sphere])
        return rest.as_expr()
    return e.func(*(on_sphere(a, components) for a in e.args))


def hidden_part(e: sp.Expr, components) -> sp.Expr:
    """The part of `e` that acts on the surface alone, with the factor 1 - lambda . lambda; 0 if there is none."""
    if is_affine(e, components):
        return sp.S.Zero
    return sp.expand(e - on_sphere(e, components))


def convex(e: sp.Expr, disc: LiftedDisc) -> sp.Expr:
    """Filippov's combination of the fields around a disc, where these are affine in h/|h|."""
    outside = on_sphere(e, disc.components)
    if not is_affine(outside, disc.components):
        raise ValueError(
            f"`convention` is 'filippov', but around {disc.symbol} the field {e} has the values {outside}, not affine "
            "in its components: their convex hull is no disc. Take 'hidden', or a law that is affine in lambda."
        )
    return outside
