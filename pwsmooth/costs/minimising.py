"""minimise(): the least cost of a run, by single shooting on exact gradients.

    min over q of  J(q)   with  c_i(q) >= 0 or = 0,  low <= q <= high

J and all c_i are read of one run a point, with a way back over its tape each. The search is SciPy's: L-BFGS-B with
bounds alone, SLSQP or trust-constr with constraints. It sees q in units of its size, J and c in units of their slopes.

A run may have no derivative (it grazes), or give no number (an event does not happen). Then a point beside it, nearer
to the last good one, stands in for it; where that has none either, a bowl around the last good point does, which sends
any line search back.
Chain: objective.py -> **minimising** -> minimum.py.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from sympy.core.relational import GreaterThan, LessThan, StrictGreaterThan, StrictLessThan
from sympy.logic.boolalg import BooleanAtom

from ..door import calls, checks
from ..paths.derivatives.of_solution import NoDerivative
from ..paths.derivatives.quantities import START_TIME
from .minimum import HELD, Evaluation, Minimum
from .objective import Objective
from .telling import telling

_BESIDE = 1e-7  # where the point lies that stands in for one without a derivative, in coordinates of size 1
_LEGS = 4  # at most so many searches, each from the best point of the one before
_SOLD = 10  # cost that a failing constraint buys, in units of the slopes of both
_ASIDE, _WAYS = 1e-3, 4  # how far, in coordinates of size 1, and in how many directions a minimum is looked at
_NEAR = 1e-5  # of a size: nearer to it a bound or constraint is active
_DEPENDENT = 1e-8  # of a constraint's slope: what is left of it beside the others, and less, is none
_STATIONARY = (
    1e-5  # slope that is left, of the first one, from which on a point that SciPy cannot leave is a minimum
)
_FOUND = "No direction that bounds and constraints leave lowers the cost."
_KINK = "No step lowers the cost, whose slope is not 0: a kink, or coarse runs ({})."
_OPEN = "The constraints do not hold: give another first guess, or constraints that can be met."
_BLIND = "A constraint does not hold, and no unknown changes it there: give a first guess that does."
_CONTRARY = (
    "The constraints contradict each other there: their slopes depend on each other, and they do not hold."
)
_RANK = 5, 6, 7  # of SLSQP: constraints whose slopes depend on each other
_SIGNS = {GreaterThan: 1, StrictGreaterThan: 1, LessThan: -1, StrictLessThan: -1, sp.Eq: 0}


@checks.door(
    (*calls.STEPS, "parameters"),
    bounds=checks.optional(checks.mapping), max_evaluations=checks.integer(1),
    method=checks.optional(checks.one_of("SLSQP", "trust-constr", "L-BFGS-B")),
    max_seconds=checks.optional(checks.positive), progress=checks.optional(checks.flag),
    callback=checks.optional(checks.function),
)  # fmt: skip
def minimise(
    system: Any,
    cost: Any,
    t_span: Sequence[float],
    x0: Any,
    by: Sequence[Any] | Mapping[Any, float],
    *,
    bounds: Mapping[Any, tuple[float, float]] | None = None,
    constraints: Sequence[Any] = (),
    method: str | None = None,
    max_evaluations: int = 300,
    max_seconds: float | None = None,
    progress: bool | None = None,
    callback: Callable[[Evaluation], None] | None = None,
    **options: Any,
) -> Minimum:
    """The least cost of a run over parameters, initial values and inputs, on gradients exact through every event.

    Parameters
    ----------
    cost : Expr
        Of quantities of a run (`integral`, `final`, `event_time`, ...) and of parameters.
    by : sequence of (str, Symbol or Control), or mapping of (str or Symbol) to float, in their units
        The unknowns: parameters, states and memories (their initial values), "t0"; a Control stands for its
        coefficients and its movable times, the name of a family for all elements. With a mapping, first guesses; else
        they begin at the system's values and at `x0`.
    bounds : mapping of (str, Symbol or Control) to (float, float), in units of the unknowns, optional
        Lowest and highest value; infinite ones are none. A Control's are those of its coefficients.
    constraints : sequence of relations
        Between quantities of the run and parameters: `final(x) >= 1`, `sp.Eq(final(v), 0)`. Strict ones are met as the
        others are.
    method : {"L-BFGS-B", "SLSQP", "trust-constr"}, optional
        Of SciPy; by default "L-BFGS-B" without constraints, "SLSQP" with them.
    max_evaluations : int
        Bound on the runs.
    max_seconds : float, in units of wall time, s, optional
        Bound on the time of the search; a run that has begun is finished.
    progress : bool, optional
        Tell each run on stderr; by default on a terminal.
    callback : callable, optional
        It gets an Evaluation after each run.
    **options
        Of `solve`: `rtol`, `atol`, `max_step`, `max_steps`, `order`, `parameters`. The search is as fine as `rtol`.

    Returns
    -------
    Minimum
        Also after Ctrl-C and at a bound, with the best point until then.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy; a first guess whose run gives no cost.

    Notes
    -----
    The minimum is a local one. Movable times of a Control stay in their order. Positive parameters stay positive.

    Source: Nocedal and Wright, Numerical Optimization, 2006, for the methods.

    A body is pushed from rest over unit distance in unit time and ends at rest, with least effort:

    >>> x, v = sp.symbols("x v", real=True)
    >>> u = Control("u", [0, 1], degree=2)
    >>> body = System({x: v, v: u})
    >>> found = minimise(body, integral(u**2), (0, 1), {x: 0, v: 0}, [u],
    ...                  constraints=[sp.Eq(final(x), 1), sp.Eq(final(v), 0)])
    >>> [round(value, 5) + 0.0 for value in found.values.values()], round(found.cost, 6)  # a straight line
    ([6.0, 0.0, -6.0], 12.0)
    """
    system = checks.system(system, "`system`")._written_out()
    span = checks.span(t_span)
    names, guesses = _unknowns(system, by)
    relations = _relations(constraints)
    costs = {"`cost`": cost} | {f"`constraints`, {label},": side for label, side, _ in relations}
    objective = Objective._of_several(system, costs, span, x0, names, **options)
    q = np.array([guesses.get(name, value) for name, value in zip(names, objective.start)])
    box = _box(system, names, q, bounds or {})
    rows = _order(system, names, q, box, span)
    if method == "L-BFGS-B" and (relations or rows):
        raise ValueError(
            f"`method` is {method!r}, which knows bounds alone, and there are "
            f"{'`constraints`' if relations else 'movable times of a Control'}; leave it out, or give 'SLSQP'."
        )
    for name, value, (low, high) in zip(names, q, box):
        if not low <= value <= high:
            raise ValueError(
                f"`by` begins with {name} = {value:g}, outside of its bounds ({low:g}, {high:g}); give another first "
                "guess, or other `bounds`."
            )
    spent = _Budget(max_evaluations, max_seconds)
    with telling(progress, callback, _words) as told:
        signs = [sign for *_, sign in relations]
        search = _Search(objective, q, box, signs, _like(system, names), spent, told)
        chosen = method or ("SLSQP" if relations or rows else "L-BFGS-B")
        best, success, message = search.run(chosen, rows, float(options.get("rtol", 1e-9)))
    values = dict(zip(names, (best.z * search.unit).tolist()))
    held = dict(zip((label for label, *_ in relations), best.misses <= HELD))
    start = {name: values.get(name, number) for name, number in objective._x0.items()}
    start = {str(s): start[str(s)] for s in system.states}
    parameters = {p.name: values[p.name] for p in system.parameters if p.name in values}
    return Minimum(
        system.with_parameters(parameters), values, best.cost, best.gradient / search.unit,
        dict(zip(held, best.margins.tolist())), {label: bool(holds) for label, holds in held.items()},
        success, message, search.history, search.problem, search.refused,
        ((values.get(START_TIME, span[0]), span[1]), start, options),
    )  # fmt: skip


# ---- what was asked, at the door


def _unknowns(system: Any, by: Any) -> tuple[list[str], dict[str, float]]:
    """Names of all unknowns, those of controls and families written out, and their first guesses where given."""
    wanted = by if isinstance(by, Mapping) else checks.several(by, "`by`")
    names = [member for key in wanted for member in _members(system, key, "`by`", times=True)]
    if not names:
        raise ValueError("`by` is empty; name at least one parameter, initial value or Control.")
    known = {p.name for p in system.parameters} | {str(s) for s in system.states} | {START_TIME}
    if strange := [name for name in names if name not in known]:
        raise ValueError(
            f"`by` names {checks.shown(strange[0])}, which is nothing that can be varied; give parameters, states "
            f"(their initial values), controls or {START_TIME!r}."
        )
    if len(set(names)) < len(names):
        raise ValueError(f"`by` names something twice: {', '.join(names)}.")
    if not isinstance(by, Mapping):
        return names, {}
    guesses = {
        member: checks.number(value, f"`by`, first guess of {key}")
        for key, value in by.items()
        for member in _members(system, key, "`by`", times=False)
    }
    return names, guesses


def _members(system: Any, key: Any, what: str, times: bool) -> list[str]:
    """The single unknowns that a name stands for."""
    name = str(checks.key(checks.named(key), f"{what}, a name there,"))
    for u in system._controls:
        if u.name == name:
            return [s.name for s in (*u.coefficients, *(u.instants if times else ()))]
    return list(system.groups.get(name, (name,)))


def _relations(constraints: Any) -> list[tuple[str, sp.Expr, int]]:
    """Each relation once; data that differ do not show in the text."""
    found: dict[str, tuple[str, sp.Expr, int]] = {}
    for relation in checks.several(constraints, "`constraints`"):
        text, side, sign = _relation(relation)
        if (side, sign) in [(known, other) for _, known, other in found.values()]:
            continue
        label = text if text not in found else f"{text} ({len(found) + 1})"
        found[label] = label, side, sign
    return list(found.values())


def _relation(relation: Any) -> tuple[str, sp.Expr, int]:
    """Of a relation its text, left minus right side, and 1 for >=, -1 for <=, 0 for =."""
    if type(relation) not in _SIGNS:
        always = " (it holds always, or never)" if isinstance(relation, (bool, BooleanAtom)) else ""
        raise TypeError(
            f"`constraints` has {checks.shown(relation)}{always}; give relations such as final(x) >= 1 or "
            "sympy.Eq(final(v), 0)."
        )
    sign = _SIGNS[type(relation)]
    text = f"{relation.lhs} = {relation.rhs}" if sign == 0 else str(relation)
    return text, relation.lhs - relation.rhs, sign


def _box(system: Any, names: list[str], q: np.ndarray, bounds: Mapping[Any, Any]) -> list[tuple[float, float]]:
    """Lowest and highest value of each unknown: as given, and as the assumptions of its symbol say."""
    given = {}
    for key, pair in bounds.items():
        for member in _members(system, key, "`bounds`", times=False):
            if member not in names:
                raise ValueError(
                    f"`bounds` names {checks.shown(member)}, which is no unknown; `by` has {', '.join(names)}."
                )
            given[member] = checks.interval(pair, f"`bounds` of {key}")
    symbols = {s.name: s for s in (*system.states, *system.parameters)}
    box = []
    for name, value in zip(names, q):
        low, high = given.get(name, (-np.inf, np.inf))
        symbol = symbols.get(name)
        if symbol is not None and symbol.is_nonnegative:
            # Zero itself is no value of a positive one.
            low = max(low, 1e-12 * abs(value) if symbol.is_positive else 0.0)
        if symbol is not None and symbol.is_nonpositive:
            high = min(high, -1e-12 * abs(value) if symbol.is_negative else 0.0)
        box.append((low, high))
    return box


def _order(
    system: Any, names: list[str], q: np.ndarray, box: list[tuple[float, float]], span: tuple[float, float]
) -> list[tuple[np.ndarray, float]]:
    """Rows (a, low) of a q >= low that keep movable times of controls in order; those of one time go into the box."""
    values, rows = {p.name: value for p, value in system.parameters.items()}, []
    for u in system._controls:
        inner = [s.name for s in u.instants]
        times: list[Any] = [max(span[0], u.times[0]), *inner, u.times[-1]]
        for begin, end in zip(times, times[1:]) if inner else ():
            a, low = np.zeros(len(names)), u.shortest
            for t, sign in ((begin, -1.0), (end, 1.0)):
                if t in names:
                    a[names.index(t)] = sign
                else:
                    low -= sign * values.get(t, t)
            unknown = np.flatnonzero(a)
            if len(unknown) == 1:
                k = int(unknown[0])
                below, above = box[k]
                box[k] = (max(below, low), above) if a[k] > 0 else (below, min(above, -low))
            elif len(unknown):
                if a @ q < low:
                    raise ValueError(
                        f"`by` begins with {begin} and {end} of Control {u.name!r} nearer than its `shortest`, "
                        f"{u.shortest:g}; give other first guesses."
                    )
                rows.append((a, low))
    return rows


# ---- the search


class _Enough(Exception):
    """A bound of the search is reached; its text says which."""


class _Budget:
    def __init__(self, runs: int, seconds: float | None) -> None:
        self.runs, self.seconds, self.begun = runs, seconds, clock.monotonic()

    def check(self, runs: int) -> None:
        if not runs:  # the first is always made
            return
        if runs >= self.runs:
            raise _Enough(
                f"{self.runs} runs were not enough: give a better first guess, or a larger `max_evaluations`."
            )
        if self.seconds is not None and clock.monotonic() - self.begun > self.seconds:
            raise _Enough(f"{self.seconds:g} s were not enough: this is the best point until then.")


class _Point(NamedTuple):
    """What a run gives at z: in the units of the model, slopes by z."""

    z: np.ndarray
    cost: float
    gradient: np.ndarray
    margins: np.ndarray  # left minus right sides
    slopes: np.ndarray  # of these
    misses: np.ndarray  # by how much each constraint fails, over its size
    real: bool  # no stand-in

    @property
    def rank(self) -> tuple[float, float]:
        """The less the better: first the constraints, then the cost."""
        miss = float(self.misses.max(initial=0.0))
        return (miss, 0.0) if miss > HELD else (0.0, self.cost)


class _Search:
    """Points by their coordinates z = q/unit, each run once."""

    def __init__(
        self, objective: Objective, q: np.ndarray, box: Sequence[tuple[float, float]], signs: Sequence[int],
        like: list[list[int]], budget: _Budget, told: Callable[[Evaluation], None],
    ) -> None:  # fmt: skip
        low, high = np.array(box).T
        self.objective, self.budget, self.told = objective, budget, told
        self.unit = _units(q, low, high, like)
        self.low, self.high, self.signs = low / self.unit, high / self.unit, np.array(signs, int)
        self.history: list[Evaluation] = []
        self.problem: NoDerivative | None = None
        self.refused = 0
        self.known: dict[bytes, _Point] = {}
        self.sizes, self.unmeasured = np.ones(len(signs)), np.ones(len(signs), bool)
        self.first = np.clip(q / self.unit, self.low, self.high)
        self.last: Any = None
        self.best: Any = None
        self.scale = 1.0

    def _begin(self) -> None:
        """The first point, and with it the sizes of cost and constraints."""
        point = self.at(self.first)
        if not point.real:
            raise ValueError(
                f"the run from `x0` and the first guesses of `by` gives no cost. {self.problem} Give others."
            )
        slope = float(np.abs(point.gradient).max())
        self.scale = max(slope, 1e-3 * abs(point.cost)) or 1.0
        self._measure(point)
        point = point._replace(misses=self._misses(point.margins))
        self.last = self.best = self.known[self.first.tobytes()] = self.known[point.z.tobytes()] = point
        self.history[-1] = self.history[-1]._replace(violation=float(point.misses.max(initial=0.0)))

    def _measure(self, point: _Point) -> None:
        """Sizes of constraints by their first slopes; one without a slope, as of a body that sticks, has none yet."""
        steepest = np.abs(point.slopes).max(axis=1, initial=0.0)
        new = self.unmeasured & (steepest > 0)
        self.sizes[new], self.unmeasured = steepest[new], self.unmeasured & ~new
        if new.any() and self.best is not None:
            self.best = self.best._replace(misses=self._misses(self.best.margins))

    def _misses(self, margins: np.ndarray) -> np.ndarray:
        miss = np.where(self.signs == 0, np.abs(margins), np.fmax(-self.signs * margins, 0.0))
        return miss / self.sizes

    def at(self, z: np.ndarray) -> _Point:
        """The point at z, or what stands in for it."""
        key = np.asarray(z, float).tobytes()
        if key not in self.known:
            point = self._run(z)
            if point is None:
                self.refused += 1
                point = self._run(self._beside(z)) or self._bowl(z)
            if point.real:
                if self.last is not None and self.unmeasured.any():
                    self._measure(point)
                    point = point._replace(misses=self._misses(point.margins))
                self.last = point
                self.known[point.z.tobytes()] = point
                if self.best is None or point.rank < self.best.rank:
                    self.best = point
            self.known[key] = point
        return self.known[key]

    def _run(self, z: np.ndarray) -> _Point | None:
        self.budget.check(len(self.history))
        q = np.array(z, float) * self.unit
        point, number = None, len(self.history) + 1
        try:
            found = self.objective._each(q)
            values = np.array([cost.value for cost in found])
            slopes = np.array([cost.gradient for cost in found]) * self.unit
            if np.isfinite(values).all() and np.isfinite(slopes).all():
                misses = self._misses(values[1:])
                point = _Point(np.array(z), float(values[0]), slopes[0], values[1:], slopes[1:], misses, True)
            else:
                raise NoDerivative(
                    self.objective._span[1], "", "the cost or its slope is no finite number there"
                )
        except NoDerivative as error:
            self.problem = self.problem or error
        except ValueError as error:
            if not self.history:
                raise
            # A value that a parameter cannot have, a step without a Taylor series.
            self.problem = self.problem or NoDerivative(self.objective._span[0], "", str(error).rstrip("."))
        cost, miss = (np.nan, np.nan) if point is None else (point.cost, float(point.misses.max(initial=0.0)))
        self.history.append(Evaluation(number, dict(zip(self.objective.names, q.tolist())), cost, miss))
        self.told(self.history[-1])
        return point

    def _beside(self, z: np.ndarray) -> np.ndarray:
        """A point near z, towards the last good one."""
        way = np.ones(len(z)) if self.last is None else self.last.z - z
        inside = np.clip(z + _BESIDE * way / (np.linalg.norm(way) or 1.0), self.low, self.high)
        return inside if np.any(inside != z) else np.clip(z - _BESIDE, self.low, self.high)

    def _bowl(self, z: np.ndarray) -> _Point:
        """A cost that rises from the last good point, and constraints that are no better there."""
        nothing = np.empty(0)
        if self.last is None:
            return _Point(np.array(z), np.nan, nothing, nothing, nothing, nothing, False)
        way = z - self.last.z
        square = float(way @ way) or 1.0
        rise = abs(float(self.last.gradient @ way)) + self.scale * np.sqrt(square)
        return self.last._replace(
            z=np.array(z), cost=self.last.cost + rise, gradient=2 * rise * way / square, real=False
        )

    def run(self, method: str, rows: Any, rtol: float) -> tuple[_Point, bool, str]:
        """The best point, whether it is a minimum, and how the search ended."""
        success, message = False, ""
        try:
            self._begin()
            start = self.best
            for leg in range(_LEGS):
                begun = self.best
                found = self._leg(method, rows, rtol, start, leg)
                end = self.at(found.x)
                # Costs of points at which constraints hold are known to what these may fail by.
                if (
                    end.real
                    and not end.rank[0]
                    and end.cost <= self.best.cost + (rtol + _SOLD * HELD) * self.scale
                ):
                    self.best = end
                here = self.best
                met = not here.rank[0]
                # trust-constr also calls it a success that its region has shrunk, or its barrier not yet.
                sure = bool(found.success) and here is end and method != "trust-constr"
                success = met and (sure or self._slope(here, rows) <= _STATIONARY)
                stuck = here.rank >= begun.rank
                if stuck and method == "SLSQP" and found.status in _RANK and not success:
                    method = "trust-constr"  # it does without the rank
                elif success and (aside := self._aside(here, rows)) is not None and leg < _LEGS - 1:
                    start, success = aside, False
                    continue
                elif success or stuck:
                    break
                start = self.best
            message = _FOUND if success else _KINK.format(found.message) if met else self._open(here)
        except _Enough as error:
            message = str(error)
        except KeyboardInterrupt:
            if self.best is None:
                raise
            message = "Interrupted: this is the best point until then."
        return self.best, success, message

    def _aside(self, point: _Point, rows: Any) -> _Point | None:
        """A point beside a minimum that is better, by its cost and what constraints that fail there would cost; None if
        there is none. Runs, not slopes, say so: a slope knows nothing of the other side of a kink.
        """
        A, pushes = self._pushes(point, rows)
        free = _across(A.T)
        price = 2 * self.scale * max(1.0, float(np.abs(pushes).max(initial=0.0)))
        ways = [*(np.random.default_rng(0).normal(size=(min(_WAYS, len(free)), len(free))) @ free)]
        # Through a constraint that only seems to be in the way: v >= 0 of a body that stops.
        first, last = (
            A.shape[1] - np.sum(self.signs == 0) - self._near(point).sum(),
            A.shape[1] - np.sum(self.signs == 0),
        )
        for k in range(first, last):
            others = _across(np.delete(A, k, axis=1).T)
            ways.append(-others.T @ (others @ A[:, k]))
        found, least = None, point.cost + price * point.misses.sum() - HELD * self.scale
        for way in ways:
            if not (length := np.linalg.norm(way)) > 0:
                continue
            for step in (_ASIDE, -_ASIDE):
                z = np.clip(point.z + step * way / length, self.low, self.high)
                if any(a @ (z * self.unit) < low for a, low in rows):
                    continue
                there = self.at(z)
                if there.real and (paid := there.cost + price * there.misses.sum()) < least:
                    found, least = there, paid
        return found

    def _open(self, point: _Point) -> str:
        """Why constraints do not hold: no unknown changes one, or those that hold leave none free, or neither."""
        failing = point.misses > HELD
        if (failing & ~(np.abs(point.slopes).max(axis=1, initial=0.0) > 0)).any():
            return _BLIND
        equal = self.signs == 0
        rows = point.slopes[equal] / self.sizes[equal, None]
        return _CONTRARY if failing[equal].any() and len(rows) > len(point.z) - len(_across(rows)) else _OPEN

    def _felt(self, point: _Point) -> np.ndarray:
        """The constraints that a step from a point meets: those that fail or are no equations.

        Of equations that hold, as of a body that a stick has stopped, those whose slopes are not slopes of others.
        """
        felt, known = np.ones(len(self.signs), bool), np.zeros((0, len(point.z)))
        for j in np.flatnonzero(self.signs == 0):
            row = point.slopes[j] / self.sizes[j]
            rest = row - known.T @ (known @ row)
            rest -= known.T @ (known @ rest)
            if (size := np.linalg.norm(rest)) > _DEPENDENT * max(float(np.linalg.norm(row)), 1.0):
                known = np.vstack([known, rest / size])
            elif point.misses[j] <= HELD:
                felt[j] = False
        return felt

    def _leg(self, method: str, rows: Any, rtol: float, begun: _Point, leg: int) -> Any:
        import warnings

        from scipy.optimize import SR1, Bounds, LinearConstraint, NonlinearConstraint, minimize

        constraints: list[Any] = []
        inner = method == "trust-constr"
        if rows:
            a, low = np.array([a for a, _ in rows]) * self.unit, np.array([low for _, low in rows])
            constraints.append(LinearConstraint(a, low, np.inf, keep_feasible=inner))
        z, felt = begun.z, self._felt(begun)
        for own in ((self.signs == 0) & felt, self.signs != 0):
            if own.any():
                size = (self.sizes * np.where(self.signs < 0, -1.0, 1.0))[own]
                constraints.append(
                    NonlinearConstraint(
                        lambda z, own=own, size=size: self.at(z).margins[own] / size,
                        0.0,
                        0.0 if (self.signs[own] == 0).all() else np.inf,
                        jac=lambda z, own=own, size=size: self.at(z).slopes[own] / size[:, None],
                        # A constraint is straight until it shows otherwise, to either side.
                        **({"hess": SR1(init_scale=1e-8)} if inner else {}),
                    )
                )
        fine = {
            "L-BFGS-B": {"ftol": max(0.01 * rtol, 1e-15), "gtol": max(10 * rtol, 1e-13)},
            "SLSQP": {"ftol": max(rtol, 1e-14)},
            "trust-constr": {
                "gtol": max(10 * rtol, 1e-13),
                "xtol": max(0.1 * rtol, 1e-14),
                "initial_barrier_parameter": 0.1 * 1e-3**leg,
                "initial_barrier_tolerance": 0.1 * 1e-3**leg,
            },
        }
        with warnings.catch_warnings():
            # A straight piece of a cost or constraint tells a quasi-Newton method nothing, and needs no word.
            warnings.filterwarnings("ignore", "delta_grad == 0.0")
            warnings.filterwarnings("ignore", "Singular Jacobian")
            return minimize(
                lambda z: self.at(z).cost / self.scale, z, jac=lambda z: self.at(z).gradient / self.scale,
                method=method, bounds=Bounds(self.low, self.high), constraints=constraints,
                options=fine[method] | {"maxiter": 10**6},
            )  # fmt: skip

    def _pushes(self, point: _Point, rows: Any) -> tuple[np.ndarray, np.ndarray]:
        """Gradients of what is active at a point, as columns, and their multipliers (Karush, Kuhn and Tucker)."""
        from scipy.optimize import lsq_linear

        k = np.eye(len(point.z))
        pushes = [k[point.z - self.low <= _NEAR], -k[self.high - point.z <= _NEAR]]
        pushes += [
            (a * self.unit)[None] for a, low in rows if a @ (point.z * self.unit) - low <= _NEAR * abs(low)
        ]
        pushes.append((point.slopes * (self.signs / self.sizes)[:, None])[self._near(point)])
        lowest = [0.0] * sum(map(len, pushes))
        equal = self.signs == 0
        pushes.append((point.slopes / self.sizes[:, None])[equal])
        lowest += [-np.inf] * int(equal.sum())
        A = np.concatenate(pushes).T
        return A, lsq_linear(A, point.gradient / self.scale, (lowest, np.inf)).x if A.size else np.empty(0)

    def _near(self, point: _Point) -> np.ndarray:
        """Which inequalities are active."""
        return (self.signs != 0) & (np.abs(point.margins) <= _NEAR * self.sizes)

    def _slope(self, point: _Point, rows: Any) -> float:
        """What is left of the slope once active bounds and constraints push against it."""
        A, pushes = self._pushes(point, rows)
        return float(np.abs(A @ pushes - point.gradient / self.scale).max())


def _across(rows: np.ndarray) -> np.ndarray:
    """Directions, as rows, across all of these."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, right = np.linalg.svd(rows)
    return right[np.sum(sizes > _DEPENDENT * max(1.0, float(sizes.max()))) :]


def _like(system: Any, names: list[str]) -> list[list[int]]:
    """Unknowns of one kind and unit, by their places: the coefficients of a Control."""
    found = [
        [names.index(s.name) for s in u.coefficients if s.name in names]
        for u in system._controls
        if u.degree == 0
    ]
    return [places for places in found if places]


def _units(q: np.ndarray, low: np.ndarray, high: np.ndarray, like: list[list[int]]) -> np.ndarray:
    """The size of each unknown: the width of its bounds, else of its first value, of a bound, or of those `like` it."""
    width = high - low
    sizes = np.array([q, np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 0.0)])
    largest = np.abs(sizes).max(axis=0)
    for places in like:  # 0 is one of the values of a piecewise constant input
        largest[places] = np.where(largest[places] > 0, largest[places], largest[places].max())
    unit = np.where(np.isfinite(width) & (width > 0), width, largest)
    return np.where(unit > 0, unit, 1.0)


def _words(at: Evaluation) -> str:
    return f"minimise: run {at.number}, cost {at.cost:.9g}, constraints miss {at.violation:.2g}"
