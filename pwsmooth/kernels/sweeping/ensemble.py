"""Many orbits in one call, measured while they run.

    for every orbit:  reset -> run (trajectory.py) -> measure what the buffers hold -> empty them -> ...

The loop is the one of solve(), with the same tolerances and steps: a sweep gives the bits of a solve. Memory is that
of the measures, as the record buffers are used again and again.

An orbit is strobed once a period, at wanted times, or where it meets a section: a terminal event, at which the run
comes back and goes on. So nothing of the window is known before it begins, and nothing is computed beyond its end.
"""

import math

from numba import types

from ..fresh import restart_counts, restart_flags
from ..intervals import forget_intervals
from ..machine.compiling import inlined_kernel, kernel, unit
from ..machine.pointers import call_outputs, call_unit
from ..outcome import Outcome
from ..state import EV_EVENT, SOLVED, Control, Problem, Record, State
from ..step.roots import low_bounds
from ..work import Work
from .state import EXTREMES, INTEGRALS, NO_RETURN, Ensemble

_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@kernel
def _reset(P, C, S, W, E, i):
    """Puts orbit i at its start: everything that a run carries from call to call."""
    for k in range(len(P.p)):
        P.p[k] = E.p[i, k]
    for k in range(P.nz):
        P.ratio[k] = E.ratio[i, k]
    for k in range(P.n):
        S.x[k] = E.x0[i, k]
    S.t = E.t0[i]
    S.step = min(1e-3, C.max_step)
    S.mult[:] = 0.0
    S.status[:] = 0
    S.deflate[:] = 0
    S.side[:] = 1
    restart_counts(S)
    for j in range(P.m):
        forget_intervals(S.last[j], E.t0[i])
    C.t_end = E.window[i, 1]
    E.returns = 0
    if E.section >= 0:
        E.window[i, 0] = E.window[i, 1] = math.inf
        C.t_end = E.t0[i] + E.longest_return
    S.unit = min(1.0, C.t_end - S.t)
    restart_flags(W)  # of a run that stopped half-way
    E.has_point = E.has_piece = E.segments = 0
    for j in range(P.m):
        E.stick_time[i, j] = 0.0
        E.sticks[i, j] = 0
    for q in range(len(E.quantity)):
        E.low[i, q], E.high[i, q] = math.inf, -math.inf
        E.first[i, q], E.second[i, q] = 0.0, 0.0
    E.events[i] = E.ambiguities[i] = E.events_inside[i] = 0


@kernel
def _piece(P, E, i, t_from, t_to):
    """Takes note of the status E.was on an interval of time of positive length."""
    begin, end = E.window[i, 0], E.window[i, 1]
    inside = min(t_to, end) - max(t_from, begin)
    changed = E.has_piece == 0
    for j in range(P.m):
        if E.was[j] == SOLVED and inside > 0.0:
            E.stick_time[i, j] += inside
        if E.has_piece == 0 or E.was[j] != E.before[j]:
            changed = True
            if E.was[j] == SOLVED and begin <= t_from < end:
                E.sticks[i, j] += 1
    if changed:
        code = 0
        for j in range(P.m):
            code += (E.was[j] + 1) * E.word_digits[j]
            E.before[j] = E.was[j]
        # Multipliers outside the itinerary start no new segment.
        count, ring = E.segments, len(E.segment)
        if count == 0 or E.segment[(count - 1) % ring] != code:
            E.segment[count % ring] = code
            E.segment_t[count % ring] = t_from
            E.segments += 1
        E.has_piece = 1


@inlined_kernel
def _is_return(P, R, E, a):
    """Whether event a in the buffers is the section's."""
    return E.section >= 0 and R.event[a, 0] == P.m + E.section


@kernel
def _stops(P, S, R, E):
    """Whether a run that an event has ended ends there: whether another one than the section's ended it."""
    if E.section < 0:
        return True
    for a in range(S.events):
        if R.event[a, 1] == EV_EVENT and P.terminal[R.event[a, 0] - P.m] != 0 and not _is_return(P, R, E, a):
            return True
    return False


@kernel
def _meet_section(P, C, S, E, i):
    """Takes note of a return of orbit i, at S; whether it was the last one."""
    k, strobes = E.returns - E.transient, E.strobe.shape[1]
    E.returns += 1
    C.t_end = S.t + E.longest_return
    if k < 0:
        return False
    if k == 0:
        E.window[i, 0] = S.t
    E.strobe_t[i, k] = S.t
    for r in range(P.n):
        E.strobe[i, k, r] = S.x[r]
    if k < strobes - 1:
        return False
    E.window[i, 1] = S.t
    return True


