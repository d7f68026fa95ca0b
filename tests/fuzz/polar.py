"""Oracle of vector friction: slip in polar variables, made without the package and unlike it.

    dy/dt = L y + c + sum_s (a_s cos w_s t + b_s sin w_s t) + sum_k N_k(t) mu_k(|h_k|) B_k lambda_k,   h_k = y[idx_k]

In slip h = r n, and the states are n, ln r and t in a time tau with dt = dtau/(1 + sum 1/r_k): there neither an arrival
at rest nor a near miss is singular, and Dormand and Prince's pair of order 8 passes both. An onset begins with
Chebyshev nodes: n is the root of G(n) = r' n + r n', a sweep at a time, so that its bounded solution is taken order by
order. One component is a scalar switch. What is not decided ends the run with a code.
"""

from collections import namedtuple

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop

from .compiling import inner, whole

# Numbers of a run; B (K, N, 3), index (K, 3), d (K), thr (K): |lambda| at which a stick ends; an event at e.y = level,
# rising, that adds `jump`.
Disc = namedtuple(
    "Disc", "L c cos sin w B index d swing pace stribeck width thr event level jump events", defaults=()
)

DONE, UNDECIDED, LOST, TOO_MANY = 0, 1, 2, 3
STICK, TANGENCY, FOLD, RESET, CROSSING, EVENT = range(6)
_A, _B, _C = dop.A[: dop.N_STAGES, : dop.N_STAGES].copy(), dop.B.copy(), dop.C[: dop.N_STAGES].copy()
_E3, _E5 = dop.E3.copy(), dop.E5.copy()
_STAGES = dop.N_STAGES
_RTOL, _ATOL = 1e-13, 1e-15
_REST = -36.0  # ln r at which a slip is at rest
_NODES = 10


def _chebyshev():
    """Nodes on [0, 1], derivatives at them, integrals from 0 to them."""
    s = 0.5 - 0.5 * np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))
    cheb = np.polynomial.chebyshev
    basis = np.linalg.inv(cheb.chebvander(2 * s - 1, _NODES - 1))
    rows = np.eye(_NODES)
    slope = np.stack([2 * cheb.chebval(2 * s - 1, cheb.chebder(e)) for e in rows], axis=1)
    whole = np.stack([0.5 * cheb.chebval(2 * s - 1, cheb.chebint(e, lbnd=-1)) for e in rows], axis=1)
    return s, slope @ basis, whole @ basis


_S, _D, _Q = _chebyshev()


@inner
def gauss(A, b):
    """Solves A x = b in place, x in b; False if singular."""
    n = len(b)
    for i in range(n):
        p = i
        for k in range(i + 1, n):
            if abs(A[k, i]) > abs(A[p, i]):
                p = k
        if not abs(A[p, i]) > 1e-14:
            return False
        if p != i:
            for k in range(n):
                A[i, k], A[p, k] = A[p, k], A[i, k]
            b[i], b[p] = b[p], b[i]
        for k in range(i + 1, n):
            f = A[k, i] / A[i, i]
            b[k] -= f * b[i]
            for q in range(i, n):
                A[k, q] -= f * A[i, q]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    return True


@inner
def strength(P, k, t, r):
    return (1 + P.swing[k] * np.cos(P.pace[k] * t)) * (1 + P.stribeck[k] * np.exp(-r / P.width[k]))


@inner
def rates(P, t, y, lam, dy):
    """dy/dt with these multipliers (K, 3)."""
    dy[:] = P.c
    for i in range(len(y)):
        for j in range(len(y)):
            dy[i] += P.L[i, j] * y[j]
    for s in range(len(P.w)):
        co, si = np.cos(P.w[s] * t), np.sin(P.w[s] * t)
        for i in range(len(y)):
            dy[i] += P.cos[s, i] * co + P.sin[s, i] * si
    for k in range(len(P.d)):
        r = 0.0
        for i in range(P.d[k]):
            r += y[P.index[k, i]] ** 2
        f = strength(P, k, t, np.sqrt(r))
        for i in range(P.d[k]):
            for j in range(len(y)):
                dy[j] += f * P.B[k, j, i] * lam[k, i]


