"""Branches of equilibria over a parameter, through the surfaces on which their mode changes.

    F(u) = (f, h_J) = 0,   tau . (u - u0) = ds,   u = (x, lam_J, q),   each in a unit of its own   (H. B. Keller, 1977)

On the way test functions are zeroed: tau_q (fold), det [DF; tau'] (branch point), the product of mu_i + mu_j (Hopf),
det L of the layer (fold of a hidden branch; with a linear switch a two-fold), and how far the point is inside its mode.
Where that ends, a boundary equilibrium, the branch goes on in the mode beside: a regular equilibrium becomes a
pseudo-equilibrium, a contact closes. If the parameter goes on as well, that is *persistence*, and a *nonsmooth fold* if
it turns back: then both exist on one side. With N = f_x of the regular side, C = h_x and E what the field adds beyond
the surface, the sign of C N**-1 E tells them apart (positive: fold); that of tau_q on both sides says the same.

Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, ch. 5, for boundary
equilibria; Kuznetsov, Elements of Applied Bifurcation Theory, for the smooth ones.
Chain: equilibria.py, equilibrium_stability.py -> **equilibrium_branches** -> hopf.py, continuation.py.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.pointwise import value
from ..definition.regularity import total_derivative
from .boundary_cycles import cycle_born
from .branch import _Along
from .equilibria import RANK, ROUNDING, Equilibrium, Statics, made
from .equilibrium_stability import lyapunov_coefficient

__all__ = ["EquilibriumBifurcation", "EquilibriumBranch"]

_MOST_NEWTON = 10
_STRAIGHT = 0.95  # least cosine between tangents of neighbours
_STEP = 1e-11  # of a Newton step, relative, after which a point is converged
_MOST_MODES = 50  # of a branch: changes of mode


@dataclass(frozen=True)
class EquilibriumBifurcation:
    """A point of a branch of equilibria at which their number, stability or mode changes.

    Attributes
    ----------
    kind : str
        "fold", "branch point", "Hopf", "sliding Hopf" (of the flow on a sliding surface), "hidden fold" (dg/dlambda = 0
        of a hidden term), "pseudo-Hopf" (of a planar switch whose two folds meet, both invisible), "two-fold" (other
        ones), "layer Hopf" (of several multipliers in their layer), "boundary equilibrium: persistence", "boundary
        equilibrium: nonsmooth fold", "boundary equilibrium" (where what lies beyond is no single branch), "end of the
        set" (of a set of equilibria, followed along a state), "surface of an event".
    name : str
        The parameter's.
    parameter : float, in the unit of the parameter
        Its value.
    uncertainty : float, in the unit of the parameter
        To which it is known.
    equilibrium : Equilibrium
        At the bifurcation.
    beyond : Equilibrium or None
        The same point in the mode in which the branch goes on.
    what : str
        Which surface, and what it changes into, in words.
    frequency : float, in radians per unit of time
        Of a Hopf point; nan for others.
    lyapunov : float or None
        First Lyapunov coefficient of a Hopf point of a smooth mode, in the units of the states: negative where the
        cycles are stable in their plane. None where it is not computed (on a sliding surface).
    cycle : str or None
        Of a boundary equilibrium: "attracting" or "repelling" where a cycle around a focus is born too, which slides on
        the surface; "" where none is. None where that is not decided: it is for two states and one switch without
        hidden terms.

    Notes
    -----
    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008; Kuznetsov, Elements of
    Applied Bifurcation Theory, for fold and Hopf points.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, find_equilibrium, follow
    >>> x, a = sp.symbols("x a", real=True)
    >>> branch = follow(find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1}), a, to=-1)
    >>> print(branch.bifurcations[0].kind, f"{abs(branch.bifurcations[0].parameter):.9f}")
    fold 0.000000000
    """

    kind: str
    name: str
    parameter: float
    uncertainty: float
    equilibrium: Equilibrium
    beyond: Equilibrium | None = None
    what: str = ""
    frequency: float = math.nan
    lyapunov: float | None = None
    cycle: str | None = None

    def __str__(self) -> str:
        at = 0.0 if abs(self.parameter) < self.uncertainty else self.parameter
        kind = f"virtual {self.kind}" if self.equilibrium.virtual else self.kind
        text = f"{kind} at {self.name} = {at:.10g} (+- {self.uncertainty:.1g})"
        if math.isfinite(self.frequency):
            text += f", frequency {self.frequency:.9g}"
        if self.lyapunov is not None:
            criticality = "super" if self.lyapunov < 0 else "sub"
            text += f", first Lyapunov coefficient {self.lyapunov:.6g} ({criticality}critical)"
        if self.cycle is not None:
            text += (
                f", with {'an' if self.cycle[0] == 'a' else 'a'} {self.cycle} cycle"
                if self.cycle
                else ", without a cycle"
            )
        return f"{text}\n    {self.what}" if self.what else text


@dataclass(repr=False)
class EquilibriumBranch(_Along):
    """Equilibria along a parameter.

    Attributes
    ----------
    parameter : str
        Its name; of a set of equilibria followed along a state, the state's.
    equilibria : list of Equilibrium
        In the order in which they were found.
    bifurcations : list of EquilibriumBifurcation
        In the order in which they were found.
    end : str
        Why it ended, in words.

    Notes
    -----
    Source: Keller's arclength continuation (1977); di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical
    Systems, 2008, for what happens at surfaces.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, find_equilibrium, follow
    >>> x, a = sp.symbols("x a", real=True)
    >>> relay = System({x: a - sp.sign(x) - x}, parameters={a: 0})
    >>> branch = follow(find_equilibrium(relay, {x: 0.3}), a, to=2)
    >>> [b.kind for b in branch.bifurcations], branch.end
    (['boundary equilibrium: persistence'], 'reached a = 2.')
    """

    parameter: str
    equilibria: list[Equilibrium] = field(default_factory=list)
    bifurcations: list[EquilibriumBifurcation] = field(default_factory=list)
    end: str = ""

    _noun = "equilibria"

    @property
    def _points(self) -> list[Any]:
        return self.equilibria

    @staticmethod
    def _at(bifurcation: Any) -> Any:
        return bifurcation.equilibrium

    @property
    def values(self) -> np.ndarray:
        """The parameter along the branch, shape (number of equilibria,), in its unit."""
        names = [str(s) for s in self.equilibria[0].system.states]
        if self.parameter in names:
            return self.x[names.index(self.parameter)]
        return super().values

    @property
    def virtual(self) -> np.ndarray:
        """Whether each equilibrium is virtual."""
        return np.array([bool(e.virtual) for e in self.equilibria])

    @property
    def mult(self) -> np.ndarray:
        """Multipliers, shape (m, number of equilibria); those of switches dimensionless."""
        return np.array([e.mult for e in self.equilibria]).T

    def _drawn(self, point: Any) -> tuple[tuple[Any, ...], str]:
        model = point.system.model
        return (*model.states, *(mu.symbol for mu in model.multipliers)), "state or multiplier"

    def _row(self, point: Any) -> np.ndarray:
        return np.concatenate([point.x, point.mult])

    def _columns(self) -> dict[str, Any]:
        names = [str(mu.symbol) for mu in self.equilibria[0].system.model.multipliers]
        return {
            "stable": self.stable,
            **dict(zip(names, self.mult)),
            "stability": [e.stability for e in self.equilibria],
            "virtual": self.virtual,
            "rightmost_eigenvalue": [e.eigenvalues.real.max(initial=-math.inf) for e in self.equilibria],
        }


# ---- one mode


@dataclass(frozen=True)
class _Point:
    """u (N,) in units of the walk, the unit tangent, the equilibrium there, Newton's steps, margins of the mode."""

    u: np.ndarray
    tangent: np.ndarray
    DF: np.ndarray
    equilibrium: Equilibrium
    steps: int
    margins: np.ndarray
    on: np.ndarray  # sizes of the margins that count as nothing
    slopes: np.ndarray  # of the margins along the tangent


