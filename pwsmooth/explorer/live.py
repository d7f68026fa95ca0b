"""The orbit of a state, the layer at its cursor, and a sentence about it: what the sliders' process computes."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ..analysis.maps.seen import Return, Strobe
from ..definition.lambdified import numpy_function
from ..definition.model import Model
from ..door import checks
from ..results.layers import field_over
from ..results.outputs import vectorised
from ..results.records import Outcome
from ..results.sampling import Sampled
from ..results.solution import Solution
from ..studies.contract import Window
from ..studies.of_solution import strobes
from ..studies.periodicity import Period
from .describe import LIMITS, can_slide, characteristic, switches
from .labels import short, written
from .subject import Subject

POINTS = 3000  # of a picture; eight of a step at least
_STEPS = 750  # of more than so many points that show no bend are left out
_TICKS = 400  # events that are sent: more are no ticks but a shade
_LAM = np.linspace(-1, 1, 161)
_PLACES = 121  # along a surface in the phase plane
_POSES = 1200  # points of the mechanism's motion
_LONGEST = 16  # periods of an orbit that a sentence names

_UNDECIDED = Outcome.AMBIGUITY, Outcome.DETERMINACY_LOST

Answer = tuple[dict[str, Any], dict[str, np.ndarray]]


class Refused(ValueError):
    """What the page sent is no state of this system; the text says why."""


class Live:
    """Answers for one page; keeps the last solution, of which layers and sentences are asked."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.solution: Solution | None = None
        self.period: float | None = None
        self._slaved: Any = None
        self._characteristic = characteristic(subject.system.model)

    def orbit(self, asked: Mapping[str, Any]) -> Answer:
        """The orbit of `p`, `x0`, `t_span`, sampled for drawing in the `names`; a refusal has its sentence."""
        begun = time.perf_counter()
        try:
            p, x0, span = state_of(self.subject, asked)
            names = self._drawn(asked)
            solution = self.subject.solve(span, x0, p, max_steps=LIMITS["steps"], max_seconds=LIMITS["seconds"])
            self.period = self.subject.period_at(p)
            solved = time.perf_counter()
            self.solution = solution
            found, values = sampled(solution, names, self.subject.sketch)
        except (ValueError, TypeError, KeyError) as error:
            said = str(error.args[0]) if error.args else str(error)
            return {"kind": "refused", "why": said, **self._remedy(said, asked)}, {}
        header = {
            "kind": "orbit", "names": names, "t_span": [float(solution.t[0]), float(solution.t[-1])],
            "asked": list(span), "ok": solution.success, "said": _outcome(solution),
            "stopped": None if solution.success else float(solution.t[-1]), "period": self.period,
            "events": _events(solution), "held": _held(solution), "lines": _lines(solution, asked),
            "ambiguities": [[a.time, str(a)] for a in solution.ambiguities][:20],
            "end": {n: float(v) for n, v in zip(solution.states[:100], solution.x[:, -1])},
            "remedies": [] if solution.success else self._remedies(span[0], float(solution.t[-1])),
            "ms": [1e3 * (solved - begun), 1e3 * (time.perf_counter() - solved)],
        }  # fmt: skip
        arrays = {"t": found.t, "status": found.statuses.T, "values": values}
        if self.subject.sketch is not None:
            told, poses = _posed(self.subject.sketch, solution, found)
            header |= told
            arrays |= poses
        return header, arrays

    def _drawn(self, asked: Mapping[str, Any]) -> list[str]:
        """Names of what the views draw of a state: its curves, its planes, what noise moves."""
        names = [n for key in ("names", "phase") for n in checks.several(asked.get(key, ()), f"`{key}`")]
        names += self._characteristic
        if self.subject.period is not None:
            names += checks.several(
                checks.mapping(asked.get("basins", {}), "`basins`").get("axes", ()), "`axes`"
            )
        noise = checks.mapping(asked.get("noise", {}), "`noise`")
        if self.subject.noise is not None and "name" in noise:
            names.append(noise["name"])
        return list(dict.fromkeys(map(str, names)))

    def layer(self, asked: Mapping[str, Any]) -> Answer:
        """dh/dt over the multiplier of a switch at the time `t`, and with fast states at their equilibrium."""
        solution, name = self.solution, str(asked.get("switch", ""))
        if solution is None:
            return {"kind": "refused", "why": "there is no orbit yet."}, {}
        t = checks.number(asked.get("t"), "`t`")
        t = min(max(t, float(solution.t[0])), float(solution.t[-1]))
        model = solution.model
        j = next(
            (k for k, m in enumerate(model.multipliers) if str(m.symbol) == name and m.kind == "switch"), None
        )
        if j is None:
            return {"kind": "refused", "why": f"{name!r} is no switch of this system."}, {}
        x = solution(np.array([t]))[:, 0]
        mult = [float(solution(t, n)) for n in solution.multipliers]
        p = solution.parameters
        g = field_over(model, model.multipliers[j].residual, j, t, x, mult, p, _LAM)
        arrays = {"lam": _LAM, "g": g}
        h = field_over(model, model.multipliers[j].surface, j, t, x, mult, p, _LAM[:1])
        header = {
            "kind": "layer",
            "switch": name,
            "t": t,
            "now": [mult[j], float(np.interp(mult[j], _LAM, g))],
            "roots": _roots(g),
            "said": f"t = {short(t)}, "
            + ("on the surface" if abs(h[0]) < 1e-9 else f"off the surface, h = {short(h[0])}"),
        }
        if "box" in asked:
            pair = tuple(str(n) for n in checks.several(asked.get("phase", ()), "`phase`"))
            header |= {"plane": pair, "sliding": _sliding(solution, t, x, mult, pair, asked["box"])}
        if (slaved := self._with_fast_states()) is not None:
            other, k = slaved.model, [str(m.symbol) for m in slaved.model.multipliers].index(name)
            slow = [x[solution.states.index(str(s))] for s in other.states]
            arrays["slaved"] = field_over(other, other.multipliers[k].residual, k, t, slow, mult, p, _LAM)
            header |= {"slaved_roots": _roots(arrays["slaved"])}
            header["said"] += f"; pink: {', '.join(map(written, self._fast))} at equilibrium"
        return header, arrays

    def sentence(self) -> Answer:
        """What the orbit comes to, in words."""
        unit = "" if self.subject.alone else " s"
        return {
            "kind": "sentence",
            "said": said_of(self.solution, self.period, unit) if self.solution else "",
        }, {}

    def _remedy(self, said: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The field that a refusal is of, and the view in which the value is allowed."""
        field = self._culprit(asked)
        if not field:
            names = {n: n for n in asked.get("p", {})} | {f"x0.{n}": n for n in asked.get("x0", {})}
            field = next((key for key, n in names.items() if f"{n!r}" in said or f"of {n} " in said), "")
        # A view without fast states knows no time constant of theirs.
        view, own = self._with_fast_states(), {p.name for p in self.subject.system.parameters}
        gone = own - {p.name for p in view.parameters} if view else set()
        return {"field": field, "remedies": [("Take the layered view", {"view": "layered"})] * (field in gone)}

    def _culprit(self, asked: Mapping[str, Any]) -> str:
        """The parameter, start or span that is refused where all else is the system's own, too; "" where none is."""
        parts = [("t_span", {"t_span": asked["t_span"]})] if "t_span" in asked else []
        for group, prefix in (("p", ""), ("x0", "x0.")):
            if isinstance(given := asked.get(group), Mapping):
                parts += [(f"{prefix}{n}", {group: {n: value}}) for n, value in given.items()]
        for field, part in parts:
            try:
                state_of(self.subject, part)
            except (ValueError, TypeError, KeyError):
                return field
        return ""

    def _remedies(self, begin: float, end: float) -> list[tuple[str, Any]]:
        """What the page itself can do where a run has stopped: a part of the state that helps."""
        outcome = self.solution.outcome if self.solution else Outcome.FINISHED
        found: list[tuple[str, Any]] = []
        if end > begin and outcome not in _UNDECIDED:  # else a shorter span ends at the same place
            found.append(("Shorter span", {"t_span": (begin, begin + 0.98 * (end - begin))}))
        if end > begin or outcome in _UNDECIDED:  # else the values are to blame
            smoothed = switches(self.subject.system.model) and not self.subject.system._view
            found += [("Smoothed view", {"view": "smoothed"})] * bool(smoothed)
        return found

    @property
    def _fast(self) -> tuple[str, ...]:
        """States whose rate has a hidden term: as fast as the layer, or slower, as their time constant says."""
        system = self.subject.system
        if system.model.families is not None or system._view:
            return ()
        states = {s.name for s in system.states}
        return tuple(dict.fromkeys(h.where for h in system.hidden_terms if h.where in states))

    def _with_fast_states(self) -> Any:
        """The view in which these sit at their equilibrium; None where there is none."""
        if self._slaved is None:
            try:
                self._slaved = (
                    self.subject.system.layered(dict.fromkeys(self._fast, sp.oo)) if self._fast else False
                )
            except ValueError:  # no time constant or equilibrium that is unique
                self._slaved = False
        return self._slaved or None


def state_of(subject: Subject, asked: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, float], Any]:
    """(parameters, start, span) that a page asks for; ValueError or TypeError in the system's words."""
    p = subject.system._spread(_numbers(asked.get("p", {}), "`p`"), "`p`")
    subject.system.with_parameters(p)
    x0 = subject.start | _numbers(asked.get("x0", {}), "`x0`")
    subject.system.initial_state(x0)
    span = checks.span(asked.get("t_span", subject.t_span))
    longest = LIMITS["span"] * max(1.0, (subject.t_span[1] - subject.t_span[0]) / 100)
    if span[1] - span[0] > 10 * longest:
        raise ValueError(
            f"`t_span` is {span[1] - span[0]:g} long; {10 * longest:g} is the most that the page draws."
        )
    return p, x0, span


