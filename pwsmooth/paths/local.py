"""A run of a family whose events cost their neighbourhood: the arrays that the kernel works on, and its Solution.

Chain: solve -> event_driven.py, or **this file** where the structure allows it -> kernels/local/loop.py.
"""

from __future__ import annotations

import ctypes
import functools
import math
import sys
import time
from typing import Any

import numpy as np
import sympy as sp

from ..codegen.machine.clock import preparing
from ..definition.families.recording import Recorder
from ..definition.families.template import LINKED, family_model
from ..definition.model import Beside, Model, Multiplier
from ..definition.pointwise import value
from ..kernels import state as names
from ..kernels.local import state as local
from ..results.assembly import Catalogue, Recorded, StoredLog, Writer
from ..results.counting import begin
from ..results.records import AmbiguityLog, Outcome
from ..results.solution import Solution
from .budget import SLICE, Budget
from .call import Call, is_smoothed
from .checkpoint import Saved, was_in_parts
from .event_driven import LOOSEST, order_for
from .levels import Levels
from .locality import LOCAL_FROM, MANY, few_elements, few_of, walls, why_global
from .parts import PARTS, beside, cut, threads_for
from .patches import SmallSystem
from .problem import FEW, terms
from .words import KINDS, ambiguities_in_words, event_words

_SHARE = 0.1  # of the tolerances, by which the rim of a patch may change
_LEAN = 100_000  # elements, of more of which rows are short
_FIRST_LOG = 2**14  # events
_FLUSHED = 2**18  # events in the kernel's buffers, from which on they are given up to the log
_COLUMNS = 201  # of a run of fewer that is asked for none
_STAMPS = 2**28  # of patches, from which on they begin anew: marks are twice as large, in 32 bits
# Of the arrays of an Assembly: what each part has of its own.
_OWN = {"event_t", "event", "event_x", "ambiguity_t", "ambiguity", "noted", "power", "terms", "old", "scanned"}
_EMPTY = np.zeros(0, np.int64)


def why_not(model: Model, call: Call) -> str:
    """Where events are those of the whole system: where neither `local` nor `record` asks for it, also of few elements.

    Raises
    ------
    ValueError
        Asked for where it cannot be.
    """
    asked = call.record is not None if call.local is None else call.local
    if call.local is False or not (asked or model.families):
        return "it is not asked for"
    if not asked and sum(model.families.sizes) < (LOCAL_FROM if call.times is not None else MANY + 1):
        return "one loop over few elements is as fast"
    reason = _why_whole(model, call)
    if asked and reason:
        cause, name = ("`record` is given", "record") if call.record else ("`local` is True", "local")
        raise ValueError(f"{cause}, but {reason}; leave `{name}` out.")
    return reason


def _why_whole(model: Model, call: Call) -> str:
    """What makes a run one of the whole system; "" where it is none."""
    whole = {
        "a smoothed view": is_smoothed(model),
        "`dense_output`": call.options.dense,
        "`noise`": call.random is not None,
        "`by`": call.wanted is not None,
        f"method {call.options.method!r}": call.options.method not in ("auto", "taylor"),
    }
    for what, so in whole.items():
        if so:
            return f"{what} takes the whole system"
    return why_global(model)


def run(call: Call) -> Solution:
    """The Solution, every event of which renews the elements that it reaches."""
    options = call.options._replace(rtol=min(call.options.rtol, LOOSEST))
    spending = call.budget()
    threads = threads_for(call.threads, spending.outer is not None)
    runs = _Run(call.system, options, threads)
    return runs.solve(*call.span, call.start, call.times, call.record, spending)


