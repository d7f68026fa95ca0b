"""The layer system run in its fast time, for several switches at once or with layered states.

    du_j/dtau = w_j g_j(t, x, Lambda(u), z),   dz_i/dtau = r_i Q_i(t, x, Lambda(u), z)

Chain: **this file** -> layer.py, which says when a run is needed.
"""

import math

import numpy as np

from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_layer, call_newton
from ..state import COMPONENT, HELD, SOLVED
from .dependent import PARTS, independent, slopes_of_group
from .sliding import mask_instant, mask_solved
from .vector import turn

SETTLED, OSCILLATES, LOST = range(3)
_SURE_STEP = 0.02  # of the relaxation of a layered state, in its own time constant: fixed steps of it were safe
_FARTHEST = 1e150  # of u, whose square is finite
_FAR = 20.0  # from there on lambda is within 2e-3 of its bound, and moves ever more slowly
_BOUND = 1e-12  # of lambda: a root farther out is none
_AT_BOUND = 1.0 - 1e-9  # of lambda: what has come to its bound has no room left
# Of lambda on its circle: a change for slopes, sweeps of Newton's method, and the change that ends them.
_NUDGE, _TURNS, _ALIKE = 1e-6, 20, 1e-9
_MANY = 1000  # steps without rest, after which it is looked at what slow motion there is


@kernel
def sigmoid(P, W, u):
    """Lambda(u)."""
    pair, value = W.layer.pair, W.layer.value
    pair[0] = min(max(u, -_FARTHEST), _FARTHEST)
    call_fields(P.sigmoid, 0.0, pair, value, value, value, value, value)
    return value[0]


@kernel
def sigmoid_inverse(P, W, lam):
    """u with Lambda(u) = lam; lam = +-1 counts as the last number before it."""
    lam = max(min(lam, 1.0 - 1e-15), -1.0 + 1e-15)
    W.layer.pair[1] = lam
    sigmoid(P, W, 0.0)
    u = W.layer.value[1]
    if u == u:
        return u
    hi = 6.0
    while sigmoid(P, W, hi) < abs(lam):
        hi *= 2.0
    lo = -hi
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        if sigmoid(P, W, mid) < lam:
            lo = mid
        else:
            hi = mid
    return 0.5 * (lo + hi)


@kernel
def push_toward(P, S, W, j, lam, toward, frozen):
    """toward * g_j at lambda_j = lam, the multipliers of every instant (W.mask) solved along.

    `frozen`: with the layered states held at W.layer.z.
    """
    S.mult[j] = lam
    if frozen:
        call_layer(P.layer, S.t, S.x, S.mult, W.layer.z, P.p, W.g, W.layer.q)
        return toward * W.g[j]
    if W.layer.masked:
        call_newton(P.newton_unit, P, S, W)
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    return toward * W.g[j]


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


@kernel
def stage_point(y, k, s, i, step):
    """Component i of the point at which stage s is taken."""
    total = 0.0
    for r in range(s):
        total += _A[s, r] * k[r, i]
    return y[i] + step * total


@kernel
def defect(k, i):
    """Component i of the error of a step, over its length."""
    total = 0.0
    for r in range(7):
        total += _E[r] * k[r, i]
    return total


@kernel
def disc_norm(P, W, size, y, i):
    """|w| of the disc to which component W.instant.group[i] belongs, from the layer's state y."""
    total = 0.0
    for r in range(size):
        if P.disc_of[W.instant.group[r]] == P.disc_of[W.instant.group[i]]:
            total += y[r] ** 2
    return math.sqrt(total)


@kernel
def _leaves(P, W, size, y, rates, i, reach):
    """Whether switch i of the layer is farther out than `reach`, and goes outwards; of a disc its first component."""
    j = W.instant.group[i]
    if P.kind[j] != COMPONENT:
        return abs(y[i]) > reach and y[i] * rates[i] > 0.0
    if j != P.disc_of[j] + 1 or not disc_norm(P, W, size, y, i) > reach:
        return False
    outwards = 0.0
    for r in range(i, i + P.dim[P.disc_of[j]]):
        outwards += y[r] * rates[r]
    return outwards > 0.0


