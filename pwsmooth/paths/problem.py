"""A model's compiled addresses as the kernels' Problem: kinds, couplings, rows, scratch arrays.

Chain: codegen.compile_model -> **Problem** -> kernels.trajectory.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Set
from typing import Any

import numpy as np
import sympy as sp

from ..codegen import compile_model
from ..codegen.families.coupled import MOST
from ..codegen.machine.clock import preparing
from ..codegen.machine.units import UNITS, unit_address, unit_addresses
from ..definition.folds import fold_model
from ..definition.model import EventSpec, Model, Multiplier, sides_of
from ..definition.pointwise import fingerprint, value
from ..definition.regularity import may_skip_orders
from ..definition.sigmoids import sigmoid
from ..definition.singular import KINDS
from ..kernels import state, work
from ..kernels.step.tables import bernstein_tables, halving_tables, short_tables
from .clock import periodic_switches
from .levels import Levels

FEW = 3  # elements that tell what holds for one


class CompiledProblem:
    """What of a Problem does not depend on parameter values; made once a model and process.

    Without `series` no program of Taylor coefficients is made.
    """

    def __init__(self, model: Model, series: bool = True):
        self.model, self._scratch = model, threading.local()
        self.tangents: dict[str, Any] = {}  # by what plays a tape of the model again (derivatives/tangents.py)
        code = self.code = compile_model(model)
        self.has_jets = series and code.has_jets
        # With families the text is that of one element, and `_numbers` writes what holds for it out.
        self._families = families = model.families
        self.levels = bool(families and families.template.levels)
        self._text = text = families.template.model if families else model
        self._fixed_symbols = set(text.parameters) | (families.template.constants if families else set())
        self.kind = self._numbers("multipliers", [_kind(mu) for mu in text.multipliers])
        hidden = self._numbers("multipliers", [int(mu.hidden) for mu in text.multipliers])
        # What has no series has no arcs by a fold either: the pair comes to it by short steps.
        folds = self.has_jets and bool(np.any((self.kind != state.ALGEBRAIC) & (hidden != 0)))
        self.fold = compile_model(fold_model(model)) if folds else None
        self.sigmoid = compile_model(sigmoid(model.sigmoid).model())
        finite = any(layer.ratio != sp.oo for layer in model.layer_states)
        self.ratios = tuple(layer.ratio for layer in model.layer_states) if finite else ()
        holders = (("multipliers", text.multipliers), ("events", text.events))
        has_surface = [self._numbers(kind, [x.surface is not None for x in parts]) for kind, parts in holders]
        has_surface = np.concatenate(has_surface) != 0
        expressions = [*text.rhs, *(mu.condition for mu in text.multipliers)]
        expressions += [e for _, _, e in families.template.sums] if families else []
        squares = [
            mu.surface for mu in text.multipliers if mu.kind == "disc"
        ]  # whose roots are taken in slip alone
        powers = {p for e in expressions for p in e.atoms(sp.Pow) if p.base not in squares}
        if families:  # those of parameters alone have no branch point on the way
            powers = {p for p in powers if not p.free_symbols <= self._fixed_symbols}
        self.singular = any(p.exp.is_integer is not True for p in powers)
        periodic = periodic_switches(text)
        numbers = self._numbers("multipliers", list(range(len(text.multipliers))))
        self.periodic = [
            (periodic[mu.symbol], np.flatnonzero(numbers == j))
            for j, mu in enumerate(text.multipliers)
            if mu.symbol in periodic
        ]
        carried = [state.SILENT if e.singular else state.PLAIN for e in text.events]
        self.carried = np.where(has_surface[code.m :], self._numbers("events", carried), state.TIMED)
        expressions += [x.surface for _, parts in holders for x in parts if x.surface is not None]
        fixed = self._of_multipliers()
        contacts, asked = self.kind == state.CONTACT, fixed["at_zero"] == state.BY_ACT
        self.acts = bool(code.ne or np.any(contacts | asked))
        self.fixed = dict(
            **self._units(),
            step_unit=0,
            pair=0,
            n=code.n,
            memories=model.n_memory,
            m=code.m,
            ne=code.ne,
            nz=len(self.ratios),
            kind=self.kind,
            hidden=hidden,
            **self._of_discs(),
            **fixed,
            **self._couplings(),
            **self._of_events(),
            **self._programs(expressions, has_surface),
        )

    def _numbers(self, kind, values):
        """One integer a multiplier or event, whatever it belongs to."""
        return np.array(self._families.spread(kind, values) if self._families else values, np.int64)

    def _of_multipliers(self) -> dict:
        multipliers, fixed = self._text.multipliers, self._fixed_symbols
        lams = {mu.symbol for mu in multipliers}
        surface_state = self._numbers("multipliers", [_surface_state(self._text, mu) for mu in multipliers])
        if self._families:
            surface_state = self._families.numbered("multipliers", "states", surface_state)
        holder = np.full(self.code.n, -1)
        keeps = (surface_state >= 0) & np.isin(self.kind, (state.SLIDING, state.COMPONENT, state.CONTACT))
        holder[surface_state[keeps]] = np.flatnonzero(keeps)
        return dict(
            holder=holder,
            contact=np.flatnonzero(self.kind == state.CONTACT),
            slope_moves=self._numbers("multipliers", [_slope_moves(mu, fixed) for mu in multipliers]),
            at_zero=self._numbers("multipliers", [_at_zero(mu) for mu in multipliers]),
            nested=np.concatenate(
                [
                    self._numbers("multipliers", [_nested(mu, lams) for mu in multipliers]),
                    self._numbers("events", [_nested(event, lams) for event in self._text.events]),
                ]
            ),
            wave=np.concatenate(
                [
                    self._numbers(
                        "multipliers", [_is_wave(mu, lams | {*self._text.states}) for mu in multipliers]
                    ),
                    np.zeros(self.code.ne, np.int64),
                ]
            ),
            surface_state=surface_state,
        )

    def _of_discs(self) -> dict:
        """The components of each disc, which follow its multiplier."""
        disc = np.maximum.accumulate(np.where(self.kind == state.DISC, np.arange(self.code.m), -1))
        disc_of = np.where(self.kind == state.COMPONENT, disc, -1)
        dim = np.array(
            [np.sum(disc_of == j) if k == state.DISC else 0 for j, k in enumerate(self.kind)], np.int64
        )
        return dict(discs=int(np.sum(self.kind == state.DISC)), dim=dim, disc_of=disc_of)

    def _couplings(self) -> dict:
        """Which residuals multipliers act on, and the groups of multipliers that are solved for together."""
        g_row, g_col = self.code.pattern("G")
        dh_row, dh_col = self.code.pattern("DH")
        link_row, link_col = _both_ways(g_row, g_col)
        hub = np.zeros(0, np.int64)
        if self._families:
            # What is solved for and belongs to the whole system may couple all elements.
            families = self._families.template.families("multipliers")
            whole = self._numbers("multipliers", [f is None for f in families])
            hub = np.flatnonzero(whole * (self.kind != state.KINK) * (self.kind != state.CROSSING))
        block_row, block_member = _groups(g_row, g_col, hub)
        of_unknowns, size = list(self.code.surfaces_of_unknowns), len(dh_row) - 1
        unknowns = np.full(size, -1)
        unknowns[of_unknowns] = len(dh_col) + size + np.arange(len(of_unknowns))
        empty = np.zeros(0, np.int64)
        fold_row, fold_col = self.fold.pattern("G") if self.fold else (empty, empty)
        return dict(
            g_row=g_row, g_col=g_col, g_diagonal=_diagonal(g_row, g_col), dh_row=dh_row, dh_col=dh_col,
            unknowns=unknowns, inner=int(bool(of_unknowns)),
            link_row=link_row, link_col=link_col, block_row=block_row, block_member=block_member, hub=hub,
            fold_row=fold_row, fold_col=fold_col,
        )  # fmt: skip

    def _of_events(self) -> dict:
        events, families = self._text.events, self._families
        watch_state = self._numbers("events", [_surface_state(self._text, e) for e in events])
        twins = [_twin(self._text, e, self._fixed_symbols) for e in events]
        twin = self._numbers("events", [j for j, _ in twins])
        if families:
            watch_state = families.numbered("events", "states", watch_state)
            twin = families.numbered("events", "multipliers", twin)
        return dict(
            direction=self._numbers("events", [e.direction for e in events]),
            rule=self._numbers(
                "events", [{None: 0, "add": state.ADD, "set": state.SET}[e.together] for e in events]
            ),
            terminal=self._numbers(
                "events", [int(e.terminal) if e.recorded else state.UNRECORDED for e in events]
            ),
            watches=int(any(e.singular for e in events)),
            watch=self._numbers("events", [KINDS.index(e.singular) for e in events]),
            watch_state=watch_state,
            twin=self._numbers("events", [sign for _, sign in twins]) * (twin + 1),
        )

    def _programs(self, expressions, has_surface) -> dict:
        """Addresses of the generated functions, and the rows of their polynomials."""
        code, fold, text = self.code, self.fold, self._text
        n, m, ne = code.n, code.m, code.ne
        slides = bool(m) and bool(np.any((self.kind != state.KINK) & (self.kind != state.CROSSING)))
        empty = np.zeros(0, np.int64)
        flat_slip = code.flat_rows_slip if self.has_jets else empty
        flat_general = code.flat_rows_general if slides else empty

        def looks(moving, flat):
            return int(len(flat) > 0 or any(may_skip_orders(e, text.time, moving) for e in expressions))

        result = dict(
            fields=code.fields,
            fields8=code.fields8 if np.any(self.kind == state.DISC) else 0,
            linear=code.linear,
            act=code.act if self.acts else 0,
            layer=code.layer if self.ratios else 0,
            jet_slip=code.jet_slip if self.has_jets else 0,
            jet_general=code.jet_general if slides else 0,
            jet_fold=fold.jet_general if fold else 0,
            fields_fold=fold.fields if fold else 0,
            linear_fold=fold.linear if fold else 0,
            look_slip=looks(set(text.states), flat_slip),
            look_general=looks({*text.states, *(mu.symbol for mu in text.multipliers)}, flat_general),
            rows_slip=code.surface_rows_slip if self.has_jets else np.where(has_surface, 0, -1),
            rows_general=code.surface_rows_general if slides else empty,
            flat_slip=flat_slip,
            flat_general=flat_general,
            flat_fold=fold.flat_rows_general if fold else empty,
            # The fold program's first multiplier is dt/ds; the model's own surfaces follow.
            rows_fold=fold.surface_rows_general[1:] if fold else empty,
            # The Runge-Kutta pair's polynomials stand in a fixed order: states, multipliers, surfaces.
            rows_pair=np.where(has_surface, n + m + np.arange(m + ne), -1),
            mult_row=code.mult_row0,
            sigmoid=self.sigmoid.fields,
        )
        # The rows of all programs, one over the other, and behind them what each keeps for itself.
        programs = {"slip": code.nrows_slip if self.has_jets else (0, 0),
                    "general": code.nrows_general if slides else (0, 0),
                    "fold": fold.nrows_general if fold else (0, 0)}  # fmt: skip
        self.nrows = max(n + 2 * m + ne, *(count for count, _ in programs.values()))
        for name, (_, own) in programs.items():
            result[f"own_{name}"] = self.nrows
            self.nrows += own
        return result

    def _units(self) -> dict[str, int]:
        """Addresses of what this model calls, 0 for the rest; the loop is compiled with them."""
        needed = {"run", "instant_unit"}
        if self.code.m or self.code.ne:
            needed.add("root_unit")
        if self.code.m:
            needed |= {"newton_unit", "layer_unit", "others_unit"}
        if self.fold:
            needed.add("fold_unit")
        if np.any(self.kind == state.DISC):
            needed.add("onset_unit")
        if any(e.singular for e in self._text.events):
            needed.add("approach_unit")
        called = [name for name in UNITS if name in needed]
        found = dict(zip(called, unit_addresses(called), strict=True))
        return {name: found.get(name, 0) for name in UNITS if name != "run"}

    def kept(self, what: str) -> dict:
        """What this thread keeps for its next run."""
        return self._scratch.__dict__.setdefault(what, {})

    def problem(self, p: np.ndarray, method: str = ""):
        """The Problem at parameter values p (one per symbol of model.parameters), for jets or a method of one step.

        This thread's one is kept: of its some forty arrays, half of the cost of a short run, two depend on p.
        """
        kept = self.kept("problems")
        made = kept.get(method)
        if made is None:
            made = kept[method] = self.new_problem(p.copy(), method)
        made.p[:] = p
        if self.ratios:
            made.ratio[:] = self._ratios_at(p)
        if self.levels:
            made.slip_share[:] = Levels(self._families, p).shares(self.code.m)
        return made

    def new_problem(self, p: np.ndarray, method: str = ""):
        """A Problem that nobody else has."""
        fixed = self.fixed
        if method or self.singular:
            fixed = fixed | dict(step_unit=unit_address(method or "rk"))
        if method:
            fixed = fixed | dict(pair=1, jet_fold=0)
        weight = np.array(self.model.eps_ratio or np.ones(self.code.m), float)
        return state.Problem(
            p=p,
            fold_bias=np.zeros(len(p) + 2 * self.code.m),
            weight=1.0 / weight,
            ratio=self._ratios_at(p),
            slip_share=Levels(self._families, p).shares(self.code.m),
            **fixed,
        )

    def _ratios_at(self, p: np.ndarray) -> np.ndarray:
        """Relaxation of the layered states over that of the layer."""
        at = dict(zip(self.model.parameters, p.tolist(), strict=True))
        return np.array([1e3 if r == sp.oo else value(r, at) for r in self.ratios])

    def work(self, order: int):
        """Scratch arrays for one run: those of this thread's last run of the order, which no run leaves in use."""
        kept = self.kept("works")
        if order not in kept:
            kept[order] = self.new_work(order)
        return kept[order]

    def work_sizes(self, order: int) -> dict[str, int]:
        """Of scratch arrays."""
        n, m, ne, fixed, fold = self.code.n, self.code.m, self.code.ne, self.fixed, self.fold
        width = terms(order) + state.PAD
        return dict(
            n=n, m=m, ne=ne, nz=len(self.ratios), width=width, rows=self.nrows,
            fold_size=m + 1 if fold else 0, entries=len(fixed["g_col"]),
            gradients=len(fixed["dh_col"]) + m + ne + len(self.code.surfaces_of_unknowns),
            fold_entries=len(fixed["fold_col"]),
            fold_gradients=len(fold.pattern("DH")[1]) + m + 1 + ne + len(fold.surfaces_of_unknowns) if fold else 0,
            group=int(np.diff(fixed["block_row"]).max(initial=0)), hubs=len(fixed["hub"]),
            contacts=len(fixed["contact"]), onset=n if fixed["discs"] else 0,
            joint=self._joint(), struck=self._struck(),
        )  # fmt: skip

    def _joint(self) -> int:
        """How many multipliers may have surfaces that depend on each other."""
        fixed, kind = self.fixed, self.kind
        beside = np.diff(fixed["link_row"]) > 0
        switches = int(np.sum((kind == state.SLIDING) & beside))
        return int(np.sum(kind == state.COMPONENT)) + (min(switches, MOST) if switches > 1 else 0)

    def _struck(self) -> int:
        """How many contacts and multipliers of dry friction an impact may strike."""
        contact, kind = self.fixed["contact"], self.kind
        rubs = np.flatnonzero((kind == state.SLIDING) | (kind == state.COMPONENT))
        row, col = self.fixed["link_row"], self.fixed["link_col"]
        beside = [col[row[j] : row[j + 1]] for j in contact]
        acts = (state.SLIDING, state.COMPONENT, state.ALGEBRAIC)
        some = len(rubs) > 0 and any(np.isin(kind[near], acts).any() for near in beside)
        return len(contact) + len(rubs) if some else 0

    def new_work(self, order: int, sizes: dict[str, int] | None = None):
        """Scratch arrays that nobody else has, of the sizes of this system or of others."""
        sizes = sizes or self.work_sizes(order)
        width = sizes["width"]
        roots = work.Roots.zeros(sizes, order=order)
        k = np.arange(float(width))
        roots.counting[:], roots.pairing[:], roots.tripling[:] = k, k * (k - 1), k * (k - 1) * (k - 2)
        roots.bernstein_table[:] = bernstein_tables(order, width)
        roots.short_table[:], roots.short_error[:], roots.short_powers[:] = short_tables(order, width)
        roots.left_half[:], roots.right_half[:] = halving_tables(order, width)
        step = work.Step.zeros(sizes, per_order=1.0 / order, per_order_before=1.0 / (order - 1))
        firing = work.Firing.zeros(sizes)
        firing.carried[: len(self.carried)] = self.carried
        return work.Work.zeros(sizes, roots=roots, step=step, firing=firing)


