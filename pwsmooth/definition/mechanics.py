"""Mechanisms of sympy.physics.mechanics: their equations, and forces along velocities by virtual power.

    dq/dt = q'(t, q, u),     M(t, q) (du/dt, multipliers) = F(t, q, u) + sum over velocities v of f_v (dv/du)^T

    KanesMethod       speeds as they are named; of dependent ones (rolling, closed loops) M has the constraints as rows
    LagrangesMethod   speeds are named after the coordinates, theta_dot; multipliers of constraints are unknowns
    System            by either of them; joints by name

The mass matrix stays unsolved: accelerations are algebraic unknowns, solved for in numbers.

Source: T. R. Kane, D. A. Levinson, Dynamics: Theory and Applications (1985), for partial velocities.
Chain: notation.py -> **mechanics** -> system.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..door import checks
from .notation import rate_symbol, solved_rows
from .primitives import Unilateral

_SEED = 20  # of the place at which a mass matrix is looked at


@dataclass
class Mechanism:
    """Equations of motion in plain symbols, and what a force along a velocity adds to them."""

    time: sp.Symbol
    rates: dict[sp.Symbol, sp.Expr]  # of the coordinates
    speeds: list[sp.Symbol]
    dependent: int  # of the speeds, the last ones
    multipliers: list[sp.Symbol]
    M: sp.Matrix
    F: sp.Matrix
    constraints: tuple[sp.Expr, ...] = ()  # of coordinates and speeds: what is 0 on the motion, as its rate is

    def __post_init__(self) -> None:
        named = {str(q): e for q, e in self.rates.items()} | {str(u): u for u in self.speeds}
        self.velocities: dict[str, sp.Expr] = named
        self.positions: dict[sp.Expr, sp.Expr] = {e: q for q, e in self.rates.items()}

    def joint(self, name: str, speed: Any, coordinate: Any) -> None:
        """Make a joint known by its name."""
        v = self._plain(speed, f"the speed of {name}")
        self.velocities[name] = v
        self.positions[v] = self._plain(coordinate, f"the coordinate of {name}")

    def velocity(self, key: Any) -> tuple[str, sp.Expr]:
        """What a key of `friction` names: a label, and the velocity in terms of speeds."""
        if isinstance(key, str):
            if key not in self.velocities:
                raise ValueError(
                    f"`friction` names {checks.shown(key)}, no joint, coordinate or speed; there are "
                    f"{', '.join(self.velocities)}. Other velocities are given as expressions of speeds."
                )
            return key.replace(" ", "_"), self.velocities[key]
        v = self._plain(key, "`friction`")
        if not v.free_symbols & {*self.speeds}:
            raise ValueError(
                f"`friction` names {checks.shown(key)}, no velocity: none of the speeds {checks.listing(self.speeds)} "
                "stands in it."
            )
        return next((name for name, e in self.velocities.items() if e == v), ""), v

    def _plain(self, e: Any, what: str) -> sp.Expr:
        if isinstance(e, sp.Basic):
            e = e.xreplace({d: self.rates.get(checks.named(d.expr), d) for d in e.atoms(sp.Derivative)})
        return checks.expression(e, what)

    def rate(self, gap: sp.Expr) -> sp.Expr:
        """d(gap)/dt in terms of speeds."""
        return sp.Add(gap.diff(self.time), *(gap.diff(q) * e for q, e in self.rates.items()))

    def kept(self) -> tuple[sp.Expr, ...]:
        """The constraints, and of those of positions alone their rates too."""
        rates = [self.rate(e) for e in self.constraints if not e.free_symbols & {*self.speeds}]
        return *self.constraints, *rates

    def along(self, v: sp.Expr, force: sp.Expr) -> sp.Matrix:
        """What a force along a velocity adds to F: force times partial velocities."""
        n, p = len(self.speeds), len(self.speeds) - self.dependent
        partial = sp.Matrix([v.diff(u) for u in self.speeds])
        if self.dependent:
            # They move with the independent ones as the rows of the constraints say, and have no forces of their own.
            tied = -self.M[p:n, p:n].LUsolve(self.M[p:n, :p])
            partial = (partial[:p, :] + tied.T * partial[p:, :]).col_join(sp.zeros(n - p, 1))
        return (force * partial).col_join(sp.zeros(len(self.multipliers), 1))

    def solved(self, forcing: sp.Matrix) -> tuple[dict[sp.Symbol, sp.Expr], list[Any]]:
        """(rates, algebraic) of a System under all its forces."""
        y, unknowns = solved_rows(self.M, list(forcing), [*map(rate_symbol, self.speeds), *self.multipliers])
        return self.rates | dict(zip(self.speeds, y)), unknowns

    def check_inertia(self, parameters: Any) -> None:
        """ValueError where the matrix has no inverse, at a place of no meaning."""
        values = {str(key): checks.number(value, f"`parameters` of {key}") for key, value in parameters.items()}
        random = np.random.default_rng(_SEED)
        at = {s: values.get(str(s), random.uniform(0.2, 0.8)) for s in sorted(self.M.free_symbols, key=str)}
        rank = np.linalg.matrix_rank(np.array(self.M.evalf(subs=at).tolist(), dtype=float))
        if rank < self.M.rows:
            raise ValueError(
                f"`method` has a singular mass matrix, of rank {rank} for {self.M.rows} unknowns "
                f"({checks.listing([*self.speeds, *self.multipliers])}): something has no inertia, or a constraint "
                "stands there twice."
            )


def mechanism(method: Any) -> Mechanism:
    """The equations of a KanesMethod, a LagrangesMethod or a System of sympy.physics.mechanics."""
    from sympy.physics import mechanics

    if isinstance(method, mechanics.System):
        try:
            equations = method.eom_method or method.form_eoms() and method.eom_method
        except Exception as error:  # whatever sympy finds missing
            raise ValueError(f"`method` is a System whose equations cannot be formed: {error}") from error
        found = mechanism(equations)
        for joint in method.joints:
            if len(joint.speeds) == 1:
                found.joint(str(joint.name), joint.speeds[0], joint.coordinates[0])
        return found
    if not isinstance(method, (mechanics.KanesMethod, mechanics.LagrangesMethod)):
        raise TypeError(
            f"`method` is {checks.shown(method)}; give a KanesMethod, a LagrangesMethod or a System of "
            "sympy.physics.mechanics."
        )
    lagrange = isinstance(method, mechanics.LagrangesMethod)
    try:
        M, F = sp.Matrix(method.mass_matrix), sp.Matrix(method.forcing)
    except (ValueError, AttributeError):
        call = "form_lagranges_equations()" if lagrange else "kanes_equations(bodies, loads)"
        raise ValueError(f"`method` has no equations yet; call its {call} first.") from None
    dependent, multipliers, (time,) = 0, [], {q.args[0] for q in method.q}
    _check_constraints(method, lagrange)
    if lagrange:
        speeds = [sp.Symbol(f"{q.func.__name__}_dot", real=True) for q in method.q]
        rates = dict(zip(method.q, speeds))
        multipliers = list(map(checks.named, method.lam_vec)) if method.coneqs else []
        if multipliers:
            m = len(multipliers)
            M = M.col_join(sp.Matrix(method._m_cd).row_join(sp.zeros(m, m)))
            F = F.col_join(sp.Matrix(method._f_cd))
    else:
        kinematic, speeds, dependent = (
            method.kindiffdict(),
            list(map(checks.named, method.u)),
            len(method._udep),
        )
        rates = {q: kinematic[q.diff(time)] for q in method.q}
    there = {q.diff(time): e for q, e in rates.items()}
    M, F = ((A.xreplace(there)).applyfunc(lambda e: checks.expression(e, "`method`")) for A in (M, F))
    plain = {checks.named(q): checks.expression(e, "`method`") for q, e in rates.items()}
    if lagrange:
        kept = [*method._hol_coneqs, *method.coneqs[len(method._hol_coneqs) :]]
    else:
        kept = [*method._f_h, *(method._k_nh * sp.Matrix(method.u) + method._f_nh if dependent else ())]
    constraints = tuple(checks.expression(e.xreplace(there), "`method`") for e in map(sp.sympify, kept))
    return Mechanism(time, plain, speeds, dependent, multipliers, M, F, constraints)


def _check_constraints(method: Any, lagrange: bool) -> None:
    """ValueError for constraints that the equations of a method do not keep."""
    if lagrange:
        bent = [
            e
            for e, row in zip(method.coneqs, method.lam_coeffs.tolist())
            if any(c.has(*method.q.diff()) for c in row)
        ]
        if bent:
            raise ValueError(
                f"`method` has the constraint {bent[0]}, which is nonlinear in the velocities: of nonholonomic ones "
                "rolling, which is linear in them, is known alone."
            )
    elif len(method._qdep) > len(method._udep):
        raise ValueError(
            f"`method` closes {len(method._qdep)} loops by configuration_constraints and keeps {len(method._udep)} of "
            "them: Kane's equations know a loop by its velocity_constraints and dependent speeds; give these too, or "
            "LagrangesMethod with hol_coneqs, which have multipliers."
        )


def _components(found: Mechanism, key: Any) -> tuple[sp.Expr, ...]:
    """The velocities of a law in the plane or in space."""
    return tuple(found.velocity(part)[1] for part in key)


def arguments_of(
    found: Mechanism, friction: Any, contacts: Any, parameters: Any, outputs: Any, others: dict[str, Any]
) -> dict[str, Any]:
    """Arguments of a System: the mechanism under the forces of its laws and contacts, along their velocities."""
    values, shown, laws = (
        dict(checks.mapping({} if given is None else given, f"`{name}`"))
        for name, given in (("parameters", parameters), ("outputs", outputs), ("friction", friction))
    )
    shown = {name: found._plain(e, f"`outputs`, {name!r}") for name, e in shown.items()}
    # Their lengths stand in no equation of motion, and how far a run drifts from them is to be seen.
    shown |= {f"constraint {k}": e for k, e in enumerate(found.constraints, 1)}
    found.check_inertia(values)
    parts = {name: list(others.pop(name, ())) for name in ("events", "algebraic")}
    parts["contacts"] = list(checks.all_of_kind("contacts", contacts, Unilateral))
    forcing, rates = found.F, {}
    for contact in parts["contacts"]:
        forcing += found.along(found.rate(contact.gap), contact.reaction)
    for number, (key, law) in enumerate(laws.items(), 1):
        law, normal = law if isinstance(law, tuple) else (law, None)
        if not hasattr(law, "attach") or getattr(law, "kind", "") == "contact":
            raise TypeError(
                f"`friction` of {key} is {checks.shown(law)}; give a law of pwsmooth.laws.friction, or (law, load)."
            )
        own_name, v = ("", _components(found, key)) if isinstance(key, (tuple, list)) else found.velocity(key)
        name = own_name or (str(number) if len(laws) > 1 else "")
        pieces = law.attach(
            velocity=v, position=found.positions.get(v), normal=normal, time=found.time, name=name
        )
        label = f"friction {name}".strip()
        named = {label: (v, pieces.force)}
        if isinstance(v, tuple):
            named = {f"{label} {axis}": part for axis, part in zip("xyz", zip(v, pieces.force))}
        for part, force in named.values():
            forcing += found.along(part, -force)
        named = {label: force for label, (_, force) in named.items()} | dict(pieces.outputs)
        for mine, theirs in ((rates, pieces.rates), (values, pieces.parameters), (shown, named)):
            if common := {*map(str, mine)} & {*map(str, theirs)}:
                raise ValueError(
                    f"`friction` of {key} brings {', '.join(sorted(common))}, which the mechanism or another law has; "
                    "rename the mechanism's own, or give both laws of one velocity as one."
                )
            mine.update(theirs)
        for kind, items in parts.items():
            items += getattr(pieces, kind)
    own, unknowns = found.solved(forcing)
    parts["algebraic"] = [*unknowns, *parts["algebraic"]]
    return {"rates": own | rates, "time": found.time, "parameters": values, "outputs": shown, **parts, **others}
