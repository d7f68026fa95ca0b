"""Bodies that meet a wall, with any contact law: free impact, falling ball, impact oscillator, block under a force.

    m dv/dt = u(t, p, v) - F,      p the indentation (-p the gap), F >= 0 the law's force

Chain: laws/contact -> **impact** -> figures, sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..door import checks
from ..laws import Law
from . import sketches
from .drive import OF_CONTACT, door, expression, t
from .scene import Scene, scene_of

p, v = sp.symbols("p v", real=True)
mass, gravity, spring, damper, gap = sp.symbols("mass gravity spring damper gap", nonnegative=True)
UNITS = {"p": "m", "v": "m/s", "force": "N", "energy": "J", "mass": "kg", "gravity": "m/s^2"}


@door("m", law=OF_CONTACT, speed=checks.positive, approach=checks.nonnegative)
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
    speed : float, m/s
        Towards the wall, > 0.
    approach : float, m
        Gap at the start, >= 0; 0 starts at touch-down.

    Returns
    -------
    Scene
        States p (indentation), v; outputs `force` and `energy` (kinetic and stored).

    Notes
    -----
    m dv/dt = -F.

    >>> scene = free_impact(HertzImpact(c_r=0.5), speed=2.0)
    >>> e = -scene.solve()["v"][-1] / 2.0
    >>> bool(abs(e - effective_restitution("lankarani-nikravesh", 0.5)) < 1e-8)  # ten times rtol
    True
    """
    start = {p: -approach, v: speed}
    return _scene("free impact", law, sp.S.Zero, start, t_span, {mass: m}, speed=speed)