@kernel
def _follow_points(P, S, R, E, i):
    """Takes note of the points in the buffers: sticks and segments."""
    for a in range(S.points):
        t = R.t[a]
        if E.has_point == 1 and t > E.last:
            _piece(P, E, i, E.last, t)
        E.last = t
        E.has_point = 1
        for j in range(P.m):
            E.was[j] = R.status[a, j]
    for a in range(S.events):
        if R.event_t[a] > E.window[i, 0] and not _is_return(P, R, E, a):
            E.events_inside[i] += 1


@inlined_kernel
def _polynomial(row, K, s):
    value = row[K]
    for k in range(K - 1, -1, -1):
        value = value * s + row[k]
    return value


@kernel
def _quantity(P, C, E, block, q, s):
    """Quantity E.quantity[q] at s on a step's polynomials."""
    n, m, K = P.n, P.m, C.order
    which = E.quantity[q]
    if which < n + m:
        return _polynomial(block[which], K, s)
    for k in range(n):
        E.x[k] = _polynomial(block[k], K, s)
    for j in range(m):
        # The constant term alone where lambda is fixed: exactly +-1, which selects a branch.
        E.mult[j] = _polynomial(block[n + j], K, s)
    call_outputs(E.outputs, _polynomial(block[n + m], K, s), E.x, E.mult, P.p, E.out)
    return E.out[which - n - m]


@kernel
def _refine(P, C, E, block, q, sign, a, b):
    """Largest value of sign * quantity on [a, b], where it has one hump: golden section."""
    c, d = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
    fc, fd = sign * _quantity(P, C, E, block, q, c), sign * _quantity(P, C, E, block, q, d)
    best = max(fc, fd)
    for _ in range(40):  # 0.618**40 = 4e-9 of the bracket: at rounding level for the value, which is flat there
        if fc > fd:
            b, d, fd = d, c, fc
            c = b - _GOLDEN * (b - a)
            fc = sign * _quantity(P, C, E, block, q, c)
        else:
            a, c, fc = c, d, fd
            d = a + _GOLDEN * (b - a)
            fd = sign * _quantity(P, C, E, block, q, d)
        best = max(best, max(fc, fd))
    return best


@kernel
def _monotone(row, K, h):
    """Whether a polynomial's first derivative outweighs all the others on [0, h]."""
    rest = 0.0
    for k in range(K, 1, -1):
        rest = rest * h + k * abs(row[k])
    return abs(row[1]) > rest * h


@kernel
def _within(row, K, h, poly, low, high):
    """Whether a polynomial stays between low and high on [0, h], by its Bernstein coefficients of degree 6."""
    power, rest = 1.0, 0.0
    for k in range(K + 1):
        poly[k] = row[k] * power
        power *= h
        if k > 6:
            rest += abs(poly[k])
    below, above = low_bounds(poly)
    return below - rest >= low and above + rest <= high


@kernel
def _measure_quantity(P, C, E, block, q, i, start, length, straight):
    """Extremes and integrals of one quantity on a step's polynomials from s = start to its end.

    `straight` says that time is t0 + s, as it is everywhere but beside a fold.
    """
    K, time = C.order, block[P.n + P.m]
    which, wanted = E.quantity[q], E.wanted[q]
    nodes = len(E.node)
    if which < P.n + P.m and wanted == EXTREMES:
        # Most steps cannot hold an extreme of the whole window.
        if _within(block[which], K, length, E.poly, E.low[i, q], E.high[i, q]):
            return
    plain = which < P.n + P.m and wanted == EXTREMES and _monotone(block[which], K, length)
    best_low, best_high = 0, 0
    for k in range(nodes + 2):
        if plain and 0 < k <= nodes:
            continue
        s = start if k == 0 else length if k == nodes + 1 else start + (length - start) * E.node[k - 1]
        value = _quantity(P, C, E, block, q, s)
        E.at[k], E.value[k, q] = s, value
        if value < E.value[best_low, q]:
            best_low = k
        if value > E.value[best_high, q]:
            best_high = k
        if wanted & INTEGRALS and 0 < k <= nodes:
            slope = 1.0
            if not straight:
                slope = 0.0
                for r in range(K, 0, -1):
                    slope = slope * s + r * time[r]
            share = E.weight[k - 1] * (length - start) * slope
            E.first[i, q] += share * value
            E.second[i, q] += share * value * value
    if wanted & EXTREMES:
        for sign in range(-1, 2, 2):
            k = best_high if sign > 0 else best_low
            top = sign * E.value[k, q]
            best = E.high[i, q] if sign > 0 else -E.low[i, q]
            if not plain:
                left, right = max(k - 1, 0), min(k + 1, nodes + 1)
                # A hump between samples rises above them by an eighth of the second difference.
                drop = max(abs(E.value[k, q] - E.value[left, q]), abs(E.value[k, q] - E.value[right, q]))
                if top + drop > best and drop > 0.0:
                    top = max(top, _refine(P, C, E, block, q, float(sign), E.at[left], E.at[right]))
            if top > best:
                if sign > 0:
                    E.high[i, q] = top
                else:
                    E.low[i, q] = -top


