"""How multipliers whose surfaces depend on each other share a load: convex problems on the product of their balls.

    least_load      minimise s,                          |lambda_k| <= s,  G(lambda) = 0      what holds, if s <= 1
    slip_or_stick   minimise lambda'Q lambda/2 - c'lambda,  |lambda_k| <= 1,  D G = c - Q lambda  what slips, if not

by interior-point methods: Newton's method for stationarity and for (dual of a bound)(room to it) = w, with w falling to
0 (Boyd and Vandenberghe 2004, 11.7). They end in the middle of what is optimal: a bound that may be left free has room.
"""

import math

from ..machine.compiling import kernel
from .sparse import find_strengths, solve_dense

FULL = 1e-12  # of the balls: with less left what they hold begins to move
# How fast w falls near its path and off it, to what, and how near to a bound a step goes.
_CENTRED, _OFF_CENTRE, _GAP, _INSIDE, _ITERATIONS = 0.1, 0.5, 1e-14, 0.99, 100


@kernel
def square_of_ball(W, i):
    """(|lambda|^2 in together.lam of the ball whose components begin at i, how many these are)."""
    group, d, total = W.together, 0, 0.0
    while i + d < group.size and group.ball[i + d] == group.ball[i]:
        total += group.lam[i + d] ** 2
        d += 1
    return total, d


@kernel
def largest_lambda(W):
    """The largest |lambda| in together.lam."""
    i, largest = 0, 0.0
    while i < W.together.size:
        square, d = square_of_ball(W, i)
        largest = max(largest, square)
        i += d
    return math.sqrt(largest)


@kernel
def _newton_for_load(W, s, rank, balls):
    """Overwrites together.matrix by Newton's equations for the optimum; returns how far the sum of the products
    held_k (s - |lambda_k|^2/s), which vanish there, is from it."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, gap, i = q + 1 + rank + balls, 0.0, 0
    for r in range(size):
        for c in range(size + 1):
            A[r, c] = 0.0
    A[q, size] = -1.0
    for k in range(balls):
        square, d = square_of_ball(W, i)
        at, held, beyond, slope = q + 1 + rank + k, group.held[k], square / s - s, -1.0 - square / s**2
        for r in range(i, i + d):
            A[r, r] = 2.0 * held / s
            A[r, q] = A[q, r] = -2.0 * held * lam[r] / s**2
            A[r, at] = 2.0 * lam[r] / s
            A[at, r] = held * A[r, at]
            A[r, size] = -held * A[r, at]
        A[q, q] += 2.0 * held * square / s**3
        A[q, at], A[at, q] = slope, held * slope
        A[q, size] -= held * slope
        A[at, at], A[at, size] = beyond, -held * beyond
        gap -= held * beyond
        i += d
    for r in range(rank):
        row = group.order[r]
        A[q + 1 + r, size] = group.goal[r]
        for c in range(q):
            slope = group.J[row, c]
            A[q + 1 + r, c] = A[c, q + 1 + r] = slope
            A[q + 1 + r, size] -= slope * lam[c]
            A[c, size] -= slope * group.push[r]
    return gap


@kernel
def _share_inside(W, s, rank, balls):
    """How much of a step of Newton's method leaves all |lambda_k| < s and all held_k > 0."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, share = q + 1 + rank + balls, 1.0
    for k in range(balls):
        if A[q + 1 + rank + k, size] < 0.0:
            share = min(share, -_INSIDE * group.held[k] / A[q + 1 + rank + k, size])
    for _ in range(60):
        ahead, i, inside = s + share * A[q, size], 0, True
        for _ in range(balls):
            square, d = square_of_ball(W, i)
            new = 0.0
            for r in range(i, i + d):
                new += (lam[r] + share * A[r, size]) ** 2
            inside = inside and ahead > 0.0 and ahead - new / ahead > (1.0 - _INSIDE) * (s - square / s)
            i += d
        if inside:
            break
        share *= 0.8
    return share


