"""Deviations of a run: its tape played again (kernels/tangent), with the model's Jacobians.

Chain: event_driven.py, whose run writes the tape -> **replay** -> of_solution.py, analysis/.
"""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...codegen import LANES, compile_model
from ...definition.folds import fold_model
from ...definition.model import Model
from ...kernels import state as names
from ...kernels.step.tables import STAGES
from ...kernels.tangent.state import NO_SERIES, UNKNOWN, ZEROS, Flow, Tangent
from ..clock import slopes_of_instants
from ..problem import CompiledProblem, terms
from .linearised import rates

_PLACES = 64  # wanted times on one way that are looked at together


class Deviations(NamedTuple):
    """What a replay gives, for each of the columns that it began with."""

    end: np.ndarray  # (n, columns)
    at_point: np.ndarray  # (points, n + m, columns)
    at_sample: np.ndarray  # (samples, n + m, columns)
    instant_t: np.ndarray  # (instants,)
    instant_why: np.ndarray  # (instants, 2)
    instant_dt: np.ndarray  # (instants, columns)
    instant_w: np.ndarray  # (instants, 2 n, columns), before and after, along with the instant's time
    stopped: float  # time of the step that has no series, or nan
    off: np.ndarray  # (columns,) what led out of the surfaces on which the run begins

    @property
    def known(self) -> bool:
        """Whether every step and every instant has been gone through by a rule that is known."""
        return np.isnan(self.stopped) and not (self.instant_why[:, 0] == UNKNOWN).any()


class Slopes(NamedTuple):
    """Of a cost, by what a run began with."""

    start: np.ndarray  # (n,)
    parameters: np.ndarray  # (np,)
    why: tuple[int, int, float] | None  # of the first instant without derivative: code, cause, time
    off: np.ndarray  # (n + np,) what leads out of the surfaces on which the run begins


class Readings(NamedTuple):
    """Slopes of a cost by what it reads: the end state, states and multipliers at times, instants of the tape."""

    end: np.ndarray  # (n,)
    times: np.ndarray  # sorted
    at: np.ndarray  # (times, n + m)
    entries: np.ndarray  # sorted entries of the tape at which instants begin
    instants: np.ndarray  # (entries, 2 n + 1): by the states before and after, and by the time


