"""The lowered model: what a System becomes once its notation is lifted and a view is chosen.

    dx/dt = f(t, x, mult; p),      mult = (lambda_1, ..., R_1, ..., a_1, ...)

Four kinds of multiplier share one mechanism. Each has a residual g(t, x, mult; p) that vanishes while
the multiplier is *solved*, and a fixed value otherwise:

    switch     g = dh/dt     fixed at +1 or -1 off its surface, solved while sliding
               g = d2h/dt2   of relative degree 2: solved while h = dh/dt = 0 is held (second-order sliding)
    disc       g = dh_i/dt of each component of lambda, solved in stick; in slip lambda is h/|h| (discs.py)
    contact    g = d2h/dt2   fixed at 0 while open, solved while closed
    algebraic  g as given    always solved

Chain: System (notation) -> Model (this file) -> codegen (compiled addresses) -> kernels (numbers only).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, cast

import numpy as np
import sympy as sp


def core(e):
    """(c, core) with e = c core: the same core for all multiples of an expression by a number."""
    c, e = e.as_coeff_Mul()
    if e.is_Add:
        part, e = e.primitive()
        c *= part
    return (-c, -e) if e.could_extract_minus_sign() else (c, e)


class Select(sp.Function):
    """Branch selection by a multiplier: `a` where lam = 1, `b` where lam = -1, affine in between.

    Only the active branch is evaluated when lam is exactly 1 or -1, so the other one may be undefined there.
    """

    nargs = 3

    @classmethod
    def eval(cls, lam, a, b):
        if a == b or lam == 1:
            return a
        if lam == -1:
            return b
        return None

    def fdiff(self, argindex=1):
        lam, a, b = self.args
        if argindex == 1:
            return (a - b) / 2
        return (1 + lam) / 2 if argindex == 2 else (1 - lam) / 2

    def _eval_derivative(self, s):
        lam, a, b = self.args
        # The branches are differentiated inside the selection: an undefined one must stay unevaluated.
        return Select(lam, a.diff(s), b.diff(s)) + lam.diff(s) * (a - b) / 2

    def affine(self, surface=None):
        """The form that serves while the switch slides or its layer is resolved.

        There its `surface` is 0, and so are powers of it.
        """
        a, b = self.args[1:] if surface is None else self.on(surface)
        return (a + b) / 2 + self.args[0] * (a - b) / 2

    def on(self, surface):
        """The branches on a surface: a power of it, |h|**1.5 say, is 0 with its whole series, and not that of its
        rounding.
        """
        return tuple(_with_powers(e, surface, lambda p: sp.S.Zero) for e in self.args[1:])

    def clamped(self, surface):
        """The branches, up to the surface and a rounding beyond: powers of it do not become nan there."""
        return tuple(
            _with_powers(e, surface, lambda p: Above(*p.args) if p.exp.is_positive else p)
            for e in self.args[1:]
        )


def on_side(e, lam, side):
    """A lifted expression on one side of a switch: of its selections the branches there."""
    return e.xreplace({s: s.args[1 if side > 0 else 2] for s in e.atoms(Select) if s.args[0] == lam})


def sides_of(surface):
    """What a surface is on the sides of all switches that select in it."""
    inner = min((s.args[0] for s in surface.atoms(Select)), key=str, default=None)
    if inner is None:
        return [surface]
    return [h for side in (1, -1) for h in sides_of(on_side(surface, inner, side))]


def _with_powers(e, surface, change):
    """`e` with `change` applied to powers of a surface that are no polynomials, on a side of a switch to those of what
    the surface is there.
    """
    powers = [p for p in e.atoms(sp.Pow) if not p.exp.is_integer]
    if not powers:
        return e
    zero = core(surface)[1]
    changes = {p: change(p) for p in powers if any(core(f)[1] == zero for f in sp.Mul.make_args(p.base))}
    inner = {s.args[0] for s in surface.atoms(Select)}
    for s in e.atoms(Select) if inner else ():
        if (lam := s.args[0]) in inner:
            branches = zip(s.args[1:], (1, -1), strict=True)
            changes[s] = Select(lam, *(_with_powers(b, on_side(surface, lam, k), change) for b, k in branches))
    return e.xreplace(changes) if changes else e


class Held(sp.Function):
    """Choice by whether a multiplier stands between its bounds: `apart` where lam is 1 or -1, else `held`."""

    nargs = 3

    def _eval_derivative(self, s):
        lam, apart, held = self.args
        return Held(lam, apart.diff(s), held.diff(s))


class Above(sp.Function):
    """Max(0, base)**exponent, with the series of base**exponent."""

    nargs = 2


class Whole(sp.Function):
    """The integer nearest to u, where motions come no nearer to the middle between two: its series ends at order 0."""

    nargs = 1

    @classmethod
    def eval(cls, u):
        return sp.floor(u + sp.S.Half) if u.is_number else None

    def fdiff(self, argindex=1):
        return sp.S.Zero

    def _eval_is_integer(self):
        return True


class Table(sp.AtomicExpr):
    """The pieces of a sampled drive up to time `end`: in each row t_k, c_d, ..., c_0 (drives.py).

    Generated code reads it in memory, and its text knows its name alone, so that one text serves every record.
    """

    def __new__(cls, name, rows, end):
        self = super().__new__(cls)
        self.name, self.rows, self.end = name, np.ascontiguousarray(rows), end
        return self

    def __getnewargs__(self):
        return self.name, self.rows, self.end

    def __getstate__(self):
        return None

    def _hashable_content(self):
        return self.name, self.rows.tobytes(), self.end

    def _sympystr(self, printer):
        return f"Table({self.name!r})"

    _sympyrepr = _sympystr

    @property
    def instants(self):
        """Times at which a cell ends and the next one begins, shape (n - 2,)."""
        return self.rows[1:, 0]

    def cell(self, t):
        """Number of the cell that a run is in from time t on."""
        return float(np.searchsorted(self.instants, t, side="right"))

    def check(self, t0, t1):
        """Refuses a span that goes beyond the record."""
        if not self.rows[0, 0] <= t0 <= t1 <= self.end:
            raise ValueError(
                f"the run goes from {t0:g} to {t1:g}, but the record of the drive {self.name!r} from "
                f"{self.rows[0, 0]:g} to {self.end:g}; stay inside of it, or lengthen the record."
            )


class Entry(sp.Function):
    """Entry(table, row, column): a number of a table, constant along a smooth piece of the motion."""

    nargs = 3

    def fdiff(self, argindex=1):
        return sp.S.Zero

    def _eval_is_real(self):
        return True


BOTH = 2  # conditions of one surface that say different things of where it stays at 0, as x > 0 and x >= 0


@dataclass(frozen=True)
class Multiplier:
    """One unknown of the right-hand side that is fixed or solved; see the table above."""

    symbol: sp.Symbol
    kind: str  # "switch" | "disc" | "component" | "contact" | "algebraic"
    residual: sp.Expr
    surface: sp.Expr | None = None  # h(t, x, mult; p); None for an algebraic unknown
    regularity: str = "sliding"  # "kink" | "sliding" (relative degree 1) | "crossing" (higher)
    hidden: bool = False  # the residual is nonlinear in this multiplier
    # Contact: the whole state after an impact; of elements (index, or Beside, and new value) of what changes.
    impact: tuple[Any, ...] | None = None
    second: sp.Expr | None = None  # d2h/dt2 of a switch that can slide to second order
    beside: sp.Expr | None = (
        None  # dh/dt, or d2h/dt2 while a kink in h is held from whose dh/dt lambda has gone
    )
    # Of a switch: its value where h stays at 0 whatever it is, an expression of its sign, or BOTH; None: any.
    at_zero: int | sp.Expr | None = None

    @property
    def may_be_solved(self) -> bool:
        """Whether it is ever solved for: kinks and crossings are not."""
        return self.kind != "switch" or self.regularity == "sliding"

    @property
    def condition(self) -> sp.Expr:
        """g: what vanishes while the multiplier is solved."""
        return next(e for e in (self.beside, self.second, self.residual) if e is not None)


@dataclass(frozen=True)
class EventSpec:
    """A lowered Event: a zero of `surface`, or the instants `every`, 2*every, ... or `at` (of a drive, its table).

    With `singular` it is no event of the user's: `surface` is an argument at whose zero the function `name` has a
    "pole", the "end" of its domain or a "branch" point (singular.py).
    """

    name: str
    surface: sp.Expr | None = None
    every: sp.Expr | None = None
    at: tuple[sp.Expr, ...] = ()
    direction: int = 0
    when: sp.Basic = sp.true
    update: tuple[tuple[int, sp.Expr], ...] = ()  # (index of state, its new value from the values before)
    terminal: bool = False
    singular: str = ""
    recorded: bool = True
    together: str | None = None  # of primitives.TOGETHER
    offset: sp.Expr | None = (
        None  # of a switch of time alone, kept as a memory: it happens at offset + k every, too
    )

    @property
    def tables(self) -> tuple[Table, ...]:
        """Those of the drives whose samples are its instants."""
        return tuple(at for at in self.at if isinstance(at, Table))

    def writes(self, states: Sequence[sp.Symbol]) -> list[tuple[int, sp.Expr, bool]]:
        """(index of state, expression, whether that is added): an update x + e adds e if e does not read x.

        Events of one instant act on the values before it; what they add to one state adds up.
        """
        result = []
        for index, value in self.update:
            state = index.symbol if isinstance(index, Beside) else states[index]
            e = value - state
            if state in e.free_symbols and sp.count_ops(e) <= 60:
                e = sp.expand(e)
            adds = state not in e.free_symbols
            result.append((index, e if adds else value, adds))
        return result


class Beside(int):
    """Index of a state of a neighbour, which an event of an element writes; `symbol` is that state there."""

    offset: int
    symbol: sp.Symbol

    def __new__(cls, index: int, offset: int, symbol: sp.Symbol) -> Beside:
        self = super().__new__(cls, index)
        self.offset, self.symbol = offset, symbol
        return self

    def __reduce__(self) -> Any:
        return Beside, (int(self), self.offset, self.symbol)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Beside) and (int(self), self.offset) == (int(other), other.offset)

    def __hash__(self) -> int:
        return hash((int(self), self.offset))

    def __repr__(self) -> str:
        return f"Beside({int(self)}, {self.offset})"


def of_event(event: Any) -> Iterator[sp.Basic]:
    """The expressions of an Event or EventSpec: when it happens, whether it acts, what it writes."""
    yield from (e for e in (event.surface, event.every, *event.at, event.when) if e is not None)
    yield from (e for _, e in event.update)


@dataclass(frozen=True)
class LayerState:
    """A fast internal state that lives only in the layer: dz/dtau = ratio * rate, tau = t/eps.

    `ratio` is sp.oo (slaved), 0 (two-stage) or the parameter symbol that carries the finite ratio.
    """

    symbol: sp.Symbol
    ratio: sp.Expr
    rate: sp.Expr  # Q(t, x, mult, z; p), without its time constant
    equilibrium: sp.Expr  # z(t, x, mult; p) with rate = 0


@dataclass(frozen=True)
class Model:
    """Everything that codegen needs, in sympy; immutable and hashable.

    `states` holds the dynamic states, then `n_memory` memories (whose rate is 0).
    `smoothing` lists (h, eps symbol) of a smoothed view: the layers that must not be stepped over.
    """

    time: sp.Symbol
    states: tuple[sp.Symbol, ...]
    parameters: tuple[sp.Symbol, ...]
    rhs: tuple[sp.Expr, ...]
    multipliers: tuple[Multiplier, ...] = ()
    events: tuple[EventSpec, ...] = ()
    outputs: tuple[tuple[str, sp.Expr], ...] = ()
    n_memory: int = 0
    layer_states: tuple[LayerState, ...] = ()
    layer_residuals: tuple[sp.Expr, ...] = ()  # of every multiplier, with the layered states free
    eps_ratio: tuple[float, ...] = ()  # of every multiplier: eps_j relative to the first switch's
    sigmoid: str | sp.Expr = "algebraic"  # a name, or Lambda(u) itself
    smoothing: tuple[tuple[sp.Expr, sp.Symbol], ...] = field(default=())
    # No field: only a model with families whose copies are not written out has families (template.FamilyModel).
    families = cast(Any, None)
    functions = cast(Any, None)  # only a model made of functions has them (functions.FunctionModel)

    @functools.cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, f.name) for f in fields(self)))

    def __hash__(self) -> int:
        return self._hash  # every solve() looks for what it keeps of a model

    def __getstate__(self) -> dict[str, Any]:
        # Hashes differ from process to process.
        return {name: value for name, value in self.__dict__.items() if name != "_hash"}


def tables_of(model: Model) -> list[Table]:
    """The tables that code of the model reads, in the order of their numbers there."""
    return [table for event in model.events for table in event.tables]
