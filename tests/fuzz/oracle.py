"""Oracle: event-driven Filippov flow of polynomial piecewise systems, made without the package and unlike it.

    dy/dt = F(y, lambda, R),  lambda_j = sign h_j(y) or solved on h_j = 0,  0 <= g_k(y)  complementary to  R_k >= 0

All right-hand sides are polynomials in states and multipliers, kept as tables (models.py makes them; time and its sines
are states there). A step is Picard's iteration on Chebyshev nodes, so that it is a polynomial without Taylor series or
Runge-Kutta pairs; the next event is the first bracketed zero of all that is watched, bisected. One switch alone is
decided by all real roots of its polynomial in lambda, several by the layer's differential equation, contacts by trying
every complementary set. What the oracle cannot decide ends its run with a code: it is then compared up to there only.
"""

from collections import namedtuple

import numpy as np

from .compiling import inner, whole

# States, multipliers (switches first, then reactions), events; rows of the tables, see models.py.
Tables = namedtuple("Tables", "N m c e coef row fac var pow direction restitution")

DONE, UNDECIDED, TOO_MANY, LOST = 0, 1, 2, 3
NODES = 12
_TINY = 1e-13  # rounding of what is watched, at states of size one


def _picard():
    """Nodes on [0, 1], the matrix that integrates from 0, and barycentric weights."""
    s = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    basis = np.polynomial.chebyshev.chebvander(2 * s - 1, NODES - 1)
    whole = np.stack(
        [
            0.5
            * np.polynomial.chebyshev.chebval(
                2 * s - 1, np.polynomial.chebyshev.chebint(np.eye(NODES)[k], lbnd=-1)
            )
            for k in range(NODES)
        ],
        axis=1,
    )
    weights = (-1.0) ** np.arange(NODES)
    weights[[0, -1]] /= 2
    return s, whole @ np.linalg.inv(basis), weights, np.linalg.inv(basis)


_S, _Q, _WEIGHTS, _TO_CHEB = _picard()
# Where watched functions are sampled: geometrically from the last event on, then evenly.
_SAMPLES = np.concatenate([10.0 ** np.arange(-9, -1), np.arange(1, 33) / 32])


def _interpolation(points):
    out = np.zeros((len(points), NODES))
    for i, p in enumerate(points):
        if np.any(p == _S):
            out[i, np.flatnonzero(p == _S)[0]] = 1
        else:
            w = _WEIGHTS / (p - _S)
            out[i] = w / w.sum()
    return out


_AT = _interpolation(_SAMPLES)


@inner
def value(D, r, v):
    total = 0.0
    for q in range(D.row[r], D.row[r + 1]):
        term = D.coef[q]
        for f in range(D.fac[q], D.fac[q + 1]):
            term *= v[D.var[f]] ** D.pow[f]
        total += term
    return total


@inner
def slope(D, r, v, k):
    """Derivative of row r by variable k."""
    total = 0.0
    for q in range(D.row[r], D.row[r + 1]):
        term, found = D.coef[q], False
        for f in range(D.fac[q], D.fac[q + 1]):
            p = D.pow[f]
            if D.var[f] == k:
                found = True
                term *= p * v[k] ** (p - 1)
            else:
                term *= v[D.var[f]] ** p
        if found:
            total += term
    return total


@inner
def surface(D, a):
    """Row of h_j for a switch, of the gap's rate for a contact."""
    return D.N + a if a < D.m else D.N + D.c + a


@inner
def push(D, a, v, F):
    """dh/dt of a switch, d2g/dt2 of a contact, with the rates F."""
    total = 0.0
    for k in range(D.N):
        if F[k] != 0.0:
            total += slope(D, surface(D, a), v, k) * F[k]
    return total


@inner
def sensitivity(D, a, v, b):
    """Derivative of `push` of a by multiplier b."""
    total = 0.0
    for k in range(D.N):
        c = slope(D, k, v, D.N + b)
        if c != 0.0:
            total += slope(D, surface(D, a), v, k) * c
    return total


@whole
def value_of_row(D, r, v):
    return value(D, r, v)


@whole
def sensitivity_of_row(D, a, v, b):
    return sensitivity(D, a, v, b)