@inner
def hold(P, t, y, lam, slips, dy):
    """Overwrites the multipliers of the discs that stick, and dy; False if there are none that hold."""
    size = 0
    for k in range(len(P.d)):
        if not slips[k]:
            size += P.d[k]
            lam[k] = 0.0
    rates(P, t, y, lam, dy)
    if size == 0:
        return True
    A, b = np.zeros((size, size)), np.zeros(size)
    row = 0
    for k in range(len(P.d)):
        if slips[k]:
            continue
        for i in range(P.d[k]):
            b[row] = -dy[P.index[k, i]]
            col = 0
            for q in range(len(P.d)):
                if slips[q]:
                    continue
                f = strength(P, q, t, 0.0)
                for j in range(P.d[q]):
                    A[row, col] = f * P.B[q, P.index[k, i], j]
                    col += 1
            row += 1
    if not gauss(A, b):
        return False
    row = 0
    for k in range(len(P.d)):
        if not slips[k]:
            for i in range(P.d[k]):
                lam[k, i] = b[row]
                row += 1
    rates(P, t, y, lam, dy)
    for k in range(len(P.d)):
        if not slips[k]:
            for i in range(P.d[k]):
                dy[P.index[k, i]] = 0.0
    return True


@inner
def unpack(P, Y, slips, y, lam):
    """States and directions of slip from (y with n in place of h, ln r, t)."""
    N = len(y)
    y[:] = Y[:N]
    for k in range(len(P.d)):
        if slips[k]:
            size = 0.0
            for i in range(P.d[k]):
                size += Y[P.index[k, i]] ** 2
            size, r = np.sqrt(size), np.exp(Y[N + k])
            for i in range(P.d[k]):
                lam[k, i] = Y[P.index[k, i]] / size
                y[P.index[k, i]] = r * lam[k, i]
        else:
            for i in range(P.d[k]):
                y[P.index[k, i]] = 0.0


@inner
def polar(P, Y, slips, y, lam, dy, out):
    """Rates of Y in tau."""
    N, K = len(y), len(P.d)
    unpack(P, Y, slips, y, lam)
    ok = hold(P, Y[N + K], y, lam, slips, dy)
    pace = 1.0
    for k in range(K):
        if slips[k]:
            pace += np.exp(-Y[N + k])
    pace = 1.0 / pace
    for i in range(N):
        out[i] = pace * dy[i]
    for k in range(K):
        out[N + k] = 0.0
        if slips[k]:
            per, along = pace * np.exp(-Y[N + k]), 0.0
            for i in range(P.d[k]):
                along += lam[k, i] * dy[P.index[k, i]]
            for i in range(P.d[k]):
                out[P.index[k, i]] = per * (dy[P.index[k, i]] - along * lam[k, i])
            out[N + k] = per * along
    out[N + K] = pace
    return ok


@inner
def step(P, Y, slips, h, F, y, lam, dy, new):
    """Overwrites new; F[0] holds the rates at Y. Returns the error in tolerances, nan if none."""
    size = len(Y)
    for s in range(1, _STAGES):
        for i in range(size):
            total = 0.0
            for q in range(s):
                total += _A[s, q] * F[q, i]
            new[i] = Y[i] + h * total
        if not polar(P, new, slips, y, lam, dy, F[s]):
            return np.nan
    for i in range(size):
        total = 0.0
        for q in range(_STAGES):
            total += _B[q] * F[q, i]
        new[i] = Y[i] + h * total
    if not polar(P, new, slips, y, lam, dy, F[_STAGES]):
        return np.nan
    e3 = e5 = 0.0
    for i in range(size):
        scale, a, b = _ATOL + _RTOL * max(abs(Y[i]), abs(new[i])), 0.0, 0.0
        for q in range(_STAGES + 1):
            a += _E3[q] * F[q, i]
            b += _E5[q] * F[q, i]
        e3 += (a / scale) ** 2
        e5 += (b / scale) ** 2
    if e5 == 0.0 and e3 == 0.0:
        return 0.0
    return abs(h) * e5 / np.sqrt((e5 + 0.01 * e3) * size)


