"""Whether a measured drive may be taken as exact: a fit does so, and its errors then leave the drive's noise out.

    s_k**2 = mean (D**k u)**2/binomial(2 k, k)   the same at k = 5 and 8 if noise makes it, not a smooth motion

The same noise is added to the drive once more, and the fit goes on from its minimum; and the drive is smoothed, which
tells the steps of an encoder. What moves by more than its stated error has a bias, or an error that is not stated.
Where the misfit grows much by what is added or taken away, that was no noise: the drive is rough, and exact.

Source: Cook and Stefanski, J. Am. Stat. Assoc. 89 (1994) 1314: to see the effect of noise, add more of it (SIMEX).
Chain: shooting.py, gauss_newton.py, identifiability.py -> **noisy_drives** -> fitting.py.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..definition.drives import Drive, rewritten, written
from .gauss_newton import ALL, Minimum, minimise
from .identifiability import covariance
from .shooting import Experiment, RunFailed, Shooting

_ORDERS = 5, 8
_KEPT, _KEPT_DEVIATION = (
    0.95,
    0.871,
)  # of the differences, and the standard deviation of these of a normal number
_SMOOTH = 0.5  # ratio of the levels of both orders below which a smooth motion makes them
_LEAST, _LARGEST = 1e-9, 0.3  # of the drive's standard deviation: rounding, and a random excitation
_DRAWS = 2  # of the noise that is added
_PRESENT = 3.0  # of the misfit: by less it grows, in one draw at least, if as much noise is there already
_TAKEN = 1.0  # of the misfit: by less it grows as noise is taken away
_RUNS = 20  # of the fit that goes on
_MOVED = 2.5  # stated errors, from which on they are not honest


def level(u: np.ndarray) -> float:
    """Standard deviation of the noise of evenly spaced samples; 0 where a smooth motion or a random one is seen."""
    spread = float(np.std(u))
    if len(u) <= 2 * _ORDERS[1] or not spread > 0:
        return 0.0
    low, high = (_usual(np.diff(u, k)) / math.sqrt(math.comb(2 * k, k)) for k in _ORDERS)
    return high if high > _SMOOTH * low and _LEAST * spread < high < _LARGEST * spread else 0.0


def _usual(d: np.ndarray) -> float:
    """Standard deviation, without the largest, which corners of a motion make; of a quantised one the median is 0."""
    squares = np.sort(d**2)
    return math.sqrt(float(np.mean(squares[: math.ceil(_KEPT * len(squares))]))) / _KEPT_DEVIATION


def unstated(
    problem: Shooting,
    found: Minimum,
    fixed: np.ndarray,
    guesses: Mapping[str, float],
    options: Mapping[str, Any],
) -> str:
    """Why stated errors are not honest, in words; empty where they are."""
    records = {_record(drive): name for e in problem.experiments for name, drive in _drives(e).items()}
    noisy = {record: level(np.array(record[1])) for record in records}
    noisy = {record: size for record, size in noisy.items() if size}
    free = np.flatnonzero(~fixed)
    if not noisy or not len(free):
        return ""
    errors = np.sqrt(np.diag(covariance(found.slopes.jacobian[:, free])))
    errors = np.where(np.isfinite(errors) & (errors > 0), errors, np.inf)

    def refitted(others: Mapping[Any, np.ndarray]) -> Minimum | None:
        with contextlib.suppress(RunFailed, ValueError):
            experiments = [_with_others(e, others, guesses, options) for e in problem.experiments]
            other = Shooting(experiments, problem.coordinates, problem.columns, problem.priors, problem.levels)
            return minimise(other, found.z, other.nodes, fixed, _RUNS, lambda _: None, ALL)
        return None

    def moved(fits: list[Minimum]) -> tuple[float, str]:
        far = [np.abs(fit.z - found.z)[free] / errors for fit in fits]
        k = int(np.argmax(np.max(far, axis=0)))
        return float(np.max(far)), problem.coordinates.names[free[k]]

    randoms = [np.random.default_rng(draw) for draw in range(_DRAWS)]
    more = [
        refitted({r: r[1] + random.normal(0.0, size, len(r[1])) for r, size in noisy.items()})
        for random in randoms
    ]
    added, misfit = [fit for fit in more if fit is not None], found.at.misfit
    smooth = refitted({record: _smoothed(*map(np.array, record)) for record in noisy})
    exact = smooth is not None and smooth.at.misfit > (1 + _TAKEN) * misfit
    exact |= bool(added) and min(fit.at.misfit for fit in added) > (1 + _PRESENT) * misfit
    if not exact and added and moved(added)[0] > _MOVED:
        (most, which), how = moved(added), "as much noise once more moves"
    elif smooth is not None and moved([smooth])[0] > _MOVED and smooth.at.misfit < misfit:
        (most, which), how = moved([smooth]), "smoothing moves"
    else:
        return ""
    told = ", ".join(
        f"the drive {records[record]!r} has noise of about {size:.2g}" for record, size in noisy.items()
    )
    return (
        f"{told[0].upper()}{told[1:]}, which a fit takes as exact: {how} {which} by {most:.2g} stated errors. "
        "Smooth the drive, or measure it better."
    )


def _drives(e: Experiment) -> dict[str, Drive]:
    """Drives of a system by name, the record before its derivatives."""
    inner = e.system._written()
    while "view" in inner:
        inner = inner["of"]
    return dict(
        sorted(
            ((str(name), drive) for name, drive in inner.get("drives", {}).items()),
            key=lambda pair: -pair[1].derivatives,
        )
    )


def _record(drive: Drive) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(drive.times.tolist()), tuple(drive.samples.tolist())


def _smoothed(times: np.ndarray, samples: np.ndarray) -> np.ndarray:
    from scipy.interpolate import make_smoothing_spline

    beats = (times - times[0]) / np.mean(np.diff(times))
    return make_smoothing_spline(beats, samples)(beats)


def _with_others(
    e: Experiment, others: Mapping[Any, np.ndarray], guesses: Mapping[str, float], options: Mapping[str, Any]
) -> Experiment:
    """The experiment with other samples of its drives."""

    def changed(drive: Drive) -> Drive:
        times, samples, kind, derivatives = written(drive)
        return rewritten(times, others.get(_record(drive), samples), kind, derivatives)

    content = e.system._written()
    inner = content
    while "view" in inner:
        inner = inner["of"]
    inner["drives"] = {name: changed(drive) for name, drive in inner["drives"].items()}
    system = type(e.system)._read(content)
    model = system if e.scene is None else dataclasses.replace(e.scene, system=system)
    return Experiment(dataclasses.replace(e.record, system=model), model, guesses, 1, options)
