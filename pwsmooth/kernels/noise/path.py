"""Trajectories of a diffusion: dx = f(t, x, lambda) dt + G(t, x, lambda) dW (Ito), piecewise smooth.

While no status changes, one step of Roessler's SRA1 (SIAM J. Numer. Anal. 48, 2010, strong order 1.5 for G of time
alone) with Milstein's terms where G depends on the state (strong order 1):

    X2 = X + 3/4 h f(X) + 3/2 G (H + W/2),      f2 = f(t + 3/4 h, X2)
    X' = X + h (f(X) + 2 f2)/3 + G W + 1/2 sum_jk (L_j g_k)(W_j W_k - delta_jk h) + (dG/dt) (h W/2 - h H)

A step that changes the status of a surface on which no noise acts is refused and its part of the Brownian path
halved, until the change is located; then the layer decides as on the event-driven path (instants.py). A surface on
which the noise acts is never slid on: there lambda = sign h, with finer steps beside it; an event happens where the
path first meets its surface (passage.py). Slow slips in a disc that the noise leaves alone: discs.py.
"""

import math

from numba import types

from ..fresh import restart_flags
from ..instant.discs import release_discs
from ..instant.surface_rates import any_is
from ..intervals import time_size
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_fields, call_linear, call_outputs, call_unit
from ..outcome import Outcome
from ..state import (
    CONTACT,
    DISC,
    GO_ON,
    HELD,
    NOTHING,
    SLIDING,
    SOLVED,
    Control,
    Problem,
    Record,
    State,
)
from ..step.recording import has_room, record_point
from ..step.roots import NO_ROOT
from ..surface.sliding import INSIDE, follow, keep_at_rest, keep_on_surface, mask_solved, surface_rounding
from ..work import Work
from .discs import ALIKE, SWEEPS, end_slow, mark_slow, time_to_turn, turn_slow
from .folds import aim_beyond, attracts, flattest
from .passage import go_to_first_passage, has_passed
from .state import ACROSS, BEND, DEEPEST, GATE, LOCATED, PULL, RATE, SLOPE, SPEED, SPREAD, WIDTH, Diffused
from .tree import begin_interval, end_time, halve, halved, length_here, pass_on

_SURE = 9.0  # three standard deviations, squared: how far a step beside a surface stays from it
_LEAP = 0.25  # of a multiplier within one step: a root farther away is another branch


@kernel
def _evaluate(P, S, W, N):
    """Overwrites W.dx, W.h, W.g and N.out at the present state, multipliers first; False if one is lost."""
    found = True
    if any_is(P, S, SOLVED):
        mask_solved(P, S, W)
        found = follow(P, S, W)
        for j in range(P.m):
            if S.status[j] == SOLVED and P.kind[j] == DISC and S.mult[j] == 1.0:
                S.mult[j] = INSIDE  # 1 says that it slips
    call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    turned = False
    for j in range(P.m):
        if N.noisy[j] and W.h[j] * S.status[j] < 0.0:
            S.status[j] = -S.status[j]
            S.mult[j] = float(S.status[j])
            turned = True
    if turned:
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
    call_outputs(N.outputs, S.t, S.x, S.mult, P.p, N.out)
    return found


@kernel
def _longest(P, S, W, N):
    """The longest step from here: a function of the present state alone, as a path that is not known ahead asks.

    W has the fields there.
    """
    m, ne, out, at = P.m, P.ne, N.out, N.at
    h = halved(N.step, N.level)
    floor = halved(h, N.finest)
    rate = 0.0
    for part in range(RATE, SPREAD):
        largest = 0.0
        for i in range(at[part], at[part + 1]):
            if not out[i] < math.inf:
                return math.nan
            largest = max(largest, out[i])
        rate += largest
    if rate > 0.0:
        h = min(h, N.resolution / rate)
    for i in range(m + ne):
        if N.noisy[i]:
            h = min(h, max(floor, W.h[i] * W.h[i] / (_SURE * out[at[SPREAD] + i] + 1e-300)))
    if P.discs != 0:
        h = min(h, max(floor, N.resolution * time_to_turn(P, S, W, N)))
    for j in range(m):
        pull = out[at[PULL] + j]
        bounded = P.kind[j] == SLIDING or P.kind[j] == DISC
        if S.status[j] == SOLVED and bounded and pull > 0.0:
            slope, bend = abs(out[at[SLOPE] + j]), abs(out[at[BEND] + j])
            size = abs(S.mult[j]) if P.kind[j] == SLIDING else math.sqrt(abs(S.mult[j]))
            room = (1.0 - size) * slope
            if bend > 0.0:
                room = min(room, 0.5 * slope * slope / bend)
            h = min(h, max(floor, room * room / (_SURE * pull)))
    part = 2.5 * N.resolution  # of a layer that a step may cross
    for i in range(at[SPEED] - at[GATE]):
        surface, speed = out[at[GATE] + i], abs(out[at[SPEED] + i])
        spread, width = out[at[ACROSS] + i], out[at[WIDTH] + i]
        square = width * width + surface * surface
        if speed > 0.0:
            h = min(h, part * math.sqrt(square) / speed)
        if spread > 0.0:
            h = min(h, part * part * square / spread)
    return h