@kernel
def _rates(P, S, W, size, y, out, stage):
    """Overwrites out[stage] with the rates of the layer system at y = (u of W.instant.group, z)."""
    instant = W.instant
    mult = S.mult
    for i in range(size):
        j = instant.group[i]
        if P.kind[j] != COMPONENT:
            mult[j] = sigmoid(P, W, y[i])
            continue
        distance = disc_norm(P, W, size, y, i)
        mult[j] = sigmoid(P, W, distance) * y[i] / distance if distance > 0.0 else 0.0
    if P.nz > 0:
        for i in range(P.nz):
            W.layer.z[i] = y[size + i]
        call_layer(P.layer, S.t, S.x, mult, W.layer.z, P.p, W.g, W.layer.q)
        for i in range(P.nz):
            out[stage, size + i] = W.layer.pace * P.ratio[i] * W.layer.q[i]
    else:
        if W.layer.masked:
            call_newton(P.newton_unit, P, S, W)
        call_fields(P.fields, S.t, S.x, mult, P.p, W.dx, W.h, W.g)
    for i in range(size):
        out[stage, i] = W.layer.pace * P.weight[instant.group[i]] * W.g[instant.group[i]]


@kernel
def _hold_redundant(P, S, W, size):
    """Where switches of the group determine the surfaces of others, as two feet of one body do, these are HELD with the
    lambda that they have come to, at their bounds before inside; whether there are any."""
    group, own = W.together, 0.0
    if size < 2 or size > len(group.comp):
        return False
    for i in range(size):
        if P.kind[W.instant.group[i]] == COMPONENT:
            return False
    for j in range(P.m):
        W.linear.start[j] = S.mult[j]
    for i in range(size):
        j = W.instant.group[i]
        group.comp[i], group.late[i] = j, int(abs(S.mult[j]) > _AT_BOUND)
    slopes_of_group(P, S, W, size)
    rank, holds = independent(W, size), False
    for i in range(size):
        own = max(own, abs(group.J[i, i]))
    for i in range(rank, size):
        S.status[group.comp[group.order[i]]] = HELD
    mask_solved(P, S, W)
    if rank < size:
        holds = call_newton(P.newton_unit, P, S, W) != 0
        for i in range(rank, size):
            holds = holds and abs(W.g[group.comp[group.order[i]]]) <= PARTS * own
    for i in range(size if not holds else 0):
        S.status[group.comp[i]] = SOLVED
    for j in range(P.m if not holds else 0):
        S.mult[j] = W.linear.start[j]
    return holds


@kernel
def _rest_is_near(P, S, W, size):
    """Solves for the rest state beside a layer run that has become slow; False (S as before) if it is elsewhere."""
    instant = W.instant
    for i in range(size):
        W.layer.status[i] = S.status[instant.group[i]]
        W.layer.mult[i] = S.mult[instant.group[i]]
        S.status[instant.group[i]] = SOLVED
    near = _hold_redundant(P, S, W, size)
    mask_solved(P, S, W)
    near = near or call_newton(P.newton_unit, P, S, W) != 0
    for i in range(size):
        j = instant.group[i]
        bounded = j if P.kind[j] != COMPONENT else P.disc_of[j]  # of a disc lambda . lambda
        near = near and abs(S.mult[j] - W.layer.mult[i]) < 1e-3 and abs(S.mult[bounded]) <= 1.0 + _BOUND
    if not near:
        for i in range(size):
            S.status[instant.group[i]] = W.layer.status[i]
            S.mult[instant.group[i]] = W.layer.mult[i]
    return near


@kernel
def _way_out_of_disc(P, S, W, size, i):
    """Puts lambda of the disc whose first component is i on its circle, where G = c n, the others at rest; c, or -1."""
    j = P.disc_of[W.instant.group[i]]
    d, c, change, keep = P.dim[j], 0.0, math.inf, 0.0
    others = W.layer.masked != 0 or size > d
    for r in range(size):
        W.mask[W.instant.group[r]] = 0 if i <= r < i + d else 1
    along = 0.0
    for k in range(j + 1, j + 1 + d):
        along += S.mult[k] ** 2
    for k in range(j + 1, j + 1 + d):
        S.mult[k] /= math.sqrt(along)
    for sweep in range(_TURNS):
        for column in range(d + 1):  # g beside n, and last at n itself
            if column < d:
                keep = S.mult[j + 1 + column]
                S.mult[j + 1 + column] = keep + _NUDGE
            if others:
                call_newton(P.newton_unit, P, S, W)
            call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
            if column < d:
                S.mult[j + 1 + column] = keep
                for r in range(d):
                    W.disc[r, column] = W.g[j + 1 + r]
        for r in range(d):
            for column in range(d):
                W.disc[r, column] = (W.disc[r, column] - W.g[j + 1 + r]) / _NUDGE
            c += S.mult[j + 1 + r] * W.g[j + 1 + r] if sweep == 0 else 0.0
        c, change = turn(P, S, W, j, c)
        if change <= _ALIKE or not change < math.inf:
            break
    return c if change <= _ALIKE else -1.0


