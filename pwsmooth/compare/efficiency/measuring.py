"""Work against precision: what each method pays for each error, on scenes whose answer is known.

Processor times are medians of interleaved repeats, warm, with compilation apart.
Chain: cases.py, methods.py, points.py -> **this file** -> experiments.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ...door import checks
from ...scenes.scene import Scene
from .case import Case, Reference, case_of
from .cases import CASES
from .contract import CannotDo, Run
from .methods import METHODS, Method
from .points import Point, WorkPrecision

__all__ = ["work_precision"]

LONG = 1.0  # s; what takes longer is timed once
SHORT = 5e-3  # s; what takes less is timed over several calls


@checks.door()
def work_precision(
    scene: str | Case | Scene | Iterable[str | Case] = (),
    methods: Iterable[str | Method] = (),
    tolerances: Sequence[float] = (),
    *,
    reference: Callable[[float], Sequence[float]] | None = None,
    sizes: Sequence[float] | None = None,
    repeats: int = 5,
    longest: float = 20.0,
    tell: Callable[[Point], None] | None = None,
) -> WorkPrecision:
    """Measure methods on a scene whose answer is known: error against processor time and evaluations.

    Parameters
    ----------
    scene : str, Case, Scene, or several names or cases
        A built-in case by name (`CASES` has them), all of them by default, or any Scene that begins at t = 0.
    methods : names, or Methods of one's own
        All built-in ones by default (`METHODS` has them); one whose package is not installed says so in its point.
    tolerances : sequence of float, any length, dimensionless, optional
        Relative tolerances, loose to tight, for the methods whose knob is `rtol`; their own by default.
    reference : callable, optional
        t -> exact state of a Scene. Without it two methods without common code have to agree.
    sizes : sequence of float, length n, optional
        Of a Scene's states, the units of the errors; by default the largest values on the motion.
    repeats : int
        Timed runs of each setting; the methods' rounds are interleaved.
    longest : float, s
        A setting whose run took longer is the last of its method on that case.
    tell : callable, optional
        Called with every Point.

    Returns
    -------
    WorkPrecision
        A list of Points, with `cheapest` and `plot`.

    Raises
    ------
    ValueError
        An unknown name, a tolerance that is none, a reference for a built-in case.
    TypeError
        A scene of another kind.
    RuntimeError
        The two methods of a reference disagree.

    >>> data = work_precision("relay", ["event-driven"], [1e-6, 1e-9], repeats=1)
    >>> [(point.itinerary, point.error < point.setting) for point in data]
    [('right', True), ('right', True)]
    >>> list(data.cheapest(1e-8))
    ['event-driven']
    """
    chosen = [_named(m, METHODS, "methods") for m in methods] or list(METHODS.values())
    for rtol in tolerances:
        if not 0 < rtol < 1:
            raise ValueError(f"`tolerances` contains {rtol!r}; give numbers between 0 and 1.")
    data = WorkPrecision()
    for case in _cases(scene, reference, sizes):
        answer = case.reference
        data.references[case.name] = {
            "title": case.title, "source": answer.source, "uncertainty": answer.uncertainty,
            "events": len(answer.kinds), "t_end": case.t_end,
        }  # fmt: skip
        data += _measure(case, chosen, tolerances, repeats, longest, tell)
    return data


def _cases(scene, reference, sizes) -> list[Case]:
    if isinstance(scene, Scene):
        return [case_of(scene, exact=reference, sizes=sizes)]
    if reference is not None or sizes is not None:
        raise ValueError("`reference` and `sizes` belong to a Scene; a Case has its own, so leave them out.")
    if isinstance(scene, (str, Case)):
        scene = [scene]
    if not isinstance(scene, Iterable):
        raise TypeError(f"`scene` is {scene!r}; give a name of {', '.join(CASES)}, a Case, or a Scene.")
    return [_named(c, CASES, "scene") for c in scene] or list(CASES.values())


def _named(item, by_name, argument):
    if not isinstance(item, str):
        return item
    if item not in by_name:
        raise ValueError(f"`{argument}` contains {item!r}, which is none of {', '.join(by_name)}.")
    return by_name[item]


def _measure(case, methods: Sequence[Method], tolerances, repeats, longest, tell):
    entries, points = [], []
    for method in methods:
        slow = 0
        settings = tolerances if tolerances and method.knob == "rtol" else method.settings
        for setting in settings:
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
                points.append(_failed(case, method, setting, f"{type(error).__name__}: {str(error)[:200]}"))
                slow += 1
                if slow == 2:  # two failures in a row: tighter settings fare no better
                    break
                continue
            slow = 0
            took = _seconds(runner, case.t_end)
            entries.append((method, setting, runner, runs, first, [took]))
            if took > longest:
                break
    # Rounds are interleaved: a slow minute of the machine hits all methods alike. The expensive ones run once.
    for _ in range(repeats - 1):
        for *_, runner, _, _, times in entries:
            if times[0] < LONG:
                times.append(_seconds(runner, case.t_end))
    for method, setting, _, runs, first, times in entries:
        points.append(_judged(case, method, setting, runs, statistics.median(times), first))
    if tell:
        for point in points:
            tell(point)
    return points


def _seconds(runner, t_end):
    """Processor time of a run. A short one is repeated: its first call after another method's pays for cold caches."""
    begin = time.process_time()
    runner(t_end)
    once = time.process_time() - begin
    if once >= SHORT:
        return once
    count = 1 + int(SHORT / max(once, SHORT / 100))
    begin = time.process_time()
    for _ in range(count):
        runner(t_end)
    return (time.process_time() - begin) / count


def _first(runner, reference: Reference) -> tuple[list[Run], float]:
    """A run to every end, and the seconds of the first."""
    begin = time.process_time()
    runs = [runner(reference.ends[0])]
    first = time.process_time() - begin
    return runs + [runner(end) for end in reference.ends[1:]], first


def _judged(case: Case, method: Method, setting, runs: list[Run], seconds, first) -> Point:
    reference = case.reference
    error = max(case.apart(run.x, x) for run, x in zip(runs, reference.states))
    error = error if np.isfinite(error) else float("inf")
    log, event_error, itinerary = runs[-1].log(), float("nan"), "none"
    if log is not None:
        log = case.itinerary(log)
        right = tuple(kind for _, kind in log) == reference.kinds
        itinerary = "right" if right else "wrong"
        if right:
            event_error = float(np.max(np.abs(np.array([at for at, _ in log]) - reference.times), initial=0.0))
    if error > 0.1:
        itinerary = "wrong"
    return Point(
        case.name, method.name, method.group, setting, error, event_error, itinerary, seconds, first,
        runs[-1].evaluations,
    )  # fmt: skip


def _failed(case, method, setting, note):
    nan = float("nan")
    return Point(case.name, method.name, method.group, setting, nan, nan, "none", nan, nan, 0, note)
