"""The scenes on which methods are compared: smooth, sliding, stiff, of several states, with impacts.

Chain: scenes, laws, case.py -> **this file** -> measuring.py, hazards.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping

import sympy as sp

from ...definition.primitives import Switch
from ...laws.friction import Dahl, LuGre, MultistateXKY
from ...scenes import block_on_belt, prescribed_motion, slider_crank, t
from ...system import System
from ..exact.catalogue import ball
from .case import Case, case_of

__all__ = ["CASES"]

x, y, v, z, x1, x2 = sp.symbols("x y v z x1 x2", real=True)
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


def _relay_state() -> Callable[[float], tuple[float, ...]]:
    """On the surface, from where it is reached from (1, 0), under x2' = sin(3 t)/2 - 2."""

    def state(s):
        speed = -2 * s + (1 - math.cos(3 * s)) / 6
        return 1 - s * s + s / 6 - math.sin(3 * s) / 18, speed

    s = 0.5
    for _ in range(50):
        position, speed = state(s)
        s -= (position + speed) / (speed + math.sin(3 * s) / 2 - 2)
    reached = state(s)[0]
    return lambda time: (reached * math.exp(s - time), -reached * math.exp(s - time))


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


def _dahl_state(amplitude: float, stiffness: float, force: float) -> Callable[[float], tuple[float, ...]]:
    """Dahl's law under x = amplitude sin t from rest: an exponential in x between reversals."""

    def state(time):
        side, place, z = 1, 0.0, 0.0
        turn = math.pi / 2

        def moved(there):
            level = side * force / stiffness
            return level + (z - level) * math.exp(-side * stiffness / force * (there - place))

        while turn < time:
            z = moved(side * amplitude)
            place, side, turn = side * amplitude, -side, turn + math.pi
        there = amplitude * math.sin(time)
        return there, moved(there)

    return state


TURN = 2 * math.pi


class _Cases(Mapping[str, Case]):
    """The built-in cases, each made when it is first asked for."""

    def __init__(self, makers: dict[str, Callable[[], Case]]) -> None:
        self._makers = {name: functools.cache(maker) for name, maker in makers.items()}

    def __getitem__(self, name: str) -> Case:
        return self._makers[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)


#: The cases by name, each made when it is asked for.
CASES = _Cases({
    "crossing": lambda: Case(
        "crossing", "friction oscillator, crossing (ρ = 0)", oscillator(2.4), (0.5, 0.3), 10 * TURN, (1, 1), 0.3
    ),
    "sticking": lambda: Case(
        "sticking", "friction oscillator, sticking (ρ = 0)", oscillator(1.2), (0.5, 0.3), 10 * TURN, (1, 1), 0.3
    ),
    "hidden": lambda: Case(
        "hidden", "oscillator, static friction (ρ = 3, β = 0.1)", oscillator(2.4, 3), (0.6, -1.07, 0.0), 5 * TURN,
        (1, 1, 1), 0.05,
    ),
    "relay": lambda: Case(
        "relay", "relay control, long sliding", relay_control(), (1.0, 0.0), 4.0, (1, 1), 0.1,
        exact=_relay_state(),
    ),
    "belt": lambda: Case("belt", "block on a belt, Stribeck friction", belt(), (0.0, 0.2), 40.0, (1, 1), 0.1),
    "chain": lambda: Case(
        "chain", "three blocks on a belt", chain(), (0.0, 0.1, 0.2, 0.0, 0.0, 0.0), 30.0, (1,) * 6, 0.1
    ),
    "ball": lambda: Case(
        "ball", "falling ball, e = 0.8", ball(sp.Rational(4, 5)), (1.0, 0.0), 3.0, (1, 1), 0.05, _ball_state(0.8)
    ),
    "lugre": lambda: case_of(
        block_on_belt(LuGre()), sizes=(1, 0.1, 1e-5), longest=0.1, t_end=12.0, name="lugre",
        title="LuGre stick-slip (stiff)",
    ),
    "dahl": lambda: case_of(
        prescribed_motion(Dahl(), position=3e-5 * sp.sin(t), t_span=(0, 20)), sizes=(3e-5, 1e-5), longest=0.3,
        exact=_dahl_state(3e-5, 1e5, 1.0), name="dahl", title="Dahl rig, hysteresis",
    ),
    "multistate": lambda: case_of(
        prescribed_motion(MultistateXKY(), velocity=10 * sp.cos(TURN * t)), sizes=(1,) * 12, longest=0.02,
        name="multistate", title="multistate rig, ten elements",
    ),
    "slider-crank": lambda: case_of(
        slider_crank(tangential=None, clearance=1e-3), sizes=(1e-3, 1e-3, 0.3, 0.3, 0.1, 1), longest=2e-4, t_end=0.05,
        counted=("reset",), name="slider-crank", title="slider-crank with clearance, four contacts",
    ),
})  # fmt: skip
