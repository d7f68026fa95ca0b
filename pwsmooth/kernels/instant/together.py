"""Discs at rest whose surfaces depend on each other: several points of one rigid body.

Together they hold more than the body can move, so that G = 0 does not say what lambda is; the motion is unique all the
same. The body rests as long as some lambda in the balls has G = 0, and that whose largest |lambda_k| is least says how
much is left: it is found by an interior-point method, and what is redundant in it keeps its value from there on. Where
it reaches 1 the body begins to move, all points in the direction of their lambda but those whose |lambda_k| is less:
about these it turns.
"""

import math

from ..machine.compiling import kernel
from ..machine.pointers import call_newton
from ..outcome import Outcome
from ..state import AMB_FORCES, GO_ON, SOLVED
from ..step.recording import record_ambiguity
from ..surface.dependent import gather, independent, slopes_of_group
from ..surface.sliding import INSIDE, mask_solved
from ..surface.sparse import solve_dense

_ALIKE = 1e-12  # of G
_FULL = 1e-12  # of the balls: with less left the body begins to move
_CENTRED, _GAP, _ITERATIONS = 0.25, 1e-13, 200  # of the interior-point method: how fast its weight falls, and to what
_DUAL = 1e-7  # of it: where the dual variables are known well
_TURNS = 1e-5  # of the balls: a point with more left is one about which the body turns
_SWEEPS, _NEWTON = 20_000, 20


@kernel
def depend(P, S, W, j):
    """Whether surfaces of disc j depend on those of other discs at h = 0; leaves their group in W.together."""
    q = gather(P, S, W, j)
    if q <= P.dim[j]:
        return False
    for i in range(q):
        S.mult[P.disc_of[W.together.comp[i]]] = INSIDE
    slopes_of_group(P, S, W, q)
    W.together.size = q
    return independent(W, q) < q


@kernel
def _square(W, i):
    """(|lambda|^2 in together.lam of the disc whose components begin at i, how many these are)."""
    group, d, total = W.together, 0, 0.0
    while i + d < group.size and group.disc[i + d] == group.disc[i]:
        total += group.lam[i + d] ** 2
        d += 1
    return total, d


@kernel
def _largest(W):
    """The largest |lambda| in together.lam."""
    i, largest = 0, 0.0
    while i < W.together.size:
        square, d = _square(W, i)
        largest = max(largest, square)
        i += d
    return math.sqrt(largest)


@kernel
def _least_load(P, S, W, rank):
    """Overwrites together.lam by the lambda with G = 0, by slopes in together.J, whose largest |lambda_k| is least, to
    the end of the path of centres to it; returns a bound of all |lambda_k|, inf if there is none.

    minimise s - w sum log(s^2 - |lambda_k|^2) by Newton's method, with w falling to 0 (Boyd and Vandenberghe 2004, 11).
    """
    group, q = W.together, W.together.size
    A, order, lam = group.matrix, group.order, group.lam
    # The shortest lambda to begin with, J'y with J J'y = b.
    for r in range(rank):
        total = -group.g[order[r]]
        for c in range(q):
            total += group.J[order[r], c] * S.mult[group.comp[c]]
        group.goal[r] = A[r, rank] = total
        for c in range(rank):
            A[r, c] = 0.0
            for i in range(q):
                A[r, c] += group.J[order[r], i] * group.J[order[c], i]
    if not solve_dense(A, rank, 1):
        return math.inf
    for i in range(q):
        lam[i] = 0.0
        for r in range(rank):
            lam[i] += group.J[order[r], i] * A[r, rank]
    s = 1.5 * _largest(W)
    if s == 0.0:
        return 0.0
    weight, last, size = s, _GAP * s, q + 1 + rank
    for _ in range(_ITERATIONS):
        for r in range(size):
            for c in range(size + 1):
                A[r, c] = 0.0
        A[q, size] = -1.0 / weight
        i = 0
        while i < q:
            square, d = _square(W, i)
            left = s * s - square
            for r in range(i, i + d):
                for c in range(i, i + d):
                    A[r, c] = 4.0 * lam[r] * lam[c] / left**2 + (2.0 / left if r == c else 0.0)
                A[r, q] = A[q, r] = -4.0 * s * lam[r] / left**2
                A[r, size] = -2.0 * lam[r] / left
            A[q, q] += 4.0 * s * s / left**2 - 2.0 / left
            A[q, size] += 2.0 * s / left
            i += d
        for r in range(rank):
            rest = group.goal[r]
            for c in range(q):
                A[q + 1 + r, c] = A[c, q + 1 + r] = group.J[order[r], c]
                rest -= group.J[order[r], c] * lam[c]
            A[q + 1 + r, size] = rest
        if not solve_dense(A, size, 1):
            break
        # As far as all stay inside.
        share = 1.0
        for i in range(q):
            group.change[i] = A[i, size]
        for _ in range(60):
            i, inside = 0, True
            while i < q:
                square, d = 0.0, _square(W, i)[1]
                for r in range(i, i + d):
                    square += (lam[r] + share * group.change[r]) ** 2
                ahead = s + share * A[q, size]
                inside = inside and ahead > 0.0 and ahead * ahead > square
                i += d
            if inside:
                break
            share *= 0.5
        for i in range(q):
            lam[i] += share * group.change[i]
        s += share * A[q, size]
        if share == 1.0:
            if weight >= _DUAL * s:
                # How they begin to move, if they do, to a common factor: what is dual to G = 0.
                for i in range(q):
                    group.move[group.comp[i]] = 0.0
                    for r in range(rank):
                        group.move[group.comp[i]] -= group.J[order[r], i] * A[q + 1 + r, size] * weight
            if weight <= last:
                break
            weight = max(last, _CENTRED * weight)
    return s


