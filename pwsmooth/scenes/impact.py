"""Bodies that meet a wall, with any contact law: free impact, falling ball, impact oscillator, block under a force.

    m dv/dt = u(t, p, v) - F,      p the indentation (-p the gap), F >= 0 the law's force

Chain: laws/contact -> **impact** -> figures, sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..laws import Law
from .drive import expression, t
from .scene import Scene, assemble

p, v = sp.symbols("p v", real=True)
mass, gravity, spring, damper, gap = sp.symbols("mass gravity spring damper gap", nonnegative=True)
UNITS = {"p": "m", "v": "m/s", "force": "N", "energy": "J", "mass": "kg", "gravity": "m/s^2"}


def free_impact(
    law: Law,
    *,
    speed: float = 1.0,
    m: float = 1.0,
    approach: float = 0.0,
    t_span: tuple[float, float] = (0.0, 1.0),
) -> Scene:
    """A mass that flies against a wall with nothing else acting on it.

    Parameters
    ----------
    law : Law
        A contact law.
    speed : float
        Towards the wall, > 0, m/s.
    m : float
        Mass, > 0, kg.
    approach : float
        Gap at the start, >= 0, m; 0 starts at touch-down.
    t_span : (float, float)

    Returns
    -------
    Scene
        States p (indentation), v; outputs `force` and `energy` (kinetic and stored).

    Raises
    ------
    ValueError
        A speed or mass that is not positive, a gap below 0.

    Examples
    --------
    >>> from pwsmooth.laws.contact import HertzImpact, effective_restitution
    >>> scene = free_impact(HertzImpact(c_r=0.5), speed=2.0)
    >>> e = -scene.solve()["v"][-1]/2.0
    >>> bool(abs(e - effective_restitution("lankarani-nikravesh", 0.5)) < 1e-8)  # ten times rtol
    True
    """
    _check_mass(m)
    if not (math.isfinite(speed) and speed > 0):
        raise ValueError(f"`speed` is {speed!r}; the mass approaches the wall, so give a speed > 0.")
    if not (math.isfinite(approach) and approach >= 0):
        raise ValueError(f"`approach` is {approach!r}; the mass starts outside the wall, so give a gap >= 0.")
    start = {p: -approach, v: speed}
    return _scene("free impact", law, sp.S.Zero, start, t_span, {mass: m}, speed=speed)


def falling_ball(
    law: Law,
    *,
    height: float = 0.1,
    m: float = 1.0,
    g: float = 9.81,
    t_span: tuple[float, float] = (0.0, 3.0),
) -> Scene:
    """A ball dropped from rest: bounces, their accumulation where the law has one, and rest.

    Parameters
    ----------
    law : Law
    height : float
        Gap at the start, > 0, m.
    m, g : float
        Mass and gravity.
    t_span : (float, float)

    Returns
    -------
    Scene
        Outputs also `height` (-p); observable `apexes`, the heights at which the ball turns.

    Raises
    ------
    ValueError
        A height, mass or gravity that is not positive.
    """
    _check_mass(m)
    for name, value in (("height", height), ("g", g)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"`{name}` is {value!r}; give a number > 0.")
    scene = _scene(
        "falling ball",
        law,
        mass * gravity,
        {p: -height, v: 0.0},
        t_span,
        {mass: m, gravity: g},
        potential=-mass * gravity * p,
        outputs={"height": -p},
    )
    scene.observables["apexes"] = apexes
    return scene


def impact_oscillator(
    law: Law,
    *,
    d: float = 1.0,
    k: float = 1.0,
    c: float = 0.1,
    m: float = 1.0,
    amplitude: float = 1.0,
    omega: float = 0.8,
    t_span: tuple[float, float] = (0.0, 60.0),
    start: tuple[float, float] = (0.0, 0.0),
) -> Scene:
    """A forced mass on a spring with a stop at x = d:  m x'' + c x' + k x = amplitude cos(omega t) - F(x - d).

    Parameters
    ----------
    law : Law
    d : float
        Where the stop stands, from the spring's rest.
    k, c, m : float
    amplitude, omega : float
    start : (float, float)
        x and its velocity; x <= d.

    Returns
    -------
    Scene
        Its steady motion grazes the stop at amplitude = d sqrt((k - m omega^2)^2 + (c omega)^2).

    Raises
    ------
    ValueError
        A mass or frequency that is not positive, a start inside the stop.
    """
    _check_mass(m)
    if not (math.isfinite(omega) and omega > 0):
        raise ValueError(f"`omega` is {omega!r}; give a frequency > 0.")
    if start[0] > d:
        raise ValueError(f"`start` has x = {start[0]:g}, inside the stop at d = {d:g}; give x <= d.")
    strength, frequency, where = sp.symbols("amplitude omega d", real=True)
    x = p + where
    drive = strength * sp.cos(frequency * t) - spring * x - damper * v
    values = {mass: m, spring: k, damper: c, strength: amplitude, frequency: omega, where: d}
    begin = {p: start[0] - d, v: start[1]}
    return _scene("impact oscillator", law, drive, begin, t_span, values, outputs={"x": x},
                  period=2 * math.pi / omega)  # fmt: skip


def grazing_amplitude(d: float, k: float, c: float, m: float, omega: float) -> float:
    """Drive at which the steady motion of `impact_oscillator` just touches its stop."""
    return d * math.hypot(k - m * omega**2, c * omega)


def pressed_block(
    law: Law,
    force: Any,
    *,
    m: float = 1.0,
    p0: float = 0.0,
    t_span: tuple[float, float] = (0.0, 1.0),
    parameters: Mapping[Any, float] | None = None,
) -> Scene:
    """A block pressed against a wall and pulled off by an outside force u(t) (> 0 presses): the sticky-force test.

    Parameters
    ----------
    law : Law
    force : expression of t
    m : float
    p0 : float
        Indentation at the start, at rest there.
    parameters : mapping, optional
        Values of the force's symbols.
    """
    _check_mass(m)
    u = expression(force, "force")
    return _scene("pressed block", law, u, {p: p0, v: 0.0}, t_span, {mass: m, **(parameters or {})},
                  outputs={"pull": u})  # fmt: skip


def apexes(solution: Any) -> Any:
    """Heights -p at which the motion turns outside contact, from the dense output or the steps."""
    import numpy as np

    if solution.dense is None:
        raise ValueError("apexes need the motion between steps: solve with `dense_output=True`.")
    found = []
    offs = [e.time for e in solution.events if e.switch.startswith("lift-off") or e.kind == "impact"]
    ons = [e.time for e in solution.events if e.switch.startswith("touch-down") or e.kind == "impact"]
    for off in offs:
        later = [on for on in ons if on > off]
        if later:
            grid = np.linspace(off, later[0], 33)
            # Free flight is a parabola: three of its points give the top.
            height = -solution(grid, "p")
            i = int(np.clip(np.argmax(height), 1, 31))
            a, b, _ = np.polyfit(grid[i - 1 : i + 2] - grid[i], height[i - 1 : i + 2], 2)
            found.append(height[i] - b**2 / (4 * a))
    return np.array(found)


def _check_mass(m):
    if not (math.isfinite(m) and m > 0):
        raise ValueError(f"`m` is {m!r}; a body needs a mass > 0.")


def _scene(name, law, drive, start, t_span, parameters, *, speed=None, potential=sp.S.Zero, outputs=None,
           period=None):  # fmt: skip
    """The scene of one body: `drive` is the force on it besides the contact's."""
    pieces = law.attach(position=p, velocity=v, time=t)
    stored = pieces.outputs.get("stored", sp.S.Zero)
    shown = {
        "force": pieces.force,
        "energy": mass * v**2 / 2 + stored + potential,
        **(outputs or {}),
    }
    system, begin, atol = assemble(
        {p: v, v: (drive - pieces.force) / mass},
        pieces,
        time=t,
        start=start,
        parameters=parameters,
        outputs=shown,
        begin=t_span[0],
    )
    if speed is not None and start[p] >= 0 and "speed" in {m.name for m in system.initial_memory}:
        begin["speed"] = speed  # it starts at the instant of touch-down, which no event precedes
    seen = {n: n for n in ("p", "v", *shown, *pieces.outputs)}
    note = f"{law.source}{'; ' + law.certainty if law.certainty else ''}"
    return Scene(f"{name}, {type(law).__name__}", system, begin, (t_span[0], t_span[1]), period, seen,
                 UNITS | law.units(), note, atol)  # fmt: skip
