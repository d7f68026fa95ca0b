"""The event-driven path of solve(): the kernel's run and its integers turned into words.

Chain: solve -> **this file** -> kernels/trajectory.py, the loop that reads like the theory.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from ..codegen.machine.clock import preparing
from ..codegen.machine.units import METHODS, trajectory_loop
from ..definition.model import Model
from ..door import calls, checks
from ..kernels import state as names
from ..results.impulses import ImpulsesOf
from ..results.records import Dense, EventLog, Outcome, course
from ..results.solution import Solution
from . import memory
from .budget import Budget, Slices, first_slice
from .call import Call, Options
from .clock import instants_of_time
from .derivatives.tangents import Tape
from .levels import Levels
from .problem import compiled_problem, longest_step
from .words import ambiguities_in_words, event_words, singular_cause

_BREAKDOWNS = Outcome.NOT_FINITE, Outcome.STEP_UNDERFLOW
_LOOP = 40  # events in a row at one instant that make a loop
_ROOM, _LEAST_ROOM = 1024, 64  # points that the first buffers hold: the fewer, the larger the system
_KEPT_BYTES = 2**21  # of first buffers, which the next run finds again
_KEPT = 16  # choices of options that a thread keeps of a model
_MOST_ROWS = 2**27  # bytes
_LARGE = 2**27  # bytes, above which the next buffers hold twice as many at most
LOOSEST = 1e-6  # looser tolerances were seen to take wrong turns
_METHODS = "auto", "taylor", *METHODS
FINEST_OF_ONE_STEP = 1e-13  # roundings of the stages keep a method of one step from less


def _next_room(room: int, first: int, t0: float, t: float, t_end: float) -> int:
    """Points of the next buffers: as many as the whole span takes at the rate so far, within bounds.

    Copies of what is full, by fours, cost a quarter of a run over thousands of periods.
    """
    reached = (t - t0) / (t_end - t0)
    return int(min(max(1.1, 2.0 * reached) / max(reached, 1e-3), 64.0 if room == first else 8.0) * room)


def why_not(model: Model, call: Call) -> str:
    """ "" always: what no other path takes is event-driven.

    Raises
    ------
    ValueError
        A method that no event-driven run has, an `order` with one that has its own, a `record`.
    """
    method, order = call.options.method, call.options.order
    if call.record is not None:
        raise ValueError("`record` is given, but the run is not one of local events; leave it out.")
    if method not in _METHODS:
        own = ", ".join(map(repr, METHODS))
        raise ValueError(
            f"`method` is {method!r}, which no event-driven run has; choose 'auto', 'taylor', {own} or 'stiff' (the "
            f"others are for `system.smoothed(...)`).{calls.hint(method, (*_METHODS, 'stiff'))}"
        )
    if order is not None and method in METHODS:
        raise ValueError(
            f"`order` is {order}, but method={method!r} has its own; leave `order` out, or use 'taylor'."
        )
    return ""


def run(call: Call, within: Budget | None = None) -> Solution:
    """The Solution, with what its derivatives take where there will be any; `within` is what it draws from."""
    kicks, system, (t0, t1) = call.random, call.system, call.span
    if kicks is not None:
        system = kicks.system
    ready = _ready(system.model, call)
    p = np.array(system.parameter_values, float)
    return ready.solve(
        system, p, t0, t1, call.start, call.times, within or call.budget(), kicks, call.continues
    )


def _ready(model: Model, call: Call) -> EventDriven:
    """What runs a call; through an inner entrance a thread finds it again."""
    ready = getattr(call.kept, "ready", None)
    if ready is not None and ready.model is model:
        return ready
    options, differentiated = call.options, call.wanted is not None
    if options.dense or differentiated:
        options = options._replace(tape=differentiated or model.families is None, rows=differentiated)
    ready = prepared_run(model, options)
    if differentiated and not ready.by_series:
        ready = prepared_run(model, options._replace(dense=True))
    if call.kept is not None:
        call.kept.ready = ready
    return ready


def prepared_run(model: Model, options: Options) -> EventDriven:
    """This thread's EventDriven of a model with these options, made at their first use.

    A short run would spend most of its time on arrays that are the same in the next one.
    """
    kept = compiled_problem(model).kept("runs")
    run = kept.get(options)
    if run is None:
        run = EventDriven(model, options)
        if len(kept) >= _KEPT:
            kept.pop(next(iter(kept)))
        kept[options] = run
    return run


class _Cells:
    """Where the numbers of the kernel's State stand: a short run would feel each being looked up by its name."""

    points, events, ambiguities, pieces, taped, steps, jets, layers, samples = (
        names.State.members[name].at
        for name in ("points", "events", "ambiguities", "pieces", "taped", "steps", "jets", "layers", "samples")
    )
    t, unit = (names.State.members[name].at for name in ("t", "unit"))


