"""Whether a measured drive may be taken as exact: a fit does so, and its errors then leave the drive's noise out.

    s_k**2 = median (D**k u)**2/(0.6745**2 binomial(2 k, k))   the same at k = 5 and 8 if noise makes it, no motion

The same noise is added to the drive once more, and the fit goes on from its minimum. What moves by more than its stated
error has a bias or an error that is not stated. Where the misfit grows by more than itself the noise is not there yet:
the drive is rough, and exact.

Source: Cook and Stefanski, J. Am. Stat. Assoc. 89 (1994) 1314: to see the effect of noise, add more of it (SIMEX).
Chain: shooting.py, gauss_newton.py, identifiability.py -> **noisy_drives** -> fitting.py.
"""

from __future__ import annotations

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
_SMOOTH = 0.5  # ratio of the levels of both orders below which a smooth motion makes them
_LEAST, _LARGEST = 1e-9, 0.3  # of the drive's standard deviation: rounding, and a random excitation
_DRAWS = 2  # of the noise that is added
_RUNS = 20  # of the fit that goes on
_MOVED = 2.5  # stated errors, from which on they are not honest
_PRESENT = 3.0  # of the misfit: by less it grows, in one draw at least, if as much noise is there already


def level(u: np.ndarray) -> float:
    """Standard deviation of the noise of evenly spaced samples; 0 where a smooth motion or a random one is seen."""
    spread = float(np.std(u))
    if len(u) <= 2 * _ORDERS[1] or not spread > 0:
        return 0.0
    low, high = (
        float(np.median(np.abs(np.diff(u, k)))) / (0.6745 * math.sqrt(math.comb(2 * k, k))) for k in _ORDERS
    )
    return high if high > _SMOOTH * low and _LEAST * spread < high < _LARGEST * spread else 0.0


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
    most, which, grown = 0.0, 0, math.inf
    for draw in range(_DRAWS):
        random = np.random.default_rng(draw)
        more = {record: random.normal(0.0, size, len(record[1])) for record, size in noisy.items()}
        try:
            experiments = [_with_more(e, more, guesses, options) for e in problem.experiments]
            other = Shooting(experiments, problem.coordinates, problem.columns, problem.priors, problem.levels)
            at = minimise(other, found.z, other.nodes, fixed, _RUNS, lambda _: None, ALL)
        except (RunFailed, ValueError):
            continue
        moved = np.abs(at.z - found.z)[free] / errors
        grown = min(grown, at.at.misfit - found.at.misfit)
        if moved.max() > most:
            most, which = float(moved.max()), int(free[moved.argmax()])
    if most <= _MOVED or grown > _PRESENT * found.at.misfit:
        return ""
    told = ", ".join(
        f"the drive {records[record]!r} has noise of about {size:.2g}" for record, size in noisy.items()
    )
    return (
        f"{told[0].upper()}{told[1:]}, which a fit takes as exact: as much noise once more moves "
        f"{problem.coordinates.names[which]} by {most:.2g} stated errors. Smooth the drive, or measure it better."
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


def _with_more(
    e: Experiment, more: Mapping[Any, np.ndarray], guesses: Mapping[str, float], options: Mapping[str, Any]
) -> Experiment:
    """The experiment with noise added to its drives."""

    def noised(drive: Drive) -> Drive:
        times, samples, kind, derivatives = written(drive)
        return rewritten(times, samples + more.get(_record(drive), 0.0), kind, derivatives)

    content = e.system._written()
    inner = content
    while "view" in inner:
        inner = inner["of"]
    inner["drives"] = {name: noised(drive) for name, drive in inner["drives"].items()}
    system = type(e.system)._read(content)
    model = system if e.scene is None else dataclasses.replace(e.scene, system=system)
    return Experiment(dataclasses.replace(e.record, system=model), model, guesses, 1, options)