@inner
def size_of(P, k, lam):
    total = 0.0
    for i in range(P.d[k]):
        total += lam[k, i] ** 2
    return np.sqrt(total)


@inner
def watched(P, Y, slips, armed, until, y, lam, dy, out):
    """What is watched, negative until it happens: rest or bound of each disc, the instant, the event."""
    N, K = len(y), len(P.d)
    unpack(P, Y, slips, y, lam)
    hold(P, Y[N + K], y, lam, slips, dy)
    for k in range(K):
        out[k] = _REST - Y[N + k] if slips[k] else size_of(P, k, lam) - P.thr[k]
    out[K] = Y[N + K] - until
    out[K + 1] = -1.0
    if P.events:
        out[K + 1] = -P.level
        for i in range(N):
            out[K + 1] += P.event[i] * y[i]
        if not armed:
            out[K + 1] = -1.0


@inner
def way_out(P, t, y, lam, slips, out, c):
    """Newton's method for G_k = c_k n_k of the discs marked in `out`, from the directions in lam; False if none."""
    N, K = len(y), len(P.d)
    dy, size = np.empty(N), 0
    for k in range(K):
        if out[k]:
            size += P.d[k] + 1
            total = size_of(P, k, lam)
            for i in range(P.d[k]):
                lam[k, i] /= total
    moving = slips.copy()
    for k in range(K):
        moving[k] = slips[k] or out[k]
    hold(P, t, y, lam, moving, dy)
    for k in range(K):
        if out[k]:
            c[k] = 0.0
            for i in range(P.d[k]):
                c[k] += lam[k, i] * dy[P.index[k, i]]
            c[k] = max(c[k], 0.0)
    A, b, u, other = np.empty((size, size)), np.empty(size), np.empty(size), np.empty(size)
    for _ in range(60):
        for col in range(-1, size):
            a = 0
            for k in range(K):
                if out[k]:
                    for i in range(P.d[k]):
                        u[a] = lam[k, i]
                        a += 1
                    u[a] = c[k]
                    a += 1
            if col >= 0:
                u[col] += 0.5
            trial, a = lam.copy(), 0
            for k in range(K):
                if out[k]:
                    for i in range(P.d[k]):
                        trial[k, i] = u[a]
                        a += 1
                    a += 1
            hold(P, t, y, trial, moving, dy)
            a = 0
            for k in range(K):
                if out[k]:
                    cc, square = u[a + P.d[k]], 0.0
                    for i in range(P.d[k]):
                        other[a + i] = dy[P.index[k, i]] - cc * trial[k, i]
                        square += trial[k, i] ** 2
                    other[a + P.d[k]] = square - 1.0
                    a += P.d[k] + 1
            if col < 0:
                b[:] = other
            else:
                A[:, col] = (other - b) / 0.5
                # The squares are of second degree: their exact slopes.
                a = 0
                for k in range(K):
                    if out[k]:
                        if a <= col < a + P.d[k]:
                            A[a + P.d[k], col] = 2 * lam[k, col - a]
                        a += P.d[k] + 1
        change = 0.0
        if not gauss(A, b):
            return False
        a = 0
        for k in range(K):
            if out[k]:
                for i in range(P.d[k]):
                    lam[k, i] -= b[a + i]
                    change = max(change, abs(b[a + i]))
                c[k] -= b[a + P.d[k]]
                change = max(change, abs(b[a + P.d[k]]) / (1 + abs(c[k])))
                a += P.d[k] + 1
        if not change < 1e6:
            return False
        if change < 1e-14:
            break
    if change > 1e-11:
        return False
    for k in range(K):
        if out[k] and not c[k] > 0.0:
            return False
    return True


