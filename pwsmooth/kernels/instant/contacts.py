"""Contacts at one instant: the impacts of all that touch, then which of them stay closed.

Velocities first (impacts.py). Then, among those that neither approach nor part, forces,

    0 <= R  complementary to  d2h/dt2 >= 0

over all that touch. Friction stands in D = dg/dR of the residuals g = d2h/dt2, so that a = D_jj may be negative, of a
slipping contact alone d2h/dt2 = a R + b (Painleve 1895): with b < 0 no R >= 0 keeps the bodies apart (inconsistent),
with b > 0 both R = 0 and R = -b/a do (indeterminate), and where a comes to 0 from above R grows without bound (jam).
Genot & Brogliato, Eur. J. Mech. A 18, 1999.
Chain: instants.py, starting.py -> **this file** -> impacts.py, sparse.py, sliding.py.
"""

import math

from ..intervals import forget_intervals, time_size
from ..machine.compiling import kernel
from ..machine.pointers import call_fields, call_linear, call_newton
from ..outcome import Outcome
from ..state import (
    AMB_INDETERMINATE,
    COMPONENT,
    DISC,
    EV_ACCUMULATION,
    EV_CLOSED,
    EV_CROSSING,
    EV_IMPACT,
    EV_OPENING,
    SLIDING,
    SOLVED,
)
from ..step.recording import record_ambiguity, record_event
from ..surface.sliding import (
    common_gradient,
    go_down_gradient,
    keep_on_surface,
    mask_solved,
    surface_rounding,
    surface_size,
    surface_tolerance,
)
from ..surface.sparse import entry, solve_dense, solve_masked
from .impacts import (
    CHANGED,
    INCONSISTENT,
    UNCHANGED,
    UNSOLVABLE,
    begin_impulses,
    collide,
    find_couplings,
    kick,
    note_rebound,
    rebound,
    record_impulses,
    solve_chosen,
)
from .surface_rates import approach_speed, evaluate_surfaces

PRESSING = -1  # known zeros of the gap of a contact that rests and is pressed from now on
UNTOLD = 1e-14  # of the time: instants that close are not told apart
_MOST_IMPACTS, _MOST_OF_COLLAPSE, _SMALLEST_GAP = 20_000, 2_000, 1e-100
_COLLAPSED = 1e-3  # of the time over which impacts have come ever sooner: so late their gaps are roundings
_TURNS = 3  # of a projection: the gaps of bodies that turn are not linear
_EQUAL = 1e-12  # of the largest speed or force: what is smaller is rounding
_JAM = 1e-6  # of what friction does to a gap, beside which the rest of its reaction is small
_GAP_ROUNDING, _GAP_TOLERANCES = (
    1e-9,
    1e3,
)  # of a gap's size, and of what `atol` leaves of it: how well it is known
_SINGULAR = 1e10  # a force so many times the others comes of a singular matrix


@kernel
def _open(S, R, W, j, order):
    """Opens contact j, whose gap has `order` known zeros: h, then dh/dt, then d2h/dt2."""
    S.status[j] = 1
    S.mult[j] = 0.0
    S.deflate[j] = order
    if W.instant.jumped == 0:
        forget_intervals(S.last[j], S.t)  # impacts that ended in its closing come to no other limit
    record_event(S, R, j, EV_OPENING, 0, 1)


@kernel
def _find_touching(P, S, R, W):
    """Overwrites `touching`, the contacts whose gap is 0, their `speed` and `at_rest`; returns how many, -1 for more
    than there is room for.

    W.firing.switch_level holds the gaps before the updates of this instant.
    """
    contacts = W.contacts
    size = 0
    evaluate_surfaces(P, S, W)
    for c in range(len(P.contact)):
        j = P.contact[c]
        rounding = surface_rounding(P, S, j, W)
        moved = P.nested[j] != 0 or (W.instant.jumped and W.h[j] != W.firing.switch_level[j])
        if S.status[j] == SOLVED and W.h[j] > rounding and moved:
            _open(S, R, W, j, 0)  # an update has lifted the body off, or a jump of the gap
        elif S.status[j] == SOLVED or W.instant.hit[j] or W.h[j] <= rounding:
            if size == len(contacts.touching):
                return -1
            contacts.touching[size] = j
            size += 1
    for a in range(size):
        contacts.speed[a] = approach_speed(P, S, contacts.touching[a], W)
        contacts.at_rest[a] = W.instant.rest_speed
    return size


