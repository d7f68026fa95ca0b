"""The ladder: an observable on every rung, its distance from the richest one, its cost, and what follows.

    distance_i = max |o_i - o_richest|,    error bar = numerical error of both + sampling error of both

The numerical error of a rung is the change of its observable between tolerances a hundredfold apart, the looser run
looked at with half as many samples; of a noisy rung also the 95 % interval of the mean over its trajectories. A rung is
within the tolerance if distance + bar <= tolerance, outside if distance - bar > tolerance, else undecided.
Chain: rungs.py, catalogue.py -> **climbing** -> result.py.
"""

from __future__ import annotations

import math
import statistics
import time
from typing import Any

import numpy as np

from ...door import checks
from ...scenes import Scene
from ...scenes.scene import ATOL
from .catalogue import setting_of
from .judging import Step
from .result import Ladder
from .rungs import Observable, Rung, Setting

__all__ = ["ladder"]

APART = 100.0  # ratio of the two tolerances: at least a decade of error between them at any order of the method


class _Failed(Exception):
    """A rung whose run did not end as asked."""


@checks.door()
def ladder(
    scene: str | Setting,
    observable: str | Observable,
    tolerance: float | str,
    *,
    rtol: float = 1e-9,
    repeats: int = 5,
    samples: int | None = None,
    max_steps: int = 300_000,
) -> Ladder:
    """The simplest model that a scene needs for an observable.

    Parameters
    ----------
    scene : str or Setting
        One of `pwsmooth.compare.ladders.scenes`, or a setting of one's own (`friction_setting`, `contact_setting`).
    observable : str or Observable
        One of the setting's, or one's own.
    tolerance : float or str, in the unit of the observable
        Largest distance from the richest model that is accepted; "5%" is relative to the richest model's value.
    rtol : float, dimensionless
        Tolerance of the runs that are reported and timed; their error is judged against runs with `100 rtol`.
    repeats : int
        Timed runs of each rung.
    samples : int, optional
        Trajectories of a noisy rung, instead of its own number.
    max_steps : int
        Bound on the steps of one run; a rung that needs more has failed, which the ladder says.

    Returns
    -------
    Ladder
        Every rung's value, error, cost and verdict, and the recommendation.

    Raises
    ------
    ValueError, TypeError
        An unknown scene or observable, a tolerance that is not positive.

    >>> found = ladder("forced oscillator", "amplitude", "1%")
    >>> found.recommended
    'Coulomb'
    """
    setting = setting_of(scene)
    wanted = setting.observable(observable)
    bound = _tolerance(tolerance)
    rtol = checks.relative_tolerance(rtol)
    repeats = checks.whole(repeats, "`repeats`", 1)
    if samples is not None:
        samples = checks.whole(samples, "`samples`", 2)
    climb = _Climb(setting, wanted, rtol, repeats, samples, checks.whole(max_steps, "`max_steps`", 1))
    top, motion = climb.step(setting.richest)
    below = [] if motion is None else [climb.step(rung)[0] for rung in setting.coarser(motion)]
    if isinstance(bound, str):
        share = float(bound[:-1]) / 100
        bound = share * float(np.max(np.abs(top.value))) if not top.failure else math.nan
    return Ladder.of(setting, wanted, float(bound), [*below, top])


def _tolerance(value):
    number = value[:-1] if isinstance(value, str) and value.endswith("%") else value
    try:
        number = float(number)
    except (TypeError, ValueError):
        raise TypeError(f"`tolerance` is {value!r}; give a number, or a share such as '5%'.") from None
    if not (math.isfinite(number) and number > 0):
        raise ValueError(f"`tolerance` is {value!r}; give one > 0: no two models agree to the last bit.")
    return value if isinstance(value, str) and value.endswith("%") else number


class _Climb:
    """Runs and measures rungs of one setting."""

    def __init__(self, setting, observable, rtol, repeats, samples, max_steps):
        self.setting, self.observable = setting, observable
        self.rtol, self.repeats, self.samples, self.max_steps = rtol, repeats, samples, max_steps

    def step(self, rung: Rung) -> tuple[Step, Any]:
        """The rung's Step, and its motion (None if it failed)."""
        model = rung.scene()
        if not isinstance(model, Scene):  # in closed form
            value = self._measured(model, 2)
            error = _gap(value, self._measured(model, 1))
            return Step(rung.name, rung.matched, value, error, 0.0, 0.0, 0), model
        count = 1 if rung.noise is None else (self.samples or rung.samples)
        try:
            coarse: list[Any] = []
            fine: list[Any] = []
            first: Any = None
            for k in range(count):
                noise = None if rung.noise is None else rung.noise(k)
                coarse.append(self._measured(self._solve(model, APART, noise), 1))
                motion = self._solve(model, 1.0, noise)
                fine.append(self._measured(motion, 2))
                first = first or motion
        except _Failed as reason:
            nan = math.nan
            return Step(rung.name, rung.matched, np.array(nan), nan, nan, nan, 0, failure=str(reason)), None
        value = np.mean(fine, axis=0)
        error = _gap(value, np.mean(coarse, axis=0))
        spread = 0.0
        if count > 1:
            from scipy.stats import t as student

            deviation = float(np.max(np.std(fine, axis=0, ddof=1)))
            spread = float(student.ppf(0.975, count - 1)) * deviation / math.sqrt(count)
        return Step(
            rung.name, rung.matched, value, error, spread, self._seconds(model, rung), first.cost.get("steps", 0),
        ), first  # fmt: skip

    def _solve(self, scene, looser, noise):
        atol = [looser * scene.atol.get(str(s), ATOL) for s in scene.system.states]
        options: dict[str, Any] = {"max_steps": self.max_steps}
        if noise is not None:
            options["noise"] = noise
        solution = scene.solve(rtol=looser * self.rtol, atol=atol, dense_output=True, **options)
        if not solution.success:
            raise _Failed(solution.message)
        return solution

    def _measured(self, motion, finer):
        points = finer * (self.setting.points - 1) + 1
        return np.asarray(self.observable.measure(motion, self.setting.window, points), float)

    def _seconds(self, scene, rung):
        """Median processor time of one trajectory; everything is compiled by now."""
        times = []
        noise = None if rung.noise is None else rung.noise(0)
        for _ in range(self.repeats):
            begin = time.process_time()
            self._solve(scene, 1.0, noise)
            times.append(time.process_time() - begin)
        return statistics.median(times)


def _gap(a, b):
    """Largest distance of two values of an observable; equal infinities and two missing values are none."""
    a, b = np.broadcast_arrays(a, b)
    if np.array_equal(a, b, equal_nan=True):
        return 0.0
    distance = np.abs(a - b)
    return float(np.max(np.where(np.isnan(distance), np.inf, distance)))