@kernel
def _follow_steps(P, C, S, R, E, i):
    """Takes note of the steps' polynomials in the buffers: extremes and integrals inside the window."""
    K, begin = C.order, E.window[i, 0]
    for d in range(S.pieces):
        block, length = R.dense[d], R.dense_s[d]
        time = block[P.n + P.m]
        if not length > 0.0 or _polynomial(time, K, length) <= begin:
            continue
        start = 0.0
        if time[0] < begin:
            low, high = 0.0, length  # t(s) increases: 60 halvings are as good as Newton and never fail
            for _ in range(60):
                start = 0.5 * (low + high)
                if _polynomial(time, K, start) < begin:
                    low = start
                else:
                    high = start
        straight = True
        for k in range(2, K + 1):
            if time[k] != 0.0:
                straight = False
        for q in range(len(E.quantity)):
            _measure_quantity(P, C, E, block, q, i, start, length, straight)


@kernel
def _same(E, i, a, b, n):
    """Whether the strobes a and b of orbit i agree within the tolerance."""
    for k in range(n):
        u, v = E.strobe[i, a, k], E.strobe[i, b, k]
        if not abs(u - v) <= E.period_tol * (1.0 + abs(v)):
            return False
    return True


@kernel
def _find_period(P, E, i):
    """The smallest number of strobes after which the second half of them repeats, or 0."""
    last = E.strobe.shape[1] - 1
    for period in range(1, min(E.longest, last // 2) + 1):
        repeats = True
        for back in range(last // 2 + 1):
            if last - back - period < 0:
                break
            if not _same(E, i, last - back, last - back - period, P.n):
                repeats = False
                break
        if repeats:
            return period
    return 0


@kernel
def _keep_word(E, i):
    """The segments that begin in the last period(s) of orbit i; the one that is on if none begins."""
    begin = E.strobe_t[i, E.strobe.shape[1] - 1 - max(E.found[i], 1)]
    count, ring = E.segments, len(E.segment)
    first = count
    while first > 0 and count - first < ring and E.segment_t[(first - 1) % ring] >= begin:
        first -= 1
    if count - first > E.word.shape[1] or count - first >= ring:
        E.word_length[i] = -1
        return
    if first == count and count > 0:
        first = count - 1
    E.word_length[i] = count - first
    for k in range(count - first):
        E.word[i, k] = E.segment[(first + k) % ring]


@unit(types.int64, Problem, Control, State, Record, Work, Ensemble, types.int64, types.int64)
def ensemble(P, C, S, R, W, E, first, stop):
    """Runs the orbits first, ..., stop - 1; returns how many of them failed."""
    failed = 0
    for i in range(first, stop):
        _reset(P, C, S, W, E, i)
        strobes, timed = E.strobe.shape[1], E.section < 0
        for k in range(len(R.t_eval)):
            R.t_eval[k] = E.window[i, 0] + k * E.period[i] if k < strobes - 1 else E.window[i, 1]
            E.strobe_t[i, k] = R.t_eval[k]
        R.x_eval[:] = math.nan
        code = Outcome.OUT_OF_MEMORY
        while code == Outcome.OUT_OF_MEMORY:
            if E.stop[0] != 0:
                break  # what is asked for no more leaves the code as it is
            code = call_unit(E.run, P, C, S, R, W)
            _follow_points(P, S, R, E, i)
            _follow_steps(P, C, S, R, E, i)
            if code == Outcome.TERMINATED and not _stops(P, S, R, E):
                code = Outcome.FINISHED if _meet_section(P, C, S, E, i) else Outcome.OUT_OF_MEMORY
            elif code == Outcome.FINISHED and not timed:
                code = NO_RETURN
            E.events[i] += S.events
            E.ambiguities[i] += S.ambiguities
            S.points = 0
            S.events = 0
            S.ambiguities = 0
            S.pieces = 0
        E.code[i] = code
        E.reached[i] = S.t
        E.steps[i] = S.steps
        for k in range(len(R.t_eval)):
            for r in range(P.n):
                E.strobe[i, k, r] = R.x_eval[k, r]
        if code == Outcome.FINISHED and timed and strobes > 0:
            # The run's own last state: its polynomial is a rounding off, and off the surface of a stick.
            for r in range(P.n):
                E.strobe[i, strobes - 1, r] = S.x[r]
        E.found[i] = _find_period(P, E, i) if code == Outcome.FINISHED else 0
        E.word_length[i] = 0
        if code == Outcome.FINISHED or (code == Outcome.TERMINATED and timed):
            _keep_word(E, i)
        elif code < 0:
            failed += 1
    return failed
