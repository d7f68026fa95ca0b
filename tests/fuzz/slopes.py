"""Derivatives of piecewise-affine runs against complex steps through matrix exponentials.

On a mode, the sides s_j = sgn(h_j) of the switches and the set K of those that slide, z = (x, S, C, t, 1) obeys
z' = M z, with lambda_K = -(G B)^-1 G M_0 z put in on slides. The oracle finds the modes and their ends itself, on
exponentials; then it goes along the same modes once more with each quantity q moved by i*tiny, durations by one Newton
step of each end's condition: imaginary parts are the derivatives. No variational equation and no saltation matrix
takes part. A number is judged where the run's states are the oracle's, and a refusal needs a degeneracy nearby.
Chain: models.py, judging.py -> slopes.py (here) -> __main__.py.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from pwsmooth.paths.derivatives.tangents import Readings

from . import affine, judging
from .judging import ILL, RIGHT, UNDECIDED, WRONG, Verdict
from .models import Model

TITLE = "derivatives of piecewise-affine runs"
_TINY = 1e-60  # of complex steps: its square is nothing beside 1
_CELLS = 7  # a look ahead is of 2**_CELLS cells
_CELL = 0.1  # length of a cell, times the norm of M: its Taylor series ends with the roundings
_TERMS = 18
_MOST_MODES = 60
_NEAR = 1e-4  # a degeneracy as near as this, beside the motion's size, explains a refusal
TIGHT = {"rtol": 1e-13, "atol": 1e-16}


def structure(seed):
    """A random Model: affine rates and surfaces, products of two multipliers, |h| and max(h, 0)."""
    r = np.random.default_rng([21, seed])
    n, m = int(r.integers(1, 5)), int(r.choice([1, 2, 3], p=[0.4, 0.35, 0.25]))
    M = Model(n, [[] for _ in range(n)])
    forced = r.random() < 0.5
    for _ in range(m):
        i, kind = int(r.integers(n)), r.choice(["state", "sum", "moving"], p=[0.4, 0.35, 0.25])
        row = [M.term(1, i, parameter=bool(r.random() < 0.5))]
        if kind != "state" and n > 1:
            row += [M.term(1, k) for k in range(n) if k != i and r.random() < 0.6]
        if kind == "moving":
            row.append(M.term(0.5, M.S if forced else M.T))
        if r.random() < 0.8 or any(len(other) == 1 for other in M.surfaces):
            row.append(M.term(1))
        M.surfaces.append(row)
    # Only a Switch has a name by which its multiplier can be asked for.
    M.notation = [str(r.choice(["Switch", "sign"], p=[0.8, 0.2])) for _ in range(m)]
    for i, row in enumerate(M.rates):
        row += [M.term(1, k) for k in range(n) if r.random() < 0.65]
        row.append(M.term(1))
        if forced and r.random() < 0.6:
            row.append(M.term(1.5, M.S))
        for j in range(m):
            if r.random() < 0.6 or any(i in powers for _, _, powers in M.surfaces[j]):
                row.append(M.term(1, M.lam(j)))
        if m > 1 and r.random() < 0.25:
            j, k = r.choice(m, 2, replace=False)
            row.append(M.term(0.5, M.lam(int(j)), M.lam(int(k))))
    if r.random() < 0.25:
        j = int(r.integers(m))
        M.kinks.append((int(r.integers(n)), 0.6, M.new(), j, str(r.choice(["Abs", "Max"]))))
    return M


def case(M, seed):
    """Random numbers for it; some begin on a surface, some so that they touch one nearly or exactly."""
    r = np.random.default_rng([22, seed])
    drawn = affine.case(M, [23, seed], options=False)
    start, on = r.uniform(-2, 2, M.n), ()
    draws = r.random()
    made = dataclasses.replace(drawn, start=start, on=on, options=dict(TIGHT))
    if r.random() < 0.15:
        made.options["rtol"] = 1e-12
    if r.random() < 0.1:
        made.options["max_step"] = float(r.uniform(0.02, 0.5))
    if draws < 0.12:
        made = _touching(M, made, r)
    return made


def _touching(M, made, r):
    """The case moved so that a surface is met at a tangency, up to a small distance; as it is where that fails."""
    j = int(r.integers(len(M.surfaces)))
    span = float(made.instants[-1] - made.t0)
    numbers = Numbers(M, made, complex_steps=False)
    for _ in range(5):
        sides = tuple(int(s) for s in r.choice([-1, 1], len(M.surfaces)))
        flow = Mode(numbers, sides)
        h = numbers.surfaces[0, j]
        # h = distance, h' = 0 at the instant: the nearest such state to a random one.
        t = made.t0 + span * r.uniform(0.2, 0.8)
        angle = made.w * t + made.a
        z = np.concatenate([r.uniform(-1, 1, M.n), [np.sin(angle), np.cos(angle), t, 1.0]])
        rows = np.stack([h, h @ flow.M[0]])
        distance = float(r.choice([0.0, 10.0 ** r.uniform(-14, -3), -(10.0 ** r.uniform(-14, -3))]))
        if np.linalg.matrix_rank(rows[:, : M.n], 1e-3) < 2:
            continue
        z[: M.n] += np.linalg.lstsq(rows[:, : M.n], [distance * sides[j], 0.0] - rows @ z, rcond=None)[0]
        if (rows[1] @ flow.M[0] @ z) * sides[j] <= 0.1:
            continue
        back = expm(-(t - made.t0) * flow.M[0]) @ z
        if np.abs(back).max() < 20:
            return dataclasses.replace(made, start=back[: M.n])
    return made


# ---- the affine modes, at real numbers and at numbers moved by i*tiny --------------------------------


class Numbers:
    """Matrices of a case, shape (k, ...): one for each quantity, moved by i*tiny; or one, real."""

    def __init__(self, M, case, complex_steps, names=None):
        n, m = M.n, len(M.surfaces)
        self.n, self.m, self.N = n, m, n + 4
        self.one = n + 3
        names = names if complex_steps else [None]
        k, kind = len(names), complex if complex_steps else float
        p, start = np.tile(case.p.astype(kind), (k, 1)), np.tile(case.start.astype(kind), (k, 1))
        w, a, t0 = (np.full(k, value, kind) for value in (case.w, case.a, case.t0))
        for row, name in enumerate(names):
            if name is None:
                continue
            step = 1j * _TINY
            if name in ("w", "a", "t0"):
                {"w": w, "a": a, "t0": t0}[name][row] += step
            elif name[0] == "k":
                p[row, int(name[1:])] += step
            else:
                start[row, int(name[1:])] += step
        self.t0 = t0
        angle = w * t0 + a
        self.start = np.column_stack([start, np.sin(angle), np.cos(angle), t0, np.ones(k, kind)])
        self.free, self.pushes = np.zeros((k, self.N, self.N), kind), np.zeros((k, m, self.N), kind)
        self.products, self.kinks = {}, np.zeros((k, m, self.N, self.N), kind)
        self.surfaces = np.zeros((k, m, self.N), kind)
        lams = {M.lam(j): j for j in range(m)}

        def number(term):
            return term[0] * (1 if term[1] is None else p[:, term[1]])

        def column(powers):
            return next(iter(powers)) if powers else self.one

        for j, row in enumerate(M.surfaces):
            for term in row:
                self.surfaces[:, j, column(term[2])] += number(term)
        for i, row in enumerate(M.rates):
            for term in row:
                met = [lams[v] for v in term[2] if v in lams]
                if len(met) == 2:
                    push = self.products.setdefault(tuple(sorted(met)), np.zeros((k, self.N), kind))
                    push[:, i] += number(term)
                elif met:
                    self.pushes[:, met[0], i] += number(term)
                else:
                    self.free[:, i, column(term[2])] += number(term)
        for state, size, q, j, what in M.kinks:
            factor = size * p[:, q] * (0.5 if what == "Max" else 1.0)
            self.kinks[:, j, state] += factor[:, None] * self.surfaces[:, j]
            if what == "Max":
                self.free[:, state] += factor[:, None] * self.surfaces[:, j]
        self.free[:, n, n + 1], self.free[:, n + 1, n] = w, -w
        self.free[:, n + 2, self.one] = 1.0


class Unknown(Exception):
    """The oracle does not judge."""


class Mode:
    """z' = M z on the sides (0: sliding), and the rows of the sliding multipliers."""

    def __init__(self, numbers, sides):
        self.sides, self.sliding = sides, [j for j, s in enumerate(sides) if s == 0]
        M = numbers.free.copy()
        B = numbers.pushes[:, self.sliding].copy()
        for j, s in enumerate(sides):
            if s:
                M[:, :, numbers.one] += s * numbers.pushes[:, j]
                M += s * numbers.kinks[:, j]
        for (j, k), push in numbers.products.items():
            if sides[j] and sides[k]:
                M[:, :, numbers.one] += sides[j] * sides[k] * push
            elif sides[j] or sides[k]:
                slides, s = (k, sides[j]) if sides[j] else (j, sides[k])
                B[:, self.sliding.index(slides)] += s * push
            else:
                raise Unknown("two that multiply slide together")
        self.rows = np.zeros((len(M), 0, numbers.N), M.dtype)
        self.stiffness = 1.0
        if self.sliding:
            G = numbers.surfaces[:, self.sliding]
            grip = G @ B.transpose(0, 2, 1)
            self.stiffness = 1 / max(np.linalg.cond(grip[0].real), 1e-300)
            if not self.stiffness > 1e-8:
                raise Unknown("a slide without grip")
            self.rows = -np.linalg.solve(grip, G @ M)
            M = M + B.transpose(0, 2, 1) @ self.rows
        self.M = M


