"""Stepping over the layer: smoothed systems under error control alone.

    y' = v,  v' = -sigma sin t - k y - c v - N L(v/eps)(1 + rho z),  beta z' = 1 - L(v/eps)^2 - z

A step that passes the layer |v| < eps at once sees none of it: the run goes on as if there were no friction change,
and reports success. The error test sees the layer only where rtol |v| is below its width, rtol < eps; where v dips
into it tangentially the shorter stay asks for more, the more so the higher the order. Outside of the layer the tails
of tanh and erf underflow, so that a method that looks at derivatives, however high, is blind to them at any tolerance.
A run is wrong where its state after 1.5 periods is off by more than 0.05: another decision between crossing and
sticking.
"""

from __future__ import annotations

import math
from functools import cache, partial
from typing import Any

import numpy as np
import sympy as sp

from ...definition.primitives import Switch
from ...solving import solve
from ...system import System
from .failures import Collapsed, Finding, attempt
from .fixed import compiled
from .hazard import Axis, Hazard, decades
from .unguarded import compiled_peer, cvode, heyoka_taylor, scipy_end

SPAN = 3 * math.pi
WRONG, AGREE = 0.05, 1e-6
K, C, N, SIGMA, RHO = 3.1, 0.1, 1.0, 2.4, 3.0
SIGMOIDS = ("algebraic", "tanh", "erf")
SEED = 20_241
Start = tuple[float, tuple[float, float, float]]
Span = tuple[float, float]


def _rates(t, x, p):
    eps, beta, kind = p
    u = x[1] / eps
    if kind == 0.0:
        lam = u / math.sqrt(1.0 + u * u)
    elif kind == 1.0:
        lam = math.tanh(u)
    else:
        lam = math.erf(u)
    force = -2.4 * math.sin(t) - 3.1 * x[0] - 0.1 * x[1]
    return np.array([x[1], force - lam * (1.0 + 3.0 * x[2]), (1.0 - lam * lam - x[2]) / beta])


@cache
def _view(sigmoid: str) -> Any:
    t, y, v, z = sp.symbols("t y v z", real=True)
    beta, lam = sp.Symbol("beta", positive=True), Switch("lam", v)
    force = -SIGMA * sp.sin(t) - K * y - C * v - N * lam * (1 + RHO * z)
    system = System({y: v, v: force, z: (1 - lam**2 - z) / beta}, time=t, parameters={beta: 1.0})
    return system.smoothed(1.0, sigmoid)


def _own(sigmoid: str, eps: float, beta: float, span: Span, x0: Any, **options: Any) -> Any:
    return solve(_view(sigmoid), span, x0, parameters={"eps": eps, "beta": beta}, **options)


@cache
def reference(sigmoid: str, eps: float, beta: float, start: Start) -> np.ndarray | None:
    """State after the span; None where two methods of different order and tolerance do not agree."""
    t0, x0 = start
    first, second = (
        _own(sigmoid, eps, beta, (t0, t0 + SPAN), x0, method=method, rtol=rtol, atol=1e-14).x[:, -1]
        for method, rtol in (("radau9", 1e-10), ("radau13", 1e-11))
    )
    return second if np.max(np.abs(first - second)) < AGREE else None


@cache
def random_starts(count: int) -> tuple[Start, ...]:
    rng = np.random.default_rng(SEED)
    t, y, v = rng.uniform((0, -1.5, -1.5), (2 * math.pi, 1.5, 1.5), (count, 3)).T.tolist()
    return tuple((t0, (y0, v0, 0.0)) for t0, y0, v0 in zip(t, y, v))


