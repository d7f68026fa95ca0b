"""The layer system: what happens on a surface h = 0 in the fast time t/eps.

    du_j/dtau = w_j g_j(t, x, lambda, z),   lambda_j = Lambda(u_j),   dz/dtau = r Q(t, x, lambda, z)

for every switch that is on its surface, t and x frozen, w_j = eps_1/eps_j. One switch without layered states
moves monotonically in lambda, so the first zero of g on its way decides. Otherwise the system is integrated.
"""

import math

import numpy as np
from numba import njit

from .pointers import call_fields, call_layer
from .sliding import follow, instant_mask, newton
from .state import SLIDING, SOLVED

SETTLED, OSCILLATES, LOST = range(3)
_SCAN = 48  # intervals over [-1, 1] in which the first zero of a hidden g is sought


@njit(cache=True)
def sigmoid(kind, u):
    """Lambda(u): algebraic u/sqrt(1+u^2), tanh u, erf u."""
    if kind == 0:
        return u / math.sqrt(1.0 + u * u) if abs(u) < 1e150 else math.copysign(1.0, u)
    return math.tanh(u) if kind == 1 else math.erf(u)


@njit(cache=True)
def sigmoid_inverse(kind, lam):
    """u with Lambda(u) = lam, |lam| < 1."""
    if kind == 0:
        return lam / math.sqrt((1.0 - lam) * (1.0 + lam))
    if kind == 1:
        return math.atanh(lam)
    lo, hi = -6.0, 6.0
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        if math.erf(mid) < lam:
            lo = mid
        else:
            hi = mid
    return 0.5 * (lo + hi)


@njit(cache=True)
def _g(P, t, x, mult, j, lam, frozen, work):
    """Residual of switch j at lambda_j = lam, the multipliers of every instant solved along."""
    mult[j] = lam
    if frozen:
        call_layer(P.layer, t, x, mult, work.z, P.p, work.g, work.q)
        return work.g[j]
    has_instant = False
    for i in range(P.m):
        if work.mask[i]:
            has_instant = True
    if has_instant:
        newton(P, t, x, mult, work.mask, work)
    call_fields(P.fields, t, x, mult, P.p, work.dx, work.h, work.g)
    return work.g[j]


@njit(cache=True)
def first_zero(P, t, x, mult, status, j, start, toward, frozen, work):
    """First lambda_j from `start` on the way to `toward` (+1 or -1) where g_j stops pushing that way.

    Returns (found, lambda). `frozen`: with the layered states held at work.z.
    """
    instant_mask(P, status, work.mask)
    work.mask[j] = 0
    g0 = _g(P, t, x, mult, j, start, frozen, work) * toward
    if g0 <= 0.0:
        return True, start
    end = float(toward)
    if not P.hidden[j] and not frozen:
        g1 = _g(P, t, x, mult, j, end, frozen, work) * toward
        if g1 > 0.0:
            return False, end
        lam = start + (end - start) * g0 / (g0 - g1)
        return True, lam
    steps = max(4, int(math.ceil(_SCAN * abs(end - start) / 2.0)))
    a, ga = start, g0
    before, g_before = start, g0
    for i in range(1, steps + 1):
        b = start + (end - start) * i / steps if i < steps else end
        gb = _g(P, t, x, mult, j, b, frozen, work) * toward
        if gb <= 0.0:
            return True, _bisect(P, t, x, mult, j, a, b, toward, frozen, work)
        if i > 1 and ga <= g_before and ga <= gb:
            # An interior minimum: the pair of zeros beside a fold may hide in it.
            c = _lowest(P, t, x, mult, j, before, b, toward, frozen, work)
            if _g(P, t, x, mult, j, c, frozen, work) * toward <= 0.0:
                return True, _bisect(P, t, x, mult, j, before, c, toward, frozen, work)
        before, g_before = a, ga
        a, ga = b, gb
    return False, end