@dataclass
class Way:
    """The modes of a case, what ends each, when; how near to a degeneracy it comes, by what."""

    modes: list = field(default_factory=list)
    ends: list = field(default_factory=list)  # ("arrives" or "leaves", switch, side)
    times: list = field(default_factory=list)
    near: list = field(default_factory=list)  # (size, what, time)
    reached: float = 0.0
    stopped: str = ""


def _conditions(numbers, mode):
    """Rows whose zeros end a mode: surfaces of those that do not slide, and sliding multipliers at +1 and -1."""
    found = [(("arrives", j, s), numbers.surfaces[:, j]) for j, s in enumerate(mode.sides) if s]
    for place, j in enumerate(mode.sliding):
        for s in (1, -1):
            row = mode.rows[:, place].copy()
            row[:, numbers.one] -= s
            found.append((("leaves", j, s), row))
    return found


def _first_zero(M, z, rows, sides, zeros, length):
    """(Duration, row) of the first zero in which a row leaves its side, or (length, -1); and near-misses.

    `sides` are the signs of rows just behind the beginning, at which `zeros` of their derivatives vanish.
    """
    cell = _CELL / max(1.0, np.abs(M).sum(axis=1).max())
    done, misses = 0.0, []
    while done < length:
        step = min(cell, (length - done) / 2**_CELLS)
        E = expm(step * M)
        Z = z[:, None]
        for _ in range(_CELLS):
            Z = np.hstack([Z, E @ Z])
            E = E @ E
        Z = np.hstack([Z, (E @ z)[:, None]])
        F, D = rows @ Z * sides[:, None], rows @ M @ Z * sides[:, None]
        scale = np.abs(rows) @ np.abs(Z).max(axis=1) + 1e-300
        out = F[:, 1:] < 0
        turns = (D[:, :-1] < 0) & (D[:, 1:] > 0)
        best = (np.inf, -1)
        for row in range(len(rows)):
            deflated = zeros[row] if done == 0.0 else 0
            cells = np.flatnonzero(out[row] | turns[row])
            for c in [0, *cells[cells > 0]] if deflated else cells:
                if c * step >= best[0]:
                    break
                series, power = [rows[row] @ Z[:, c] * sides[row]], Z[:, c]
                for k in range(1, _TERMS):
                    power = M @ power * (step / k)
                    series.append(rows[row] @ power * sides[row])
                f = np.polynomial.Polynomial(series[deflated:] if c == 0 else series)
                end = 1.0
                if not f(1.0) < 0:
                    if not (f.deriv()(0.0) < 0 < f.deriv()(1.0)):
                        continue
                    end = _bisected(f.deriv(), -1)
                    misses.append((abs(f(end)) / scale[row], "touches", done + (c + end) * step))
                    if not f(end) < 0:
                        continue
                if not f(0.0) > 0:
                    raise Unknown("no side to begin on")
                best = min(best, ((c + end * _bisected(lambda s, f=f, e=end: f(e * s), 1)) * step, row))
                break
        if best[1] >= 0 and done + best[0] < length:
            return done + best[0], best[1], misses
        done += 2**_CELLS * step
        z = Z[:, -1]
    return length, -1, misses