@kernel
def is_behind(P, C, S, W, moved):
    """Whether a gap is negative by more than states are known to, and has not come there by the motion: at a start or
    after an update, which have `moved` the state, or where a switch in it has jumped."""
    evaluate_surfaces(P, S, W)
    for c in range(len(P.contact)):
        j = P.contact[c]
        if W.instant.hit[j] or not (moved or P.nested[j] != 0):
            continue
        if W.h[j] < -_GAP_ROUNDING * surface_size(P, S, j, W) - _GAP_TOLERANCES * surface_tolerance(P, C, W, j):
            return True
    return False


@kernel
def friction_on(P, W, j):
    """The most that switches that can stick change the acceleration of gap j, or of multiplier j's surface."""
    total = 0.0
    for k in range(P.m):
        if P.kind[k] == SLIDING:
            total += abs(entry(P.g_row, P.g_col, W.G, j, k))
    return total


@kernel
def part_or_press(P, S, W, j):
    """Of contacts that rested because switch j stuck, and that have felt nothing: on which side it leaves them.

    It slips now with an acceleration that begins at 0, and so does the gap.
    """
    evaluate_surfaces(P, S, W)
    for c in range(len(P.contact)):
        k = P.contact[c]
        held = entry(P.g_row, P.g_col, W.G, k, j)
        if S.status[k] != SOLVED and S.deflate[k] == 2 and abs(W.g[k]) < 1e-9 * abs(held):
            parts = S.status[j] * held * W.G[P.g_diagonal[j]] > 0.0
            S.deflate[k] = 3 if parts else PRESSING
            W.instant.look_again = 1


@kernel
def acts(P, W, k):
    """Whether lambda_k acts on what is solved for, by the slopes in W.G: friction does not if its contact is open."""
    if W.G[P.g_diagonal[k]] != 0.0:
        return True
    for i in range(P.m):
        if P.kind[i] != DISC and entry(P.g_row, P.g_col, W.G, i, k) != 0.0:
            return True
    return False


@kernel
def _mask_acting(P, S, W):
    """Overwrites W.mask: what is solved now, without friction that acts on nothing."""
    mask_solved(P, S, W)
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for k in range(P.m):
        if W.mask[k] and (P.kind[k] == SLIDING or P.kind[k] == COMPONENT) and not acts(P, W, k):
            W.mask[k] = 0


@kernel
def cross_without_load(P, S, R, W, size):
    """Lets those of W.instant.active[:size] cross that act on nothing; returns the size without them."""
    rest = 0
    evaluate_surfaces(P, S, W)
    for a in range(size):
        j = W.instant.active[a]
        if acts(P, W, j):
            W.instant.active[rest] = j
            rest += 1
            continue
        record_event(S, R, j, EV_CROSSING, S.status[j], -S.status[j])
        S.status[j] = -S.status[j]
        S.mult[j], S.deflate[j] = float(S.status[j]), 1
    return rest


@kernel
def _pulls(P, S, W, k):
    """Whether contact k, which is closed, would take a pull, by what has just been solved for."""
    own = abs(entry(P.g_row, P.g_col, W.G, k, k))
    return (
        S.status[k] == SOLVED
        and S.mult[k] < 0.0
        and abs(S.mult[k]) * own >= _EQUAL * (own + friction_on(P, W, k))
    )


@kernel
def crosses_as_contacts_open(P, S, W, j):
    """Whether switch j, which has been made to stick, crosses: its stick takes pulls of contacts, and beyond its
    surface these open and the motion goes on. Then it is on that side."""
    came, mult, contacts = W.instant.came[j], S.mult[j], W.contacts
    mask_solved(P, S, W)
    if call_newton(P.newton_unit, P, S, W) == 0:
        return False
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    opened = 0
    for c in range(len(P.contact)):
        if opened < len(contacts.touching) and _pulls(P, S, W, P.contact[c]):
            contacts.touching[opened] = P.contact[c]
            opened += 1
    if opened == 0:
        return False
    for a in range(opened):
        k = contacts.touching[a]
        S.status[k], S.mult[k] = 1, 0.0
    S.status[j], S.mult[j] = -came, -float(came)
    mask_solved(P, S, W)
    crosses = (
        call_newton(P.newton_unit, P, S, W) != 0 and came * approach_speed(P, S, j, W) < -W.instant.rest_speed
    )
    for a in range(opened):
        crosses = crosses and W.g[contacts.touching[a]] > 0.0
        S.status[contacts.touching[a]] = SOLVED  # it opens when contacts are looked at again
    if not crosses:
        S.status[j], S.mult[j] = SOLVED, mult
    return crosses