class _FlowOf:
    """The entries of a Taylor program with Jacobians, by rows: n of the rates, m of the residuals."""

    def __init__(self, program: Any, name: str, n: int, m: int, parameters: int, own: int):
        entries = [] if program is None else program.constants["ENTRIES"]
        entries = [e for e in entries if e[0] % 3 != 2 or e[2] < parameters]
        self.row = np.array([i + n * (kind >= 3) for kind, i, *_ in entries], np.int64)
        order = np.argsort(self.row, kind="stable")
        table = np.array(entries, np.int64).reshape(-1, 5)[order]
        self.first = np.concatenate([[0], np.cumsum(np.bincount(self.row, minlength=n + m))])
        self.kind, self.equation, self.column, self.place, constant = table.T
        self.moves, self.m, self.own = 1 - constant, m, own
        rows = [
            {(kind % 3, j, place) for kind, r, j, place, _ in entries if r == i and kind // 3 == level}
            for level, size in ((0, n), (1, m)) for i in range(size)
        ]  # fmt: skip
        self.same = np.array(
            [rows[n:].index(row) if row and row in rows[n:] else -1 for row in rows[:n]], np.int64
        )
        self.jet = program.address(name) if program else 0
        self.reads = np.array(program.constants.get("READ_ROWS", ()) if program else (), np.int64)

    def bundle(self, width: int, wide: int) -> Flow:
        """For rows of this width and deviations of this many columns."""
        what, by_mult = self.kind % 3, self.kind == 4
        table = np.stack([self.equation, self.column, self.place * width], axis=1)
        return Flow(
            jet=self.jet, reads=self.reads, own=self.own, residuals=self.m, first=self.first, what=what,
            index=np.where(what == 2, self.column * wide, self.column), place=self.place * width, moves=self.moves,
            same=self.same, by_mult=table[by_mult], solved=np.full(1 + self.m, -2), count=np.zeros(1, np.int64),
            equations=np.zeros(6 * len(self.same) + 6 * self.m, np.int64), term_at=np.zeros(2 * len(table), np.int64),
            term_row=np.zeros(2 * len(table), np.int64),
        )  # fmt: skip


class CompiledTangents:
    """The programs with Jacobians of a model, and the arrays that describe them."""

    def __init__(self, problem: CompiledProblem, what: str):
        """What the programs do along steps: see Compiled.tangent()."""
        self.model = model = problem.model
        self.told = {"given": int(what != "jets"), "lanes": LANES.get(what, 0)}
        code = self.code = compile_model(model)
        n, m, count = code.n, code.m, code.np
        slides = problem.fixed["jet_general"] != 0
        fold = self.fold = compile_model(fold_model(model)) if problem.fold else None
        programs = {name: code.tangent(what, name) for name in ("slip", "general") if name == "slip" or slides}
        programs["fold"] = fold.tangent("jets", "general") if fold else None
        top = max(p.constants["NROWS"] for p in programs.values() if p)
        self.flows, own = {}, 0
        for name in ("slip", "general", "fold"):
            program = programs.get(name)
            rows, address = n + 1 + m if name == "fold" else n, "jet_slip" if name == "slip" else "jet_general"
            self.flows[name] = _FlowOf(program, address, rows, m + (name == "fold"), count, top + own)
            own += program.constants["OWN_ROWS"] if program else 0
        point, acts = (code.tangent("point", name) for name in ("jacobian", "act_slopes"))
        entries = np.array(point.constants["ENTRIES"], np.int64).reshape(-1, 5)
        writes = acts.constants["WRITES"]
        flat = [w for update in writes for w in update]
        self.fixed: dict[str, Any] = dict(
            jacobian=point.address("jacobian"), act_slopes=acts.address("act_slopes"), entries_point=entries,
            write_first=np.cumsum([0, *map(len, writes)]), write_state=np.array([k for k, _ in flat], np.int64),
            write_adds=np.array([adds for _, adds in flat], np.int64), jac=np.zeros(len(entries)),
        )  # fmt: skip
        most = max(map(len, writes), default=0)
        both, unknowns = n + m + 2, max(2 * m, m + 1)
        self.sizes = dict(
            n=n, m=m, np=count, rows=top + own, all=both, unknowns=unknowns, twice=2 * unknowns,
            closed=4 * m, wider=n, room=_PLACES, sums=8 * max(both, unknowns),
        )  # fmt: skip
        discs = any(mu.kind == "disc" for mu in model.multipliers)
        self.sizes |= dict(moment=5 + n if discs else 0, node_rows=STAGES * (n + m) if discs else 0)
        self.lengths = dict(
            slopes=max((n + m + count + 1) * most, m + code.ne, 1), bias=count + 2 * m,
        )  # fmt: skip

        self.kept: dict[tuple, list[tuple[Tangent, np.ndarray]]] = {}

    @contextlib.contextmanager
    def tangent(self, order: int, tolerance: float, columns: int, **given: np.ndarray) -> Iterator[Tangent]:
        """A Tangent for so many columns (a multiple of eight), at rest and nobody else's while it is used."""
        kept = self.kept.setdefault((order, tolerance, columns), [])
        made, cells = kept.pop() if kept else self._new(order, tolerance, columns)
        made.cells[:] = cells
        made.w[:], made.seeds[:], made.slope_q[:], made.scale[:] = 0.0, 0.0, 0.0, 0.0
        for name, value in given.items():
            Tangent.members[name].give(made, value)
        yield made
        kept.append((made, cells))

    def _new(self, order: int, tolerance: float, columns: int) -> tuple[Tangent, np.ndarray]:
        """A Tangent, and what its cells hold at rest."""
        sizes = self.sizes | dict(wide=columns + 8, width=terms(order) + names.PAD, columns=columns)
        width, wide = sizes["width"], sizes["wide"]
        scratch: dict[str, Any] = {name: flow.bundle(width, wide) for name, flow in self.flows.items()}
        scratch |= {name: np.zeros(size) for name, size in self.lengths.items()}
        sizes["moments"] = sizes["moment"] * (1 + columns)
        sizes["node_columns"] = sizes["node_rows"] + columns
        sizes["columned"] = sizes["rows"] * width if self.told["lanes"] else 0
        sizes["series"] = (sizes["all"] + sizes["unknowns"]) * 8 * (order + 1 + ZEROS)
        made = Tangent.zeros(
            sizes,
            order=order,
            tolerance=tolerance,
            columns=columns,
            parameters=self.code.np,
            **self.told,
            **self.fixed,
            **scratch,
        )
        Tangent.members["rows_flat"].give(made, made.rows.ravel())
        binomials = [[math.comb(i, k) for k in range(width)] for i in range(order + 1)]
        Tangent.members["binomials"].give(made, np.ravel(binomials))
        return made, made.cells.copy()


@dataclass(frozen=True, eq=False)
class Tape:
    """What the loop has written of a run (step/recording.py), and what it ran with."""

    compiled: CompiledProblem
    p: np.ndarray
    order: int
    rtol: float
    clock: np.ndarray
    clock_event: np.ndarray
    entries: np.ndarray
    values: np.ndarray
    dense: np.ndarray | None = None  # (steps, n + m + 1, order + 1) where the run has kept its polynomials
    may_pair: bool = True  # whether steps can be taken by the pair

    @property
    def model(self) -> Model:
        """That of the run."""
        return self.compiled.model

    def programs(self, given: str) -> CompiledTangents:
        """What plays it again: if the run has kept its polynomials, those on these."""
        what = "jets" if self.dense is None else given
        found = self.compiled.tangents.get(what)
        if found is None:
            found = self.compiled.tangents[what] = CompiledTangents(self.compiled, what)
        return found

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Of a Tangent that plays it."""
        dense = np.empty((0, 0, 0)) if self.dense is None else self.dense
        return {"tape": self.entries, "tape_x": self.values, "dense": dense}

    @functools.cached_property
    def instants(self) -> np.ndarray:
        """The entries at which instants begin, as a replay counts them and `Readings.entries` names them."""
        kind, what = self.entries[:, 0], self.entries[:, 1]
        meets = np.flatnonzero((kind == names.TAPE_MEET) & (what != names.TAPE_NOTHING))
        parts = (kind == names.TAPE_STEP) & (
            (self.values[:, 1] > 1e-15 * np.abs(self.values[:, 0])) | np.isin(what, (names.ARC, names.CLOSING))
        )
        steps = np.searchsorted(np.flatnonzero(parts), meets)
        return meets[np.append(True, steps[1:] != steps[:-1])] if len(meets) else meets

    @functools.cached_property
    def counts(self) -> np.ndarray:
        """How many entries it has of each kind."""
        return np.bincount(self.entries[:, 0], minlength=names.TAPE_END + 1)

    @functools.cached_property
    def by_series(self) -> bool:
        """Whether every step has a series; those of the pair at the branch point of a root have none."""
        if not self.may_pair:
            return True
        return not ((self.entries[:, 0] == names.TAPE_STEP) & (self.entries[:, 1] == names.PAIR)).any()

    def met(self) -> tuple[np.ndarray, np.ndarray]:
        """Times of the instants, and their causes: places among multipliers and events."""
        return self.values[self.instants, 0], self.entries[self.instants, 2]

    @property
    def first_step(self) -> int:
        """Its entry, where the run stands as it holds from the start on; of a run without steps the last one."""
        steps = np.flatnonzero(self.entries[:, 0] == names.TAPE_STEP)
        return int(steps[0]) if steps.size else len(self.entries) - 1

    @property
    def instant_size(self) -> float:
        """Times that differ by less are one."""
        return 1e-12 * float(self.values[-1, 0] - self.values[0, 0])

    def standing(self, k: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Time, states and multipliers at an entry."""
        n, m = len(self.model.states), len(self.model.multipliers)
        row = self.values[k]
        return float(row[0]), row[2 : 2 + n], row[2 + n : 2 + n + m]

    def first_rates(self) -> np.ndarray:
        """f behind the start."""
        return rates(self.model, *self.standing(self.first_step), self.p)

    def ticks(self, parameters: Iterable[int]) -> Iterator[tuple[int, np.ndarray]]:
        """Of these parameters those that move instants of the clock: its place, d(instants)/d(parameter)."""
        if len(self.clock):
            given = dict(zip(self.model.parameters, self.p))
            for j in parameters:
                yield (
                    j,
                    slopes_of_instants(
                        self.model, given, self.clock, self.clock_event, self.model.parameters[j]
                    ),
                )

    def deviations(
        self, start: np.ndarray, seeds: np.ndarray, times: np.ndarray | None = None, points: bool = True
    ) -> Deviations:
        """Along the run from `start` (n, columns) of its states and `seeds` (np, columns) of its parameters.

        `times` are wanted besides those of the record.
        """
        from ...codegen.machine.units import tangent_replay

        (n, k), m = start.shape, len(self.model.multipliers)
        loop, compiled = tangent_replay(), self.programs("columns")
        columns = -(-k // 8) * 8
        instants, recorded = (int(self.counts[kind]) for kind in (names.TAPE_MEET, names.TAPE_POINT))
        times = np.empty(0) if times is None else times
        at_point = np.zeros((recorded if points else 0, n + m, columns))
        at_sample = np.zeros((len(times), n + m, columns))
        instant_t, why = np.empty(instants), np.empty((instants, 2), np.int64)
        instant_dt, instant_w = np.empty((instants, columns)), np.empty((instants, 2 * n, columns))
        asked = self.arrays | dict(
            instant_t=instant_t, instant_why=why, instant_dt=instant_dt, instant_w=instant_w
        )
        # A Tangent at rest is asked for nothing.
        asked |= {
            name: a
            for name, a in (("at_point", at_point), ("at_sample", at_sample), ("t_eval", times))
            if len(a)
        }
        if len(self.clock):
            clock = asked["clock"] = np.zeros((len(self.clock), columns + 8))
            for j, slopes in self.ticks(np.flatnonzero(seeds.any(axis=1))):
                clock[:, :k] += np.outer(slopes, seeds[j])
        with compiled.tangent(self.order, max(10.0 * self.rtol, 1e-15), columns, **asked) as tangent:
            tangent.w[:, :k], tangent.seeds[:, :k] = start, seeds
            first = np.abs(self.values[0, 2 : 2 + n])
            tangent.scale[:k] = np.maximum(np.abs(self.p) @ (seeds != 0), first @ (start != 0))
            tangent.instant = self.instant_size
            stopped = loop(self.compiled.problem(self.p).address, tangent.address, len(self.entries))
            found, end = tangent.instants, tangent.w[:, :k].copy()
            samples, off = tangent.samples, tangent.off[:k].copy()
        return Deviations(
            end, at_point[:, :, :k], at_sample[:samples, :, :k], instant_t[:found], why[:found],
            instant_dt[:found, :k], instant_w[:found, :, :k],
            np.nan if stopped < 0 else float(self.values[stopped, 0]), off,
        )  # fmt: skip

    def pull_back(self, cost: Readings) -> Slopes:
        """Slopes of a cost by the start of the run and by its parameters."""
        from ...codegen.machine.units import tangent_replay

        loop, compiled = tangent_replay(), self.programs("given")
        n, m, count = compiled.code.n, compiled.code.m, compiled.code.np
        columns = -(-(n + count + 2) // 8) * 8
        steps = np.flatnonzero(self.entries[:, 0] == names.TAPE_STEP)
        arcs = np.isin(self.entries[steps, 1], (names.ARC, names.START, names.CLOSING))
        ends = np.append(self.values[steps[1:], 0], self.values[-1, 0])[arcs]
        # Only along these, and at the end, columns are asked for what the cost reads.
        begins = np.append(self.values[steps[arcs], 0], self.values[-1, 0])
        ends = np.append(ends, np.inf)
        most = int((np.searchsorted(cost.times, ends) - np.searchsorted(cost.times, begins)).max())
        clock = np.zeros((len(self.clock), columns + 8))
        clock[:, n + count] = 1.0
        slope_clock = np.zeros(len(self.clock))
        asked = dict(
            **self.arrays, t_eval=cost.times, cost_slope=cost.at, cost_entry=cost.entries,
            cost_instant=cost.instants, clock=clock, slope_clock=slope_clock,
            at_sample=np.zeros((most, n + m, columns)), instant_t=np.zeros(1),
            instant_why=np.zeros((1, 2), np.int64), instant_dt=np.zeros((1, columns)),
            instant_w=np.zeros((1, 2 * n, columns)),
        )  # fmt: skip
        with compiled.tangent(self.order, max(10.0 * self.rtol, 1e-15), columns, **asked) as tangent:
            tangent.seeds[:, n : n + count] = np.eye(count)
            tangent.scale[n : n + count], tangent.instant = np.abs(self.p), self.instant_size
            tangent.slope[:] = cost.end
            tangent.backward, tangent.bad = 1, -1
            tangent.cost, tangent.cost_events = len(cost.times), len(cost.entries)
            stopped = loop(self.compiled.problem(self.p).address, tangent.address, len(self.entries))
            bad, why, cause = tangent.bad, tangent.bad_why, tangent.bad_cause
            by_start, by_parameters = tangent.slope.copy(), tangent.slope_q[:, 0].copy()
            off = tangent.off[: n + count].copy()
        for j, slopes in self.ticks(range(count)):
            by_parameters[j] += slopes @ slope_clock
        bad, why, cause = (stopped, NO_SERIES, -1) if stopped >= 0 else (bad, why, cause)
        problem = None if bad < 0 else (why, cause, float(self.values[bad, 0]))
        return Slopes(by_start, by_parameters, problem, off)