def _bisected(f, sign):
    """A zero on [0, 1] of a function that has this sign at 0."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sign * f(middle) > 0 else (low, middle)
    return 0.5 * (low + high)


def way(M, case):
    """The modes of a case."""
    numbers, found = Numbers(M, case, complex_steps=False), Way()
    z, t, end = numbers.start[0], case.t0, float(case.instants[-1])
    found.reached = end
    try:
        h = numbers.surfaces[0] @ z
        sides = tuple(int(np.sign(value)) for value in h)
        if not all(sides):
            raise Unknown("begins on a surface")
        mode, begun = Mode(numbers, sides), {}
        while True:
            found.modes.append(mode)
            conditions = _conditions(numbers, mode)
            rows = np.stack([row[0] for _, row in conditions])
            signs = np.array([s if what == "arrives" else -s for (what, _, s), _ in conditions], float)
            zeros = [begun.get(j, 0) if what == "arrives" else 0 for (what, j, _), _ in conditions]
            length, which, misses = _first_zero(mode.M[0], z, rows, signs, zeros, end - t)
            found.near += [(size, what, t + when) for size, what, when in misses if when <= length]
            z = expm(length * mode.M[0]) @ z
            t += length
            if which < 0:
                return found
            scale = np.abs(rows) @ (np.abs(z) + 1e-300)
            values = rows @ z
            # How soon after or before another condition would be met: a corner.
            for other, value in enumerate(values):
                if other != which and not (conditions[other][0][1] == conditions[which][0][1]):
                    found.near.append((abs(value) / scale[other], "corner", t))
            what, j, s = conditions[which][0]
            speed = rows[which] @ mode.M[0] @ z
            size = np.abs(rows[which]) @ (np.abs(mode.M[0]) @ np.abs(z))
            found.near.append((abs(speed) / size, "slow", t))
            found.ends.append(conditions[which][0])
            found.times.append(t)
            # Of those that were on their surface: one that leaves by its multiplier begins at a double zero.
            begun = {j: 2} if what == "leaves" else dict.fromkeys([j, *mode.sliding], 1)
            mode = _next(numbers, mode, z, what, j, s, found, t)
            if len(found.modes) > _MOST_MODES:
                raise Unknown("many modes")
    except Unknown as why:
        found.stopped, found.reached = str(why), t
        return found


def _next(numbers, mode, z, what, j, s, found, t):
    """The mode behind an end."""
    sides = list(mode.sides)
    if what == "leaves":
        sides[j] = s
        new = Mode(numbers, tuple(sides))
        h = numbers.surfaces[0, j] @ new.M[0] @ new.M[0]
        if not s * (h @ z) > 0:
            raise Unknown("leaves and returns")
        found.near.append((abs(h @ z) / (np.abs(h) @ np.abs(z)), "slow exit", t))
        return new
    consistent = []
    moving = [j, *mode.sliding]
    for tried in itertools.product((-1, 0, 1), repeat=len(moving)):
        for k, side in zip(moving, tried):
            sides[k] = side
        new = Mode(numbers, tuple(sides))
        good = True
        for k, side in zip(moving, tried):
            if side:
                row = numbers.surfaces[0, k] @ new.M[0]
                speed, size = row @ z, np.abs(row) @ np.abs(z)
                margin = abs(speed) / size if size else 0.0
                good &= side * speed > 0
            else:
                lam = new.rows[0, new.sliding.index(k)] @ z
                margin = abs(abs(lam) - 1)
                good &= abs(lam) < 1
            if margin < _NEAR:
                found.near.append((margin, "barely decided", t))
        if good:
            consistent.append(new)
    if len(consistent) != 1:
        raise Unknown(f"{len(consistent)} ways to go on")
    return consistent[0]


@dataclass
class Slopes:
    """d(states)/dq at instants (instants, n, k), of multipliers, of event times (events, k) and of states there."""

    x: np.ndarray
    values: np.ndarray
    mult: np.ndarray
    times: np.ndarray
    at: np.ndarray
    growth: float


def slopes(M, case, found, names):
    """Derivatives along the modes of `way`, by complex steps; nan at instants that it did not reach."""
    numbers = Numbers(M, case, complex_steps=True, names=names)
    k, n, m = len(names), M.n, len(M.surfaces)
    z, begin = numbers.start.copy(), numbers.t0.copy()
    x, values = np.full((len(case.instants), n, k), np.nan), np.full((len(case.instants), n), np.nan)
    mult, times, at, growth = np.full((len(case.instants), m, k), np.nan), [], [], 1.0
    ends = [*found.times, found.reached]
    begins = [case.t0, *found.times]
    for i, real in enumerate(found.modes[: len(ends)]):
        mode = Mode(numbers, real.sides)
        last = i == len(ends) - 1
        for q in np.flatnonzero((case.instants >= begins[i]) & (case.instants < ends[i])):
            here = _moved(mode.M, case.instants[q] - begin, z)
            x[q], values[q] = here[:, :n].imag.T / _TINY, here[0, :n].real
            mult[q] = 0.0
            for place, j in enumerate(mode.sliding):
                mult[q, j] = np.einsum("kn,kn->k", mode.rows[:, place], here).imag / _TINY
        if last and not found.stopped:
            q = len(case.instants) - 1
            here = _moved(mode.M, case.instants[q] - begin, z)
            x[q], values[q] = here[:, :n].imag.T / _TINY, here[0, :n].real
            break
        if last:
            break
        row = dict(_conditions(numbers, mode))[found.ends[i]]
        z = _moved(mode.M, ends[i] - begin, z)
        rate = np.einsum("kij,kj->ki", mode.M, z)
        late = -np.einsum("kn,kn->k", row, z) / np.einsum("kn,kn->k", row, rate)
        late = 1j * late.imag  # the real part is the rounding of the polished instant
        z = z + late[:, None] * rate
        begin = ends[i] + late
        times.append(late.imag / _TINY)
        at.append(z[:, :n].imag.T / _TINY)
        growth = max(growth, np.abs(at[-1]).max())
    return Slopes(x, values, mult, np.array(times).reshape(-1, k), np.array(at).reshape(-1, n, k), growth)


def _moved(M, duration, z):
    return np.einsum("kij,kj->ki", expm(M * duration[:, None, None]), z)


# ---- verdicts ----------------------------------------------------------------------------------------


def quantities(M, known):
    """Names of all parameters, initial values, and the start time."""
    return [*sorted(known), *(f"x{i}" for i in range(M.n)), "t0"]


def play(played, seed):
    """The verdict on one case."""
    M = played.model
    made = case(M, seed)
    names = quantities(M, played.known)
    found = way(M, made)
    try:
        expected = slopes(M, made, found, names)
    except Unknown as why:
        return Verdict(UNDECIDED, str(why))
    judged = int(np.isfinite(expected.values).all(axis=1).sum())
    if not judged:
        return Verdict(UNDECIDED, found.stopped)
    try:
        solution = judging.solve(
            played.system, (made.t0, float(made.instants[-1])), made.start.tolist(), t_eval=made.instants,
            parameters=made.parameters(played.known), by=names, **made.options,
        )  # fmt: skip
        return judge(M, made, found, expected, solution, names, judged, seed)
    except Exception as error:  # what a solve raises is a finding
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])


def judge(M, made, found, expected, solution, names, judged, seed):
    """The verdict on a solution and its derivatives."""
    d = solution.derivatives
    if not np.array_equal(solution.t[:judged], made.instants[:judged]):
        return Verdict(judging.REFUSED, f"the run: {solution.outcome.name}")
    scale = 1 + np.abs(expected.values[:judged]).max()
    off = np.abs(solution.x.T[:judged] - expected.values[:judged]).max()
    if not off <= 1e-9 * scale * max(1.0, expected.growth):
        # Whether the states are right is the subject of affine.py.
        near = _nearest(found, made.instants[judged - 1])
        return Verdict(UNDECIDED, f"another motion, {near[1]}" if near[0] < _NEAR else "another motion", off)
    problems = [q for q in d.problems if q.t <= made.instants[judged - 1]]
    if problems:
        first = problems[0]
        near = _nearest(found, first.t, from_t=first.t - 1e-4 * (1 + abs(first.t)))
        if near[0] < _NEAR:
            return Verdict("justly refused", f"{first.reason[:24]}: {near[1]}")
        return Verdict(WRONG, f"over-refused: {first}"[:200], near[0])
    got = read(solution, M, judged, found)
    until = made.instants[judged - 1]
    met = len({round(t, 7) for t in solution.event_times() if t <= until})
    if got is None or not M.kinks and met > len({round(t, 7) for t in found.times if t <= until}):
        # As deep as rounding: the run touches what the oracle does not. A depth is the square of a speed.
        near = _nearest(found, until)
        return Verdict(
            UNDECIDED if near[0] < (1e-10 if near[1] == "touches" else 1e-6) else WRONG,
            f"other events, {near[1]}",
            near[0],
        )
    worst, failing = 0.0, []
    for what, (here, there) in enumerate(zip(got, _rows(expected, judged, len(got[2])))):
        same = np.isfinite(there)
        if what == 1:
            same &= np.array([kind == "Switch" for kind in M.notation])[:, None]
        if not np.isfinite(here[same]).all():
            return Verdict(WRONG, f"{_ROWS[what]}: not finite")
        error = _beside(here, there, same)
        worst = max(worst, error.max(initial=0.0))
        if np.any(error > 1e3 * made.options["rtol"]):
            failing.append((what, error))
    if not failing:
        if d.problems:
            return Verdict(RIGHT, "up to where it is refused", worst)
        return reverse(M, made, solution, names, seed)
    spread = _spread(M, made, found, expected, names, judged, len(got[2]))
    for what, error in failing:
        if np.any((error > 1e3 * made.options["rtol"]) & (error > 10 * spread[what])):
            return Verdict(WRONG, _ROWS[what], float(error.max()))
    return Verdict(ILL, "", worst)


_ROWS = ("states", "multipliers", "event times", "states at events")


def _rows(expected, judged, events):
    return expected.x[:judged], expected.mult[:judged], expected.times[:events], expected.at[:events]


def _beside(one, two, same):
    """Of each instant or event the largest difference, beside the size of what differs."""
    each = tuple(range(1, one.ndim))
    off = np.where(same, np.abs(np.where(same, one - two, 0.0)), 0.0).max(axis=each, initial=0.0)
    return off / (1 + np.where(same, np.abs(np.where(same, two, 0.0)), 0.0).max(axis=each, initial=0.0))


def read(solution, M, judged, found):
    """What the run's derivatives say, in the order of `_rows`; None where its events are not the oracle's."""
    d = solution.derivatives
    asked = solution.t[:judged]
    whole = judged == len(solution.t)
    # What stands at the solution's own times, and what is asked at times, in turn.
    got = d.x if whole else d(asked)
    mult = np.full((len(M.surfaces), *got.shape[1:]), np.nan)
    for j, kind in enumerate(M.notation):
        if kind == "Switch":
            mult[j] = d[f"lam{j}"] if whole else d(asked, f"lam{j}")
    got, mult = np.moveaxis(got, -1, 0), np.moveaxis(mult, -1, 0)
    times, at = [], []
    everywhen = solution.event_times()
    for t in found.times:
        near = np.flatnonzero(np.abs(everywhen - t) <= 1e-7 * (1 + abs(t)))
        if t > asked[-1] or len(near) > 1:
            break  # those of an accumulation are one beside the other
        if not len(near):
            return None
        event = d.at_event(int(near[0]))
        times.append(event.time)
        at.append(event.after)
        if not np.allclose(event.before, event.after, rtol=1e-10, atol=1e-10 * (1 + np.abs(event.after).max())):
            at[-1] = np.full_like(event.after, np.nan)
    n, k = M.n, len(d.names)
    return got, mult, np.array(times).reshape(-1, k), np.array(at).reshape(-1, n, k)


def _nearest(found, until, from_t=-np.inf):
    near = [item for item in found.near if from_t <= item[2] <= until + 1e-6 * (1 + abs(until))]
    return min(near, default=(np.inf, "", 0.0))


def _spread(M, made, found, expected, names, judged, events, tries=5):
    """Changes of the oracle's derivatives as start and parameters move by the tolerance, as `_beside`."""
    random = np.random.default_rng(0)
    base = _rows(expected, judged, events)
    largest, size = [np.zeros(len(rows)) for rows in base], 10 * made.options["rtol"]
    for _ in range(tries):
        moved = dataclasses.replace(
            made,
            p=made.p * (1 + size * random.uniform(-1, 1, len(made.p))),
            start=made.start + size * random.uniform(-1, 1, M.n),
        )
        other = way(M, moved)
        if other.ends != found.ends or other.stopped != found.stopped:
            continue  # one that goes another way says nothing of the others: it must not excuse a wrong number
        for what, rows in enumerate(_rows(slopes(M, moved, other, names), judged, events)):
            same = np.isfinite(rows) & np.isfinite(base[what])
            largest[what] = np.maximum(largest[what], _beside(rows, base[what], same))
    return largest


