"""Impacts of all that touch at one instant, with dry friction between what touches.

With u the rates of the gaps and x+ = x + sum p_j b_j(lambda) the states after impulses p_j along the pushes b_j,

    0 <= p  complementary to  u+ + e u >= 0        (Newton's restitution; Moreau 1988)
    h_k(x+) = 0  or  lambda_k = sgn h_k(x+)        (Coulomb's law of impulses, of a disc lambda = h/|h|)

over all that touch and act on each other. Friction is what stands in a push and is opposed to its own slip: its impulse
opposes the slip after the impact, which ends where that suffices. Which push and which stick is found by sweeps of
projected Gauss-Seidel steps, the impulses then by Newton's method, with the shortest change of lambda where the
equations leave some open. One contact alone rebounds with -e u.
Chain: contacts.py -> **this file** -> surface_rates.py, sparse.py.
"""

import math

from ..intervals import note_arc
from ..machine.compiling import inlined_kernel, kernel
from ..machine.pointers import call_act, call_fields
from ..state import (
    AMB_IMPACTS,
    COMPONENT,
    CONTACT,
    DISC,
    EV_IMPACT,
    SLIDING,
    TAPE_ACT,
    TAPE_MEET,
    TAPE_OTHER,
    TAPE_ROUND,
)
from ..step.recording import put_on_tape, record_ambiguity, record_event
from ..surface.sliding import INSIDE, keep_on_surface, put_in_slip, surface_size, surface_speed
from ..surface.sparse import entry, link, solve_dense
from .surface_rates import approach_speed, evaluate_surfaces

INCONSISTENT, UNSOLVABLE, UNCHANGED, CHANGED = -2, -1, 0, 1
_PUSHED = 2  # impulses without friction are in contacts.impulse
_HEAVY = float(2**30)  # a reaction beside which all other forces are small
_EQUAL = 1e-12  # of the largest speed or force: what is smaller is rounding
_SINGULAR = 1e10  # an impulse or force so many times the others comes of a singular matrix
_STEP = 2.0**-10  # of an impulse or lambda, over which slopes are taken
_OPEN = 1e-12  # of the slopes' squares: what is added to them where equations leave unknowns open
_IDLE = 1e-10  # of its own slip: less that a lambda does to it is nothing
_NEWTON, _MOST_SWEEPS = 30, 3000


@kernel
def find_couplings(P, S, W, size):
    """Overwrites W.contacts.delassus, the matrix D of the touching contacts."""
    contacts = W.contacts
    evaluate_surfaces(P, S, W)
    for a in range(size):
        for b in range(size):
            contacts.delassus[a, b] = entry(P.g_row, P.g_col, W.G, contacts.touching[a], contacts.touching[b])


@kernel
def _coupled(P, W, a, size):
    """Whether an impulse at touching contact a moves another one that touches, or is moved by it.

    Where there is friction the lambda of which is not known yet: whether it can be.
    """
    contacts, friction = W.contacts, len(W.struck.member) > 0
    for b in range(size):
        if b != a and (contacts.delassus[a, b] != 0.0 or contacts.delassus[b, a] != 0.0):
            return True
        for e in range(P.g_row[contacts.touching[a]], P.g_row[contacts.touching[a] + 1]):
            if friction and b != a and P.g_col[e] == contacts.touching[b]:
                return True
    return False


@kernel
def _rebound(P, S, W, j):
    """Overwrites W.contacts.after by the state after a rebound of contact j alone; returns its speed there."""
    contacts = W.contacts
    for i in range(P.n):
        contacts.before[i] = contacts.after[i] = S.x[i]
    call_act(P.act, P.ne + j, S.t, S.x, S.mult, P.p, contacts.after)
    for i in range(P.n):
        S.x[i] = contacts.after[i]
    speed = approach_speed(P, S, j, W)
    for i in range(P.n):
        S.x[i] = contacts.before[i]
    return speed


@kernel
def kick(P, S, W, j, impulse):
    """Gives the state an impulse at contact j: the rates are linear in R_j, whose factor is the direction."""
    mult = S.mult[j]
    S.mult[j] = -_HEAVY
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    for i in range(P.n):
        W.contacts.after[i] = W.dx[i]  # what is given, in a patch of elements, stands in `dx` alone
    S.mult[j] = _HEAVY
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    S.mult[j] = mult
    for i in range(P.n):
        S.x[i] += impulse * ((W.dx[i] - W.contacts.after[i]) / (2.0 * _HEAVY))