def method_of(subject: Subject, asked: Mapping[str, Any]) -> dict[str, str]:
    """The method of maps, which do not choose it themselves, as an option: that of the orbit of this state."""
    p, x0, span = state_of(subject, asked)
    orbit = subject.solve(span, x0, p, max_steps=LIMITS["steps"], max_seconds=LIMITS["seconds"])
    return {"method": "stiff"} if orbit.tolerances.get("method") == "stiff" else {}


def seen_by(subject: Subject, asked: Mapping[str, Any]) -> Strobe | Return:
    """How a map sees the motion: once a period, or by `section` = [state, direction], at its zeros."""
    if subject.period is not None:
        return Strobe(subject.period)
    name, direction = checks.several(asked.get("section") or ("", 1), "`section`")
    if str(name) not in [s.name for s in subject.system.states]:
        raise ValueError("the system has no period, and no state is chosen whose zeros make a section.")
    return Return(str(name), direction)


def _numbers(given: Any, what: str) -> dict[str, float]:
    """Names to finite numbers, of which text and truth values are none."""
    for key, value in checks.mapping(given, what).items():
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
            raise TypeError(f"{what}, value of {str(key)!r} is {checks.shown(value)}; give a number.")
    return checks.values(given, what)


def sampled(solution: Solution, names: list[str], sketch: Any = None) -> tuple[Sampled, np.ndarray]:
    """Points even in each step's own variable, with what the sketch needs, and the values (names, m) at them."""
    wanted = [n for n in names if not n.startswith("h:")]
    if len(wanted) < len(names):
        wanted = [*solution.states, *solution.multipliers, *wanted]
    if sketch is not None:
        own = (*solution.states, *solution.multipliers, *solution.outputs)
        wanted += [n for n in sketch.names if n in own]
    # A step of many may still be long: all get eight places, of which what shows no bend is dropped again.
    steps = len(solution.t)
    points, chord = max(POINTS, min(8 * steps, 64 * _STEPS)), 5e-4 if steps > _STEPS else None
    found = solution.sample(points, list(dict.fromkeys(wanted)), chord=chord)
    rows = dict(zip(found.names, found.values.T))
    model, p = solution.model, [solution.parameters[str(s)] for s in solution.model.parameters]
    for m in model.multipliers:
        if f"h:{m.symbol}" in names:
            known = (rows[n] for n in (*solution.states, *solution.multipliers))
            rows[f"h:{m.symbol}"] = np.broadcast_to(
                vectorised(model, m.surface)(found.t, *known, *p), found.t.shape
            )
    return found, np.array([rows[n] for n in names])


