"""The modes that equilibria are looked for in, and when two solutions are one.

Chain: equilibrium.py -> **equilibrium_modes** -> equilibria.py.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from ..definition import checks
from ..definition.pointwise import value
from ..definition.sigmoids import sigmoid
from ..paths.linearised import linearise
from .equilibrium import Equilibrium
from .sections import depends_on_time
from .statics import ROUNDING, Statics

SAME = 1e-7  # relative: nearer together two solutions are one (double ones come as near as 1e-8)


def autonomous(system: Any, what: str) -> Any:
    """The system, written out; ValueError where it depends on time."""
    system = system._written_out()
    model = system.model
    if depends_on_time(model):
        timed = [
            f"the rate of {x}" for x, rate in zip(model.states, model.rhs) if model.time in rate.free_symbols
        ]
        timed += [f"the event {event.name!r}" for event in model.events if event.surface is None]
        names = checks.listing(timed[:5]) if timed else "a surface, gap or residual"
        raise ValueError(
            f"{what} depends on time ({names}), so that it has no equilibria; its periodic orbits are what "
            "find_orbit() finds, with the `period` of its forcing. Or give it constants in the place of what moves it."
        )
    return system


def modes(system: Any, sides: Mapping[Any, Any] | None) -> list[tuple[int, ...]]:
    """The sides that each multiplier may have, with those that are given."""
    model, given = system.model, {}
    sides = checks.mapping({} if sides is None else sides, "`sides`", "switches to 1, -1 or 0")
    able = [mu for mu in model.multipliers if mu.kind != "algebraic"]
    for key, side in system._spread(sides, "`sides`").items():
        s = checks.lookup(key, [mu.symbol for mu in able], "`sides`", "switch or contact")
        mu = next(mu for mu in able if mu.symbol == s)
        allowed = _sides_of(mu)
        if type(side) not in (int, float, np.int64) or side not in allowed:
            said = "a contact is open (1) or closed (0)" if mu.kind == "contact" else "choose one of " + ", ".join(
                map(str, allowed)
            )  # fmt: skip
            raise ValueError(f"`sides` of {s} is {checks.shown(side)}; {said}.")
        given[s] = int(side)
    return [(given[mu.symbol],) if mu.symbol in given else _sides_of(mu) for mu in model.multipliers]


def _sides_of(mu: Any) -> tuple[int, ...]:
    if mu.kind == "algebraic":
        return (0,)
    if mu.kind == "contact":
        return (1, 0)
    # A field that is continuous across a kink is never held there.
    return (1, -1) if mu.regularity == "kink" else (1, -1, 0)


def same(one: Equilibrium, other: Equilibrium, unit: Any = 1.0) -> bool:
    """Whether two solutions are one point: also of two modes on whose common border it lies."""
    n = len(one.x) - one.system.model.n_memory
    if np.any(np.abs(one.x - other.x)[:n] > SAME * (unit + np.abs(one.x[:n]))):
        return False
    if one.sides == other.sides:
        return bool(np.all(np.abs(one.mult - other.mult) <= SAME * (1 + np.abs(one.mult))))
    apart = np.abs(one.mult - other.mult) > SAME * (1 + np.abs(one.mult))
    kinks = [mu.kind == "switch" and mu.regularity == "kink" for mu in one.system.model.multipliers]
    return not np.any(apart & ~np.array(kinks, bool))


def fits(system: Any, x: np.ndarray) -> bool:
    """Whether the states have the properties that their symbols are declared to have, to rounding."""
    values = zip(system.model.states, x.tolist())
    return all(checks.fits(s, value) or checks.is_zero_of(s, value) for s, value in values)


def ends_set(e: Equilibrium, found: list[Equilibrium]) -> bool:
    """Whether an equilibrium of a side, on its surface, is the end of a set that is held there."""
    if not e.border or not e.isolated:
        return False
    memories = e.x[len(e.x) - e.system.model.n_memory :]
    for sides in {one.sides for one in found if not one.isolated}:
        own = [a for a, b in zip(e.sides, sides) if a != b]
        statics = Statics(e.system, sides, memories)
        u = np.concatenate([e.x[: statics.n], e.mult[statics.J]])[None]
        if own and all(own) and statics.error(*statics(u), u)[0] <= 1e3 * ROUNDING:
            return True
    return False


def beside_exact(system: Any, found: Any) -> np.ndarray:
    """Starts for a smoothed view, (k, n): where the exact system stands still, within its layers lam = Lambda(h/eps).

    Outside of its layers a smoothed switch is flat, and no start leads into them.
    """
    model, view = system.model, system._view
    n = len(model.states) - model.n_memory
    seeds: list[np.ndarray] = []
    if not model.smoothing:
        return np.empty((0, n))
    values = {p.name: value for p, value in system.parameters.items()}
    exact = view.original
    exact = exact.with_parameters({p.name: values[p.name] for p in exact.parameters if p.name in values})
    widths = [values[eps.name] for _, eps in model.smoothing]  # in the order of the switches
    inverse = _inverse(model.sigmoid)
    for e in found(exact):
        held = [j for j, side in enumerate(e.sides) if side == 0 and j < len(widths) and abs(e.mult[j]) < 1]
        line = linearise(e.system.model)
        p = np.array(e.system.parameter_values, float)
        H = line.constraints(np.zeros(1), e.x[:, None], e.mult[:, None], p)[1][0][held]
        depth = np.array([widths[j] * inverse(e.mult[j]) for j in held])
        at = dict(zip(map(str, e.system.states), e.x + np.linalg.pinv(H) @ depth))
        point = {s: v for s, v in zip((mu.symbol for mu in e.system.model.multipliers), e.mult)}
        point |= dict(zip(e.system.states, e.x)) | e.system.parameters
        at |= {str(z.symbol): value(z.equilibrium, point) for z in e.system.model.layer_states}
        seeds.append(np.array([at[str(s)] for s in model.states[:n]]))
    return np.array(seeds).reshape(-1, n)


@functools.lru_cache(maxsize=8)
def _inverse(name: str) -> Any:
    lam = sp.Symbol("lam", real=True)
    return sp.lambdify(lam, sigmoid(name).inverse(lam), modules=["scipy", "numpy"])