@cache
def grazing_starts(count: int, eps: float) -> tuple[Start, ...]:
    """Starts in slip whose v has a minimum at kappa eps, |kappa| < 6: run back from it in closed form."""
    rng = np.random.default_rng(SEED + 1)
    w = math.sqrt(K - C * C / 4)
    det = (K - 1) ** 2 + C * C
    A, B = -SIGMA * (K - 1) / det, SIGMA * C / det
    starts: list[Start] = []
    while len(starts) < count:
        dip, v_dip = rng.uniform(0, 2 * math.pi), rng.uniform(-6, 6) * eps
        y_dip = (-SIGMA * math.sin(dip) - C * v_dip - N) / K  # v' = 0
        if -SIGMA * math.cos(dip) - K * v_dip < 0.3:  # v'' > 0
            continue
        a = y_dip + N / K - A * math.sin(dip) - B * math.cos(dip)
        b = (v_dip - A * math.cos(dip) + B * math.sin(dip) + C / 2 * a) / w
        back = rng.uniform(0.3, 0.8)

        def slip(ago: Any, dip: float = dip, a: float = a, b: float = b) -> tuple[Any, Any]:
            t, grow = dip - ago, np.exp(C / 2 * ago)
            co, si = np.cos(w * ago), -np.sin(w * ago)
            y = grow * (a * co + b * si) - N / K + A * np.sin(t) + B * np.cos(t)
            v = grow * ((w * b - C / 2 * a) * co - (w * a + C / 2 * b) * si) + A * np.cos(t) - B * np.sin(t)
            return y, v

        # From outside of the layer, and with no earlier meeting of it.
        if slip(back)[1] >= 12 * eps and np.min(slip(np.linspace(0.05, back, 30))[1]) > v_dip:
            y0, v0 = slip(back)
            starts.append((float(dip - back), (float(y0), float(v0), 0.0)))
    return tuple(starts)


# ---- the methods: (sigmoid, eps, beta, span, x0, rtol) -> state after the span


def _ours(sigmoid: str, eps: float, beta: float, span: Span, x0: Any, rtol: float) -> np.ndarray:
    solution = _own(sigmoid, eps, beta, span, x0, rtol=rtol, atol=1e-3 * rtol)
    if not solution.success:
        raise Collapsed(solution.message)
    return solution.x[:, -1]


def _compiled(name: str, sigmoid: str, eps: float, beta: float, span: Span, x0: Any, rtol: float) -> np.ndarray:
    return compiled_peer(name, compiled(_rates), span, x0, (eps, beta, SIGMOIDS.index(sigmoid)), rtol)


def _called(peer: Any, sigmoid: str, eps: float, beta: float, span: Span, x0: Any, rtol: float) -> np.ndarray:
    """By a peer that calls the right-hand side through Python."""
    p, rates = np.array([eps, beta, SIGMOIDS.index(sigmoid)]), compiled(_rates)
    return peer(lambda t, x: rates(t, x, p), span, x0, rtol, rtol)


@cache
def _equations(sigmoid: str) -> Any:
    def system(hy):
        y, v, z = hy.make_vars("y", "v", "z")
        u = v / hy.par[0]
        lam = {"algebraic": u / hy.sqrt(1.0 + u * u), "tanh": hy.tanh(u), "erf": hy.erf(u)}[sigmoid]
        force = -SIGMA * hy.sin(hy.time) - K * y - C * v
        return [(y, v), (v, force - N * lam * (1.0 + RHO * z)), (z, (1.0 - lam * lam - z) / hy.par[1])]

    return system


def _heyoka(sigmoid: str, eps: float, beta: float, span: Span, x0: Any, rtol: float) -> np.ndarray:
    return heyoka_taylor(_equations(sigmoid), (eps, beta), span, x0, rtol)


# name -> (run, share of the starts that it gets, smallest eps, smallest rtol): what takes too long is left out.
RUNS: dict[str, tuple[Any, float, float, float]] = {
    "smoothed path": (_ours, 1.0, 0.0, 0.0),
    "heyoka": (_heyoka, 0.5, 1e-4, 0.0),
    "LSODA (compiled)": (partial(_compiled, "lsoda"), 1.0, 0.0, 0.0),
    "DOP853 (compiled)": (partial(_compiled, "dop853"), 0.5, 1e-3, 0.0),
    "CVODE": (partial(_called, cvode), 0.2, 0.0, 0.0),
    "Radau": (partial(_called, partial(scipy_end, "Radau")), 0.06, 0.0, 1e-6),
}