@inner
def begin(P, y, t, lam, slips, out, c, span):
    """Overwrites y, lam: the slips marked in `out` have begun and last `span`; False if the sweeps do not converge."""
    N, K = len(y), len(P.d)
    states = np.empty((_NODES, N))
    n = np.empty((_NODES, K, 3))
    r, dr = np.zeros((_NODES, K)), np.zeros((_NODES, K))
    slope = np.zeros((_NODES, N))
    work = lam.copy()
    dy = np.empty(N)
    for q in range(_NODES):
        states[q], n[q], dr[q] = y, lam, c
        r[q] = span * _S[q] * c
    moving = slips.copy()
    for k in range(K):
        moving[k] = slips[k] or out[k]
    before = 1e300
    for sweep in range(40):
        change = 0.0
        for q in range(_NODES):
            now = t + span * _S[q]
            for k in range(K):
                if slips[k]:
                    size = 0.0
                    for i in range(P.d[k]):
                        size += states[q, P.index[k, i]] ** 2
                    for i in range(P.d[k]):
                        n[q, k, i] = states[q, P.index[k, i]] / np.sqrt(size)
        # G(n) = c n + r n' at all nodes together, by Newton's method a disc at a time.
        for k in range(K):
            if not out[k]:
                continue
            d = P.d[k]
            e = d + 1
            for _ in range(12):
                A, b = np.zeros((_NODES * e, _NODES * e)), np.zeros(_NODES * e)
                for q in range(_NODES):
                    now = t + span * _S[q]
                    work[:] = n[q]
                    hold(P, now, states[q], work, moving, dy)
                    base = dy.copy()
                    square = 0.0
                    for i in range(d):
                        b[q * e + i] = base[P.index[k, i]] - dr[q, k] * n[q, k, i]
                        square += n[q, k, i] ** 2
                        for p in range(_NODES):
                            b[q * e + i] -= r[q, k] * _D[q, p] * n[p, k, i] / span
                            A[q * e + i, p * e + i] = -r[q, k] * _D[q, p] / span
                    b[q * e + d] = square - 1.0
                    for j in range(d):
                        work[:] = n[q]
                        work[k, j] += 1.0
                        hold(P, now, states[q], work, moving, dy)
                        for i in range(d):
                            A[q * e + i, q * e + j] += (
                                dy[P.index[k, i]] - base[P.index[k, i]] - (dr[q, k] if i == j else 0.0)
                            )
                        A[q * e + d, q * e + j] = 2 * n[q, k, j]
                        A[q * e + j, q * e + d] = -n[q, k, j]
                if not gauss(A, b):
                    return False
                moved = 0.0
                for q in range(_NODES):
                    for i in range(d):
                        n[q, k, i] -= b[q * e + i]
                        moved = max(moved, abs(b[q * e + i]))
                    dr[q, k] -= b[q * e + d]
                if moved < 1e-15:
                    break
        for q in range(_NODES):
            now = t + span * _S[q]
            work[:] = n[q]
            hold(P, now, states[q], work, moving, slope[q])
        for k in range(K):
            if not out[k]:
                continue
            for q in range(_NODES):
                total = 0.0
                for p in range(_NODES):
                    total += span * _Q[q, p] * dr[p, k]
                r[q, k] = total
        for q in range(_NODES):
            for j in range(N):
                total = y[j]
                for p in range(_NODES):
                    total += span * _Q[q, p] * slope[p, j]
                new = total
                for k in range(K):
                    if out[k]:
                        for i in range(P.d[k]):
                            if P.index[k, i] == j:
                                new = r[q, k] * n[q, k, i]
                scale = abs(states[q, j]) + 1e-300
                for k in range(K):
                    if out[k]:
                        for i in range(P.d[k]):
                            if P.index[k, i] == j:
                                scale = r[_NODES - 1, k]
                change = max(change, abs(new - states[q, j]) / (scale + 1e-300) if q == _NODES - 1 else 0.0)
                states[q, j] = new
        if not change < 1e6:
            return False
        if change < 1e-14 or (sweep > 12 and change < 1e-11 and change > 0.3 * before):
            break
        before = change
    if change > 1e-11:
        return False
    y[:], lam[:] = states[_NODES - 1], n[_NODES - 1]
    for k in range(K):
        if out[k] and not r[_NODES - 1, k] > 0.0:
            return False
    return True