@kernel
def _outward(P, S, W, size, y, rates):
    """Of switches far out on their way to a bound, one that still goes outward at the bound, the others at rest there.

    Its place, or -1. It creeps by the difference from a root beyond its bound, for ever where that is small.
    """
    instant = W.instant
    found = -1
    for i in range(size):
        if not _leaves(P, W, size, y, rates, i, _FAR):
            continue
        j, side, stays = instant.group[i], 1.0 if y[i] > 0.0 else -1.0, True
        for r in range(size):
            W.layer.mult[r] = S.mult[instant.group[r]]
            W.mask[instant.group[r]] = 0 if r == i else 1
        if P.kind[j] == COMPONENT:
            push = _way_out_of_disc(P, S, W, size, i)
        else:
            S.mult[j] = side
            stays = call_newton(P.newton_unit, P, S, W) != 0
            call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
            push = side * W.g[j]
        for r in range(size):
            stays = stays and abs(S.mult[instant.group[r]] - W.layer.mult[r]) < 1e-2
        if stays and push > 1e-12:
            found = i
        for r in range(size):
            S.mult[instant.group[r]] = W.layer.mult[r]
            W.mask[instant.group[r]] = 0
    return found


@kernel
def _set_pace(P, S, W, size):
    """Leaves in W.layer.pace the power of 2 that brings the fastest switch's rate to size 1, if it is far from that.

    Returns that rate.
    """
    fastest = 0.0
    for i in range(size):
        j = W.instant.group[i]
        keep = S.mult[j]
        for side in range(-1, 2):
            S.mult[j] = float(side)
            call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
            fastest = max(fastest, abs(P.weight[j] * W.g[j]))
        S.mult[j] = keep
    W.layer.pace = 1.0
    if 0.0 < fastest < math.inf and not 1e-2 <= fastest <= 1e2:
        W.layer.pace = 2.0 ** -math.floor(math.log2(fastest))
    return W.layer.pace * fastest


@kernel
def integrate(P, S, W, size):
    """Runs the layer system of the switches group[:size] from u = W.layer.y (and z) until all are settled.

    Overwrites S.mult, S.status, z, group. Returns SETTLED, OSCILLATES (no rest within the time allowed) or LOST.
    A switch that runs out to u = +-inf gets that side; the rest goes on without it.
    """
    instant = W.instant
    nz, y, new, k = P.nz, W.layer.y, W.layer.new, W.layer.k
    W.layer.masked = 1 if mask_instant(P, S, W) else 0
    reach = 1e3
    for i in range(size):
        W.mask[instant.group[i]] = 0
        reach = max(reach, 10.0 * abs(y[i]))
    for i in range(nz):
        y[size + i] = W.layer.z[i]
    # A start within rounding of a root is at rest: what it moves by is no scale.
    tau, step, scale = 0.0, 1e-3, 1e-6 * _set_pace(P, S, W, size)
    _rates(P, S, W, size, y, k, 0)
    quiet, small = 0, 1e-7
    for taken in range(1, 200001):
        dim = size + nz
        for s in range(1, 7):
            for i in range(dim):
                new[i] = stage_point(y, k, s, i, step)
            _rates(P, S, W, size, new, k, s)
        error = 0.0
        for i in range(dim):
            error = max(error, abs(step * defect(k, i)) / (1e-10 + 1e-10 * abs(new[i])))
        if not error < math.inf:
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
        speed, gone = 0.0, -1
        for i in range(dim):
            y[i] = new[i]
            k[0, i] = k[6, i]
            speed = max(speed, abs(k[0, i]))
        for i in range(size):
            if _leaves(P, W, size, y, k[0], i, reach):
                gone = i
        scale = max(scale, speed)
        if taken % _MANY == 0 and gone < 0 and nz == 0:
            gone = _outward(P, S, W, size, y, k[0])
        if gone >= 0:
            j, width = instant.group[gone], 1
            if P.kind[j] == COMPONENT:
                width = P.dim[P.disc_of[j]]
                S.status[P.disc_of[j]] = 1
            else:
                S.status[j] = 1 if y[gone] > 0.0 else -1
                S.mult[j] = float(S.status[j])
            for i in range(gone, dim - width):
                y[i] = y[i + width]
            for i in range(gone, size - width):
                instant.group[i] = instant.group[i + width]
            size -= width
            if size == 0:
                return SETTLED
            _rates(P, S, W, size, y, k, 0)
            step = min(step, 0.1)
            continue
        quiet = quiet + 1 if speed <= small * scale else 0
        creeps = False  # to a root just inside of its bound
        for i in range(size if taken % _MANY == 0 and nz == 0 else 0):
            creeps = creeps or abs(y[i]) > _FAR
        if quiet >= 3 or creeps:
            if _rest_is_near(P, S, W, size):
                return SETTLED
            # A bottleneck near a fold, not an equilibrium: continue with a stricter test of rest.
            small *= 1.0 if creeps else 0.1
            quiet = 0
            for i in range(size):
                W.mask[instant.group[i]] = 0
    return OSCILLATES


