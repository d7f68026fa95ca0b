"""Periodic orbits that begin at a Hopf point of a branch of equilibria.

    x(t) = x0 + a Re(q exp(i w t)),   A q = i w q;   section Im <p, x - x0> = 0, rising,   A' p = -i w p

Across the section the linear motion is fastest, and the amplitude a along Re q is held while Newton's method finds the
parameter, as behind a flip (continuation.branch_off). Where other directions grow much within a turn, the orbit is shot
over in segments, which begin along the ellipse.

Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the eigenvectors as predictor.
Chain: special.py, orbit_problem.py -> **hopf**.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from ....door import calls, checks
from ...equilibria.equilibrium import Equilibrium
from ...maps.scales import Scale, units_at
from ...maps.sections import Section, poincare_map
from ...maps.seen import Return
from ...maps.segments import TOO_LONG, Segments
from ...orbits.periodic_orbit import PeriodicOrbit, none_found
from ..orbit_problem import OrbitProblem, in_units, leaves
from ..special import Special

__all__ = ["cycle_from"]

_GROWTH = 1e2  # of deviations in a segment
_TURNS = 0.2  # of the linear motion's period: the shortest that a cycle near by may take
_SMALLEST = 0.5  # of the predicted distance from the equilibrium: what comes nearer is the equilibrium itself


@checks.door(
    calls.RUNS,
    hopf=checks.instance(Special, "one of the `specials` of a branch of equilibria"),
    amplitude=checks.positive, seen=checks.optional(checks.instance(Return, "Return(section)")),
)  # fmt: skip
def cycle_from(
    hopf: Special,
    amplitude: float = 1e-2,
    *,
    seen: Return | None = None,
    **options: Any,
) -> PeriodicOrbit:
    """A periodic orbit near a Hopf point, of the system or of its flow on a sliding surface.

    Parameters
    ----------
    hopf : Special
        Of kind "Hopf" or "sliding Hopf".
    amplitude : float, in the units of the states
        Of the orbit, along the critical eigenvector of length 1; the parameter follows from it.
    seen : Return, optional
        To a surface through the equilibrium that the orbit crosses; by default a plane.

    Returns
    -------
    PeriodicOrbit
        At its own parameter value, which `follow` continues and `refine` accepts; `success` False if none was found.

    Raises
    ------
    ValueError, TypeError
        Another kind of bifurcation; a section that the system cannot return to.

    Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the predictor.

    >>> x, y, a = sp.symbols("x y a", real=True)
    >>> r2 = x**2 + y**2  # the cycle has the radius sqrt(a)
    >>> ring = System({x: a * x - y - x * r2, y: x + a * y - y * r2}, parameters={a: -0.5})
    >>> (hopf,) = follow(find_equilibrium(ring, {x: 0, y: 0}), {a: 0.5}).specials
    >>> cycle = cycle_from(hopf, 0.2)
    >>> cycle.success, round(cycle.system.parameters[a], 9), round(float(abs(cycle.x).max()) ** 2, 9)
    (True, 0.02, 0.02)
    """
    if hopf.kind not in ("Hopf", "sliding Hopf"):
        raise ValueError(f"`hopf` is a {hopf.kind}; cycles begin at a Hopf or a sliding Hopf point.")
    e = hopf.point
    if not isinstance(e, Equilibrium):
        raise ValueError(
            f"`hopf` is a {hopf.kind} of no equilibrium; give one of a branch of equilibria, or of a diagram that was "
            "not read from a file."
        )
    ((name, at),) = hopf.values.items()
    system, linear = e.system, e.linear
    own = len(e.x) - system.model.n_memory
    mu, vectors = np.linalg.eig(linear.matrix)
    critical = int(np.argmin(np.abs(mu - 1j * hopf.frequency)))
    left = np.linalg.inv(vectors)[critical]  # <p, .>: <p, q> = 1
    q = linear.along @ vectors[:, critical]
    turn = np.exp(-0.5j * np.angle(q @ q))  # Re q and Im q are orthogonal then, Re q the longer one
    q, p = q * turn / np.linalg.norm(q), np.linalg.norm(q) / turn * (left @ linear.along.T)
    if seen is None:
        plane = (float(c) * (s - float(x)) for c, s, x in zip(p.imag, system.model.states, e.x))
        seen = Return(sp.Add(*plane))
    map_ = poincare_map(system, seen, options)
    assert isinstance(map_, Section)
    # A cycle is small against the states where it begins: its own size is their unit.
    unit = units_at(np.append(amplitude * np.abs(q), np.zeros(len(e.x) - own)))
    map_ = map_._with(scale=Scale(tuple(unit.tolist()), tuple(unit.tolist())))
    h = map_.gradient(e.x)[:own]
    # On the section, and where its function rises: h . Re(q exp(i phase)) = 0, d/dt of it > 0.
    phase = np.pi / 2 - np.angle(h @ q) if abs(h @ q) > 0 else 0.0
    phase += np.pi if (seen.direction * (h @ (1j * q * np.exp(1j * phase))).real) < 0 else 0.0
    period = 2 * np.pi / hopf.frequency
    grown = max(float(mu.real.max()), 0.0) * period
    number = max(1, math.ceil(grown / math.log(_GROWTH))) if grown > math.log(TOO_LONG) else 1
    times = period * np.arange(number) / number
    ahead = np.zeros((number, len(e.x)))
    ahead[:, :own] = (q * np.exp(1j * (phase + hopf.frequency * times))[:, None]).real
    nothing = np.full((number, len(e.x), len(e.x)), np.nan)
    pieces = Segments((tuple(times[1:].tolist()),), np.tile(e.x, (number, 1)), nothing, False, False)
    first = PeriodicOrbit(
        map_, e.x, 0.0, nothing[0], (), 0.0, 0, True, "", segments=pieces if number > 1 else None
    )
    problem = OrbitProblem(first, name, 1.0, unit)
    normal = np.append(ahead.ravel() / np.linalg.norm(ahead), 0.0)
    begun = np.append(np.tile(e.x, number), at) / problem.sizes
    guess = begun + np.append(amplitude * ahead.ravel(), 0.0) / problem.sizes
    point = problem.correct(guess, normal, normal)
    lost = "give another `amplitude`, a smaller one as a rule, or a section in `seen` that the cycle crosses."
    if point is None:
        return none_found(map_, e.x, f"no orbit was found at this distance from the Hopf point: {lost}")
    orbit = in_units(point.orbit, np.append(e.unit, np.ones(len(e.x) - own)))
    if np.linalg.norm(orbit.x - e.x) < _SMALLEST * amplitude * np.linalg.norm(ahead[0]):
        return none_found(map_, e.x, f"no orbit was found but the equilibrium itself: {lost}")
    if (
        leaves(problem, begun, hopf.uncertainty, point, normal) is None
        or not _TURNS < orbit.period / period < 1 / _TURNS
    ):
        return none_found(map_, e.x, f"found was an orbit that does not come from the Hopf point: {lost}")
    return orbit