class _Run:
    """The arrays of one run."""

    @preparing()
    def __init__(self, system: Any, options: Any, threads: int):
        from ..codegen.machine.units import local_loop

        self.system, self.model, self.options, self.threads = system, system.model, options, threads
        # Of very many elements the rows of coefficients are what fills the memory: as few as two vectors hold.
        large = self.model.families.sizes[0] > _LEAN and options.rtol >= 1e-10
        self.order = options.order or (15 if large else order_for(options.rtol, False))
        families = self.model.families
        self.n = families.sizes[0]
        self.template = families.template
        self.parts = few_elements(self.template)
        self.code = self._code()
        self.loop = local_loop()
        text = self.template.model
        self.ns, self.nm, self.ne = len(text.states), len(text.multipliers), len(text.events)
        self.width = terms(self.order)
        self._layout()
        # Numbers of a block of the few elements: their first one.
        starts = few_of(self.template).starts
        self.m_at = np.array(starts("multipliers")[:-1], np.int64)
        self.e_at = np.array(starts("events")[:-1], np.int64)
        self.timed = [b for b, e in enumerate(text.events) if e.every is not None or e.at]

    def _code(self) -> Any:
        """A copy of the machine code that nothing else uses now; the next run takes it."""
        from ..codegen.patch import PatchCode

        free = self.parts.kept("patches").setdefault("free", [])
        return free.pop() if free else PatchCode(family_model(few_of(self.template)))

    # ---- what holds for one element

    def _layout(self) -> None:
        """Blocks of the parameters and of the rows of the programs."""
        families = self.template.families("parameters")
        own = [f is not None for f in families]
        self.own_parameters = np.flatnonzero(own)
        self.p_fixed = np.cumsum([0, *(not o for o in own)])[:-1]
        self.p_blocks = np.cumsum([0, *own])[:-1]
        self.rows = {}
        for name in ("slip", "general"):
            constants = self.code.constants.get(name)
            if constants is None:
                continue
            each = np.array([f is not None for f in constants["ROW_FAMILIES"]], bool)
            surfaces = np.array(constants["SURFACE_ROWS"], np.int64).reshape(-1)
            before = np.cumsum([0, *each])
            fixed = np.cumsum([0, *~each])
            has, flat = surfaces >= 0, np.array(constants["FLAT_ROWS"], np.int64)
            self.rows[name] = {
                "blocks": int(before[-1]), "fixed": int(fixed[-1]), "scratch": constants["SCRATCH"],
                "surface": np.where(has, before[surfaces], -1), "of": np.where(has, fixed[surfaces], 0),
                "own": np.where(has, each[surfaces], False).astype(np.int64), "flat": before[flat],
                "flat_of": fixed[flat], "flat_own": each[flat].astype(np.int64),
            }  # fmt: skip

    def _pattern(self, rows: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ends of rows of (block, offset), their blocks, and the columns of the neighbours' table."""
        ends = np.cumsum([0, *map(len, rows)])
        offsets, entries = self.code.offsets, [entry for row in rows for entry in row]
        near = [offsets.index(offset) if offset else -1 for _, offset in entries]
        return ends.astype(np.int64), np.array([b for b, _ in entries], np.int64), np.array(near, np.int64)

    def _kind(self) -> Any:
        fixed, nm, ne = self.parts.fixed, self.nm, self.ne
        own = np.array(
            [f is not None for kind in ("multipliers", "events") for f in self.template.families(kind)], bool
        )
        self.fixed_m, self.blocks_m = int((~own[:nm]).sum()), int(own[:nm].sum())
        firsts = self.model.families.starts
        first = [*firsts("multipliers")[:-1], *(firsts("multipliers")[-1] + i for i in firsts("events")[:-1])]
        of_m, of_e = self.m_at, self.e_at
        linear = self.code.constants["linear"]
        g_rows = [[b for b, offset in row if not offset] for row in linear["G_ROWS"]]
        links = [
            sorted({*row, *(i for i, r in enumerate(g_rows) if j in r)} - {j}) for j, row in enumerate(g_rows)
        ]
        groups: list[list[int]] = []
        for j in range(nm):
            linked = [g for g in groups if set(links[j]) & set(g)]
            groups = [g for g in groups if g not in linked] + [sorted({j, *(i for g in linked for i in g)})]
        coupled = set(self.template.linked)
        groups = [rest for group in groups if (rest := [b for b in group if b not in coupled])]
        g_first, g_block, g_near = self._pattern(linear["G_ROWS"])
        beside = {(j, b, o) for j, row in enumerate(linear["G_ROWS"]) for b, o in row if o}
        beside |= {(b, j, -o) for j, b, o in beside}
        rows = [
            [*((b, 0) for b in row), *((b, o) for i, b, o in sorted(beside) if i == j)]
            for j, row in enumerate(links)
        ]
        link_first, link_block, link_near = self._pattern(rows)
        group_first, group_block, _ = self._pattern([[(b, 0) for b in group] for group in sorted(groups)])
        dh_first, dh_block, dh_near = self._pattern(linear["DH_ROWS"])
        contact = np.flatnonzero(self.parts.kind[of_m] == names.CONTACT)
        self.contacts = len(contact)
        between = np.array([
            b for b, m in enumerate(self.template.model.multipliers)
            if m.may_be_solved and m.surface is not None and m.surface.free_symbols & self.template.beside
        ], np.int64)  # fmt: skip
        reads = [e for e in (*self.template.model.multipliers, *self.template.model.events)
                 if e.surface is not None and self.template.beside & e.surface.free_symbols]  # fmt: skip
        acts = any(not isinstance(e, Multiplier) or e.may_be_solved for e in reads)
        self.groups, self.g_block, self.link_block = groups, g_block, link_block
        self.own_groups = sum(bool(own[group[0]]) for group in groups)  # exactly: their number is a loop's end
        self.group_block, self.dh_block = group_block, dh_block
        place = self.template.place
        read = sorted({
            self.template.model.states.index(p.base) for p in place.values()
            if p.offset and p.base in self.template.model.states
        })  # fmt: skip
        slip = self.rows["slip"]
        none = dict.fromkeys(("flat", "flat_of", "flat_own"), _EMPTY)
        general = self.rows.get("general", slip | none)
        twin = fixed["twin"][of_e]
        twins = [np.searchsorted(of_m, abs(j) - 1, "right") if j else 0 for j in twin]  # blocks, from 1
        at_first, at = self._instants()
        of_surfaces = np.concatenate([of_m, len(self.parts.kind) + of_e])
        sizes = dict(ns=self.ns, nm=nm, ne=ne, nt=len(self.timed), nx=len(read), np=len(self.p_fixed))
        return local.Kind.zeros(
            sizes, ns=self.ns, memories=self.template.model.n_memory, nm=nm, ne=ne,
            np=len(self.own_parameters), nr=len(self.code.offsets),
            target=self._targets(), contact=contact, between=between,
            felt=np.array(self.template.felt, np.int64), felt_blocks=len(self.own_parameters),
            felt_fixed=len(self.p_fixed) - len(self.own_parameters),
            coupled=np.array(self.template.linked, np.int64), reads_between=int(len(reads) > 0),
            acts_between=int(acts), g_near=g_near, dh_near=dh_near, link_near=link_near,
            together=int(self._act_together()), timed=np.array(self.timed, np.int64), at_first=at_first, at=at,
            walls=int(walls(self.template)), read=np.array(read, np.int64),
            s_fixed=np.cumsum([0, *~own])[:-1], s_blocks=np.cumsum([0, *own])[:-1], s_own=own.astype(np.int64),
            s_first=np.array(first, np.int64), fixed_m=self.fixed_m, blocks_m=self.blocks_m,
            kind=self.parts.kind[of_m], hidden=fixed["hidden"][of_m], slope_moves=fixed["slope_moves"][of_m],
            at_zero=fixed["at_zero"][of_m],
            **{name: fixed[name][of_surfaces] for name in ("nested", "wave")},
            surface_state=_blocks(fixed["surface_state"][of_m]),
            g_first=g_first, g_block=g_block, link_first=link_first, link_block=link_block,
            group_first=group_first, group_block=group_block, dh_first=dh_first, dh_block=dh_block,
            rows_slip=slip["blocks"], rows_general=general["blocks"], fixed_slip=slip["fixed"],
            fixed_general=general["fixed"], surface_slip=slip["surface"], surface_general=general["surface"],
            of_slip=slip["of"], of_general=general["of"], own_slip=slip["own"], own_general=general["own"],
            flat_slip=slip["flat"], flat_general=general["flat"], flat_of_slip=slip["flat_of"],
            flat_of_general=general["flat_of"], flat_own_slip=slip["flat_own"],
            flat_own_general=general["flat_own"], direction=fixed["direction"][of_e], terminal=fixed["terminal"][of_e],
            rule=fixed["rule"][of_e],
            twin=np.sign(twin) * np.array(twins, np.int64), carried=self.parts.carried[of_e],
            atol=np.maximum(self.atol[:: self.n], 1e-300), p_fixed=self.p_fixed[self.own_parameters],
            p_blocks=self.p_blocks[self.own_parameters],
            **dict(zip(("shared_fixed", "shared_blocks", "shared"), self.shared, strict=True)),
        )  # fmt: skip

    def _targets(self) -> np.ndarray:
        """Columns of the neighbours that events and impacts write."""
        text = self.template.model
        written = [b for e in text.events for b, _ in e.update]
        written += [b for m in text.multipliers for b, _ in m.impact or ()]
        return np.array(
            sorted({self.code.offsets.index(b.offset) for b in written if isinstance(b, Beside)}), np.int64
        )

    def _act_together(self) -> bool:
        """Whether what an event of an element does depends on other elements, or acts on them."""
        beside = self.template.beside
        for event in self.template.model.events:
            said = [e for _, e in event.update] + ([event.when] if isinstance(event.when, sp.Basic) else [])
            said += [event.surface] if event.surface is not None else []
            if any(isinstance(b, Beside) for b, _ in event.update) or any(
                e.free_symbols & beside for e in said
            ):
                return True
        return False

    def _instants(self) -> tuple[np.ndarray, np.ndarray]:
        """Where those of each timed event begin, and they themselves."""
        values = {
            p: self.system.parameters[p] for p in self.template.model.parameters if p not in self.template.place
        }
        lists = [sorted({value(e, values) for e in self.template.model.events[b].at}) for b in self.timed]
        ends = np.cumsum([0, *map(len, lists)]).astype(np.int64)
        return ends, np.array([t for part in lists for t in part], float)

    def _first_ticks(self, t0: float) -> None:
        """The first instants after the start."""
        A = self.A
        for q, b in enumerate(self.timed):
            event = self.template.model.events[b]
            if event.every is None:
                own = A.kind.at[A.kind.at_first[q] : A.kind.at_first[q + 1]]
                A.tick[:, q] = np.searchsorted(own, t0, side="right")
                continue
            every = A.every[:, q] = self.model.families.of_parameters(event.every, self.values, 0)
            if not (every > 0).all():
                raise ValueError(f"Event {event.name!r}: `every` is {every.min():g}; give a period > 0.")
            first = np.floor(t0 / every).astype(np.int64)
            A.tick[:, q] = first + (every * first <= t0)

    # ---- the whole

    def _may_be_cut(self, kind: Any) -> bool:
        """Whether what happens at an instant reaches only as far as what it changes afterwards does."""
        at_once = len(kind.between) + len(kind.target) > 0 or not kind.s_own.all()
        return not (at_once or kind.terminal.any() or self.options.strict)

    def _assembly(
        self, t0: float, t1: float, start: np.ndarray, times: np.ndarray, kept: np.ndarray, in_parts: bool
    ) -> None:
        n, ns, nm, ne = self.n, self.ns, self.nm, self.ne
        offsets = self.code.offsets
        values = self.values = np.asarray(self.system.parameter_values, float)
        blocks = self.model.families.starts("parameters")
        of_all = np.setdiff1d(np.arange(len(self.p_fixed)), self.own_parameters)
        self.shared = self.p_fixed[of_all], self.p_blocks[of_all], values[[blocks[b] for b in of_all]]
        i = np.arange(n)
        near = np.empty((n, len(offsets)), np.int32)
        for r, offset in enumerate(offsets):
            j = i + offset
            if offset >= LINKED:
                near[:, r] = self.model.families.links[0].rows[:, offset - LINKED]
                continue
            near[:, r] = j % n if self.template.periodic[0] else np.where((j >= 0) & (j < n), j, i)
        pairs = np.stack([near.ravel(), np.repeat(i.astype(np.int32), len(offsets))], axis=1)
        pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
        first = np.concatenate([[0], np.cumsum(np.bincount(pairs[:, 0], minlength=n))])
        kind = self._kind()
        part = np.zeros(n, np.int8)
        if in_parts and self._may_be_cut(kind):
            part = cut(near, first, pairs[:, 1], any(offset >= LINKED for offset in offsets))
        parts = PARTS if part.any() else 0
        in_order = np.argsort(part, kind="stable").astype(np.int32)
        counts = np.bincount(part, minlength=parts + 1)
        sizes = dict(
            elements=n, ns=ns, nm=nm, ne=ne, nt=len(self.timed), nr=len(offsets), np=len(self.own_parameters),
            width=self.width, kept=len(kept), times=len(times), room=_FIRST_LOG, unsure=_FIRST_LOG, most=0,
            near_places=0, cells=0, parts=parts,
        )  # fmt: skip
        queue = local.Queue.zeros(sizes, part=part, first=np.cumsum([0, *counts[:-1]]))
        queue.place[:], queue.key[:] = -1, math.inf
        numbers: dict[str, Any] = dict(
            t=t0, t_end=t1, unit=min(1.0, t1 - t0), share=_SHARE, alone=int(len(pairs) == 0), parts=parts
        )
        A = self.A = local.Assembly.zeros(
            sizes, kind=kind, queue=queue, patch=local.Patch.zeros(sizes), near=near, reader_first=first,
            reader=np.ascontiguousarray(pairs[:, 1]), asked=times, seat=parts, own=-1, **numbers,
        )  # fmt: skip
        A.here, A.post_address = A.address, A.post.ctypes.data
        A.unit_of_parts = ctypes.cast(self.loop, ctypes.c_void_p).value
        A.x[:] = start.reshape(ns, n).T
        A.row[:, :, 0] = A.x
        A.begun[:] = A.until[:] = t0
        A.status[:] = 1
        A.met[:] = A.grazed[:] = math.inf
        A.noted[:] = -math.inf
        A.active[:], A.active_place[in_order], A.actives[:] = in_order, i, counts
        A.waits[:] = math.inf
        A.seen[:], A.keeps[:] = -1, -1
        A.keeps[kept] = np.arange(len(kept))
        self.initial = None
        self._first_ticks(t0)
        self.levels = Levels(self.model.families, values)
        for b, (*_, share) in self.levels.of_block.items():
            A.slip_share[:, b] = share
        for k in range(self.order + 1):
            A.shift[k * self.width : k * self.width + k + 1] = [math.comb(k, j) for j in range(k + 1)]
        for a, b in enumerate(self.own_parameters):
            A.p[:, a] = values[blocks[b] : blocks[b + 1]]
        all_of_them = {
            name: getattr(A, name) for name, member in local.Assembly.members.items()
            if hasattr(member, "rank") and name not in _OWN
        }  # fmt: skip
        patch = A.patch
        self.systems = [SmallSystem(self, self.code, A)]  # that of the border, and those of the parts
        for d in range(parts):
            own = local.Patch.zeros(sizes, mark=patch.mark, slot=patch.slot)
            of_part = local.Assembly.zeros(
                sizes, kind=A.kind.changed(), queue=A.queue.changed(), patch=own, seat=d, own=d, **numbers,
                **all_of_them,
            )  # fmt: skip
            self.systems.append(SmallSystem(self, self._code(), of_part))
            A.crew[d] = self.systems[-1].addresses
        for k, system in enumerate(self.systems):
            patch = system.A.patch
            patch.stamp, patch.stride = 1 + k, 1 + parts
            patch.depth[:] = 1
            patch.depth[1] = 0

    def solve(
        self, t0: float, t1: float, start: Any, times: Any, record: Recorder | None, spending: Budget
    ) -> Solution:
        self.atol = np.broadcast_to(self.options.atol, self.n * self.ns)
        ends = np.array([t0, t1])
        self.record = record
        self.only_ends = record is not None or (times is None and self.n > MANY)
        if self.only_ends:
            kept = self._elements(record)
            asked = times if times is not None and len(kept) else np.empty(0)
        else:
            kept = np.arange(self.n)
            asked = np.linspace(t0, t1, _COLUMNS) if times is None else times
        text = self.template.model
        self.names = [str(s).replace("[]", "") for s in text.states]
        whole = t0, t1, np.asarray(start, float), np.asarray(asked, float), kept
        path = record.checkpoint if record else None
        code = self._run(whole, path, was_in_parts(path), spending)
        if code == local.WITHOUT_PARTS:
            # Of parts that failed, or that went too far ahead, nothing is taken.
            if path:
                path.unlink(missing_ok=True)
            code = self._run(whole, path, False, spending)
        for system in self.systems:
            self.parts.kept("patches")["free"].append(system.code)
        return self._solution(Outcome(code), ends if self.only_ends else asked, asked, kept)

    def _run(self, whole: Any, path: Any, in_parts: bool, spending: Budget) -> int:
        """From the start, or from a checkpoint, to the end; a code."""
        self._assembly(*whole, in_parts)
        record = self.record
        self.statistics = {}
        for name, what in ((record.statistics if record else None) or {}).items():
            self.statistics[name] = begin(
                what, name, self._surfaces(), self.names, KINDS, whole[0], self.A.near
            )
        saved = Saved(self, np.array(whole[:2]), whole[2]) if path else None
        rows = saved.load() if saved else 0
        self.log = Writer(record and record.events, self.names, rows)
        code, stopped = names.AGAIN, (names.AGAIN, Outcome.TIME_LIMIT, Outcome.TOO_MANY_STEPS)
        try:
            code = self._advance(spending, saved)
        finally:
            if code != local.WITHOUT_PARTS:
                self._flush(self._known() if code in stopped else math.inf)
        if code in stopped:
            self.A.halts = 1  # the states where it is now
            for system in self.systems:
                system.A.due = 2**62
            ended = self._call()
            while ended == Outcome.OUT_OF_MEMORY:
                ended = self._call()
            if ended == local.WITHOUT_PARTS:
                return ended
            self._flush(math.inf)
        if saved and code == Outcome.FINISHED:
            saved.remove()
        return code

    def _elements(self, record: Recorder | None) -> np.ndarray:
        """Numbers 0, ..., n - 1 of those that are kept."""
        wanted = np.array(record.elements if record and record.elements else (), np.int64)
        if len(wanted) and np.abs(wanted).max() > self.n:
            raise ValueError(
                f"`elements` of `record` names {np.abs(wanted).max()}; the family has 1 to {self.n}."
            )
        return np.where(wanted > 0, wanted - 1, self.n + wanted)

    def _call(self) -> int:
        """The kernel once, with its threads; a code. Room is made where it was missing."""
        A, systems = self.A, self.systems
        if max(s.A.patch.stamp for s in systems) > _STAMPS and not any(s.A.patch.kept for s in systems):
            A.patch.mark[:] = A.fresh[:] = 0
            for k, system in enumerate(systems):
                system.A.patch.stamp = 1 + k
        with beside(A, self.threads):
            code = self.loop(*systems[0].addresses[:1], A.address, *systems[0].addresses[1:])
        if code == Outcome.OUT_OF_MEMORY:  # perhaps in the midst of an event: nothing else now
            waiting = np.flatnonzero(A.told == Outcome.OUT_OF_MEMORY)
            for k in waiting + 1 if len(waiting) else [0]:
                systems[k].enlarge()
            A.told[:] = 0
            for d in range(A.parts):
                A.crew[d] = systems[1 + d].addresses
        return code

    def _sum(self, name: str) -> int:
        """A counter, over all parts."""
        return sum(getattr(system.A, name) for system in self.systems)

    def _known(self) -> float:
        """The time before which nothing happens any more."""
        A, Q = self.A, self.A.queue
        if not A.parts:
            return math.inf
        first = [Q.key[Q.heap[k]] for k, size in zip(Q.first, Q.size, strict=True) if size]
        return min([A.slab_end, *first, *A.waits])

    def _advance(self, spending: Budget, saved: Saved | None) -> int:
        """Runs the kernel to the end; a code. It comes back now and then, to hear the clock and to give up events."""
        A, shown, last, spent = self.A, 0.0, self.log.rows, self._sum("renewed") // self.n
        while True:
            for system in self.systems:
                system.A.due = system.A.renewed + max(1, int(min(SLICE, self.n * spending.left)))
            code = self._call()
            now_spent = self._sum("renewed") // self.n
            spending.spend(now_spent - spent)
            spent = now_spent
            if code == names.AGAIN and A.slabs == 2 and self.initial is None:
                self.initial = A.x.copy(), A.mult.copy(), A.status.copy()
            if code == Outcome.OUT_OF_MEMORY:
                continue  # with more
            if code != names.AGAIN:
                return code
            late = spending.late()
            stop = late or spending.left <= 0
            events = self._sum("events")
            due = saved is not None and (stop or self.log.rows + events >= last + saved.every)
            if due or events >= _FLUSHED:
                self._flush(self._known())
            if due:
                last = self.log.rows
                saved.write()
            if self.record and self.record.progress and (now := time.monotonic()) > shown + 1.0:
                shown = now
                events = self.log.rows + self._sum("events")
                print(
                    f"t = {A.slab_begin:.6g}, {events} events, {A.actives.sum()} elements move", file=sys.stderr
                )
            if stop:
                return Outcome.TIME_LIMIT if late else Outcome.TOO_MANY_STEPS

    def _flush(self, known: float) -> None:
        """Events before a time from the kernel's buffers into the log, those of parts in the order of their times."""
        parts = []
        for system in self.systems:
            A = system.A
            buffers = A.event_t, A.event, A.event_x
            now, count = A.event_t[: A.events] < known, A.events
            parts.append([b[:count][now] for b in buffers])
            A.events = count - len(parts[-1][0])
            for b in buffers:
                b[: A.events] = b[:count][~now]
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        if len(parts) > 1:
            in_order = np.argsort(columns[0], kind="stable")
            columns = [column[in_order] for column in columns]
        if len(columns[0]):
            self._log(*columns)

    def _log(self, event_t: np.ndarray, event: np.ndarray, event_x: np.ndarray) -> None:
        """Events into the log and the statistics."""
        self.levels.name_folds(event)
        once = np.flatnonzero(self.model.families.told_once(event[:, 0]))
        if len(once) < len(event):
            event_t, event, event_x = event_t[once], event[once], event_x[once]
        first, own = self.A.kind.s_first, self.A.kind.s_own
        surface = np.searchsorted(first, event[:, 0], side="right") - 1
        columns = {
            "t": event_t, "surface": surface.astype(np.int32),
            "element": np.where(own[surface] != 0, event[:, 0] - first[surface] + 1, 0).astype(np.int32),
            **{name: event[:, c].astype(np.int8) for c, name in enumerate(("kind", "came", "went"), 1)},
            **{f"state {name}": event_x[:, b] for b, name in enumerate(self.log.states)},
        }  # fmt: skip
        for statistic in self.statistics.values():
            statistic.take(columns)
        self.log.append(columns, self.record is None or self.record.keep_events)

    def _solution(self, outcome: Outcome, times: np.ndarray, asked: np.ndarray, kept: np.ndarray) -> Solution:
        A = self.A
        reached = int(A.next_asked.min(initial=len(asked)))
        recorded = None
        if self.only_ends:
            # What has no polynomials yet is all that there is.
            first = self.initial or (A.x, A.mult, A.status)
            parts = [*zip(first, (A.x, A.mult, A.status), strict=True)]
            self.initial = first = None
            times = np.array([times[0], A.t])
            names_of = {name: A.x_asked[:reached, :, b].T for b, name in enumerate(self.log.states)}
            for b, mu in enumerate(self.template.model.multipliers):
                kept_mult = A.mult_asked[:reached, :, b].T
                if b in self.levels.of_block:
                    kept_mult = self.levels.lambdas(b, kept_mult, A.status_asked[:reached, :, b].T, kept)
                names_of[mu.symbol.name.replace("[]", "")] = kept_mult
            if len(kept):
                recorded = Recorded(asked[:reached], tuple((kept + 1).tolist()), names_of)
        else:
            times = times[:reached]
            parts = [part[:reached] for part in (A.x_asked, A.mult_asked, A.status_asked)]
            if outcome is not Outcome.FINISHED and not (reached and times[-1] == A.t):
                # Where and in which state it stopped is the most wanted column of a run that did.
                times = np.append(times, A.t)
                ends = A.x, A.mult, A.status
                parts = [np.concatenate([part, end[None]]) for part, end in zip(parts, ends, strict=True)]
        own = [f is not None for f in self.template.families("multipliers")]
        x, mult, status = map(self._rows, parts, ([True] * self.ns, own, own))
        cost = {name: self._sum(name) for name in ("steps", "jets", "events", "layers", "renewed")}
        cost["events"] = self.log.rows
        tolerances = {"rtol": self.options.rtol, "atol": float(self.atol.max(initial=0.0)), "order": self.order}
        words = functools.partial(ambiguities_in_words, self.model)
        told = [(s.A.ambiguity_t[: s.A.ambiguities], s.A.ambiguity[: s.A.ambiguities]) for s in self.systems]
        when, what = (np.concatenate(part) for part in zip(*told, strict=True))
        once = np.flatnonzero(self.model.families.told_once(what[:, 0]))
        if len(told) > 1:
            once = once[np.argsort(when[once], kind="stable")]
        unsure = AmbiguityLog(when[once], what[once], words)
        columns = self.log.columns()
        log = StoredLog(columns, A.kind.s_first.copy(), event_words(self.model))
        solution = Solution(
            self.system, times, x, self.levels.show(mult, status), status, log, None, outcome, cost,
            tolerances, unsure, self.system.parameters, None,
        )  # fmt: skip
        catalogue = Catalogue(columns, self._surfaces(), self.log.states, A.near)
        for statistic in self.statistics.values():
            statistic.end(A.t)
        solution.recorded, solution.catalogue, solution.statistics = recorded, catalogue, self.statistics
        return solution

    def _surfaces(self) -> list[str]:
        """Names of the switches, contacts and events."""
        text = self.template.model
        names_of = [mu.symbol.name.replace("[]", "") for mu in text.multipliers]
        return names_of + [str(e.name).replace(" []", "") for e in text.events]

    def _rows(self, part: Any, own: list[bool]) -> np.ndarray:
        """Of arrays of elements and blocks, one a time: a row a number, one alone of what belongs to all elements."""
        ends = np.cumsum([0, *(self.n if each else 1 for each in own)])
        rows = np.empty((ends[-1], len(part)), part[0].dtype if len(part) else part.dtype)
        for k, array in enumerate(part):
            for b, (first, end) in enumerate(zip(ends, ends[1:])):
                rows[first:end, k] = array[: end - first, b]
        return rows


def _blocks(numbers: np.ndarray) -> np.ndarray:
    """Numbers of a few elements -> their blocks."""
    return np.where(numbers >= 0, numbers // FEW, -1)