@njit(cache=True)
def _bisect(P, t, x, mult, j, a, b, toward, frozen, work):
    """Zero of g_j between a (pushing toward) and b (not)."""
    for _ in range(80):
        c = 0.5 * (a + b)
        if c == a or c == b:
            break
        if _g(P, t, x, mult, j, c, frozen, work) * toward > 0.0:
            a = c
        else:
            b = c
    return 0.5 * (a + b)


@njit(cache=True)
def _lowest(P, t, x, mult, j, a, b, toward, frozen, work):
    """Minimum of toward * g_j in [a, b] by golden sections, ended as soon as a value is not positive."""
    ratio = 0.6180339887498949
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    gc = _g(P, t, x, mult, j, c, frozen, work) * toward
    gd = _g(P, t, x, mult, j, d, frozen, work) * toward
    for _ in range(50):
        if gc <= 0.0:
            return c
        if gd <= 0.0:
            return d
        if gc < gd:
            b, d, gd = d, c, gc
            c = b - ratio * (b - a)
            gc = _g(P, t, x, mult, j, c, frozen, work) * toward
        else:
            a, c, gc = c, d, gd
            d = a + ratio * (b - a)
            gd = _g(P, t, x, mult, j, d, frozen, work) * toward
    return c if gc < gd else d


# Dormand-Prince 5(4).
_A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@njit(cache=True)
def _rates(P, t, x, mult, active, size, y, out, work):
    for i in range(size):
        mult[active[i]] = sigmoid(P.sigmoid, y[i])
    if P.nz > 0:
        for i in range(P.nz):
            work.z[i] = y[size + i]
        call_layer(P.layer, t, x, mult, work.z, P.p, work.g, work.q)
        for i in range(P.nz):
            out[size + i] = P.ratio[i] * work.q[i]
    else:
        has_instant = False
        for i in range(P.m):
            if work.mask[i]:
                has_instant = True
        if has_instant:
            newton(P, t, x, mult, work.mask, work)
        call_fields(P.fields, t, x, mult, P.p, work.dx, work.h, work.g)
    for i in range(size):
        out[i] = P.weight[active[i]] * work.g[active[i]]


@njit(cache=True)
def integrate(P, t, x, mult, status, active, size, u, work):
    """Runs the layer system of the switches active[:size] from u (and work.z) until all are settled.

    Overwrites mult, status, work.z. Returns SETTLED, OSCILLATES (no rest within the time allowed) or LOST.
    A switch that runs out to u = +-inf gets that side; the rest goes on without it.
    """
    instant_mask(P, status, work.mask)
    nz = P.nz
    y = np.zeros(size + nz)
    for i in range(size):
        y[i] = u[i]
        work.mask[active[i]] = 0
    for i in range(nz):
        y[size + i] = work.z[i]
    reach = 1e3
    for i in range(size):
        reach = max(reach, 10.0 * abs(u[i]))
    tau, step, scale = 0.0, 1e-3, 0.0
    k = np.zeros((7, size + nz))
    new = np.zeros(size + nz)
    _rates(P, t, x, mult, active, size, y, k[0], work)
    quiet = 0
    for attempt in range(200000):
        dim = size + nz
        for s in range(1, 7):
            for i in range(dim):
                total = 0.0
                for r in range(s):
                    total += _A[s, r] * k[r, i]
                new[i] = y[i] + step * total
            _rates(P, t, x, mult, active, size, new, k[s], work)
        error = 0.0
        for i in range(dim):
            total = 0.0
            for r in range(7):
                total += _E[r] * k[r, i]
            error = max(error, abs(step * total) / (1e-10 + 1e-10 * abs(new[i])))
        if not np.isfinite(error):
            step *= 0.1
            if step < 1e-14:
                return LOST
            continue
        factor = 0.9 * (error + 1e-12) ** -0.2
        if error > 1.0:
            step *= max(0.2, factor)
            continue
        tau += step
        step *= min(5.0, factor)
        for i in range(dim):
            y[i] = new[i]
            k[0, i] = k[6, i]
        speed = 0.0
        for i in range(dim):
            speed = max(speed, abs(k[0, i]))
        scale = max(scale, speed)
        gone = -1
        for i in range(size):
            if abs(y[i]) > reach and y[i] * k[0, i] > 0.0:
                gone = i
        if gone >= 0:
            j = active[gone]
            status[j] = 1 if y[gone] > 0.0 else -1
            mult[j] = float(status[j])
            for i in range(gone, dim - 1):
                y[i] = y[i + 1]
                if i < size - 1:
                    active[i] = active[i + 1]
            size -= 1
            if size == 0:
                return SETTLED
            _rates(P, t, x, mult, active, size, y, k[0], work)
            step = min(step, 0.1)
            continue
        quiet = quiet + 1 if speed <= 1e-9 * scale else 0
        if quiet >= 3:
            break
        if tau > 1e5 * (1.0 + reach / max(scale, 1e-3) * 1e-3) and attempt > 20000:
            return OSCILLATES
    else:
        return OSCILLATES
    for i in range(size):
        status[active[i]] = SOLVED
    for j in range(P.m):
        work.mask[j] = 1 if status[j] == SOLVED else 0
    return SETTLED if newton(P, t, x, mult, work.mask, work) else LOST