@kernel
def begin_impulses(P, S, W):
    """Nothing has been struck yet at this instant."""
    for k in range(P.m):
        W.contacts.push[k], W.contacts.pushed[k] = 0.0 if P.kind[k] == CONTACT else S.mult[k], 0.0


@kernel
def note_rebound(W, j, code, speed, mobility):
    """Notes the impulse of contact j, which has met with this speed and rebounded alone."""
    if code == CHANGED:
        _note_friction(W)
    else:
        W.contacts.push[j] += (W.contacts.rebound - speed) / mobility


@kernel
def _note_friction(W):
    """Notes the impulses of the group, and the lambda of their friction: the mean of what they have had."""
    contacts, group, sum_ = W.contacts, W.struck, 0.0
    for r in range(group.contacts):
        contacts.push[group.member[r]] += group.value[r]
        sum_ += group.value[r]
    for r in range(group.contacts, group.size if sum_ > 0.0 else group.contacts):
        k = group.member[r]
        contacts.pushed[k] += sum_
        contacts.push[k] += (group.value[r] - contacts.push[k]) * (sum_ / contacts.pushed[k])


@kernel
def record_impulses(S, R, W, first):
    """Writes the impulses of the instant beside the impacts that were recorded from `first` on."""
    for i in range(first, S.events if R.push.shape[0] > 0 else first):
        for k in range(R.push.shape[1]):
            R.push[i, k] = W.contacts.push[k]


@kernel
def solve_chosen(contacts, size):
    """Overwrites contacts.impulse: q + D p = 0 for the chosen contacts, p = 0 for the others; False if singular."""
    p, q, D, A = contacts.impulse, contacts.load, contacts.delassus, contacts.pivots
    rows, scale = 0, 0.0
    for a in range(size):
        scale = max(scale, abs(q[a]))
        if contacts.chosen[a]:
            columns = 0
            for b in range(size):
                if contacts.chosen[b]:
                    A[rows, columns] = D[a, b]
                    columns += 1
            A[rows, columns] = -q[a]
            rows += 1
    if not solve_dense(A, rows, 1):
        return False
    row = 0
    for a in range(size):
        p[a] = 0.0
        if contacts.chosen[a]:
            p[a] = A[row, rows]
            row += 1
            if not abs(p[a] * D[a, a]) <= _SINGULAR * scale:
                return False
    return True


@kernel
def _complementarity(contacts, size):
    """Solves 0 <= p, q + D p >= 0, one of them 0, for the impulse p, q in contacts.load: Murty's least-index pivoting.

    False where D is no P-matrix, as where two walls close on a body.
    """
    p, q, D = contacts.impulse, contacts.load, contacts.delassus
    scale = 0.0
    for a in range(size):
        contacts.chosen[a] = 0
        p[a] = 0.0
        scale = max(scale, abs(q[a]))
    for _ in range(64 + 16 * size):
        largest, wrong = 0.0, -1
        for a in range(size):
            largest = max(largest, abs(p[a]))
        for a in range(size):
            rate = q[a]
            for b in range(size):
                rate += D[a, b] * p[b]
            if p[a] < -_EQUAL * largest if contacts.chosen[a] else rate < -_EQUAL * scale:
                wrong = a
                break
        if wrong < 0:
            return True
        contacts.chosen[wrong] = 1 - contacts.chosen[wrong]
        if not solve_chosen(contacts, size):
            return False
    return False


