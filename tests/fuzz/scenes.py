"""Scenes whose derivatives are tried by differences.py: slides, folds, layers, memories, contacts, rests, kicks.

A scene is one System with ranges of its quantities; cases differ in numbers. Names of scenes begin with their class.
Chain: scenes.py (here) -> differences.py -> __main__.py.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import sympy as sp

from pwsmooth import Event, Kicks, Memory, Switch, System, Unilateral

t, x, y, v, w, z, u, q = sp.symbols("t x y v w z u q", real=True)
a, b, c, e, g, k, m, F, A, om, rho, beta, sigma, mu, T, d = sp.symbols(
    "a b c e g k m F A om rho beta sigma mu T d", positive=True
)


@dataclass
class Scene:
    """A System, the ranges of its parameters and of its start, and the longest span."""

    name: str
    system: object
    ranges: dict  # of names of parameters and states
    length: float = 8.0
    start: tuple = (0.0, 0.0)  # range of the start time
    noise: tuple = ()  # (sizes, every, law) of kicks


def _system(rates, ranges, **more):
    """A System whose parameters are the symbols of `ranges` that stand in it."""
    stand = set().union(*(sp.sympify(rate).free_symbols for rate in rates.values()))
    for lam in [s for s in stand if hasattr(s, "surface") or hasattr(s, "gap")]:
        stand |= (
            lam.surface.free_symbols
            if hasattr(lam, "surface")
            else lam.gap.free_symbols | lam.restitution.free_symbols
        )
    for event in more.get("events", ()):
        stand |= set().union(
            *(sp.sympify(e).free_symbols for e in (event.surface or 0, event.every or 0, *event.at))
        )
        stand |= set().union(*(new.free_symbols for _, new in event.update))
    parameters = {s: 1 for s in (a, b, c, e, g, k, m, F, A, om, rho, beta, sigma, mu, T, d)
                  if s.name in ranges and s in stand}  # fmt: skip
    return System(rates, time=t, parameters=parameters, **more)


def _scene(name, rates, ranges, *, view=None, length=8.0, start=(0.0, 0.0), noise=(), **more):
    system = _system(rates, ranges, **more)
    system = view(system) if view else system
    known = {s.name for s in (*system.parameters, *system.states)}
    return Scene(name, system, {n: ends for n, ends in ranges.items() if n in known}, length, start, noise)


def _block(lam, friction):
    return {y: v, v: F * sp.sin(om * t) - sigma * y - b * v - friction}


_BLOCK = {"F": (1.0, 4.0), "om": (0.5, 2.0), "sigma": (0.5, 4.0), "b": (0.0, 0.4), "rho": (0.3, 3.0),
          "y": (-1.0, 1.0), "v": (-1.5, 1.5)}  # fmt: skip


def _slides():
    lam = Switch("lam", v)
    yield _scene(
        "slide friction",
        {y: v, v: F * sp.cos(om * t) - k * sp.sin(y) - b * v - lam * (1 + z), z: (rho * (1 - lam**2) - z) / beta},
        {"F": (1, 4), "om": (0.5, 2), "k": (0.5, 4), "b": (0.02, 0.4), "rho": (0.1, 2), "beta": (0.1, 1),
         "y": (-1, 1), "v": (-1.5, 1.5), "z": (0, 1)},
        start=(-1.0, 1.0), outputs={"force": lam * (1 + z), "power": lam * v + z**2},
    )  # fmt: skip
    s = Switch("s", x**2 + y**2 - d**2)
    yield _scene(
        "slide circle",
        {x: y - a * x * s + F * sp.cos(om * t), y: -x - a * y * s + b * x * y, z: s * x - z},
        {"a": (0.3, 2), "F": (0.2, 2), "om": (0.5, 2), "b": (0.05, 0.6), "d": (0.7, 1.5), "x": (-2, 2),
         "y": (-2, 2), "z": (-1, 1)},
        outputs={"force": s * (1 + x * y)},
    )  # fmt: skip
    p, r = Switch("p", x - b * sp.sin(t)), Switch("r", y + x / 3 - d)
    yield _scene(
        "slide two",
        {x: F * sp.sin(om * t) - a * p + r * sp.cos(x + y) / 4, y: c * sp.cos(t) - k * r + p * x / 5 - y / 4,
         z: p * r + x * y - z / 2},
        {"F": (0.5, 2), "om": (0.5, 2), "a": (0.7, 2), "k": (0.7, 2), "c": (0.2, 1.5), "b": (0.1, 0.5),
         "d": (0.1, 0.5), "x": (-1.5, 1.5), "y": (-1.5, 1.5), "z": (-1, 1)},
        outputs={"both": p + r * x},
    )  # fmt: skip


def _folds():
    lam = Switch("lam", v)
    yield _scene(
        "fold cubic", _block(lam, lam * (1 + rho * (1 - lam**2))), _BLOCK, start=(0.0, 2.0),
        outputs={"mu": lam * (1 + rho * (1 - lam**2))},
    )  # fmt: skip
    moved = Switch("lam", v - a * sp.cos(t))
    yield _scene(
        "fold moving", _block(moved, moved * (1 + rho * (1 - moved**2) ** 2) + y * moved**2 / 4),
        _BLOCK | {"a": (0.1, 0.8)}, outputs={"mu": moved**3},
    )  # fmt: skip
    yield _scene(
        "fold state",
        {y: v, v: F * sp.sin(om * t) - sigma * y - lam * (1 + z * (1 - lam**2)), z: (rho - z - lam**2 / 2) / 2},
        _BLOCK | {"z": (0.0, 2.0)},
    )


def _layers():
    lam = Switch("lam", v)
    rates = {
        y: v, v: F * sp.sin(om * t) - sigma * y - b * v - lam * (1 + z), z: (rho * (1 - lam**2) - z) / beta
    }  # fmt: skip
    for ratio in (sp.oo, 2.0, 0):
        yield _scene(
            f"layered {ratio}", rates, _BLOCK | {"beta": (0.05, 0.2)},
            view=lambda system, ratio=ratio: system.layered({z: ratio}),
        )  # fmt: skip


def _memories():
    n = Memory("n", 0.3)
    yield _scene(
        "memory relay",
        {x: y, y: -x - b * y + n + sp.sin(om * t)},
        {"b": (0.05, 0.4), "om": (0.5, 3), "a": (0.3, 1), "c": (0.1, 0.6), "d": (0.5, 0.9), "x": (-1, 1),
         "y": (-1, 1), "n": (-0.5, 0.5)},
        events=[
            Event(x - c, direction=1, update={n: a * y - n / 3}, name="up"),
            Event(x + c, direction=-1, update={n: a * x - d * n, y: y + sp.tanh(n) / 4}, name="down"),
        ],
    )  # fmt: skip
    latch, count = Memory("latch", 0.1), Memory("count", 0.0)
    yield _scene(
        "memory clock",
        {x: -k * x + latch + sp.sign(y - b) / 2, y: x - y / 2 + sp.cos(t)},
        {"k": (0.3, 1.5), "b": (0.02, 0.5), "T": (0.5, 1.2), "a": (0.2, 1), "d": (0.3, 2.5), "x": (-1, 1),
         "y": (-1, 1)},
        events=[
            Event(every=T, update={latch: a * sp.sin(x) - latch / 2, count: count + 1}, name="sample"),
            Event(at=[d**2], update={x: x / 2 + a * y}, name="once"),
            Event(y - x, when=x > latch, update={y: y + a, x: x - y / 4}, name="meet", direction=1),
        ],
    )  # fmt: skip
    speed = Memory("speed", 1.0)
    lam = Switch("lam", v)
    yield _scene(
        "memory stick",
        {y: v, v: F * sp.sin(om * t) - sigma * y - lam * speed},
        {"F": (1, 3), "om": (0.5, 2), "sigma": (0.5, 3), "a": (0.2, 0.7), "y": (-1, 1), "v": (-1.5, 1.5),
         "speed": (0.4, 1.2)},
        events=[Event(y, update={speed: 1 / (1 + a * v**2)}, name="middle")],
        outputs={"force": lam * speed},
    )  # fmt: skip


def _contacts():
    R = Unilateral(x - d * sp.sin(om * t) + 1, restitution=e, name="R")
    yield _scene(
        "contact opening",
        {x: v, v: F * sp.cos(t) - g - b * v + R.reaction},
        {"F": (0.5, 3), "g": (0.3, 2), "b": (0.05, 0.5), "d": (0.1, 0.4), "om": (0.5, 2), "e": (0.3, 0.9),
         "x": (-0.3, 1), "v": (-1, 1)},
        outputs={"R": R.reaction},
    )  # fmt: skip
    P = Unilateral(x + c * x * sp.cos(y), restitution=0, name="P")
    lam = Switch("lam", w)
    yield _scene(
        "contact friction",
        {x: v, v: F * sp.cos(t) - g + P.reaction, y: w, w: a * sp.sin(om * t) - y - mu * lam * P.reaction},
        {"F": (0.5, 3), "g": (0.3, 2), "c": (0.05, 0.4), "a": (0.5, 2), "om": (0.5, 2), "mu": (0.1, 0.9),
         "x": (0.1, 1), "v": (-1, 1), "y": (-1, 1), "w": (-1, 1)},
        outputs={"slip": lam * P.reaction},
    )  # fmt: skip
    first = Unilateral(x, restitution=e, name="first")
    between = Unilateral(y - x - sp.Rational(1, 5), restitution=c, name="between")
    yield _scene(
        "contact two",
        {x: v, v: -k * x - g + first.reaction - between.reaction / m, y: w,
         w: -g + F * sp.cos(om * t) + between.reaction},
        {"k": (0.2, 2), "g": (0.5, 2), "m": (0.5, 2), "F": (0.1, 2), "om": (0.5, 2), "e": (0.1, 0.7),
         "c": (0.1, 0.7), "x": (0.2, 1), "v": (-0.5, 0.5), "y": (1.4, 2), "w": (-0.5, 0.5)},
        length=4.0,
    )  # fmt: skip
    Q = Unilateral(x, restitution=sp.Rational(1, 2), name="Q")
    yield _scene(
        "contact jump",
        {x: v, v: -g + F * sp.sign(sp.sin(om * t)) + Q.reaction, y: Q.reaction - y},
        {"F": (0.5, 3), "g": (0.3, 2), "om": (0.7, 2), "x": (0.1, 0.6), "v": (-1, 1), "y": (-1, 1)},
    )


def _rests():
    R = Unilateral(x - A * sp.sin(om * t), restitution=e, name="R")
    yield _scene(
        "rest table",
        {x: v, v: -g + R.reaction},
        {"A": (0.1, 0.5), "om": (1.0, 2.5), "e": (0.1, 0.6), "g": (0.6, 3), "x": (0.2, 1), "v": (-0.5, 0.5)},
        length=12.0,
    )  # fmt: skip
    P = Unilateral(x, restitution=e, name="P")
    lam = Switch("lam", w)
    yield _scene(
        "rest friction",
        {x: v, v: -g + F * sp.Max(0, sp.sin(om * t)) + P.reaction, y: w,
         w: a * sp.cos(t) - y - mu * lam * P.reaction},
        {"g": (1, 2), "F": (0.5, 3), "om": (0.4, 1), "e": (0.2, 0.6), "a": (0.5, 2), "mu": (0.2, 0.8),
         "x": (0.05, 0.4), "v": (-0.3, 0.3), "y": (-1, 1), "w": (-1, 1)},
        length=12.0,
    )  # fmt: skip
    S = Unilateral(x - c * t**2 / 8, restitution=e, name="S")
    yield _scene(
        "rest energy",
        {x: v, v: -g - k * x + S.reaction, z: S.reaction * sp.cos(t) - z},
        {"c": (0.05, 0.4), "k": (0.1, 1), "g": (1, 3), "e": (0.1, 0.6), "x": (0.3, 1), "v": (-0.5, 0.5),
         "z": (-1, 1)},
        length=6.0,
    )  # fmt: skip


def _kicked():
    lam = Switch("lam", v)
    yield _scene(
        "kicks fold", _block(lam, lam * (1 + rho * (1 - lam**2))), _BLOCK,
        noise=({"v": 0.3, "y": 0.1}, 0.37, "uniform"),
    )  # fmt: skip
    R = Unilateral(x - d * sp.sin(t) + 1, restitution=e, name="R")
    yield _scene(
        "kicks contact",
        {x: v, v: F * sp.cos(om * t) - g + R.reaction},
        {
            "F": (0.5, 2),
            "om": (0.5, 2),
            "g": (0.4, 2),
            "d": (0.1, 0.4),
            "e": (0.3, 0.8),
            "x": (0, 1),
            "v": (-1, 1),
        },
        noise=({"v": 0.4}, 0.61, "normal"),
    )
    n = Memory("n", 0.3)
    yield _scene(
        "kicks memory",
        {x: -k * x + n - sp.sign(x - a) / 2},
        {"k": (0.3, 1), "a": (0.1, 0.6), "b": (0.3, 1), "T": (0.5, 1), "x": (-1, 1)},
        events=[Event(every=T, update={n: b * x}, name="sample")], noise=({"x": 0.5}, 0.43, "uniform"),
    )  # fmt: skip


def _notations():
    yield _scene(
        "notation stairs",
        {x: sp.floor(a * y) / 2 - x + sp.Mod(t, T), y: x - b * y + sp.Piecewise((1, sp.Mod(t, T) < d * T), (0, True))},
        {"a": (0.7, 2), "b": (0.3, 1), "T": (0.6, 1.5), "d": (0.2, 0.8), "x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    yield _scene(
        "notation kinks",
        {x: y, y: -sp.Max(x, a * y) - sp.Min(b, x * y) + sp.cos(om * t) * sp.Abs(x - c),
         z: sp.atan2(x, 2 + y) + sp.sqrt(sp.Abs(x) + d)},
        {"a": (0.1, 0.7), "b": (0.2, 1), "c": (0.1, 0.6), "om": (0.5, 2), "d": (0.3, 1), "x": (-1, 1), "y": (-1, 1),
         "z": (-1, 1)},
    )  # fmt: skip
    yield _scene(
        "notation pulses",
        {x: y + a * sp.DiracDelta(t - b), y: -k * x - y / 5 - sp.sign(y) / 3 + c * sp.DiracDelta(t - d)},
        {"a": (0.3, 1), "b": (0.4, 2), "k": (0.5, 3), "c": (0.3, 1), "d": (2.2, 3), "x": (-1, 1), "y": (-1, 1)},
    )
    lam = Switch("lam", u)
    yield Scene(
        "notation masses",
        System(
            {q: u, x: v},
            mass_matrix=sp.Matrix([[1 + m, m * sp.cos(q)], [m * sp.cos(q), m + x**2]]),
            forcing={u: F * sp.sin(om * t) - k * q - lam, v: -x - v / 3 + m * u**2 * sp.sin(q)},
            time=t, parameters=dict.fromkeys([m, F, om, k], 1),
        ),
        {"m": (0.4, 1), "F": (1, 3), "om": (0.5, 2), "k": (0.5, 2), "q": (-1, 1), "u": (-1, 1), "x": (0.5, 1.5),
         "v": (-1, 1)},
    )  # fmt: skip


CLASSES = {
    "slide": _slides, "fold": _folds, "layered": _layers, "memory": _memories, "contact": _contacts, "rest": _rests,
    "kicks": _kicked, "notation": _notations,
}  # fmt: skip


@functools.lru_cache(maxsize=1)
def all_scenes():
    """Every scene, the classes in turn."""
    made = [list(of_class()) for of_class in CLASSES.values()]
    return [rows[i] for i in range(max(map(len, made))) for rows in made if i < len(rows)]


def noise_of(scene, seed):
    """The kicks of a case."""
    if not scene.noise:
        return None
    size, every, law = scene.noise
    return Kicks(size, every, law=law, seed=seed)


def draw(scene, r):
    """(Values of all quantities, (t0, t1))."""
    values = {name: float(r.uniform(*ends)) for name, ends in scene.ranges.items()}
    t0 = float(r.uniform(*scene.start)) if scene.start[0] < scene.start[1] else scene.start[0]
    return values, (t0, t0 + float(scene.length * r.uniform(0.4, 1.0)))