def reverse(M, made, solution, names, seed):
    """Covectors pulled back over the tape, against the same read forward."""
    d, r = solution.derivatives, np.random.default_rng([24, seed])
    inside = (made.instants > made.t0) & (made.instants <= solution.t[-1])
    times = made.instants[inside]
    n, m = len(solution.x), len(solution.mult)
    run = d._replay(times, points=False)
    end, at = r.normal(size=n), r.normal(size=(len(times), n + m))
    forward = end @ run.end + np.einsum("ti,tik->k", at, run.at_sample)
    none = np.zeros(0, np.int64), np.zeros((0, 2 * n + 1))
    back = solution.derivatives.tape.pull_back(Readings(end, times, at, *none))
    if back.why is not None:
        return Verdict(WRONG, "refused backward alone")
    places = {p.name: i for i, p in enumerate(solution.model.parameters)}
    kept = [q for q, name in enumerate(names) if name != "t0"]
    backward = [back.parameters[places[q]] if q in places else back.start[int(q[1:])]
                for q in names if q != "t0"]  # fmt: skip
    size = np.abs(forward).max() + np.abs(run.end).max()
    error = float(np.abs(forward[kept] - backward).max() / size)
    if error > 1e-11 and error > 1e-13 * np.abs(run.at_sample).max() ** 2:
        return Verdict(WRONG, "backward", error)
    return Verdict(RIGHT, error=error)


def script(number, seed):
    """A short program that shows the case, with what the oracle expects."""
    from . import models

    M = structure(number)
    made = case(M, seed)
    _, known = M.system()
    names, found = quantities(M, known), way(M, made)
    text = models.script(M, made).replace("t_eval=instants", f"t_eval=instants, by={names}")
    expected = slopes(M, made, found, names)
    return "\n".join([
        text, "print(s.derivatives.problems)", "print(s.derivatives.x[..., -1])",
        f"# modes {[mode.sides for mode in found.modes]}, ends {found.ends} at {found.times} {found.stopped}",
        f"# near {sorted(found.near)[:4]}", f"# expected at the last instant\n# {expected.x[-1].tolist()}",
    ])  # fmt: skip
