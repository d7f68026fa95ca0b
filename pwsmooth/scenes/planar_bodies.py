"""Bodies that slide in the plane and turn, and two on each other: discs, balls, a caster, what a gripper holds, stacks.

The slip velocity is that of the body's material at the contact: of a ball v + omega x r, of what is gripped its
velocity at the pad, and of a contact with an area the spin is its third component.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import sympy as sp

from ..door import checks
from ..laws import Law
from .drive import IN_PLANE, SPINNING, door, expression, t
from .planar import mass, two, v_x, v_y, x, y
from .scene import Scene, scene_of

turn, spin, omega_x, omega_y = sp.symbols("turn spin omega_x omega_y", real=True)
about = sp.Symbol("inertia", positive=True)


@door("m", law=SPINNING, velocity=checks.pair, spin=checks.number, inertia=checks.positive, push=checks.numbers)
def spinning_disc(
    law: Law, *, velocity: Sequence[float] = (1.0, 0.0), spin: float = 1.0, m: float = 1.0, inertia: float = 0.5,
    push: Sequence[float] = (0.0, 0.0, 0.0), t_span: tuple[float, float] = (0.0, 5.0),
) -> Scene:  # fmt: skip
    """A disc that slides and spins on a plane: a puck, a coaster; a curling stone, whose ring has a `tilt`.

    Parameters
    ----------
    law : Law
        `Contensou` or `LimitEllipsoid`, of a contact that spins.
    spin : float, rad/s
        At the start.
    inertia : float, kg m^2
        Moment of inertia about the axis; m R^2/2 of a uniform disc.
    push : (float, float, float), N, N and N m
        Constant force and moment.

    Returns
    -------
    Scene
        States x, y, `turn` (the angle), v_x, v_y, `spin`; outputs `friction_x`, `friction_y`, `moment`.

    Raises
    ------
    ValueError, TypeError
        A law of a contact that does not spin.

    Source: Farkas, Bartels, Unger, Wolf, PRL 90 (2003) 248302: slide and spin of a uniform disc stop together.

    >>> thrown = spinning_disc(Contensou(), velocity=(1, 0), spin=0.25).solve()
    >>> print(f"{thrown.event_times('stick')[0]:.9f}")
    1.040528902
    """
    if len(push) != 3:
        raise ValueError(f"`push` has {len(push)} components; give two forces and a moment.")
    rate = sp.Symbol("spin", real=True)  # `spin` is its start here
    pieces = law.attach(velocity=(v_x, v_y, rate))
    pushes = sp.symbols("push_x push_y push_turn", real=True)
    rates = {x: v_x, y: v_y, turn: rate} | {
        w: (u - f) / inert
        for w, u, f, inert in zip((v_x, v_y, rate), pushes, pieces.force, (mass, mass, about), strict=True)
    }
    shown = dict(zip(("friction_x", "friction_y", "moment"), pieces.force, strict=True))
    begin = dict(zip(rates, (0.0, 0.0, 0.0, *map(float, velocity), float(spin)), strict=True))
    return scene_of("spinning disc", law, t_span, rates, [pieces], (*map(str, rates), *shown), x0=begin,
                    parameters={mass: m, about: inertia} | dict(zip(pushes, map(float, push), strict=True)),
                    outputs=shown)  # fmt: skip


@door(
    "m",
    law=SPINNING,
    grip=checks.expression,
    arm=checks.number,
    **dict.fromkeys(("inertia", "g"), checks.positive),
)
def gripped_bar(
    law: Law, grip: Any, *, arm: float = 0.05, m: float = 1.0, inertia: float = 0.01, g: float = 9.81,
    t_span: tuple[float, float] = (0.0, 2.0),
) -> Scene:  # fmt: skip
    """A bar that a gripper holds beside its centre of mass: it slips and turns as the grip loosens.

    Parameters
    ----------
    law : Law
        `LimitEllipsoid` of the pad, per unit of the grip's force; `Contensou` for the slip alone, not for the hold.
    grip : Expr of t, N
        Force of the grip, > 0.
    arm : float, m
        Distance of the centre of mass from the pad, at the start horizontal.
    inertia : float, kg m^2
        Moment of inertia about the centre of mass.
    g : float, m/s^2
        Gravity, along -y.

    Returns
    -------
    Scene
        States x, y (the centre of mass, the pad at 0), `turn`, v_x, v_y, `spin`; outputs `friction_x`, `friction_y`,
        `moment`.

    Raises
    ------
    ValueError, TypeError
        A law of a contact that does not spin.

    Source: limit surfaces of grasps, Howe and Cutkosky, Int. J. Robotics Research 15 (1996) 531.

    An ellipsoid holds m g and m g arm together up to grip mu = m g sqrt(1 + (arm/(k R))^2):

    >>> pad = LimitEllipsoid(F_c=0.5, R=0.03)
    >>> run = gripped_bar(pad, 80 - 20 * t, t_span=(0, 1.5)).solve()
    >>> print(f"{80 - 20 * run.events[0].time:.6f} {9.81 / 0.5 * (1 + (0.05 / 0.02)**2)**0.5:.6f}")
    52.828467 52.828467
    """
    load = expression(grip, "grip")
    weight = sp.Symbol("gravity", nonnegative=True)
    slip = (v_x + spin * y, v_y - spin * x, spin)
    pieces = law.attach(velocity=slip, normal=load, time=t)
    F_x, F_y, M = pieces.force
    rates = {x: v_x, y: v_y, turn: spin, v_x: -F_x / mass, v_y: -weight - F_y / mass,
             spin: (x * F_y - y * F_x - M) / about}  # fmt: skip
    shown = dict(zip(("friction_x", "friction_y", "moment"), pieces.force, strict=True))
    begin = dict.fromkeys(rates, 0.0) | {x: arm}
    return scene_of("gripped bar", law, t_span, rates, [pieces], (*map(str, rates), *shown), x0=begin,
                    parameters={mass: m, about: inertia, weight: g}, outputs=shown)  # fmt: skip


@door(
    "m", law=IN_PLANE, velocity=checks.pair, spins=checks.pair, rolling=checks.optional(IN_PLANE),
    **dict.fromkeys(("radius", "inertia", "g"), checks.positive),
)  # fmt: skip
def billiard_ball(
    law: Law, *, velocity: Sequence[float] = (1.0, 0.0), spins: Sequence[float] = (0.0, 0.0), radius: float = 1.0,
    m: float = 1.0, inertia: float = 0.4, g: float = 9.81, rolling: Law | None = None,
    t_span: tuple[float, float] = (0.0, 2.0),
) -> Scene:  # fmt: skip
    """A ball thrown with a spin: it slides along a parabola until it rolls; a wheel with slip in the plane.

    Parameters
    ----------
    law : Law
        Of friction in the plane, per unit of the load m g.
    spins : (float, float), rad/s
        About the two horizontal axes, at the start; rolling without slip is (-v_y, v_x)/radius.
    radius : float, m
        Of the ball.
    inertia : float, kg m^2
        Moment of inertia, 2/5 m R^2 of a full ball.
    rolling : Law, optional
        Resistance against rolling, of the two spins, per unit of the load.

    Returns
    -------
    Scene
        States x, y, v_x, v_y, omega_x, omega_y and the laws'; outputs `slip_x`, `slip_y`.

    Source: Coriolis 1835, for the parabola and the velocity of rolling, v - slip/(1 + m R^2/I).

    A full ball without a spin rolls at 5/7 of its speed, after 2/7 of it over mu g:

    >>> run = billiard_ball(Coulomb(F_c=0.2)).solve()
    >>> print(f"{run['v_x'][-1]:.9f} {run.event_times('stick')[0]:.9f} {2 / 7 / 0.2 / 9.81:.9f}")
    0.714285714 0.145623999 0.145623999
    """
    weight, size = sp.Symbol("gravity", nonnegative=True), sp.Symbol("radius", positive=True)
    load = mass * weight
    slip = (v_x - size * omega_y, v_y + size * omega_x)
    pieces = [law.attach(velocity=slip, normal=load, time=t)]
    moment = (sp.S.Zero, sp.S.Zero)
    if rolling is not None:
        pieces.append(rolling.attach(velocity=(omega_x, omega_y), normal=load, time=t, name="rolling"))
        moment = pieces[1].force
    first, second = pieces[0].force
    rates = {x: v_x, y: v_y, v_x: -first / mass, v_y: -second / mass,
             omega_x: (-size * second - moment[0]) / about, omega_y: (size * first - moment[1]) / about}  # fmt: skip
    shown = {"slip_x": slip[0], "slip_y": slip[1]}
    begin = dict(zip(rates, (0.0, 0.0, *map(float, velocity), *map(float, spins)), strict=True))
    return scene_of("ball", law, t_span, rates, pieces, (*map(str, rates), *shown), x0=begin,
                    parameters={mass: m, about: inertia, weight: g, size: radius}, outputs=shown)  # fmt: skip


@door(
    law=IN_PLANE,
    swivel=checks.number,
    **dict.fromkeys(("speed", "trail", "radius", "inertia", "wheel", "load"), checks.positive),
)
def caster(
    law: Law, *, speed: float = 1.0, swivel: float = 2.0, trail: float = 0.05, radius: float = 0.05,
    inertia: float = 0.01, wheel: float = 0.001, load: float = 100.0, t_span: tuple[float, float] = (0.0, 1.0),
) -> Scene:  # fmt: skip
    """A caster whose pivot is pulled along at a constant speed: its wheel rolls into line, or skids.

    Parameters
    ----------
    law : Law
        Of friction in the plane between wheel and ground, per unit of the load.
    speed : float, m/s
        Of the pivot, > 0.
    swivel : float, rad
        Angle between the wheel's heading and the way of the pivot, at the start, at which it rolls.
    trail : float, m
        Distance of the wheel's contact behind the pivot, > 0.
    radius : float, m
        Of the wheel, > 0.
    inertia, wheel : float, kg m^2
        Moments of inertia, about the pivot and of the wheel about its axle, > 0.
    load : float, N
        On the wheel, > 0.

    Returns
    -------
    Scene
        States `swivel`, `swivel_rate`, `wheel_rate` and the law's; outputs `slip_along`, `slip_aside`,
        `friction_along`, `friction_aside`, of the wheel's heading.

    Notes
    -----
    While it rolls tan(swivel/2) falls as exp(-speed t/trail), and the ground holds speed^2 sin(swivel)/trail times
    (wheel sin(swivel)/radius^2, inertia cos(swivel)/trail^2) along and aside.

    Source: derived here.

    >>> run = caster(Coulomb(F_c=0.5), swivel=2, trail=0.05).solve()
    >>> print(run.itinerary, f"{np.log(np.tan(run['swivel'][-1] / 2) / np.tan(1)):.6f}")
    ('stick (lam sliding)',) -20.000000
    """
    angle, rate, wheel_rate = sp.symbols("swivel swivel_rate wheel_rate", real=True)
    arm, size, about_pivot, of_wheel, pull = sp.symbols("trail radius inertia wheel speed", positive=True)
    slip = (pull * sp.cos(angle) - size * wheel_rate, -pull * sp.sin(angle) - arm * rate)
    weight = sp.Symbol("load", positive=True)
    pieces = law.attach(velocity=slip, normal=weight, time=t)
    along, aside = pieces.force
    rates = {angle: rate, rate: arm * aside / about_pivot, wheel_rate: size * along / of_wheel}
    shown = {"slip_along": slip[0], "slip_aside": slip[1], "friction_along": along, "friction_aside": aside}
    begin = {
        angle: swivel,
        rate: -speed * math.sin(swivel) / trail,
        wheel_rate: speed * math.cos(swivel) / radius,
    }
    values = {arm: trail, size: radius, about_pivot: inertia, of_wheel: wheel, pull: speed, weight: load}
    return scene_of("caster", law, t_span, rates, [pieces], (*map(str, rates), *shown), x0=begin,
                    parameters=values, outputs=shown)  # fmt: skip


@door(
    law=IN_PLANE, ground=IN_PLANE, **dict.fromkeys(("masses", "block", "plate"), checks.pair), g=checks.positive,
)  # fmt: skip
def stacked_plates(
    law: Law, ground: Law, *, force: Any = (0, 0), masses: Sequence[float] = (1.0, 1.0),
    block: Sequence[float] = (1.0, 0.0), plate: Sequence[float] = (0.0, 0.0), g: float = 9.81,
    t_span: tuple[float, float] = (0.0, 5.0),
) -> Scene:  # fmt: skip
    """A block on a plate on the ground: two contacts, of which each drives the other.

    Parameters
    ----------
    law, ground : Law
        Of friction between block and plate, and between plate and ground, per unit of their loads.
    force : (Expr of t, Expr of t), N
        On the plate.
    masses : (float, float), kg
        Of block and plate, > 0.
    block, plate : (float, float), m/s
        Their velocities at the start.

    Returns
    -------
    Scene
        States x_b, y_b, x_p, y_p, u_b, v_b, u_p, v_p and the laws'; outputs `between_x`, `between_y` (the force on the
        plate by the block), `ground_x`, `ground_y`.

    Raises
    ------
    ValueError, TypeError
        A mass that is not positive.

    Source: derived here.

    On a light plate over rough ground the block alone slides, as on the ground:

    >>> run = stacked_plates(Coulomb(F_c=0.2), Coulomb(F_c=0.3), block=(0.6, 0.8)).solve()
    >>> print(f"{run.event_times('stick')[-1]:.9f} {1 / 0.2 / 9.81:.9f}, the plate moves {run['x_p'][-1]:.0f}")
    0.509683996 0.509683996, the plate moves 0
    """
    if not min(masses) > 0:
        raise ValueError(f"`masses` are {tuple(masses)}; give two positive ones.")
    names = "x_b y_b x_p y_p u_b v_b u_p v_p"
    places, speeds = (sp.symbols(part, real=True) for part in (names[:15], names[16:]))
    heavy, weight = sp.symbols("mass_b mass_p", positive=True), sp.Symbol("gravity", nonnegative=True)
    between = law.attach(velocity=(speeds[0] - speeds[2], speeds[1] - speeds[3]), normal=heavy[0] * weight, time=t,
                         name="block")  # fmt: skip
    below = ground.attach(velocity=speeds[2:], normal=sum(heavy) * weight, time=t, name="ground")
    pushes = two(force, "force")
    rates = dict(zip(places, speeds, strict=True))
    rates |= {w: -f / heavy[0] for w, f in zip(speeds[:2], between.force, strict=True)}
    rates |= {
        w: (u + f - r) / heavy[1]
        for w, u, f, r in zip(speeds[2:], pushes, between.force, below.force, strict=True)
    }
    shown = {"between_x": between.force[0], "between_y": between.force[1],
             "ground_x": below.force[0], "ground_y": below.force[1]}  # fmt: skip
    begin = dict.fromkeys(rates, 0.0) | dict(zip(speeds, map(float, (*block, *plate)), strict=True))
    values = dict(zip(heavy, map(float, masses), strict=True)) | {weight: g}
    return scene_of("stacked plates", law, t_span, rates, [between, below], (*map(str, rates), *shown), x0=begin,
                    parameters=values, outputs=shown)  # fmt: skip