def terms(order: int) -> int:
    """Coefficients of a row: loops run in blocks of eight."""
    return -(-(order + 1) // 8) * 8


def longest_step(order: int) -> float:
    """Longest step all of whose powers are finite: the zeros behind the last coefficient are multiplied too."""
    return 1e290 ** (1.0 / (terms(order) - 1))


def _groups(row, col, hub):
    """Multipliers in groups that couple only through the hubs: ends and members of the groups."""
    m = len(row) - 1
    parent = list(range(m))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    outside = set(hub.tolist())
    for i in range(m):
        for j in col[row[i] : row[i + 1]].tolist():
            if not outside & {i, j}:
                low, high = sorted((root(i), root(j)))
                parent[high] = low
    groups: dict[int, list[int]] = {}
    for i in range(m):
        if i not in outside:
            groups.setdefault(root(i), []).append(i)
    ends = np.cumsum([0, *map(len, groups.values())])
    return ends.astype(np.int64), np.array([i for group in groups.values() for i in group], np.int64)


def _both_ways(row, col):
    """The pattern of a sparse matrix and of its transpose together, without the diagonal."""
    m = len(row) - 1
    i = np.repeat(np.arange(m), np.diff(row))
    places = np.unique(np.concatenate([i * m + col, col * m + i]))
    places = places[places // max(m, 1) != places % max(m, 1)]
    ends = np.concatenate([[0], np.cumsum(np.bincount(places // max(m, 1), minlength=m))])
    return ends.astype(np.int64), (places % max(m, 1)).astype(np.int64)


def _diagonal(row, col):
    """Where the diagonal entries of a sparse matrix stand; those of neighbours that are none come after them."""
    rows = np.repeat(np.arange(len(row) - 1), np.diff(row))
    here = np.flatnonzero(rows == col)
    return here[np.unique(rows[here], return_index=True)[1]]


def _at_zero(mu: Multiplier) -> int:
    if isinstance(mu.at_zero, sp.Expr):
        return state.BY_ACT
    return state.ANY if mu.at_zero is None else mu.at_zero


def _slope_moves(mu: Multiplier, fixed) -> int:
    """Whether dg/dlambda of a sliding switch can change its sign along a step."""
    if _kind(mu) != state.SLIDING or mu.hidden:
        return 0
    return int(not mu.residual.diff(mu.symbol).free_symbols <= fixed)


def _kind(mu: Multiplier) -> int:
    if mu.kind == "switch":
        if mu.second is not None:
            return state.SECOND_ORDER
        return {"kink": state.KINK, "sliding": state.SLIDING, "crossing": state.CROSSING}[mu.regularity]
    return {
        "disc": state.DISC, "component": state.COMPONENT, "contact": state.CONTACT, "algebraic": state.ALGEBRAIC
    }[mu.kind]  # fmt: skip


def _twin(model: Model, event: EventSpec, fixed: Set[sp.Symbol]) -> tuple[int, int]:
    """The switch whose surface, up to a factor, is that of the event, and the factor's sign; -1 and 0 without one."""
    if event.surface is None or event.singular not in ("", "branch"):
        return -1, 0
    key = fingerprint(event.surface, frozenset(fixed))
    for j, mu in enumerate(model.multipliers if key is not None else ()):
        if mu.kind != "switch":
            continue
        # A power stands in a branch, where the surface that it is of may be simpler.
        for h in (mu.surface,) if event.singular == "" else sides_of(mu.surface):
            if fingerprint(h, frozenset(fixed)) != key:
                continue
            factor = sp.cancel(event.surface / h)
            # A factor of unknown sign does not say which side is which.
            if factor.free_symbols <= fixed and (factor.is_positive or factor.is_negative):
                return j, 1 if factor.is_positive else -1
    return -1, 0


def _nested(of: Multiplier | EventSpec, lams: set[sp.Symbol]) -> int:
    """Whether another multiplier stands in the surface, which jumps when that one switches."""
    return int(of.surface is not None and bool(of.surface.free_symbols & lams))


def _is_wave(mu: Multiplier, moving: set[sp.Symbol]) -> int:
    """Whether the surface of a switch is a sine of what is `moving`, not of time alone."""
    h = mu.surface
    return int(mu.kind == "switch" and isinstance(h, (sp.sin, sp.cos)) and bool(h.free_symbols & moving))


def _surface_state(model: Model, mu: Multiplier | EventSpec) -> int:
    """Index of the state whose zero is the surface, or -1."""
    if mu.surface is not None:
        for i, state in enumerate(model.states):
            if mu.surface in (state, -state):
                return i
    return -1


@functools.lru_cache(maxsize=64)
@preparing()
def compiled_problem(model: Model, series: bool = True) -> CompiledProblem:
    """The compiled problem of a model; the last ones are kept. Its addresses live as long as the object."""
    return CompiledProblem(model, series)