@inner
def gauss(J, r, n):
    """Solves J d = r in place, leaving d in r; False if singular."""
    for i in range(n):
        p = i
        for k in range(i + 1, n):
            if abs(J[k, i]) > abs(J[p, i]):
                p = k
        if abs(J[p, i]) < 1e-14:
            return False
        if p != i:
            for k in range(n):
                J[i, k], J[p, k] = J[p, k], J[i, k]
            r[i], r[p] = r[p], r[i]
        for k in range(i + 1, n):
            w = J[k, i] / J[i, i]
            r[k] -= w * r[i]
            for q in range(i, n):
                J[k, q] -= w * J[i, q]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            r[i] -= J[i, k] * r[k]
        r[i] /= J[i, i]
    return True


@inner
def rates(D, v, F):
    for k in range(D.N):
        F[k] = value(D, k, v)


@inner
def solve_multipliers(D, v, act, F):
    """Newton's iteration for push = 0 of the multipliers marked in `act`, into v; F are the rates."""
    which = np.flatnonzero(act)
    n = len(which)
    rates(D, v, F)
    if n == 0:
        return True
    J, r = np.empty((n, n)), np.empty(n)
    for _ in range(30):
        for i in range(n):
            r[i] = push(D, which[i], v, F)
            for k in range(n):
                J[i, k] = sensitivity(D, which[i], v, which[k])
        if not gauss(J, r, n):
            return False
        size = 0.0
        for i in range(n):
            v[D.N + which[i]] -= r[i]
            size = max(size, abs(r[i]) / (1.0 + abs(v[D.N + which[i]])))
            if not abs(v[D.N + which[i]]) < 1e9:
                return False
        rates(D, v, F)
        if size < 1e-9:  # it converges quadratically: the error is the square
            return True
    return False


@inner
def picard(D, v, dt, act, Y, L, G):
    """A step of length dt: states at the nodes into Y, multipliers into L. Returns 0 or what failed."""
    N = D.N
    w, F = v.copy(), np.empty(N)
    if not solve_multipliers(D, w, act, F):
        return 1
    for i in range(NODES):
        Y[i], L[i] = w[:N], w[N:]
    scale = 1.0 + np.max(np.abs(v[:N]))
    change = last = 1e300
    for trial in range(40):
        for i in range(NODES):
            w[:N], w[N:] = Y[i], L[i]
            if not solve_multipliers(D, w, act, F):
                return 1
            L[i], G[i] = w[N:], F
        last, change = change, 0.0
        for i in range(NODES):
            for k in range(N):
                new = 0.0
                for q in range(NODES):
                    new += _Q[i, q] * G[q, k]
                new = v[k] + dt * new
                change = max(change, abs(new - Y[i, k]))
                Y[i, k] = new
        if not change < 1e9:
            return 1
        if change <= 2e-15 * scale or (trial > 6 and change >= last and change < 1e-13 * scale):
            break
        if trial > 8 and change > 0.5 * last:
            return 1
    if change > 1e-13 * scale:
        return 1
    for i in range(NODES - 1):
        for j in range(D.m):
            if act[j] and abs(L[i + 1, j] - L[i, j]) > 0.2:
                return 1  # Newton's iteration went over a fold to another root
    # The last two Chebyshev coefficients tell what the polynomial lacks.
    for k in range(N):
        a = b = 0.0
        for q in range(NODES):
            a += _TO_CHEB[NODES - 1, q] * Y[q, k]
            b += _TO_CHEB[NODES - 2, q] * Y[q, k]
        if abs(a) + abs(b) > 3e-14 * scale:
            return 1
    # Multipliers that jump between nodes have changed their root: beyond a fold Newton's iteration finds another.
    for k in range(D.m + D.c):
        a = b = size = 0.0
        for q in range(NODES):
            a += _TO_CHEB[NODES - 1, q] * L[q, k]
            b += _TO_CHEB[NODES - 2, q] * L[q, k]
            size = max(size, abs(L[q, k]))
        if abs(a) + abs(b) > 1e-3 * (1.0 + size):
            return 1
    return 0


@inner
def at(s, Y, out):
    """The step's polynomial at s in [0, 1]."""
    total = 0.0
    out[:] = 0.0
    for q in range(NODES):
        d = s - _S[q]
        if d == 0.0:
            out[:] = Y[q]
            return
        w = _WEIGHTS[q] / d
        total += w
        out += w * Y[q]
    out /= total


