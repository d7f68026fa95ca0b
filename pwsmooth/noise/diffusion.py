"""Diffusions: dx = f(t, x, lambda) dt + G(t, x, lambda) dW, in Ito's sense, and their ensembles.

What the amplitudes mean for a system is decided here, in symbols: the matrix G of a view, Milstein's terms
L_j g_k = sum_i G_ij dG_k/dx_i (which need commuting columns), on which surfaces the noise acts, and how fast the
drift varies. The generated functions go to kernels/noise/path.py, which takes the steps.

Chain: solve, ensemble -> diffusion_run.py -> **this file** (symbols) -> kernels/noise/path.py.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from ..definition import checks
from ..definition.discs import discs_of
from ..definition.expansion import Expansion
from ..definition.model import Held, Model, Multiplier
from ..definition.pointwise import draw, value
from ..definition.views import substitutes

NEAREST = sp.Symbol("amplitude_nearest", real=True)  # the finest step: what a path does in it is not looked at
_TINY = sp.Float(1e-300)  # so that a start with h = 0 has a direction, 0
_BENT = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Piecewise, sp.Heaviside)


@dataclass(frozen=True)
class Diffusion:
    """White noise that drives some states, with constant or state-dependent amplitude.

    Parameters
    ----------
    amplitude : mapping or Matrix
        State -> expression: each such state has a source of its own. State -> {source name: expression}: sources
        may be shared. A Matrix has one row a state, one column a source. Expressions in states, time, parameters
        and, of a smoothed view, switches; unit: that of the state over the root of time. The member of a `Family`
        stands for the states of all elements, each with a source of its own unless that is named, and its expression
        for that of each element.
    step : float, in units of time
        The interval of time, > 0, on whose multiples the path is given, and the longest step: short against the times
        over which the drift varies. Steps are halves, quarters, ... of it where the drift is faster, and beside
        surfaces. The start, the end and `t_eval` are multiples of it.
    seed, trajectory : int
        The Brownian path is a function of (seed, trajectory, step), whatever steps are taken along it.
    parameters : mapping of Symbol to float, optional
        Values of symbols that stand in the amplitude alone, in the units of the model.
    convention : {"ito", "stratonovich"}
        How the amplitude is meant.
    resolution : float, dimensionless
        Steps keep to `resolution` over the rate of the drift, and cross at most 2.5 `resolution` of a layer.
    level : int
        Every interval is halved at least so often: the same path, finer steps.
    finest : int
        Further halvings beside a surface on which the noise acts (a switch, an event).

    Raises
    ------
    ValueError, TypeError
        Here: sizes and integers out of range. In solve(): states or symbols that do not exist, an amplitude that
        cannot be differentiated by the states, columns that do not commute.

    Notes
    -----
    Between switches: strong order 1.5 and weak order 2 in the step where the amplitude is constant (Roessler's
    SRA1), strong and weak order 1 where it depends on the state (Milstein). Across a switch on whose surface the
    noise acts, the drift is discontinuous and the order falls: about 3/4 strong with equal steps; with one level
    of `finest` more for each level, so that the steps beside the surface shrink as the square, about 1 in the mean
    number of steps.

    Noise that acts on a switch's surface leaves no sticking at eps = 0: the path meets the surface in a set of
    times of measure zero, and terms hidden on it never act (a warning says so). Noise on other states leaves
    sticking as it is, and makes its end a first passage of the multiplier; how many of the short slips that follow
    such an end are seen depends on `step` and `finest`. Noise that acts on the surface of a `Disc` leaves no sticking
    either: lambda = h/|h|, with finer steps about h = 0. A disc that the noise leaves alone sticks and slips; a slip
    whose direction turns faster than the steps beside h = 0 (`finest`) has one lambda a step, that of its end.

    Source: Roessler, SIAM J. Numer. Anal. 48 (2010) 922-952 for SRA1; Milstein, Theory Probab. Appl. 19 (1974) 557-562;
    the orders across a switch were measured here.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import Diffusion, System, solve
    >>> x = sp.Symbol("x")
    >>> path = solve(System({x: -x}), (0, 1), {x: 0}, noise=Diffusion({x: 0.3}, step=1 / 64, seed=5))
    >>> len(path.t)
    65
    """

    amplitude: Any
    step: float
    seed: int = 0
    trajectory: int = 0
    parameters: Mapping[Any, float] = field(default_factory=dict)
    convention: str = "ito"
    resolution: float = 0.1
    level: int = 0
    finest: int = 6

    def __post_init__(self) -> None:
        set_to = functools.partial(object.__setattr__, self)
        set_to("step", checks.positive(self.step, "`step` of the diffusion"))
        set_to("resolution", checks.positive(self.resolution, "`resolution`"))
        if self.resolution > 0.5:
            raise ValueError(f"`resolution` is {self.resolution:g}; give a number up to 0.5, such as 0.1.")
        checks.fields(self, convention=checks.one_of("ito", "stratonovich"))
        for name in ("seed", "trajectory"):
            set_to(name, checks.exact_integer(getattr(self, name), f"`{name}`"))
        for name in ("level", "finest"):
            set_to(name, checks.whole(getattr(self, name), f"`{name}`", 0, 20))
        if not isinstance(self.amplitude, (Mapping, sp.MatrixBase)):
            raise TypeError(
                f"`amplitude` is {checks.shown(self.amplitude)}; give state -> expression, such as {{v: 0.1}}, or a "
                "sympy Matrix."
            )
        if isinstance(self.amplitude, Mapping):
            set_to("amplitude", {str(key): _entry(key, value) for key, value in self.amplitude.items()})
            if not self.amplitude:
                raise ValueError(
                    "`amplitude` is empty; name the states that the noise drives, such as {v: 0.1}."
                )
        set_to("parameters", checks.values(self.parameters, "`parameters` of the diffusion"))
        inside = {s.name for e in self._expressions() for s in e.free_symbols}
        if unknown := [name for name in self.parameters if name not in inside]:
            raise ValueError(
                f"`parameters` of the diffusion names {checks.listing(unknown)}, which is not in the amplitude; leave "
                "it out."
            )

    def _expressions(self) -> list[sp.Expr]:
        if isinstance(self.amplitude, sp.MatrixBase):
            return [checks.expression(e, "`amplitude`, an entry") for e in self.amplitude]
        return [e for row in self.amplitude.values() for e in row.values()]

    def entries(
        self, states: list[sp.Symbol], groups: Mapping[str, Sequence[str]] | None = None
    ) -> list[tuple[int, str, sp.Expr]]:
        """The entries of the amplitude that are not 0.

        Parameters
        ----------
        states : list of Symbol
            States of the view, in order.
        groups : mapping of str to sequence of str, optional
            Names of a family's member in all elements.

        Returns
        -------
        list of (int, str, Expr)
            Index of the state, name of the source, expression in the unit of the state over the root of time.

        Raises
        ------
        ValueError
            A state that the view does not have; a Matrix with another number of rows.
        """
        if isinstance(self.amplitude, sp.MatrixBase):
            if self.amplitude.rows != len(states):
                raise ValueError(
                    f"`amplitude` has {self.amplitude.rows} rows; this view has {len(states)} states "
                    f"({checks.listing(states)})."
                )
            rows, columns = self.amplitude.shape
            found = [(i, f"source {k + 1}", self.amplitude[i, k]) for i in range(rows) for k in range(columns)]
        else:
            found, written = [], Expansion()
            for name, sources in self.amplitude.items():
                members = (groups or {}).get(name)
                for k, own in enumerate(members or (name,)):
                    i = states.index(checks.lookup(own, states, "`amplitude`", "state"))
                    found += [
                        (i, own if source == name else source, written.element(e, k if members else None))
                        for source, e in sources.items()
                    ]
        return [entry for entry in found if not entry[2].is_zero]

    def __str__(self) -> str:
        if isinstance(self.amplitude, sp.MatrixBase):
            shown = str(self.amplitude.tolist())
        else:
            shown = ", ".join(
                f"{sp.sstr(e, full_prec=False)} dW[{source}] on {state}"
                for state, row in self.amplitude.items()
                for source, e in row.items()
            )
        values = "".join(f", {name} = {value:g}" for name, value in self.parameters.items())
        return (
            f"{self.convention} diffusion {shown}{values}, step {self.step:g}, seed {self.seed}, "
            f"trajectory {self.trajectory}"
        )


def _entry(state: Any, value: Any) -> dict[str, sp.Expr]:
    sources = value if isinstance(value, Mapping) else {str(state): value}
    return {
        str(source): checks.expression(e, f"`amplitude` of {state}, source {source}")
        for source, e in sources.items()
    }


# ---- a diffusion on a view, in symbols


@dataclass(frozen=True)
class Lowered:
    """A model with what its noise needs: its `outputs` are what kernels/noise_state.Diffused.out holds."""

    model: Model
    q: int
    pairs: int
    moving: bool
    spreads: tuple[sp.Expr, ...]  # of every surface: |dh . G|^2

    @property
    def noisy(self) -> tuple[bool, ...]:
        """Whether the noise acts on each surface."""
        return tuple(s != 0 for s in self.spreads)

    def holds(self, values: Mapping[sp.Symbol, float]) -> bool:
        """Whether no surface that seems noisy in symbols is quiet with these numbers."""
        return all(s == 0 or not _vanishes(s.subs(values)) for s in self.spreads)


def meaning(system: Any, own: Mapping[str, sp.Symbol]) -> dict[str, sp.Expr]:
    """Name -> expression in the symbols of the view's model."""
    model = system.model
    named: dict[str, sp.Expr] = {str(s): s for s in (model.time, *model.states, *model.parameters)}
    named |= {str(m.symbol): m.symbol for m in model.multipliers}
    named |= substitutes(system)
    return named | {name: symbol for name, symbol in own.items() if name not in named}


