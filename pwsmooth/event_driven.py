"""The event-driven path of solve(): the kernel's run and its integers turned into words.

Chain: solve -> **this file** -> kernels/trajectory.py, the loop that reads like the theory.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
import sympy as sp

from . import memory
from .model import Model
from .records import Ambiguity, Dense, EventLog, EventRecord, Outcome
from .solution import Solution

_LOOP = 40  # events in a row at one instant that make a loop
_ROOM = 1024  # points that the first buffers hold
_LARGE = 2**27  # bytes, above which the next ones hold twice as many at most


def _next_room(room: int, t0: float, t: float, t_end: float) -> int:
    """Points of the next buffers: as many as the whole span takes at the rate so far, within bounds.

    Copies of what is full, by fours, cost a quarter of a run over thousands of periods.
    """
    reached = (t - t0) / (t_end - t0)
    return int(min(max(1.1, 2.0 * reached) / max(reached, 1e-3), 64.0 if room == _ROOM else 8.0) * room)


class EventDriven:
    """One event-driven run: the arrays that the kernel works on, and what it recorded."""

    def __init__(
        self, system, values, p, rtol, atol, t1, times, dense, max_step, max_steps, order, strict, method
    ):
        from .codegen.units import trajectory_loop
        from .compiled import compiled_problem
        from .kernels import state

        self.system, self.values, self.times, self.dense = system, values, times, dense
        self.run = trajectory_loop()
        self.names = state
        model = self.model = system.model
        parts = compiled_problem(model)
        self.sizes = parts.code
        if method == "taylor" and not parts.has_jets:
            raise ValueError(
                "`method` is 'taylor', but a function of this system has no Taylor recurrence; use 'rk'."
            )
        pair = method == "rk" or not parts.has_jets
        # The pair's interpolant has degree 7.
        self.order = 7 if pair else order or _order_for(rtol, parts.code.by_responses)
        self.tolerances = {"rtol": rtol, "atol": float(atol.max(initial=0.0)), "order": self.order}
        self.problem = parts.problem(p, pair)
        self.work = parts.work(self.order)
        self.control = dict(
            order=self.order,
            rtol=rtol,
            atol=np.maximum(atol, 1e-300),
            max_step=float(max_step),
            t_end=t1,
            max_steps=int(max_steps),
            strict=int(strict),
        )

    def begin(self, t0, start):
        """Runs the kernel to its end, emptying its buffers as they fill."""
        names, model = self.names, self.model
        clock, which = _clock(model, self.values, t0, self.control["t_end"], self.control["max_steps"])
        control = names.Control(**self.control, clock=clock, clock_event=which)
        state = self.fresh_state(t0, start)
        record = self._record(_ROOM, None, state.counts)
        while (code := self.run(self.problem, control, state, record, self.work)) == names.FULL:
            # Between two visits Ctrl-C works; the room grows geometrically, more slowly where it is large.
            room = _next_room(len(record.t), t0, state.now[0], control.t_end)
            if self._bytes(room) >= _LARGE:
                room = min(room, 2 * len(record.t))
            if not memory.fits(self._bytes(room)):
                break
            record = self._record(room, record, state.counts)
        self.code, self.state, self.record = code, state, record

    def fresh_state(self, t0, start):
        """The kernel's State before its first step (kernels/ensemble.py makes the same one for every orbit)."""
        m, ne = len(self.model.multipliers), len(self.model.events)
        return self.names.State(
            now=np.array([t0, min(1e-3, self.control["max_step"])]),
            x=start,
            mult=np.zeros(m),
            status=np.zeros(m),
            deflate=np.zeros(m + ne),
            side=np.ones(ne),
            counts=np.zeros(self.names.N_COUNTS),
            last=np.tile([t0, 0.0, 0.0, 0.0], (m, 1)),
        )

    def _shapes(self, room):
        """Shapes of the buffers for `room` points and events; eight bytes an entry are enough."""
        n, m = self.sizes.n, self.sizes.m
        dense = room if self.dense else 0
        return {
            "t": (room,), "x": (room, n), "mult": (room, m), "event_t": (room,), "event": (room, 4),
            "ambiguity_t": (room,), "ambiguity": (room, 3), "dense": (dense, n + m + 1, self.order + 1),
            "dense_s": (dense,), "status": (room, m),
        }  # fmt: skip

    def _bytes(self, room):
        return sum(8 * math.prod(shape) for shape in self._shapes(room).values())

    def _record(self, room, old, counts):
        """Buffers for `room` points and events, with what `old` holds copied over."""
        names, n, m = self.names, self.sizes.n, self.sizes.m
        asked = np.empty(0) if self.times is None else self.times
        shapes = self._shapes(room)
        dtypes = {"event": np.int64, "ambiguity": np.int64, "status": np.int8}
        # One block for all: from 4 MB on numpy asks for huge pages, and a fresh page costs more than filling it.
        arena = np.empty(max(self._bytes(room), 1 << 22 if old else 0), np.uint8)
        buffers, start = {}, 0
        for name, shape in shapes.items():
            dtype = np.dtype(dtypes.get(name, float))
            size = math.prod(shape) * dtype.itemsize
            buffers[name] = arena[start : start + size].view(dtype).reshape(shape)
            start += size
        new = names.Record(
            t_eval=asked, x_eval=old.x_eval if old else np.empty((len(asked), n)),
            mult_eval=old.mult_eval if old else np.empty((len(asked), m)), **buffers,
        )  # fmt: skip
        if old:
            for name, count in self._counted(counts):
                getattr(new, name)[:count] = getattr(old, name)[:count]
        return new

    def _counted(self, counts):
        """Every buffer with the number of its entries."""
        names = self.names
        for count, buffers in (
            (names.C_POINTS, ("t", "x", "mult", "status")),
            (names.C_EVENTS, ("event_t", "event")),
            (names.C_AMBIGUITIES, ("ambiguity_t", "ambiguity")),
            (names.C_DENSE, ("dense", "dense_s")),
        ):
            for name in buffers:
                yield name, int(counts[count])

    def finish(self) -> Solution:
        """The Solution, in words."""
        names, model, counts = self.names, self.model, self.state.counts
        kept = {name: getattr(self.record, name)[:count] for name, count in self._counted(counts)}
        t, x, mult, status = kept["t"], kept["x"], kept["mult"], kept["status"]
        status[status == names.HELD] = 0
        event_t = kept["event_t"]
        outcome = self._outcome(event_t, kept["event"])
        cost = {
            "steps": int(counts[names.C_STEPS]),
            "jets": int(counts[names.C_JETS]),
            "events": len(event_t),
            "layers": int(counts[names.C_LAYERS]),
        }
        dense = self._dense(kept["dense"], kept["dense_s"], t, status) if self.dense else None
        if self.times is not None:
            # What was asked for and reached, with the status of the step that holds each instant.
            k = counts[names.C_EVAL]
            asked, x_asked, mult_asked = self.times[:k], self.record.x_eval[:k], self.record.mult_eval[:k]
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
        return Solution(
            self.system,
            t,
            x.T,
            mult.T,
            status.T,
            _events_in_words(names, model, event_t, kept["event"]),
            dense,
            outcome,
            cost,
            self.tolerances,
            _ambiguities_in_words(names, model, kept["ambiguity_t"], kept["ambiguity"]),
            self.values,
        )

    def _outcome(self, event_t, events) -> Outcome:
        """The kernel's code as an Outcome; two of its codes have causes that are told apart here."""
        names = self.names
        outcome = _outcomes(names)[self.code]
        last = events[-_LOOP:]
        if outcome is Outcome.CHATTERING and len(last) == _LOOP:
            if np.all(last[:, 1] == names.EV_EVENT) and event_t[-_LOOP] == event_t[-1]:
                return Outcome.EVENT_LOOP
        if outcome in (Outcome.STEP_UNDERFLOW, Outcome.NOT_FINITE):
            # Near a pole the coefficients overflow before the step does: what tells is the right-hand side itself.
            return Outcome.STEP_UNDERFLOW if self._defined() else Outcome.NOT_FINITE
        return outcome

    def _defined(self) -> bool:
        """Whether the right-hand side is finite where the run stopped, and just ahead of it."""
        import ctypes

        n, m, ne = len(self.model.states), len(self.model.multipliers), len(self.model.events)
        double = ctypes.POINTER(ctypes.c_double)
        fields = ctypes.CFUNCTYPE(None, ctypes.c_double, *6 * [double])(int(self.problem.fields))
        t, x, rates = self.state.now[0], np.append(self.state.x, 0.0), np.zeros(n)
        others = [np.append(a, 0.0) for a in (self.state.mult, self.problem.p)]
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
        for j, k in enumerate(self.problem.surface_state):
            if k >= 0:
                states[k][status[:, j] == 0] = 0.0

    def _dense(self, blocks, lengths, t, status) -> Dense:
        n = len(self.model.states)
        time = blocks[:, -1]
        column = np.clip(np.searchsorted(t, time[:, 0], side="right") - 1, 0, len(t) - 1)
        self._pin(blocks[:, :n].swapaxes(0, 1), status[column])
        ends = np.zeros(len(lengths))
        for k in range(time.shape[1] - 1, -1, -1):
            ends = ends * lengths + time[:, k]
        return Dense(time[:, 0].copy(), ends, blocks[:, :n], blocks[:, n:-1], time, lengths)


