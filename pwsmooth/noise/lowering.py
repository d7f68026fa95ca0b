"""What a diffusion means for a model, in symbols: the functions that its steps ask for.

The matrix G of a view, Milstein's terms L_j g_k = sum_i G_ij dG_k/dx_i (which need commuting columns), on which
surfaces the noise acts, and how fast the drift varies. A model with families stays one.
Chain: diffusion_run.py -> **this file**, on amplitudes.py -> kernels/noise/path.py.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp

from ..definition.discs import discs_of
from ..definition.families.between import NoTemplate
from ..definition.families.template import Families, family_model
from ..definition.model import Held, Model, Multiplier
from ..definition.views import substitutes
from ..door import checks
from .amplitudes import Amplitudes, Source, vanishes

NEAREST = sp.Symbol("amplitude_nearest", real=True)  # the finest step: what a path does in it is not looked at
_TINY = sp.Float(1e-300)  # so that a start with h = 0 has a direction, 0
_BENT = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Piecewise, sp.Heaviside)
_RATES = 6


@dataclass(frozen=True)
class Lowered:
    """A model with what its noise needs: its `outputs` are what kernels/noise/state.Diffused.out holds.

    `parts` are the first places of each of its parts, and their end. Rows of G and of Milstein's terms by state:
    where each begins, the sources, and the place of each entry in `out`.
    """

    model: Model
    spreads: tuple[sp.Expr, ...]  # of every surface, a block each: |dh . G|^2
    q: int
    moving: bool
    noisy: np.ndarray  # whether the noise acts on each surface, a number each
    parts: np.ndarray
    G: tuple[np.ndarray, ...]
    milstein: tuple[np.ndarray, ...]

    def holds(self, values: Mapping[sp.Symbol, float]) -> bool:
        """Whether no surface that seems noisy in symbols is quiet with these numbers."""
        return all(s == 0 or not vanishes(s.subs(values)) for s in self.spreads)


def meaning(system: Any, model: Model, own: Mapping[str, sp.Symbol]) -> dict[str, sp.Expr]:
    """Name -> expression in the symbols of the view's model, or of the template of its families."""
    template = model.families.template if model.families else None
    text = template.model if template else model
    named: dict[str, sp.Expr] = {str(s): s for s in (text.time, *text.states, *text.parameters)}
    named |= {str(m.symbol): m.symbol for m in text.multipliers}
    if template is None:
        named |= substitutes(system)
    else:
        named |= {s.name: s for s, place in template.places if place.base is not None or not place.offset}
        if text.smoothing:  # the outputs of an element tell what its multipliers have become
            named |= dict(text.outputs)
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
    """The model with the quantities of its noise as outputs; `entries` are (state, source, amplitude).

    A model with families keeps them: there entries and states are those of its template. ValueError for amplitudes
    that cannot be differentiated, columns that do not commute, and noise along a curved surface; NoTemplate for what
    one element cannot tell of all.
    """
    families: Families | None = model.families
    template = families.template if families else None
    text = template.model if template else model
    rows: dict[sp.Symbol, dict[Source, sp.Expr]] = {}
    for i, source, e in entries:
        row = rows.setdefault(text.states[i], {})
        row[source] = row.get(source, sp.S.Zero) + e
    noise = Amplitudes(text, rows, template)
    _differentiable(text, noise)
    milstein = _milstein(noise, list(dict.fromkeys(source for _, source, _ in entries)))
    kept = [not e.singular for e in text.events]
    text = replace(text, events=tuple(itertools.compress(text.events, kept)))
    turning, text = (_slipping(text, noise.spread, nearest) for nearest in (NEAREST, 0))
    if convention == "stratonovich":
        # A term with j = k is half of L_k g_k.
        more = [sp.Add(*(e for (j, k), e in milstein.get(x, {}).items() if j == k)) for x in text.states]
        turning, text = (replace(m, rhs=tuple(map(operator.add, m.rhs, more))) for m in (turning, text))
    noise = noise.of_model(text)
    surfaces = [m.surface for m in text.multipliers] + [e.surface for e in text.events]
    spreads = tuple(map(noise.spread, surfaces))
    _flat(text, noise, spreads)
    parts = _outputs(text, noise, noise.of_model(turning), spreads, milstein)
    written = [(f"q{i}", e) for i, e in enumerate(e for part in parts for _, e in part)]
    coefficients = {s for _, e in written for s in e.free_symbols if s.name.startswith("amplitude_")}
    text = replace(
        text,
        parameters=(*text.parameters, *extra, *sorted(coefficients, key=str)),
        outputs=tuple(written),
    )
    if template is not None and families is not None:
        template = replace(
            template,
            model=text,
            places=tuple(noise.places.items()),
            sums=(*template.sums, *((s, f, e) for s, (f, e) in noise.more.items())),
            event_families=tuple(itertools.compress(template.event_families, kept)),
            output_families=tuple(_family(template, of, kept) for part in parts for of, _ in part),
        )
        families = replace(families, template=template)
        model = family_model(families)
    else:
        model = text
    return Lowered(model, spreads, **_places(model, parts, rows, milstein, entries, spreads))


