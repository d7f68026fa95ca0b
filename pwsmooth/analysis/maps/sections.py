"""Poincare maps of a system: stroboscopic ones of driven systems, returns to a surface of autonomous ones.

    P(x) = phi(t0 + T; t0, x)             one forcing period (or several)
    N(x) = G**-1 phi(t0 + T/2; t0, x)     a half one, for a system with the symmetry (x, t) -> (G x, t + T/2); N N = P
    P(x) = first return to h = 0          autonomous systems, D P = (1 - f grad h/(grad h f)) Phi

Chain: poincare.py, first_order.py -> **sections** -> orbits, continuation, studies/attraction.py.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import EventSpec, Model, of_event
from ...definition.pointwise import value
from ...door import checks
from ...paths.derivatives.linearised import linearise
from ...results.records import Outcome
from ...results.solution import Solution
from .first_order import chosen_parameters, moved
from .poincare import RETURN, Image, Leg, _Map, lost, why_stopped, word_of
from .scales import extents
from .seen import LONGEST, Return, Strobe, how_seen
from .symmetry import symmetry_matrix

__all__ = ["Image", "Section", "Stroboscopic", "word_of"]

_ROUNDING = 1e-12  # of a state: a start so near to its section has not left it
_SLOW = 1e-12  # of the mean speed across the section on the way: slower, it is not crossed
_FEW_STEPS = 300  # without a return in LONGEST: a run of fewer waits ten times as long
_MOST_LEADS = 20  # each ten times as long: a start on its section is left after a few roundings of its states


@checks.door()
@dataclass(frozen=True)
class Stroboscopic(_Map):
    """The map over `count` forcing periods, or over half a one.

    Parameters
    ----------
    system : System
        Driven with `period`.
    period : float or Expr, in the unit of the model's time
        Forcing period T; an expression of parameters (2*pi/omega) where one of these is to be changed.
    count : int
        Periods a step of the map.
    phase : float, dimensionless
        The section is t = phase*T.
    symmetry : mapping of state to Expr, optional
        G, linear: with it the map is N = G**-1 phi over T/2, whose fixed points are the symmetric orbits.
    options : mapping, optional
        For `solve`; rtol 1e-12 (smoothed views 1e-10) unless given.
    scale : Scale, optional
        Sizes of the states along an orbit, as `find_orbit` gives them to its map.
    angles : tuple of float, in the units of the states, optional
        A turn of each state that is an angle, 0 of the others, as `find_orbit` gives them to its map.

    Raises
    ------
    ValueError, TypeError
        A period that is not positive; a symmetry that the system does not have; no System.

    Source: the stroboscopic map of Poincare; the half-period map as in Swift, Wiesenfeld, Phys. Rev. Lett. 52
    (1984) 705-708.

    >>> x, t = sp.symbols("x t", real=True)
    >>> P = Stroboscopic(System({x: sp.cos(t) - x}, time=t), 2 * sp.pi)
    >>> round(float(P({x: 0.5})[0]), 9)  # x = (cos t + sin t)/2 is the periodic orbit
    0.5
    """

    period: Any = None
    count: int = 1
    phase: float = 0.0
    symmetry: Any = None

    def __post_init__(self) -> None:
        checks.system(self.system, "`system`")
        period = checks.period(self.period, self.system.parameters)
        checks.fields(self, count=checks.integer(1), phase=checks.number, options=checks.run_options)
        object.__setattr__(self, "period", period)
        if self.symmetry is not None and not isinstance(self.symmetry, np.ndarray):
            matrix = symmetry_matrix(self.system, self.symmetry, self.forcing_period)
            object.__setattr__(self, "symmetry", matrix)

    def with_parameters(self, values: Mapping[Any, float]) -> Any:
        other = super().with_parameters(values)
        if self.period.free_symbols:
            for name in ("forcing_period", "_period_slopes"):
                other.__dict__.pop(name, None)
        return other

    def doubled(self) -> Stroboscopic:
        if self.symmetry is not None:
            return replace(self, symmetry=None)
        return super().doubled()

    def at_phase(self, phase: float) -> Stroboscopic:
        """The same map on another section.

        Parameters
        ----------
        phase : float, dimensionless
            Part of the period.

        Returns
        -------
        Stroboscopic
            Of the same system.
        """
        other = copy.copy(self)  # nothing else depends on it
        object.__setattr__(other, "phase", checks.number(phase, "`phase`"))
        return other

    def solved(self, x: Any, time: float, system: Any) -> Solution:
        """The trajectory of a point from the section to a time, with dense output.

        Parameters
        ----------
        time : float, in the unit of the model's time
            End.
        system : System
            Which one, at its own parameters.

        Returns
        -------
        Solution
            With dense output.
        """
        own = self if system is self.system else replace(self, system=system)
        return self._solve(system, (own.start_time, time), x, True)

    @functools.cached_property
    def forcing_period(self) -> float:
        """The period T at the system's parameters, in the unit of the model's time."""
        return value(self.period, self.system.parameters)

    def _period_slope(self, name: Any) -> float:
        """dT/dq by a parameter."""
        return self._period_slopes.get(
            checks.lookup(name, self.system.parameters, "`parameters`", "parameter"), 0.0
        )

    @functools.cached_property
    def _period_slopes(self) -> dict[sp.Symbol, float]:
        """dT/dq by every parameter of the period: each segment of an orbit asks for them."""
        return {q: value(slope, self.system.parameters) for q, slope in _slopes_of(self.period)}

    @property
    def start_time(self) -> float:
        """Time t0 of the section, in the unit of the model's time."""
        return self.phase * self.forcing_period

    @property
    def duration(self) -> float:
        """Time that one application of the map takes, in the unit of the model's time."""
        return self.forcing_period * (0.5 if self.symmetry is not None else self.count)

    def _iterated(self, x: Any, count: int, discard: int = 0) -> tuple[np.ndarray, str]:
        if self.symmetry is not None:
            return super()._iterated(x, count, discard)
        # One run over all periods instead of one for each.
        t0, n = self.start_time, len(self.system.model.states)
        strobes = t0 + self.duration * np.arange(discard + 1, discard + count + 1)
        at = self.system.initial_state(x)
        run = self._solve(self.system, (t0, float(strobes[-1])), at, False, strobes)
        points = np.full((count, n), np.nan)
        # A run that stops early has one more column, where it stopped.
        reached = int(np.searchsorted(strobes, run.t[-1], side="right"))
        points[:reached] = run.x.T[:reached]
        return points, "" if reached == count else why_stopped(run)

    def image(self, x: Any, parameters: Sequence[Any] | None = None) -> Image:
        return self.closed(self.leg(x, (0, 0.0, float(self.turns)), parameters))

    def closed(self, image: Image) -> Image:
        if self.symmetry is None or not image.success:
            return image
        back = np.linalg.inv(self.symmetry)
        found = image if image.jacobian.size == 0 else replace(
            image, jacobian=back @ image.jacobian, by_parameter=back @ image.by_parameter
        )  # fmt: skip
        return replace(found, x=back @ image.x)

    end = 1.0  # of an application, in the unit of cuts: a part of its time

    @property
    def turns(self) -> int:
        """How many applications the map consists of: periods, or the half one."""
        return 1 if self.symmetry is not None else self.count

    @property
    def beat(self) -> float:
        """What cuts are counted in: the time of one application, in the unit of the model's time."""
        return self.duration / self.turns

    def _begins(self, leg: Leg) -> bool:
        return leg[:2] == (0, 0.0)

    def _section_at(self, x: Any) -> tuple[float, np.ndarray, np.ndarray | None]:
        return self.start_time, np.asarray(x, float), None

    def _leg(self, x: Any, leg: Leg, parameters: Sequence[Any] | None) -> Image:
        k, first, last = leg
        t0, begin, end = self.start_time, (k + first) / self.turns, (k + last) / self.turns
        span = (t0 + begin * self.duration, t0 + end * self.duration)
        run = self._solve(self.system, span, x, parameters is not None)
        if not (run.success and run.t[-1] == span[1]):
            return lost(len(x), (run,), why_stopped(run))
        back = self.within_a_turn(run.x[:, -1], np.asarray(x, float))
        if parameters is None:
            return Image(back, span[1] - span[0], (run,))
        found = moved(run, chosen_parameters(self.system, parameters))
        by_parameter = found.by_parameter
        for k, q in enumerate(found.chosen):
            # The ends of the span move with the parameter: phi(t1) by f there, and by -Phi f at its start.
            slope = self._period_slope(q)
            if slope:
                stretch = slope * self.duration / self.forcing_period
                early, late = (self.phase * slope + part * stretch for part in (begin, end))
                by_parameter[:, k] += found.rates * late - found.matrix @ found.first_rates * early
        return Image(back, span[1] - span[0], (run,), found.matrix, by_parameter, tuple(found.degenerate))