@inner
def watched(D, v, status, F, side, out):
    """What is watched, positive until it happens: switches, multipliers at bounds, contacts, events."""
    m, c = D.m, D.c
    for j in range(m):
        if status[j] != 0:
            out[2 * j] = status[j] * value(D, D.N + j, v)
            out[2 * j + 1] = 1.0
        else:
            out[2 * j], out[2 * j + 1] = 1.0 - v[D.N + j], 1.0 + v[D.N + j]
    for k in range(c):
        out[2 * m + k] = value(D, D.N + m + k, v) if status[m + k] else v[D.N + m + k]
    for e in range(D.e):
        out[2 * m + c + e] = side[e] * value(D, D.N + m + 2 * c + e, v)


@inner
def look(D, s, Y, L, v, act, status, side, F, out):
    """`watched` at s, with the multipliers solved there."""
    at(s, Y, v[: D.N])
    at(s, L, v[D.N :])
    for j in range(D.m):
        if status[j] != 0:
            v[D.N + j] = status[j]
    ok = not np.any(act) or solve_multipliers(D, v, act, F)
    watched(D, v, status, F, side, out)
    return ok


@inner
def real_roots(a, lo, hi):
    """Real roots in [lo, hi] of sum a[k] z^k: those of a derivative separate those of the one above."""
    n = len(a) - 1
    below = np.empty(0)
    for order in range(n - 1, -1, -1):
        b = a[order:].copy()
        for k in range(len(b)):
            for i in range(order):
                b[k] *= k + i + 1
        edges = np.concatenate((np.array([lo]), below, np.array([hi])))
        found = np.empty(len(edges))
        count = 0
        for i in range(len(edges) - 1):
            p, q = edges[i], edges[i + 1]
            fp = fq = 0.0
            for k in range(len(b) - 1, -1, -1):
                fp, fq = fp * p + b[k], fq * q + b[k]
            if fp == 0.0:
                if count == 0 or found[count - 1] != p:
                    found[count] = p
                    count += 1
                continue
            if fp * fq >= 0.0:
                continue
            for _ in range(200):
                z = 0.5 * (p + q)
                if z == p or z == q:
                    break
                fz = 0.0
                for k in range(len(b) - 1, -1, -1):
                    fz = fz * z + b[k]
                if fz * fp > 0.0:
                    p = z
                else:
                    q = z
            found[count] = 0.5 * (p + q)
            count += 1
        below = found[:count]
    return below


@inner
def in_lambda(D, v, j, act, degree=9):
    """Coefficients of push_j as a polynomial in lambda_j, by values at Chebyshev points."""
    others = act.copy()
    others[j] = False
    A, r, F = np.empty((degree + 1, degree + 1)), np.empty(degree + 1), np.empty(D.N)
    w = v.copy()
    for i in range(degree + 1):
        z = np.cos(np.pi * (i + 0.5) / (degree + 1))
        w[D.N + j] = z
        solve_multipliers(D, w, others, F)
        r[i] = push(D, j, w, F)
        for k in range(degree + 1):
            A[i, k] = z**k
    size = np.max(np.abs(r)) + 1e-300
    gauss(A, r, degree + 1)
    for k in range(degree + 1):
        if abs(r[k]) < 1e-11 * size:
            r[k] = 0.0  # beyond the degree
    return r


@inner
def one_layer(D, v, j, act, start, beyond=False):
    """lambda_j where the layer of j alone ends: 2 for no root on the way, then it leaves at the returned end.

    `beyond`: the root at `start` vanishes (a fold) with its neighbour, towards which lambda moves.
    Returns (status, lambda).
    """
    a = in_lambda(D, v, j, act)
    roots = real_roots(a, -1.0, 1.0)
    if beyond:
        if len(roots) < 2:
            return 9, start
        near = np.argsort(np.abs(roots - start))
        other = roots[near[1]]
        toward = 1.0 if other > roots[near[0]] else -1.0
        start = other
        hit = 2.0 * toward
        for z in roots:
            if (z - start) * toward > 1e-9 and abs(z - start) < abs(hit - start):
                hit = z
        return (0, hit) if abs(hit) < 2 else (int(toward), toward)
    g = 0.0
    for k in range(len(a) - 1, -1, -1):
        g = g * start + a[k]
    if abs(g) < 1e-11 * np.sum(np.abs(a)):
        return 0, start
    toward = 1.0 if g > 0 else -1.0
    hit = 2.0 * toward
    for z in roots:
        if (z - start) * toward > 0 and abs(z - start) < abs(hit - start):
            hit = z
    return (0, hit) if abs(hit) < 2 else (int(toward), toward)


