"""Springs in series with sliders, in parallel: Maxwell-slip, in mechanics of materials Iwan's model.

    df_i/dt = kappa_i v  while |f_i| < L_i or f_i v < 0, else 0;      f = sum f_i

An element sticks or slips (a Memory): it slips where |f_i| reaches L_i, and sticks again where v vanishes.
Rate independent; Masing's rules hold: f - f_r = 2 Phi((x - x_r)/2) after a reversal, with the virgin curve
Phi(x) = sum min(kappa_i x, L_i); inner loops close and are forgotten (return-point memory). In the plane an element
gives way where |f_i| reaches L_i, and only the part of v along f_i slips, until f_i.v falls through zero:
df_i/dt = kappa_i (v - max(0, f_i.v) f_i/L_i^2) stays on that circle.
"""

import numpy as np
import sympy as sp

from ...definition.primitives import Event
from ..contract import Law, Pieces, law, parameter
from ..inclusions import clip


def slider(z, limit, slip, v, at):
    """(rate, events) of a spring of deflection z before a slider that gives way at |z| = limit.

    The Memory `slip` is 0 while it sticks, else the direction of slip, 1 or -1; in the plane 1.
    """
    # It sticks a few roundings inside: where v only touches zero the limit is reached again, from below.
    inside = limit * (1 - 2.0**-48)
    if at.planar:
        along, size = at.dot(z, v) / limit, at.dot(z, z) / limit**2
        yields = slip * sp.Max(0, along) / limit
        rate = at.each(lambda z, v: v - yields * z, z, v)
        return rate, (
            Event((1 - slip) * size - 1, direction=1, update={slip: 1, **at.rates(z, clip(z, limit))},
                  when=along >= 0, name=at.label("slip")),
            Event(along, update={slip: 0, **at.rates(z, clip(z, inside))}, when=sp.Ne(slip, 0), direction=-1,
                  name=at.label("stick")),
        )  # fmt: skip
    # In slip it yields outwards only: an amplitude that just reaches the limit may meet it a rounding after the
    # velocity has turned, when no end of the slip is left to be seen.
    rate = sp.Piecewise((v, sp.Eq(slip, 0)), (v * sp.Heaviside(-slip * v), True))
    # (z/limit)^2 - 1 in sticking. In slip |z| stays at the limit, where a surface that stayed zero would be met again
    # and again: there it is the other limit's.
    surface = (1 - slip**2) * (z / limit) ** 2 - slip * z / limit - 1
    return rate, (
        Event(surface, direction=1, update={slip: sp.sign(z), z: limit * sp.sign(z)}, when=z * v >= 0,
              name=at.label("slip")),
        Event(v, update={slip: 0, z: clip(z, inside)}, when=sp.Ne(slip, 0), name=at.label("stick")),
    )  # fmt: skip