def split(entries, named, values, lift):
    """(entries in the model's symbols, values of the symbols that stand for their numbers if `lift`)."""
    numbers: dict[float, sp.Symbol] = {}
    found = []
    for i, source, e in entries:
        unknown = sorted({s.name for s in e.free_symbols} - set(named))
        if unknown:
            raise ValueError(
                f"`amplitude` contains {checks.listing(unknown)}, which is nothing of this view; it has "
                f"{checks.listing(named)}. Values of further symbols go into `parameters` of the diffusion."
            )
        e = e.xreplace({s: named[s.name] for s in e.free_symbols})
        if e.has(sp.I, sp.nan, sp.zoo, sp.oo):
            raise ValueError(f"`amplitude` contains {e}; give real, finite expressions.")
        if e.subs(values).is_zero:
            continue
        factor, rest = e.as_coeff_Mul()
        size = abs(float(factor))
        if lift and size != 1:
            # Numbers become parameters, so that another one compiles nothing; equal ones stay equal.
            symbol = numbers.setdefault(size, sp.Symbol(f"amplitude_{len(numbers)}", real=True))
            e = (symbol if factor > 0 else -symbol) * rest
        found.append((i, source, e))
    return tuple(found), {symbol: size for size, symbol in numbers.items()}


@functools.lru_cache(maxsize=64)
def lower(model: Model, entries: tuple, extra: tuple, convention: str) -> Lowered:
    """The model with the quantities of its noise as outputs.

    ValueError for amplitudes that cannot be differentiated, columns that do not commute, and noise along a curved
    surface.
    """
    states, n = list(model.states), len(model.states)
    sources = list(dict.fromkeys(source for _, source, _ in entries))
    q = len(sources)
    G = sp.zeros(n, q)
    for i, source, e in entries:
        G[i, sources.index(source)] += e
    unknowns = {m.symbol for m in model.multipliers}
    bound = sorted(s.name for s in G.free_symbols & unknowns)
    if bound:
        raise ValueError(
            f"`amplitude` contains {checks.listing(bound)}, which the system solves for while it sticks; give an "
            "amplitude in states, time and parameters, or take the smoothed view."
        )
    additive = not G.free_symbols & set(states)
    columns = [G[:, k] for k in range(q)]
    terms: list[sp.Expr] = []
    if not additive:
        bent = [e for e in G if any(a.free_symbols & set(states) for a in e.atoms(*_BENT))]
        if bent:
            raise ValueError(
                f"`amplitude` contains {bent[0]}, which has no derivative by the states everywhere: Ito's and "
                "Milstein's terms need one. Take the smoothed view and write it with its switch."
            )
        slopes = [column.jacobian(states) for column in columns]
        along = {(j, k): slopes[k] * columns[j] for j in range(q) for k in range(q)}
        for j in range(q):
            for k in range(j):
                if not all(map(_vanishes, along[j, k] - along[k, j])):
                    raise ValueError(
                        f"the noise does not commute: sources {sources[k]!r} and {sources[j]!r} act on each other's "
                        "amplitudes, and Milstein's scheme would need their Levy area. Give sources whose amplitudes "
                        "depend only on states that they drive alone, or one source."
                    )
        terms = [along[j, k][i] / (2 if j == k else 1) for i in range(n) for j in range(q) for k in range(j, q)]
    model = replace(model, events=tuple(e for e in model.events if not e.singular))
    spread = functools.partial(_spread, states=states, columns=columns)
    turning, model = (_slipping(model, spread, nearest) for nearest in (NEAREST, 0))
    rhs, followed = model.rhs, turning.rhs
    if convention == "stratonovich" and not additive:
        drift = sum((along[k, k] for k in range(q)), sp.zeros(n, 1)) / 2
        rhs, followed = (tuple(f + c for f, c in zip(fs, drift)) for fs in (rhs, followed))
    surfaces = [m.surface for m in model.multipliers] + [e.surface for e in model.events]
    spreads = [spread(h) for h in surfaces]
    _flat(model, states, columns, spreads)
    outputs = [*G, *terms, _rate(followed, states, columns, bool(model.smoothing)), *spreads]
    members = {disc.symbol: components for disc, *components in discs_of(model)}
    for m in model.multipliers:
        if m.kind == "disc":
            outputs += [sp.Add(*(spread(c.residual) for c in members[m.symbol])), *_slopes(members[m.symbol])]
            continue
        slope = m.residual.diff(m.symbol)
        outputs += [spread(m.residual), slope, slope.diff(m.symbol)]
    for h, width in model.smoothing:
        speed = h.diff(model.time) + sum(h.diff(x) * f for x, f in zip(states, rhs))
        outputs += [h, speed, spread(h), width]
    coefficients = sorted(
        {s for e in outputs for s in e.free_symbols if s.name.startswith("amplitude_")}, key=str
    )
    lowered = replace(
        model,
        rhs=rhs,
        parameters=(*model.parameters, *extra, *coefficients),
        outputs=tuple((f"q{i}", e) for i, e in enumerate(outputs)),
    )
    pairs = 0 if additive else q * (q + 1) // 2
    return Lowered(lowered, q, pairs, model.time in G.free_symbols, tuple(spreads))


