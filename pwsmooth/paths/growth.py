"""Growth of a frame of deviations along a run: its tape played again, the frame made orthonormal behind every step.

Chain: tangents.py, kernels/tangent/growth.py -> **growth** -> analysis/lyapunov.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels import state as names
from ..kernels.tangent.frame import Frame
from .problem import compiled_problem
from .tangents import Tape, compiled_tangents


class Growth(NamedTuple):
    """How the k directions of a frame grow along a tape, by factors: each a step with the instant before it."""

    frame: np.ndarray  # (n, k), at the end
    t: np.ndarray  # (factors,), ends
    log: np.ndarray  # (factors, k)
    instant_t: np.ndarray  # (instants,)
    instant_why: np.ndarray  # (instants, 2)
    stopped: float  # as of Deviations


def growth(tape: Tape, frame: np.ndarray) -> Growth:
    """Carries a frame (n, k) of orthonormal deviations along a run."""
    from ..codegen.machine.units import tangent_growth, unit_address

    loop, compiled = tangent_growth(), compiled_tangents(tape.model)
    (n, k), entries = frame.shape, len(tape.entries)
    columns = -(-k // 8) * 8
    kinds = tape.entries[:, 0]
    instants = int(np.count_nonzero(kinds == names.TAPE_MEET))
    most = int(np.count_nonzero((kinds == names.TAPE_STEP) | (kinds == names.TAPE_END)))
    asked = dict(
        tape=tape.entries, tape_x=tape.values, clock=np.zeros((len(tape.clock), columns + 8)),
        instant_t=np.zeros(instants), instant_why=np.zeros((instants, 2), np.int64),
        instant_dt=np.zeros((instants, columns)), instant_w=np.zeros((instants, 2 * n, columns)),
        t_eval=np.empty(0), at_point=np.empty((0, 0, 0)), at_sample=np.empty((0, 0, 0)),
    )  # fmt: skip
    grown = Frame(
        replay=unit_address("replay"), count=k, entries=entries, t=np.zeros(most), log=np.zeros((most, k))
    )
    with compiled.tangent(tape.order, max(10.0 * tape.rtol, 1e-15), columns, **asked) as tangent:
        tangent.w[:, :k] = frame
        tangent.scale[:k] = (frame != 0).T @ np.abs(tape.values[0, 2 : 2 + n])
        tangent.instant = tape.instant_size
        stopped = loop(compiled_problem(tape.model).problem(tape.p), tangent, grown)
        found, end = tangent.instants, tangent.w[:, :k].copy()
    factors = grown.factors
    return Growth(
        end, grown.t[:factors], grown.log[:factors], asked["instant_t"][:found], asked["instant_why"][:found],
        np.nan if stopped < 0 else float(tape.values[stopped, 0]),
    )  # fmt: skip