@kernel
def _strike(P, S, W):
    """Puts S.x where impulses struck.value leave struck.x, with the friction of S.mult; W has the surfaces there."""
    group, most = W.struck, 0.0
    for r in range(group.contacts):
        most = max(most, abs(group.value[r]))
    for i in range(P.n):
        S.x[i] = group.x[i]
    for way in range(-1, 2 if most > 0.0 else -1, 2):
        for r in range(group.contacts):
            S.mult[group.member[r]] = way * _HEAVY * (group.value[r] / most)
        call_fields(P.fields, S.t, group.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(P.n):
            S.x[i] += way * W.dx[i] * (most / (2.0 * _HEAVY))
    for r in range(group.contacts):
        S.mult[group.member[r]] = group.mult[group.member[r]]
    evaluate_surfaces(P, S, W)


@kernel
def _level(P, W, r):
    """By how much a contact of the group is faster than it shall be, or how fast friction slips."""
    k = W.struck.member[r]
    return surface_speed(P, W, k) - W.struck.aim[r] if r < W.struck.contacts else W.h[k]


@kernel
def _move(S, W, r, by):
    """Changes impulse or lambda r of the group."""
    W.struck.value[r] += by
    if r >= W.struck.contacts:
        S.mult[W.struck.member[r]] = W.struck.value[r]


@kernel
def _own_change(P, S, W, r, by):
    """By how much a change of impulse or lambda r changes its own level, which is left in struck.rest."""
    _strike(P, S, W)
    W.struck.rest[r] = _level(P, W, r)
    _move(S, W, r, by)
    _strike(P, S, W)
    _move(S, W, r, -by)
    return _level(P, W, r) - W.struck.rest[r]


@inlined_kernel
def _width(P, k):
    """How many components the disc has whose multiplier k is, 1 of others."""
    return P.dim[P.disc_of[k]] if P.disc_of[k] >= 0 else 1


@kernel
def _gather_friction(P, S, W, fastest):
    """Appends to the contacts of the group the friction that their impulses bring, with lambda 0; whether there is any.

    That is what stands in a push, against its own slip. In a run that goes back in time it drives the slip, and is
    known.
    Finds struck.unit, impulses that change speeds by about `fastest`.
    """
    group, some = W.struck, W.struck.contacts
    group.size = some
    for k in range(P.m):
        group.met[k] = 0
    for r in range(some):
        link(P, S, W, group.member[r])
        for k in range(P.m):
            if W.linear.linked[k] and (P.kind[k] == SLIDING or P.kind[k] == COMPONENT):
                group.met[k if P.disc_of[k] < 0 else P.disc_of[k]] = 1
    for k in range(P.m):
        if group.met[k if P.disc_of[k] < 0 else P.disc_of[k]] == 0 or P.kind[k] == DISC:
            continue
        if group.size == len(group.member):
            return False
        group.member[group.size], group.unit[group.size], group.value[group.size] = k, 1.0, 0.0
        group.size += 1
        S.mult[k] = 0.0
        if P.disc_of[k] >= 0:
            S.mult[P.disc_of[k]] = INSIDE
    if group.size == some:
        return False
    for r in range(some):
        group.value[r] = 0.0
    _strike(P, S, W)
    for r in range(some, group.size):
        group.kept[r] = surface_size(P, S, group.member[r], W)  # also of a slip that the impulses end
    for r in range(some):
        change = abs(_own_change(P, S, W, r, 1.0))
        group.unit[r] = fastest / change if change > 0.0 else 1.0
    for r in range(some):
        group.value[r] = group.unit[r]
    for r in range(some, group.size):
        k = group.member[r]
        _move(S, W, r, -1.0)
        group.slip[r] = -_own_change(P, S, W, r, 2.0)
        _move(S, W, r, 1.0)
        if group.slip[r] > _IDLE * (group.kept[r] + surface_size(P, S, k, W)):
            group.met[k if P.disc_of[k] < 0 else P.disc_of[k]] = 2
    last, group.size = group.size, some
    for r in range(some, last):
        k = group.member[r]
        if group.met[k if P.disc_of[k] < 0 else P.disc_of[k]] == 2:
            group.member[group.size], group.slip[group.size] = k, abs(group.slip[r])
            group.size += 1
        else:
            S.mult[k] = group.mult[k]
    for r in range(some):
        group.value[r] = 0.0
    return group.size > some


@kernel
def _sweep(P, S, W, fastest):
    """Impulses and lambda one after the other, each with what the others are: projected Gauss-Seidel steps. Takes the
    modes to which they come, what pushes and what slips, and keeps the values."""
    group, r = W.struck, 0
    while r < group.size:
        d, own, square = _width(P, group.member[r]), 0.0, 0.0
        if r < group.contacts:
            _strike(P, S, W)
            group.value[r] = max(0.0, group.value[r] - _level(P, W, r) * (group.unit[r] / fastest))
            group.mode[r] = int(group.value[r] > 0.0)
        else:
            for q in range(r, r + d):
                own -= _own_change(P, S, W, q, _STEP) / _STEP
            for q in range(r, r + d):
                _move(S, W, q, group.rest[q] / own if own > 0.0 else -group.value[q])
                square += group.value[q] ** 2
            for q in range(r, r + d):
                _move(S, W, q, group.value[q] / max(1.0, math.sqrt(square)) - group.value[q])
                side = 1 if d > 1 or group.value[q] > 0.0 else -1
                group.mode[q] = side if square > 1.0 - _IDLE else 0
        for q in range(r, r + d):
            group.kept[q] = group.value[q]
        r += d


@kernel
def _take_residuals(P, S, W, rest):
    """Overwrites `rest` by what impulses and lambda leave of the equations of the group with its modes."""
    group = W.struck
    _strike(P, S, W)
    for r in range(group.size):
        k, mode = group.member[r], group.mode[r]
        if (mode != 0) == (r < group.contacts):
            rest[r] = _level(P, W, r)
        elif P.disc_of[k] < 0:
            rest[r] = group.value[r] - mode
        else:
            rest[r] = math.sqrt(W.h[P.disc_of[k]]) * S.mult[k] - W.h[k]


@kernel
def _solve_modes(P, S, W, rounding):
    """Newton's method for the impulses and lambda of the group with its modes, by least changes; whether it ends, its
    steps being less than `rounding` or not falling any more."""
    group, A, size, previous = W.struck, W.struck.matrix, W.struck.size, math.inf
    for _ in range(_NEWTON):
        _take_residuals(P, S, W, group.rest)
        for c in range(size):
            _move(S, W, c, _STEP * group.unit[c])
            _take_residuals(P, S, W, group.ahead)
            _move(S, W, c, -_STEP * group.unit[c])
            for r in range(size):
                A[r, c] = (group.ahead[r] - group.rest[r]) / _STEP
        for r in range(size):
            square = 0.0
            for c in range(size):
                square += A[r, c] ** 2
            idle = not abs(A[r, r]) > _IDLE * math.sqrt(square)  # its contact does not push: lambda stays
            scale = 1.0 if idle else 1.0 / math.sqrt(square)
            for c in range(size):
                A[r, c] = (1.0 if r == c else 0.0) if idle else A[r, c] * scale
            A[r, 2 * size] = 0.0 if idle else -group.rest[r] * scale
        for r in range(size):
            for q in range(size):
                A[r, size + q] = _OPEN if r == q else 0.0
                for c in range(size):
                    A[r, size + q] += A[r, c] * A[q, c]
        if not solve_dense(A[:, size:], size, 1):
            return False
        change = 0.0
        for c in range(size):
            step = 0.0
            for r in range(size):
                step += A[r, c] * A[r, 2 * size]
            _move(S, W, c, step * group.unit[c])
            change = max(change, abs(step) / (1.0 + abs(group.value[c]) / group.unit[c]))
        if change <= 1e-15 or (change < max(1e-11, rounding) and change >= 0.25 * previous):
            return True
        previous = change
    return False


@kernel
def _fits(P, S, W, fastest, rounding):
    """Whether no contact pulls or still approaches, by more than `rounding` of `fastest`, and no friction is more than
    it can be or drives its slip on.

    Leaves S.x as the state after, and the lambda of switches that slip exactly at their bounds.
    """
    group, most = W.struck, 1.0
    for r in range(group.contacts):
        most = max(most, abs(group.value[r] / group.unit[r]))
    _strike(P, S, W)
    for r in range(group.size):
        k, level, square, along = group.member[r], _level(P, W, r), 0.0, 0.0
        if r < group.contacts:
            if min(level / fastest, group.value[r] / group.unit[r]) < -_EQUAL * most - rounding:
                return False
            continue
        for q in range(group.contacts, group.size):
            if q == r or (P.disc_of[k] >= 0 and P.disc_of[group.member[q]] == P.disc_of[k]):
                square += group.value[q] ** 2
                along += group.value[q] * W.h[group.member[q]]
        least = _EQUAL * (surface_size(P, S, k, W) + group.slip[r])
        if square > 1.0 + 2.0 * _EQUAL or (group.mode[r] != 0 and (along < -least or square < 1.0 - _IDLE)):
            return False
        if P.disc_of[k] < 0 and group.mode[r] != 0:
            S.mult[k] = float(group.mode[r])
    return True


@kernel
def _find_friction(P, S, W, fastest):
    """Impacts of the contacts of the group, whose speeds after are to be struck.aim, if there is friction in their
    pushes: a code. Then S.x is the state after and S.mult has the lambda; struck.x and struck.mult what was before."""
    group, found, sweeps = W.struck, UNCHANGED, 2
    if len(group.member) == 0:
        return UNCHANGED
    for i in range(P.n):
        group.x[i] = S.x[i]
    for k in range(P.m):
        group.mult[k] = S.mult[k]
    rounding, some = W.instant.rest_speed / fastest, _gather_friction(P, S, W, fastest)
    while some and found != CHANGED and sweeps < _MOST_SWEEPS:
        for _ in range(sweeps):
            _sweep(P, S, W, fastest)
        solved = _solve_modes(P, S, W, rounding) and _fits(P, S, W, fastest, rounding)
        found = CHANGED if solved else INCONSISTENT
        for r in range(group.size if found != CHANGED else 0):
            _move(S, W, r, group.kept[r] - group.value[r])
        sweeps *= 2
    if found != CHANGED:
        _restore(P, S, W)
        for i in range(P.n):
            S.x[i] = group.x[i]
    return found


@kernel
def _restore(P, S, W):
    """Takes back the lambda of an impact."""
    for k in range(P.m):
        S.mult[k] = W.struck.mult[k]


@kernel
def _stop_what_sticks(P, S, W):
    """Puts S.x exactly where what an impact has stopped stands still, and takes its lambda back."""
    group = W.struck
    evaluate_surfaces(P, S, W)
    for r in range(group.contacts, group.size):
        k = group.member[r]
        size = surface_size(P, S, k, W) + group.slip[r]
        group.met[k] = int(abs(W.h[k]) <= (_IDLE if group.mode[r] == 0 else _EQUAL) * size)
    for r in range(group.contacts, group.size):
        k = group.member[r]
        if group.met[k] and P.disc_of[k] < 0:
            keep_on_surface(P, S, k, W)
        elif group.met[k] and k == P.disc_of[k] + 1:
            put_in_slip(P, S, P.disc_of[k], 0.0, S.mult, W)
    _restore(P, S, W)


@kernel
def _slips_on(P, S, W):
    """Whether all friction of an impact is that of before, and goes with it: of a disc in the same direction."""
    group = W.struck
    evaluate_surfaces(P, S, W)
    for r in range(group.contacts, group.size):
        k = group.member[r]
        disc = P.disc_of[k]
        size = math.sqrt(W.h[disc]) if disc >= 0 else 1.0
        turned = abs(S.mult[k] * size - W.h[k]) > _EQUAL * size if disc >= 0 else S.mult[k] != group.mult[k]
        if group.mode[r] == 0 or turned:
            return False
    return True


@kernel
def rebound(P, S, R, W, j, taped):
    """Lets contact j rebound alone: a code."""
    group, code = W.struck, UNCHANGED
    if len(group.member) > 0:
        before = approach_speed(P, S, j, W)
        group.contacts, group.member[0], group.aim[0] = 1, j, _rebound(P, S, W, j)
        code = _find_friction(P, S, W, abs(before))
        if code < UNCHANGED:
            return code
        for i in range(P.n):
            S.x[i] = group.x[i]
    same = code == UNCHANGED or _slips_on(P, S, W)
    if same and code == CHANGED:
        _restore(P, S, W)
    W.contacts.rebound = _rebound(P, S, W, j)
    if taped and R.tape.shape[0] > 0:
        if not same:
            put_on_tape(P, S, R, TAPE_MEET, TAPE_OTHER, j, 0, 0.0)
        put_on_tape(P, S, R, TAPE_ACT, 0, P.ne + j, 0, 0.0)
        put_on_tape(P, S, R, TAPE_ROUND, 0, 0, 0, 0.0)
    for i in range(P.n):
        S.x[i] = W.contacts.after[i]
    if code == CHANGED:
        _stop_what_sticks(P, S, W)
    return code


@kernel
def _apart_from_single_impacts(P, S, R, W, size):
    """Largest difference between the speeds contacts.together and those after rebounds one by one, from either end.

    Relative to the largest speed of approach. One that rests and is hit through another has its own restitution then.
    """
    contacts = W.contacts
    scale, apart = 0.0, 0.0
    for a in range(size):
        scale = max(scale, abs(contacts.speed[a]))
    for i in range(P.n):
        contacts.first[i] = S.x[i]
    for turn in range(2):
        for _ in range(200 * size):
            found = -1
            for k in range(size):
                a = k if turn == 0 else size - 1 - k
                if found < 0 and approach_speed(P, S, contacts.touching[a], W) < -_EQUAL * scale:
                    found = a
            if found < 0:
                break
            rebound(P, S, R, W, contacts.touching[found], False)
        for a in range(size):
            apart = max(apart, abs(contacts.together[a] - approach_speed(P, S, contacts.touching[a], W)))
        for i in range(P.n):
            S.x[i] = contacts.first[i]
    return apart / scale


@kernel
def _rebound_together(P, S, R, W, size):
    """Impulses of the touching contacts that act on each other: a code. Where their order matters that is recorded."""
    contacts, group, first, fastest = W.contacts, W.struck, -1, 0.0
    group.contacts = 0
    for a in range(size):
        fastest = max(fastest, abs(contacts.speed[a]))
        if not _coupled(P, W, a, size):
            continue
        if first < 0 and contacts.speed[a] < -contacts.at_rest[a]:
            first = a
        if len(group.member) > 0:
            r = group.contacts
            group.member[r], group.aim[r] = contacts.touching[a], contacts.speed[a] - contacts.load[a]
            group.contacts += 1
    if first < 0:
        return UNCHANGED
    code = _find_friction(P, S, W, fastest)
    if code < UNCHANGED:
        return code
    if code == CHANGED:
        _note_friction(W)
        _stop_what_sticks(P, S, W)
        for a in range(size):
            contacts.together[a] = approach_speed(P, S, contacts.touching[a], W)
        for i in range(P.n):
            contacts.solved[i], S.x[i] = S.x[i], group.x[i]
    else:
        for a in range(size):
            if contacts.speed[a] < -contacts.at_rest[a] and contacts.delassus[a, a] < 0.0:
                return INCONSISTENT
        if not _complementarity(W.contacts, size):
            return UNSOLVABLE
        for a in range(size):
            contacts.together[a] = contacts.speed[a]
            for b in range(size):
                contacts.together[a] += contacts.delassus[a, b] * contacts.impulse[b]
    if _apart_from_single_impacts(P, S, R, W, size) > 1e-9:
        record_ambiguity(S, R, contacts.touching[first], AMB_IMPACTS, 0)
    for i in range(P.n if code == CHANGED else 0):
        S.x[i] = contacts.solved[i]
    return CHANGED if code == CHANGED else _PUSHED


@kernel
def collide(P, S, R, W, size):
    """Impacts of the touching contacts, those that act on each other together; whether they have a solution: a code."""
    contacts = W.contacts
    approaching, together = False, UNCHANGED
    for a in range(size):
        approaching = approaching or contacts.speed[a] < -contacts.at_rest[a]
    if not approaching:
        return UNCHANGED
    first = S.events
    begin_impulses(P, S, W)
    find_couplings(P, S, W, size)
    for a in range(size if size > 1 else 0):
        contacts.load[a] = contacts.speed[a]
        if contacts.speed[a] < -contacts.at_rest[a]:
            contacts.load[a] -= _rebound(P, S, W, contacts.touching[a])
    if size > 1:
        together = _rebound_together(P, S, R, W, size)
        if together < UNCHANGED:
            return together
    for a in range(size):
        j, meets = contacts.touching[a], contacts.speed[a] < -contacts.at_rest[a]
        if together != UNCHANGED and _coupled(P, W, a, size):
            if R.tape.shape[0] > 0:
                put_on_tape(P, S, R, TAPE_MEET, TAPE_OTHER, j, 0, 0.0)
            if together == _PUSHED and contacts.impulse[a] > 0.0:
                kick(P, S, W, j, contacts.impulse[a])
                contacts.push[j] = contacts.impulse[a]
        elif meets:
            code = rebound(P, S, R, W, j, True)
            if code < UNCHANGED or (code == UNCHANGED and contacts.delassus[a, a] < 0.0):
                return (
                    INCONSISTENT  # an impulse along the friction of the slip drives the bodies into each other
                )
            note_rebound(W, j, code, contacts.speed[a], contacts.delassus[a, a])
        if meets:
            keep_on_surface(P, S, j, W)
            S.deflate[j] = 1
            W.instant.hit[j] = True
            note_arc(S, j, contacts.speed[a])
            record_event(S, R, j, EV_IMPACT, 1, 1)
    record_impulses(S, R, W, first)
    W.instant.jumped = 1
    return CHANGED
