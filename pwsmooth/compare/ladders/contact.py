"""The ladder of contact laws under one law, and how each gets its parameters from it.

    rigid impact -> Hertz with damping factor -> linear with residual indentation -> nonlinear with residual indentation

Matching, at the speed V of the scene's first impact, from a free impact of the richest law: restitution e of the
rigid one, and of Hertz's by the exact damping factor; K and exponent those of slow loading; the linear stiffness does
the same work of slow loading up to the depth p of that impact, K_1 p^2/2 = K p^(n+1)/(n+1).
Chain: laws -> rungs.py -> **contact** -> catalogue.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...door import checks
from ...laws import Law
from ...laws import contact as laws
from ...scenes import Scene, falling_ball, free_impact
from ...scenes.impact import apexes
from .observables import end_value, peak
from .rungs import Observable, Rung, Setting, top_rung

NAMES = {  # poorest first
    "RigidImpact": "rigid impact",
    "HertzImpact": "Hertz with damping",
    "LinearResidual": "linear with residual",
    "ResidualIndentation": "nonlinear with residual",
}
ORDER = tuple(NAMES)


class Impact(NamedTuple):
    """A free impact: restitution, and largest indentation (m)."""

    restitution: float
    depth: float


@functools.lru_cache(maxsize=64)
def first_impact(law: Law, speed: float, mass: float) -> Impact:
    """What a law does to a mass that meets it at `speed` with nothing else acting.

    ValueError if it does not come off: the law sticks, or takes longer than a thousand of its own periods.
    """
    # The elastic impact on the same stiffness sets the time scale.
    values = law.values
    span = 20 * laws.contact_duration(values["K"], float(values.get("n", 1)), mass, speed)
    scene = free_impact(law, speed=speed, m=mass, approach=span * speed / 100, t_span=(0.0, span))
    run = scene.solve(dense_output=True)
    contact = _contact_span(run)
    if not (run.success and contact):
        raise ValueError(
            f"`richest` holds on to a mass that meets it at {speed:g} m/s; give a law that lets it go."
        )
    depth = float(peak("", "p", "").measure(run, contact, 4001))
    return Impact(-float(run["v"][-1]) / speed, depth)


@checks.door()
def contact_rungs(richest: Law, build: Callable[[Law], Scene], speed: float, mass: float) -> list[Rung]:
    """The rungs below a contact law, poorest first, matched to it.

    Parameters
    ----------
    speed : float, m/s
        Of the impact at which they are matched, > 0.
    mass : float, kg
        Of that impact, > 0.

    Returns
    -------
    list of Rung
        Without the richest itself.

    Raises
    ------
    ValueError
        A law that stands on no rung, a speed or mass that is not positive.

    Notes
    -----
    Restitution and work of slow loading are those of a free impact of the richest law.

    >>> [rung.name for rung in contact_rungs(ResidualIndentation(), falling_ball, speed=1.0, mass=1.0)]
    ['rigid impact', 'Hertz with damping', 'linear with residual']
    """
    kind = type(richest).__name__
    if kind not in ORDER[1:]:
        raise ValueError(
            f"`richest` is {kind}, which stands on no upper rung of contact; choose one of {', '.join(ORDER[1:])}."
        )
    for name, value in (("speed", speed), ("mass", mass)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"`{name}` is {value!r}; give a number > 0.")
    match = first_impact(richest, speed, mass)
    e = f"e = {match.restitution:.5g}, of a free impact of the richest law at {speed:.4g} m/s"
    values = richest.values
    K, n = values["K"], float(values.get("n", 1))
    below: list[tuple[Law, str]] = [
        (laws.RigidImpact(e=match.restitution), e),
        (
            laws.HertzImpact(K=K, n=n, c_r=match.restitution, eta="zhang-sharf"),
            f"K = {K:.4g} and exponent {n:g} of slow loading; {e}",
        ),
    ]
    if kind == "ResidualIndentation":
        stiffness = 2 * K * match.depth ** (n - 1) / (n + 1)
        below.append((
            laws.LinearResidual(K=stiffness, beta=values["beta"], gamma=values["gamma"]),
            f"beta, gamma; K = {stiffness:.4g}, the same work of slow loading up to {match.depth:.3g} m",
        ))  # fmt: skip
    rungs = [Rung(NAMES[type(law).__name__], functools.partial(build, law), words) for law, words in below]
    return rungs[: ORDER.index(kind)]


@checks.door()
def contact_setting(
    name: str, title: str, richest: Law, build: Callable[[Law], Scene], observables: Sequence[Observable],
    *, speed: float, mass: float = 1.0, window: tuple[float, float], points: int = 8001,
) -> Setting:  # fmt: skip
    """A setting whose rungs are contact laws in one scene.

    Parameters
    ----------
    speed : float, m/s
        Of the first impact.
    mass : float, kg
        Of the first impact.

    Returns
    -------
    Setting
        For `ladder`.

    >>> wall = contact_setting("wall", "a wall", LinearResidual(), lambda law: free_impact(law, t_span=(0, 0.2)),
    ...                        [end_value("speed", "v", "m/s")], speed=1.0, window=(0.0, 0.2))
    >>> wall.richest.name, wall.observable("speed").unit
    ('linear with residual', 'm/s')
    """
    top = top_rung(NAMES, richest, build)
    return Setting(name, title, top, lambda motion: contact_rungs(richest, build, speed, mass), tuple(observables),
                   window, points)  # fmt: skip


# ---- observables of contacts ----------------------------------------------------------------------


def _contact_span(run: Any) -> tuple[float, float] | None:
    """From the first touch-down to the first lift-off; None if one of them does not occur."""
    on, off = run.event_times("reset", "touch-down"), run.event_times("reset", "lift-off")
    return (on[0], off[0]) if len(on) and len(off) else None


def _duration(motion: Any, window, points) -> float:
    if len(motion.event_times("impact")):
        return 0.0
    span = _contact_span(motion)
    return float(span[1] - span[0]) if span else math.nan


def forces(observable: Observable) -> Observable:
    """The same, but nan where the motion has impacts: their force is an impulse, of no finite size."""

    def measure(motion, window, points):
        rigid = len(motion.event_times("impact")) if hasattr(motion, "event_times") else 0
        return math.nan if rigid else observable.measure(motion, window, points)

    return Observable(observable.name, observable.unit, observable.meaning, measure)


def _apex(number):
    def measure(motion, window, points):
        heights = apexes(motion)
        return float(heights[number]) if len(heights) > number else math.nan

    return measure


def impact() -> Setting:
    """1 kg meets a wall at 1 m/s."""

    def build(law):
        return free_impact(law, speed=1.0, approach=0.01, t_span=(0.0, 0.1))

    observables = (
        Observable(
            "restitution", "1", "speed off the wall over that towards it", lambda m, w, n: -float(m(w[1], "v"))
        ),
        Observable("duration", "s", "time in contact", _duration),
        peak("top indentation", "p", "m"),
        forces(peak("top force", "force", "N")),
    )
    return contact_setting("impact", "free impact", laws.ResidualIndentation(), build, observables, speed=1.0,
                           window=(0.0, 0.1))  # fmt: skip


def falling() -> Setting:
    """1 kg dropped from 0.1 m."""
    observables = (
        Observable("first apex", "m", "height of the first rebound", _apex(0)),
        Observable("third apex", "m", "height of the third rebound", _apex(2)),
        end_value("rest", "p", "m"),
        forces(peak("top force", "force", "N")),
        peak("top indentation", "p", "m"),
    )
    speed = float(np.sqrt(2 * 9.81 * 0.1))
    return contact_setting("ball", "falling ball", laws.ResidualIndentation(beta=0.002), falling_ball, observables,
                           speed=speed, window=(0.0, 3.0), points=40001)  # fmt: skip