@inner
def settle(P, t, y, lam, slips, came, jumped, log, found, margin, longest):
    """All discs at rest stick or begin to slip, y and t moved to where they do; (code, t).

    came: disc that has just arrived, or -1; only its bound is 1, that of others P.thr (a stick that held goes on).
    """
    N, K = len(y), len(P.d)
    dy, c = np.empty(N), np.zeros(K)
    out = np.zeros(K, np.bool_)
    rest = ~slips
    for trial in range(2**K):
        # Subsets of the discs at rest that begin to slip, the smaller first.
        mask, valid = trial, True
        for k in range(K):
            out[k] = (mask >> k) & 1 == 1
            valid = valid and (rest[k] or not out[k])
        if not valid:
            continue
        moving = slips.copy()
        work = lam.copy()
        all_held = lam.copy()
        if not hold(P, t, y, all_held, slips, dy):
            return UNDECIDED, t
        for k in range(K):
            if out[k]:
                moving[k] = True
                work[k] = all_held[k]
        if mask and not way_out(P, t, y, work, slips, out, c):
            continue
        hold(P, t, y, work, moving, dy)
        for k in range(K):
            if not moving[k]:
                bound = 1.0 if k == came else P.thr[k]
                valid = valid and size_of(P, k, work) <= bound
                margin[0] = min(margin[0], abs(size_of(P, k, work) - bound))
        if not valid:
            continue
        lam[:] = work
        if mask == 0:
            return DONE, t
        for k in range(K):
            if out[k] and k != came:
                log[found[0], 0], log[found[0], 1], log[found[0], 2] = (
                    t,
                    k,
                    RESET if P.thr[k] == 1 or jumped else FOLD,
                )
                found[0] += 1
        return release(P, t, y, lam, slips, out, c, longest)
    return UNDECIDED, t


@inner
def release(P, t, y, lam, slips, out, c, span):
    """Begins the slips in `out`, whose first moments last `span` at most; (code, t)."""
    fastest = 1.0
    for s in range(len(P.w)):
        fastest = max(fastest, P.w[s])
    for k in range(len(P.d)):
        fastest = max(fastest, P.pace[k])
    span = min(span, 0.01 / fastest)
    for k in range(len(P.d)):
        if slips[k]:
            r = 0.0
            for i in range(P.d[k]):
                r += y[P.index[k, i]] ** 2
            span = min(span, 0.01 * np.sqrt(r))
    held, dy = slips | out, np.empty(len(y))
    for _ in range(8):
        there, way = y.copy(), lam.copy()
        good = begin(P, there, t, way, slips, out, c, span)
        if good and not held.all():
            # No other disc may have passed its bound in these moments, which nobody watches.
            beside = way.copy()
            good = hold(P, t + span, there, beside, held, dy)
            for k in range(len(P.d)):
                good = good and (held[k] or size_of(P, k, beside) <= P.thr[k])
        if good:
            y[:], lam[:] = there, way
            for k in range(len(P.d)):
                slips[k] = slips[k] or out[k]
            return DONE, t + span
        span *= 0.25
    return UNDECIDED, t


@inner
def pack(P, y, lam, slips, t, Y):
    N = len(y)
    Y[:N] = y
    for k in range(len(P.d)):
        Y[N + k] = 0.0
        if slips[k]:
            r = 0.0
            for i in range(P.d[k]):
                r += y[P.index[k, i]] ** 2
            r = np.sqrt(r)
            Y[N + k] = np.log(r)
            for i in range(P.d[k]):
                Y[P.index[k, i]] = y[P.index[k, i]] / r
    Y[N + len(P.d)] = t