@inner
def layer_rates(D, w, group, width, contacts, u, F, du):
    for i in range(len(group)):
        w[D.N + group[i]] = u[i] / np.sqrt(1.0 + u[i] * u[i])
    ok = solve_multipliers(D, w, contacts, F)
    for i in range(len(group)):
        du[i] = push(D, group[i], w, F) / width[i]
    return ok


@inner
def many_layer(D, v, group, start, width, contacts, out):
    """The layer of several switches, du_i/dtau = push_i/width_i, by Bogacki-Shampine; statuses into `out`."""
    n = len(group)
    far = 1e3
    u, F, w = np.empty(n), np.empty(D.N), v.copy()
    for i in range(n):
        lam = min(max(start[i], -1.0 + 1e-9), 1.0 - 1e-9)
        u[i] = min(max(lam / np.sqrt((1 - lam) * (1 + lam)), -60.0), 60.0)
    k1, k2, k3, k4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    h = 0.05
    layer_rates(D, w, group, width, contacts, u, F, k1)
    for _ in range(2500):
        done = True
        for i in range(n):
            out[i] = 0
            if abs(u[i]) > far and k1[i] * u[i] > 0:
                out[i] = 1 if u[i] > 0 else -1
            elif abs(k1[i]) > 1e-9:
                done = False
        if done:
            return True
        layer_rates(D, w, group, width, contacts, u + 0.5 * h * k1, F, k2)
        layer_rates(D, w, group, width, contacts, u + 0.75 * h * k2, F, k3)
        new = u + h * (2 * k1 + 3 * k2 + 4 * k3) / 9
        if not layer_rates(D, w, group, width, contacts, new, F, k4):
            return False
        err = 0.0
        for i in range(n):
            e = h * abs(-5 * k1[i] / 72 + k2[i] / 12 + k3[i] / 9 - k4[i] / 8)
            err = max(err, e / (1e-6 * (1 + abs(u[i]))))
        if err <= 1:
            u[:], k1[:] = new, k4
        h *= min(4.0, max(0.2, 0.8 / (err + 1e-9) ** (1 / 3)))
    return False


@inner
def attracts(D, v, which):
    """Whether sliding on these surfaces attracts at every ratio of widths: minors of -J are positive."""
    n = len(which)
    J = np.empty((n, n))
    for i in range(n):
        for k in range(n):
            J[i, k] = -sensitivity(D, which[i], v, which[k])
        if J[i, i] <= 0:
            return False
    for i in range(n):
        for k in range(i + 1, n):
            if J[i, i] * J[k, k] - J[i, k] * J[k, i] <= 0:
                return False
    return True


@inner
def classify(D, v, status, group, contacts, forced):
    """Decides the switches of `group` (marked) with these contacts closed; v and status are set. Returns 0 or a code.

    forced: a switch that has met its bound and goes there, or -1.
    """
    which = np.flatnonzero(group)
    act = contacts.copy()
    F = np.empty(D.N)
    if len(which) == 1:
        j = which[0]
        status[j], lam = one_layer(D, v, j, act, v[D.N + j], forced == 100 + j)
        if status[j] == 9:
            return UNDECIDED
        v[D.N + j] = lam
    elif len(which) > 1:
        start = np.array([v[D.N + j] for j in which])
        out, again = np.zeros(len(which), np.int64), np.zeros(len(which), np.int64)
        if not many_layer(D, v, which, start, np.ones(len(which)), contacts, out):
            return UNDECIDED
        for i in range(len(which)):
            for ratio in (0.2, 5.0):
                width = np.ones(len(which))
                width[i] = ratio
                if not many_layer(D, v, which, start, width, contacts, again) or np.any(again != out):
                    return UNDECIDED
        for i in range(len(which)):
            status[which[i]] = out[i]
            v[D.N + which[i]] = out[i] if out[i] else v[D.N + which[i]]
    for j in which:
        act[j] = status[j] == 0
    if not solve_multipliers(D, v, act, F):
        return UNDECIDED
    slid = np.flatnonzero(act[: D.m])
    for j in slid:
        if abs(v[D.N + j]) > 1 + 1e-9:
            return UNDECIDED
    return 0 if attracts(D, v, slid) else UNDECIDED