@law
class MaxwellSlip(Law):
    """Maxwell-slip (Iwan) elements in parallel.

    The defaults are the multistate reference set's with constant strength F_s = 2 N.

    >>> law = MaxwellSlip(kappa=(2.0, 1.0), strength=(1.0, 1.5))
    >>> law.virgin_curve([0.0, 0.5, 1.0, 2.0]).tolist()
    [0.0, 1.5, 2.0, 2.5]
    >>> law.loss(1.0)
    2.0
    """

    kind = "friction"
    source = "Iwan, J. Appl. Mech. 33 (1966) 893-900; Lampaert, Swevers, Al-Bender; defaults chosen"
    in_plane = True
    kappa: tuple = parameter(tuple(2.5 / i for i in range(1, 11)), "N/um", "stiffness", each=True)
    strength: tuple = parameter((0.2,) * 10, "N", "strength of the slider", each=True)

    @classmethod
    def from_virgin_curve(cls, x, force):
        """Elements of a concave polygon through (0, 0) and the points (x, force), which ends flat.

        Parameters
        ----------
        x : array_like, shape (n,)
            Displacements in the length unit of kappa (um), increasing, > 0.
        force : array_like, shape (n,)
            Forces there in the unit of strength (N), increasing ever more slowly.

        Returns
        -------
        MaxwellSlip
            With one element for each point.

        Raises
        ------
        ValueError
            Displacements that do not increase; a polygon that is not concave.

        >>> MaxwellSlip.from_virgin_curve([0.5, 1.5], [1.5, 2.5])
        MaxwellSlip(kappa=(2.0, 1.0), strength=(1.0, 1.5))
        """
        x, force = (np.concatenate([[0.0], np.asarray(a, float)]) for a in (x, force))
        if not (np.diff(x) > 0).all():
            k = int(np.flatnonzero(np.diff(x) <= 0)[0])
            raise ValueError(
                f"`x` of from_virgin_curve must increase from 0; {x[k + 1]:g} follows {x[k]:g}. Sort the points."
            )
        slope = np.append(np.diff(force) / np.diff(x), 0.0)
        kappa = -np.diff(slope)
        if not (kappa > 0).all():
            shown = ", ".join(f"{s:g}" for s in slope)
            raise ValueError(
                f"`force` of from_virgin_curve has the slopes {shown}; each must be smaller than the one before, as of "
                "a concave curve that ends flat."
            )
        return cls(kappa=tuple(kappa), strength=tuple(kappa * x[1:]))

    def virgin_curve(self, x):
        """Force of the first loading, Phi(x) = sum min(kappa_i x, L_i).

        Parameters
        ----------
        x : array_like, shape (nx,)
            Displacement from the relaxed state in the length unit of kappa, >= 0.

        Returns
        -------
        ndarray, shape (nx,)
            Forces, in the unit of strength.
        """
        kappa, strength = np.broadcast_arrays(self.kappa, self.strength)
        return np.minimum(np.multiply.outer(np.asarray(x, float), kappa), strength).sum(axis=-1)

    def loss(self, amplitude):
        """Work of a closed cycle between -A and A: sum 4 L_i (A - L_i/kappa_i)+.

        Parameters
        ----------
        amplitude : float
            A, in the length unit of kappa.

        Returns
        -------
        float
            In the units of strength times length.
        """
        kappa, strength = np.broadcast_arrays(self.kappa, self.strength)
        return float(np.sum(4 * strength * np.maximum(amplitude - strength / kappa, 0)))

    def pieces(self, at, p):
        elements = at.family(self.elements)
        f = at.deflection("f", scale=max(self.strengths()), family=elements)
        slip = elements.memory(at.label("slip"), 0)
        drawn = at.each(lambda v: p.kappa * v, at.v)
        rate, events = slider(f, p.strength, slip, drawn, at)
        return Pieces(
            force=at.each(elements.sum, f),
            rates=at.rates(f, rate),
            events=events,
            outputs={"presliding": elements.sum(1 - slip**2)},
            surfaces=(at.dot(f, at.v) if at.planar else at.v, *at.bounds(f, p.strength)),
        )

    def steady(self, v, p):
        return float(self.strengths().sum()) * sp.sign(v)

    def strengths(self):
        """Strengths of the elements.

        Returns
        -------
        ndarray, shape (n,)
            L_i, in the unit of strength.
        """
        return np.broadcast_arrays(np.atleast_1d(self.kappa), self.strength)[1]


@law
class Masing(Law):
    """A spring beside one spring-slider: f = k x + k_0 w, with k_0 w kept in [-alpha, alpha].

    >>> law = Masing(k=1e4, k_0=1e5, alpha=1.0)
    >>> rig = prescribed_motion(law, position=3e-5 * sp.sin(t), t_span=(0, 7))
    >>> print(f"{rig.solve()['force'].max():.6f}")
    1.300000
    """

    kind = "friction"
    source = "Bastien, Michon, Manin, Dufour, J. Sound Vib. 302 (2007); details reconstructed"
    certainty = "reconstructed"
    needs = ("position",)
    k: float = parameter(1e4, "N/m", "stiffness of the spring", "nonnegative")
    k_0: float = parameter(1e5, "N/m", "stiffness before the slider")
    alpha: float = parameter(1.0, "N", "strength of the slider")

    def pieces(self, at, p):
        w, slip = at.state("w", scale=self.alpha / self.k_0), at.memory("slip", 0)
        rate, events = slider(w, p.alpha / p.k_0, slip, at.v, at)
        force = p.k * at.x + p.k_0 * w
        return Pieces(force=force, rates={w: rate}, events=events, surfaces=(at.v, sp.Abs(w) - p.alpha / p.k_0))