def _differentiable(model, noise):
    """ValueError for an amplitude that reads what is solved for, or has no derivative."""
    amplitudes = [e for row in noise.rows.values() for e in row.values()]
    bound = sorted(
        {s.name for e in amplitudes for s in e.free_symbols} & {m.symbol.name for m in model.multipliers}
    )
    if bound:
        raise ValueError(
            f"`amplitude` contains {checks.listing(bound)}, which the system solves for while it sticks; give an "
            "amplitude in states, time and parameters, or take the smoothed view."
        )
    bent = [e for e in amplitudes if any(noise.moving(a) for a in e.atoms(*_BENT))]
    if bent:
        raise ValueError(
            f"`amplitude` contains {bent[0]}, which has no derivative by the states everywhere: Ito's and "
            "Milstein's terms need one. Take the smoothed view and write it with its switch."
        )


def _milstein(noise, sources):
    """State -> {(j, k): term with W_j W_k - delta_jk h}, j not after k; those that are not 0.

    L_j g_k is along[k][j].
    """
    found: dict[sp.Symbol, dict[tuple[Source, Source], sp.Expr]] = {}
    for x, row in noise.rows.items():
        if any(map(noise.summed, row.values())):
            raise NoTemplate("an amplitude that reads a sum")
        along = {k: noise.along(e) for k, e in row.items() if noise.moving(e)}
        reached = {*row, *(j for of in along.values() for j in of)} if along else set()
        if not reached <= set(sources):
            raise NoTemplate("an amplitude that reads neighbours under noise")
        reached = [s for s in sources if s in reached]
        for j, k in itertools.combinations_with_replacement(reached, 2):
            term, other = (along.get(b, {}).get(a, sp.S.Zero) for a, b in ((j, k), (k, j)))
            if j != k and not vanishes(term - other):
                raise ValueError(
                    f"the noise does not commute: sources {j[0]!r} and {k[0]!r} act on each other's "
                    "amplitudes, and Milstein's scheme would need their Levy area. Give sources whose amplitudes "
                    "depend only on states that they drive alone, or one source."
                )
            if term != 0:
                found.setdefault(x, {})[j, k] = term / (2 if j == k else 1)
    return found


def _outputs(model, noise, turned, spreads, milstein):
    """The outputs by parts: (what each belongs to, expression) - a state, a multiplier, an event or a layer.

    The noise of the model itself, and of that whose directions turn no faster than the steps follow.
    """
    states = model.states
    of = {
        kind: [(kind, b) for b in range(len(getattr(model, kind)))]
        for kind in ("multipliers", "events", "smoothing")
    }
    G = [(("states", states.index(x)), e) for x, row in _sorted(noise.rows, states) for e in row.values()]
    terms = [(("states", states.index(x)), e) for x, row in _sorted(milstein, states) for e in row.values()]
    members = {disc.symbol: components for disc, *components in discs_of(model)}
    pulls = [_pull(m, members.get(m.symbol, ()), noise) for m in model.multipliers]
    gates = [(h, h.diff(model.time) + noise.drift(h), noise.spread(h), width) for h, width in model.smoothing]
    return [
        G, terms, *_rates(model, turned), list(zip(of["multipliers"] + of["events"], spreads)),
        *(list(zip(of["multipliers"], column)) for column in (zip(*pulls) if pulls else [()] * 3)),
        *(list(zip(of["smoothing"], column)) for column in (zip(*gates) if gates else [()] * 4)),
    ]  # fmt: skip


def _sorted(rows, states):
    """In the order of the states."""
    return [(x, rows[x]) for x in states if x in rows]


def _pull(m, components, noise):
    """|dg . G|^2, dg/dlambda, d2g/dlambda2 of a multiplier."""
    if m.kind == "disc":
        return sp.Add(*(noise.spread(c.residual) for c in components)), *_slopes(components)
    residual = m.residual if m.may_be_solved else sp.S.Zero
    slope = residual.diff(m.symbol)
    return noise.spread(residual), slope, slope.diff(m.symbol)


def _slopes(components):
    """How little lambda may act on a disc, and how that changes: like dg/dlambda and d2g/dlambda2 of a switch."""
    lams, G = [c.symbol for c in components], sp.Matrix([c.residual for c in components])
    slopes, d = G.jacobian(lams), len(lams)
    together = sp.Add(*(sp.Abs(slopes[k, k]) for k in range(d))) / d
    bends = [sp.Abs(slopes[k, k].diff(lam)) for k, lam in enumerate(lams)]
    return -sp.Abs(slopes.det()) / (together + _TINY) ** (d - 1), sp.Max(*bends)


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