@njit(cache=True)
def relax(P, t, x, mult, status, j, along, work):
    """Lets the layered states run to rest at fixed lambda_j, or along the root of g_j (two-stage layer).

    Overwrites work.z and mult. Returns the side that lambda_j left by, or 0 when everything came to rest.
    """
    z, q = work.z, work.q
    k = np.zeros((4, P.nz))
    z0 = np.zeros(P.nz)
    shift = np.array([0.0, 0.5, 0.5, 1.0])
    dt = 0.02
    for sweep in range(100000):
        for i in range(P.nz):
            z0[i] = z[i]
        for s in range(4):
            for i in range(P.nz):
                z[i] = z0[i] + (shift[s] * dt * k[s - 1, i] if s > 0 else 0.0)
            if along:
                lam = mult[j]
                toward = 1.0
                found = False
                # Secant steps on g_j(lambda; z): the root moves little between stages.
                a = lam
                ga = _g(P, t, x, mult, j, a, True, work)
                b = a + 1e-7
                for _ in range(30):
                    gb = _g(P, t, x, mult, j, b, True, work)
                    if gb == ga:
                        found = gb == 0.0
                        break
                    c = b - gb * (b - a) / (gb - ga)
                    a, ga, b = b, gb, c
                    if abs(b - a) < 1e-15:
                        found = True
                        break
                if not found and not abs(b - a) < 1e-10:
                    return 1 if lam > 0 else -1
                mult[j] = b
                if abs(b) >= 1.0:
                    return 1 if b > 0 else -1
            call_layer(P.layer, t, x, mult, z, P.p, work.g, q)
            for i in range(P.nz):
                k[s, i] = q[i]
        speed = 0.0
        for i in range(P.nz):
            z[i] = z0[i] + dt / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
            speed = max(speed, abs(k[0, i]))
        if speed < 1e-14:
            break
    return 0


@njit(cache=True)
def _tail(P, g):
    """Distance |u| from which a layer run starts or ends: far enough that fast layered states have settled."""
    slowest = 1.0
    for i in range(P.nz):
        slowest = min(slowest, P.ratio[i])
    return 1e3 + 50.0 * abs(g) / slowest