@kernel
def _is_pushed(P, S, W, j):
    """Whether the updates of this instant have changed the acceleration of gap j."""
    if P.ne == 0 or W.instant.jumped == 0:
        return False
    evaluate_surfaces(P, S, W)
    after = W.g[j]
    for k in range(P.n):
        W.instant.x[k], S.x[k] = S.x[k], W.firing.arrived[k]
    evaluate_surfaces(P, S, W)
    before = W.g[j]
    for k in range(P.n):
        S.x[k] = W.instant.x[k]
    return after != before


@kernel
def _settle_forces(P, S, R, W, size):
    """Closes and opens the touching contacts that neither approach nor part; whether some forces do that: a code."""
    contacts = W.contacts
    largest, resting, was_closed = 0.0, contacts.chosen, contacts.load
    some = False
    W.instant.look_again = int(size > 1)
    for a in range(size):
        j = contacts.touching[a]
        was_closed[a] = 1.0 if S.status[j] == SOLVED else 0.0
        # Of one that has just been left smoothly the acceleration is 0, and rounding says nothing of its sign.
        smooth = S.status[j] != SOLVED and S.deflate[j] == 3 and not _is_pushed(P, S, W, j)
        resting[a] = 1 if abs(contacts.speed[a]) <= contacts.at_rest[a] and not smooth else 0
        if resting[a] and S.deflate[j] == PRESSING:
            S.status[j] = SOLVED
        if resting[a]:
            some = True
            W.instant.look_again = 1
        largest = max(largest, S.mult[j])
    added, settled = -1, not some
    for _ in range(64 + 16 * size if some else 0):
        _mask_acting(P, S, W)
        solved = call_newton(P.newton_unit, P, S, W) != 0
        now = 0.0
        for a in range(size):
            now = max(now, abs(S.mult[contacts.touching[a]]))
        if added >= 0 and (not solved or (largest > 0.0 and now > _SINGULAR * largest)):
            S.status[contacts.touching[added]] = 1
            S.mult[contacts.touching[added]] = 0.0
            resting[added] = 0
            added = -1
            continue
        if not solved:
            return UNSOLVABLE
        largest = max(largest, now)
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        wrong = -1
        for a in range(size):
            j = contacts.touching[a]
            if wrong < 0 and resting[a]:
                own = abs(entry(P.g_row, P.g_col, W.G, j, j))
                rounding = _EQUAL * (own * largest + friction_on(P, W, j))
                if S.status[j] == SOLVED:
                    fails = S.mult[j] < 0.0 and not abs(S.mult[j]) * own < rounding
                else:
                    # What is held already stays open: by another contact, as a second wall at the same place, or by
                    # friction.
                    fails = W.g[j] <= 0.0 and not abs(W.g[j]) < rounding
                if fails:
                    wrong = a
        if wrong < 0:
            settled = True
            break
        j = contacts.touching[wrong]
        added = wrong if S.status[j] != SOLVED else -1
        S.status[j] = SOLVED if added >= 0 else 1
        S.mult[j] = 0.0
    if not settled:
        return INCONSISTENT
    for a in range(size):
        if resting[a]:
            _note_if_indeterminate(P, S, R, W, contacts.touching[a])
    for a in range(size):
        j = contacts.touching[a]
        if S.status[j] == SOLVED and was_closed[a] == 0.0:
            record_event(S, R, j, EV_CLOSED, 1, 0)
        elif S.status[j] != SOLVED and was_closed[a] != 0.0:
            _open(S, R, W, j, 2)
        elif S.status[j] != SOLVED and resting[a]:
            S.deflate[j] = 2
    return UNCHANGED


@kernel
def _push(P, S, W, j):
    """d(d2h_j/dt2)/dR_j, whatever else is solved for following: a of the equation above; nan where that is singular."""
    mask_solved(P, S, W)
    W.mask[j] = 1
    for i in range(P.m):
        W.linear.rhs[i] = 0.0
    W.linear.rhs[j] = 1.0
    return 1.0 / W.linear.rhs[j] if solve_masked(P, W) and W.linear.rhs[j] != 0.0 else math.nan