@inner
def impulses(D, v, closing, U, after):
    """Newton's law with all `closing` contacts as one complementarity problem, by trying every set. False: none."""
    n = len(closing)
    M, need = np.empty((n, n)), np.empty(n)
    for i in range(n):
        need[i] = -U[i] - after[i]
        for k in range(n):
            M[i, k] = sensitivity(D, D.m + closing[i], v, D.m + closing[k])
    for code in range(1 << n):
        S = np.array([i for i in range(n) if code >> i & 1])
        A, p = np.empty((len(S), len(S))), np.empty(len(S))
        for i in range(len(S)):
            p[i] = need[S[i]]
            for k in range(len(S)):
                A[i, k] = M[S[i], S[k]]
        if len(S) and not gauss(A, p, len(S)):
            continue
        if np.any(p < -1e-12):
            continue
        good = True
        for i in range(n):
            got = 0.0
            for k in range(len(S)):
                got += M[i, S[k]] * p[k]
            if got < need[i] - 1e-10:
                good = False
        if good:
            for k in range(len(S)):
                for q in range(D.N):
                    v[q] += slope(D, q, v, D.N + D.m + closing[S[k]]) * p[k]
            return True
    return False


@inner
def one_by_one(D, v, closing, first):
    """The impacts of `closing` one after the other, first = +1: the fastest first, -1: the slowest. False: no end."""
    for _ in range(1000):
        chosen, rate = -1, 0.0
        for k in closing:
            now = value(D, D.N + D.m + D.c + k, v)
            if now < -1e-9 and (chosen < 0 or first * now < first * rate):
                chosen, rate = k, now
        if chosen < 0:
            return True
        bounce = D.restitution[chosen] * rate if rate < -1e-7 else 0.0
        if not impulses(D, v, np.array([chosen]), np.array([rate]), np.array([bounce])):
            return False
    return False


# Tags of what a run met, for counting apart; they excuse nothing.
JUMP_WHILE_CLOSED, SEVERAL_IMPACTS, RESET_BEYOND, SIMULTANEOUS, ACCUMULATES, SLIDES_MANY, LAYERS_MANY, FOLD = (
    1, 2, 4, 8, 16, 32, 64, 128)  # fmt: skip


