"""Discs whose slip stays on a line, or nearly: beside a switch, beside h = 0, and captured there.

On a line   a disc with nothing across is a `Switch`: the same kinds and order of events, the same times
A miss      |F| > mu: v passes 0 at a least speed; d/dt (mu |v| + F.v) = |F|^2 - mu^2 holds through it, and the number
            of steps grows as its logarithm does
Captured    hidden static friction, mu < |F| < mu_s: exactly against F the slip is captured, beside it it passes
Chain: judging.py -> lines.py (here) -> __main__.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from . import judging
from .judging import REFUSED, RIGHT, WRONG, Played, Verdict

TITLE = "discs on lines"
KINDS = ("on a line", "on a line, hidden", "on a line, Stribeck", "a miss", "captured")
STEPS = 5_000

_HEAD = """import sympy as sp
from pwsmooth import Disc, Switch, System, solve
x, y, z, vx, vy, vz, t, F, w, k, mu, rho, s, q = sp.symbols("x y z vx vy vz t F w k mu rho s q", real=True)
place, speed = (x, y, z)[:{d}], (vx, vy, vz)[:{d}]
"""
_LINE = """h = {h}
lam = Disc("lam", h)
one = Switch("lam", vx)
{law}
force = F*sp.cos(w*t) + 0.3*sp.sin(2.7*t) - k*x
S = System(dict(zip((*place, *speed), (*speed, force - lam[0]*law(lam.square, lam.size),
    *(-k*u - n*law(lam.square, lam.size) for u, n in zip(place[1:], tuple(lam)[1:]))))), time=t,
    parameters={{F: 1, w: 1, k: 1, mu: 1{more}}})
L = System({{x: vx, vx: force - one*law(one**2, sp.Abs(vx))}}, time=t, parameters={{F: 1, w: 1, k: 1, mu: 1{more}}})
"""
_THROWN = """lam = Disc("lam", speed)
S = System(dict(zip((*place, *speed), (*speed, *((F if i == 0 else 0) - n*mu*(1 + rho*(1 - lam.square))
    for i, n in enumerate(lam))))), parameters={{F: 1, mu: 1, rho: 1}})