@kernel
def _step(P, S, W, N):
    """One step over the present part of the path from N.x, N.f, N.out_start: overwrites S.x, S.t, S.mult.

    False if a sliding multiplier was lost at the stage.
    """
    n, x, start = P.n, S.x, N.out_start
    level = N.depth
    dw, area = N.increment[level], N.area[level]
    h, t = length_here(N), S.t
    for i in range(n):
        total = 0.75 * h * N.f[i]
        for k in range(N.G_row[i], N.G_row[i + 1]):
            s = N.G_source[k]
            total += 1.5 * start[N.G_place[k]] * (area[s] + 0.5 * dw[s])
        x[i] = N.x[i] + total
    S.t = t + 0.75 * h
    found = True
    if any_is(P, S, SOLVED):
        mask_solved(P, S, W)
        found = follow(P, S, W)
    call_fields(P.fields, S.t, x, S.mult, P.p, W.dx, W.h, W.g)
    if N.moving:
        call_outputs(N.outputs, t + h, x, S.mult, P.p, N.out_ahead)
    for i in range(n):
        total = h * (N.f[i] + 2.0 * W.dx[i]) / 3.0
        for k in range(N.G_row[i], N.G_row[i + 1]):
            s, g = N.G_source[k], start[N.G_place[k]]
            total += g * dw[s]
            if N.moving:
                total += (N.out_ahead[N.G_place[k]] - g) * (0.5 * dw[s] - area[s])
        for k in range(N.M_row[i], N.M_row[i + 1]):
            a, b = N.M_first[k], N.M_second[k]
            total += start[N.M_place[k]] * (dw[a] * dw[b] - (h if a == b else 0.0))
        x[i] = N.x[i] + total
    S.t = end_time(N)
    for j in range(P.m):
        if S.status[j] == SOLVED and P.kind[j] == SLIDING:
            keep_on_surface(P, S, j, W)
    if P.discs != 0:
        keep_at_rest(P, S, W)
    return found