@kernel
def _note_if_indeterminate(P, S, R, W, j):
    """Records that contact j, at rest along its normal, might as well be open if it is closed, or closed if open."""
    known = S.ambiguities > 0 and R.ambiguity_t[S.ambiguities - 1] == S.t
    if (
        known
        and R.ambiguity[S.ambiguities - 1, 0] == j
        and R.ambiguity[S.ambiguities - 1, 1] == AMB_INDETERMINATE
    ):
        return
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    closed = S.status[j] == SOLVED
    if (S.mult[j] > 0.0 if closed else W.g[j] > 0.0) and _push(P, S, W, j) < 0.0:
        record_ambiguity(S, R, j, AMB_INDETERMINATE, int(closed))


@kernel
def jams(P, S, W):
    """Whether the reaction of a closed contact has all but lost its hold: where a = 0 it would be infinite."""
    call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
    for c in range(len(P.contact)):
        j = P.contact[c]
        if S.status[j] == SOLVED:
            friction = friction_on(P, W, j)
            if abs(entry(P.g_row, P.g_col, W.G, j, j) * S.mult[j]) < _JAM * friction:
                return True
    return False


@kernel
def settle_contacts(P, S, R, W):
    """Looks at all contacts together; how that ends, with `jumped` set where velocities jump."""
    contacts = W.contacts
    before = S.events
    for c in range(len(P.contact)):
        j = P.contact[c]
        if W.instant.hit[j] and S.status[j] == SOLVED and W.instant.jumped == 0:
            _open(S, R, W, j, 3)  # R has come to 0, and d2h/dt2 with it
            W.instant.hit[j] = False
    size = _find_touching(P, S, R, W)
    if size < 0:
        return UNSOLVABLE
    code = collide(P, S, R, W, size)
    if code < UNCHANGED:
        return code
    for a in range(size):
        j = contacts.touching[a]
        contacts.speed[a] = approach_speed(P, S, j, W)
        if contacts.speed[a] > contacts.at_rest[a]:
            if S.status[j] == SOLVED:
                _open(S, R, W, j, 1)
            S.deflate[j] = 1
    code = _settle_forces(P, S, R, W, size)
    if code < UNCHANGED:
        return code
    return CHANGED if S.events > before else UNCHANGED


@kernel
def collapses(P, S, W):
    """Whether contacts meet that have met just before, ever sooner one after the other, so that their gaps are told
    from 0 no more: what falls on each other has all but come to rest so."""
    touching, again = 0, False
    evaluate_surfaces(P, S, W)
    for c in range(len(P.contact)):
        j = P.contact[c]
        if S.status[j] == SOLVED or not (W.instant.hit[j] or W.h[j] <= surface_rounding(P, S, j, W)):
            continue
        touching += 1
        again = again or S.t - S.last[j, 0] <= _COLLAPSED * (S.last[j, 0] - S.last[j, 6])
    return touching > 1 and again


@kernel
def impact_to_the_end(P, S, R, W, endless):
    """Impacts that follow each other faster than the clock tells, as among bodies that fall on each other, until none
    is left, or they come to rest (inelastic collapse). False if these, or those that touch, are too many; then S is as
    before, and they go on in time unless they are `endless` there.

    Forces do nothing meanwhile, so gaps count by their ratios: smaller and smaller ones stand for those of the motion.
    """
    contacts, size, fastest = W.contacts, 0, 0.0
    gap, impacts, unsure, told = contacts.load, contacts.chosen, S.ambiguities, S.events
    for i in range(P.n):
        W.instant.x[i] = S.x[i]
    for c in range(len(P.contact)):
        fastest = max(fastest, abs(approach_speed(P, S, P.contact[c], W)))
    for c in range(len(P.contact)):
        j = P.contact[c]
        met = S.status[j] == SOLVED or W.instant.hit[j]
        if met or W.h[j] <= max(UNTOLD * time_size(S) * fastest, surface_rounding(P, S, j, W)):
            if size == len(contacts.touching):
                return False
            contacts.touching[size], impacts[size] = j, 0
            gap[size] = 0.0 if met else max(W.h[j], 0.0)
            size += 1
    solved = True
    begin_impulses(P, S, W)
    for _ in range(_MOST_IMPACTS if endless else _MOST_OF_COLLAPSE):
        found, first, moves = -1, math.inf, False
        for a in range(size):
            contacts.speed[a] = approach_speed(P, S, contacts.touching[a], W)
            moves = moves or abs(contacts.speed[a]) > W.instant.rest_speed
            if contacts.speed[a] < -W.instant.rest_speed and gap[a] < first * -contacts.speed[a]:
                found, first = a, gap[a] / -contacts.speed[a]
        if found < 0:
            break
        largest = 0.0
        for a in range(size):
            gap[a] = max(0.0, gap[a] + first * contacts.speed[a]) if a != found else 0.0
            largest = max(largest, gap[a])
        for a in range(size if 0.0 < largest < _SMALLEST_GAP else 0):
            gap[a] /= largest
        j = contacts.touching[found]
        evaluate_surfaces(P, S, W)
        mobility = entry(P.g_row, P.g_col, W.G, j, j)
        code = rebound(P, S, R, W, j, False)
        solved = code >= UNCHANGED
        if not solved:
            break
        note_rebound(W, j, code, contacts.speed[found], mobility)
        impacts[found] = 1
    if not solved or found >= 0:
        for i in range(P.n):
            S.x[i] = W.instant.x[i]
        S.ambiguities, S.events = unsure, told
        return False
    for a in range(size):
        j = contacts.touching[a]
        if impacts[a]:
            record_event(S, R, j, EV_IMPACT if moves else EV_ACCUMULATION, 1, 1)
            forget_intervals(S.last[j], S.t)
            W.instant.hit[j] = True
            S.deflate[j] = 1
    record_impulses(S, R, W, told)
    W.instant.jumped = 1
    return True


