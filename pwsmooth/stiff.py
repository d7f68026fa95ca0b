"""The smoothed path: stiff integration of a smoothed Model that never steps over its layers.

Chain: System.smoothed(...) -> Model -> codegen.stiff (functions) -> kernels.stiff_loop (Radau IIA 5/9/13 and
Taylor in one loop, behind the gate of kernels.stiff_gate) -> StiffResult.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pwsmooth.model import Model

METHODS = ("auto", "radau5", "radau9", "radau13", "taylor")
# Looser tolerances were seen to step over layers in spite of the gate.
LOOSEST_RTOL = 1e-3
_CHUNK = 4096
RAISE_TOLERANCE = True


@dataclass
class StiffResult:
    """What one run of the smoothed path returned.

    Attributes
    ----------
    t : ndarray (nt,)
    x : ndarray (n, nt)
    status : int
        One of kernels.stiff_state: DONE, TERMINAL, NOT_FINITE, UNDERFLOW, TOO_MANY, EVENT_LOOP.
    counters : dict
        steps, rejected, f_evals, jac, newton, taylor_steps.
    dense : list of (t0, h, coefficients (n, degree + 1))
        Powers of (t - t0)/h; only on request.
    t_eval, x_eval : ndarray
        (ne,) and (n, ne); as far as the run came.
    events : list of (t, event index, x before, x after)
    """

    t: np.ndarray
    x: np.ndarray
    status: int
    counters: dict
    dense: list = field(default_factory=list)
    t_eval: np.ndarray | None = None
    x_eval: np.ndarray | None = None
    events: list = field(default_factory=list)


def internal_tolerances(rtol: float, method: str) -> tuple[int, int, float, float]:
    """(order index, Taylor order, rtol of Radau, rtol of Taylor) that serve the user's rtol without waste.

    The embedded error of Radau IIA has order s, the step order 2s - 1: at an internal 1e-6 the true error is about
    1e-9, so the user's tolerance is raised to a power that still leaves a margin on the problems measured.
    """
    if not RAISE_TOLERANCE:
        return 1, 12, rtol, rtol
    index = {"radau5": 0, "radau9": 1, "radau13": 2}.get(method, 1 if rtol >= 3e-5 else 2)
    power = (1.0, 0.8, 0.8)[index]
    return index, 12 if rtol >= 1e-9 else 16, min(LOOSEST_RTOL, rtol**power), 0.3 * rtol


def integrate(
    model: Model, t_span, x0, p, *, rtol=1e-9, atol=1e-12, first_step=None, max_step=np.inf, max_steps=10_000_000,
    method="auto", dense=False, t_eval=None,
) -> StiffResult:  # fmt: skip
    from pwsmooth.codegen import stiff as codegen
    from pwsmooth.codegen.cache import load_kernels

    S = load_kernels("stiff_state")
    loop = load_kernels("stiff_loop")
    compiled = codegen.compile_stiff(model)
    n, q, e = compiled.n, compiled.n_surfaces, compiled.n_events
    t0, t1 = map(float, t_span)
    rtol = min(float(rtol), LOOSEST_RTOL)
    order, K, rtol_radau, rtol_taylor = internal_tolerances(rtol, method)
    atol = np.broadcast_to(np.asarray(atol, float), (n,)) * (rtol_radau / rtol)
    has_taylor = compiled.address[codegen.NAMES.index("taylor")] != 0
    if method == "taylor" and not has_taylor:
        raise ValueError("`method='taylor'` needs a recurrence for every function of the model; use 'auto'.")
    num = np.zeros(12)
    num[S.T], num[S.T_END] = t0, t1
    num[S.H] = first_step or 0.0
    num[S.RTOL], num[S.RTOL_TAYLOR] = rtol_radau, rtol_taylor
    num[S.H_MAX] = min(max_step, t1 - t0)
    num[S.KAPPA] = min(0.03, 10.0 * np.sqrt(rtol_radau))
    cnt = np.zeros(21, dtype=np.int64)
    cnt[S.ORDER], cnt[S.K] = order, K
    cnt[S.MAY_TAYLOR] = has_taylor and method in ("auto", "taylor")
    cnt[S.MAY_RADAU] = method != "taylor"
    cnt[S.MODE] = S.TAYLOR if cnt[S.MAY_TAYLOR] else S.RADAU
    cnt[S.DENSE_WANTED] = dense
    cnt[S.FIRST] = 2
    cnt[S.STEPS_LEFT] = max_steps
    slots = compiled.n_slots or n * n + n
    run = S.Run(
        n, q, e, compiled.address, np.ascontiguousarray(p, float), np.ascontiguousarray(atol), compiled.surface_state,
        compiled.surface_row, num, cnt, np.array(x0, float), np.zeros(n), np.zeros((n, 8)),
        np.zeros((2, n + q, S.STRIDE)), 1.0 / (1.0 + np.arange(n)), np.zeros((q, n + 3)), np.zeros((n, n)),
        np.zeros((slots, 8)), np.zeros((5, n, 8)), np.zeros((compiled.n_hoisted + 1, 8)), np.zeros((max(q, e, 1), 8)),
        np.zeros((8, n + 8)), np.zeros((n, 17)),
    )  # fmt: skip
    t_eval = np.zeros(0) if t_eval is None else np.ascontiguousarray(t_eval, float)
    x_eval = np.full((len(t_eval), n), np.nan)
    out = S.Output(
        np.zeros(_CHUNK), np.zeros((_CHUNK, n)), np.zeros(_CHUNK), np.zeros(_CHUNK, np.int64),
        np.zeros((_CHUNK if dense else 0, n, 17)), np.zeros(2, np.int64), t_eval, x_eval,
        np.zeros(64), np.zeros(64, np.int64), np.zeros((64, 2, n)),
    )  # fmt: skip
    ts, xs, polynomials, events = [np.array([t0])], [run.x[None].copy()], [], []
    while True:
        status = loop.integrate(run, out, _CHUNK)
        k = out.count[0]
        ts.append(out.t[:k].copy())
        xs.append(out.x[:k].copy())
        if status != S.FULL:
            break
    counters = {"steps": int(cnt[S.STEPS]), "rejected": int(cnt[S.REJECTIONS]), "f_evals": int(cnt[S.F_EVALS]),
                "jac": int(cnt[S.JACOBIANS]), "newton": int(cnt[S.NEWTON]), "taylor_steps": int(cnt[S.TAYLOR_STEPS])}  # fmt: skip
    return StiffResult(np.concatenate(ts), np.concatenate(xs).T, int(status), counters, polynomials,
                       t_eval, x_eval.T, events)  # fmt: skip