def _slopes(components):
    """How little lambda may act on a disc, and how that changes: like dg/dlambda and d2g/dlambda2 of a switch."""
    lams, G = [c.symbol for c in components], sp.Matrix([c.residual for c in components])
    slopes, d = G.jacobian(lams), len(lams)
    together = sp.Add(*(sp.Abs(slopes[k, k]) for k in range(d))) / d
    bends = [sp.Abs(slopes[k, k].diff(lam)) for k, lam in enumerate(lams)]
    return -sp.Abs(slopes.det()) / (together + _TINY) ** (d - 1), sp.Max(*bends)


def _spread(h, states, columns, proves=True):
    """Variance of h a unit of time: sum_k (dh . g_k)^2; 0 for no surface, and where it `proves` that it vanishes."""
    if h is None:
        return sp.S.Zero
    gradient = [h.diff(x) for x in states]
    parts = [sum((a * b for a, b in zip(gradient, g)), sp.S.Zero) for g in columns]
    if not proves:
        return sp.Add(*(e**2 for e in parts))
    total = sum((sp.expand(e) ** 2 for e in parts), sp.S.Zero)
    return sp.S.Zero if _vanishes(total) else total


def _vanishes(e):
    """Whether an expression is 0 everywhere: a number that is not 0 answers at once."""
    point = {s: draw(s, 0) for s in e.free_symbols}
    return not abs(value(e, point)) > 1e-6 and sp.simplify(e) == 0