class _Run:
    """What the parts of one run have in common."""

    def __init__(self, system: Any, problem: Any, control: Any, most: int) -> None:
        self.system, self.problem, self.control, self.most = system, problem, control, most
        self.p = problem.p.copy()


class Checkpoint(NamedTuple):
    """Where a part of a run began: the kernel's State, the room of its buffers, and where it has to end at last."""

    run: _Run
    end: float
    room: int
    block: np.ndarray
    cells: np.ndarray


class Part(NamedTuple):
    """Of a run, in the buffers themselves, where the next part and any other run of the model will write."""

    tape: Tape
    ambiguities: int  # that are recorded in it
    code: int
    solution: Callable[[], Solution]


class EventDriven:
    """A model with options, ready to run: the arrays that the kernel works on.

    Nothing of a run stays in them that the next one would see.
    """

    @preparing()
    def __init__(self, model: Model, options: Options, series: bool = True):
        self.model, self.dense = model, options.dense
        self.loop = trajectory_loop()
        self.parts = parts = compiled_problem(model) if series else compiled_problem(model, False)
        # A tape is played again by series; where an argument of a root comes to 0 there is none.
        self.by_series = parts.has_jets and not parts.singular
        self.tape = options.tape and parts.has_jets
        if self.tape:
            checks.without_together(model, "derivatives")
        self.rows = self.tape and options.rows and options.method not in METHODS
        self.sizes = parts.code
        if options.method == "taylor" and not parts.has_jets:
            raise ValueError(
                "`method` is 'taylor', but a function of this system has no Taylor recurrence; use 'rk'."
            )
        # Which of the methods of one step; none with series.
        self.one_step = options.method if options.method in METHODS else "" if parts.has_jets else "rk"
        if self.one_step:
            checks.without_discs(model, f"steps of method {self.one_step!r}")
        rtol = max(min(options.rtol, LOOSEST), FINEST_OF_ONE_STEP if self.one_step else 0.0)
        atol = options.absolute(model)
        # Their polynomials have degree 7 at most.
        self.order = 7 if self.one_step else options.order or order_for(rtol, parts.code.by_responses)
        self.tolerances = {"rtol": rtol, "atol": float(atol.max(initial=0.0)), "order": self.order}
        if self.rows:
            self.most_rows = _MOST_ROWS // (8 * (parts.code.n + parts.code.m) * (self.order + 1))
        self.work = parts.work(self.order)
        self.words = event_words(model)
        self.collides = any(mu.kind == "contact" for mu in model.multipliers)
        self.impulses_of = ImpulsesOf(model) if self.collides else None
        self.max_steps, self.slice = options.max_steps, first_slice(parts.code.n + parts.code.m)
        self.limits = dict(
            order=self.order, rtol=rtol, atol=np.maximum(atol, 1e-300), t_end=0.0,
            max_step=min(options.max_step, longest_step(self.order)),
            max_steps=options.max_steps, strict=int(options.strict),
        )  # fmt: skip
        self.periodic = parts.periodic
        self.clocked = bool(parts.periodic) or any(
            event.every is not None or event.at for event in model.events
        )
        none = np.empty(0, np.int64)
        self.control = names.Control(**self.limits, clock=np.empty(0), clock_event=none, clock_side=none)
        self.t_end, self.bound = self.control.scalar("t_end"), self.control.scalar("max_steps").view(np.int64)
        m, ne = len(model.multipliers), len(model.events)
        self.state = names.State.in_one_block(names.State.planned(dict(n=len(model.states), m=m, ne=ne)))
        self.state.side[:], self.state.step = 1, min(1e-3, options.max_step)
        self.blank = self.state.block.copy(), self.state.cells.copy()
        self.most = {"most_events": 4 * m + 6 * ne + 192, "most_unsure": m + ne + 8}
        least, more = self._bytes(0), self._bytes(1024) - self._bytes(0)
        self._keep(min(_ROOM, max(_LEAST_ROOM, 1024 * (_KEPT_BYTES - least) // more)))

    def _keep(self, room: int) -> None:
        """First buffers of runs to come; what a large system records is given back after every run."""
        self.room, self.record = room, self._record(room) if self._bytes(room) <= _KEPT_BYTES else None

    def begin(self, t0: float, t1: float, start: Any) -> Any:
        """The kernel's State before its first step (kernels/sweeping makes the same one for every orbit)."""
        state = self.state
        state.block[:], state.cells[:] = self.blank
        state.floats[_Cells.t], state.floats[_Cells.unit] = t0, min(1.0, t1 - t0)
        state.x[:] = start
        state.last[:, 0] = t0
        return state

    def timed(self, t0: float, t1: float, values: Mapping[sp.Symbol, float], continues: bool = False) -> Any:
        """The kernel's Control for a span, which may continue a run that ended at t0."""
        if self.clocked:
            clock, which, sides = instants_of_time(
                self.model, values, t0, t1, self.max_steps, self.periodic, not continues
            )
            return names.Control(
                **self.limits | {"t_end": t1}, clock=clock, clock_event=which, clock_side=sides
            )
        self.t_end[0] = t1
        return self.control

    def solve(
        self, system: Any, p: np.ndarray, t0: float, t1: float, start: Any, times: Any, spending: Budget,
        kicks: Any = None, continues: bool = False,
    ):  # fmt: skip
        """The Solution of one run: the kernel runs to its end, its buffers emptied as they fill.

        `p` has one value per symbol of model.parameters, `times` are the wanted ones or None.
        """
        problem = self.parts.problem(p, self.one_step)
        if kicks is not None:
            problem = kicks.problem(problem)
        control, state = self.timed(t0, t1, system.parameters, continues), self.begin(t0, t1, start)
        advance = self.advance(problem, control, state)
        more = functools.partial(self.larger, state, t0, t1)
        code, record = self.advanced(advance, more, control, state, self.first_record(times), spending)
        if code == names.BROKEN:
            mu = self.model.multipliers[self.work.broken].symbol
            raise AssertionError(
                f"an invariant of {mu} does not hold at t = {state.t!r}: statuses {state.status.tolist()}, "
                f"multipliers {state.mult.tolist()}, states {state.x.tolist()} "
                "(PWSMOOTH_CHECK; kernels/instant/invariants.py)."
            )
        kept = self._kept(record, state)
        solution = self.finish(system, code, problem, state, kept, record, times)
        if self.tape:
            solution.tape = self._tape(p, control, state, kept)
        if len(record.t) == self.room:
            return solution
        room = int(1.1 * max(state.points, state.events, state.ambiguities, state.pieces))
        if room > self.room and self._bytes(room) <= _KEPT_BYTES:
            self._keep(room)
        return solution

    def parts_of(
        self,
        system: Any,
        p: np.ndarray,
        t0: float,
        ends: Sequence[float],
        start: Any,
        spending: Budget,
        most: int = 0,
    ) -> Iterator[tuple[Solution, Checkpoint]]:
        """One run to the last of `ends`, however long, in parts: each a Solution with its tape, and where it began.

        Parts end at the `ends`, and where the buffers are full, which grow to `most` bytes. A part begins with the
        column that the one before it ended with; what it holds is overwritten by the next one.
        """
        for run, code, record, begun in self._in_parts(system, p, t0, ends, start, spending, most):
            yield self._finished(run, code, record), begun

    def tapes_of(
        self, system: Any, p: np.ndarray, t0: float, ends: Sequence[float], start: Any, spending: Budget
    ) -> Iterator[Part]:
        """The same without Solutions."""
        state = self.state
        for run, code, record, _ in self._in_parts(system, p, t0, ends, start, spending):
            tape = self._tape(run.p, run.control, state, self._parts(record, state))
            yield Part(tape, state.ambiguities, code, functools.partial(self._finished, run, code, record))

    def _in_parts(
        self,
        system: Any,
        p: np.ndarray,
        t0: float,
        ends: Sequence[float],
        start: Any,
        spending: Budget,
        most: int = 0,
    ) -> Iterator[tuple[_Run, int, Any, Checkpoint]]:
        control, state = self.timed(t0, ends[-1], system.parameters), self.begin(t0, ends[-1], start)
        run, record = _Run(system, self.parts.problem(p, self.one_step), control, most), self.first_record()
        stands = state.block.copy(), state.cells.copy()
        for end in ends:
            code: int = Outcome.OUT_OF_MEMORY
            while code == Outcome.OUT_OF_MEMORY:
                # Whoever has taken the last part may have run others here.
                state.block[:], state.cells[:] = begun = stands
                self._empty(record)
                code, record = self._part(run, end, record, spending)
                stands = state.block.copy(), state.cells.copy()
                yield run, code, record, Checkpoint(run, end, len(record.t), *begun)
            if code != Outcome.FINISHED:
                return

    def again(self, begun: Checkpoint, spending: Budget) -> Solution:
        """A part of a run once more."""
        self.state.block[:], self.state.cells[:] = begun.block, begun.cells
        run, record = begun.run, self._record(begun.room)
        run.problem.p[:] = run.p
        self._empty(record)
        return self._finished(run, *self._part(run, begun.end, record, spending))

    def _part(self, run: _Run, end: float, record: Any, spending: Budget) -> tuple[int, Any]:
        """(code, buffers) where the buffers are full or the end is reached."""
        run.control.scalar("t_end")[0] = end

        def more(record: Any) -> Any:
            room = 4 * len(record.t)
            return self._record(room, record, self.state) if self._bytes(room) <= run.most else None

        advance = self.advance(run.problem, run.control, self.state)
        return self.advanced(advance, more, run.control, self.state, record, spending)

    def _finished(self, run: _Run, code: int, record: Any) -> Solution:
        """The part as a Solution; one that is cut has FINISHED as its outcome."""
        code = Outcome.FINISHED if code == Outcome.OUT_OF_MEMORY else code
        kept = self._kept(record, self.state)
        solution = self.finish(run.system, code, run.problem, self.state, kept)
        solution.tape = self._tape(run.p, run.control, self.state, kept)
        return solution

    def _empty(self, record: Any) -> None:
        """The buffers hold where the run stands, if it has begun, and nothing else."""
        state = self.state
        if not state.started:
            return
        state.points, state.events, state.ambiguities, state.taped, state.pieces = 1, 0, 0, 0, 0
        record.t[0], record.x[0], record.mult[0], record.status[0] = state.t, state.x, state.mult, state.status

    def advance(self, problem: Any, control: Any, state: Any) -> Callable[[Any], int]:
        """What runs on into the buffers that it is given, and says why it ended."""
        fixed = problem.address, control.address, state.address
        return lambda record: self.loop(*fixed, record.address, self.work.address)

    def advanced(self, advance: Any, more: Any, control: Any, state: Any, record: Any, spending: Budget) -> Any:
        """(code, record) of `advance(record)` at its end; full buffers go on as `more(record)`, or are the end.

        The kernel comes back after every slice of steps, so that Ctrl-C and the clock are heard.
        """
        bound = self.bound if control is self.control else control.scalar("max_steps").view(np.int64)
        number = state.cells.item
        begun = taken = number(_Cells.steps)
        most = min(self.max_steps, begun + spending.left)
        slices = Slices(self.slice)
        steps = self.slice
        while True:
            bound[0] = min(taken + (0 if spending.late() else steps), most)
            code = advance(record)
            if code != Outcome.TOO_MANY_STEPS and code != Outcome.OUT_OF_MEMORY:
                break
            before, taken = taken, number(_Cells.steps)
            if code == Outcome.OUT_OF_MEMORY:
                if (larger := more(record)) is None:
                    break
                record = larger
            elif taken >= most:
                break
            if spending.late():
                code = Outcome.TIME_LIMIT
                break
            steps = slices.next(taken - before)
        spending.spend(number(_Cells.steps) - begun)
        return code, record

    def larger(self, state: Any, t0: float, t1: float, record: Any) -> Any:
        """Buffers in place of full ones, by fewer times more where they are large; None where memory has none."""
        room = _next_room(len(record.t), self.room, t0, state.t, t1)
        if self._bytes(room) >= _LARGE:
            room = min(room, 2 * len(record.t))
        return self._record(room, record, state) if memory.fits(self._bytes(room)) else None

    def _plan(self, room: int) -> Any:
        """Of the buffers for `room` points and events."""
        # Rows beyond what memory holds easily are made again instead.
        pieces = room if self.dense or (self.rows and room <= self.most_rows) else 0
        tapes = 4 * room if self.tape else 0
        n, m = self.sizes.n, self.sizes.m
        sizes = dict(
            n=n, m=m, order=self.order, room=room, pieces=pieces, polynomials=n + m + self.dense, tapes=tapes,
            events=room + self.most["most_events"], unsure=room + self.most["most_unsure"],
            pushes=room + self.most["most_events"] if self.collides else 0,
        )  # fmt: skip
        return names.Record.planned(sizes, undefined=names.Record.members)

    def _bytes(self, room: int) -> int:
        return self._plan(room).size

    def _record(self, room: int, old: Any = None, state: Any = None) -> Any:
        """Buffers for `room` points and events, with what `old` holds at this state copied over."""
        n, m = self.sizes.n, self.sizes.m
        asked = {"t_eval": np.empty(0), "x_eval": np.empty((0, n)), "mult_eval": np.empty((0, m))}
        # One block for all: from 4 MB on numpy asks for huge pages, and a fresh page costs more than filling it.
        new = names.Record.in_one_block(
            self._plan(room),
            memory=lambda size: np.empty(max(size, 1 << 22 if old else 0), np.uint8),
            **self.most,
            **{k: getattr(old, k, empty) for k, empty in asked.items()},
        )
        if old:
            for name, part in self._parts(old, state).items():
                target = getattr(new, name)
                target[: len(part)] = part[: len(target)]
        return new

    def recording(self, room: int, times: np.ndarray) -> Any:
        """Buffers for `room` points and events, and for the wanted times."""
        return self._asked(self._record(room), times)

    def first_record(self, times: np.ndarray | None = None) -> Any:
        """The buffers at the start of a run that is asked for these times, or for none."""
        record = self.record or self._record(self.room)
        return record if times is None else self._asked(record, times)

    def _asked(self, record: Any, times: np.ndarray) -> Any:
        k = len(times)
        return record.changed(
            t_eval=times, x_eval=np.empty((k, self.sizes.n)), mult_eval=np.empty((k, self.sizes.m))
        )

    def _parts(self, record: Any, state: Any) -> dict[str, np.ndarray]:
        """What the buffers hold at a state."""
        number = state.cells.item
        points, events = number(_Cells.points), number(_Cells.events)
        parts = {
            "t": record.t[:points], "x": record.x[:points], "mult": record.mult[:points],
            "status": record.status[:points], "event_t": record.event_t[:events], "event": record.event[:events],
        }  # fmt: skip
        if self.collides:
            parts["push"] = record.push[:events]
        if ambiguities := number(_Cells.ambiguities):
            parts |= {name: getattr(record, name)[:ambiguities] for name in ("ambiguity_t", "ambiguity")}
        if self.tape:  # and a line for its end
            taped = number(_Cells.taped) + 1
            parts |= {name: getattr(record, name)[:taped] for name in ("tape", "tape_x")}
        if len(record.dense_s) or self.dense:
            pieces = number(_Cells.pieces)
            parts |= {name: getattr(record, name)[:pieces] for name in ("dense", "dense_s")}
        return parts

    def _kept(self, record: Any, state: Any) -> dict[str, np.ndarray]:
        """What the buffers hold at the end, where the next run will not write."""
        kept = self._parts(record, state)
        if self.record is not None and record.t is self.record.t:
            kept = {name: part.copy() for name, part in kept.items()}
        return kept

    def _tape(self, p: np.ndarray, control: Any, state: Any, kept: dict[str, np.ndarray]) -> Tape:
        """The run's tape, with the state at its end as its last entry."""
        k, n, m = state.cells.item(_Cells.taped), len(state.x), len(state.mult)
        entries, values = kept["tape"], kept["tape_x"]
        entries[k, 0], entries[k, 4:] = names.TAPE_END, state.status
        if self.one_step and not self.parts.singular:  # played again, a step by the pair is one by series
            steps = (entries[:, 0] == names.TAPE_STEP) & (entries[:, 1] == names.PAIR)
            solved = (entries[steps, 4:] == names.SOLVED).any(axis=1)
            entries[steps, 1] = np.where(solved, names.GENERAL, names.SLIP)
        values[k, 0], values[k, 2 : 2 + n] = state.floats[_Cells.t], state.x
        values[k, 2 + n : 2 + n + m] = state.mult
        clock, owners = (
            (control.clock, control.clock_event) if self.clocked else (np.empty(0), np.empty(0, int))
        )
        order = order_for(control.rtol, False) if self.one_step else control.order
        dense = None if self.one_step else kept.get("dense")
        may_pair = not self.by_series
        return Tape(self.parts, p.copy(), order, control.rtol, clock, owners, entries, values, dense, may_pair)

    def finish(
        self,
        system: Any,
        code: int,
        problem: Any,
        state: Any,
        kept: dict[str, np.ndarray],
        record: Any = None,
        times: Any = None,
    ) -> Solution:
        """The Solution of a run that ended with this code, in words; at wanted times those of the record."""
        t, x, mult, status = kept["t"], kept["x"], kept["mult"], kept["status"]
        if not len(t):
            # Its first multipliers were not found: the start is all there is, and they are not known.
            t, x, status = np.array([state.t]), state.x[None].copy(), state.status[None].copy()
            mult = np.full((1, len(state.mult)), np.nan)
        event_t, events, impulses = kept["event_t"], kept["event"], None
        done = code == Outcome.FINISHED  # of most runs: to ask the enumeration takes 4 % of a short one
        outcome = Outcome.FINISHED if done else self._outcome(code, problem, state, event_t, events)
        if outcome in _BREAKDOWNS:
            cause = singular_cause(self.model, t[-1:], x[-1:].T, mult[-1:].T, problem.p, self.limits["atol"])
            if cause is not None:
                outcome = Outcome.SINGULAR_POINT
                event_t = np.append(event_t, t[-1])
                events = np.vstack([events, [len(self.model.multipliers) + cause, names.EV_SINGULAR, 0, 0]])
        families = self.model.families
        if families and families.told_beside is not None:
            once = families.told_once(events[:, 0])
            event_t, events = event_t[once], events[once]
            kept = kept | {"push": kept["push"][once]} if self.collides else kept
        if self.impulses_of:
            impulses = self.impulses_of(event_t, events, kept["push"], t, x, problem.p, times is not None)
        number = state.cells.item
        cost = {
            "steps": number(_Cells.steps),
            "jets": number(_Cells.jets),
            "events": len(event_t),
            "layers": number(_Cells.layers),
        }
        dense = self._dense(kept["dense"], kept["dense_s"], t, status) if self.dense else None
        whole, columns = None, (t, x, mult, status)
        if times is not None:
            whole = course(t, status.T)
            # What was asked for and reached, with the status of the step that holds each instant.
            k = number(_Cells.samples)
            asked, x_asked, mult_asked = times[:k], record.x_eval[:k], record.mult_eval[:k]
            column = np.clip(np.searchsorted(t, asked, side="right") - 1, 0, len(t) - 1)
            # At an event the side after it, as the dense output has it.
            met = t[column] == asked
            x_asked[met], mult_asked[met] = x[column[met]], mult[column[met]]
            self._pin(x_asked.T, status[column])
            if outcome is not Outcome.FINISHED and (k == 0 or asked[-1] < t[-1]):
                # Where and in which state it stopped is the most wanted column of a run that did.
                asked, column = np.append(asked, t[-1]), np.append(column, len(t) - 1)
                x_asked, mult_asked = np.vstack([x_asked, x[-1:]]), np.vstack([mult_asked, mult[-1:]])
            t, x, mult, status = asked, x_asked, mult_asked, status[column]
        ambiguities = []
        if "ambiguity" in kept:
            once = families.told_once(kept["ambiguity"][:, 0]) if families else slice(None)
            ambiguities = ambiguities_in_words(self.model, kept["ambiguity_t"][once], kept["ambiguity"][once])

        levels = Levels(families, problem.p) if self.parts.levels else None
        if levels:
            levels.name_folds(events)

        def solution(t: Any, x: Any, mult: Any, status: Any, course: Any = None) -> Solution:
            return Solution(
                system, t, x.T, levels.show(mult.T, status.T) if levels else mult.T, status.T,
                EventLog(event_t, events, self.words, impulses), dense, outcome, cost, self.tolerances, ambiguities,
                system.parameters, course,
            )  # fmt: skip

        found = solution(t, x, mult, status, whole)
        if times is not None and self.dense and not (self.tape and self.by_series):
            found.whole = solution(*columns)
        return found

    def _outcome(self, code: int, problem: Any, state: Any, event_t: Any, events: Any) -> Outcome:
        """The kernel's code as an Outcome; two of its codes have causes that are told apart here."""
        outcome = Outcome(code)
        if outcome is Outcome.CHATTERING and len(events) >= _LOOP:
            if np.all(events[-_LOOP:, 1] == names.EV_EVENT) and event_t[-_LOOP] == event_t[-1]:
                return Outcome.EVENT_LOOP
        if outcome in _BREAKDOWNS:
            # Near a pole the coefficients overflow before the step does: what tells is the right-hand side itself.
            return Outcome.STEP_UNDERFLOW if self._defined(problem, state) else Outcome.NOT_FINITE
        return outcome

    def _defined(self, problem: Any, state: Any) -> bool:
        """Whether the right-hand side is finite where the run stopped, and just ahead of it."""
        import ctypes

        n, m, ne = len(self.model.states), len(self.model.multipliers), len(self.model.events)
        double = ctypes.POINTER(ctypes.c_double)
        fields = ctypes.CFUNCTYPE(None, ctypes.c_double, *6 * [double])(int(problem.fields))
        t, x, rates = state.t, np.append(state.x, 0.0), np.zeros(n)
        others = [np.append(a, 0.0) for a in (state.mult, problem.p)]
        arrays = [x, *others, rates, np.zeros(m + ne + 1), np.zeros(m + 1)]
        ahead = 1e-8 * (1 + abs(t))
        for step in (0.0, ahead):
            x[:n] += step * rates
            fields(t + step, *(a.ctypes.data_as(double) for a in arrays))
            if not np.isfinite(rates).all():
                return False
        return True

    def _pin(self, states, status) -> None:
        """Zeroes a state that is a surface's h where that surface slides: its polynomial is 0 to rounding only.

        `states` has a row a state and a column an instant or step, `status` a row for each of these.
        """
        for j, k in enumerate(self.parts.fixed["surface_state"]):
            if k >= 0:
                states[k][status[:, j] == 0] = 0.0

    def _dense(self, blocks, lengths, t, status) -> Dense:
        n = len(self.model.states)
        time = blocks[:, -1]
        column = np.maximum(np.searchsorted(t, time[:, 0], side="right") - 1, 0)
        self._pin(blocks[:, :n].swapaxes(0, 1), status[column])
        ends = np.zeros(len(lengths))
        # Of most runs t(s) = t0 + s on every step.
        for k in range(int(np.flatnonzero(time.any(axis=0)).max(initial=0)), -1, -1):
            ends = ends * lengths + time[:, k]
        return Dense(time[:, 0].copy(), ends, blocks[:, :n], blocks[:, n:-1], time, lengths)


def order_for(rtol: float, by_responses: bool) -> int:
    """Order of the Taylor polynomials, the fastest of eight models at 1e-6, 1e-9 and 1e-12 or near it.

    Linear models and products alike: longer steps outweigh longer products up to 20 or 22. Above, rounding grows with
    the step: 20 is the highest whose worst case stays near 1e-13, which only tolerances below 1e-10 ask for.
    Where a jet is a matrix product (responses.py) orders cost next to nothing: as many as four vectors hold,
    with which an oscillator goes from event to event in one step.
    """
    if by_responses and rtol >= 1e-10:
        return 31
    return 16 if rtol > 1e-8 else 22 if rtol >= 1e-10 else 20
