"""Stability of an equilibrium: of the flow on the sliding manifold, and of the layer that holds it there.

    A = T' (f_x + f_J lam_x) T,   lam_x = -(g_JJ)**-1 g_Jx,   T a basis of the directions along what is held
    L = Lambda'(lam_S)/eps_S (g_SS - g_SK (g_KK)**-1 g_KS),   S the switches held, K the other solved unknowns

Of a disc that is held Lambda' is a matrix, with Lambda/u across lambda. Of one that slips lambda and the speed r are
unknowns (disc_modes.py).

h = 0 of a switch that slides takes one direction, h = dh/dt = 0 of a closed contact two. L belongs to the motion of the
multipliers through the layer: where it has an eigenvalue on the right, the slow flow runs on a branch that repels.
At a Hopf point the first Lyapunov coefficient says which way the cycles go.

Chain: paths/derivatives/linearised.py, disc_modes.py -> **equilibrium_stability** -> statics.py, equilibrium.py.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model
from ...definition.sigmoids import sigmoid
from ...paths.derivatives.linearised import Linearised, linearise
from ...results.outputs import vectorised
from .disc_modes import completed, held, in_mode, places, unknowns

_ON_SURFACE = 1e-9  # of h, lambda and reactions, relative: nearer than this it lies on the border
_ROUNDING = 1e-12  # to which a state at 0 is known, in its unit
_EIGENVALUE = 1e-9  # relative to the largest: nearer to the imaginary axis nothing is decided
_MOST_STATES = 12  # of a Lyapunov coefficient: third derivatives are n**4/6 expressions
_CANCELLED = 1e-9  # of a Lyapunov coefficient's terms: a Hopf point is known to some 1e-10
_SAME_SLOPE = 1e-9  # of Jacobians on both sides of a kink
_ASIDE = 1e-10  # how far beside a point that has no derivative it is asked for


@dataclass(frozen=True)
class Linear:
    """The linear part at an equilibrium: `matrix` (d, d) on the basis `along` (n, d), and the `layer`'s (k, k).

    `undecided` says why eigenvalues do not decide; it is empty where they do. On a kink `joined` are the rates of the
    motion on both of its sides together, in the place of eigenvalues.
    """

    matrix: np.ndarray
    along: np.ndarray
    layer: np.ndarray
    undecided: str
    joined: np.ndarray | None = None

    @functools.cached_property
    def eigenvalues(self) -> np.ndarray:
        return _eigenvalues(self.matrix) if self.joined is None else self.joined

    @functools.cached_property
    def layer_eigenvalues(self) -> np.ndarray:
        return _eigenvalues(self.layer)


def _eigenvalues(matrix: np.ndarray) -> np.ndarray:
    if not np.isfinite(matrix).all():
        return np.full(len(matrix), np.nan, complex)
    values = np.linalg.eigvals(matrix).astype(complex)
    return values[np.argsort(-values.real, kind="stable")]


def signs(values: np.ndarray) -> tuple[int, int, int]:
    """How many eigenvalues lie left of the imaginary axis, on it and right of it."""
    size = _EIGENVALUE * np.abs(values).max(initial=0.0)
    left, right = int(np.sum(values.real < -size)), int(np.sum(values.real > size))
    return left, len(values) - left - right, right


def linear_at(system: Any, x: np.ndarray, mult: np.ndarray, sides: tuple[int, ...]) -> Linear:
    """The linear part at a point (n,), (m,) of a mode."""
    model = system.model
    line, mult, p = _in_its_mode(system, x, mult, sides)
    n, constraints = len(model.states) - model.n_memory, system._constraints
    J = unknowns(model, sides)
    inside, on = margins(line, x, mult, p, sides)
    met = np.flatnonzero(np.abs(inside) <= on).tolist()
    kinks = [j for j in met if sides[j] and model.multipliers[j].regularity == "kink"]
    undecided = next((_border(model.multipliers[j], sides[j], mult[j]) for j in met if j not in kinks), "")
    # At rest h/|h| of a disc may be any direction.
    own = {j: [j] for j in kinks} | {j: parts for j, parts in places(model) if j in kinks}
    J = [j for j in J if not any(j == kink or j in parts for kink, parts in own.items())]
    matrix, along = _on_manifold(line, x, mult, p, n, J, constraints)
    joined = _joined(line, x, mult, p, n, met[0]) if len(met) == 1 and not J else None
    if joined is not None:
        return Linear(matrix, along, _layer(line, x, mult, p, sides, J), "", joined)
    if not (np.isfinite(matrix).all() or np.isfinite(line.blocks(*_point(x, mult), p).f_w).all()):
        # The tip of a cone |v|, which has no derivative.
        around = [
            _on_manifold(line, x + np.pad(step, (0, len(x) - n)), mult, p, n, J, constraints)
            for step in beside(8, n)
        ]
        slopes = [basis @ slope @ basis.T for slope, basis in around]
        matrix, along = around[0]
        if any(_differ(slope, slopes[0]) for slope in slopes):
            undecided = undecided or "its Jacobian jumps there"
    if kinks:
        ways = [
            [(parts, side * way) for way in np.eye(len(parts)) for side in (1, -1)] for parts in own.values()
        ]
        for turned in itertools.product(*ways):
            other = mult.copy()
            for parts, way in turned:
                other[parts] = way
            slope = _on_manifold(line, x, other, p, n, J, constraints)[0]
            if _differ(slope, matrix):
                names = ", ".join(str(line.symbols[j]) for j in kinks)
                undecided = undecided or f"it lies on the kink of {names}, where the Jacobian jumps"
    for j in J:
        mu = model.multipliers[j]
        if mu.kind == "switch" and mu.regularity != "sliding":
            undecided = undecided or (
                f"{mu.symbol} holds it on a surface of relative degree 2 or more, where the motion beside it decides"
            )
    if not np.isfinite(matrix).all():
        undecided = undecided or "dg/dlambda = 0 for what is held: the sliding flow has no slope there"
    return Linear(matrix, along, _layer(line, x, mult, p, sides, J), undecided)


def layer_at(system: Any, x: np.ndarray, mult: np.ndarray, sides: tuple[int, ...]) -> np.ndarray:
    """The Jacobian of the layer alone, (k, k), at a point (n,), (m,) of a mode."""
    line, mult, p = _in_its_mode(system, x, mult, sides)
    return _layer(line, x, mult, p, sides, unknowns(system.model, sides))


def _in_its_mode(
    system: Any, x: np.ndarray, mult: np.ndarray, sides: tuple[int, ...]
) -> tuple[Linearised, np.ndarray, np.ndarray]:
    line, p = linearise(in_mode(system.model, sides)), np.array(system.parameter_values, float)
    return line, completed(line, sides, x[:, None], mult[:, None], p)[:, 0], p


def _joined(
    line: Linearised, x: np.ndarray, mult: np.ndarray, p: np.ndarray, n: int, j: int
) -> np.ndarray | None:
    """Rates of the motion near a point of the surface h_j = 0 at which the fields of both sides vanish.

    On a ray that stays on its side its eigenvalue. Without such rays the motion turns: in half a turn of a focus
    a +- i w it grows by exp(pi a/w), and the rates are those of both halves together. None of more than two states, and
    where it may slide.
    """
    if n > 2 or line.model.multipliers[j].kind != "switch":
        return None
    slopes = []
    for side in (1, -1):
        there = mult.copy()
        there[j] = side
        blocks = line.blocks(*_point(x, there), p)
        F, A = blocks.f[0][:n], blocks.f_w[0][:n, :n]
        rounding = np.abs(A) @ (_ON_SURFACE * np.abs(x[:n]) + _ROUNDING)
        if not (np.isfinite(A).all() and np.all(np.abs(F) <= rounding)):
            return None
        slopes.append(A)
    if not _differ(*slopes):
        return None
    if n == 2:
        C = line.gradient(line.model.multipliers[j].surface, 0.0, x, mult, p)[0][:n]
        along = np.array([-C[1], C[0]])
        a, b = (float(C @ A @ along) for A in slopes)
        if not a * b > 0 or min(abs(a), abs(b)) <= _SAME_SLOPE * (C @ C) * np.abs(slopes).max():
            return None
    pairs = [np.linalg.eigvals(A).astype(complex) for A in slopes]
    rays = [rate for pair in pairs for rate in pair if np.abs(pair.imag).max() == 0]
    if rays:
        return np.array(sorted(rays, key=lambda rate: -rate.real))
    halves = [math.pi / np.abs(pair.imag).max() for pair in pairs]
    rate = sum(half * pair[0].real for half, pair in zip(halves, pairs)) / sum(halves)
    return rate + 2j * math.pi / sum(halves) * np.array([1, -1])


def _differ(slope: np.ndarray, matrix: np.ndarray) -> bool:
    return bool(np.abs(slope - matrix).max(initial=0.0) > _SAME_SLOPE * (1 + np.abs(matrix).max(initial=0.0)))


def beside(count: int, n: int) -> np.ndarray:
    """Steps (count, n) in several directions so short that what has a derivative keeps it."""
    ways = np.random.default_rng(0).standard_normal((count, n))
    return _ASIDE * ways / np.linalg.norm(ways, axis=1, keepdims=True)


def _point(x: np.ndarray, mult: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros(1), x[:, None], mult[:, None]


def _on_manifold(
    line: Linearised, x: np.ndarray, mult: np.ndarray, p: np.ndarray, n: int, J: list[int],
    constraints: tuple[sp.Expr, ...] = (),
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The Jacobian of the flow along what is held and along constraints, and a basis of these directions."""
    blocks = line.blocks(*_point(x, mult), p)
    multipliers = line.model.multipliers
    if not all(line.solvable[j] for j in J):
        return np.full((n, n), np.nan), np.eye(n)
    try:
        flow = blocks.flow(J)[0][:n, :n]
        lam_x = blocks.solved(J)[0][0][:, :n] if J else np.zeros((0, n))
    except np.linalg.LinAlgError:  # a fold of the layer: lambda has no slope
        flow, lam_x = np.full((n, n), np.nan), np.zeros((len(J), n))
    rows = [*line.values(constraints, *_point(x, mult), p)[1][0][:, :n]]
    _, c_w, c_lam = line.constraints(*_point(x, mult), p)
    for j in J:
        mu = multipliers[j]
        if mu.surface is None or mu.residual == mu.surface:
            continue  # solved at its instant: it takes no direction away
        rows.append(c_w[0, j, :n] + c_lam[0, j, J] @ lam_x)
        if mu.kind == "contact" or mu.regularity != "sliding":
            h_w, _, h_lam = line.gradient(line.speed(j), 0.0, x, mult, p)
            rows.append(h_w[:n] + h_lam[J] @ lam_x)
    along = np.eye(n)
    if rows:
        _, sizes, right = np.linalg.svd(np.array([row / (np.linalg.norm(row) or 1.0) for row in rows]))
        along = right[np.sum(sizes > 1e-12 * sizes[0]) :].T
    return along.T @ flow @ along, along


