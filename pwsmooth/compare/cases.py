"""The scenes on which methods are compared, each with a reference from an independent path.

    reference   a closed form, or two methods without common code that agree: the event-driven kernels and
                restarting.py over SciPy's DOP853
Chain: scenes, laws -> **this file** -> measuring.py, stability.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..laws.friction import Dahl, LuGre, MultistateXKY
from ..primitives import Switch
from ..scenes import block_on_belt, prescribed_motion, slider_crank, t
from ..scenes.scene import Scene
from ..solve import solve
from ..system import System
from .exact_problems import ball
from .plain import plain
from .restarting import restarted

__all__ = ["CASES", "Case", "Reference", "case_of"]

x, y, v, z, x1, x2 = sp.symbols("x y v z x1 x2", real=True)
KINDS = ("crossing", "stick", "slip", "impact")
WORST = 1e-9  # by which the two paths of a reference may differ, in units of the states' sizes


@dataclass(frozen=True)
class Reference:
    """The answer of a case: states at the ends asked for, events up to the last, and how they were found.

    Attributes
    ----------
    ends : tuple of float, s
        Times at which states are known.
    states : ndarray, shape (number of ends, n)
        In the units of the states.
    times : ndarray, shape (ne,), s
        Of the events.
    kinds : tuple of str
        Of the events: "crossing", "stick", "slip", "impact".
    source : str
        "closed form" or "two paths without common code".
    uncertainty : float, dimensionless
        Of states and times, in units of their sizes.

    Notes
    -----
    Source: defined here.

    Examples
    --------
    >>> from pwsmooth.compare import CASES
    >>> reference = CASES["relay"].reference
    >>> reference.kinds, reference.source
    (('stick',), 'closed form')
    """

    ends: tuple[float, ...]
    states: np.ndarray  # (number of ends, n)
    times: np.ndarray
    kinds: tuple[str, ...]
    source: str
    uncertainty: float  # of states and times


@dataclass(frozen=True)
class Case:
    """A scene for all methods of a comparison.

    Parameters
    ----------
    name, title : str
        For the command line and files, and in words.
    system : System
        Without noise.
    start : tuple of float
        Of all states, memories included, in their units.
    t_end : float, s
        From t = 0. Errors are taken at 0.31, 0.72 and 1 of it: a dissipative system forgets early ones.
    sizes : tuple of float
        Of the states, in their units: errors are in these units, and every method gets them in its `atol`. An error
        above a tenth is a wrong orbit.
    longest : float, s
        Bound on the step that a careful user gives methods whose events can be stepped over.
    restitution : float, dimensionless, optional
        Of the contact, if there is one.
    exact : callable, optional
        t -> exact state; without it two methods have to agree.
    counted : tuple of str
        Kinds of events that make the itinerary.

    Notes
    -----
    Source: defined here; what is known of a built-in case stands in its `reference`.

    Examples
    --------
    >>> from pwsmooth.compare import CASES
    >>> case = CASES["relay"]
    >>> case.t_end, [f"{end:.2f}" for end in case.ends]
    (4.0, ['1.24', '2.88', '4.00'])
    """

    name: str
    title: str
    system: System
    start: tuple[float, ...]
    t_end: float
    sizes: tuple[float, ...]
    longest: float
    restitution: float | None = None
    exact: Callable[[float], Sequence[float]] | None = None
    counted: tuple[str, ...] = KINDS

    def tolerances(self, rtol: float) -> dict[str, Any]:
        """Tolerances of a method, the absolute one a hundredth of the relative one at the states' sizes.

        Parameters
        ----------
        rtol : float, dimensionless
            Relative tolerance.

        Returns
        -------
        dict of str to (float or ndarray, shape (n,))
            `rtol`, dimensionless, and `atol`, in the units of the states.
        """
        return {"rtol": rtol, "atol": 1e-2 * rtol * np.array(self.sizes)}

    def apart(self, one: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of two states, or of rows of them, in units of the sizes.

        Parameters
        ----------
        one, other : ndarray, shape (n,) or (k, n)
            In the units of the states.

        Returns
        -------
        float
            Dimensionless.
        """
        return float(np.max(np.abs(np.asarray(one) - other) / np.array(self.sizes)))

    def itinerary(self, log: Iterable[tuple[float, str]]) -> list[tuple[float, str]]:
        """The events that count.

        Parameters
        ----------
        log : iterable of (float, str), s and a word
            Time and kind of every event.

        Returns
        -------
        list of (float, str), s and a word
            Those whose kind is in `counted`.
        """
        return [(time, kind) for time, kind in log if kind in self.counted]

    @property
    def ends(self) -> tuple[float, ...]:
        """Times at which errors are taken, s."""
        return tuple(share * self.t_end for share in (0.31, 0.72, 1.0))

    @functools.cached_property
    def reference(self) -> Reference:
        """Computed once.

        Raises
        ------
        RuntimeError
            The two paths disagree by more than 1e-9: neither can serve.
        """
        tight = self.tolerances(1e-13)
        own = solve(self.system, (0, self.t_end), self.start, dense_output=True, **tight)
        if not own.success:
            raise RuntimeError(f"the reference of {self.name!r} cannot be computed: {own.message}")
        log = self.itinerary((event.time, basic(event.kind)) for event in own.events)
        times = np.array([time for time, _ in log])
        mine = np.array([own(end)[: len(self.start)] for end in self.ends])
        if self.exact is not None:
            states, source = np.array([self.exact(end) for end in self.ends], float), "closed form"
            apart = self.apart(states, mine)
        else:
            functions, source = plain(self.system), "two paths without common code"
            runs = [
                restarted(functions, (0, end), np.array(self.start), max_step=self.longest, **tight)
                for end in self.ends
            ]
            states = np.array([run[0] for run in runs])
            others = self.itinerary(runs[-1][1])
            if [kind for _, kind in others] != [kind for _, kind in log]:
                raise RuntimeError(f"the two references of {self.name!r} have different events.")
            late = np.abs(times - [time for time, _ in others])
            apart = max(self.apart(states, mine), float(np.max(late, initial=0.0)))
        if not apart < WORST:
            raise RuntimeError(
                f"the two references of {self.name!r} differ by {apart:.1e}, more than {WORST:g}: neither can serve."
            )
        return Reference(self.ends, states, times, tuple(kind for _, kind in log), source, apart)