"""
_LAWS = {
    "on a line": ("law = lambda square, size: mu", ""),
    "on a line, hidden": ("law = lambda square, size: mu*(1 + rho*(1 - square))", ", rho: 1"),
    "on a line, Stribeck": ("law = lambda square, size: mu*(1 + s*sp.exp(-size/q))", ", s: 1, q: 1"),
}


@dataclass
class Model:
    """A kind and its source."""

    kind: str
    d: int
    text: str


@dataclass
class Case:
    """Numbers of one run."""

    p: dict
    start: list
    end: float
    options: dict = field(default_factory=dict)
    least: float = 0.0


def structure(seed):
    """A random Model."""
    r = np.random.default_rng([51, seed])
    kind, d = KINDS[seed % len(KINDS)], int(r.choice([2, 3], p=[0.7, 0.3]))
    if kind in _LAWS:
        law, more = _LAWS[kind]
        h = str(r.choice(["speed", "(vx + vy/3, *speed[1:])", "speed"]))
        return Model(kind, d, (_HEAD + _LINE).format(d=d, h=h, law=law, more=more))
    return Model(kind, d, (_HEAD + _THROWN).format(d=d))


def case(M, seed):
    """Random numbers for it."""
    r = np.random.default_rng([52, seed])
    tight = {"rtol": 1e-12, "atol": 1e-14}
    if M.kind in _LAWS:
        p = {"F": r.uniform(0.3, 3), "w": r.uniform(0.3, 2), "k": r.uniform(0, 2), "mu": r.uniform(0.3, 1.2),
             "rho": r.uniform(0.1, 4), "s": r.uniform(-0.4, 1), "q": 10 ** r.uniform(-1, 0.5)}  # fmt: skip
        start = [r.uniform(-1, 1), r.uniform(-1, 1) if r.random() < 0.8 else 0.0]
        return Case(p, start, float(r.uniform(5, 25)), tight)
    if M.kind == "captured":
        p = {"F": 1.0, "rho": r.uniform(1, 4)}
        top = 2 * p["rho"] * ((1 + p["rho"]) / (3 * p["rho"])) ** 1.5
        p["mu"] = 1 / r.uniform(1.02, 0.98 * top)
        p["F"] *= (scale := float(10 ** r.uniform(-1, 1)))
        p["mu"] *= scale
        return Case(p, [r.uniform(0.1, 2)], 0.0, tight)
    p = {"F": r.uniform(1.02, 4), "mu": 1.0, "rho": 0.0}
    least = float(10 ** r.uniform(-12, -3))
    return Case(p, [_beside(p["F"], least)], 0.0, tight, least)


def _beside(F, least):
    """Angle from the direction against F, at speed 1, from which the least speed is `least`; mu = 1.

    Slip keeps v sin(phi) tan(phi/2)^(-1/F); the speed is least at cos(phi) = 1/F.
    """
    phi = math.acos(1 / F)
    C = math.log(least * math.sin(phi)) - math.log(math.tan(phi / 2)) / F
    return math.exp(brentq(lambda a: math.log(math.sin(math.exp(a))) + math.log(math.tan(math.exp(a) / 2)) / F - C,
                           -100, math.log(math.pi - phi)))  # fmt: skip


def compiled(module, seed):
    """The structure of this seed."""
    M = structure(seed)
    space = {}
    exec(M.text, space)
    return Played(module, M, space, {p.name for p in space["S"].parameters})


def _given(system, p):
    return {k: float(v) for k, v in p.items() if k in {q.name for q in system.parameters}}


def play(played, seed):
    """The verdict on one case."""
    M, one = played.model, case(played.model, seed)
    try:
        return {"a miss": _miss, "captured": _captured}.get(M.kind, _line)(played, one)
    except Exception as error:
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])


def _solve(system, one, start, end=None, **more):
    return judging.solve(system, (0, end or one.end), [float(u) for u in start], parameters=_given(system, one.p),
                 max_steps=STEPS, **one.options, **more)  # fmt: skip


def _line(played, one):
    space, d = played.system, played.model.d
    x, v = one.start
    plane = _solve(space["S"], one, [x, *[0] * (d - 1), v, *[0] * (d - 1)])
    line = _solve(space["L"], one, one.start)
    if not (plane.success and line.success):
        same = plane.outcome == line.outcome
        return Verdict(RIGHT if same else REFUSED, f"{plane.outcome.name}, the switch {line.outcome.name}")
    ours = [(e.time, e.kind) for e in plane.events]
    theirs = [(e.time, e.kind) for e in line.events if e.switch == "lam"]
    if [k for _, k in ours] != [k for _, k in theirs]:
        return Verdict(WRONG, f"disc {ours[:6]} switch {theirs[:6]}")
    late = np.abs(np.array([a[0] - b[0] for a, b in zip(ours, theirs, strict=True)]))
    error = float(np.abs(plane.x[[0, d], -1] - line.x[:, -1]).max())
    across = float(np.abs(np.delete(plane.x, [0, d], axis=0)).max())
    # Errors grow with what is behind: a stop forgets, a passage does not.
    if late.max(initial=0) > 1e-11 * (1 + one.end) or error > 1e-10 or across > 0:
        return Verdict(WRONG, f"late {late.max(initial=0):.1e} states {error:.1e} across {across:.1e}", error)
    return Verdict(RIGHT, error=max(error, late.max(initial=0)))


def _miss(played, one):
    d, (away,) = played.model.d, one.start
    F, mu = one.p["F"], one.p["mu"]
    end = 2.5 / (F - 0.9)
    s = _solve(played.system["S"], one, [*[0] * d, -math.cos(away), math.sin(away), *[0] * (d - 2)], end)
    if not s.success:
        return Verdict(REFUSED, s.outcome.name)
    v = s.x[d:]
    size = np.linalg.norm(v, axis=0)
    kept = size * mu + F * v[0]
    drift = float(np.abs(kept - kept[0] - (F * F - mu * mu) * s.t).max())
    steps = s.cost["steps"]
    if len(s.events):
        return Verdict(WRONG, f"least {one.least:.0e}: {[str(e) for e in s.events][:3]}", drift)
    if drift > 1e-11 * (1 + kept.max()):
        return Verdict(WRONG, f"identity off by {drift:.1e}, least {one.least:.0e}, F {F:.3f}", drift)
    if steps > 60 + 25 * math.log10(1 / one.least):
        return Verdict(WRONG, f"{steps} steps for a least speed of {one.least:.0e}, F {F:.3f}", drift)
    return Verdict(RIGHT, error=drift)


def _captured(played, one):
    d, (v,) = played.model.d, one.start
    F, mu = one.p["F"], one.p["mu"]
    rest = v / (F + mu)
    s = _solve(played.system["S"], one, [*[0] * d, -v, *[0] * (d - 1)], 2 * rest)
    if not s.success:
        return Verdict(REFUSED, s.outcome.name)
    if [e.kind for e in s.events] != ["stick"] or abs(s.events[0].time - rest) > 1e-12 * (1 + rest):
        return Verdict(WRONG, f"against F: {[str(e) for e in s.events]}, rest {rest}")
    if abs(s.x[0, -1] + v * rest / 2) > 1e-12 * v * rest or np.any(s.x[1:, -1]):
        return Verdict(WRONG, f"against F: rests at {s.x[:, -1]}, not at {-v * rest / 2}")
    s = _solve(
        played.system["S"], one, [*[0] * d, -v * math.cos(1e-3), v * math.sin(1e-3), *[0] * (d - 2)], 2 * rest
    )
    if not s.success:
        return Verdict(REFUSED, f"beside, {s.outcome.name}")
    if len(s.events):
        return Verdict(WRONG, f"beside: {[str(e) for e in s.events]}")
    u = s.x[d:]
    kept = np.linalg.norm(u, axis=0) * mu + F * u[0]
    drift = float(np.abs(kept - kept[0] - (F * F - mu * mu) * s.t).max() / (F * v))
    return Verdict(
        RIGHT if drift < 1e-10 else WRONG, "" if drift < 1e-10 else f"identity off by {drift:.1e}", drift
    )


def script(number, seed):
    """The case as a program."""
    M = structure(number)
    one = case(M, seed)
    return f"{M.text}\n# {M.kind}: {one}"
