"""The scenes on which methods are compared, each with a reference from an independent path.

    reference   a closed form, or two methods without common code that agree: the event-driven kernels and
                restarting.py over SciPy's DOP853
Chain: scenes, laws -> **this file** -> work_precision.py, stability.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy as sp

from ..primitives import Switch
from ..solve import solve
from ..system import System
from .exact_problems import ball
from .plain import plain
from .restarting import restarted

__all__ = ["CASES", "Case", "Reference"]

t, x, y, v, z, x1, x2 = sp.symbols("t x y v z x1 x2", real=True)


@dataclass(frozen=True)
class Reference:
    """State at the ends asked for, events up to the last, and how they were found."""

    ends: tuple[float, ...]
    states: np.ndarray  # (number of ends, n)
    times: np.ndarray
    kinds: tuple[str, ...]
    source: str
    uncertainty: float  # of states and times


@dataclass(frozen=True)
class Case:
    """A scene for all methods.

    Parameters
    ----------
    name, title : str
    system : System
    start : tuple of float
    t_end : float
        From t = 0. Errors are taken at 0.31, 0.72 and 1 of it: a dissipative system forgets early ones.
    scale : float
        Size of the states: an error of a tenth of it is a wrong orbit.
    longest : float
        Bound on the step that a careful user gives methods whose events can be stepped over.
    restitution : float, optional
        Of the contact, if there is one.
    states_closed : callable, optional
        t -> exact state.
    """

    name: str
    title: str
    system: System
    start: tuple[float, ...]
    t_end: float
    scale: float
    longest: float
    restitution: float | None = None
    states_closed: Callable[[float], tuple[float, ...]] | None = None

    @property
    def ends(self) -> tuple[float, ...]:
        return tuple(share * self.t_end for share in (0.31, 0.72, 1.0))

    @functools.cached_property
    def reference(self) -> Reference:
        """Computed once.

        Raises
        ------
        RuntimeError
            The two paths disagree by more than 1e-9: neither can serve.
        """
        tight = dict(rtol=1e-13, atol=1e-15)
        own = solve(self.system, (0, self.t_end), self.start, dense_output=True, **tight)
        log = [(event.time, basic(event.kind)) for event in own.events if basic(event.kind)]
        mine = np.array([own(end)[: len(self.start)] for end in self.ends])
        if self.states_closed is not None:
            states, source = np.array([self.states_closed(end) for end in self.ends]), "closed form"
            times = np.array([time for time, _ in log])
            apart = float(np.max(np.abs(states - mine)))
        else:
            functions = plain(self.system)
            runs = [
                restarted(functions, (0, end), np.array(self.start), max_step=self.longest, **tight)
                for end in self.ends
            ]
            states, source = np.array([run[0] for run in runs]), "two paths without common code"
            others = [time for time, kind in runs[-1][1]]
            if [kind for _, kind in runs[-1][1]] != [kind for _, kind in log]:
                raise RuntimeError(f"the two references of {self.name!r} have different events.")
            times = np.array([time for time, _ in log])
            apart = max(
                float(np.max(np.abs(states - mine))), float(np.max(np.abs(times - others), initial=0.0))
            )
        if apart > 1e-9:
            raise RuntimeError(f"the two references of {self.name!r} differ by {apart:.1e}.")
        return Reference(self.ends, states, times, tuple(kind for _, kind in log), source, apart)


def basic(kind: str) -> str:
    """Kinds of events as all methods can tell them apart; "" for those that are none to the others."""
    if kind.startswith("slip"):
        return "slip"
    return kind if kind in ("crossing", "stick", "impact") else ""


# ---- the scenes

lam = Switch("lam", v)


def oscillator(sigma: float, rho: float = 0.0, beta: float = 0.1) -> System:
    """The friction oscillator k = 3.1, c = 0.1, N = 1, omega = 1."""
    drive = -sigma * sp.sin(t) - sp.Rational(31, 10) * y - v / 10
    if not rho:
        return System({y: v, v: drive - lam}, time=t)
    return System({y: v, v: drive - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, time=t)


def relay_control() -> System:
    """A double integrator held on x + v = 0 by a relay, under a disturbance: one reaching phase, then sliding."""
    relay = Switch("relay", x1 + x2)
    return System({x1: x2, x2: sp.sin(3 * t) / 2 - 2 * relay}, time=t)


def _relay_state(reached: tuple[float, float]) -> Callable[[float], tuple[float, ...]]:
    start, position = reached
    return lambda time: (position * math.exp(start - time), -position * math.exp(start - time))


def _reaching() -> tuple[float, float]:
    """Time and position at which the relay's surface is reached from (1, 0), where x2' = sin(3 t)/2 - 2."""

    def state(s):
        speed = -2 * s + (1 - math.cos(3 * s)) / 6
        return 1 - s * s + s / 6 - math.sin(3 * s) / 18, speed

    s = 0.5
    for _ in range(50):
        position, speed = state(s)
        s -= (position + speed) / (speed + math.sin(3 * s) / 2 - 2)
    return s, state(s)[0]


def belt(speed: float = 0.5) -> System:
    """A block on a belt under Stribeck friction, F = lam (1 + exp(-4 w^2)/2): stick-slip."""
    grip = Switch("grip", v - speed)
    return System({x: v, v: -x - grip * (1 + sp.exp(-4 * (v - speed) ** 2) / 2)})


def chain() -> System:
    """Three blocks on a belt, coupled by springs, each with Coulomb friction of its own strength."""
    q, w = sp.symbols("q1:4", real=True), sp.symbols("w1:4", real=True)
    rates: dict = dict(zip(q, w))
    for i in range(3):
        left = q[i] - (q[i - 1] if i else 0)
        right = q[i] - q[i + 1] if i < 2 else 0
        grip = Switch(f"grip{i + 1}", w[i] - sp.Rational(1, 2))
        rates[w[i]] = -left - right - w[i] / 20 - (1 + sp.Rational(i, 5)) * grip
    return System(rates)


def _ball_state(restitution: float) -> Callable[[float], tuple[float, ...]]:
    """A ball from 1 m, bounce after bounce; (0, 0) after the last."""

    def state(time):
        fall = math.sqrt(2 / 9.81)
        begin, speed = fall, restitution * 9.81 * fall
        if time <= fall:
            return 1 - 9.81 / 2 * time**2, -9.81 * time
        while speed > 1e-17:
            flight = 2 * speed / 9.81
            if time <= begin + flight:
                s = time - begin
                return speed * s - 9.81 / 2 * s * s, speed - 9.81 * s
            begin, speed = begin + flight, restitution * speed
        return 0.0, 0.0

    return state


TURN = 2 * math.pi
CASES = {
    case.name: case
    for case in (
        Case("crossing", "friction oscillator, crossing (rho = 0)", oscillator(2.4), (0.5, 0.3), 10 * TURN, 1.0, 0.3),
        Case("sticking", "friction oscillator, sticking (rho = 0)", oscillator(1.2), (0.5, 0.3), 10 * TURN, 1.0, 0.3),
        Case("hidden", "friction oscillator with static friction (rho = 3, beta = 0.1)", oscillator(2.4, 3),
             (0.6, -1.07, 0.0), 5 * TURN, 1.0, 0.05),
        Case("relay", "relay control, long sliding", relay_control(), (1.0, 0.0), 4.0, 1.0, 0.1,
             states_closed=_relay_state(_reaching())),
        Case("belt", "block on a belt, Stribeck friction", belt(), (0.0, 0.2), 40.0, 1.0, 0.1),
        Case("chain", "three blocks on a belt", chain(), (0.0, 0.1, 0.2, 0.0, 0.0, 0.0), 30.0, 1.0, 0.1),
        Case("ball", "falling ball, e = 0.8", ball(sp.Rational(4, 5)), (1.0, 0.0), 3.0, 1.0, 0.05, 0.8,
             _ball_state(0.8)),
    )
}  # fmt: skip