@kernel
def _follow_slow_slips(P, S, W, N, t):
    """A step with the lambda of its end in slow slips: (whether that was found, whether no multiplier was lost)."""
    length = length_here(N)
    for _ in range(SWEEPS):
        S.t, found = t, True
        for i in range(P.n):
            S.x[i] = N.x[i]
        if any_is(P, S, SOLVED):
            mask_solved(P, S, W)
            found = follow(P, S, W)
        call_fields(P.fields, S.t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        for i in range(P.n):
            N.f[i] = W.dx[i]
        found = _step(P, S, W, N) and found
        change = turn_slow(P, S, W, N, length)
        if change <= ALIKE:
            end_slow(P, S, W, N, length)
            return True, found
        if not change < math.inf:
            break
    return False, found


@kernel
def _changes(P, S, W, N, found):
    """Marks in tau and instant.fold what has changed its status over the step just made; True if anything has."""
    m, some = P.m, False
    W.instant.fold = -1
    linear = False
    for i in range(m + P.ne):
        W.meeting.tau[i] = NO_ROOT
        if i < m:
            if N.noisy[i] or S.status[i] == HELD or P.kind[i] >= CONTACT:
                continue
            if P.kind[i] == DISC and S.status[i] == 1:
                if N.rests[i]:
                    W.meeting.tau[i] = 0.5
                    some = True
                continue
            if S.status[i] == SOLVED:
                lam = S.mult[i]
                if not found or not abs(lam - N.mult[i]) <= _LEAP or not attracts(P, S, W, N, i):
                    W.instant.fold = i
                    some = True
                elif abs(lam) > 1.0:
                    W.meeting.tau[i] = 0.5
                    W.meeting.exit_side[i] = 1 if lam > 0.0 else -1
                    some = True
                continue
            side = S.status[i]
        else:
            side = S.side[i - m]
        if P.rows_slip[i] < 0:
            continue
        if i >= m and N.noisy[i] and P.watch[i - m] == 0 and has_passed(W, N, i):
            W.meeting.tau[i] = 0.5
            some = True
        if not W.h[i] * side < 0.0:
            continue
        if not linear:
            call_linear(P.linear, S.t, S.x, S.mult, P.p, W.G, W.dh)
            linear = True
        if -W.h[i] * side > surface_rounding(P, S, i, W):
            W.meeting.tau[i] = 0.5
            some = True
    return some


@kernel
def _deep_enough(P, W, N):
    """Whether what has changed is located: to the finest level where noise acts on the surface, else to rounding."""
    level = N.depth
    if W.instant.fold >= 0:
        return level >= LOCATED
    for i in range(P.m + P.ne):
        if W.meeting.tau[i] < NO_ROOT and not N.noisy[i]:
            return level >= LOCATED
    return level >= N.level + N.finest


@kernel
def _act(P, C, S, R, W, N, t_before, found):
    """Acts on the changes at the present instant, where the roots of all multipliers have been `found`; a code."""
    instant = W.instant
    t = S.t
    if instant.fold >= 0:
        # Past the fold the layer flow has one direction: that of g at the root that was. A root that does not attract
        # lies in it, too.
        for j in range(P.m):
            W.arc.mult[1 + j] = S.mult[j] - N.mult[j]
            if S.status[j] == SOLVED:
                S.mult[j] = N.mult[j]
        if not found:
            instant.fold = flattest(P, S, W, instant.fold)
        fold = instant.fold
        call_fields(P.fields, t, S.x, S.mult, P.p, W.dx, W.h, W.g)
        ahead = W.arc.mult[1 + fold] if found else W.g[fold]
        instant.way = 1 if ahead > 0.0 else -1
        if P.kind[fold] == DISC:
            instant.fold = fold + 1  # its first component
            if not found:
                aim_beyond(P, S, W, fold)
    instant.at_clock = 0
    for j in range(P.m):
        S.last[j, 1] = 0.0  # intervals of a random path are no sequence that converges
    instant.met, W.step.length, instant.elapsed = 0.5, t - t_before, t - t_before
    code = call_unit(P.instant_unit, P, C, S, R, W)
    S.t = t
    return code


@kernel
def _restore(P, S, N, t):
    S.t = t
    for i in range(P.n):
        S.x[i] = N.x[i]
    for j in range(P.m):
        S.mult[j] = N.mult[j]
        S.status[j] = N.status[j]


@kernel
def _sample(S, R, P):
    """The asked-for instants up to now, which is the end of an interval."""
    slack = 1e-9 * time_size(S)
    while S.samples < len(R.t_eval) and R.t_eval[S.samples] <= S.t + slack:
        k = S.samples
        for i in range(P.n):
            R.x_eval[k, i] = S.x[i]
        for j in range(P.m):
            R.mult_eval[k, j] = S.mult[j]
        S.samples = k + 1


@kernel
def _begin(P, C, S, R, W, N):
    """Classifies the start; returns a code."""
    begin_interval(N)
    restart_flags(W)
    W.meeting.widest[:] = 0.0
    W.meeting.blurred[:] = 0.0  # at rest by a step of the noise is no touch
    code = call_unit(P.instant_unit, P, C, S, R, W)
    if code == GO_ON:
        _sample(S, R, P)
        _evaluate(P, S, W, N)
    return code


@unit(types.int64, Problem, Control, State, Record, Work, Diffused)
def diffuse(P, C, S, R, W, N):
    """Advances S to the start of interval N.last, or to the first reason to return; see state.py."""
    if S.started == 0:
        code = _begin(P, C, S, R, W, N)
        if code != GO_ON:
            return code
    while N.interval < N.last:
        if not has_room(P, R, S):
            return Outcome.OUT_OF_MEMORY
        if S.steps >= C.max_steps:
            return Outcome.TOO_MANY_STEPS
        longest = _longest(P, S, W, N)
        if not longest > 0.0:
            return Outcome.NOT_FINITE
        while length_here(N) > longest:
            if N.depth >= DEEPEST:
                return Outcome.STEP_UNDERFLOW
            halve(N)
        t = S.t
        for i in range(P.n):
            N.x[i] = S.x[i]
            N.f[i] = W.dx[i]
        for j in range(P.m):
            N.mult[j] = S.mult[j]
            N.status[j] = S.status[j]
        for i in range(len(N.out)):
            N.out_start[i] = N.out[i]
        for i in range(P.m + P.ne):
            N.surface[i] = W.h[i]
        while True:
            S.steps += 1
            follows = True
            if P.discs != 0 and mark_slow(P, S, W, N, length_here(N)):
                follows, found = _follow_slow_slips(P, S, W, N, t)
            else:
                found = _step(P, S, W, N)
            if not follows:
                if N.depth >= DEEPEST:
                    return Outcome.STEP_UNDERFLOW
                _restore(P, S, N, t)
                halve(N)
                N.rejected += 1
                continue
            # Where a root is lost within the last part alone, it is there again.
            found = _evaluate(P, S, W, N) and (found or N.depth >= LOCATED)
            changed = _changes(P, S, W, N, found)
            if not changed or _deep_enough(P, W, N):
                break
            _restore(P, S, N, t)
            halve(N)
            N.rejected += 1
        total = 0.0
        for i in range(P.n):
            total += abs(S.x[i])
        if not total < math.inf:
            _restore(P, S, N, t)
            return Outcome.NOT_FINITE
        end = S.t
        passes = changed and go_to_first_passage(P, S, W, N, t)
        pass_on(N)
        if changed:
            code = _act(P, C, S, R, W, N, t, found)
            if passes and code == GO_ON:
                S.t = end
                for i in range(P.n):
                    S.x[i] += N.rest[i]
            _evaluate(P, S, W, N)
            if code != GO_ON:
                return code
        else:
            S.stalled = 0
            S.deflate[:] = 0
        if P.discs != 0 and any_is(P, S, HELD):
            code = release_discs(P, S, R, W)
            if code != NOTHING:
                _evaluate(P, S, W, N)
            if code < GO_ON:
                return code
        if N.depth == 0 and N.position == 0:
            _sample(S, R, P)
            if N.recording and not changed:
                record_point(P, S, R)
    return Outcome.FINISHED
