"""nosnoc: finite elements with switch detection, a nonlinear programme with complementarities for each control step.

Given as in its authors' examples of simulation: Radau IIA, Stewart's representation with the two fields of every
switch, two finite elements in each step of the simulation, complementarity tolerance 1e-9; time is a state.
What is nonlinear in the multiplier has no place in a convex combination of two fields.
A. Nurkanovic, M. Diehl, IEEE Control Systems Letters 6 (2022) 3110-3115.
"""

from __future__ import annotations

import contextlib
import functools
import io
from typing import Any

import numpy as np
import sympy as sp

from ....definition.model import Select
from ..plain import affine, numbers

ELEMENTS = 2  # in each step of the simulation: one switch in each


@functools.lru_cache(maxsize=64)
def solver(system: Any, steps: int, t_end: float, stages: int, tolerance: float) -> Any:
    """A compiled solver of one step of length t_end/steps."""
    import casadi as ca
    import nosnoc

    model = system.model
    lams = [mu.symbol for mu in model.multipliers]
    x = ca.SX.sym("x", len(model.states) + 1)

    def translated(expressions, lam):
        values = numbers(system) | dict(zip(lams, lam))
        plain = [e.xreplace(values).replace(Select, affine) for e in expressions]
        space = {name: getattr(ca, name) for name in ("sin", "cos", "exp", "sqrt", "tanh")}
        made = sp.lambdify([model.time, list(model.states)], plain, modules=[space, "math"])
        return made(x[-1], [x[i] for i in range(x.shape[0] - 1)])

    m = len(lams)
    zero = ca.vertcat(*translated(model.rhs, [0] * m), 1)
    fields, unit = [], np.eye(m, dtype=int).tolist()
    for j in range(m):
        force = ca.vertcat(*translated(model.rhs, unit[j]), 1) - zero
        fields.append(ca.horzcat(force, -force))
    options = nosnoc.NosnocOpts()
    options.use_fesd = True
    options.pss_mode = nosnoc.PssMode.STEWART
    options.irk_scheme = nosnoc.IrkSchemes.RADAU_IIA
    options.n_s = stages
    options.N_finite_elements = ELEMENTS
    options.N_stages = 1
    options.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    options.comp_tol = tolerance
    options.sigma_N = tolerance
    options.homotopy_update_slope = 0.1
    options.terminal_time = t_end / steps
    options.print_level = 0
    surfaces = translated([mu.surface for mu in model.multipliers], [0] * m)
    made = nosnoc.NosnocModel(
        x=x, F=fields, f_0=zero, c=list(surfaces), S=[np.array([[1], [-1]])] * m, x0=np.zeros(len(model.states) + 1),
        name="case",
    )  # fmt: skip
    return nosnoc.NosnocSolver(options, made)


def simulate(system: Any, t_end: float, x0: np.ndarray, steps: int, stages: int, tolerance: float) -> Any:
    """(state at the end, no events, stages computed); RuntimeError where a step's programme is not solved."""
    import nosnoc

    steps_solver = solver(system, steps, t_end, stages, tolerance)
    loop = nosnoc.NosnocSimLooper(steps_solver, np.append(x0, 0.0), steps)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a line for each programme that fails
        loop.run()
    failed = sum(status != nosnoc.nosnoc_types.Status.SUCCESS for status in loop.status)
    if failed:
        raise RuntimeError(f"{failed} of {steps} programmes were not solved")
    return np.array(loop.xcurrent).ravel()[:-1], None, steps * ELEMENTS * stages
