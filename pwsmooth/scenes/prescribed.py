"""The prescribed-motion rig: position or velocity in, force out; no mass, so that the law is seen alone.

x = p(t) or dx/dt = v(t)  ->  f(t)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..definition import checks
from ..definition.drives import Drive
from ..laws import Law
from .drive import check_continuous, door, expression, t, value, within
from .scene import Scene, scene_of

x, v, done = sp.symbols("x v work", real=True)


@door("period", "parameters", work=checks.flag)
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
    position, velocity : Expr of t or Drive
        One of them, in the units of the law; a position must not jump. Symbols other than t are parameters of
        the drive.
    normal : Expr of t or Drive, optional
        Normal load; the law is per unit of load then.
    t_span : (float, float), s, optional
        (0, 1), or that of the record.
    period : float, s, optional
        Period of the motion.
    parameters : mapping of (Symbol or str) to float, optional
        Values of the drive's symbols, in its units.
    work : bool
        Add the state `work`, the integral of f v dt.

    Returns
    -------
    Scene
        Outputs `force`, `position`, `velocity`, and those of the law.

    Raises
    ------
    ValueError, TypeError
        Both or none of `position` and `velocity`; a position that jumps; a drive that is no expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.laws.friction import Dahl
    >>> from pwsmooth.scenes import prescribed_motion, t
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
    t_span = within(t_span, position, velocity, normal)
    # The constant becomes a state of rate 0: an expression without states can be no surface.
    own: dict[Any, Any] = {}
    begins: dict[Any, float] = {}
    place, speed, acceleration, drives = _motion(position, velocity, t_span, values)
    if t not in speed.free_symbols and not drives:
        begins[v], own[v] = value(speed, values | {"t": t_span[0]}, "`velocity`"), sp.S.Zero
        speed, acceleration = v, sp.S.Zero
        values = {key: value for key, value in values.items() if key in map(str, place.free_symbols)}
    own[x] = speed
    begins[x] = 0.0 if position is None else _first(position, place, t_span, values)
    load = None if normal is None else sp.Symbol("load", real=True)
    if isinstance(normal, Drive):
        drives[load] = normal
    elif normal is not None:
        load = expression(normal, "normal")
    pieces = law.attach(position=place, velocity=speed, acceleration=acceleration, normal=load, time=t)
    if work:
        own[done], begins[done] = pieces.force * speed, 0.0
    if "acceleration" not in law.needs:
        drives.pop(acceleration, None)
    shown = {"force": pieces.force, "position": place, "velocity": speed}
    seen = sorted({*shown, *pieces.outputs, *(("work",) if work else ())})
    return scene_of(
        "prescribed motion", law, t_span, own, [pieces], seen, period=period, start=begins, parameters=values,
        outputs=shown, drives=drives,
    )  # fmt: skip


def _motion(position, velocity, t_span, values):
    """(position, velocity, acceleration) as expressions, and the drives among them."""
    if isinstance(position, Drive):
        place, speed, acceleration = symbols = sp.symbols("p p_1 p_2", real=True)
        rate = position.derivative()
        return *symbols, {place: position, speed: rate, acceleration: rate.derivative()}
    if isinstance(velocity, Drive):
        speed, acceleration = symbols = sp.symbols("w w_1", real=True)
        return x, *symbols, {speed: velocity, acceleration: velocity.derivative()}
    if position is not None:
        place = expression(position, "position")
        check_continuous(place, "position", t_span, values)
        return place, place.diff(t), place.diff(t, 2), {}
    speed = expression(velocity, "velocity")
    return x, speed, speed.diff(t), {}


def _first(position, place, t_span, values):
    """The position at the start."""
    if isinstance(position, Drive):
        return position.at(t_span[0])
    return value(place, values | {"t": t_span[0]}, "`position`")