def margins(
    line: Linearised, x: np.ndarray, mult: np.ndarray, p: np.ndarray, sides: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """How far a point is inside its mode, for each multiplier, and below which size that is none: (m,), (m,).

    h on its own side, 1 - |lam| while held, the speed of a disc's slip, the reaction of a closed contact; inf for an
    unknown.
    """
    c, c_w, _ = (part[0] for part in line.constraints(*_point(x, mult), p))
    inside, on = np.full(len(sides), np.inf), np.full(len(sides), _ON_SURFACE)
    rounding = np.abs(c_w[:, : len(x)]) @ (_ON_SURFACE * np.abs(x) + _ROUNDING)
    for own, parts in places(line.model):
        inside[own] = mult[own] if sides[own] else 1 - math.sqrt(max(mult[own], 0.0))
        on[own] = rounding[parts].sum() if sides[own] else _ON_SURFACE
    for j, mu in enumerate(line.model.multipliers):
        if mu.kind == "disc":
            continue
        if sides[j]:
            inside[j], on[j] = sides[j] * c[j], rounding[j]
        elif mu.kind == "contact":
            inside[j], on[j] = mult[j], _ON_SURFACE * np.abs(mult).max() + _ROUNDING
        elif mu.kind == "switch":
            inside[j] = 1 - abs(mult[j])
    return inside, on


def _border(mu: Any, side: int, value: float) -> str:
    """Why a point on the border of its mode has no eigenvalues that decide."""
    if side:
        return f"it lies on the surface of {mu.symbol} and is held by neither side"
    if mu.kind == "disc":
        return f"|{mu.symbol}| stands on its bound 1"
    return f"{mu.symbol} = {value:.6g} stands on its bound"


def _layer(
    line: Linearised, x: np.ndarray, mult: np.ndarray, p: np.ndarray, sides: tuple[int, ...], J: list[int]
) -> np.ndarray:
    """The Jacobian L of the layer, in the first switch's eps; with layered states theirs below."""
    model = line.model
    S = [j for j in held(model, sides) if model.multipliers[j].regularity == "sliding"]
    S = [j for j in S if model.multipliers[j].residual != model.multipliers[j].surface]
    if not S:
        return np.zeros((0, 0))
    K = [j for j in J if j not in S]
    speed = _speed(model, mult, S)
    finite = [z for z in model.layer_states if z.ratio != sp.oo]
    if not finite:
        g = line.blocks(*_point(x, mult), p).g_lam[0]
        square = g[np.ix_(S, S)]
        if K:
            try:
                square = square - g[np.ix_(S, K)] @ np.linalg.solve(g[np.ix_(K, K)], g[np.ix_(K, S)])
            except np.linalg.LinAlgError:  # a slip without speed has no direction of its own
                return np.full_like(square, np.nan)
        return speed @ square
    functions = _layered(model)
    z = [float(np.ravel(f(0.0, *x, *mult, *p))[0]) for f in functions[0]]
    values = np.array([np.ravel(v)[0] for v in functions[1](0.0, *x, *mult, *p, *z)], float)
    k = len(finite)
    g_lam, g_z, Q_lam, Q_z, r = np.split(values, np.cumsum([line.m * line.m, line.m * k, k * line.m, k * k]))
    g_lam, g_z = g_lam.reshape(line.m, line.m), g_z.reshape(line.m, k)
    Q_lam, Q_z = Q_lam.reshape(k, line.m), Q_z.reshape(k, k)
    inner = speed @ g_lam[np.ix_(S, S)]
    if not r.any():  # two stages: lambda first, then z along its root
        rest = Q_z - Q_lam[:, S] @ np.linalg.solve(inner, speed @ g_z[S])
        return np.block([[inner, np.zeros((len(S), k))], [np.zeros((k, len(S))), rest]])
    return np.block([[inner, speed @ g_z[S]], [r[:, None] * Q_lam[:, S], r[:, None] * Q_z]])


def _speed(model: Model, mult: np.ndarray, S: list[int]) -> np.ndarray:
    """How fast the multipliers S move through their layers as dh/dt is 1: a row and a column each.

    Of a switch Lambda', of a disc with the radius u of Lambda(u) = |lambda| the matrix that has Lambda' along lambda
    and Lambda/u across it.
    """
    slope, inverse = sigmoid_slope(model.sigmoid), sigmoid_inverse(model.sigmoid)
    speed = np.zeros((len(S), len(S)))
    # Beyond 1, where an equilibrium is virtual, no sigmoid has a slope: there its sign is all that is asked for.
    for k, j in enumerate(S):
        speed[k, k] = (slope(mult[j]) if abs(mult[j]) < 1 else 1.0) / model.eps_ratio[j]
    for own, parts in places(model):
        at = [k for k, j in enumerate(S) if j in parts]
        size = float(np.linalg.norm(mult[parts]))
        if at and size > 0:
            n = mult[parts] / size
            along, across = (slope(size), size / inverse(size)) if size < 1 else (1.0, 1.0)
            matrix = across * np.eye(len(n)) + (along - across) * np.outer(n, n)
            speed[np.ix_(at, at)] = matrix / model.eps_ratio[own]
    return speed


@functools.lru_cache(maxsize=16)
def _layered(model: Model) -> Any:
    """Functions of the equilibria of layered states, and of derivatives of the layer's residuals and rates."""
    finite = [z for z in model.layer_states if z.ratio != sp.oo]
    lams, zs = [mu.symbol for mu in model.multipliers], [z.symbol for z in finite]
    slaved = {z.symbol: z.equilibrium for z in model.layer_states if z.ratio == sp.oo}
    g, Q = [e.xreplace(slaved) for e in model.layer_residuals], [z.rate.xreplace(slaved) for z in finite]
    parts = [e.diff(s) for expressions, symbols in ((g, lams), (g, zs), (Q, lams), (Q, zs))
             for e in expressions for s in symbols]  # fmt: skip
    parts += [z.ratio for z in finite]
    return (
        [vectorised(model, z.equilibrium) for z in finite],
        vectorised(model, sp.Tuple(*parts), tuple(zs)),
    )


@functools.lru_cache(maxsize=8)
def sigmoid_slope(name: str) -> Any:
    lam = sp.Symbol("lam", real=True)
    return sp.lambdify(lam, sigmoid(name).slope(lam), modules=["scipy", "numpy"])


@functools.lru_cache(maxsize=8)
def sigmoid_inverse(name: str) -> Any:
    lam = sp.Symbol("lam", real=True)
    return sp.lambdify(lam, sigmoid(name).inverse(lam), modules=["scipy", "numpy"])


def lyapunov_coefficient(system: Any, x: np.ndarray, mult: np.ndarray, sides: tuple[int, ...]) -> float | None:
    """First Lyapunov coefficient at a Hopf point of a smooth mode; None where unknowns are solved or states are many.

    Exactly 0 where its terms cancel to what an error of the point leaves of them.

    With A q = i w q, A' p = -i w p, <q, q> = <p, q> = 1 and the derivatives B, C of second and third order of the rates

        l1 = Re(<p, C(q, q, q*)> - 2 <p, B(q, A**-1 B(q, q*))> + <p, B(q*, (2 i w - A)**-1 B(q, q))>)/(2 w)
    """
    model = system.model
    n = len(model.states) - model.n_memory
    if n > _MOST_STATES or any(
        side == 0 and mu.kind != "component" for mu, side in zip(model.multipliers, sides)
    ):
        return None
    mult = mult.copy()
    mult[[own for own, _ in places(model)]] = 1.0  # they slip, with lambda = h/|h|
    line = linearise(model)
    p_ = np.array(system.parameter_values, float)
    A = line.blocks(*_point(x, mult), p_).f_w[0][:n, :n]
    values, vectors = np.linalg.eig(A)
    critical = np.argmin(np.abs(values.real) + np.where(values.imag > 0, 0.0, np.inf))
    q, w = vectors[:, critical], float(values[critical].imag)
    q = q / np.linalg.norm(q)
    left_values, left = np.linalg.eig(A.T)
    p = left[:, np.argmin(np.abs(left_values + 1j * w))]
    p = p / np.conj(np.vdot(p, q))
    B2, C3 = _derivatives(model)(x, mult, p_)

    def B(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.einsum("ijk,j,k->i", B2, a, b)

    cubic = np.einsum("ijkl,j,k,l->i", C3, q, q, q.conj())
    one = B(q, np.linalg.solve(A, B(q, q.conj())))
    two = B(q.conj(), np.linalg.solve(2j * w * np.eye(n) - A, B(q, q)))
    terms = np.array([np.vdot(p, cubic), -2 * np.vdot(p, one), np.vdot(p, two)]) / (2 * w)
    total = float(terms.sum().real)
    return total if abs(total) > _CANCELLED * np.abs(terms).sum() else 0.0


@functools.lru_cache(maxsize=16)
def _derivatives(model: Model) -> Any:
    """Second and third derivatives of the rates by the states, as a function of a point: (n, n, n), (n, n, n, n)."""
    n = len(model.states) - model.n_memory
    states = model.states[:n]
    pairs = list(itertools.combinations_with_replacement(range(n), 2))
    triples = list(itertools.combinations_with_replacement(range(n), 3))
    second: dict[Any, sp.Expr] = {
        (i, *jk): model.rhs[i].diff(*(states[j] for j in jk)) for i in range(n) for jk in pairs
    }
    third: dict[Any, sp.Expr] = {
        (i, *jkl): second[i, jkl[0], jkl[1]].diff(states[jkl[2]]) for i in range(n) for jkl in triples
    }
    found = {key: e for key, e in {**second, **third}.items() if e != 0}
    function = vectorised(model, sp.Tuple(*found.values())) if found else None

    def evaluate(x: np.ndarray, mult: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        B, C = np.zeros((n,) * 3), np.zeros((n,) * 4)
        numbers = function(0.0, *x, *mult, *p) if function else ()
        for (i, *rest), number in zip(found, numbers):
            for order in set(itertools.permutations(rest)):
                (B if len(rest) == 2 else C)[(i, *order)] = number
        return B, C

    return evaluate
