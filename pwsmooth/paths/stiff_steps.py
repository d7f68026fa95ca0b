"""The smoothed path: stiff integration of a smoothed Model that never steps over its layers.

Chain: System.smoothed(...) -> Model -> codegen.stiff (functions) -> kernels.stiff.loop (Radau IIA 5/9/13 and
Taylor in one loop, behind the gate of kernels.stiff.gate) -> StiffResult. `integrate_scipy` runs SciPy's
solvers on the same generated functions: the independent cross-check.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass, field

import numpy as np

from pwsmooth.definition.model import Model
from pwsmooth.door import checks
from pwsmooth.kernels.outcome import Outcome
from pwsmooth.kernels.state import ALWAYS, PLAIN, SILENT, TIMED
from pwsmooth.kernels.stiff import state as S
from pwsmooth.paths import memory
from pwsmooth.paths.budget import MOST_STEPS, Slices, first_slice, opened
from pwsmooth.paths.clock import instants_of_time
from pwsmooth.paths.stiff_arrays import core

METHODS = ("auto", "radau5", "radau9", "radau13", "taylor")
SCIPY_METHODS = ("Radau", "BDF", "LSODA", "DOP853")
# Looser tolerances were seen to step over layers in spite of the gate.
LOOSEST_RTOL = 1e-3
_CHUNK = 4096  # steps at most between two looks at the clock and the keyboard
# Of the span, in stiff_loop.STALL attempts: at a slower pace the end is 10^10 attempts away.
_LEAST_ADVANCE = 1e-6


@dataclass
class StiffResult:
    """What one run of the smoothed path returned.

    Attributes
    ----------
    t : ndarray (nt,)
        Ends of the steps; an event that changes the state stands twice, before and after.
    x : ndarray (n, nt)
    status : int
        The Outcome as the loop says it.
    counters : dict
        steps, rejected, f_evals, jac, newton, taylor_steps.
    dense : list of (t0, h, coefficients)
        On request: coefficients (n, degree + 1) of powers of (t - t0)/h, valid up to the next entry's t0.
    t_eval, x_eval : ndarray
        (ne,) and (n, ne); nan beyond the end of the run.
    events : list of (t, index, before, after)
        Index into `model.events`, and the states around the instant; after EVENTS_ACCUMULATE the last is the limit of
        its event.
    """

    t: np.ndarray
    x: np.ndarray
    status: int
    counters: dict
    dense: list = field(default_factory=list)
    t_eval: np.ndarray | None = None
    x_eval: np.ndarray | None = None
    events: list = field(default_factory=list)


def internal_tolerances(rtol: float, method: str, exact: bool) -> tuple[int, int, float, float]:
    """(order index, Taylor order, rtol of Radau, rtol of Taylor) that serve the user's rtol without waste.

    The embedded error of Radau IIA has order s, the step order 2s - 1: at an internal 1e-6 the true error is
    about 1e-9, so the tolerance is raised to a power that still leaves a margin on the problems measured. Not
    so when the estimate is `exact`: where states inside the steps are wanted, since the collocation polynomial has
    the order of the embedded error, and across kinks, where every order is low.
    """
    index = {"radau5": 0, "radau9": 1, "radau13": 2}.get(method, 1 if rtol >= 3e-5 else 2)
    power = 1.0 if exact or index == 0 else 0.8
    return index, 12 if rtol >= 1e-9 else 16, min(LOOSEST_RTOL, rtol**power), 0.3 * rtol


def integrate(
    model: Model, t_span, x0, p, *, rtol=1e-9, atol=1e-12, first_step=None, max_step=np.inf,
    spending=None, method="auto", dense=False, t_eval=None, kicks=None, remembers=None, at_rest=None,
) -> StiffResult:  # fmt: skip
    """Integrate a smoothed model over `t_span`.

    Parameters
    ----------
    model : Model
        Without multipliers; `smoothing` names the layers that must not be stepped over.
    t_span : (float, float)
        Ascending.
    x0 : array_like (n,)
    p : array_like
        Values in the order of `model.parameters`.
    rtol, atol : float or array_like
        `rtol` is a number, at most 1e-3 (a looser one runs at that bound). `atol` never weakens the layers'
        test.
    first_step, max_step : float
        By default the first step is found, and none is longer than a tenth of the span.
    spending : Budget, optional
        Attempted steps before the run stops with TOO_MANY_STEPS, and its seconds.
    method : {"auto", "radau5", "radau9", "radau13", "taylor"}
        "auto" chooses the order by the tolerance and takes Taylor steps where the motion is not stiff. Not of a family:
        in loops over elements a Taylor step takes as long as an implicit one.
    dense : bool
        Keep the polynomial of every step.
    t_eval : array_like, optional
        Ascending times within the span.
    kicks : KickedRun, optional
        Random kicks at one of the model's time events (noise.py).
    remembers : sequence of int, one of each event, optional
        Index of the memory that keeps the side of the event's surface (stiff_events.py), or -1.
    at_rest : sequence of int, one of each event, optional
        Index of the event whose update says what that memory is where the surface stays at 0, or -1.

    Returns
    -------
    StiffResult

    Raises
    ------
    ValueError
        Unknown method; a method that the model's functions do not allow; a model that still has multipliers.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.definition.model import Model
    >>> t, v, eps = sp.symbols("t v eps")
    >>> relay = Model(t, (v,), (eps,), (sp.Rational(1, 2) - sp.tanh(v / eps),), smoothing=((v, eps),))
    >>> run = integrate(relay, (0, 3), [1.0], [1e-6])
    >>> bool(abs(run.x[0, -1] / 1e-6 - 0.5493061443) < 1e-6)  # at rest where tanh(v/eps) = 1/2
    True
    """
    from pwsmooth.codegen.machine.units import stiff_loop

    from ..codegen.stiff import functions as codegen

    if method not in METHODS:
        raise ValueError(f"`method` is {method!r}; the smoothed path knows {', '.join(METHODS)}.")
    checks.without_together(model, "implicit steps")
    chunk, units = stiff_loop()
    spending = spending or opened()
    compiled = codegen.compile_stiff(model)
    if method == "taylor":
        compiled = compiled.with_taylor()
    has_taylor = compiled.address[codegen.NAMES.index("taylor")] != 0
    if method == "taylor" and not has_taylor:
        raise ValueError("`method='taylor'` needs a recurrence for every function of the model; use 'auto'.")
    t0, t1 = map(float, t_span)
    rtol = min(float(rtol), LOOSEST_RTOL)
    kinds = model.events if model.families is None else model.families.of_events()
    inside = dense or t_eval is not None or any(e.surface is not None and not e.singular for e in kinds)
    order, K, rtol_radau, rtol_taylor = internal_tolerances(rtol, method, inside or not compiled.smooth)

    p = np.ascontiguousarray(p, float)
    address = compiled.address
    if kicks is not None:
        address, p = kicks.smooth(address, codegen.NAMES.index("act"), p)
    addresses = np.array([*address, *units], dtype=np.int64)
    if method != "taylor":
        addresses[codegen.NAMES.index("radau")] = compiled.radau(order)
    values = dict(zip(model.parameters, p.tolist())) if model.events else {}
    instants = instants_of_time(model, values, t0, t1, int(min(spending.left, MOST_STEPS)))
    wanted = np.zeros(0) if t_eval is None else np.array(t_eval, float)
    taylor = has_taylor and method in ("auto", "taylor")
    run = core(
        compiled, _CHUNK, dense, adr=addresses, p=p,
        t_eval=wanted, x_eval=np.full((len(wanted), compiled.n), np.nan),
        instant_t=instants[0], instant_event=instants[1],
        order=order, taylor_order=K, may_taylor=taylor, may_radau=method != "taylor",
        t=t0, t_end=t1, unit=min(1.0, t1 - t0), h=first_step or 0.0, rtol=rtol_radau, rtol_taylor=rtol_taylor,
        # A tenth of the span: a seat belt, not what protects the layers.
        h_max=min(max_step, 0.1 * (t1 - t0)), mark=t0, least_advance=_LEAST_ADVANCE * (t1 - t0),
        kappa=min(0.03, 10.0 * math.sqrt(rtol_radau)),
        mode=S.TAYLOR if taylor else S.RADAU, first=2, steps_left=0 if spending.late() else spending.left,
    )  # fmt: skip
    run.atol[:] = np.multiply(atol, rtol_radau / rtol)
    run.x[:] = x0
    run.power[:] = 1.0 / (1.0 + np.arange(compiled.n))
    if model.events:
        run.direction[:] = [event.direction for event in kinds]
        run.stops[:] = [event.terminal or bool(event.singular) for event in kinds]
        run.remembers[:] = -1 if remembers is None else remembers
        run.at_rest[:] = -1 if at_rest is None else at_rest
        run.carried[:] = [
            TIMED if event.surface is None else ALWAYS if own >= 0 else SILENT if event.singular else PLAIN
            for event, own in zip(kinds, run.remembers)
        ]

    steps = min(first_slice(compiled.n), _CHUNK)
    slices, made = Slices(steps), 0
    pieces, polynomials, events = [(np.array([t0]), run.x[None].copy())], [], []
    while True:
        begun = run.t
        status = chunk(run.address, steps)
        k = run.points
        pieces.append((run.times[:k].copy(), run.states[:k].copy()))
        if dense:
            starts = np.concatenate([[begun], run.times[:k]])
            polynomials += [
                (float(starts[i]), float(run.length[i]), run.coefficients[i, :, : run.degree[i] + 1].copy())
                for i in range(k)
                if run.degree[i] >= 0
            ]
        k = run.records
        sides = run.event_x[:k].copy()  # before and after each
        events += zip(run.event_t[:k].tolist(), run.event_index[:k].tolist(), *sides.swapaxes(0, 1))
        if status != Outcome.OUT_OF_MEMORY:
            break
        if spending.late():
            status = Outcome.TIME_LIMIT
            break
        made, before = run.steps + run.rejections, made
        steps = min(slices.next(made - before), _CHUNK)
        # The Solution will hold the polynomials once more, of degree 16 at most.
        if dense and len(pieces) % 16 == 0 and not memory.fits(len(polynomials) * 8 * 17 * compiled.n):
            break
    if status == Outcome.TOO_MANY_STEPS and spending.late():
        status = Outcome.TIME_LIMIT
    spending.spend(run.steps + run.rejections)
    counters = {
        "steps": run.steps,
        "rejected": run.rejections,
        "f_evals": run.f_evals,
        "jac": run.jacobians,
        "newton": run.newton,
        "taylor_steps": run.taylor_steps,
    }
    times, states = (np.concatenate(part) for part in zip(*pieces, strict=True))
    wanted = (run.t_eval, run.x_eval.T) if t_eval is not None else (None, None)
    return StiffResult(times, states.T, int(status), counters, polynomials, *wanted, events)


def integrate_scipy(
    model: Model,
    t_span,
    x0,
    p,
    *,
    method="Radau",
    rtol=1e-9,
    atol=1e-12,
    max_step=np.inf,
    spending=None,
    t_eval=None,
    dense=False,
):
    """SciPy's solution of the same generated right-hand side and Jacobian, as an independent cross-check.

    No gate protects the layers here: that is the point of the comparison, and a reason for tight tolerances.

    Parameters
    ----------
    model, t_span, x0, p, rtol, atol, max_step, spending, t_eval, dense
        As for `integrate`; `spending` bounds the accepted steps, the only ones that SciPy shows.
    method : {"Radau", "BDF", "LSODA", "DOP853"}

    Returns
    -------
    scipy.integrate._ivp.ivp.OdeResult
        With three more entries: `steps`, `ended` (the code of the bound that stopped it, or 0), and `last`, the
        time and the state at which it ended.

    Raises
    ------
    ValueError
        Unknown method, or a model with events.
    """
    import scipy.integrate

    from ..codegen.stiff import functions as codegen

    if method not in SCIPY_METHODS:
        raise ValueError(f"`method` is {method!r}; SciPy's own are {', '.join(SCIPY_METHODS)}.")
    if any(not event.singular for event in model.events):
        raise ValueError(
            f"`method={method!r}` runs without events; this model has {len(model.events)}. Use 'auto'."
        )
    compiled = codegen.compile_stiff(model)
    spending = spending or opened()
    n = compiled.n
    p, x = np.ascontiguousarray(p, float), np.zeros(n)
    f, entries = np.zeros(n), np.zeros(len(compiled.pattern[0]))
    signature = ctypes.CFUNCTYPE(None, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
    rates, jacobian = (
        signature(int(compiled.address[codegen.NAMES.index(name)])) for name in ("rates1", "jacobian")
    )

    def call(function, t, state, out):
        x[:] = state
        function(t, x.ctypes.data, p.ctypes.data, out.ctypes.data)
        return out.copy()

    class Bounded(getattr(scipy.integrate, method)):
        """SciPy's solver, which knows no bound on its steps, with one."""

        steps, ended = 0, 0

        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            solvers.append(self)

        def step(self):
            self.ended = Outcome.TOO_MANY_STEPS if self.steps >= spending.left else 0
            self.ended = self.ended or (Outcome.TIME_LIMIT if spending.late() else 0)
            if self.ended:
                self.status = "failed"
                return "The bound on steps or seconds was reached."
            self.steps += 1
            return super().step()

    solvers: list = []
    implicit = (
        {} if method == "DOP853" else {"jac": lambda t, y: compiled.matrix(call(jacobian, t, y, entries))}
    )
    run = scipy.integrate.solve_ivp(
        lambda t, y: call(rates, t, y, f), t_span, x0, method=Bounded, rtol=rtol, atol=atol, max_step=max_step,
        t_eval=t_eval, dense_output=dense, **implicit,
    )  # fmt: skip
    run.steps, run.ended, run.last = solvers[0].steps, solvers[0].ended, (solvers[0].t, solvers[0].y)
    spending.spend(run.steps)
    return run