class _Walk:
    """Predictor and corrector in one mode, over a parameter or, along a set of equilibria, a state."""

    def __init__(self, e: Equilibrium, name: str, scale: float) -> None:
        self.system, self.name = e.system, name
        own = len(e.x) - e.system.model.n_memory
        q = next((p for p in e.system.parameters if p.name == name), None)
        self.q = q
        self.statics = Statics(e.system, e.sides, e.x[own:], q)
        states = [str(s) for s in e.system.model.states]
        self.place = self.statics.size if q is not None else states.index(name)
        u = np.concatenate([e.x[:own], e.mult[self.statics.J]])
        self.unit = 1 + np.abs(u)
        if q is not None:
            u, self.unit = np.append(u, e.system.parameters[q]), np.append(self.unit, scale)
        else:
            self.unit[self.place] = scale
        self.first = u / self.unit

    def value(self, point: _Point) -> float:
        return float(point.u[self.place] * self.unit[self.place])

    def equations(self, u: np.ndarray) -> tuple[Any, ...] | None:
        """The system, F, DF in units of the walk, and the error; None where q is not allowed or nothing is defined."""
        at = u * self.unit
        system = self.system
        if self.q is not None:
            try:
                system = system.with_parameters({self.q: float(at[-1])})
            except ValueError:  # outside the assumptions of the parameter
                return None
        F, DF = self.statics(at[None])
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return None
        return system, F[0], DF[0] * self.unit, float(self.statics.error(F, DF, at[None])[0])

    def point(self, u: np.ndarray, direction: np.ndarray, steps: int = 0) -> _Point | None:
        """The point at a solution, its tangent along `direction`."""
        equations = self.equations(u)
        if equations is None:
            return None
        system, _, DF, error = equations
        sizes = np.abs(DF).max(axis=1, keepdims=True)
        tangent = np.linalg.svd(DF / np.where(sizes > 0, sizes, 1.0))[2][-1]
        if tangent @ direction < 0:
            tangent = -tangent
        at = u * self.unit
        e = made(self.statics, at, error, steps, system)
        margins, on, slopes = self.statics.margins(at)
        return _Point(u, tangent, DF, e, steps, margins, on, slopes @ (self.unit * tangent))

    def alone(self, point: _Point) -> bool:
        """Whether the tangent is the one way on."""
        sizes = np.abs(point.DF).max(axis=1, keepdims=True)
        found = np.linalg.svd(point.DF / np.where(sizes > 0, sizes, 1.0), compute_uv=False)
        return bool(np.sum(found > RANK * max(1.0, found[0])) == len(point.u) - 1)

    def correct(self, guess: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> _Point | None:
        """Newton's method in the plane normal . (u - guess) = 0."""
        u = guess
        last = math.inf
        for steps in range(_MOST_NEWTON + 1):
            equations = self.equations(u)
            if equations is None:
                return None
            _, F, DF, error = equations
            step = np.linalg.lstsq(
                np.vstack([DF, normal]), np.append(-F, -normal @ (u - guess)), rcond=RANK * 1e-3
            )[0]
            size = float(np.abs(step / (1 + np.abs(u))).max())
            if (size <= _STEP and error <= ROUNDING) or (error <= 1e-3 * ROUNDING and steps):
                return self.point(u + step if size <= _STEP else u, direction, steps)
            if size > 2 * last or steps == _MOST_NEWTON:
                return None
            u, last = u + step, size
        return None

    def step(self, here: _Point, ds: float) -> _Point | None:
        """One step along the tangent; None if it must be shorter."""
        there = self.correct(here.u + ds * here.tangent, here.tangent, here.tangent)
        if there is None or np.linalg.norm(there.u - here.u) > 2 * ds:
            return None
        return there if there.tangent @ here.tangent >= _STRAIGHT else None

    def along(self, here: _Point, there: _Point, part: float) -> _Point | None:
        """The point whose projection on the chord is at a part of it."""
        chord = there.u - here.u
        return self.correct(here.u + part * chord, chord / np.linalg.norm(chord), here.tangent)

    def at_value(self, here: _Point, there: _Point, wanted: float) -> _Point | None:
        """The point between two at which the parameter has a value."""
        way = there.u - here.u
        normal = np.zeros(len(way))
        normal[self.place] = 1.0
        guess = here.u + way * (wanted / self.unit[self.place] - here.u[self.place]) / way[self.place]
        guess[self.place] = wanted / self.unit[self.place]
        return self.correct(guess, normal, here.tangent)

    def zero(self, here: _Point, there: _Point, test: Callable[[_Point], float]) -> tuple[_Point, float] | None:
        """Where a test function of opposite signs at two points is zero, and how well the parameter is known there."""
        from scipy.optimize import brentq

        points = {0.0: here, 1.0: there}

        def at(part: float) -> float:
            if part not in points:
                point = self.along(here, there, part)
                if point is None:
                    raise _Lost
                points[part] = point
            return test(points[part])

        try:
            zero = float(brentq(at, 0.0, 1.0, xtol=1e-15, rtol=1e-14))
            at(zero)
        except _Lost:
            return None
        span = abs(self.value(there) - self.value(here))
        slope = abs(test(there) - test(here))
        return points[zero], 1e-12 * max(abs(self.value(points[zero])), 1.0) + 1e-10 * min(span / slope, 1.0)


class _Lost(Exception):
    """Newton's method found nothing between two points of a branch."""


# ---- what is found on the way


def _smooth(walk: _Walk, here: _Point, there: _Point) -> list[EquilibriumBifurcation]:
    """Bifurcations between two points of one mode."""
    tests: dict[str, Callable[[_Point], float]] = {"fold": lambda p: float(p.tangent[walk.place])}
    if walk.q is not None:
        tests["branch point"] = _bordered
    tests |= {"Hopf": lambda p: _pairs(p.equilibrium.eigenvalues), "layer": _layer_determinant}
    if len(here.equilibrium.layer_eigenvalues) > 1:
        tests["layer Hopf"] = lambda p: _pairs(p.equilibrium.layer_eigenvalues)
    for event in walk.system.model.events:
        if event.surface is not None and not event.singular:
            tests[f"event {event.name}"] = _event_surface(event.surface)
    found: list[EquilibriumBifurcation] = []
    for kind, test in tests.items():
        a, b = test(here), test(there)
        if not a * b < 0:
            continue
        at = walk.zero(here, there, test)
        if at is None or abs(test(at[0])) > 1e-4 * max(abs(a), abs(b)):
            continue  # a pole: eigenvalues go through infinity where the layer folds
        if (named := _named(walk, kind, here, *at)) is not None:
            found.append(named)
    # Where all of x is held, the layer's fold is that of the branch.
    layer = [b for b in found if b.kind == "hidden fold"]
    near = [b for b in found if b.kind == "fold" and any(abs(b.parameter - c.parameter) <= 1e-7 * walk.unit[walk.place]
                                                         for c in layer)]  # fmt: skip
    found = [b for b in found if b not in near]
    return sorted(found, key=lambda b: float(np.linalg.norm(b.equilibrium.x - here.equilibrium.x)))


def _named(walk: _Walk, kind: str, here: _Point, point: _Point, width: float) -> EquilibriumBifurcation | None:
    e = point.equilibrium
    made_ = EquilibriumBifurcation(kind, walk.name, walk.value(point), width, e)
    if kind == "Hopf":
        w = _critical(e.eigenvalues)
        if w is None:
            return None  # a neutral saddle: two real eigenvalues of opposite sign
        kind = "sliding Hopf" if "pseudo" in e.kind else "Hopf"
        l1 = lyapunov_coefficient(e.system, e.x, e.mult, e.sides)
        return replace(made_, kind=kind, frequency=w, lyapunov=l1)
    if kind == "layer Hopf":
        w = _critical(e.layer_eigenvalues)
        return (
            None if w is None else replace(made_, what=f"{', '.join(e.held)} begin to oscillate in the layer")
        )
    if kind == "layer":
        name, what = _layer_kind(e)
        return replace(made_, kind=name, what=what)
    if kind.startswith("event "):
        return replace(made_, kind="surface of an event", what=f"the surface of {kind[6:]} is met")
    return made_


def _bordered(point: _Point) -> float:
    """Sign and size of det [DF; tau']: 0 where two branches meet, and not at a fold."""
    square = np.vstack([point.DF, point.tangent])
    return float(np.linalg.det(square / (1 + np.linalg.norm(square, axis=1))[:, None]))


def _pairs(mu: np.ndarray) -> float:
    """Product of mu_i + mu_j over pairs, every factor bounded; 0 where a pair is imaginary."""
    if not np.isfinite(mu).all():
        return 1.0
    factors = [(mu[i] + mu[j]) / (1e-300 + abs(mu[i]) + abs(mu[j])) for i in range(len(mu)) for j in range(i)]
    return float(np.prod(factors).real) if factors else 1.0


def _critical(mu: np.ndarray) -> float | None:
    """Frequency of the pair on the imaginary axis; None where it is none."""
    pairs = mu[mu.imag > 1e-7 * np.abs(mu).max(initial=0.0)]
    if not pairs.size:
        return None
    nearest = pairs[np.argmin(np.abs(pairs.real))]
    return float(nearest.imag) if abs(nearest.real) <= 1e-6 * np.abs(mu).max() else None


def _layer_determinant(point: _Point) -> float:
    layer = point.equilibrium.linear.layer
    if not len(layer) or not np.isfinite(layer).all():
        return 1.0
    return float(np.linalg.det(layer / max(np.abs(layer).max(), 1.0)))


def _event_surface(surface: sp.Expr) -> Callable[[_Point], float]:
    def test(point: _Point) -> float:
        return value(surface, _symbols(point.equilibrium))

    return test


def _symbols(e: Equilibrium) -> dict[sp.Symbol, float]:
    model = e.system.model
    names = (*model.states, *(mu.symbol for mu in model.multipliers), *e.system.parameters, model.time)
    return dict(zip(names, (*e.x, *e.mult, *e.system.parameters.values(), 0.0)))


def _layer_kind(e: Equilibrium) -> tuple[str, str]:
    """The name of a point at which the layer's determinant vanishes, and what happens there."""
    model = e.system.model
    held = [mu for mu, side in zip(model.multipliers, e.sides) if side == 0 and mu.kind == "switch"]
    if any(mu.hidden for mu in held) or model.layer_states:
        return (
            "hidden fold",
            f"dg/dlambda = 0: one side of it attracts {', '.join(e.held)} in the layer, the other repels",
        )
    if len(held) > 1:
        return "fold of the layer", f"{', '.join(e.held)} are no longer determined by dh/dt = 0"
    (mu,) = held
    turns = []  # d2h/dt2 on both sides
    for side in (1, -1):
        rates = [f.xreplace({mu.symbol: sp.Integer(side)}) for f in model.rhs]
        speed = total_derivative(mu.surface, model.time, model.states, rates)
        turns.append(value(total_derivative(speed, model.time, model.states, rates), _symbols(e)))
    visible = [turns[0] > 0, turns[1] < 0]
    words = {0: "both invisible", 1: "one of them visible", 2: "both visible"}[sum(visible)]
    planar = len(model.states) - model.n_memory == 2
    name = "pseudo-Hopf" if planar and not any(visible) else "two-fold"
    return (
        name,
        f"the folds of {mu.symbol} on both sides meet, {words}: sliding turns from attracting to repelling",
    )


# ---- the walk through modes


def follow_equilibrium(
    e: Equilibrium, name: str, to: float, lengths: tuple[float, float, float], most: int, virtual: bool,
    max_seconds: float | None,
) -> EquilibriumBranch:  # fmt: skip
    """The branch of an equilibrium over a parameter, or of a set of them along a state (continuation.follow)."""
    begin = value_at(e, name)
    late = math.inf if max_seconds is None else time.monotonic() + max_seconds
    branch = EquilibriumBranch(name, [e])
    branch.end = _followed(branch, e, (begin, to), lengths, most, virtual, lambda: time.monotonic() > late)
    return branch


def coordinate(e: Equilibrium, parameter: Any) -> str:
    """The name of the parameter, or of the state along which a set of equilibria is followed; ValueError else."""
    names = {s.name for s in e.system.parameters}
    own = e.system.model.states[: len(e.x) - e.system.model.n_memory]
    free = len(e.free_directions)
    key = str(getattr(checks.named(parameter), "name", parameter))
    if key not in names and free == 1 and any(s.name == key for s in own):
        if np.abs(e.free_directions[0, [s.name for s in own].index(key)]) <= RANK:
            raise ValueError(
                f"`parameter` is the state {key}, which is the same in the whole set of equilibria."
            )
        return key
    found = checks.lookup(parameter, e.system.parameters, "`parameter`", "parameter").name
    if free:
        raise ValueError(
            f"`orbit` is one of a set of equilibria of dimension {free}, so that no single one leads on over {found}. "
            + (f"Follow the set along one of the states {checks.listing(own)}." if free == 1 else
               "Leave states that nothing depends on out of the model.")
        )  # fmt: skip
    return found


def value_at(e: Equilibrium, name: str) -> float:
    """The value of a parameter, or of the state along which a set is followed."""
    return float({**e.start, **{p.name: v for p, v in e.system.parameters.items()}}[name])


def _followed(branch, e, bounds, lengths, most, virtual, late) -> str:
    (step, longest, shortest), (begin, end), name = lengths, bounds, branch.parameter
    walk = _Walk(e, name, abs(end - begin))
    direction = np.zeros(len(walk.first))
    direction[walk.place] = math.copysign(1.0, end - begin)
    here = walk.point(walk.first, direction)
    assert here is not None
    modes, ds = 0, min(step, longest)
    while len(branch.equilibria) < most:
        where = f"{name} = {walk.value(here):.10g}"
        if late():
            return f"`max_seconds` are used up at {where}: give more, or go on from `equilibria[-1]`."
        if not walk.alone(here):
            return f"at {where} the equilibrium is not isolated: there is a set of them, and no single way leads on."
        there = walk.step(here, ds)
        if there is None:
            if ds > shortest:
                ds *= 0.3
                continue
            return f"no equilibrium was found beyond {where} with steps down to {ds:.1g}."
        past = _passed(walk.value(there), walk.value(here), begin, end)
        if past is not None:
            there = walk.at_value(here, there, past)
            if there is None:
                return f"no equilibrium was found at {name} = {past:g}."
        crossed = _crossed(here, there)
        leaving = [j for j in crossed if here.margins[j] >= -here.on[j]]
        if leaving and not virtual:
            border = _border(walk, here, there, leaving)
            if border is None:
                ds *= 0.3
                if ds < shortest:
                    return f"the border of the mode was lost beyond {where}."
                continue
            point, j, width = border
            branch.bifurcations += _smooth(walk, here, point)
            branch.equilibria.append(point.equilibrium)
            both = [k for k in range(len(point.margins)) if k != j and abs(point.margins[k]) <= point.on[k]
                    and here.margins[k] > here.on[k]]  # fmt: skip
            bifurcation, after = _boundary(walk, point, j, width, abs(end - begin))
            branch.bifurcations.append(bifurcation)
            modes += 1
            if after is None or both or modes > _MOST_MODES:
                return f"{bifurcation.kind} at {name} = {walk.value(point):.10g}: " + (
                    "two surfaces are met at once." if both else bifurcation.what + "."
                )
            walk, here = after
            ds = min(step, longest)
            continue
        for j in crossed:
            border = _border(walk, here, there, [j])
            if border is not None:
                branch.bifurcations.append(_boundary(walk, border[0], j, border[2], abs(end - begin))[0])
        branch.bifurcations += _smooth(walk, here, there)
        branch.equilibria.append(there.equilibrium)
        if past is not None:
            return f"reached {name} = {past:g}."
        ds = min(ds * (2.0 if there.steps <= 3 else 1.0 if there.steps <= 5 else 0.5), longest)
        here = there
    return f"stopped after {len(branch.equilibria)} equilibria (`most`)."


def _passed(q: float, q0: float, begin: float, end: float) -> float | None:
    """The bound that the last step has passed: the end of the range or, after a turn, its beginning."""
    low, high = sorted((begin, end))
    if q >= high and q > q0:
        return high
    return low if q <= low and q < q0 else None


def _crossed(here: _Point, there: _Point) -> list[int]:
    """The multipliers whose bound was passed between two points, in either direction."""
    a, b = here.margins, there.margins
    at = np.abs(a) <= here.on
    out = (b < -there.on) & ((a > 0) | (at & (here.slopes < 0)))
    return [int(j) for j in np.flatnonzero(out | ((a < -here.on) & (b > there.on)))]


def _border(walk: _Walk, here: _Point, there: _Point, crossed: list[int]) -> tuple[_Point, int, float] | None:
    """The first of the bounds that are passed."""
    first = None
    for j in crossed:
        if abs(here.margins[j]) <= here.on[j]:
            return here, j, 1e-12 * (1 + abs(walk.value(here)))
        found = walk.zero(here, there, lambda p, j=j: float(p.margins[j]))  # type: ignore[misc]
        if found is None:
            return None
        distance = float(np.linalg.norm(found[0].u - here.u))
        if first is None or distance < first[0]:
            first = distance, (found[0], j, found[1])
    return None if first is None else first[1]


def _boundary(
    walk: _Walk, point: _Point, j: int, width: float, scale: float
) -> tuple[EquilibriumBifurcation, tuple[_Walk, _Point] | None]:
    """The boundary equilibrium at a point, and the walk and first point of the mode beside, where there is one."""
    e = point.equilibrium
    mu = e.system.model.multipliers[j]
    side, kink = e.sides[j], mu.kind == "switch" and mu.regularity == "kink"
    other = 1 if mu.kind == "contact" else int(np.sign(e.mult[j]))
    new = -side if kink else other if side == 0 else 0
    if mu.kind == "contact":
        what = f"the contact {mu.symbol} {'opens' if side == 0 else 'closes'}"
    elif kink:
        what = f"the kink {mu.surface} = 0 of {mu.symbol} is met"
    elif side == 0:
        what = f"{mu.symbol} reaches {other}: the pseudo-equilibrium leaves {mu.surface} = 0"
    else:
        what = f"{mu.surface} = 0 is met at {mu.symbol} = {side}: a pseudo-equilibrium is held there"
    kind = "boundary equilibrium" if walk.q is not None else "end of the set"
    mult = e.mult.copy()
    mult[j] = new if mu.kind == "switch" and new else 0.0 if mu.kind == "contact" else side if not kink else new
    sides = (*e.sides[:j], new, *e.sides[j + 1 :])
    beside = replace(e, mult=mult, sides=sides, message="")
    cycle = cycle_born(e, j) if walk.q is not None else None
    bifurcation = EquilibriumBifurcation(kind, walk.name, walk.value(point), width, e, None, what, cycle=cycle)
    if walk.q is None:
        return bifurcation, None
    after = _Walk(beside, walk.name, scale)
    there = after.point(after.first, np.ones(len(after.first)))
    if (
        there is None
        or there.equilibrium.residual > 1e3 * ROUNDING
        or not (after.alone(there) and there.equilibrium.isolated)
    ):
        return replace(bifurcation, what=what + ", and what lies beyond is no single equilibrium"), None
    if there.slopes[j] < 0:
        there = after.point(after.first, -there.tangent)
        assert there is not None
    q, beyond = point.tangent[walk.place], there.tangent[after.place]
    out = np.sign(point.slopes[j])  # 1 where a virtual branch comes back
    if min(abs(q), abs(beyond)) > 1e-9:
        kind += ": persistence" if q * beyond * -out > 0 else ": nonsmooth fold"
    return replace(bifurcation, kind=kind, beyond=there.equilibrium), (after, there)