@door("m", law=OF_CONTACT, height=checks.positive, g=checks.positive)
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
    height : float, m
        Gap at the start, > 0.
    g : float, m/s^2
        Gravity, > 0.

    Returns
    -------
    Scene
        Outputs `force`, `energy`, `height` (-p); observable `apexes`, the heights at which the ball turns.

    Notes
    -----
    m dv/dt = m g - F.

    Each apex of a rigid ball is e^2 times the one before:

    >>> scene = falling_ball(RigidImpact(e=0.8), height=1.0, t_span=(0, 2))
    >>> solution = scene.solve(dense_output=True)
    >>> [f"{apex:.6f}" for apex in scene.observe(solution)["apexes"][:2]]
    ['0.640000', '0.409600']
    """
    scene = _scene(
        "falling ball",
        law,
        mass * gravity,
        {p: -height, v: 0.0},
        t_span,
        {mass: m, gravity: g},
        potential=-mass * gravity * p,
        outputs={"height": -p},
        sketch=sketches.ball_above_ground(p, height),
    )
    scene.observables["apexes"] = apexes
    return scene


@door(
    "m",
    "x0",
    law=OF_CONTACT,
    omega=checks.positive,
    **dict.fromkeys(("d", "k", "c", "amplitude"), checks.number),
)
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
    x0: tuple[float, float] = (0.0, 0.0),
) -> Scene:
    """A forced mass on a spring with a stop at x = d:  m x'' + c x' + k x = amplitude cos(omega t) - F(x - d).

    Parameters
    ----------
    law : Law
        A contact law, of the stop.
    d : float, m
        Where the stop stands, from the spring's rest.
    x0 : (float, float), m and m/s
        x and its velocity; x <= d.

    Returns
    -------
    Scene
        Its steady motion grazes the stop at amplitude = d sqrt((k - m omega^2)^2 + (c omega)^2).

    Raises
    ------
    ValueError
        A mass or frequency that is not positive, a start inside the stop.

    Source: the impact oscillator of Shaw and Holmes, J. Sound Vib., 1983; the law has its own.

    The steady motion meets the stop above the grazing amplitude, and never below:

    >>> grazing = grazing_amplitude(d=1.0, k=1.0, c=0.5, m=1.0, omega=0.8)
    >>> for share in (0.99, 1.01):
    ...     scene = impact_oscillator(RigidImpact(e=0.8), c=0.5, amplitude=share * grazing, t_span=(0, 150))
    ...     late = scene.solve().event_times("impact") > 75
    ...     print(share, late.any())
    0.99 False
    1.01 True
    """
    if x0[0] > d:
        raise ValueError(f"`x0` has x = {x0[0]:g}, inside the stop at d = {d:g}; give x <= d.")
    strength, frequency, where = sp.symbols("amplitude omega d", real=True)
    x = p + where
    drive = strength * sp.cos(frequency * t) - spring * x - damper * v
    values = {mass: m, spring: k, damper: c, strength: amplitude, frequency: omega, where: d}
    begin = {p: x0[0] - d, v: x0[1]}
    reach = max(abs(amplitude / k) if k else 0.0, abs(d), abs(x0[0]), 0.1)
    return _scene("impact oscillator", law, drive, begin, t_span, values, outputs={"x": x},
                  period=2 * math.pi / omega, sketch=sketches.block_before_a_stop(p, where, d, reach))  # fmt: skip


@checks.door(**dict.fromkeys(("d", "k", "c", "m", "omega"), checks.number))
@checks.closed_form
def grazing_amplitude(d: float, k: float, c: float, m: float, omega: float) -> float:
    """Drive at which the steady motion of `impact_oscillator` just touches its stop.

    Parameters
    ----------
    d : float, m
        Where the stop stands.

    Returns
    -------
    float
        Amplitude d sqrt((k - m omega^2)^2 + (c omega)^2), N.

    Source: the amplitude of the linear oscillator's steady motion.

    >>> grazing_amplitude(d=1.0, k=2.0, c=0.0, m=1.0, omega=1.0)
    1.0
    """
    return d * math.hypot(k - m * omega**2, c * omega)


@door("m", "parameters", law=OF_CONTACT, p0=checks.number)
def pressed_block(
    law: Law,
    force: Any,
    *,
    m: float = 1.0,
    p0: float = 0.0,
    t_span: tuple[float, float] = (0.0, 1.0),
    parameters: Mapping[Any, float] | None = None,
) -> Scene:
    """A block pressed against a wall and pulled off by an outside force: the sticky-force test.

    Parameters
    ----------
    force : Expr of t
        u(t), N; > 0 presses.
    p0 : float, m
        Indentation at the start, at rest there.

    Returns
    -------
    Scene
        States p, v; outputs `force`, `energy`, `pull`.

    Source: X. Xiong's thesis, chapter 5, figure 5.3; the law has its own.

    Kelvin and Voigt's contact sticks to the wall; one that is released where its force vanishes does not:

    >>> for law in (KelvinVoigt(), LinearResidual()):
    ...     force = pressed_block(law, 10 - 200 * t, p0=0.01, t_span=(0, 0.2)).solve()["force"]
    ...     print(f"{type(law).__name__} pulls with {max(0.0, -force.min()):.1f} N")
    KelvinVoigt pulls with 5.1 N
    LinearResidual pulls with 0.0 N
    """
    u = expression(force, "force")
    return _scene("pressed block", law, u, {p: p0, v: 0.0}, t_span, {mass: m, **(parameters or {})},
                  outputs={"pull": u})  # fmt: skip


def apexes(solution: Any) -> Any:
    """Heights -p at which the motion turns outside contact, from the dense output or the steps."""
    import numpy as np

    if solution.dense is None:
        raise ValueError("apexes need the motion between steps: solve with `dense_output=True`.")
    heights = []
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
            heights.append(height[i] - b**2 / (4 * a))
    return np.array(heights)


def _scene(name, law, drive, start, t_span, parameters, *, speed=None, potential=sp.S.Zero, outputs=None,
           period=None, sketch=None):  # fmt: skip
    """The scene of one body: `drive` is the force on it besides the contact's."""
    pieces = law.attach(position=p, velocity=v, time=t)
    stored = pieces.outputs.get("stored", sp.S.Zero)
    shown = {"force": pieces.force, "energy": mass * v**2 / 2 + stored + potential, **(outputs or {})}
    rates = {p: v, v: (drive - pieces.force) / mass}
    note = f"{law.source}{'; ' + law.certainty if law.certainty else ''}"
    scene = scene_of(
        name, law, t_span, rates, pieces, ("p", "v", *shown, *pieces.outputs), period=period,
        units=UNITS | law.units(), note=note, x0=start, parameters=parameters, outputs=shown, sketch=sketch,
    )  # fmt: skip
    if speed is not None and start[p] >= 0 and "speed" in {m.name for m in scene.system.initial_memory}:
        scene.x0["speed"] = speed  # it starts at the instant of touch-down, which no event precedes
    return scene