@njit(cache=True)
def arrive(P, t, x, mult, status, active, size, side, work):
    """Settles switches that came to their surfaces from `side` (0: on the surface at rest, u = 0).

    Overwrites mult and status; returns SETTLED, OSCILLATES or LOST.
    """
    call_fields(P.fields, t, x, mult, P.p, work.dx, work.h, work.g)
    slaved = P.nz == 0
    two_stage = P.nz > 0 and P.ratio.max() == 0.0
    if size == 1 and (slaved or two_stage):
        j = active[0]
        start = float(side[0])
        toward = -side[0]
        frozen = False
        if two_stage:
            mult[j] = start
            relax(P, t, x, mult, status, j, False, work)
            frozen = True
        if side[0] == 0:
            instant_mask(P, status, work.mask)
            work.mask[j] = 0
            toward = 1 if _g(P, t, x, mult, j, 0.0, frozen, work) > 0.0 else -1
        found, lam = first_zero(P, t, x, mult, status, j, start, toward, frozen, work)
        if found and two_stage:
            mult[j] = lam
            left = relax(P, t, x, mult, status, j, True, work)
            if left != 0:
                found = False
                toward = left
            lam = mult[j]
        if not found:
            status[j] = toward
            mult[j] = float(toward)
            instant_mask(P, status, work.mask)
            return SETTLED if follow(P, t, x, mult, work.mask, work) else LOST
        status[j] = SOLVED
        mult[j] = lam
        for i in range(P.m):
            work.mask[i] = 1 if status[i] == SOLVED else 0
        return SETTLED if follow(P, t, x, mult, work.mask, work) else LOST
    top = 1e-300
    for i in range(size):
        if side[i] != 0:
            top = max(top, abs(work.g[active[i]]) * P.weight[active[i]])
    u = np.zeros(size)
    for i in range(size):
        j = active[i]
        if side[i] == 0:
            u[i] = sigmoid_inverse(P.sigmoid, mult[j]) if abs(mult[j]) < 1.0 else 0.0
        else:
            # Along the straight approach all |h_j| vanish at one instant: |u_j| in the ratio of the speeds.
            share = abs(work.g[j]) * P.weight[j] / top
            u[i] = side[i] * _tail(P, top) * max(share, 1e-6)
            mult[j] = sigmoid(P.sigmoid, u[i])
    if P.nz > 0:
        for i in range(P.nz):
            work.z[i] = 0.0
        relax(P, t, x, mult, status, active[0], False, work)
    return integrate(P, t, x, mult, status, active, size, u, work)


@njit(cache=True)
def leave_fold(P, t, x, mult, status, j, toward, work):
    """After a fold of switch j's root the layer decides again, going on in the direction `toward`.

    Overwrites mult and status; returns SETTLED, OSCILLATES or LOST.
    """
    start = mult[j] + 1e-6 * toward
    others = 0
    active = np.empty(P.m, np.int64)
    for i in range(P.m):
        if i != j and status[i] == SOLVED and P.kind[i] == SLIDING and (P.coupled[i, j] or P.coupled[j, i]):
            active[1 + others] = i
            others += 1
    slaved = P.nz == 0
    two_stage = P.nz > 0 and P.ratio.max() == 0.0
    if others == 0 and slaved:
        found, lam = first_zero(P, t, x, mult, status, j, start, toward, False, work)
        if found and abs(lam - start) < 1e-5:
            # Still on the rounding of the fold: look on from beyond it.
            found, lam = first_zero(P, t, x, mult, status, j, mult[j] + 1e-3 * toward, toward, False, work)
        if found:
            status[j], mult[j] = SOLVED, lam
        else:
            status[j], mult[j] = toward, float(toward)
        for i in range(P.m):
            work.mask[i] = 1 if status[i] == SOLVED else 0
        return SETTLED if follow(P, t, x, mult, work.mask, work) else LOST
    mult[j] = mult[j] + 1e-3 * toward
    if P.nz > 0:
        for i in range(P.nz):
            work.z[i] = 0.0
        relax(P, t, x, mult, status, j, False, work)
    if two_stage and others == 0:
        left = relax(P, t, x, mult, status, j, True, work)
        if left != 0:
            status[j], mult[j] = left, float(left)
        for i in range(P.m):
            work.mask[i] = 1 if status[i] == SOLVED else 0
        return SETTLED if follow(P, t, x, mult, work.mask, work) else LOST
    active[0] = j
    u = np.zeros(1 + others)
    for i in range(1 + others):
        lam = min(max(mult[active[i]], -1.0 + 1e-12), 1.0 - 1e-12)
        u[i] = sigmoid_inverse(P.sigmoid, lam)
    return integrate(P, t, x, mult, status, active, 1 + others, u, work)