@kernel
def _slip(W):
    """Overwrites together.lam by the solution of the variational inequality: of each disc in turn, over and over, the
    lambda in its ball with G = 0 or |lambda| = 1 and G = c lambda, c > 0; leaves G in together.g."""
    group, q, A = W.together, W.together.size, W.together.matrix
    for _ in range(_SWEEPS):
        change, i = 0.0, 0
        while i < q:
            d = _square(W, i)[1]
            for r in range(i, i + d):
                group.goal[r] = group.g[r]
                for c in range(i, i + d):
                    group.goal[r] -= group.J[r, c] * group.lam[c]
            # lambda = (c - J)^-1 g with |lambda| <= 1; its size falls with c.
            pace, size = 0.0, 0.0
            for _ in range(60):
                for r in range(d):
                    for c in range(d):
                        A[r, c] = (pace if r == c else 0.0) - group.J[i + r, i + c]
                    A[r, d] = group.goal[i + r]
                if not solve_dense(A, d, 1):
                    break
                size = 0.0
                for r in range(d):
                    size += A[r, d] ** 2
                size = math.sqrt(size)
                if size <= 1.0 + 1e-15 and (pace == 0.0 or size >= 1.0 - 1e-15):
                    break
                # Newton's method for 1/|lambda| = 1, exact where J is isotropic.
                for r in range(d):
                    group.change[r] = A[r, d]
                    for c in range(d):
                        A[r, c] = (pace if r == c else 0.0) - group.J[i + r, i + c]
                    A[r, d] = group.change[r]
                if not solve_dense(A, d, 1):
                    break
                slope = 0.0
                for r in range(d):
                    slope += group.change[r] * A[r, d]
                    A[r, d] = group.change[r]
                pace = max(0.0, pace + size * size * (size - 1.0) / slope)
            for r in range(d):
                step = A[r, d] - group.lam[i + r]
                change = max(change, abs(step))
                group.lam[i + r] += step
                for k in range(q):
                    group.g[k] += group.J[k, i + r] * step
            i += d
        if change <= 1e-15:
            break


@kernel
def _put(S, W):
    """Takes the lambda of the group over."""
    for i in range(W.together.size):
        S.mult[W.together.comp[i]] = W.together.lam[i]


@kernel
def _rests_already(P, S, W, q):
    """Whether the lambda of the group hold it, as another look at an instant finds it."""
    group, pull = W.together, 0.0
    largest = slopes_of_group(P, S, W, q)
    for i in range(q):
        pull = max(pull, abs(group.J[i, i]))
    return largest <= _ALIKE * pull and _largest(W) <= 1.0


@kernel
def settle_dependent(P, S, R, W, leaves):
    """The group of discs in W.together is at h = 0: it rests, or moves on; a code.

    If its force has not jumped it `leaves` where no lambda in the balls holds it any more.
    """
    group, load = W.together, math.inf
    q = group.size
    for i in range(q):
        group.disc[i] = P.disc_of[group.comp[i]]
        group.lam[i] = S.mult[group.comp[i]]
    rests = _rests_already(P, S, W, q) and not leaves
    for _ in range(0 if rests else _NEWTON):
        largest = slopes_of_group(P, S, W, q)
        load = _least_load(P, S, W, independent(W, q))
        if not load < math.inf:
            return Outcome.NO_ROOT
        if load > 1.0 and not leaves:
            for i in range(q):
                group.lam[i] = S.mult[group.comp[i]]
            _slip(W)
        change = 0.0
        for i in range(q):
            change = max(change, abs(group.lam[i] - S.mult[group.comp[i]]))
        _put(S, W)
        if change <= 1e-9 or largest == 0.0:
            break
    moves = not rests and (load > 1.0 or (leaves and load > 1.0 - _FULL))
    # What slips keeps its direction; of what sticks as much is solved for as is independent.
    i, sticking = 0, 0
    while i < q:
        square, d = _square(W, i)
        j = group.disc[i]
        size = math.sqrt(square)
        slips = moves and size >= (load * (1.0 - _TURNS) if leaves else 1.0 - _ALIKE)
        S.mult[j] = INSIDE
        S.status[j] = 1 if slips else SOLVED
        S.deflate[j] = 1 if slips else 0
        for r in range(i, i + d):
            k = group.comp[r]
            S.status[k], S.deflate[k] = 1, 0
            group.move[k] = group.move[k] if slips and leaves else 0.0
            if slips:
                S.mult[k] /= size
            else:
                group.comp[sticking] = k
                sticking += 1
        if not slips:
            S.mult[j] = min(square, INSIDE)
        i += d
    group.size = sticking
    if sticking == 0:
        return GO_ON
    slopes_of_group(P, S, W, sticking)
    rank = independent(W, sticking)
    for r in range(rank):
        S.status[group.comp[group.order[r]]] = SOLVED
    if rank < sticking and not leaves:
        record_ambiguity(S, R, P.disc_of[group.comp[0]], AMB_FORCES, 0)
    mask_solved(P, S, W)
    return GO_ON if call_newton(P.newton_unit, P, S, W) != 0 else Outcome.NO_ROOT