def _judged(exact: np.ndarray, x: np.ndarray) -> Finding:
    off = float(np.max(np.abs(x - exact)))
    return Finding("right" if off <= WRONG else "wrong itinerary", off)


def _trials(situation: Any) -> Any:
    """Trials of all methods; `situation(row)` is (sigmoid, eps, beta, starts)."""

    def trial(name: str, rtol: float, row: float) -> list[Finding]:
        run, share, smallest, tightest = RUNS[name]
        sigmoid, eps, beta, starts = situation(row)
        if eps < smallest * 0.999 or rtol < tightest * 0.999:
            return []
        findings = []
        for start in starts[: max(2, round(share * len(starts)))]:
            exact, (t0, x0) = reference(sigmoid, eps, beta, start), start
            if exact is not None:
                span = t0, t0 + SPAN
                findings.append(attempt(run, partial(_judged, exact), sigmoid, eps, beta, span, x0, rtol))
        return findings

    return {name: partial(trial, name) for name in RUNS}


TRUTH = "two methods of this package, of orders 9 and 13, that agree to 1e-6"


def _widths(name: str, title: str, rtols: tuple[float, ...], widths: tuple[float, ...], starts: Any) -> Hazard:
    """rtol against eps = beta for the algebraic sigmoid, from starts(eps)."""
    return Hazard(
        name,
        f"smoothed, algebraic sigmoid: {title}",
        Axis("rtol = atol", rtols),
        Axis("width ε = β", widths),
        _trials(lambda eps: ("algebraic", eps, eps, starts(eps))),
        lambda method, eps: math.inf if method == "smoothed path" else eps,
        "rtol = ε: the layer is below what the error test sees",
        unit="error of the state",
        truth=TRUTH,
    )


def smoothed_random(fast: bool) -> Hazard:
    """200 starts at random."""
    rtols, widths = decades(-6, -2, 0.5 if fast else 2), decades(-6, -1, 0.4 if fast else 1)
    starts = random_starts(16 if fast else 200)
    return _widths("smoothed-random", "starts at random", rtols, widths, lambda eps: starts)


def smoothed_grazing(fast: bool) -> Hazard:
    """200 starts that dip into the layer."""
    rtols, widths = decades(-9, -2, 0.5 if fast else 1), decades(-6, -2, 0.5 if fast else 1)
    starts = partial(grazing_starts, 16 if fast else 200)
    return _widths("smoothed-grazing", "grazing starts", rtols, widths, starts)


TAILS = (("tanh", 1e-2, 1e-2), ("tanh", 1e-3, 1e-1), ("erf", 1e-1, 1e-1), ("erf", 1e-2, 1e-2), ("erf", 1e-3, 1e-3),
         ("erf", 1e-3, 1e-1))  # fmt: skip


def smoothed_tails(fast: bool) -> Hazard:
    """tanh and erf, whose tails underflow."""
    starts = random_starts(12 if fast else 60)
    chosen = TAILS[1::2] if fast else TAILS
    return Hazard(
        "smoothed-tails",
        "smoothed, tanh and erf: blind outside the layer",
        Axis("rtol = atol", decades(-12, -4, 0.25 if fast else 0.5)),
        Axis("sigmoid, ε, β", tuple(range(len(chosen))), tuple(f"{s} {e:g}, {b:g}" for s, e, b in chosen)),
        {
            name: trial
            for name, trial in _trials(lambda row: (*chosen[int(row)], starts)).items()
            if name not in ("CVODE", "Radau")
        },
        unit="error of the state",
        truth=TRUTH,
    )