@whole
def run(P, start, t, instants, log, found, margin, steps):
    """(code, time reached, states at the instants); log rows are (time, disc, kind).

    margin: distance of |lambda| from its bound where that decided, least d|lambda|/dt at an onset, least speed of a
    slip at an extremum, distance between two things watched.
    """
    N, K = len(start), len(P.d)
    # Of the types of all numbers: a function is compiled anew for every literal.
    nobody, no, yes = np.int64(-1), np.bool_(False), np.bool_(True)
    states = np.full((len(instants), N), np.nan)
    y, lam, dy = start.copy(), np.zeros((K, 3)), np.empty(N)
    slips = np.zeros(K, np.bool_)
    for k in range(K):
        r = 0.0
        for i in range(P.d[k]):
            r += y[P.index[k, i]] ** 2
        slips[k] = r > 0.0
        if slips[k]:
            for i in range(P.d[k]):
                lam[k, i] = y[P.index[k, i]] / np.sqrt(r)
    Y, new = np.zeros(N + K + 1), np.zeros(N + K + 1)
    F = np.zeros((_STAGES + 1, N + K + 1))
    g, after = np.zeros(K + 2), np.zeros(K + 2)
    asked = 0
    code = DONE
    if not slips.all():
        code, t = settle(P, t, y, lam, slips, nobody, no, log, found, margin, 0.5 * (instants[0] - t))
    if code != DONE:
        return code, t, states
    pack(P, y, lam, slips, t, Y)
    polar(P, Y, slips, y, lam, dy, F[0])
    fastest = 1.0
    for s in range(len(P.w)):
        fastest = max(fastest, P.w[s])
    for k in range(K):
        fastest = max(fastest, P.pace[k])
    h, armed = 1e-3, yes
    if P.events:
        level = -P.level
        for i in range(N):
            level += P.event[i] * start[i]
        armed = level < 0.0
    rising, falling = np.zeros(K), np.zeros(K, np.bool_)
    for _ in range(400_000):
        steps[0] += 1
        while asked < len(instants) and Y[N + K] >= instants[asked]:
            unpack(P, Y, slips, y, lam)
            states[asked] = y
            asked += 1
        if asked == len(instants):
            return DONE, Y[N + K], states
        until = instants[asked]
        if P.events and not armed:
            watched(P, Y, slips, yes, until, y, lam, dy, g)
            level, armed = g[K + 1], g[K + 1] < 0.0
        watched(P, Y, slips, armed, until, y, lam, dy, g)
        sticks = not slips.all()
        if sticks:
            h = min(h, 0.03 / fastest)
            for k in range(K):
                # Near its bound lambda must not be back within a step: its arc is seen, however flat.
                if not slips[k] and -1e-3 < g[k] < 0.0:
                    h = min(h, max(0.03 * np.sqrt(-1e3 * g[k]), 1e-5) / fastest)
        error = step(P, Y, slips, h, F, y, lam, dy, new)
        if not error <= 1.0:
            h *= max(0.2, 0.9 * error**-0.125) if error < 1e300 else 0.2
            if h < 1e-13:
                return LOST, Y[N + K], states
            continue
        if P.events and not armed and h > 1e-9 and abs(level) < 1e-10:
            # From its level behind an event the motion may be back within a step: it must be seen below.
            watched(P, new, slips, yes, until, y, lam, dy, after)
            unpack(P, Y, slips, y, lam)
            rates(P, Y[N + K], y, lam, dy)
            slope = 0.0
            for i in range(N):
                slope += P.event[i] * dy[i]
            if slope < 0.0 and after[K + 1] >= 0.0:
                h *= 0.25
                continue
        watched(P, new, slips, armed, until, y, lam, dy, after)
        taken, what = h, -1
        if (after > 0.0).any():
            # The first of what happens: the smallest root, each by false position on the step's length.
            for a in range(K + 2):
                if not after[a] > 0.0 or g[a] > 0.0:
                    continue
                lo, hi, glo, ghi = 0.0, h, g[a], after[a]
                side = 0
                trial_new = np.empty_like(new)
                trial = np.empty(K + 2)
                for turn in range(80):
                    mid = (lo * ghi - hi * glo) / (ghi - glo) if turn % 4 < 3 else 0.5 * (lo + hi)
                    if not lo < mid < hi:
                        break
                    step(P, Y, slips, mid, F, y, lam, dy, trial_new)
                    watched(P, trial_new, slips, armed, until, y, lam, dy, trial)
                    if trial[a] == 0.0:
                        hi = mid
                        break
                    if trial[a] > 0.0:
                        hi, ghi = mid, trial[a]
                        if side == 1:
                            glo *= 0.5
                        side = 1
                    else:
                        lo, glo = mid, trial[a]
                        if side == -1:
                            ghi *= 0.5
                        side = -1
                    if hi - lo <= 1e-16 * (1 + hi):
                        break
                if what >= 0 and a != K and what != K:
                    margin[3] = min(margin[3], abs(hi - taken))
                if hi < taken or what < 0:
                    taken, what = hi, a
            step(P, Y, slips, taken, F, y, lam, dy, new)
        # A bound that is nearly reached, and turns.
        if sticks:
            watched(P, new, slips, armed, until, y, lam, dy, after)
            for k in range(K):
                if not slips[k]:
                    if rising[k] > 0.0 and after[k] < g[k] and what != k:
                        margin[0] = min(margin[0], abs(g[k]))
                    rising[k] = after[k] - g[k]
        for k in range(K):
            if slips[k]:
                if falling[k] and new[N + k] > Y[N + k] and what != k:
                    margin[2] = min(margin[2], np.exp(Y[N + k]))
                falling[k] = new[N + k] < Y[N + k]
        Y[:] = new
        h_next = min(5.0, 0.9 * (error + 1e-12) ** -0.125) * h
        if what < 0 or what == K:
            if what == K:
                Y[N + K] = until
            polar(P, Y, slips, y, lam, dy, F[0])
            h = h_next if what < 0 else max(h, 1e-6)
            continue
        unpack(P, Y, slips, y, lam)
        t = Y[N + K]
        longest = 0.5 * (until - t)
        if what == K + 1:
            log[found[0], 0], log[found[0], 1], log[found[0], 2] = t, K, EVENT
            found[0] += 1
            armed = no
            for i in range(N):
                y[i] += P.jump[i]
            for k in range(K):
                r = 0.0
                for i in range(P.d[k]):
                    r += y[P.index[k, i]] ** 2
                if not slips[k] and r > 0.0:
                    slips[k] = True
            for k in range(K):
                if slips[k]:
                    r = 0.0
                    for i in range(P.d[k]):
                        r += y[P.index[k, i]] ** 2
                    for i in range(P.d[k]):
                        lam[k, i] = y[P.index[k, i]] / np.sqrt(r)
            if not slips.all():
                code, t = settle(P, t, y, lam, slips, nobody, yes, log, found, margin, longest)
        elif slips[what]:
            came = what
            at = t
            slips[came] = False
            for i in range(P.d[came]):
                y[P.index[came, i]] = 0.0
            row = found[0]
            found[0] += 1  # kept for what the arrival turns out to be
            code, t = settle(P, t, y, lam, slips, came, no, log, found, margin, longest)
            log[row, 0], log[row, 1], log[row, 2] = at, came, CROSSING if slips[came] else STICK
            rising[came] = 0.0
        else:
            k = what
            out = np.zeros(K, np.bool_)
            out[k] = True
            c = np.zeros(K)
            log[found[0], 0], log[found[0], 1] = t, k
            log[found[0], 2] = FOLD if P.thr[k] > 1.0 else TANGENCY
            found[0] += 1
            if P.thr[k] > 1.0:
                code = DONE if way_out(P, t, y, lam, slips, out, c) else UNDECIDED
                if code == DONE:
                    code, t = release(P, t, y, lam, slips, out, c, longest)
            else:
                # How fast the bound is passed tells how soon the series of the direction diverge.
                base, ahead = y.copy(), lam.copy()
                hold(P, t, base, ahead, slips, dy)
                size = size_of(P, k, ahead)
                tiny = 1e-5 / fastest
                for i in range(N):
                    base[i] += tiny * dy[i]
                hold(P, t + tiny, base, ahead, slips, dy)
                speed = (size_of(P, k, ahead) - size) / tiny
                margin[1] = min(margin[1], speed)
                if not speed > 1e-6:
                    return UNDECIDED, t, states
                size = size_of(P, k, lam)
                for i in range(P.d[k]):
                    lam[k, i] /= size
                code, t = release(P, t, y, lam, slips, out, c, min(0.005 / speed, longest))
        if found[0] > len(log) - 8:
            return TOO_MANY, t, states
        if code != DONE:
            return code, t, states
        pack(P, y, lam, slips, t, Y)
        polar(P, Y, slips, y, lam, dy, F[0])
        h = 1e-3
    return TOO_MANY, Y[N + K], states