def _slipping(model, spread, nearest):
    """The model in which discs on which noise acts always slip, lambda = h/|h|: it leaves h = 0 at once.

    Such a disc becomes a switch with |h|^2 > 0, a component an unknown with that equation. With `nearest`, a span of
    time, directions turn no faster than |h| spreads in it: what they turn by nearer to 0 is not followed. Then the
    lambda of other discs is constant: the steps see to their direction themselves (kernels/noise/discs.py).
    """
    multipliers: list[Multiplier] = []
    values: dict[sp.Basic, sp.Expr] = {}
    softened: dict[sp.Basic, sp.Expr] = {}
    alone: set[sp.Basic] = set()
    for disc, *components in discs_of(model):
        spreads = [spread(m.surface) for m in components]
        if not any(spreads):
            alone.add(disc.symbol)
            continue
        softened[disc.surface] = disc.surface + nearest * sp.Add(*spreads) + _TINY
        values |= {m.symbol: m.surface / sp.sqrt(disc.surface) for m in components} | {disc.symbol: sp.S.One}
    if not values and not (nearest and alone):
        return model

    def slipping(e):
        apart = {choice: choice.args[1] for choice in e.atoms(Held) if choice.args[0] in values}
        if nearest:
            apart |= {choice: choice.args[2] for choice in e.atoms(Held) if choice.args[0] in alone}
        return e.xreplace(apart).xreplace(values).xreplace(softened)

    for m in model.multipliers:
        if m.kind == "disc" and m.symbol in values:
            rate = sp.Add(
                *(m.surface.diff(x) * f for x, f in zip(model.states, model.rhs)), m.surface.diff(model.time)
            )
            m = Multiplier(m.symbol, "switch", slipping(rate), m.surface, "kink")
        elif m.kind == "component" and m.symbol in values:
            m = Multiplier(m.symbol, "algebraic", slipping(m.symbol) - m.symbol)
        multipliers.append(m)
    return replace(model, rhs=tuple(map(slipping, model.rhs)), multipliers=tuple(multipliers))


