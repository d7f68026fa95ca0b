"""The modes that equilibria are looked for in, and when two solutions are one.

Chain: equilibrium.py -> **equilibrium_modes** -> equilibria.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...definition.pointwise import value
from ...door import checks
from ...paths.derivatives.linearised import linearise
from ..maps.sections import depends_on_time
from .disc_modes import idle, in_mode, places
from .equilibrium import Equilibrium, made
from .stability import sigmoid_inverse
from .statics import RANK, ROUNDING, Statics

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
    able = [mu for mu in model.multipliers if mu.kind not in ("algebraic", "component")]
    for key, side in system._spread(sides, "`sides`").items():
        s = checks.lookup(key, [mu.symbol for mu in able], "`sides`", "switch or contact")
        mu = next(mu for mu in able if mu.symbol == s)
        allowed = _sides_of(mu)
        if type(side) not in (int, float, np.int64) or side not in allowed:
            said = {"contact": "a contact is open (1) or closed (0)", "disc": "a disc slips (1) or is held (0)"}
            choose = "choose one of " + ", ".join(map(str, allowed))
            raise ValueError(f"`sides` of {s} is {checks.shown(side)}; {said.get(mu.kind, choose)}.")
        given[s] = int(side)
    return [(given[mu.symbol],) if mu.symbol in given else _sides_of(mu) for mu in model.multipliers]


def _sides_of(mu: Any) -> tuple[int, ...]:
    if mu.kind in ("algebraic", "component"):
        return (0,)
    sides = (1,) if mu.kind in ("contact", "disc") else (1, -1)
    # A field that is continuous across a kink is never held there.
    return sides if mu.regularity == "kink" else (*sides, 0)


def same(one: Equilibrium, other: Equilibrium, unit: Any = 1.0) -> bool:
    """Whether two solutions are one point: also of two modes on whose common border it lies."""
    n = len(one.x) - one.system.model.n_memory
    if np.any(np.abs(one.x - other.x)[:n] > SAME * (unit + np.abs(one.x[:n]))):
        return False
    model = one.system.model
    apart = np.abs(one.mult - other.mult) > SAME * (1 + np.abs(one.mult))
    apart[idle(model)] = False  # those of one state are the same, but at rest, where they do nothing
    if one.sides == other.sides:
        return not apart.any()
    # The disc's own multiplier follows its components, but where it only says that it slips.
    free = [mu.kind == "disc" or (mu.kind == "switch" and mu.regularity == "kink") for mu in model.multipliers]
    return not np.any(apart & ~np.array(free, bool))


def fits(system: Any, x: np.ndarray) -> bool:
    """Whether the states have the properties that their symbols are declared to have, to rounding."""
    values = zip(system.model.states, x.tolist())
    return all(checks.fits(s, value) or checks.is_zero_of(s, value) for s, value in values)


def without_idle(found: list[Equilibrium]) -> list[Equilibrium]:
    """Of a point at which the fields of both sides vanish one side alone: what is held there does nothing."""
    dropped: list[Equilibrium] = []
    for e in found:
        own = len(e.x) - e.system.model.n_memory
        if e.isolated or np.any(np.abs(e.free_directions[:, :own]) > RANK):
            continue
        sides = [one for one in found if one.isolated and one.border]
        sides = [one for one in sides if np.all(np.abs(one.x - e.x) <= SAME * (1 + np.abs(e.x)))]
        dropped += [e, *sides[1:]] if sides else []
    return [e for e in found if not any(e is one for one in dropped)]


def set_ending_at(e: Equilibrium, found: list[Equilibrium]) -> Equilibrium | None:
    """An equilibrium of a side, on its surface, as one of the set that is held there and ends in it; None if none."""
    if not e.border:
        return None
    memories = e.x[len(e.x) - e.system.model.n_memory :]
    for sides in {one.sides for one in found if not one.isolated}:
        own = [j for j, (a, b) in enumerate(zip(e.sides, sides)) if a != b]
        # The end of a disc's set is a set itself: slips without speed, in any direction.
        if not (e.isolated or all(e.system.model.multipliers[j].kind == "disc" for j in own)):
            continue
        statics = Statics(e.system, sides, memories, unit=e.unit)
        u = statics.unknowns(e.x, e.mult)[None]
        error = statics.error(*statics(u), u)[0]
        if own and all(e.sides[j] for j in own) and error <= 1e3 * ROUNDING:
            return made(statics, u[0], error, e.steps, e.system)
    return None


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
    widths = [values[eps.name] for _, eps in model.smoothing]  # in the order of the switches, then of the discs
    inverse = sigmoid_inverse(model.sigmoid)
    for e in found(exact):
        line = linearise(in_mode(e.system.model, e.sides))
        kinds = [mu.kind for mu in e.system.model.multipliers]
        layers = [(j, [j]) for j, kind in enumerate(kinds) if kind == "switch"] + places(e.system.model)
        p = np.array(e.system.parameter_values, float)
        by_x = line.constraints(np.zeros(1), e.x[:, None], e.mult[:, None], p)[1][0]
        depths: dict[int, float] = {}
        for (own, parts), width in zip(layers, widths):
            size = float(np.linalg.norm(e.mult[parts]))
            if e.sides[own] == 0 and size < 1:
                deep = width * inverse(size) / size if size > 0 else 0.0
                depths |= {j: deep * e.mult[j] for j in parts}
        H, depth = by_x[list(depths)], np.array(list(depths.values()))
        at = dict(zip(map(str, e.system.states), e.x + np.linalg.pinv(H) @ depth))
        point = {s: v for s, v in zip((mu.symbol for mu in e.system.model.multipliers), e.mult)}
        point |= dict(zip(e.system.states, e.x)) | e.system.parameters
        at |= {str(z.symbol): value(z.equilibrium, point) for z in e.system.model.layer_states}
        seeds.append(np.array([at[str(s)] for s in model.states[:n]]))
    return np.array(seeds).reshape(-1, n)
