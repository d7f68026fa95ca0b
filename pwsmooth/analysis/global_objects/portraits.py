"""The flow on a switching surface: where it crosses and slides, its folds, and how the motion goes on along it.

    g(lam; a) = dh/dt on h = 0,   g(lam) = 0, |lam| <= 1:   sliding, attracting where dg/dlam < 0
    g(+1) = 0, g(-1) = 0:   folds (tangencies) of the fields on both sides, visible where d2h/dt2 leads away
    g = dg/dlam = 0, |lam| < 1:   hidden folds, at which two sliding flows meet and end
    g(+1) = g(-1) = 0:   two-folds

in two coordinates a of the surface, states or time; a third state follows from h = 0. A hidden term gives several
sliding flows over one region, one for each lam.

Source: Filippov, Differential Equations with Discontinuous Righthand Sides, 1988; Jeffrey, On the mathematical basis
of solid friction, for hidden folds; A. Colombo, M. R. Jeffrey, SIAM J. Appl. Dyn. Syst. 10 (2011), for two-folds.
Chain: switching_surface.py, portrait.py, equilibria.py -> **portraits**.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from ...door import checks
from ..equilibria.finding import equilibria
from ..maps.sections import depends_on_time
from .portrait import FoldLine, SlidingPortrait, TwoFold
from .switching_surface import POLISHED, Surface, Values, contours, onto, roots_of

__all__ = ["sliding_portrait"]

_SAME = 1e-6  # of the box


@checks.door(
    system=checks.system, box=checks.mapping, at=checks.optional(checks.mapping), points=checks.integer(5, 2000)
)
def sliding_portrait(
    system: Any, switch: Any, box: Mapping[Any, Any], *, at: Mapping[Any, float] | None = None, points: int = 81
) -> SlidingPortrait:
    """The portrait of the surface of one switch: regions, sliding flows, folds, two-folds, pseudo-equilibria.

    Parameters
    ----------
    system : System
        Exact or layered; with any number of states.
    switch : Switch, Symbol or str
        Whose surface.
    box : mapping of state or time to (float, float)
        Two coordinates on the surface with their bounds, in their units.
    at : mapping of state or time to float, optional
        Values, in their units, of all others but one, which follows from h = 0; the time at which a driven system is
        frozen.
    points : int
        Of the grid in each direction.

    Returns
    -------
    SlidingPortrait
        Data, with a plot.

    Raises
    ------
    ValueError, TypeError
        Not two coordinates, or not one state left for h = 0, in which h has to be linear; a system that depends on
        time, if time is neither; a switch that cannot slide; algebraic unknowns.

    Notes
    -----
    Lines are contours of the grid, whose points are then put onto the line by Newton's method: pieces smaller than a
    cell are not seen. Other switches are taken on the sides on which they are; where a contact would be closed there
    are no values.

    Source: Filippov 1988; Colombo and Jeffrey 2011, for two-folds.

    Examples
    --------
    A two-fold: above the surface z = 0 the fold is y = 0, below it is x = 0.

    >>> x, y, z = sp.symbols("x y z", real=True)
    >>> lam = Switch("lam", z)
    >>> up, down = (1 + lam) / 2, (1 - lam) / 2
    >>> teixeira = System({x: up - down, y: -up + down, z: -up * y + down * x})
    >>> portrait = sliding_portrait(teixeira, lam, {x: (-1, 1), y: (-1, 1)})
    >>> [(two.kind, [round(abs(float(c)), 9) for c in two.point]) for two in portrait.two_folds]
    [('visible-visible', [0.0, 0.0])]
    """
    system = system._written_out()
    model = system.model
    checks.without_discs(model, "sliding portraits")
    able = [m for m in model.multipliers if m.kind == "switch" and m.regularity == "sliding"]
    name = checks.lookup(switch, [m.symbol for m in able], "`switch`", "switch that can slide")
    j = next(k for k, m in enumerate(model.multipliers) if m.symbol == name)
    if any(m.kind == "algebraic" for m in model.multipliers) or model.n_memory:
        raise ValueError(
            "`system` has algebraic unknowns or memories, whose values on the surface are not known here."
        )
    names = (*model.states, model.time)
    bounds: dict[Any, tuple[float, float]] = {}
    for key, pair in box.items():
        s = checks.lookup(key, names, "`box`", "state or time")
        bounds[s] = checks.pair(pair, f"`box` of {s}")
        if not bounds[s][0] < bounds[s][1]:
            raise ValueError(f"`box` of {s} is {bounds[s]}; give the lowest first.")
    fixed = {}
    for key, value in (at or {}).items():
        s = checks.lookup(key, names, "`at`", "state or time")
        fixed[s] = checks.number(value, f"`at`, value of {s}")
    left = [s for s in model.states if s not in bounds and s not in fixed]
    if len(bounds) != 2 or len(left) != 1 or bounds.keys() & fixed.keys():
        raise ValueError(
            f"`box` has {checks.listing(bounds)} and `at` {checks.listing(fixed) or 'nothing'}: give bounds of two "
            f"coordinates, and values of all other states but one, which follows from h = 0; now {len(left)} are left."
        )
    if depends_on_time(model) and model.time not in bounds and model.time not in fixed:
        raise ValueError(f"`system` depends on time; give {model.time} bounds in `box`, or a value in `at`.")
    chosen = tuple(bounds)
    surface = Surface(system, j, chosen, fixed)
    axes = [np.linspace(low, high, points) for low, high in bounds.values()]
    return _portrait(surface, axes, not depends_on_time(model) and not fixed and model.time not in bounds)


def _portrait(surface: Surface, axes: list[np.ndarray], still: bool) -> SlidingPortrait:
    grid = np.array([part.ravel() for part in np.meshgrid(*axes)])
    shape = len(axes[1]), len(axes[0])
    lam, g = surface.lam, surface.function([surface.g])
    slope = surface.function([surface.g.diff(lam)])
    roots = roots_of(lambda a, value: g(a, value)[0], grid)
    attracts = np.array([slope(grid, root)[0] < 0 for root in roots]).reshape(roots.shape)
    flow = surface.function(surface.rates)
    velocity = np.array([flow(grid, root) for root in roots]).reshape(len(roots), 2, -1)
    velocity[np.isnan(np.repeat(roots[:, None], 2, axis=1))] = np.nan
    below, above = g(grid, -1.0)[0], g(grid, 1.0)[0]
    spans = np.array([np.ptp(axis) for axis in axes])
    folds = []
    for side, values in ((1, above), (-1, below)):
        test = _at(surface, [surface.g, *(surface.g.diff(s) for s in surface.chosen)], side)
        turn = surface.function([surface.turn(side)])
        for line in contours(axes, values.reshape(shape)):
            line = onto(test, line, spans)
            folds.append(FoldLine(side, line, side * turn(line, float(side))[0] > 0))
    return SlidingPortrait(
        surface.system, str(lam), (str(surface.chosen[0]), str(surface.chosen[1])), (axes[0], axes[1]),
        _regions(below, above, roots).reshape(shape), roots.reshape(-1, *shape), attracts.reshape(-1, *shape),
        velocity.reshape(-1, 2, *shape), tuple(folds), tuple(_hidden_folds(surface, axes, grid, spans)),
        tuple(_two_folds(surface, axes, below.reshape(shape), above.reshape(shape), spans)),
        tuple(_pseudo_equilibria(surface, axes, grid)) if still else (),
    )  # fmt: skip


def _regions(below: np.ndarray, above: np.ndarray, roots: np.ndarray) -> np.ndarray:
    """Places in `REGIONS` (portrait.py)."""
    inner = np.abs(roots) < 1 - 1e-12
    up, down, held = below > 0, above < 0, inner.any(axis=0)
    region = np.select(
        [up & down, up & held, down & held, up, down, inner.sum(axis=0) > 1],
        [2, 4, 5, 0, 1, 6],
        default=3,
    )
    return np.where(np.isnan(below + above), -1, region)


def _at(surface: Surface, expressions: list[sp.Expr], side: int) -> Values:
    f = surface.function([e.xreplace({surface.lam: sp.Integer(side)}) for e in expressions])

    def test(a: np.ndarray, _: Any = None) -> np.ndarray:
        return f(a, float(side))

    return test


def _hidden_folds(
    surface: Surface, axes: list[np.ndarray], grid: np.ndarray, spans: np.ndarray
) -> list[np.ndarray]:
    """Lines (3, N) in the coordinates and lambda on which two roots meet."""
    lam, g = surface.lam, surface.g
    if g.diff(lam, 2) == 0:
        return []
    value, slope = (surface.function([e]) for e in (g, g.diff(lam)))
    names = (*surface.chosen, lam)
    system = surface.function([e.diff(s) if s else e for e in (g, g.diff(lam)) for s in (None, *names)])
    lines = []
    for critical in roots_of(lambda a, at: slope(a, at)[0], grid):
        extreme = value(grid, critical)[0].reshape(len(axes[1]), -1)
        for line in contours(axes, extreme):
            nearest = [
                int(np.argmin((((grid - a[:, None]) / spans[:, None]) ** 2).sum(axis=0))) for a in line.T
            ]
            u = np.vstack([line, critical[nearest]])
            unit = np.array([*spans, 1.0])
            for _ in range(POLISHED):
                rows = system(u[:2], u[2]).reshape(2, 4, -1)
                if not np.isfinite(rows).all():
                    break
                matrix = np.moveaxis(rows[:, 1:], 2, 0) * unit
                u = u - (np.linalg.pinv(matrix) @ np.moveaxis(rows[:, :1], 2, 0))[:, :, 0].T * unit[:, None]
            kept = np.abs(u[2]) < 1
            if kept.sum() > 1:
                lines.append(u[:, kept])
    return lines


def _two_folds(
    surface: Surface, axes: list[np.ndarray], below: np.ndarray, above: np.ndarray, spans: np.ndarray
) -> list[TwoFold]:
    """Points at which the folds of both sides meet."""
    tests = [_at(surface, [surface.g, *(surface.g.diff(s) for s in surface.chosen)], side) for side in (1, -1)]
    turns = [(side, surface.function([surface.turn(side)])) for side in (1, -1)]
    found: list[TwoFold] = []

    def changes(values: np.ndarray) -> np.ndarray:
        corners = np.stack([values[:-1, :-1], values[1:, :-1], values[:-1, 1:], values[1:, 1:]])
        return (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)

    for row, column in zip(*np.nonzero(changes(below) & changes(above))):
        a = np.array([axes[0][column : column + 2].mean(), axes[1][row : row + 2].mean()])
        for _ in range(3 * POLISHED):
            values = np.array([test(a[:, None], None)[:, 0] for test in tests])
            if not np.isfinite(values).all() or abs(np.linalg.det(values[:, 1:] * spans)) == 0:
                break
            a = a - np.linalg.solve(values[:, 1:], values[:, 0])
        residual = np.abs([test(a[:, None], None)[0, 0] for test in tests]).max()
        scale = np.abs(values[:, 1:] * spans).max()
        inside = all(axis[0] <= c <= axis[-1] for axis, c in zip(axes, a))
        if not (inside and residual <= 1e-10 * scale):
            continue
        if any(np.abs((two.point - a) / spans).max() < _SAME for two in found):
            continue
        seen = sorted(
            "visible" if side * turn(a[:, None], float(side))[0, 0] > 0 else "invisible" for side, turn in turns
        )
        found.append(TwoFold(a, "-".join(reversed(seen))))
    return found


def _pseudo_equilibria(surface: Surface, axes: list[np.ndarray], grid: np.ndarray) -> list[Any]:
    """Pseudo-equilibria inside the box."""
    third = surface.function([surface.given[surface.gone]])(grid, 0.0)[0]
    third = third[np.isfinite(third)]
    room = 1e-6 + 0.01 * np.ptp(third)
    box = {s: (axis[0], axis[-1]) for s, axis in zip(surface.chosen, axes)}
    box[surface.gone] = (third.min(initial=0.0) - room, third.max(initial=0.0) + room)
    return [e for e in equilibria(surface.system, box, sides={surface.lam: 0}) if e.admissible]