@kernel
def least_load(P, S, W, rank):
    """Overwrites together.lam by the lambda with G = 0, by slopes in together.J, whose largest |lambda_k| is least, to
    the end of the path of centres to it; together.free by 1 where that is the largest, else 0. Returns a bound of all
    |lambda_k|, inf if there is none.

    Newton's method for held_k (s - |lambda_k|^2/s) = w and a stationary Lagrangian.
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
    find_strengths(W, group.J, group.strength, q)  # G = -S strength
    s = 1.5 * largest_lambda(W)
    if s == 0.0:
        return 0.0
    balls, total, i = 0, 0.0, 0
    while i < q:
        square, d = square_of_ball(W, i)
        total += 1.0 + square / s**2
        balls, i = balls + 1, i + d
    for k in range(balls):
        group.held[k] = 1.0 / total
    for r in range(rank):
        group.push[r] = 0.0
    size, share = q + 1 + rank + balls, 1.0
    for _ in range(_ITERATIONS):
        gap = _newton_for_load(W, s, rank, balls)
        centre = (_CENTRED if share > 0.5 else _OFF_CENTRE) * gap / balls
        for k in range(balls):
            A[q + 1 + rank + k, size] -= centre
        if gap <= _GAP * s or not solve_dense(A, size, 1):
            break
        share = _share_inside(W, s, rank, balls)
        for i in range(q):
            lam[i] += share * A[i, size]
        s += share * A[q, size]
        for r in range(rank):
            group.push[r] += share * A[q + 1 + r, size]
        for k in range(balls):
            group.held[k] += share * A[q + 1 + rank + k, size]
    i = 0
    for k in range(balls):
        square, d = square_of_ball(W, i)
        for r in range(i, i + d):
            group.free[r] = 1 if group.held[k] * s > s - square / s else 0
        i += d
    # How they begin to move, if they do, to a common factor: what is dual to G = 0.
    for i in range(q):
        group.move[group.comp[i]] = 0.0
        for r in range(rank):
            group.move[group.comp[i]] -= group.J[order[r], i] * group.push[r]
        group.move[group.comp[i]] /= group.strength[i]
    return s


@kernel
def _newton_for_slip(W, balls):
    """Overwrites together.matrix by Newton's equations for the optimum; returns the sum of the products
    held_k (1 - |lambda_k|^2)/2, which vanish there."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, gap, i = q + balls, 0.0, 0
    for r in range(size):
        for c in range(size + 1):
            A[r, c] = 0.0
    for r in range(q):
        A[r, size] = group.goal[r]
        for c in range(q):
            A[r, c] = -group.strength[r] * group.J[r, c]
            A[r, size] -= A[r, c] * lam[c]
    for k in range(balls):
        square, d = square_of_ball(W, i)
        at, held, room = q + k, group.held[k], 0.5 * (1.0 - square)
        for r in range(i, i + d):
            A[r, r] += held
            A[r, at] = lam[r]
            A[r, size] -= held * lam[r]
            A[at, r] = -held * lam[r]
        A[at, at], A[at, size] = room, -held * room
        gap += held * room
        i += d
    return gap


@kernel
def _share_of_slip(W, balls):
    """How much of a step of Newton's method leaves all |lambda_k| < 1 and all held_k > 0."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    size, share, i = q + balls, 1.0, 0
    for k in range(balls):
        if A[q + k, size] < 0.0:
            share = min(share, -_INSIDE * group.held[k] / A[q + k, size])
    for _ in range(balls):
        square, d = square_of_ball(W, i)
        for _ in range(60):
            new = 0.0
            for r in range(i, i + d):
                new += (lam[r] + share * A[r, size]) ** 2
            if 1.0 - new > (1.0 - _INSIDE) * (1.0 - square):
                break
            share *= 0.8
        i += d
    return share


@kernel
def slip_or_stick(W):
    """Overwrites together.lam by the solution of the variational inequality on the product of the balls:
    G = 0, or |lambda_k| = 1 and G_k along lambda_k; together.free by 1 where it slips so, else 0. By slopes in
    together.J, with G at the lambda that stands in together.lam in together.g, which it follows."""
    group, q, A, lam = W.together, W.together.size, W.together.matrix, W.together.lam
    find_strengths(W, group.J, group.strength, q)
    balls, i, most = 0, 0, 0.0
    for r in range(q):
        total = group.g[r]
        for c in range(q):
            total -= group.J[r, c] * lam[c]
        group.goal[r] = group.strength[r] * total
        most = max(most, abs(group.goal[r]))
    while i < q:
        balls, i = balls + 1, i + square_of_ball(W, i)[1]
    for r in range(q):
        lam[r] = 0.0
    for k in range(balls):
        group.held[k] = most
    share = 1.0
    for _ in range(_ITERATIONS if most > 0.0 else 0):
        gap = _newton_for_slip(W, balls)
        centre = (_CENTRED if share > 0.5 else _OFF_CENTRE) * gap / balls
        for k in range(balls):
            A[q + k, q + balls] += centre
        if gap <= _GAP * most or not solve_dense(A, q + balls, 1):
            break
        share = _share_of_slip(W, balls)
        for r in range(q):
            lam[r] += share * A[r, q + balls]
        for k in range(balls):
            group.held[k] += share * A[q + k, q + balls]
    i = 0
    for k in range(balls):
        square, d = square_of_ball(W, i)
        for r in range(i, i + d):
            group.free[r] = 1 if group.held[k] > 0.5 * most * (1.0 - square) else 0
        i += d
    for r in range(q):
        total = group.goal[r]
        for c in range(q):
            total += group.strength[r] * group.J[r, c] * lam[c]
        group.g[r] = total / group.strength[r]
