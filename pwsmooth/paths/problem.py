"""A model's compiled addresses as the kernels' Problem: kinds, couplings, rows, scratch arrays.

Chain: codegen.compile_model -> **Problem** -> kernels.trajectory.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Set

import numpy as np
import sympy as sp

from ..codegen import compile_model
from ..codegen.machine.units import UNITS, unit_address
from ..definition.folds import fold_model
from ..definition.model import EventSpec, Model, Multiplier
from ..definition.pointwise import fingerprint
from ..definition.regularity import may_skip_orders
from ..definition.sigmoids import sigmoid
from ..definition.singular import KINDS
from ..kernels import state, work
from ..kernels.step.tables import bernstein_tables, halving_tables, short_tables


class CompiledProblem:
    """What of a Problem does not depend on parameter values; made once a model and process."""

    def __init__(self, model: Model):
        self.model = model
        code = self.code = compile_model(model)
        self._scratch = threading.local()
        self.has_jets = code.has_jets
        n, m, ne = code.n, code.m, code.ne
        # With families this is the model of one element, and `numbers` writes what holds for it out.
        loops = model.loops
        text = loops.template.model if loops else model

        def numbers(kind, values):
            return np.array(loops.spread(kind, values) if loops else values, np.int64)

        self.kind = numbers("multipliers", [_kind(mu) for mu in text.multipliers])
        slides = bool(m) and bool(np.any((self.kind != state.KINK) & (self.kind != state.CROSSING)))
        hidden = numbers("multipliers", [int(mu.hidden) for mu in text.multipliers])
        folds = bool(np.any((self.kind == state.SLIDING) & (hidden != 0)))
        self.fold = compile_model(fold_model(model)) if folds else None
        self.sigmoid = compile_model(sigmoid(model.sigmoid).model())
        g_row, g_col = code.pattern("G")
        dh_row, dh_col = code.pattern("DH")
        link_row, link_col = _both_ways(g_row, g_col)
        # What is solved for and belongs to the whole system may couple all elements.
        families = loops.template.families("multipliers") if loops else ()
        hub = np.flatnonzero(numbers("multipliers", [f is None for f in families]) * (self.kind != state.KINK)
                             * (self.kind != state.CROSSING)) if loops else np.zeros(0, np.int64)  # fmt: skip
        block_row, block_member = _groups(g_row, g_col, hub)
        fixed = set(text.parameters) | (loops.template.constants if loops else set())
        slope_moves = numbers("multipliers", [_slope_moves(mu, fixed) for mu in text.multipliers])
        lams = {mu.symbol for mu in text.multipliers}
        nested = numbers("multipliers", [_nested(mu, lams) for mu in text.multipliers])
        surface_state = numbers("multipliers", [_surface_state(text, mu) for mu in text.multipliers])
        watch_state = numbers("events", [_surface_state(text, e) for e in text.events])
        if loops:
            watch_state = loops.numbered("events", "states", watch_state)
            surface_state = loops.numbered("multipliers", "states", surface_state)
        twins = [_twin(text, e, fixed) for e in text.events]
        twin = numbers("events", [j for j, _ in twins])
        twin_sign = numbers("events", [sign for _, sign in twins])
        if loops:
            twin = loops.numbered("events", "multipliers", twin)
        holders = (("multipliers", text.multipliers), ("events", text.events))
        has_surface = [numbers(kind, [part.surface is not None for part in parts]) for kind, parts in holders]
        has_surface = np.concatenate(has_surface) != 0
        expressions = (*text.rhs, *(mu.condition for mu in text.multipliers))
        if loops:
            expressions += tuple(e for _, _, e in loops.template.sums)
        self.singular = any(p.exp.is_integer is not True for e in expressions for p in e.atoms(sp.Pow))
        carried = [state.SILENT if e.singular else state.PLAIN for e in text.events]
        self.carried = np.where(has_surface[m:], numbers("events", carried), state.TIMED)
        surfaces = [part.surface for _, parts in holders for part in parts if part.surface is not None]

        def looks(moving, flat):
            gaps = any(may_skip_orders(e, text.time, moving) for e in (*expressions, *surfaces))
            return int(gaps or len(flat) > 0)

        finite = [layer for layer in model.layer_states if layer.ratio != sp.oo]
        self.ratios = tuple(layer.ratio for layer in model.layer_states) if finite else ()
        fold = self.fold
        empty = np.zeros(0, np.int64)
        flat_rows = [code.flat_rows_slip, code.flat_rows_general if slides else empty]
        fold_row, fold_col = fold.pattern("G") if fold else (empty, empty)
        self.fixed = dict(
            rk_unit=0,
            look_slip=looks(set(text.states), flat_rows[0]),
            look_general=looks({*text.states, *lams}, flat_rows[1]),
            pair=0,
            **{name: unit_address(name) for name in UNITS if name not in ("run", "rk_unit")},
            fields=code.fields,
            linear=code.linear,
            act=code.act if ne or np.any(self.kind == state.CONTACT) else 0,
            layer=code.layer if self.ratios else 0,
            jet_slip=code.jet_slip,
            jet_general=code.jet_general if slides else 0,
            jet_fold=fold.jet_general if fold else 0,
            fields_fold=fold.fields if fold else 0,
            linear_fold=fold.linear if fold else 0,
            fold_row=fold_row,
            fold_col=fold_col,
            n=n,
            m=m,
            ne=ne,
            nz=len(self.ratios),
            kind=self.kind,
            hidden=hidden,
            g_row=g_row,
            g_col=g_col,
            g_diagonal=_diagonal(g_row, g_col),
            link_row=link_row,
            link_col=link_col,
            contact=np.flatnonzero(self.kind == state.CONTACT),
            block_row=block_row,
            block_member=block_member,
            hub=hub,
            dh_row=dh_row,
            dh_col=dh_col,
            slope_moves=slope_moves,
            nested=nested,
            surface_state=surface_state,
            direction=numbers("events", [e.direction for e in text.events]),
            terminal=numbers("events", [int(e.terminal) for e in text.events]),
            watches=int(any(e.singular for e in text.events)),
            watch=numbers("events", [KINDS.index(e.singular) for e in text.events]),
            watch_state=watch_state,
            twin=twin_sign * (twin + 1),
            rows_slip=code.surface_rows_slip if self.has_jets else np.where(has_surface, 0, -1),
            rows_general=code.surface_rows_general if slides else empty,
            flat_slip=flat_rows[0],
            flat_general=flat_rows[1],
            flat_fold=fold.flat_rows_general if fold else empty,
            # The fold program's first multiplier is dt/ds; the model's own surfaces follow.
            rows_fold=fold.surface_rows_general[1:] if fold else empty,
            # The Runge-Kutta pair's polynomials stand in a fixed order: states, multipliers, surfaces.
            rows_pair=np.where(has_surface, n + m + np.arange(m + ne), -1),
            mult_row=code.mult_row0,
            sigmoid=self.sigmoid.fields,
        )
        # The rows of all programs, one over the other, and behind them what each keeps for itself.
        programs = {"slip": code.nrows_slip, "general": code.nrows_general if slides else (0, 0),
                    "fold": fold.nrows_general if fold else (0, 0)}  # fmt: skip
        self.nrows = max(n + 2 * m + ne, *(count for count, _ in programs.values()))
        for name, (_, own) in programs.items():
            self.fixed[f"own_{name}"] = self.nrows
            self.nrows += own

    def kept(self, what: str) -> dict:
        """What this thread keeps for its next run."""
        return self._scratch.__dict__.setdefault(what, {})

    def problem(self, p: np.ndarray, runge_kutta: bool = False):
        """The Problem at parameter values p (one per symbol of model.parameters), for jets or for the pair.

        This thread's last one is kept: some forty arrays, half of the cost of a short run, depend on p alone.
        """
        kept = self.kept("problems")
        known, made = kept.get(runge_kutta, (None, None))
        if known != p.tobytes():
            made = self.new_problem(p.copy(), runge_kutta)
            kept[runge_kutta] = p.tobytes(), made
        made.p[:] = p  # a sweep writes each orbit's values there
        return made

    def new_problem(self, p: np.ndarray, runge_kutta: bool = False):
        """A Problem that nobody else has."""
        fixed = self.fixed
        if runge_kutta or self.singular:
            fixed = fixed | dict(rk_unit=unit_address("rk_unit"))
        if runge_kutta:
            fixed = fixed | dict(pair=1, jet_fold=0)
        at = dict(zip(self.model.parameters, p.tolist(), strict=True))
        ratio = [1e3 if r == sp.oo else float(r.subs(at)) for r in self.ratios]
        weight = np.array(self.model.eps_ratio or np.ones(self.code.m), float)
        return state.Problem(
            p=p,
            fold_bias=np.zeros(len(p) + self.code.m),
            weight=1.0 / weight,
            ratio=np.array(ratio, float),
            **fixed,
        )

    def work(self, order: int):
        """Scratch arrays for one run: those of this thread's last run of the order, which no run leaves in use."""
        kept = self.kept("works")
        if order not in kept:
            kept[order] = self.new_work(order)
        return kept[order]

    def new_work(self, order: int):
        """Scratch arrays that nobody else has."""
        n, m, ne, fixed, fold = self.code.n, self.code.m, self.code.ne, self.fixed, self.fold
        width = -(-(order + 1) // 8) * 8 + state.PAD  # loops run in blocks of eight
        sizes = dict(
            n=n, m=m, ne=ne, nz=len(self.ratios), width=width, rows=self.nrows,
            fold_size=m + 1 if fold else 0, entries=len(fixed["g_col"]), gradients=len(fixed["dh_col"]) + m + ne,
            fold_entries=len(fixed["fold_col"]),
            fold_gradients=len(fold.pattern("DH")[1]) + m + 1 + ne if fold else 0,
            group=int(np.diff(fixed["block_row"]).max(initial=0)), hubs=len(fixed["hub"]),
            contacts=len(fixed["contact"]),
        )  # fmt: skip
        roots = work.Roots.zeros(sizes, order=order)
        k = np.arange(float(width))
        roots.counting[:], roots.pairing[:], roots.tripling[:] = k, k * (k - 1), k * (k - 1) * (k - 2)
        roots.bernstein_table[:] = bernstein_tables(order, width)
        roots.short_table[:], roots.short_error[:], roots.short_powers[:] = short_tables(order, width)
        roots.left_half[:], roots.right_half[:] = halving_tables(order, width)
        step = work.Step.zeros(sizes, per_order=1.0 / order, per_order_before=1.0 / (order - 1))
        firing = work.Firing.zeros(sizes, carried=self.carried)
        return work.Work.zeros(sizes, roots=roots, step=step, firing=firing)


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
    """Where the diagonal entries of a sparse matrix stand."""
    rows = np.repeat(np.arange(len(row) - 1), np.diff(row))
    return np.flatnonzero(rows == col)


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
    return state.CONTACT if mu.kind == "contact" else state.ALGEBRAIC


def _twin(model: Model, event: EventSpec, fixed: Set[sp.Symbol]) -> tuple[int, int]:
    """The switch whose surface, up to a factor, is that of the event, and the factor's sign; -1 and 0 without one."""
    if event.surface is None or event.singular:
        return -1, 0
    key, _ = fingerprint(event.surface, frozenset(fixed))
    for j, mu in enumerate(model.multipliers):
        if key is not None and mu.kind == "switch" and fingerprint(mu.surface, frozenset(fixed))[0] == key:
            factor = sp.cancel(event.surface / mu.surface)
            # A factor of unknown sign does not say which side is which.
            if factor.free_symbols <= fixed and (factor.is_positive or factor.is_negative):
                return j, 1 if factor.is_positive else -1
    return -1, 0


def _nested(mu: Multiplier, lams: set[sp.Symbol]) -> int:
    """Whether another multiplier stands in the surface, which jumps when that one switches."""
    return int(mu.surface is not None and bool(mu.surface.free_symbols & lams))


def _surface_state(model: Model, mu: Multiplier | EventSpec) -> int:
    """Index of the state whose zero is the surface, or -1."""
    if mu.surface is not None:
        for i, state in enumerate(model.states):
            if mu.surface in (state, -state):
                return i
    return -1


@functools.lru_cache(maxsize=64)
def compiled_problem(model: Model) -> CompiledProblem:
    """The compiled problem of a model; the last ones are kept. Its addresses live as long as the object."""
    return CompiledProblem(model)
