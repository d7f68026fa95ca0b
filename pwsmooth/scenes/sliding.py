"""Bodies that slide: a mass with friction under a force, on a spring, in an oscillator, under a controller.

    m dv/dt = u(t, x, v) - f,      f the friction law's force at the velocity v

Any law fits any scene; one that depends on the acceleration makes it an unknown of the equation of motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..definition.drives import Drive
from ..definition.primitives import Algebraic
from ..door import checks
from ..laws import Law
from . import sketches
from .drive import OF_FRICTION, door, expression, t, within
from .scene import Scene, scene_of

x, v, e, y, i, a = sp.symbols("x v elongation y integral acceleration", real=True)
mass, spring, damper = sp.symbols("mass spring damper", nonnegative=True)


def _scene(name, law, drive, rates, start, t_span, *, position=x, normal=None, parameters, period=None, outputs=None,
           drives=None, sketch=None):  # fmt: skip
    """The scene of one body: `drive` is the force on it without friction."""
    checks.positive(parameters.get("mass", parameters.get(mass, 1.0)), "`mass`")
    load = None if normal is None else expression(normal, "normal")
    needs = "acceleration" in law.needs
    pieces = law.attach(position=position, velocity=v, acceleration=a if needs else None, normal=load, time=t)
    rates = {**rates, v: a if needs else (drive - pieces.force) / mass}
    unknowns = [Algebraic(a, mass * a + pieces.force - drive)] if needs else []
    shown = {"friction": pieces.force, "drive": drive, **(outputs or {})}
    return scene_of(
        name, law, t_span, rates, [pieces], (*map(str, rates), *shown, *pieces.outputs), period=period,
        x0=start, parameters=parameters, outputs=shown, algebraic=unknowns, drives=drives, sketch=sketch,
    )  # fmt: skip


def _reach(law, k):
    """How far a spring is pulled by the law's largest force, nearly."""
    forces = [getattr(law, name, None) for name, unit in law.units().items() if unit == "N"]
    return max((abs(f) for f in forces if isinstance(f, (int, float))), default=1.0) / (abs(k) or 1.0) or 1.0


@door("m", "period", "parameters", law=OF_FRICTION)
def force_driven(
    law: Law, force: Any, *, m: float = 1.0, normal: Any = None, t_span: tuple[float, float] | None = None,
    period: float | None = None, parameters: Mapping[Any, float] | None = None,
) -> Scene:  # fmt: skip
    """A mass under a force u(t): presliding, break-away, drift.

    Parameters
    ----------
    force : Expr of t or Drive
        u, N.
    t_span : (float, float), s, optional
        (0, 1), or that of the record.

    Returns
    -------
    Scene
        States x, v and the law's; outputs `friction`, `drive`, and those of the law.

    Raises
    ------
    ValueError, TypeError
        A mass that is not positive; a force that is no expression; a span beyond the record.

    Notes
    -----
    m dv/dt = u - f.

    Coulomb friction holds a force below F_c:

    >>> pushed = force_driven(Coulomb(F_c=1.0), 0.5 * t, t_span=(0, 4)).solve()
    >>> [f"{event.kind} at {event.time:.6f}" for event in pushed.events]
    ['slip by tangency at 2.000000']
    """
    values = {mass: m, **(parameters or {})}
    t_span = within(t_span, force)
    u, drives = sp.Symbol("u", real=True), {}
    if isinstance(force, Drive):
        drives = {u: force}
    else:
        u = expression(force, "force")
    return _scene("force-driven mass", law, u, {x: v}, {x: 0.0, v: 0.0}, t_span, normal=normal, period=period,
                  parameters=values, drives=drives)  # fmt: skip