@functools.lru_cache(maxsize=64)
def _slopes_of(period: sp.Expr) -> tuple[tuple[sp.Symbol, sp.Expr], ...]:
    return tuple((q, period.diff(q)) for q in period.free_symbols)


@checks.door()
@dataclass(frozen=True)
class Section(_Map):
    """The map of returns to a surface, of an autonomous system.

    Parameters
    ----------
    system : System
        Without explicit time.
    surface : Expr
        h(x), of states; the section is h = 0.
    direction : {1, -1}
        Crossed with h rising or falling.
    count : int
        Returns a step of the map.
    longest : float, in the unit of the model's time
        Give up after this time on the way to a return.
    options : mapping, optional
        For `solve`.
    scale : Scale, optional
        Sizes of the states along an orbit, as `find_orbit` gives them to its map.
    angles : tuple of float, in the units of the states, optional
        A turn of each state that is an angle, 0 of the others, as `find_orbit` gives them to its map.

    Raises
    ------
    ValueError
        A surface of time, or of what is no state or parameter; a system that depends on time.

    Source: the first return map of Poincare; D P = (1 - f grad h/(grad h f)) Phi.

    Van der Pol's oscillator returns to v = 0 at its amplitude:

    >>> x, v = sp.symbols("x v", real=True)
    >>> pol = System({x: v, v: (1 - x**2) * v - x})
    >>> P = Section(pol, surface=v, direction=-1)
    >>> print(f"{P.iterate({x: 1, v: 0}, 1, discard=9)[0, 0]:.6f}")
    2.008620
    """

    surface: Any = None
    direction: int = 1
    count: int = 1
    longest: float = LONGEST
    _watched: Any = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.system(self.system, "`system`")
        checks.fields(
            self, count=checks.integer(1), direction=checks.one_of(1, -1), longest=checks.positive,
            options=checks.run_options,
        )  # fmt: skip
        surface = section_of(self.system, self.surface, "`surface`")
        object.__setattr__(self, "surface", surface)
        ends = EventSpec(
            RETURN, surface, direction=self.direction, when=self.system.model.time > 0, terminal=True
        )
        object.__setattr__(self, "_watched", watching(self.system, ends))

    def with_parameters(self, values: Mapping[Any, float]) -> Any:
        other = super().with_parameters(values)
        object.__setattr__(other, "_watched", self._watched.with_parameters(values))
        return other

    def image(self, x: Any, parameters: Sequence[Any] | None = None) -> Image:
        n = len(x)
        at, time = np.asarray(x, float), 0.0
        total, by_parameter = np.eye(n), np.zeros((n, len(parameters or ())))
        degenerate: list[str] = []
        runs: list[Solution] = []
        for _ in range(self.count):
            image = self.leg(at, (0, 0.0, math.inf), parameters)
            runs += image.runs
            if not image.success:
                return lost(n, tuple(runs), image.reason)
            at, time = image.x, time + image.time
            if parameters is not None:
                degenerate += image.degenerate
                by_parameter = image.jacobian @ by_parameter + image.by_parameter
                total = image.jacobian @ total
        if parameters is None:
            return Image(at, time, tuple(runs))
        return Image(at, time, tuple(runs), total, by_parameter, tuple(degenerate))

    end, beat = math.inf, 1.0  # of an application, which ends at a return; cuts are times since the last one

    @property
    def turns(self) -> int:
        """How many applications the map consists of: returns."""
        return self.count

    def closed(self, image: Image) -> Image:
        return image

    def _begins(self, leg: Leg) -> bool:
        return leg[1] == 0.0

    def _section_at(self, x: Any) -> tuple[float, np.ndarray, np.ndarray | None]:
        return 0.0, np.asarray(x, float), self.gradient(x)

    def _leg(self, x: Any, leg: Leg, parameters: Sequence[Any] | None) -> Image:
        _, begin, end = leg
        if end < math.inf:
            # Returns count from time 0 on: by then the section is left.
            first = 0.0 if begin > 0 else -0.1 * end
            run = self._solve(self._watched, (first, first + end - begin), x, parameters is not None)
            if run.outcome is not Outcome.FINISHED:
                early = any(e.switch == RETURN for e in run.events[-8:])
                return lost(len(x), (run,), "it returns within a segment." if early else why_stopped(run))
        else:
            run, reason = self._to_return(np.asarray(x, float), parameters is not None)
            if reason:
                return lost(len(x), (run,), reason)
        at, time = run.x[:, -1], float(run.t[-1] - run.t[0])
        back = self.within_a_turn(at, np.asarray(x, float))
        if parameters is None:
            return Image(back, time, (run,))
        n, chosen = len(x), chosen_parameters(self.system, parameters)
        found = moved(run, chosen)
        matrix, by_parameter = found.matrix, found.by_parameter
        if end == math.inf:
            h_w, f = self._gradient(at, chosen), found.rates
            speed = h_w[:n] @ f
            usual = np.abs(h_w[:n]) @ extents((run,)) / time
            if abs(speed) <= _SLOW * usual:
                return lost(
                    n, (run,), f"it comes to rest on the section {self.surface} = 0, or only touches it."
                )
            stop = np.eye(n) - np.outer(f, h_w[:n]) / speed
            matrix, by_parameter = stop @ matrix, stop @ by_parameter - np.outer(f, h_w[n:]) / speed
        return Image(back, time, (run,), matrix, by_parameter, tuple(found.degenerate))

    def _to_return(self, x: np.ndarray, dense: bool) -> tuple[Solution, str]:
        """The run from a point of the section to its next return, and why there is none."""
        lead, longest = 0.0, self.longest
        for _ in range(_MOST_LEADS):
            # Returns count from time 0 on: what begins before has left the section by then.
            run = self._solve(self._watched, (-lead, longest), x, dense)
            if not any(e.switch == RETURN for e in run.events[-8:]):  # other switches may follow it in the log
                if not self._waits_on(run):
                    break
                longest *= 10
                continue
            if self._has_left(run):
                return run, ""
            lead = 10 * lead + 2 * float(run.t[-1] + lead)
            if lead > longest:
                return run, f"it stays on the section {self.surface} = 0."
        else:
            return run, f"it stays on the section {self.surface} = 0."
        if run.outcome is Outcome.FINISHED:
            way = "rising" if self.direction > 0 else "falling"
            return run, (
                f"it does not cross the section {self.surface} = 0 {way} within {longest:g} units of time: take a "
                "surface that the motion crosses, or the other `direction`."
            )
        return run, why_stopped(run)

    def _waits_on(self, run: Solution) -> bool:
        """Whether a run without a return was short, as its steps tell: the unit of time may be a small one."""
        slow = run.outcome is Outcome.FINISHED and run.cost["steps"] < _FEW_STEPS
        return slow and self.longest == LONGEST and bool(np.any(run.x[:, -1] != run.x[:, -2]))

    def _has_left(self, run: Solution) -> bool:
        """Whether the motion has come away from its start by more than roundings of it."""
        slack = _ROUNDING * (self.unit + np.abs(run.x[:, 0]))
        if np.any(np.abs(run.x - run.x[:, :1]) > slack[:, None]):
            return True
        # A closed orbit that one step goes around has no column off its start.
        model = run.model
        point = dict(
            zip((*model.states, *(mu.symbol for mu in model.multipliers)), (*run.x[:, -1], *run.mult[:, -1]))
        )
        point |= {**run.system.parameters, model.time: 0.0}
        rates = np.array([value(rate, point) for rate in model.rhs])
        return bool(np.any(np.abs(rates) * (run.t[-1] - run.t[0]) > slack))

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient of h at a point.

        Returns
        -------
        ndarray, shape (n,)
            In the unit of h over those of the states.
        """
        return self._gradient(x)

    def _gradient(self, x: np.ndarray, chosen: tuple[sp.Symbol, ...] = ()) -> np.ndarray:
        """The same by parameters too."""
        line, nothing = linearise(self._watched.model, chosen), np.zeros(len(self.system.model.multipliers))
        return line.gradient(self.surface, 0.0, x, nothing, np.array(self._watched.parameter_values, float))[0]


def poincare_map(
    system: Any, seen: Strobe | Return, options: Mapping[str, Any], count: int = 1, symmetric: bool = False
) -> Stroboscopic | Section:
    """The map of a driven system or of an autonomous one; of whole periods unless it is to be `symmetric`."""
    if isinstance(how_seen(seen, "`seen`"), Strobe):
        symmetry = seen.symmetry if symmetric else None
        return Stroboscopic(system, seen.period, count, seen.phase, symmetry, options=options)
    surface = section_of(system, seen.section, "`section`")
    return Section(system, surface, seen.direction, count, seen.longest, options=options)


def section_of(system: Any, surface: Any, what: str) -> sp.Expr:
    """h of a section h = 0; ValueError where the system has no returns to it that depend on states alone."""
    model, parameters = system.model, system.parameters
    e = checks.expression(surface, what, {s.name: s for s in (*model.states, *parameters)})
    unknown = e.free_symbols - {*model.states, *parameters}
    if unknown or not e.free_symbols & set(model.states):
        said = f", in which {checks.listing(unknown)} is no state or parameter of the system" if unknown else ""
        raise ValueError(f"{what} is {e}{said}; give a function of states {checks.listing(model.states)}.")
    if depends_on_time(model):
        raise ValueError(
            f"the system depends on time, so returns to {what} are no map of its states. Give Strobe(period), with the "
            "period of the forcing, instead."
        )
    return e


def watching(system: Any, event: EventSpec) -> Any:
    """The same system with one more event of a surface, behind its own."""
    model, surface = system.model, event.surface
    assert surface is not None
    names = {p for p in system.parameters if p in surface.free_symbols} - {*model.parameters}
    other = copy.copy(system)
    other.model = replace(
        model,
        events=(*model.events, event),
        parameters=(*model.parameters, *sorted(names, key=str)),
    )
    return other


def depends_on_time(model: Model) -> bool:
    """Whether anything that moves the states reads the time or a clock."""
    parts: list[Any] = [*model.rhs, *model.layer_residuals]
    for mu in model.multipliers:
        parts += [mu.residual, mu.surface, *(mu.impact or ())]
    for layer in model.layer_states:
        parts += [layer.rate, layer.equilibrium]
    for event in model.events:
        parts += of_event(event)
    timed = any(event.surface is None for event in model.events)
    return timed or any(model.time in part.free_symbols for part in parts if part is not None)