def _flat(model, noise, spreads) -> None:
    """Refuses noise along a curved surface: Ito's term would push off it, and the sliding condition lacks it."""
    for m, spread in zip(model.multipliers, spreads):
        slid_on = (m.kind == "switch" and m.regularity == "sliding") or m.kind == "component"
        if slid_on and spread == 0 and not all(map(vanishes, noise.bend(m.surface))):
            raise ValueError(
                f"the noise acts along the curved surface {m.surface} = 0 of {m.symbol}: sliding on it is not "
                "provided for a diffusion. Take coordinates in which the surface is flat, or the smoothed view."
            )


def _rates(model, noise):
    """How fast the drift varies, free of the states' units: the largest |J_ii|, the largest sqrt|J_ij J_ji|, and more.

    A derivative that vanishes at a point would allow any step there: so the growth of these along the drift and the
    noise counts too, as the rates at which it reaches them. Within layers the kernel's gates see to that. The largest
    of each part, added up, is the rate: the kernel looks for it.
    """
    parts = [[] for _ in range(_RATES)]
    for b, x in enumerate(model.states):
        own = noise.own_slope(x)
        grown = [] if model.smoothing else [sp.S.One]
        for part, entries, power in ((0, [own] if own != 0 else [], 1), (3, noise.pairs(x), 2)):
            found = [[sp.Abs(e) if power == 1 else sp.sqrt(sp.Abs(e)) for e in entries]]
            for _ in grown:
                # |e| h^power grows by |e'.f| h^(1 + power) and |e'.g| h^(1/2 + power).
                drifts = [noise.drift(e, far=False) for e in entries]
                spreads = [noise.spread(e, proves=False) for e in entries]
                found.append([sp.Abs(e) ** sp.Rational(1, 1 + power) for e in drifts if e != 0])
                found.append([e ** sp.Rational(1, 1 + 2 * power) for e in spreads if e != 0])
            for k, several in enumerate(found):
                if several:
                    # Without a look at which of two is larger.
                    parts[part + k].append((("states", b), sp.Max(*several, evaluate=False)))
    return parts


def _family(template, of, kept):
    """The family of what belongs to a block; `kept` are the events that there still are."""
    kind, b = of
    families = template.families(kind)
    return list(itertools.compress(families, kept))[b] if kind == "events" else families[b]


def _places(model, parts, rows, milstein, entries, spreads):
    """Where everything is: of Lowered, all but its model and spreads."""
    families = model.families
    text = families.template.model if families else model
    starts = {
        kind: families.starts(kind) if families else range(len(getattr(text, kind)) + 1)
        for kind in ("states", "multipliers", "events", "outputs")
    }
    sizes = np.diff(starts["states"])
    # Sources in the order of the amplitude: one of all, or one for each element.
    first, q = {}, 0
    for i, source, _ in entries:
        if source not in first:
            first[source], q = q, q + (1 if source[1] is None else int(sizes[i]))
    ends = [0, *itertools.accumulate(map(len, parts))]

    def by_rows(part, keys):
        """Where rows begin, the sources of their entries, and the places of these."""
        output, lengths = ends[part], []
        sources, places = [[np.zeros(0, np.int64)] for _ in range(part + 1)], [np.zeros(0, np.int64)]
        for b, x in enumerate(text.states):
            k = np.arange(sizes[b])
            found = keys.get(x, ())
            lengths += [len(found)] * len(k)
            for c, column in enumerate(sources):
                at = [first[key[c]] + (0 * k if key[c][1] is None else k) for key in found]
                column += [np.stack(at, axis=1).ravel()] if at else []
            at = [starts["outputs"][output + r] + k for r in range(len(found))]
            places += [np.stack(at, axis=1).ravel()] if at else []
            output += len(found)
        return tuple(np.concatenate(a).astype(np.int64) for a in ([[0], np.cumsum(lengths)], *sources, places))

    surfaces = [*np.diff(starts["multipliers"]), *np.diff(starts["events"])]
    return dict(
        q=q,
        moving=any(model.time in e.free_symbols for row in rows.values() for e in row.values()),
        noisy=np.repeat(np.array([s != 0 for s in spreads], bool), np.array(surfaces, int)),
        parts=np.array([starts["outputs"][e] for e in ends], np.int64),
        G=by_rows(0, {x: [(source,) for source in row] for x, row in rows.items()}),
        milstein=by_rows(1, {x: [*terms] for x, terms in milstein.items()}),
    )