def case_of(
    scene: Scene,
    *,
    exact: Callable[[float], Sequence[float]] | None = None,
    sizes: Sequence[float] | None = None,
    longest: float | None = None,
    restitution: float | None = None,
    counted: Sequence[str] = KINDS,
    name: str = "",
    title: str = "",
    t_end: float | None = None,
) -> Case:
    """A scene as a case.

    Parameters
    ----------
    scene : Scene
        Its span begins at 0.
    exact : callable, optional
        t -> exact state, in the order of `scene.system.states`. Without it the reference is made of two
        methods that
        agree, see `Case.reference`.
    sizes : sequence of float, length n, optional
        Of the states, in their units; by default the largest values on the motion.
    longest : float, s, optional
        Bound on the steps of rivals; by default a two-hundredth of the span.
    restitution : float, dimensionless, optional
        Of the contact, if there is one.
    counted : sequence of str
        Kinds of events that make the itinerary.
    name, title : str
        The scene's by default.
    t_end : float, s, optional
        The span's end by default.

    Returns
    -------
    Case
        Its reference is computed when it is asked for.

    Raises
    ------
    ValueError
        A span that does not begin at 0.

    Notes
    -----
    Source: defined here.

    Examples
    --------
    >>> from pwsmooth.compare import case_of
    >>> from pwsmooth.laws.friction import StaticKinetic
    >>> from pwsmooth.scenes import block_on_belt
    >>> case = case_of(block_on_belt(StaticKinetic()), t_end=10.0)
    >>> case.name, case.longest
    ('block on a belt, StaticKinetic', 0.05)
    """
    begin, end = scene.t_span
    if begin != 0:
        raise ValueError(f"`scene` begins at t = {begin:g}; comparisons begin at 0, so shift its drive.")
    end = end if t_end is None else t_end
    start = tuple(scene.system.initial_state(scene.start))
    if sizes is None:
        motion = np.abs(scene.solve((0, end)).x).max(axis=1)
        sizes = np.where(motion > 0, motion, 1.0).tolist()
    return Case(name or scene.name, title or scene.name, scene.system, start, end, tuple(sizes),
                longest or end / 200, restitution, exact, tuple(counted))  # fmt: skip


def basic(kind: str) -> str:
    """Kinds of events as all methods can tell them apart; "" for those that are none to the others."""
    if kind.startswith("slip"):
        return "slip"
    return kind if kind in ("crossing", "stick", "impact", "reset") else ""


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
        self._makers = makers
        self._made: dict[str, Case] = {}

    def __getitem__(self, name: str) -> Case:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

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
        exact=_relay_state(_reaching()),
    ),
    "belt": lambda: Case("belt", "block on a belt, Stribeck friction", belt(), (0.0, 0.2), 40.0, (1, 1), 0.1),
    "chain": lambda: Case(
        "chain", "three blocks on a belt", chain(), (0.0, 0.1, 0.2, 0.0, 0.0, 0.0), 30.0, (1,) * 6, 0.1
    ),
    "ball": lambda: Case(
        "ball", "falling ball, e = 0.8", ball(sp.Rational(4, 5)), (1.0, 0.0), 3.0, (1, 1), 0.05, 0.8, _ball_state(0.8)
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