@door("m", law=OF_FRICTION, **dict.fromkeys(("k", "pull", "c"), checks.number))
def block_on_belt(
    law: Law, *, k: float = 2.0, pull: float = 0.1, m: float = 1.0, c: float = 0.0, normal: Any = None,
    t_span: tuple[float, float] = (0.0, 35.0),
) -> Scene:  # fmt: skip
    """A block pulled over the ground by a spring whose end moves at constant speed; also a block on a belt.

    The two are one system: on a belt that moves at `pull` the block stands at y = -elongation. The equations are
    autonomous in the elongation e = pull t - x of the spring and the slip velocity v.

    Parameters
    ----------
    pull : float, m/s
        Speed of the spring's end or of the belt.
    c : float, N s/m
        Damper, of the elongation's rate.

    Returns
    -------
    Scene
        States `elongation`, v and the law's; outputs `x`, `friction`, `drive`, and those of the law.

    Source: the stick-slip test of the friction laws' papers, as of Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE
    TAC 40 (1995) 419-425; the law has its own.

    The spring stretches until its force is that of static friction:

    >>> solution = block_on_belt(StaticKinetic(F_s=1.5), k=2.0).solve()
    >>> print(f"{2.0 * solution['elongation'][solution.t <= solution.event_times('slip')[0]].max():.6f} N")
    1.500000 N
    """
    speed = sp.Symbol("pull", real=True)
    values = {mass: m, spring: k, speed: pull}
    stretch = spring * e
    if c:
        values[damper] = c
        stretch += damper * (speed - v)
    return _scene("block on a belt", law, stretch, {e: speed - v}, {e: 0.0, v: 0.0}, t_span, normal=normal,
                  position=speed * t - e, parameters=values, outputs={"x": speed * t - e},
                  sketch=sketches.block_on_belt(e, speed, _reach(law, k), "lam"))  # fmt: skip


@door("m", "x0", law=OF_FRICTION, **dict.fromkeys(("k", "c", "amplitude", "omega"), checks.number))
def friction_oscillator(
    law: Law, *, k: float = 3.1, c: float = 0.1, m: float = 1.0, amplitude: float = 2.4, omega: float = 1.0,
    normal: Any = None, t_span: tuple[float, float] = (0.0, 60.0), x0: tuple[float, float] = (0.5, 0.3),
) -> Scene:  # fmt: skip
    """A mass on a spring under -amplitude sin(omega t), with any law in place of the hidden one.

    Parameters
    ----------
    law : Law
        `HiddenStatic` gives the oscillator of the solid-friction paper.
    x0 : (float, float), m and m/s
        Displacement and velocity.

    Returns
    -------
    Scene
        States y, v and the law's; outputs `friction`, `drive`, and those of the law.

    Source: Jeffrey, On the mathematical basis of solid friction, sec. 2, whose parameters are the defaults; the law
    has its own.

    >>> solution = friction_oscillator(HiddenStatic(rho=3.0, beta=0.1)).solve()
    >>> "stick (lam sliding)" in solution.itinerary
    True
    """
    strength, frequency = sp.symbols("amplitude omega", nonnegative=True)
    values = {mass: m, spring: k, damper: c, strength: amplitude, frequency: omega}
    drive = -strength * sp.sin(frequency * t) - spring * y - damper * v
    begin = dict(zip((y, v), x0))
    period = 2 * math.pi / omega if omega else None
    reach = max(abs(amplitude / k) if k else 0.0, abs(x0[0]), 0.1)
    return _scene("friction oscillator", law, drive, {y: v}, begin, t_span, position=y, normal=normal,
                  parameters=values, period=period,
                  sketch=sketches.block_on_spring(y, reach, abs(amplitude) or 1.0, "lam"))  # fmt: skip


@door(
    "m", law=OF_FRICTION, **dict.fromkeys(("target", "proportional", "derivative", "integral"), checks.number)
)
def position_control(
    law: Law, *, target: float = 1.0, proportional: float = 3.0, derivative: float = 6.0, integral: float = 4.0,
    m: float = 1.0, normal: Any = None, t_span: tuple[float, float] = (0.0, 100.0),
) -> Scene:  # fmt: skip
    """A mass under a PID controller: u = -k_d v - k_p (x - target) - k_i integral(x - target).

    Parameters
    ----------
    target : float, m
        Wanted position.
    proportional : float, N/m
        Gain k_p.
    derivative : float, N s/m
        Gain k_d.
    integral : float, units of N/(m s)
        Gain k_i.

    Returns
    -------
    Scene
        States x, `integral`, v and the law's; outputs `friction`, `drive`, and those of the law.

    Source: the hunting test of Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419-425; the law
    has its own.

    With static friction above the kinetic one the position hunts around its target:

    >>> solution = position_control(StaticKinetic(F_s=1.5), t_span=(0.0, 50.0)).solve()
    >>> len(solution.event_times("slip")) > 1
    True
    """
    goal = sp.Symbol("target", real=True)
    k_p, k_d, k_i = sp.symbols("k_p k_d k_i", nonnegative=True)
    values = {mass: m, goal: target, k_p: proportional, k_d: derivative, k_i: integral}
    drive = -k_d * v - k_p * (x - goal) - k_i * i
    return _scene("PID position control", law, drive, {x: v, i: x - goal}, {x: 0.0, i: 0.0, v: 0.0}, t_span,
                  normal=normal, parameters=values)  # fmt: skip