def _flat(model, states, columns, spreads) -> None:
    """Refuses noise along a curved surface: Ito's term would push off it, and the sliding condition lacks it."""
    for m, spread in zip(model.multipliers, spreads):
        slid_on = (m.kind == "switch" and m.regularity == "sliding") or m.kind == "component"
        if not slid_on or spread != 0:
            continue
        bend = sp.hessian(m.surface, states)
        if not all(_vanishes((g.T * bend * g)[0]) for g in columns):
            raise ValueError(
                f"the noise acts along the curved surface {m.surface} = 0 of {m.symbol}: sliding on it is not "
                "provided for a diffusion. Take coordinates in which the surface is flat, or the smoothed view."
            )


def _rate(rhs, states, columns, layers):
    """How fast the drift varies, free of the states' units: the largest |J_ii| plus the largest sqrt|J_ij J_ji|.

    A derivative that vanishes at a point would allow any step there: so the growth of these along the drift and the
    noise counts too, as the rates at which it reaches them. Within `layers` the kernel's gates see to that.
    """
    own, pairs = [], []
    slopes = {(i, j): rhs[i].diff(states[j]) for i in range(len(states)) for j in range(len(states))}
    for (i, j), e in slopes.items():
        if i == j and e != 0:
            own.append(e)
        elif i < j and e != 0 and slopes[j, i] != 0:
            pairs.append(e * slopes[j, i])
    parts = [[sp.Abs(e) for e in own], [sp.sqrt(sp.Abs(e)) for e in pairs]]
    if not layers:
        for entries, power in ((own, 1), (pairs, 2)):
            # |e| h^power grows by |e'.f| h^(1 + power) and |e'.g| h^(1/2 + power).
            along = [sum(e.diff(x) * f for x, f in zip(states, rhs)) for e in entries]
            parts.append([sp.Abs(e) ** sp.Rational(1, 1 + power) for e in along if e != 0])
            spread = [_spread(e, states, columns, proves=False) for e in entries]
            parts.append([e ** sp.Rational(1, 1 + 2 * power) for e in spread if e != 0])
    # Without a look at which of two is larger, of which there are n^2.
    return sum((sp.Max(*part, evaluate=False) for part in parts if part), sp.S.Zero)