@inner
def settle(D, v, status, touched, forced, tags):
    """Decides contacts and switches together after an event: impacts, then closed sets, then layers. 0 or a code.

    touched: multipliers whose surface was reached now; forced: a multiplier that leaves (see `classify`), or -1.
    """
    m, c, N = D.m, D.c, D.N
    F = np.empty(N)
    near = np.zeros(c, np.bool_)
    for _ in range(200):
        count = 0
        closing, U, after = np.empty(c, np.int64), np.empty(c), np.empty(c)
        worst = 0.0
        for k in range(c):
            rate = value(D, N + m + c + k, v)
            gap = abs(value(D, N + m + k, v))
            on = status[m + k] == 0 or touched[m + k] or gap < 1e-11
            if (
                on
                and status[m + k] != 0
                and not touched[m + k]
                and rate < -1e-9
                and gap > max(2e-13, -1e-9 * rate)
            ):
                return UNDECIDED  # it is near, and so slow that it comes too late to be taken as come
            near[k] = on and abs(rate) < 1e-9
            if on and rate < 1e-9:
                closing[count], U[count] = k, rate
                after[count] = D.restitution[k] * min(rate, 0.0) if rate < -1e-7 else 0.0
                worst = min(worst, rate)
                count += 1
            elif on:
                status[m + k] = 1
        if worst > -1e-9:
            break
        if count > 1:
            tags[0] |= SEVERAL_IMPACTS
        before = np.array([value(D, N + j, v) for j in range(m)])
        fast, slow = v.copy(), v.copy()
        if not impulses(D, v, closing[:count], U[:count], after[:count]):
            return UNDECIDED
        # What is open by less than this can tell, but not quite touched yet, is not hit at the same time. The two
        # come to a limit that is not that of one impact, be it that bodies come to rest between each other.
        merged = False
        for k in closing[:count]:
            merged = merged or (status[m + k] != 0 and not touched[m + k])
        if count > 1 and merged:
            up, down = np.int64(1), np.int64(-1)
            if not one_by_one(D, fast, closing[:count], up) or not one_by_one(D, slow, closing[:count], down):
                return UNDECIDED
            if np.max(np.abs(fast - v)) > 1e-8 or np.max(np.abs(slow - v)) > 1e-8:
                if np.max(np.abs(fast - slow)) > 1e-8:
                    return UNDECIDED
                v[:] = fast
        for j in range(m):
            h = value(D, N + j, v)
            if h != before[j]:
                if abs(h) < 1e-11:
                    touched[j] = True
                else:
                    status[j], touched[j] = (1 if h > 0 else -1), False
                    v[N + j] = status[j]
    else:
        return UNDECIDED
    group = np.zeros(m, np.bool_)
    for j in range(m):
        group[j] = (status[j] == 0 or touched[j]) and forced != j
    candidates = np.flatnonzero(near)
    if len(candidates) and forced >= m and forced < 100:
        candidates = candidates[candidates != forced - m]
        status[forced] = 1
    keep_v, keep_status = v.copy(), status.copy()
    found = 0
    best_v, best_status = v.copy(), status.copy()
    for code in range(1 << len(candidates)):
        v[:], status[:] = keep_v, keep_status
        contacts = np.zeros(m + c, np.bool_)
        for i in range(len(candidates)):
            closed = (code >> i & 1) == 1
            contacts[m + candidates[i]] = closed
            status[m + candidates[i]] = 0 if closed else 1
            if not closed:
                v[N + m + candidates[i]] = 0.0
        for k in range(c):
            if status[m + k] == 1:
                v[N + m + k] = 0.0
        act = contacts.copy()
        for j in range(m):
            act[j] = status[j] == 0 and not touched[j]
        if forced >= 0 and forced < m:
            v[N + forced] = status[forced]
        if forced >= 0 and forced < 100 and len(candidates) == 0:
            # Nothing but a switch at its bound: the others follow continuously, no layer begins.
            if not solve_multipliers(D, v, act, F):
                continue
            failed = 0
        else:
            failed = classify(D, v, status, group, contacts, forced)
        if failed:
            if len(candidates) == 0:
                return failed
            continue
        act = contacts.copy()
        for j in range(m):
            act[j] = status[j] == 0
        if not solve_multipliers(D, v, act, F):
            continue
        good = True
        for k in candidates:
            if contacts[m + k]:
                good = good and v[N + m + k] > -1e-10
            else:
                good = good and push(D, m + k, v, F) > -1e-10
        if good:
            found += 1
            best_v[:], best_status[:] = v, status
    if found != 1:
        return UNDECIDED
    v[:], status[:] = best_v, best_status
    return 0


@inner
def reads(D, row, k):
    """Whether variable k stands in a row."""
    return np.any(D.var[D.fac[D.row[row]] : D.fac[D.row[row + 1]]] == k)


@inner
def fire(D, v, status, side, touched, hit, tags):
    """Events at this instant act on the values before, increments added; then those whose surface was jumped.

    What reads the state that it changes is no increment, but sets it.
    """
    N, m, c, E = D.N, D.m, D.c, D.e
    first = N + m + 2 * c
    now = hit.copy()
    for _ in range(20):
        if not np.any(now):
            return True
        if np.sum(now) > 1:
            tags[0] |= SIMULTANEOUS
        new, before = v.copy(), v.copy()
        for e in range(E):
            if now[e]:
                for k in range(N):
                    row = first + E + e * N + k  # of what an update changes
                    change = value(D, row, before)
                    new[k] = before[k] + change if reads(D, row, k) else new[k] + change
        fired = now.copy()
        now[:] = False
        for j in range(m):
            was, h = value(D, N + j, v), value(D, N + j, new)
            if abs(h - was) > 1e-14:
                if abs(h) < 1e-11:
                    touched[j] = True
                else:
                    status[j], touched[j] = (1 if h > 0 else -1), False
                    new[N + j] = status[j]
        v[:] = new
        for e in range(E):
            h, was = value(D, first + e, v), value(D, first + e, before)
            if abs(h - was) > 1e-14 and abs(h) > 1e-11 and h * side[e] < 0:
                # What acts now moves its own surface as it likes; what stood on its surface has passed through nothing.
                if fired[e]:
                    tags[0] |= RESET_BEYOND
                elif abs(was) > 1e-11:
                    now[e] = D.direction[e] == 0 or D.direction[e] * h > 0
            if abs(h) > 1e-11:
                side[e] = 1.0 if h > 0 else -1.0
            elif fired[e]:
                side[e] = -side[e]
    return False