@kernel
def close_at_start(P, S, R, W):
    """Closes the contacts that touch at rest at the start of a run; whether forces do that: a code."""
    before = S.events
    size = _find_touching(P, S, R, W)
    code = _settle_forces(P, S, R, W, size) if size >= 0 else UNSOLVABLE
    S.events = before  # what holds from the start is no event
    return code


@kernel
def outcome_of(code):
    """How a run ends where contacts are not settled."""
    return Outcome.INCONSISTENT_CONTACT if code == INCONSISTENT else Outcome.SINGULAR


@kernel
def _close_gaps(P, S, W, size):
    """Puts S.x where the gaps of the touching contacts are 0, by the least change of what none of them is by itself.

    All at once: one after the other each would open its neighbours, by what the forces of a pile have been off in all
    the time that it rests. So it is where they depend on each other, as the legs of a table.
    """
    A, touching = W.contacts.pivots, W.contacts.touching
    for a in range(size):
        if P.surface_state[touching[a]] >= 0:
            S.x[P.surface_state[touching[a]]] = 0.0
    for _ in range(_TURNS):
        evaluate_surfaces(P, S, W)
        count, apart = 0, False
        for a in range(size):
            j = touching[a]
            if P.surface_state[j] >= 0:
                continue
            columns = 0
            for b in range(size):
                if P.surface_state[touching[b]] < 0:
                    A[count, columns] = common_gradient(P, S, W, j, touching[b])
                    columns += 1
            A[count, columns] = W.h[j]
            apart = apart or W.h[j] != 0.0
            count += 1
        if not apart:
            return
        if not solve_dense(A, count, 1):
            break
        row = 0
        for a in range(size):
            if P.surface_state[touching[a]] < 0:
                go_down_gradient(P, S, W, touching[a], A[row, count], 1.0)
                row += 1
    else:
        return
    for a in range(size):
        keep_on_surface(P, S, touching[a], W)


@kernel
def closed_move(P, S, W):
    """Whether the gap of a closed contact has a rate beyond rounding."""
    for c in range(len(P.contact)):
        j = P.contact[c]
        if S.status[j] == SOLVED and abs(approach_speed(P, S, j, W)) > W.instant.rest_speed:
            return True
    return False


@kernel
def stop_closed(P, S, W):
    """Puts every closed contact exactly on its gap's zero, and takes from the state what is left of the gaps' rates.

    That acts with its friction: states that something keeps at 0 are put there again.
    """
    contacts = W.contacts
    size = 0
    for c in range(len(P.contact)):
        if S.status[P.contact[c]] == SOLVED:
            contacts.touching[size] = P.contact[c]
            size += 1
    if size == 0:
        return
    if size == 1:
        keep_on_surface(P, S, contacts.touching[0], W)
    else:
        _close_gaps(P, S, W, size)
    for a in range(size):
        contacts.chosen[a] = 1
        contacts.load[a] = approach_speed(P, S, contacts.touching[a], W)
    find_couplings(P, S, W, size)
    if solve_chosen(W.contacts, size):
        for a in range(size):
            if contacts.impulse[a] != 0.0:
                kick(P, S, W, contacts.touching[a], contacts.impulse[a])
        for i in range(P.n):
            if P.holder[i] >= 0 and S.status[P.holder[i]] == SOLVED:
                S.x[i] = 0.0
