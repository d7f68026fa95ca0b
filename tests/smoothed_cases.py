"""Starts on which a smoothed run is tried, and what counts as a wrong one.

Shared by the reduced test and the full experiment. Random starts sample the oscillator's parameters widely;
grazing starts reach the layer tangentially, v dipping to kappa*eps with |kappa| < 6, which is where an
unguarded solver steps over it (parameters of the published orbits).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pwsmooth.paths import stiff_steps as stiff

SPAN = 1.5 * 2 * math.pi
WRONG = 0.05  # a macroscopic difference: another decision between crossing and sticking
AGREE = 1e-6  # of the two references


@dataclass(frozen=True)
class Case:
    """One start with its parameters."""

    values: dict  # name of parameter -> value
    t0: float
    state: tuple  # (y, v, z)


def random_cases(n, eps, seed):
    """Oscillators, starts and phases at random; beta from eps to 1000 eps, at most 1."""
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(n):
        beta = min(1.0, eps * 10 ** rng.uniform(0, 3))
        values = {
            "k": rng.uniform(1.5, 5),
            "sigma": rng.uniform(0.6, 3),
            "rho": rng.uniform(0, 4),
            "beta": beta,
            "eps": eps,
        }
        state = (rng.uniform(-1.5, 1.5), rng.uniform(-1.5, 1.5), 0.0)
        cases.append(Case(values, rng.uniform(0, 2 * math.pi), state))
    return cases


def grazing_cases(n, eps, seed, k=3.1, sigma=2.4, c=0.1, N=1.0):
    """Starts from which v dips to kappa*eps, were the slip phase to last: found by going back from the dip."""
    rng = np.random.default_rng(seed)
    values = {"k": k, "sigma": sigma, "rho": 3.0, "beta": eps, "eps": eps}
    w = math.sqrt(k - c * c / 4)
    det = (k - 1) ** 2 + c * c
    A, B = -sigma * (k - 1) / det, sigma * c / det
    cases = []
    while len(cases) < n:
        dip = rng.uniform(0, 2 * math.pi)
        v_dip = rng.uniform(-6, 6) * eps
        # v' = 0 fixes y; v'' = -sigma cos t - k v must be positive for a dip
        y_dip = (-sigma * math.sin(dip) - c * v_dip - N) / k
        if -sigma * math.cos(dip) - k * v_dip < 0.3:
            continue
        C = y_dip + N / k - A * math.sin(dip) - B * math.cos(dip)
        S = (v_dip - A * math.cos(dip) + B * math.sin(dip) + c / 2 * C) / w

        def slip(back, dip=dip, C=C, S=S):
            t, tau = dip - back, -back
            grow = math.exp(-c / 2 * tau)
            co, si = math.cos(w * tau), math.sin(w * tau)
            y = grow * (C * co + S * si) - N / k + A * math.sin(t) + B * math.cos(t)
            v = grow * ((w * S - c / 2 * C) * co - (w * C + c / 2 * S) * si) + A * math.cos(t) - B * math.sin(t)
            return y, v

        # from outside of the layer, and with no earlier meeting of it
        back = rng.uniform(0.3, 0.8)
        if slip(back)[1] < 12 * eps or min(slip(b)[1] for b in np.linspace(0.05, back, 30)) <= v_dip:
            continue
        cases.append(Case(values, dip - back, (*slip(back), 0.0)))
    return cases


def end_state(view, case, *, rtol, atol=None, method="auto", shift=(0.0, 0.0)):
    """State (y, v, z) after 1.5 periods, or nan where the run failed; `shift` moves the start in y and v."""
    # Names -> the view's own order; values that it does not know are those of other views.
    p = np.array([case.values.get(s.name, view.parameters[s]) for s in view.model.parameters], float)
    start = np.array(case.state) + (*shift, 0.0)
    run = stiff.integrate(
        view.model,
        (case.t0, case.t0 + SPAN),
        start,
        p,
        rtol=rtol,
        atol=1e-3 * rtol if atol is None else atol,
        method=method,
    )
    return run.x[:, -1] if run.status == 0 else np.full(3, math.nan)


def references(view, case):
    """Two references of different order and tolerance, and whether they agree."""
    first = end_state(view, case, rtol=1e-10, atol=1e-14, method="radau9")
    second = end_state(view, case, rtol=1e-11, atol=1e-14, method="radau13")
    return second, bool(np.max(np.abs(first - second)) < AGREE)


def beside_a_boundary(view, case, rtol):
    """Whether moving the start by rtol changes the outcome: no method could be right at that tolerance."""
    ends = [
        end_state(view, case, rtol=1e-10, atol=1e-14, method="radau9", shift=shift)
        for shift in ((rtol, 0), (-rtol, 0), (0, rtol), (0, -rtol))
    ]
    reference, _ = references(view, case)
    return any(np.max(np.abs(end - reference)) > WRONG for end in ends)


def count_wrong(view, cases, rtol, method="auto"):
    """(wrong ones, starts beside a boundary, starts without agreeing references)."""
    wrong, boundary, unclear = [], [], []
    for case in cases:
        reference, agree = references(view, case)
        if not agree:
            unclear.append(case)
            continue
        error = np.max(np.abs(end_state(view, case, rtol=rtol, method=method) - reference))
        if not error <= WRONG:  # a failed run, nan, is wrong too
            (boundary if beside_a_boundary(view, case, rtol) else wrong).append(case)
    return wrong, boundary, unclear
