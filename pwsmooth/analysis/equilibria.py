"""Equilibria of a piecewise-smooth system: regular, pseudo, on closed contacts; admissible or virtual.

    f(x, lam) = 0,   h_j(x, lam) = 0 for what is held,   lam_j = 1 or -1, R_j = 0 for what is not

A mode says of every multiplier on which side of its surface it is: 1 or -1, or 0 where it is held there (a closed
contact, an algebraic unknown). In a mode the equations are smooth, and Newton's method solves them from many starts at
once, in the states and in the multipliers that are free. As f vanishes, dh/dt does so by itself: g(lam) = 0 needs no
equation of its own, and several lam on one surface are several solutions.

Chain: paths/linearised.py, equilibrium_stability.py -> **equilibria** -> equilibrium_branches.py.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.describe import Described, Rows, listed, number, values
from ..definition.pointwise import value
from ..definition.sigmoids import sigmoid
from ..paths.linearised import linearise
from .equilibrium_stability import Linear, linear_at, margins, signs
from .sections import depends_on_time

__all__ = ["Equilibrium", "equilibria", "find_equilibrium"]

Sides = tuple[int, ...]
_MOST_NEWTON = 60
_CONVERGED = 1e-10  # of a full step, relative: the error after it is its square
_UNDERFLOW = 1e-24  # what Newton's method leaves of a 0
ROUNDING = 1e-12  # of an equation, relative to the sum of its terms
RANK = 1e-10  # of the smallest singular value to the largest: below it a direction is free
SAME = 1e-7  # relative: nearer together two solutions are one (double ones come as near as 1e-8)
_MOST_MODES = 4096
_BATCH = 256  # starts of Newton's method at once
_MOST_BATCHES = 8  # of a mode that goes on giving new solutions


class Statics:
    """The equations of a mode, F = (f, h_J), and their derivatives by u = (x, lam_J) and, if given, a parameter q."""

    def __init__(
        self, system: Any, sides: Sides, memories: np.ndarray, q: sp.Symbol | None = None, unit: Any = 1.0
    ) -> None:
        model = system.model
        self.system, self.sides, self.q, self.memories = system, sides, q, memories
        self.line = linearise(model, () if q is None else (q,))
        self.n, self.m = len(model.states) - model.n_memory, len(model.multipliers)
        self.J = [j for j, side in enumerate(sides) if side == 0]
        # An open contact has side 1 and the reaction 0.
        self.fixed = np.array(
            [side if mu.kind == "switch" else 0 for mu, side in zip(model.multipliers, sides)], float
        )
        self.p = np.array(system.parameter_values, float)
        self.place = model.parameters.index(q) if q in model.parameters else None
        self.size = self.n + len(self.J)  # of (x, lam_J)
        self.unit = np.ones(self.size)  # in which unknowns are counted
        self.unit[: self.n] = unit

    def parts(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (states, K), multipliers (m, K) and parameters at the rows of u."""
        x = np.empty((self.n + len(self.memories), len(u)))
        x[: self.n], x[self.n :] = u[:, : self.n].T, self.memories[:, None]
        mult = np.repeat(self.fixed[:, None], len(u), axis=1)
        mult[self.J] = u[:, self.n : self.size].T
        p = self.p
        if self.place is not None:
            p = p.copy()
            p[self.place] = u[0, -1]  # of one row only
        return x, mult, p

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (K, M) and DF (K, M, N) at the rows of u (K, N)."""
        x, mult, p = self.parts(u)
        blocks = self.line.blocks(np.zeros(len(u)), x, mult, p)
        c, c_w, c_lam = self.line.constraints(np.zeros(len(u)), x, mult, p)
        n, J, own = self.n, self.J, len(x)
        F = np.concatenate([blocks.f[:, :n], c[:, J]], axis=1)
        w = np.concatenate([blocks.f_w[:, :n], c_w[:, J]], axis=1)
        lam = np.concatenate([blocks.f_lam[:, :n], c_lam[:, J]], axis=1)
        return F, np.concatenate([w[:, :, :n], lam[:, :, J], w[:, :, own:]], axis=2)

    def margins(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far u (N,) is inside its mode, for each multiplier, what counts as nothing, and the gradient by u."""
        x, mult, p = self.parts(u[None])
        inside, on = margins(self.line, x[:, 0], mult[:, 0], p, self.sides)
        _, c_w, c_lam = (part[0] for part in self.line.constraints(np.zeros(1), x, mult, p))
        slopes = np.zeros((self.m, len(u)))
        for j, mu in enumerate(self.system.model.multipliers):
            if self.sides[j]:
                by_u = np.concatenate([c_w[j, : self.n], c_lam[j, self.J], c_w[j, x.shape[0] :]])
                slopes[j] = self.sides[j] * by_u
            elif mu.kind != "algebraic":
                slopes[j, self.n + self.J.index(j)] = 1.0 if mu.kind == "contact" else -np.sign(mult[j, 0])
        return inside, on, slopes

    def error(self, F: np.ndarray, DF: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Largest |F| relative to the terms of its derivative, (K,): a few roundings at a solution."""
        unit = np.ones(u.shape[1])
        unit[: self.size] = self.unit
        terms = (np.abs(DF) * (unit + np.abs(u))[:, None, :]).sum(axis=2)
        return (np.abs(F) / np.where(terms > 0, terms, 1.0)).max(axis=1, initial=0.0)


@np.errstate(all="ignore")
def newton(statics: Statics, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method from the rows of u (K, N): solutions, their errors (inf where none) and steps.

    Pseudo-inverses, so that it also meets solutions that are not isolated. A step is halved while the next one, with
    the same matrix, would be longer (Deuflhard's natural monotonicity test).
    """
    u, K = u.copy(), len(u)
    errors, counts, going = np.full(K, math.inf), np.zeros(K, int), np.arange(K)
    for count in range(_MOST_NEWTON + 1):
        F, DF = statics(u[going])
        finite = np.isfinite(F).all(axis=1) & np.isfinite(DF).all(axis=(1, 2))
        going, F, DF = going[finite], F[finite], DF[finite]
        if not going.size:
            break
        scaled = DF * statics.unit
        rows = np.abs(scaled).max(axis=2, initial=0.0)
        rows = np.where(rows > 0, rows, 1.0)
        inverse = np.linalg.pinv(scaled / rows[:, :, None], rcond=RANK) / rows[:, None, :]
        step = -(inverse @ F[:, :, None])[:, :, 0]  # in units
        at = u[going] / statics.unit
        size = np.abs(step / (1 + np.abs(at))).max(axis=1, initial=0.0)
        errors[going], counts[going] = statics.error(F, DF, u[going]), count
        # Near a double solution steps shrink slowly, and what is left is rounding.
        done = (size <= _CONVERGED) & (errors[going] <= ROUNDING)
        u[going[done]] += step[done] * statics.unit
        if count == _MOST_NEWTON or done.all():
            break
        going, inverse, step, at = going[~done], inverse[~done], step[~done], at[~done]
        length = np.linalg.norm(step, axis=1)
        part, waiting = np.ones(len(going)), np.ones(len(going), bool)
        for _ in range(4):
            trial = statics((at[waiting] + part[waiting, None] * step[waiting]) * statics.unit)[0]
            ahead = np.linalg.norm((inverse[waiting] @ trial[:, :, None])[:, :, 0], axis=1)
            worse = ~(ahead < length[waiting])
            waiting[np.flatnonzero(waiting)[~worse]] = False
            if not waiting.any():
                break
            part[waiting] *= 0.5
        u[going] = (at + part[:, None] * step) * statics.unit
    errors[(errors > ROUNDING) | ~np.isfinite(u).all(axis=1)] = math.inf
    u[np.abs(u) < _UNDERFLOW] = 0.0
    return u, errors, counts


@dataclass(frozen=True, repr=False, eq=False)
class Equilibrium(Described):
    """A point at which the system stands still, or the best that was found (`success` False, `message` why).

    Attributes
    ----------
    system : System
        With the parameter values of the equilibrium.
    x : ndarray, shape (n,)
        The point, in the units of the states.
    mult : ndarray, shape (m,)
        Multipliers there: those of switches dimensionless, reactions and unknowns in the units of the model.
    sides : tuple of int
        Of each multiplier 1 or -1 off its surface, 0 where it is held (a contact: 1 open, 0 closed).
    residual : float, dimensionless
        Largest equation, relative to its terms.
    steps : int
        Of Newton's method.
    success : bool
        Whether there is one.
    message : str
        In words, with what to try next.

    Notes
    -----
    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for regular, pseudo-,
    virtual and boundary equilibria; Jeffrey, On the mathematical basis of solid friction, for the layer's stability.

    Examples
    --------
    A relay that pushes to both sides of x = 0, against a wind:

    >>> import sympy as sp
    >>> from pwsmooth import System, find_equilibrium
    >>> x = sp.Symbol("x", real=True)
    >>> rest = find_equilibrium(System({x: 0.5 - sp.sign(x)}), {x: 1})
    >>> rest.kind, rest.multipliers, rest.stability
    ('pseudo-equilibrium', {'sgn(x)': 0.5}, 'stable')
    """

    system: Any
    x: np.ndarray
    mult: np.ndarray
    sides: Sides
    residual: float
    steps: int
    success: bool = True
    message: str = ""
    _free: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def start(self) -> dict[str, float]:
        """The state by name, as `solve` takes it."""
        return {str(s): float(value) for s, value in zip(self.system.model.states, self.x)}

    @property
    def multipliers(self) -> dict[str, float]:
        """Multipliers by name."""
        return {str(mu.symbol): float(v) for mu, v in zip(self.system.model.multipliers, self.mult)}

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the switches and contacts that are held on their surfaces."""
        pairs = zip(self.system.model.multipliers, self.sides)
        return tuple(str(mu.symbol) for mu, side in pairs if side == 0 and mu.kind != "algebraic")

    @property
    def kind(self) -> str:
        """ "regular", "pseudo-equilibrium" where a switch is held, "rest on a contact" where one is closed alone."""
        pairs = zip(self.system.model.multipliers, self.sides)
        kinds = {mu.kind for mu, side in pairs if side == 0}
        if "switch" in kinds:
            return "pseudo-equilibrium"
        return "rest on a contact" if "contact" in kinds else "regular"

    @functools.cached_property
    def border(self) -> str:
        """Where it lies on the border of its mode, in words; empty off the border."""
        return "; ".join(self._words(lambda margin, on: abs(margin) <= on))

    @functools.cached_property
    def virtual(self) -> str:
        """Why it is one of a field's continuation, not of the system, in words; empty for an admissible one."""
        return "; ".join(self._words(lambda margin, on: margin < -on))

    def _words(self, wanted: Any) -> Iterator[str]:
        statics = Statics(self.system, self.sides, self.x[len(self.x) - self.system.model.n_memory :])
        inside, on, _ = statics.margins(np.concatenate([self.x[: statics.n], self.mult[statics.J]]))
        for mu, side, margin, size, lam in zip(
            self.system.model.multipliers, self.sides, inside, on, self.mult
        ):
            if not wanted(margin, size):
                continue
            if mu.kind == "contact":
                yield (
                    f"the reaction {mu.symbol} is {lam:.6g}"
                    if side == 0
                    else (f"the gap {mu.surface} of {mu.symbol} is {margin:.6g}")
                )
            elif side == 0:
                yield f"{mu.symbol} is {lam:.6g}, " + ("beyond [-1, 1]" if margin < -size else "on its bound")
            else:
                yield f"{mu.surface} is {side * margin:.6g}, with {mu.symbol} = {side}"

    @property
    def admissible(self) -> bool:
        """Whether the system itself stands still here, on the border of a mode included."""
        return self.success and not self.virtual

    @functools.cached_property
    def linear(self) -> Linear:
        """Jacobian of the flow along what is held, and of the layer (equilibrium_stability.py)."""
        if not self.success:
            return Linear(
                np.full((len(self.x),) * 2, np.nan), np.eye(len(self.x)), np.zeros((0, 0)), self.message
            )
        return linear_at(self.system, self.x, self.mult, self.sides)

    @property
    def eigenvalues(self) -> np.ndarray:
        """Of the flow on the manifold of what is held, the rightmost first, in units of 1/time."""
        return self.linear.eigenvalues

    @property
    def layer_eigenvalues(self) -> np.ndarray:
        """Of the layer's motion, in units of 1/time times the width eps; empty without a held switch."""
        return self.linear.layer_eigenvalues

    @property
    def free_directions(self) -> np.ndarray:
        """Directions (x, multipliers held) in which there are more equilibria, shape (dimension, N)."""
        return self._free

    @property
    def isolated(self) -> bool:
        """Whether no other equilibria lie beside it at the same parameters: False for a sticking block's."""
        return len(self._free) == 0

    @functools.cached_property
    def stability(self) -> str:
        """ "stable", "unstable", "neutral" or "undecided"; "stable set" where it lies in a set that attracts."""
        if not self.success:
            return "undecided"
        layer, flow = signs(self.layer_eigenvalues), signs(self.eigenvalues)
        if np.isnan(self.linear.matrix).any() or np.isnan(self.linear.layer).any():
            return "undecided"
        if layer[2] or (flow[2] and not self.linear.undecided):
            return "unstable"
        if self.linear.undecided:
            return "undecided"
        if layer[1] or flow[1] > len(self._free):
            return "neutral"
        return "stable set" if len(self._free) else "stable"

    @property
    def stable(self) -> bool:
        """Whether it attracts, layer included; a set of equilibria: whether the set does."""
        return self.stability.startswith("stable")

    def _described(self) -> tuple[str, Rows]:
        if not self.success:
            return f"No equilibrium: {self.message}", {}.items()
        kind = ", ".join(filter(None, ["virtual" if self.virtual else "", self.kind, self.stability]))
        names, held = self.multipliers, set(self.held)
        shown = {k: v for k, v in names.items() if k in held or k not in self._switches}
        sides = [f"{k} = {v:+.0f}" for k, v in names.items() if k in self._switches and k not in held]
        return f"Equilibrium: {kind}", {
            "at": values(self.start, self.x),
            "held": values(shown, list(shown.values())),
            "sides": listed(sides),
            "eigenvalues": listed(list(map(number, self.eigenvalues))),
            "layer": listed(list(map(number, self.layer_eigenvalues))),
            "virtual": [self.virtual] if self.virtual else [],
            "border": [self.border] if self.border else [],
            "undecided": [self.linear.undecided] if self.linear.undecided else [],
            "set": [f"one of a set of dimension {len(self._free)}"] if len(self._free) else [],
            "message": [self.message] if self.message else [],
        }.items()

    @property
    def _switches(self) -> set[str]:
        return {str(mu.symbol) for mu in self.system.model.multipliers if mu.kind == "switch"}


# ---- the doors


def _autonomous(system: Any, what: str) -> Any:
    """The system, written out; ValueError where it depends on time."""
    system = system._written_out()
    model = system.model
    if depends_on_time(model):
        timed = [
            f"the rate of {x}" for x, rate in zip(model.states, model.rhs) if model.time in rate.free_symbols
        ]
        timed += [f"the event {event.name!r}" for event in model.events if event.surface is None]
        names = checks.listing(timed[:5]) if timed else "a surface, gap or residual"
        raise ValueError(
            f"{what} depends on time ({names}), so that it has no equilibria; its periodic orbits are what "
            "find_orbit() finds, with the `period` of its forcing. Or give it constants in the place of what moves it."
        )
    return system


def _options(system: Any, sides: Mapping[Any, Any] | None) -> list[tuple[int, ...]]:
    """The sides that each multiplier may have, with those that are given."""
    model, given = system.model, {}
    sides = checks.mapping({} if sides is None else sides, "`sides`", "switches to 1, -1 or 0")
    able = [mu for mu in model.multipliers if mu.kind != "algebraic"]
    for key, side in system._spread(sides, "`sides`").items():
        s = checks.lookup(key, [mu.symbol for mu in able], "`sides`", "switch or contact")
        mu = next(mu for mu in able if mu.symbol == s)
        allowed = _sides_of(mu)
        if type(side) not in (int, float, np.int64) or side not in allowed:
            said = "a contact is open (1) or closed (0)" if mu.kind == "contact" else "choose one of " + ", ".join(
                map(str, allowed)
            )  # fmt: skip
            raise ValueError(f"`sides` of {s} is {checks.shown(side)}; {said}.")
        given[s] = int(side)
    return [(given[mu.symbol],) if mu.symbol in given else _sides_of(mu) for mu in model.multipliers]


def _sides_of(mu: Any) -> tuple[int, ...]:
    if mu.kind == "algebraic":
        return (0,)
    if mu.kind == "contact":
        return (1, 0)
    # A field that is continuous across a kink is never held there.
    return (1, -1) if mu.regularity == "kink" else (1, -1, 0)


def made(
    statics: Statics, u: np.ndarray, error: float, steps: int, system: Any, message: str = ""
) -> Equilibrium:
    """The Equilibrium of a solution u (N,), without its parameter."""
    row = u[None] if statics.q is not None else u[None, : statics.size]
    x, mult, _ = statics.parts(row)
    free = _free(statics(row)[1][0][:, : statics.size] * statics.unit) * statics.unit
    free = free / np.linalg.norm(free, axis=1, keepdims=True)
    return Equilibrium(
        system, x[:, 0], mult[:, 0], statics.sides, float(error), int(steps), True, message, free
    )


def _free(DF: np.ndarray) -> np.ndarray:
    """Directions, as rows, in which the equations with these derivatives (M, N) leave the unknowns free."""
    rows = np.abs(DF).max(axis=1, keepdims=True, initial=0.0)
    sizes, right = np.linalg.svd(DF / np.where(rows > 0, rows, 1.0))[1:]
    return right[np.sum(sizes > RANK * sizes.max(initial=1.0)) :]


def _same(one: Equilibrium, other: Equilibrium, unit: Any = 1.0) -> bool:
    """Whether two solutions are one point: also of two modes on whose common border it lies."""
    n = len(one.x) - one.system.model.n_memory
    if np.any(np.abs(one.x - other.x)[:n] > SAME * (unit + np.abs(one.x[:n]))):
        return False
    if one.sides == other.sides:
        return bool(np.all(np.abs(one.mult - other.mult) <= SAME * (1 + np.abs(one.mult))))
    apart = np.abs(one.mult - other.mult) > SAME * (1 + np.abs(one.mult))
    kinks = [mu.kind == "switch" and mu.regularity == "kink" for mu in one.system.model.multipliers]
    return not np.any(apart & ~np.array(kinks, bool))


def _fits(system: Any, x: np.ndarray) -> bool:
    return all(checks.fits(s, float(value)) for s, value in zip(system.model.states, x))


@checks.door(
    system=checks.system, box=checks.mapping, sides=checks.optional(checks.mapping), virtual=checks.flag,
    starts=checks.integer(1, 10**7),
)  # fmt: skip
def equilibria(
    system: Any, box: Mapping[Any, Any], *, sides: Any = None, virtual: bool = False, starts: int = 256
) -> list[Equilibrium]:
    """The equilibria in a box of states: regular ones, pseudo-equilibria and rests on contacts, of every mode.

    Parameters
    ----------
    system : System
        Autonomous: exact, layered or smoothed.
    box : mapping of state to (float, float)
        The lowest and the highest value of every state, in its unit.
    sides : mapping of switch or contact to {1, -1, 0}, optional
        Only modes in which these are on that side; 0: held on the surface, a closed contact.
    virtual : bool
        Whether virtual ones are given too: of a field beyond its surface, of lambda beyond [-1, 1], of a reaction < 0.
    starts : int
        Starts of Newton's method in each mode, which are spread evenly; doubled while they give new solutions.

    Returns
    -------
    list of Equilibrium
        Admissible ones first. Of a set of equilibria (a sticking block's) one member a mode and a kind of stability.

    Raises
    ------
    ValueError, TypeError
        A system that depends on time; a box that lacks a state; more than 4096 combinations of sides.

    Notes
    -----
    Where the equations of a mode are linear, the one solution is found for certain; else all to which a start leads.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the kinds; Jeffrey,
    On the mathematical basis of solid friction, for several lambda on one surface.

    Examples
    --------
    Static friction as a hidden term holds a block under a force in three ways, one of which repels:

    >>> import sympy as sp
    >>> from pwsmooth import Switch, System
    >>> from pwsmooth.analysis.equilibria import equilibria
    >>> v = sp.Symbol("v", real=True)
    >>> lam = Switch("lam", v)
    >>> pulled = System({v: 1.2 - lam * (1 + 3 * (1 - lam**2))})
    >>> [(round(e.multipliers["lam"], 6), e.stability) for e in equilibria(pulled, {v: (-1, 1)})]
    [(0.32598, 'stable'), (0.956669, 'unstable')]
    """
    system = _autonomous(system, "`system`")
    model = system.model
    own = model.states[: len(model.states) - model.n_memory]
    bounds = {}
    names = [(str(getattr(checks.named(key), "name", key)), key, pair) for key, pair in box.items()]
    groups = system.groups  # of a family: one pair for all of its elements
    for each, pair in ((each, pair) for name, key, pair in names for each in groups.get(name, (key,))):
        s = checks.lookup(each, own, "`box`", "state")
        low, high = bounds[s] = checks.pair(pair, f"`box` of {s}")
        if not low < high:
            raise ValueError(f"`box` of {s} is ({low:g}, {high:g}); give the lowest first.")
    if missing := [s for s in own if s not in bounds]:
        raise ValueError(
            f"`box` has no bounds for {checks.listing(missing)}; give (lowest, highest) of every state."
        )
    low, high = np.array([bounds[s] for s in own]).reshape(-1, 2).T
    unit = high - low
    memories = np.array([float(system.initial_memory[m]) for m in system.initial_memory])
    found: list[Equilibrium] = []
    options = _options(system, sides)
    if (count := math.prod(map(len, options))) > _MOST_MODES:
        raise ValueError(
            f"`system` has {count} combinations of sides, more than {_MOST_MODES}; give the side of some switches in "
            "`sides`."
        )
    seeds = _beside_exact(system, lambda exact: equilibria(
        exact, {s: pair for s, pair in bounds.items() if s in exact.states}, starts=starts))  # fmt: skip
    for mode in itertools.product(*options):
        for e in _of_mode(Statics(system, mode, memories, unit=unit), low, high, starts, virtual, seeds):
            if not any(_same(one, e, unit) for one in found):
                found.append(e)
    found = [e for e in found if not _ends_set(e, found)]
    return sorted(found, key=lambda e: (bool(e.virtual), e.held != (), *e.x, *e.mult))


def _beside_exact(system: Any, found: Any) -> np.ndarray:
    """Starts for a smoothed view, (k, n): where the exact system stands still, within its layers lam = Lambda(h/eps).

    Outside of its layers a smoothed switch is flat, and no start leads into them.
    """
    model, view = system.model, system._view
    n = len(model.states) - model.n_memory
    seeds: list[np.ndarray] = []
    if not model.smoothing:
        return np.empty((0, n))
    values = {p.name: value for p, value in system.parameters.items()}
    exact = view.original
    exact = exact.with_parameters({p.name: values[p.name] for p in exact.parameters if p.name in values})
    widths = [values[eps.name] for _, eps in model.smoothing]  # in the order of the switches
    inverse = _inverse(model.sigmoid)
    for e in found(exact):
        held = [j for j, side in enumerate(e.sides) if side == 0 and j < len(widths) and abs(e.mult[j]) < 1]
        line = linearise(e.system.model)
        p = np.array(e.system.parameter_values, float)
        H = line.constraints(np.zeros(1), e.x[:, None], e.mult[:, None], p)[1][0][held]
        depth = np.array([widths[j] * inverse(e.mult[j]) for j in held])
        at = dict(zip(map(str, e.system.states), e.x + np.linalg.pinv(H) @ depth))
        point = {s: v for s, v in zip((mu.symbol for mu in e.system.model.multipliers), e.mult)}
        point |= dict(zip(e.system.states, e.x)) | e.system.parameters
        at |= {str(z.symbol): value(z.equilibrium, point) for z in e.system.model.layer_states}
        seeds.append(np.array([at[str(s)] for s in model.states[:n]]))
    return np.array(seeds).reshape(-1, n)


@functools.lru_cache(maxsize=8)
def _inverse(name: str) -> Any:
    lam = sp.Symbol("lam", real=True)
    return sp.lambdify(lam, sigmoid(name).inverse(lam), modules=["scipy", "numpy"])


def _of_mode(
    statics: Statics, low: np.ndarray, high: np.ndarray, starts: int, virtual: bool, seeds: np.ndarray
) -> list[Equilibrium]:
    """All solutions of a mode inside the box to which starts lead."""
    from scipy.stats import qmc

    system, n = statics.system, statics.n
    slack = 1e-9 * (high - low)
    points = qmc.Halton(statics.size, scramble=False)
    points.fast_forward(1)  # the first one is a corner
    found: list[Equilibrium] = []
    count = min(starts, _BATCH)
    taken = 0
    while taken < max(starts, 1) * _MOST_BATCHES:
        u = _spread(points.random(count), statics, low, high, virtual)
        if taken == 0 and _one_solution(statics, u):
            u = u[:1]
        if taken == 0 and len(seeds):
            u = np.concatenate([seeds, u])
        taken += count
        u, errors, steps = newton(statics, u)
        new = False
        for k in np.flatnonzero(np.isfinite(errors)):
            x = u[k, :n]
            if np.any((x < low - slack) | (x > high + slack)):
                continue
            e = made(statics, u[k], errors[k], steps[k], system)
            if not _fits(system, e.x) or (e.virtual and not virtual):
                continue
            if any(_same(one, e, statics.unit[:n]) or _one_set(one, e) for one in found):
                continue
            found.append(e)
            new = True
        if len(u) == 1 or (taken >= starts and not new):
            break
    return found


def _one_set(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two are taken for members of one set of equilibria."""
    if one.isolated or other.isolated or one.sides != other.sides:
        return False
    return bool(one.virtual) == bool(other.virtual) and one.stability == other.stability


def _ends_set(e: Equilibrium, found: list[Equilibrium]) -> bool:
    """Whether an equilibrium of a side, on its surface, is the end of a set that is held there."""
    if not e.border or not e.isolated:
        return False
    memories = e.x[len(e.x) - e.system.model.n_memory :]
    for sides in {one.sides for one in found if not one.isolated}:
        own = [a for a, b in zip(e.sides, sides) if a != b]
        statics = Statics(e.system, sides, memories)
        u = np.concatenate([e.x[: statics.n], e.mult[statics.J]])[None]
        if own and all(own) and statics.error(*statics(u), u)[0] <= 1e3 * ROUNDING:
            return True
    return False


def _spread(points: np.ndarray, statics: Statics, low: np.ndarray, high: np.ndarray, wide: bool) -> np.ndarray:
    """Points of the unit cube over the box; multipliers of switches over [-1, 1], others over a long-tailed line."""
    u = points.copy()
    n = statics.n
    u[:, :n] = low + (high - low) * points[:, :n]
    for k, j in enumerate(statics.J, n):
        centred = 2 * points[:, k] - 1
        tail = np.tan(0.499 * math.pi * centred)
        if statics.system.model.multipliers[j].kind != "switch":
            u[:, k] = tail
        else:
            u[:, k] = centred
            if wide:  # every second one beyond
                u[1::2, k] = 2 * tail[1::2]
    return u


def _one_solution(statics: Statics, u: np.ndarray) -> bool:
    """Whether the equations are linear, as the same derivatives at all these points say, and not singular."""
    DF = statics(u)[1]
    if not np.isfinite(DF).all():
        return False
    if not np.all(np.abs(DF - DF[0]) <= 1e-13 * np.abs(DF[0]).max(initial=0.0)):
        return False
    return _free(DF[0] * statics.unit).shape[0] == 0


@checks.door(system=checks.system, sides=checks.optional(checks.mapping), virtual=checks.flag)
def find_equilibrium(system: Any, x0: Any, *, sides: Any = None, virtual: bool = False) -> Equilibrium:
    """Find an equilibrium near a start, in whatever mode it lies.

    Parameters
    ----------
    system : System
        Autonomous: exact, layered or smoothed.
    x0 : mapping or sequence of float, length n
        First guess, in the units of the states; a mapping may name multipliers too, to choose between several lambda.
    sides : mapping of switch or contact to {1, -1, 0}, optional
        Only modes in which these are on that side; 0: held on the surface, a closed contact.
    virtual : bool
        Whether a virtual one will do where no admissible one is found.

    Returns
    -------
    Equilibrium
        The admissible one nearest to the guess; `success` False and a `message` where there is none.

    Raises
    ------
    ValueError, TypeError
        A system that depends on time; bad input.

    Notes
    -----
    Newton's method in every mode; of more than 4096 in that of the start, and from there, while what it finds is
    virtual, in the mode to which that points. Of several multipliers at one state the nearest to the guess of it is
    taken, and without one what is stable.

    Source: Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, for pseudo-equilibria.

    Examples
    --------
    A ball on a floor, which carries it:

    >>> import sympy as sp
    >>> from pwsmooth import System, Unilateral, find_equilibrium
    >>> y, v = sp.symbols("y v", real=True)
    >>> floor = Unilateral(y, restitution=0.5, name="R")
    >>> rest = find_equilibrium(System({y: v, v: -9.81 + floor.reaction}), {y: 1, v: 0})
    >>> rest.kind, rest.multipliers
    ('rest on a contact', {'R': 9.81})
    """
    system = _autonomous(system, "`system`")
    model = system.model
    guesses = {}
    if isinstance(x0, Mapping):
        names = {str(mu.symbol): j for j, mu in enumerate(model.multipliers)}
        key = {k: str(getattr(checks.named(k), "name", k)) for k in x0}
        guesses = {
            names[key[k]]: checks.number(value, f"`x0`, value of {k}")
            for k, value in x0.items()
            if key[k] in names
        }
        x0 = {k: value for k, value in x0.items() if key[k] not in names}
    start = np.array(system.initial_state(x0), float)
    n = len(start) - model.n_memory
    found: list[tuple[float, float, Equilibrium]] = []
    named = {str(s): value for s, value in zip(model.states, start)}
    seeds = _beside_exact(system, lambda exact: filter(lambda e: e.success, [
        find_equilibrium(exact, {s: named[str(s)] for s in exact.states if str(s) in named})]))  # fmt: skip

    def tried(mode: Sides) -> list[Equilibrium]:
        statics = Statics(system, mode, start[n:])
        first = _from(start[:n], statics, guesses)
        if len(seeds):
            first = np.concatenate([seeds, first])
        u, errors, steps = newton(statics, first)
        these = [made(statics, u[k], errors[k], steps[k], system) for k in np.flatnonzero(np.isfinite(errors))]
        for e in these:
            if _fits(system, e.x) and not any(_same(e, other) for *_, other in found):
                far = float(np.linalg.norm((e.x - start) / (1 + np.abs(start))))
                off = max((abs(e.mult[j] - guess) for j, guess in guesses.items()), default=0.0)
                found.append((far, off, e))
        return these

    options = _options(system, sides)
    if math.prod(map(len, options)) <= _MOST_MODES:
        for mode in itertools.product(*options):
            tried(mode)
    else:
        _pivoted(system, start, options, tried)
    found = [one for one in found if not _ends_set(one[-1], [e for *_, e in found])]
    order = sorted(
        found, key=lambda one: (round(one[0], 8), one[1], not one[2].stable, np.abs(one[2].mult).sum())
    )
    admissible = [e for *_, e in order if e.admissible]
    if admissible:
        return admissible[0]
    if order and virtual:
        return order[0][-1]
    nothing = "Newton's method converged in no mode: give a nearer guess, or a box of them to equilibria()."
    why = f"the nearest is virtual, {order[0][-1].virtual}; `virtual=True` gives it." if order else nothing
    lost = np.full(len(model.multipliers), np.nan)
    return Equilibrium(system, start, lost, (0,) * len(lost), math.inf, 0, False, why)


def _pivoted(system: Any, start: np.ndarray, options: list[tuple[int, ...]], tried: Any) -> None:
    """Of many modes, that of the start, and from each solution that is virtual the mode in which it would not be."""
    model = system.model
    n, m = len(model.states) - model.n_memory, len(model.multipliers)
    statics = Statics(system, (1,) * m, start[n:])
    h, on = margins(statics.line, start, np.zeros(m), statics.p, statics.sides)
    mode = [0 if abs(h_j) <= size else int(np.sign(h_j)) for h_j, size in zip(h, on)]
    seen: set[Sides] = set()
    while True:
        mode = [side if side in allowed else allowed[0] for side, allowed in zip(mode, options)]
        if tuple(mode) in seen:
            return
        seen.add(tuple(mode))
        these = tried(tuple(mode))
        if not these or any(e.admissible for e in these):
            return
        e = these[0]
        statics = Statics(system, e.sides, start[n:])
        inside = statics.margins(np.concatenate([e.x[:n], e.mult[statics.J]]))[0]
        for j in np.flatnonzero(inside < 0):
            if model.multipliers[j].kind == "contact":
                mode[j] = 1 - mode[j]
            elif mode[j] == 0:
                mode[j] = int(np.sign(e.mult[j]))
            else:
                mode[j] = 0 if 0 in options[j] else -mode[j]


def _from(x: np.ndarray, statics: Statics, guesses: Mapping[int, float]) -> np.ndarray:
    """Starts at one state: with several values of what is held, where none is given."""
    multipliers = statics.system.model.multipliers
    values: list[tuple[float, ...]] = []
    for j in statics.J:
        if j in guesses:
            values.append((guesses[j],))
        elif multipliers[j].kind == "switch":
            values.append((0.0, 0.5, -0.5, 0.9, -0.9, 0.25, -0.25, 1.0, -1.0)[: 9 if len(statics.J) < 3 else 3])
        else:
            values.append((0.0, 1.0) if len(statics.J) < 3 else (0.3,))
    rows = list(itertools.islice(itertools.product(*values), 512))
    free = np.array(rows, float).reshape(len(rows), len(statics.J))
    u = np.column_stack([np.tile(x, (len(free), 1)), free])
    if not statics.J:
        return u
    # A start within a set of equilibria, of a block that sticks there, stays: the multipliers alone are solved for.
    still = u.copy()
    for _ in range(_MOST_NEWTON):
        F, DF = statics(still)
        if not (np.isfinite(F).all() and np.isfinite(DF).all()):
            return u
        step = (np.linalg.pinv(DF[:, :, statics.n :], rcond=RANK) @ F[:, :, None])[:, :, 0]
        still[:, statics.n :] -= step
        if np.all(np.abs(step) <= ROUNDING * (1 + np.abs(still[:, statics.n :]))):
            break
    return np.concatenate([still, u])