def _order_for(rtol: float, by_responses: bool) -> int:
    """Order of the Taylor polynomials, the fastest of eight models at 1e-6, 1e-9 and 1e-12 or near it.

    Linear models and products alike: longer steps outweigh longer products up to 20 or 22. Above, rounding grows with
    the step: 20 is the highest whose worst case stays near 1e-13, which only tolerances below 1e-10 ask for.
    Where a jet is a matrix product (codegen/responses.py) orders cost next to nothing: as many as four vectors hold,
    with which an oscillator goes from event to event in one step.
    """
    if by_responses and rtol >= 1e-10:
        return 31
    return 16 if rtol > 1e-8 else 22 if rtol >= 1e-10 else 20


def _clock(
    model: Model, values: Mapping[sp.Symbol, float], t0: float, t1: float, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sorted instants of the time events in (t0, t1], and the event of each; of each event the first `most`."""
    instants, owners = [np.empty(0)], [np.empty(0, np.int64)]
    if all(event.every is None and not event.at for event in model.events):
        return instants[0], owners[0]
    for i, event in enumerate(model.events):
        when = np.array([float(at.subs(values)) for at in event.at])
        if event.every is not None:
            every = float(event.every.subs(values))
            if not every > 0:
                raise ValueError(f"Event {event.name!r}: `every` is {every:g}; give a period > 0.")
            # Every instant costs a step: beyond the bound on steps none is reached.
            first, last = math.floor(t0 / every), math.floor(t1 / every) + 1
            when = every * np.arange(first, min(last, first + most + 2) + 1, dtype=float)
        when = np.unique(when[(when > t0) & (when <= t1)])
        instants.append(when)
        owners.append(np.full(len(when), i))
    when, which = np.concatenate(instants), np.concatenate(owners)
    order = np.argsort(when, kind="stable")
    when, which = when[order], which[order]
    if when.size:
        # 3*0.1 and 0.3 are one instant; several roundings apart they are two.
        near = np.diff(when) <= 4 * np.spacing(np.abs(when[1:]))
        first = np.maximum.accumulate(np.where(np.append(False, near), 0, np.arange(len(when))))
        when = when[first]
    return when, which


@functools.cache
def _outcomes(names) -> dict[int, Outcome]:
    return {
        names.DONE: Outcome.FINISHED,
        names.TERMINAL: Outcome.TERMINATED,
        names.NOT_FINITE: Outcome.NOT_FINITE,
        names.UNDERFLOW: Outcome.STEP_UNDERFLOW,
        names.CHATTERING: Outcome.CHATTERING,
        names.NO_ROOT_FOUND: Outcome.NO_ROOT,
        names.HIDDEN_OSCILLATION: Outcome.LAYER_UNSETTLED,
        names.MAX_STEPS: Outcome.TOO_MANY_STEPS,
        names.STRICT: Outcome.AMBIGUITY,
        names.NEWTON_FAILED: Outcome.SINGULAR,
        names.DETERMINACY_LOST: Outcome.DETERMINACY_LOST,
        names.ACCUMULATED: Outcome.EVENTS_ACCUMULATE,
        names.FULL: Outcome.OUT_OF_MEMORY,
    }


def _events_in_words(names, model: Model, times, codes) -> EventLog:
    kinds = {
        names.EV_CROSSING: "crossing",
        names.EV_STICK: "stick",
        names.EV_TANGENCY: "slip by tangency",
        names.EV_FOLD: "slip by fold",
        names.EV_FOLD_TO_SLIDING: "sliding to sliding",
        names.EV_EVENT: "reset",
        names.EV_IMPACT: "impact",
        names.EV_CLOSED: "closed contact",
        names.EV_OPENING: "opening",
        names.EV_ACCUMULATION: "accumulation",
        names.EV_RESET: "slip by reset",
    }
    multipliers = model.multipliers

    def words(t: float, index: int, kind: int, came: int, went: int) -> EventRecord:
        if index >= len(multipliers):
            event = model.events[index - len(multipliers)]
            if kind == names.EV_ACCUMULATION:
                return EventRecord(t, event.name, kinds[kind])
            return EventRecord(t, event.name, "terminal" if event.terminal else "reset")
        contact = multipliers[index].kind == "contact"
        note = "" if contact else f"{came:+d} to {went:+d}".replace("+0", "0")
        return EventRecord(t, multipliers[index].symbol.name, kinds[kind], note)

    return EventLog(times, codes, words)


def _ambiguities_in_words(names, model: Model, times, records) -> list[Ambiguity]:
    words = {
        names.AMB_REPELLING: ("repelling sliding", ("leave to +1", "leave to -1", "stay on the surface")),
        names.AMB_SEVERAL_ROOTS: (
            "several attracting states of the layer",
            ("from lam = 0", "from -1", "from +1"),
        ),
        names.AMB_TWO_FOLD: ("two-fold", ("leave to +1", "leave to -1", "stay on the surface")),
        names.AMB_CORNER: ("corner", ("the outcome changes with eps_ratio",)),
        names.AMB_GRAZING: ("grazing", ("touch and stay on this side", "cross")),
        names.AMB_HIDDEN_OSCILLATION: ("hidden oscillation", ("the layer never comes to rest",)),
    }
    found = []
    for t, (index, kind, taken) in zip(times.tolist(), records.tolist(), strict=True):
        name, continuations = words[kind]
        if kind in (names.AMB_TWO_FOLD, names.AMB_HIDDEN_OSCILLATION):
            choice = "stopped"
        elif kind == names.AMB_GRAZING:
            choice = continuations[taken]
        elif kind == names.AMB_REPELLING:
            choice = "stay on the surface" if taken == 0 else f"leave to {taken:+d}"
        else:
            choice = continuations[0]
        found.append(Ambiguity(t, str(model.multipliers[index].symbol), name, choice, continuations))
    return found
