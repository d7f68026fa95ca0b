"""Bodies that slide in the plane without turning: on an incline, on a shaken plate, on a spring.

    m dv/dt = u(t, x, v) - f,      f the law's force at the slip velocity, a vector

Any law of `pwsmooth.laws.friction` with a form in the plane (`Law.in_plane`) fits; with a normal load it is per unit of
load, so that Coulomb(F_c=0.3) has the coefficient 0.3.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..definition.drives import Drive
from ..door import checks
from ..laws import Law
from .drive import IN_PLANE, check_continuous, door, expression, t, value, within
from .scene import Scene, scene_of

x, y, v_x, v_y = sp.symbols("x y v_x v_y", real=True)
mass, gravity, spring, damper = sp.symbols("mass gravity spring damper", nonnegative=True)


def two(given: Any, what: str) -> tuple[Any, Any]:
    """`given` as two drives."""
    parts = checks.several(given, f"`{what}`")
    if len(parts) != 2:
        raise ValueError(f"`{what}` has {len(parts)} components; give two, (x, y).")
    first, second = (p if isinstance(p, Drive) else expression(p, what) for p in parts)
    return first, second


def _scene(name, law, force, t_span, start, *, normal=None, plate=(0, 0), place=(x, y), parameters, period=None,
           outputs=None, drives=None):  # fmt: skip
    """The scene of one body: `force` is what acts on it without friction, `plate` the velocity of what it lies on."""
    slip = (v_x - plate[0], v_y - plate[1])
    pieces = law.attach(position=place, velocity=slip, normal=normal, time=t)
    rates = {x: v_x, y: v_y}
    rates |= {w: (u - f) / mass for w, u, f in zip((v_x, v_y), force, pieces.force, strict=True)}
    shown = {"friction_x": pieces.force[0], "friction_y": pieces.force[1],
             "slip_speed": sp.sqrt(slip[0] ** 2 + slip[1] ** 2), **(outputs or {})}  # fmt: skip
    begin = dict(zip(rates, map(float, start), strict=True))
    return scene_of(name, law, t_span, rates, [pieces], (*map(str, rates), *shown, *pieces.outputs), period=period,
                    x0=begin, parameters=parameters, outputs=shown, drives=drives)  # fmt: skip


def _two_of(*names: str) -> dict[str, checks.Check]:
    return dict.fromkeys(names, checks.pair)


@door("m", law=IN_PLANE, velocity=checks.pair, slope=checks.number, g=checks.positive)
def incline(
    law: Law, *, slope: float = 0.5, velocity: Sequence[float] = (0.0, 1.0), m: float = 1.0, g: float = 9.81,
    t_span: tuple[float, float] = (0.0, 5.0),
) -> Scene:  # fmt: skip
    """A block thrown across an incline: it turns downhill while it stops.

    Parameters
    ----------
    law : Law
        Of friction in the plane, per unit of the load m g cos(slope).
    slope : float, rad
        Of the incline, below pi/2.
    velocity : (float, float), m/s
        At the start, downhill and across.

    Returns
    -------
    Scene
        States x (downhill), y (across), v_x, v_y and the law's; outputs `friction_x`, `friction_y`, `slip_speed`.

    Raises
    ------
    ValueError, TypeError
        A slope that is no incline.

    Source: Am. J. Phys. 82 (2014) 764 for its closed form under Coulomb friction.

    Thrown across at 1 m/s it stops after kappa v/(G (kappa^2 - 1)), kappa = mu/tan(slope), G = g sin(slope):

    >>> thrown = incline(Coulomb(F_c=1.5 * math.tan(0.5)), slope=0.5).solve()
    >>> print(f"{thrown.event_times('stick')[0]:.9f} {1.2 / 9.81 / math.sin(0.5):.9f}")
    0.255147357 0.255147357
    """
    if not abs(slope) < math.pi / 2:
        raise ValueError(f"`slope` is {slope:g}; give an angle in radians, below pi/2 = 1.57.")
    angle = sp.Symbol("slope", real=True)
    values = {mass: m, gravity: g, angle: slope}
    pull = (mass * gravity * sp.sin(angle), sp.S.Zero)
    return _scene("block on an incline", law, pull, t_span, (0, 0, *velocity), parameters=values,
                  normal=mass * gravity * sp.cos(angle))  # fmt: skip


@door(
    "m",
    "period",
    law=IN_PLANE,
    g=checks.positive,
    lift=checks.optional(checks.expression),
    **_two_of("tilt", "velocity"),
)
def shaken_plate(
    law: Law, plate: Any, *, lift: Any = None, tilt: Sequence[float] = (0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0), m: float = 1.0, g: float = 9.81, period: float | None = None,
    t_span: tuple[float, float] = (0.0, 20.0),
) -> Scene:  # fmt: skip
    """A body on a plate that is shaken in its plane and across it: vibratory conveyors and feeders.

    Parameters
    ----------
    law : Law
        Of friction in the plane, per unit of the load m (g + lift).
    plate : (Expr of t, Expr of t), m/s
        Velocity of the plate.
    lift : Expr of t, m/s^2, optional
        Vertical acceleration of the plate, above -g: the body stays on it.
    tilt : (float, float), dimensionless
        Slope of the plate in both directions; the body is pulled by m g times it.
    velocity : (float, float), m/s
        Of the body at the start.

    Returns
    -------
    Scene
        States x, y, v_x, v_y (of the body over the ground) and the law's; outputs `friction_x`, `friction_y`,
        `slip_speed`, `load`.

    Raises
    ------
    ValueError, TypeError
        A plate that falls faster than the body.

    Source: Winkler, Int. J. Mech. Sci. 20 (1978) 561, for vibratory conveyance.

    On a plate that moves on a circle at the speed U, faster than friction can hold it, a body goes on a circle itself,
    at the speed mu g/omega:

    >>> plate = (-2 * sp.sin(5 * t), 2 * sp.cos(5 * t))
    >>> run = shaken_plate(Coulomb(F_c=0.3), plate, t_span=(0, 40)).solve()
    >>> print(f"{(run['v_x'][-1]**2 + run['v_y'][-1]**2)**0.5:.6f} {0.3 * 9.81 / 5:.6f}")
    0.588600 0.588600
    """
    moves = two(plate, "plate")
    values = {mass: m, gravity: g}
    up = sp.S.Zero if lift is None else expression(lift, "lift")
    times = np.linspace(t_span[0], t_span[1] if period is None else t_span[0] + period, 513)
    least = min(value(up, {"t": s}, "`lift`") for s in times) if up.free_symbols else float(up)
    if not least > -g:
        raise ValueError(
            f"`lift` falls to {least:.6g}, and gravity is {g:g}: the body would leave the plate. Give less, or a "
            "contact (Unilateral) in a System of your own."
        )
    load = mass * (gravity + up)
    slopes = sp.symbols("tilt_x tilt_y", real=True)
    values |= dict(zip(slopes, tilt, strict=True))
    pull = tuple(mass * gravity * s for s in slopes)
    place = (x, y) if not any(moves) else None
    return _scene("body on a shaken plate", law, pull, t_span, (0, 0, *velocity), parameters=values, normal=load,
                  plate=moves, period=period, place=place, outputs={"load": load})  # fmt: skip


@door("m", law=IN_PLANE, **dict.fromkeys(("lean", "heading"), checks.number), tilt=checks.pair,
      **dict.fromkeys(("stroke", "omega", "g"), checks.positive))  # fmt: skip
def bristle_bot(
    law: Law, *, lean: float = 0.5, stroke: float = 1e-3, omega: float = 90.0, heading: float = 0.0,
    tilt: Sequence[float] = (0.0, 0.0), m: float = 0.01, g: float = 9.81, t_span: tuple[float, float] = (0.0, 5.0),
) -> Scene:  # fmt: skip
    """A brush with a motor: bristles that lean push it forward as it shakes up and down on them.

    A body at the height stroke sin(omega t) over stiff bristles that lean by an angle: their tips slide at
    v - tan(lean) times its vertical velocity, along the heading, under the load m (g + vertical acceleration). It is
    the vibratory conveyor, seen from what is conveyed.

    Parameters
    ----------
    law : Law
        Of friction in the plane, per unit of the load.
    lean : float, rad
        Of the bristles, below pi/2 either way.
    stroke : float, m
        Amplitude of the shaking; stroke omega^2 is less than gravity.
    omega : float, rad/s
        Of the motor.
    heading : float, rad
        Direction of the lean in the plane.
    tilt : (float, float), dimensionless
        Slope of the ground in both directions; the body is pulled by m g times it.

    Returns
    -------
    Scene
        As `shaken_plate`; its `slip_speed` is that of the tips.

    Raises
    ------
    ValueError, TypeError
        Bristles that lie; a body that jumps.

    Source: Cicconofri and DeSimone, Int. J. Non-Linear Mech. 76 (2015) 233, for the mechanism; rigid bristles here.

    It goes along its heading, and with the other lean against it:

    >>> print(*(f"{bristle_bot(Coulomb(F_c=0.3), lean=lean).solve()['x'][-1]:.4f}" for lean in (0.5, -0.5)))
    0.1014 -0.1014
    """
    if not abs(lean) < math.pi / 2:
        raise ValueError(f"`lean` is {lean:g}; give an angle in radians, below pi/2 = 1.57.")
    height = stroke * sp.sin(omega * t)
    tips = sp.Float(math.tan(lean)) * height.diff(t)
    plate = (tips * math.cos(heading), tips * math.sin(heading)) if heading else (tips, 0)
    return dataclasses.replace(
        shaken_plate(
            law, plate, lift=height.diff(t, 2), tilt=tilt, m=m, g=g, period=2 * math.pi / omega, t_span=t_span
        ),
        name=f"bristle-bot, {type(law).__name__}",
    )


@door(
    "m", "period", law=IN_PLANE, **dict.fromkeys(("k", "c"), checks.nonnegative), **_two_of("start", "velocity")
)
def planar_oscillator(
    law: Law, force: Any, *, k: float = 1.0, c: float = 0.0, m: float = 1.0, start: Sequence[float] = (0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0), normal: Any = None, period: float | None = None,
    t_span: tuple[float, float] | None = None,
) -> Scene:  # fmt: skip
    """A mass on a spring in the plane under a force with two components: also a sliding bearing under an earthquake.

    Parameters
    ----------
    force : (Expr of t or Drive, Expr of t or Drive), N
        Its components; of ground that accelerates by a, -m a.
    k : float, N/m
        Spring, the same in all directions.
    start, velocity : (float, float), m and m/s
        At the start.
    t_span : (float, float), s, optional
        (0, 30), or that of the record.

    Returns
    -------
    Scene
        States x, y, v_x, v_y and the law's; outputs `friction_x`, `friction_y`, `slip_speed`.

    Source: Griffin and Menq, J. Vib. Acoust. 113 (1991) 225, for circular forcing.

    Under a circular force, larger than friction, the mass goes on a circle of radius sqrt(P^2 - F_c^2)/|k - m omega^2|:

    >>> scene = planar_oscillator(Coulomb(F_c=0.6), (sp.cos(2 * t), sp.sin(2 * t)), t_span=(0, 60))
    >>> run = scene.solve()
    >>> print(f"{(run['x'][-1]**2 + run['y'][-1]**2)**0.5:.6f} {0.8 / 3:.6f}")
    0.266667 0.266667
    """
    parts = two(force, "force")
    span = (
        (0.0, 30.0)
        if t_span is None and not any(isinstance(p, Drive) for p in parts)
        else within(t_span, *parts)
    )
    drives, pushes = {}, []
    for axis, part in zip("xy", parts, strict=True):
        if isinstance(part, Drive):
            symbol = sp.Symbol(f"u_{axis}", real=True)
            drives[symbol] = part
            part = symbol
        pushes.append(part)
    values = {mass: m, spring: k}
    pull = [-spring * q for q in (x, y)]
    if c:
        values[damper] = c
        pull = [p - damper * w for p, w in zip(pull, (v_x, v_y), strict=True)]
    forces = [p + u for p, u in zip(pull, pushes, strict=True)]
    load = None if normal is None else expression(normal, "normal")
    shown = {} if drives else dict(zip(("u_x", "u_y"), pushes, strict=True))
    return _scene("planar oscillator", law, forces, span, (*start, *velocity), parameters=values, normal=load,
                  period=period, drives=drives, outputs=shown)  # fmt: skip


@door("m", "period", law=IN_PLANE, **dict.fromkeys(("k", "c"), checks.nonnegative), start=checks.pair)
def pulled_block(
    law: Law, path: Any, *, plate: Any = (0, 0), k: float = 1.0, c: float = 0.0, m: float = 1.0,
    start: Sequence[float] = (0.0, 0.0), normal: Any = None, period: float | None = None,
    t_span: tuple[float, float] = (0.0, 20.0),
) -> Scene:  # fmt: skip
    """A block on a spring whose end goes along a path: around a corner, or over a plate that vibrates.

    Parameters
    ----------
    path : (Expr of t, Expr of t), m
        The end of the spring.
    plate : (Expr of t, Expr of t), m/s
        Velocity of the plate on which the block lies.
    k : float, N/m
        Spring, of no length when relaxed.
    c : float, N s/m
        Damper beside it.
    start : (float, float), m
        Place of the block, at rest.

    Returns
    -------
    Scene
        States x, y, v_x, v_y and the law's; outputs `friction_x`, `friction_y`, `slip_speed`, `pull_x`, `pull_y` (the
        force of the spring).

    Source: derived here; the friction under a plate that vibrates is that of Gutowski and Leus, and of Popov's group,
    Front. Mech. Eng. 6:69 (2020).

    A light block follows around a corner on a tractrix: the tangent of half the angle of the spring falls with
    exp(-s/L) where the end has gone s, L = F_c/k:

    >>> start = (-math.sin(1.5), -math.cos(1.5))
    >>> corner = pulled_block(Coulomb(F_c=1.0), (0, t), start=start, m=1e-5, t_span=(0, 2)).solve()
    >>> print(f"{corner['x'][-1]:.3f} {-math.sin(2 * math.atan(math.tan(0.75) * math.exp(-2))):.3f}")
    -0.248 -0.248
    """
    end, moves = two(path, "path"), two(plate, "plate")
    for part in end:
        check_continuous(part, "path", t_span, {})
    values = {mass: m, spring: k}
    pull = [spring * (e - q) for e, q in zip(end, (x, y), strict=True)]
    if c:
        values[damper] = c
        pull = [p + damper * (e.diff(t) - w) for p, e, w in zip(pull, end, (v_x, v_y), strict=True)]
    load = None if normal is None else expression(normal, "normal")
    place = (x, y) if not any(moves) else None
    return _scene("pulled block", law, pull, t_span, (*start, 0, 0), parameters=values, normal=load, plate=moves,
                  period=period, place=place, outputs={"pull_x": pull[0], "pull_y": pull[1]})  # fmt: skip