@whole
def run(D, v0, status0, t0, instants, log, graze, tags, most=1500):
    """From t0 through the instants: (code, time reached, states at the instants). `log` takes (t, what) of events."""
    N, m, c, E = D.N, D.m, D.c, D.e
    M, W = m + c, 2 * m + c + E
    v, status = v0.copy(), status0.copy()
    out = np.full((len(instants), N), np.nan)
    F, phi, before, phi2 = np.empty(N), np.empty(W), np.empty(W), np.empty(W)
    old = np.empty(W)
    w = v.copy()
    Y, L, G = np.empty((NODES, N)), np.empty((NODES, M)), np.empty((NODES, N))
    side, fired = np.ones(E), np.full(E, -np.inf)
    for e in range(E):
        side[e] = 1.0 if value(D, N + m + 2 * c + e, v) >= 0 else -1.0
    t, dt, k, events, calm = t0, 0.05, 0, 0, 9
    graze[:] = 1e300
    touched = np.zeros(M, np.bool_)
    for j in range(M):
        touched[j] = status[j] == 0
    failed = settle(D, v, status, touched, np.int64(-1), tags)
    if failed:
        return failed, t, out, events
    act = status == 0
    for _ in range(most):
        ahead = instants[k] - t
        h = min(dt, ahead)
        short = False
        while picard(D, v, h, act, Y, L, G):
            h *= 0.5
            short = True
            if h < 1e-12 * (1 + abs(t)):
                break
        if short and h < 1e-12 * (1 + abs(t)):
            # Only a fold of one hidden term is known to end a step like this.
            slid = np.flatnonzero(act[:m])
            if len(slid) != 1 or np.any(act[m:]):
                return LOST, t, out, events
            j = slid[0]
            tags[0] |= FOLD
            failed = settle(D, v, status, np.zeros(M, np.bool_), 100 + j, tags)
            if failed:
                return failed, t, out, events
            if events < len(log):
                log[events, 0], log[events, 1], log[events, 2] = t, j, 9
            events += 1
            act, dt = status == 0, 1e-6
            continue
        # The first sample at which something watched is negative; then the earliest zero before it.
        s0, found, hit_s = 0.0, -1, 2.0
        look(D, 0.0, Y, L, w, act, status, side, F, before)
        old[:] = before
        s_old = 0.0
        for i in range(len(_SAMPLES)):
            s = _SAMPLES[i]
            ok = look(D, s, Y, L, w, act, status, side, F, phi)
            for q in range(W):
                a, b, z = s0, s, phi[q]
                if not z < -_TINY:
                    if before[q] < old[q] and before[q] <= z and before[q] < 0.5 and s_old < s0 and ok:
                        # A least value between samples: golden sections tell whether it passes 0.
                        lo, hi = s_old, s
                        for _ in range(36):
                            p1, p2 = hi - 0.618034 * (hi - lo), lo + 0.618034 * (hi - lo)
                            look(D, p1, Y, L, w, act, status, side, F, phi2)
                            f1 = phi2[q]
                            look(D, p2, Y, L, w, act, status, side, F, phi2)
                            if f1 < phi2[q]:
                                hi = p2
                            else:
                                lo = p1
                            if min(f1, phi2[q]) < -1e-11:
                                break
                        p1 = 0.5 * (lo + hi)
                        look(D, p1, Y, L, w, act, status, side, F, phi2)
                        if q >= 2 * m or status[q // 2] != 0:
                            graze[0] = min(graze[0], abs(phi2[q]))
                        else:
                            graze[1] = min(graze[1], abs(phi2[q]))
                        if phi2[q] < -1e-12:
                            a, b, z = s_old, p1, phi2[q]
                if z < -_TINY:
                    for _ in range(60):
                        p1 = 0.5 * (a + b)
                        if p1 == a or p1 == b:
                            break
                        look(D, p1, Y, L, w, act, status, side, F, phi2)
                        if phi2[q] > 0:
                            a = p1
                        else:
                            b = p1
                    if b < hit_s:
                        hit_s, found = b, q
            if found >= 0:
                break
            old[:], before[:] = before, phi
            s_old, s0 = s0, s
        if found < 0:
            v[:N], v[N:] = Y[NODES - 1], L[NODES - 1]
            solve_multipliers(D, v, act, F)
            t = instants[k] if h == ahead else t + h
            slid = np.flatnonzero(act[:m])
            if len(slid) > 0 and not attracts(D, v, slid):
                return UNDECIDED, t, out, events
            if np.max(np.abs(v[:N])) > 1e3:
                return UNDECIDED, t, out, events
            # A step that fails costs as much as one that does not: grow slowly after a failure.
            calm = 0 if short else calm + 1
            if short or h == dt:
                dt = min(1.4 * h, 0.6) if calm > 3 else h
            while k < len(instants) and t == instants[k]:
                out[k] = v[:N]
                k += 1
            if k == len(instants):
                return DONE, t, out, events
            continue
        look(D, hit_s, Y, L, w, act, status, side, F, phi)
        v[:] = w
        t += hit_s * h
        if events < len(log):
            log[events, 0], log[events, 1], log[events, 2] = t, found, 0
        events += 1
        touched[:] = False
        forced = -1
        for j in range(m):
            touched[j] = status[j] != 0 and abs(value(D, N + j, v)) < 1e-12
        closed = np.any(act[m:])
        jumped = v[:N].copy()
        if found < 2 * m:
            j = found // 2
            if closed:
                tags[0] |= JUMP_WHILE_CLOSED
            if status[j] != 0:
                touched[j] = True
                if np.sum(act[:m]):
                    tags[0] |= LAYERS_MANY
            else:
                forced = j
                status[j] = 1 if found % 2 == 0 else -1
        elif found < 2 * m + c:
            j = m + found - 2 * m
            if status[j]:
                touched[j] = True
                if closed:
                    tags[0] |= JUMP_WHILE_CLOSED
            else:
                forced = j
                status[j] = 1
                v[N + j] = 0.0
        else:
            hit = np.zeros(E, np.bool_)
            e0 = found - 2 * m - c
            for e in range(E):
                # Another event of the same instant: its surface is zero as well.
                near = abs(value(D, N + m + 2 * c + e, v)) < 1e-12 and phi[2 * m + c + e] <= 1e-12
                if e == e0 or near:
                    hit[e] = D.direction[e] == 0 or D.direction[e] * side[e] < 0
                    if not hit[e]:
                        side[e] = -side[e]
            if closed and np.any(hit):
                tags[0] |= JUMP_WHILE_CLOSED
            for e in range(E):
                if hit[e]:
                    if t - fired[e] < 1e-9 * (1 + abs(t)):
                        return (
                            UNDECIDED,
                            t,
                            out,
                            events,
                        )  # the next one of a sequence that shrinks would be missed
                    fired[e] = t
            if not fire(D, v, status, side, touched, hit, tags):
                return UNDECIDED, t, out, events
        # What moves without a jump and is at its bound already stays as it is.
        if found < 2 * m + c or np.any(v[:N] != jumped):
            for j in range(m):
                if status[j] != 0 and not touched[j]:
                    v[N + j] = status[j]
            failed = settle(D, v, status, touched, forced, tags)
            if failed:
                return failed, t, out, events
        act = status == 0
        if found >= 2 * m + c:
            # Where a reset leaves the state on the surface of its event, that is left to where the motion goes on.
            there, rates_there = v.copy(), np.empty(N)
            for e in range(E):
                r = N + m + 2 * c + e
                if hit[e] and abs(value(D, r, v)) < 1e-11 and solve_multipliers(D, there, act, rates_there):
                    rise = 0.0
                    for i in range(N):
                        rise += slope(D, r, there, i) * rates_there[i]
                    if abs(rise) > 1e-9:
                        side[e] = 1.0 if rise > 0 else -1.0
        if np.sum(act[:m]) > 1:
            tags[0] |= SLIDES_MANY
        # After a bounce the next flight may be short.
        dt = min(dt, 0.1)
        for q in range(c):
            if status[m + q] == 1 and touched[m + q]:
                solve_multipliers(D, v, act, F)
                rate, fall = value(D, N + m + c + q, v), push(D, m + q, v, F)
                if fall < 0:
                    dt = min(dt, max(-3 * rate / fall, 1e-10))
                if rate < 1e-4:
                    tags[0] |= ACCUMULATES
    return TOO_MANY, t, out, events
