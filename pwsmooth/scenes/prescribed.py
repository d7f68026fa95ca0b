"""The prescribed-motion rig: position or velocity in, force out; no mass, so that the law is seen alone.

x = p(t) or dx/dt = v(t)  ->  f(t)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..definition.drives import Drive
from ..door import checks
from ..laws import Law
from ..laws.catalogue import Takes
from .drive import check_continuous, door, expression, t, value, within
from .scene import Scene, scene_of

done = sp.Symbol("work", real=True)


@door("period", "parameters", law=Takes(spins=None), work=checks.flag)
def prescribed_motion(
    law: Law,
    *,
    position: Any = None,
    velocity: Any = None,
    normal: Any = None,
    t_span: tuple[float, float] | None = None,
    period: float | None = None,
    parameters: Mapping[Any, float] | None = None,
    work: bool = False,
) -> Scene:
    """A law under a given motion: position or velocity in, force out; no mass, so that the law is seen alone.

    Parameters
    ----------
    law : Law
        Of friction or contact.
    position, velocity : Expr of t or Drive, or sequence of them, length 2 or 3
        One of them, in the units of the law; a position must not jump. With components, of a law with a form in the
        plane. Symbols other than t are parameters of the drive.
    normal : Expr of t or Drive, optional
        Normal load; the law is per unit of load then.
    t_span : (float, float), s, optional
        (0, 1), or that of the record.
    work : bool
        Add the state `work`, the integral of f v dt.

    Returns
    -------
    Scene
        Outputs `force`, `position`, `velocity`, of components with the ends _x, _y, _z, and those of the law.

    Raises
    ------
    ValueError, TypeError
        Both or none of `position` and `velocity`; a position that jumps; a drive that is no expression.

    >>> rig = prescribed_motion(Dahl(sigma0=1e5, F_c=1.0), position=3e-5*sp.sin(t), t_span=(0, 20))
    >>> force = rig.solve()["force"]
    >>> round(float(force.max()), 6)  # tanh(sigma0 X/F_c), in the steady loop
    0.995055
    """
    if (position is None) == (velocity is None):
        raise ValueError(
            f"{'neither `position` nor `velocity` is' if position is None else '`position` and `velocity` are both'} "
            "given to prescribed_motion; give one of them, an expression of t or a Drive."
        )
    values = dict(parameters or {})
    given = velocity if position is None else position
    planar = isinstance(given, (tuple, list))
    motions = checks.several(given, "`velocity`" if position is None else "`position`") if planar else (given,)
    t_span = within(t_span, *motions, normal)
    axes = [f"_{axis}" for axis, _ in zip("xyz", motions, strict=False)] if planar else [""]
    own: dict[Any, Any] = {}
    begins: dict[Any, float] = {}
    drives: dict[Any, Any] = {}
    place, speed, acceleration = zip(
        *(
            _motion(motion, position is not None, axis, t_span, values, own, begins, drives)
            for motion, axis in zip(motions, axes, strict=True)
        ),
        strict=True,
    )
    if not drives and not any(rate.has(t) for rate in own.values()):
        used = {str(s) for e in (*place, *own.values()) for s in e.free_symbols}
        values = {key: value for key, value in values.items() if key in used}
    load = None if normal is None else sp.Symbol("load", real=True)
    if isinstance(normal, Drive):
        drives[load] = normal
    elif normal is not None:
        load = expression(normal, "normal")
    if planar:
        pieces = law.attach(position=place, velocity=speed, normal=load, time=t)
    else:
        pieces = law.attach(
            position=place[0], velocity=speed[0], acceleration=acceleration[0], normal=load, time=t
        )
    force = pieces.force if planar else (pieces.force,)
    if work:
        own[done], begins[done] = sp.Add(*(f * w for f, w in zip(force, speed, strict=True))), 0.0
    if "acceleration" not in law.needs and not planar:  # in the plane a velocity is the integral of it
        drives.pop(acceleration[0], None)
    shown = {
        f"{name}{axis}": e
        for name, parts in (("force", force), ("position", place), ("velocity", speed))
        for axis, e in zip(axes, parts, strict=True)
    }
    seen = sorted({*shown, *pieces.outputs, *(("work",) if work else ())})
    return scene_of(
        "prescribed motion", law, t_span, own, [pieces], seen, period=period, x0=begins, parameters=values,
        outputs=shown, drives=drives,
    )  # fmt: skip


def _motion(motion, placed, axis, t_span, values, own, begins, drives):
    """(position, velocity, acceleration) of a component; overwrites the states, their starts and the drives.

    `placed`: the motion is a position, not a velocity.
    """
    x, v = (sp.Symbol(f"{name}{axis}", real=True) for name in "xv")
    if isinstance(motion, Drive):
        names = ("p", "p_1", "p_2") if placed else ("w", "w_1")
        symbols, rate = tuple(sp.Symbol(f"{name}{axis}", real=True) for name in names), motion
        for symbol in symbols:
            drives[symbol], rate = rate, rate.derivative()
        begins[x] = motion.at(t_span[0]) if placed else 0.0
        place, speed, acceleration = symbols if placed else (x, *symbols)
    elif placed:
        place = expression(motion, "position")
        check_continuous(place, "position", t_span, values)
        begins[x] = value(place, values | {"t": t_span[0]}, "`position`")
        speed, acceleration = place.diff(t), place.diff(t, 2)
    else:
        speed = expression(motion, "velocity")
        begins[x], place, acceleration = 0.0, x, speed.diff(t)
    if axis or t not in speed.free_symbols and not isinstance(motion, Drive):
        # A state: an expression without states can be no surface of one velocity, nor a function of time of several.
        first = drives.pop(speed).at(t_span[0]) if isinstance(motion, Drive) else speed
        begins[v], own[v] = value(first, values | {"t": t_span[0]}, "`velocity`"), acceleration
        speed = v
    own[x] = speed
    return place, speed, acceleration
