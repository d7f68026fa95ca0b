"""Work against precision: what each method pays for each error, on scenes whose answer is known.

Three errors of a run: the state (largest over three ends of the span), the event times, and the one that matters
most here, a wrong itinerary: another sequence of crossings, sticks and slips than the reference's.
Work: processor time (median of interleaved repeats, compilation apart) and evaluations of the right-hand side.
Chain: cases.py, methods.py -> **this file** -> charts.py, experiments.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .cases import CASES, Case, Reference
from .methods import METHODS, CannotDo, Method, Run

__all__ = ["Point", "work_precision"]


@dataclass(frozen=True)
class Point:
    """One method at one setting on one case.

    Attributes
    ----------
    error : float
        Of the state, in the units of the case; nan where there is none.
    event_error : float
        Largest error of an event time (s); nan without events or with a wrong itinerary.
    itinerary : str
        "right", "wrong", or "none" for methods that know no events.
    seconds : float
        Processor time of a run to the last end, median.
    first_call : float
        Processor time of the first call, compilation included, s.
    evaluations : int
    note : str
        Why there is no result.
    """

    case: str
    method: str
    group: str
    setting: Any
    error: float
    event_error: float
    itinerary: str
    seconds: float
    first_call: float
    evaluations: int
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For a data file."""
        return asdict(self)


def work_precision(
    cases: Iterable[str | Case] = (),
    methods: Iterable[str | Method] = (),
    *,
    repeats: int = 5,
    longest: float = 20.0,
    tell: Callable[[Point], None] | None = None,
) -> list[Point]:
    """Measure methods on cases.

    Parameters
    ----------
    cases, methods : names, or objects of one's own
        All built-in ones by default.
    repeats : int
        Timed runs of each setting; the methods' rounds are interleaved.
    longest : float
        Seconds; a setting whose run took longer is the last of its method on that case.
    tell : callable, optional
        Called with every Point.

    Returns
    -------
    list of Point

    Raises
    ------
    ValueError
        An unknown name.
    """
    chosen = [_named(m, METHODS, "methods") for m in methods] or list(METHODS.values())
    points = []
    for case in [_named(c, CASES, "cases") for c in cases] or list(CASES.values()):
        points += _measure(case, chosen, repeats, longest, tell)
    return points


def _named(item, known, argument):
    if not isinstance(item, str):
        return item
    if item not in known:
        raise ValueError(f"`{argument}` contains {item!r}, which is none of {', '.join(known)}.")
    return known[item]


def _measure(case, methods: Sequence[Method], repeats, longest, tell):
    entries, points = [], []
    for method in methods:
        for setting in method.settings:
            try:
                runner = method.runner(case, setting)
                runs, first = _first(runner, case.reference)
            except CannotDo as reason:
                points.append(_failed(case, method, setting, f"cannot do: {reason}"))
                break
            except ImportError as reason:
                points.append(_failed(case, method, setting, f"not installed: {reason.name}"))
                break
            except Exception as error:  # a rival's failure is a result
                points.append(_failed(case, method, setting, f"{type(error).__name__}: {error}"))
                continue
            took = _seconds(runner, case.t_end)
            entries.append((method, setting, runner, runs, first, [took]))
            if took > longest:
                break
    # Rounds are interleaved: a slow minute of the machine hits all methods alike. The expensive ones run once.
    for _ in range(repeats - 1):
        for *_, runner, _, _, times in entries:
            if times[0] < 1.0:
                times.append(_seconds(runner, case.t_end))
    for method, setting, _, runs, first, times in entries:
        points.append(_judged(case, method, setting, runs, statistics.median(times), first))
    if tell:
        for point in points:
            tell(point)
    return points


def _seconds(runner, t_end):
    begin = time.process_time()
    runner(t_end)
    return time.process_time() - begin


def _first(runner, reference: Reference) -> tuple[list[Run], float]:
    """A run to every end, and the seconds of the first."""
    begin = time.process_time()
    runs = [runner(reference.ends[0])]
    first = time.process_time() - begin
    return runs + [runner(end) for end in reference.ends[1:]], first


def _judged(case: Case, method: Method, setting, runs: list[Run], seconds, first) -> Point:
    reference = case.reference
    error = max(float(np.max(np.abs(run.x - x))) for run, x in zip(runs, reference.states))
    log, event_error, itinerary = runs[-1].events, float("nan"), "none"
    if log is not None:
        right = tuple(kind for _, kind in log) == reference.kinds
        itinerary = "right" if right else "wrong"
        if right:
            event_error = float(np.max(np.abs(np.array([at for at, _ in log]) - reference.times), initial=0.0))
    if error > 0.1 * case.scale:
        itinerary = "wrong"
    return Point(
        case.name, method.name, method.group, setting, error, event_error, itinerary, seconds, first,
        runs[-1].evaluations,
    )  # fmt: skip


def _failed(case, method, setting, note):
    nan = float("nan")
    return Point(case.name, method.name, method.group, setting, nan, nan, "none", nan, nan, 0, note)