@kernel
def _root_along(P, S, W, j):
    """Moves lambda_j onto the zero of g_j at frozen z by secant steps; False when there is none beside it."""
    a = S.mult[j]
    b = a + 1e-7
    push_a = push_toward(P, S, W, j, a, 1, True)
    for _ in range(30):
        push_b = push_toward(P, S, W, j, b, 1, True)
        if push_b == push_a:
            return push_b == 0.0
        c = b - push_b * (b - a) / (push_b - push_a)
        a, push_a, b = b, push_b, c
        if abs(b - a) < 1e-14:
            S.mult[j] = b
            return True
    return False


@kernel
def relax(P, S, W, j, along):
    """Lets the layered states run to rest at fixed lambda_j, or along the root of g_j (two-stage layer).

    Overwrites W.layer.z and S.mult. Returns the side that lambda_j left by, or 0 when everything came to rest. The pair
    5(4), so that rest is reached in some sixty steps; a root is lost only on a step so short that a stage does not
    jump over it.
    """
    z, q, z0, k, nz = W.layer.z, W.layer.q, W.layer.new, W.layer.k, P.nz
    dt, lam = _SURE_STEP, S.mult[j]
    for i in range(nz):
        z0[i] = z[i]
    for _ in range(100000):
        left, error, speed = 0, 0.0, 0.0
        for s in range(7):
            for i in range(nz):
                z[i] = stage_point(z0, k, s, i, dt)
            if along:
                was = S.mult[j]
                if not _root_along(P, S, W, j):
                    left = 1 if was > 0.0 else -1
                elif abs(S.mult[j]) >= 1.0:
                    left = 1 if S.mult[j] > 0.0 else -1
                if left != 0:
                    break
            call_layer(P.layer, S.t, S.x, S.mult, z, P.p, W.g, q)
            for i in range(nz):
                k[s, i] = q[i]
                if s == 0:
                    speed = max(speed, abs(q[i]))
        if left != 0:
            if dt <= _SURE_STEP:
                return left
            dt = max(0.25 * dt, _SURE_STEP)
            S.mult[j] = lam
            continue
        for i in range(nz):
            # Relative to what is left to go as well: at rest nothing must keep it moving.
            error = max(error, abs(dt * defect(k, i)) / (min(1e-10, 1e-4 * dt * speed) + 1e-18))
        if not error < math.inf:
            error = math.inf
        factor = 0.9 * (error + 1e-12) ** -0.2
        if error > 1.0 and dt > _SURE_STEP:
            dt = max(dt * max(0.2, factor), _SURE_STEP)
            S.mult[j] = lam
            continue
        # The last stage stands at the step's end.
        for i in range(nz):
            z0[i] = z[i]
        lam = S.mult[j]
        if speed < 1e-14:
            break
        dt = max(dt * min(5.0, factor), _SURE_STEP)
    return 0


@kernel
def relax_from_zero(P, S, W, j):
    for i in range(P.nz):
        W.layer.z[i] = 0.0
    relax(P, S, W, j, False)