def _posed(sketch: Any, solution: Solution, found: Sampled) -> Answer:
    """Rows of the pose, those that stay as numbers, and the others at every few of the points; the room they need."""
    few = slice(None, None, max(1, len(found) // _POSES))
    some = replace(
        found, t=found.t[few], values=found.values[few], status=found.status[few], step=found.step[few],
        statuses=found.statuses[few],
    )  # fmt: skip
    rows: list[float | None] = []
    moving: list[np.ndarray] = []
    ends: dict[str, list[float]] = {"x": [], "y": []}
    for shape, places in zip(sketch.describe(), sketch.pose(solution, some).values()):
        wide = shape.get("width") or 2 * shape.get("radius", 0.0)
        half = {"x": wide / 2, "y": (shape.get("height") or 2 * shape.get("radius", 0.0) or wide) / 2}
        for name, row in zip(shape["places"], places):
            if (axis := name[0]) in ends:
                ends[axis] += [row.min() - half[axis], row.max() + half[axis]]
            still = np.ptp(row) == 0
            rows.append(float(row[0]) if still else None)
            if not still:
                moving.append(row)
    left, right, low, high = (float(f(ends[axis])) for axis in "xy" for f in (min, max))
    pad = 0.06 * (right - left)
    reach = sketch.bounds or (left - pad, right + pad, low - 2 * pad, high + pad)
    header = {"pose": rows, "reach": reach}
    return header, {"pose": np.array(moving).reshape(len(moving), len(some)), "pose_t": some.t}


def _events(solution: Solution) -> list[list[Any]]:
    events = list(solution.events)
    thin = max(1, -(-len(events) // _TICKS))
    return [[float(e.time), e.kind, str(e.switch)] for e in events[::thin]]


def _held(solution: Solution) -> list[list[float]]:
    """(start, end, number of held switches or contacts) of the segments in which some are."""
    segments = solution.segments
    if not len(solution.mult):
        return []
    status = np.array([s.status for s in segments]).T
    held, count = solution._holds(status), (status == 0).sum(axis=0)
    return [[s.start, s.end, int(n)] for s, h, n in zip(segments, held, count) if h][: 4 * _TICKS]


def _lines(solution: Solution, asked: Mapping[str, Any]) -> list[list[float]]:
    """(a, b, c) of surfaces a x + b y + c = 0 that are straight lines of the phase plane."""
    pair = tuple(str(n) for n in asked.get("phase", ()))
    if len(pair) != 2 or solution.model.families is not None:
        return []
    p = [solution.parameters[str(s)] for s in solution.model.parameters]
    return [[float(c(*p)) for c in line] for _, line in _straight(solution.model, pair)]


def _sliding(
    solution: Solution, t: float, x: Any, mult: Any, pair: tuple[str, ...], box: Any
) -> list[list[float]]:
    """Pieces (x0, y0, x1, y1) of straight surfaces in the phase plane on which it slides at the time t.

    There the layer has an attracting root: dh/dt > 0 at some lambda and < 0 at a larger one, all else as it is now.
    """
    model, p, sides = solution.model, solution.parameters, checks.several(box, "`box`")
    if len(pair) != 2 or len(sides) != 2 or model.families is not None:
        return []
    low, high = np.array([checks.interval(side, "`box`") for side in sides]).T
    values = [p[str(s)] for s in model.parameters]
    found: list[list[float]] = []
    for m, line in _straight(model, pair):
        a, b, c = (float(k(*values)) for k in line)
        j = model.multipliers.index(m)
        if not can_slide(model, m):
            continue
        slope, size = (a, b), high - low
        k = int(abs(a) * size[0] > abs(b) * size[1])  # the axis that the line is along
        places = np.empty((2, _PLACES))
        places[k] = np.linspace(low[k], high[k], _PLACES)
        places[1 - k] = -(slope[k] * places[k] + c) / slope[1 - k]
        there = [
            places[pair.index(name), :, None] if (name := str(s)) in pair else v
            for s, v in zip(model.states, x)
        ]
        g = field_over(model, m.residual, j, t, there, mult, p, np.broadcast_to(_LAM, (_PLACES, len(_LAM))))
        # > 0 where there is such a root, and its zero is where this one comes or goes.
        margin = np.minimum(np.maximum.accumulate(g, axis=1), -g).max(axis=1)
        inside = np.flatnonzero(np.diff(np.concatenate([[False], margin > 0, [False]]).astype(int)))
        for first, last in zip(inside[::2], inside[1::2] - 1):
            ends = []
            for at, beside in ((first, first - 1), (last, last + 1)):
                u = margin[at] / (margin[at] - margin[beside]) if 0 <= beside < _PLACES else 0.0
                ends += (
                    places[:, at] + u * (places[:, min(max(beside, 0), _PLACES - 1)] - places[:, at])
                ).tolist()
            found.append(ends)
    return found


@functools.lru_cache(maxsize=64)
def _straight(model: Model, pair: tuple[str, ...]) -> list[tuple[Any, list[Any]]]:
    """Switches and contacts whose surface is straight in two states, with its coefficients by the parameters."""
    states = {s.name: s for s in model.states}
    if not set(pair) <= set(states) or pair[0] == pair[1]:
        return []
    x, y = (states[n] for n in pair)
    found = []
    for m in model.multipliers:
        h = m.surface
        if h is None or h.free_symbols - {x, y, *model.parameters} or not h.is_polynomial(x, y):
            continue
        if (poly := sp.Poly(h, x, y)).total_degree() == 1:
            found.append((m, [numpy_function(model.parameters, poly.coeff_monomial(k)) for k in (x, y, 1)]))
    return found


def _roots(g: np.ndarray) -> list[list[float]]:
    """(lambda, 1 where attracting else 0) of the zeros of dh/dt inside (-1, 1)."""
    g = np.asarray(g)
    at = np.flatnonzero((g[:-1] > 0) != (g[1:] > 0))
    lam = _LAM[at] - g[at] * (_LAM[1] - _LAM[0]) / (g[at + 1] - g[at])
    return [[float(l), float(g[k] > 0)] for l, k in zip(lam, at)]


def _outcome(solution: Solution) -> str:
    """Why it stopped, or since when it is not unique."""
    if solution.outcome in (Outcome.TOO_MANY_STEPS, Outcome.TIME_LIMIT):  # whose remedies no page has
        most = (
            f"{LIMITS['steps']:_} steps"
            if solution.outcome == Outcome.TOO_MANY_STEPS
            else f"{LIMITS['seconds']:g} s"
        )
        return f"Stopped at t = {short(solution.t[-1])} after {most}, the most of a picture.".replace("_", " ")
    if not solution.success:
        return solution.message
    unsure = next(iter(solution.ambiguities), None)
    return f"Not unique from t = {short(unsure.time)} on: {unsure}" if unsure else ""


def said_of(solution: Solution, period: float | None, unit: str = "") -> str:
    """What the orbit comes to, its sticks and events: a sentence or two. `unit` is that of time."""
    if not solution.success:
        return f"Stopped at t = {solution.t[-1]:.6g}{unit}."
    end, begin = float(solution.t[-1]), float(solution.t[0])
    first, each = "", ""
    if period:
        count = int((end - begin) / period * (1 + 1e-12))
        window = Window(end - period * np.arange(min(count, 2 * _LONGEST), -1, -1.0), True)
        cycle = Period(_LONGEST, 1e-5).find(strobes(solution, window)) if count else 0
        if cycle:
            drive = "drive period" if cycle == 1 else f"{cycle} drive periods"
            first, each = f"Repeats every {drive} ({cycle * period:.3g}{unit}); ", " each time"
            begin = end - cycle * period
        else:
            first = f"No period found from {short(begin)} to {short(end)}{unit}: still settling, or none. "
    words: list[str] = []
    lengths = [h[1] - h[0] for h in _held(solution) if h[0] >= begin - 1e-9 * abs(begin)]
    if lengths:
        told = ", ".join(f"{d:.3g}{unit}" for d in lengths[:3]) + (" ..." if len(lengths) > 3 else "")
        words.append(f"1 stick of {told}" if len(lengths) == 1 else f"{len(lengths)} sticks ({told})")
    elif switches(solution.model):
        words.append("no stick")
    count = sum(e.time >= begin for e in solution.events)
    words.append(f"{count} event{'s' * (count != 1)}{each}")
    if solution.ambiguities:
        count = len(solution.ambiguities)
        words.append(f"{count} place{'s' * (count > 1)} from which it is not unique")
    rest = ", ".join(words)
    return f"{first}{rest if first.endswith('; ') else rest[:1].upper() + rest[1:]}."
