"""Closed-form piecewise solution of the Coulomb oscillator, the exact answer behind rho = 0.

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N sign(v)

A slip phase of side s is a damped oscillation plus a sinusoid; with a = c/2, w = sqrt(k - a^2),
theta = omega t,

    v  = exp(-a tau) (P cos w tau + Q sin w tau) + omega (A cos theta - B sin theta),
    k y = -sigma sin theta - c v - v' - s N,

and ends at the first zero of v. There the contact sticks when |F| <= capture, F = -sigma sin theta - k y, and
crosses otherwise; a stick ends where |F| reaches `static`, an arcsine. Coulomb's law has capture = static = N.
The three limits with the hidden term, beta -> 0, differ only in the two thresholds: static = N mu_s in each,
and capture = N mu_s (slaved), N (two-stage) or F_c(r) (layer ratio r), because z = 0 in every slip phase.

No zero is looked for by sampling. On each interval D of a grid, v is compared with its cubic Hermite
interpolant, whose error is at most M4 D^4/384, M4 = |Z_h| k^2 + |Z_d| omega^4 from the amplitudes. Where that
decides nothing the interval is bisected under bounds of v'' and v''' until v is seen to be of one sign,
monotone or of one curvature, so that grazing is decided by the value of v at its extremum.

Underdamped only (c^2 < 4 k).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

CROSSING, STICK, SLIP = 1, 2, 3
KIND_NAMES = {CROSSING: "crossing", STICK: "stick", SLIP: "slip by tangency"}

TWO_PI = 2 * math.pi
# Grid in units of 1/max(sqrt(k), omega): wider fails the Hermite test too often, narrower has more nodes.
GRID = 0.6
# A dip of v beyond zero by less than this is counted as a touch, not as an event.
TOUCH = 1e-15


@njit(cache=True, error_model="numpy")
def _slip_values(tau, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega):
    """s*v, s*v' and the drive's sine and cosine at tau after the start of a slip phase."""
    decay = math.exp(-a * tau)
    ch, sh = math.cos(w * tau), math.sin(w * tau)
    theta = theta0 + omega * tau
    cd, sd = math.cos(theta), math.sin(theta)
    v = decay * (P * ch + Q * sh) + omega * (A * cd - B * sd)
    acc = decay * ((w * Q - a * P) * ch - (a * Q + w * P) * sh) - omega * omega * (A * sd + B * cd)
    return s * v, s * acc, sd, cd


@njit(cache=True, error_model="numpy")
def _careful_zero(lo, hi, M2, M3, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega):
    """Bracket of the first zero of s*v in (lo, hi], s*v > 0 just after lo; (-1, -1) when there is none.

    Bisection under |v''| <= M2 and |v'''| <= M3, left half first, until v is decided on the interval.
    """
    stack = np.empty((64, 2))
    stack[0, 0], stack[0, 1] = lo, hi
    depth = 1
    while depth:
        depth -= 1
        x0, x1 = stack[depth, 0], stack[depth, 1]
        half = 0.5 * (x1 - x0)
        xm = x0 + half
        v1 = _slip_values(x1, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega)[0]
        vm, am, sd, cd = _slip_values(xm, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega)
        if vm - abs(am) * half - 0.5 * M2 * half * half > 0:
            continue
        jm = -c * am - k * vm - s * sigma * omega * cd
        if abs(am) > M2 * half or abs(am) - abs(jm) * half > 0.5 * M3 * half * half:  # monotone
            if v1 <= 0:
                return x0, x1
            continue
        if jm < -M3 * half:  # concave: the least value is at an end
            if v1 <= 0:
                return x0, x1
            continue
        if jm > M3 * half:  # convex: one minimum, found by Newton's method inside its bracket
            left, right, x = x0, x1, xm
            for _ in range(60):
                vx, ax, sd, cd = _slip_values(x, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega)
                if ax < 0:
                    left = x
                else:
                    right = x
                step = -ax / (-c * ax - k * vx - s * sigma * omega * cd)
                x += step
                if abs(step) < 1e-13 or right - left < 1e-15 * (1 + right):
                    break
                if not left < x < right:
                    x = 0.5 * (left + right)
            x = min(max(x, left), right)  # at an end of the interval when v' has no zero inside
            vx = _slip_values(x, theta0, s, P, Q, A, B, a, w, c, k, sigma, omega)[0]
            if vx < -TOUCH:
                return x0, x
            if v1 <= 0 and x1 - x > 1e-14:
                return x, x1
            continue
        if half < 1e-10:  # v, v' and v'' vanish together to rounding: a sign at the end is all that can be told
            if v1 <= 0:
                return x0, x1
            continue
        stack[depth, 0], stack[depth, 1] = xm, x1
        stack[depth + 1, 0], stack[depth + 1, 1] = x0, xm
        depth += 2
    return -1.0, -1.0


@njit(cache=True, error_model="numpy")
def trajectory(k, sigma, c, N, omega, capture, static, t0, y0, v0, t_end, times, kinds):
    """Orbit from (t0, y0, v0) to t_end; events go to `times`, `kinds` while there is room.

    Returns (number of events, y, v at t_end).
    """
    a = 0.5 * c
    w = math.sqrt(k - a * a)
    det = (k - omega * omega) ** 2 + (c * omega) ** 2
    A = -sigma * (k - omega * omega) / det
    B = sigma * c * omega / det
    D = GRID / max(math.sqrt(k), omega)
    # One node to the next: the two phasors turn by constant factors.
    hr, hi = math.exp(-a * D) * math.cos(w * D), math.exp(-a * D) * math.sin(w * D)
    dr, di = math.cos(omega * D), math.sin(omega * D)
    zd_abs = omega * math.hypot(A, B)
    k2, w4 = k * k, omega**4
    room = len(times)
    n = 0

    t = t0
    theta = omega * t0
    sd, cd = math.sin(theta), math.cos(theta)
    v, y = v0, y0
    force = -sigma * sd - k * y
    stuck = v == 0.0 and abs(force) <= static
    s = 1.0 if v > 0 or (v == 0 and force > 0) else -1.0
    acc = force - c * v - s * N  # v' on the side s

    while True:
        if stuck:
            ky = -sigma * sd - force
            delta = math.inf
            up, down = -(static + ky) / sigma, (static - ky) / sigma
            if abs(up) < 1:
                delta = (math.pi - math.asin(up) - theta) % TWO_PI
                # A stick that begins within rounding of its end: the phases' difference may come out below 0.
                if delta > TWO_PI - 1e-6 and cd < 0:
                    delta = 0.0
                s = 1.0
            if abs(down) < 1:
                other = (math.asin(down) - theta) % TWO_PI
                if other > TWO_PI - 1e-6 and cd > 0:
                    other = 0.0
                if other < delta:
                    delta = other
                    s = -1.0
            if t + delta / omega >= t_end:
                return n, ky / k, 0.0
            t += delta / omega
            if n < room:
                times[n], kinds[n] = t, SLIP
            n += 1
            sd = up if s > 0 else down
            cd = -s * math.sqrt((1 - sd) * (1 + sd))
            v, acc = 0.0, s * (static - N)
            stuck = False

        theta = omega * t
        # Phasors of s*v: zh turns and decays, zd turns; their sum's real part is s*v.
        vd, ad = omega * (A * cd - B * sd), -omega * omega * (A * sd + B * cd)
        P = v - vd
        Q = (acc - ad + a * P) / w
        zr, zi = s * P, -s * Q
        ur, ui = s * vd, -s * ad / omega
        zh_abs = math.sqrt(P * P + Q * Q)
        M4 = zh_abs * k2 + zd_abs * w4
        tail, slope_tail = M4 * D**4 / 384, M4 * D**3 * 0.00801875373874
        v0n, a0n = s * v, s * acc
        x0 = 0.0
        span = t_end - t
        low = high = -1.0
        while True:
            zr, zi = zr * hr - zi * hi, zr * hi + zi * hr
            ur, ui = ur * dr - ui * di, ur * di + ui * dr
            x1 = x0 + D
            v1n = zr + ur
            a1n = -a * zr - w * zi - omega * ui
            sure = False
            if x0 > 0 or v0n > 0:
                b1, b2 = v0n + D * a0n / 3, v1n - D * a1n / 3
                if min(min(v0n, b1), min(b2, v1n)) > tail:
                    sure = True
                elif v1n < 0:
                    middle = 3 * (v1n - v0n) / D - a0n - a1n
                    if max(max(a0n, middle), a1n) < -slope_tail:
                        low, high = x0, x1
                        break
                    # Concave: v'' of the Hermite cubic is linear, its error at most M4 D^2/12.
                    chord = 6 * (v1n - v0n) / D
                    if max(chord - 4 * a0n - 2 * a1n, 2 * a0n + 4 * a1n - chord) < -M4 * D**3 / 12:
                        low, high = x0, x1
                        break
            else:
                # v = 0 at the start, after a stick v' too: that zero is divided out of the Taylor polynomial.
                j0 = s * (-c * acc - sigma * omega * cd)
                q0 = -c * j0 - k * a0n + s * sigma * omega * omega * sd
                if acc != 0:
                    rest = M4 * D**3 / 24
                    sure = min(a0n, min(a0n + D * j0 / 4, a0n + D * j0 / 2 + D * D * q0 / 6)) > rest
                else:
                    sure = min(j0, j0 + D * q0 / 3) > M4 * D**2 / 12
            if not sure:
                rk = math.sqrt(k)
                M2, M3 = zh_abs * k + zd_abs * omega**2, zh_abs * k * rk + zd_abs * omega**3
                start = x0
                if x0 == 0 and v == 0:
                    if acc != 0:
                        start = 1.99 * a0n / M2
                    else:
                        start = 2.99 * s * (-sigma * omega * cd) / M3
                if start < x1:
                    low, high = _careful_zero(start, x1, M2, M3, theta, s, P, Q, A, B, a, w, c, k, sigma, omega)
                    if low >= 0:
                        break
            if x1 >= span:
                break
            x0, v0n, a0n = x1, v1n, a1n

        if low < 0 or low >= span:
            sv, sa, sd, cd = _slip_values(span, theta, s, P, Q, A, B, a, w, c, k, sigma, omega)
            return n, (-sigma * sd - c * s * sv - s * sa - s * N) / k, s * sv

        # First guess: the inverse cubic Hermite interpolant when the bracket is a grid interval.
        if low == x0 and high == x1:
            r = v0n / (v0n - v1n)
            g0, g1 = (v1n - v0n) / (a0n * D), (v1n - v0n) / (a1n * D)
            tau = x0 + D * (r * r * (3 - 2 * r) + r * (1 - r) * (g0 * (1 - r) - g1 * r))
            if not low < tau < high:
                tau = low + 0.5 * (high - low)
        else:
            tau = low + 0.5 * (high - low)
        dt = 0.0
        for _ in range(80):
            sv, sa, sd, cd = _slip_values(tau, theta, s, P, Q, A, B, a, w, c, k, sigma, omega)
            sj = -c * sa - k * sv - s * sigma * omega * cd
            if sv > 0:
                low = tau
            else:
                high = tau
            dt = -sv * sa / (sa * sa - 0.5 * sv * sj)  # Halley
            new = tau + dt
            curl = sj * dt / sa
            if abs(dt) < 1e-5 and curl * curl * abs(dt) < 4e-16:
                break  # cubic convergence: the next correction is below rounding
            if not low < new < high:
                new = 0.5 * (low + high)
            if high - low < 1e-15 * (1 + high):
                dt = 0.0
                break
            tau = new
        if tau + dt > span:
            sv, sa, sd, cd = _slip_values(span, theta, s, P, Q, A, B, a, w, c, k, sigma, omega)
            return n, (-sigma * sd - c * s * sv - s * sa - s * N) / k, s * sv
        # Carry the last correction by Taylor polynomials instead of a further evaluation.
        sq = -c * sj - k * sa + s * sigma * omega * omega * sd
        sa += dt * (sj + 0.5 * dt * sq)
        turn = omega * dt
        sd, cd = sd + turn * (cd - 0.5 * turn * sd), cd - turn * (sd + 0.5 * turn * cd)
        t += tau + dt
        theta = omega * t
        v = 0.0
        acc = s * sa
        force = acc + s * N
        if n < room:
            times[n] = t
        if abs(force) <= capture:
            stuck = True
            if n < room:
                kinds[n] = STICK
        else:
            s = -s
            acc = force - s * N
            if n < room:
                kinds[n] = CROSSING
        n += 1


@njit(cache=True, error_model="numpy")
def ensemble(k, sigma, c, N, omega, capture, static, y0, v0, t_end, times, kinds, counts, final):
    """Orbits from t = 0 for k, sigma, y0, v0 (n,); fills times, kinds (n, room), counts (n,), final (n, 2)."""
    for i in range(len(k)):
        counts[i], final[i, 0], final[i, 1] = trajectory(
            k[i], sigma[i], c, N, omega, capture, static, 0.0, y0[i], v0[i], t_end, times[i], kinds[i]
        )


def solve_closed_form(
    k, sigma, c=0.1, N=1.0, omega=1.0, *, capture=None, static=None, y0=0.5, v0=0.3, t_end=20 * TWO_PI, room=400
):
    """One orbit from t = 0: (times, kinds, (y, v) at t_end); Coulomb's law unless thresholds are given."""
    static = N if static is None else static
    capture = static if capture is None else capture
    times, kinds = np.empty(room), np.zeros(room, np.int64)
    args = [float(a) for a in (k, sigma, c, N, omega, capture, static, 0.0, y0, v0, t_end)]
    n, y, v = trajectory(*args, times, kinds)
    if n > room:
        raise ValueError(f"`room` = {room} is too small: the orbit has {n} events.")
    return times[:n], kinds[:n], np.array([y, v])
