"""Growth of a frame of deviations along a run: its tape played again, the frame made orthonormal behind every step.

Chain: tangents.py, kernels/tangent/growth.py -> **growth** -> analysis/lyapunov.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .tangents import Tape


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
    from ...codegen.machine.units import tangent_growth, unit_address

    (n, k), entries = frame.shape, len(tape.entries)
    loop, compiled = tangent_growth(), tape.programs("column" if k == 1 else "columns")
    columns = -(-k // 8) * 8
    times, logs = np.empty(entries), np.empty((entries, k))
    instant_t, why = np.empty(entries), np.empty((entries, 2), np.int64)
    asked = tape.arrays | dict(instant_t=instant_t, instant_why=why, grown_t=times, grown=logs)
    if len(tape.clock):
        asked["clock"] = np.zeros((len(tape.clock), columns + 8))
    with compiled.tangent(tape.order, max(10.0 * tape.rtol, 1e-15), columns, **asked) as tangent:
        tangent.w[:, :k] = frame
        tangent.scale[:k] = (frame != 0).T @ np.abs(tape.values[0, 2 : 2 + n])
        tangent.instant, tangent.replay = tape.instant_size, unit_address("replay")
        stopped = loop(tape.compiled.problem(tape.p).address, tangent.address)
        found, factors, end = tangent.instants, tangent.factors, tangent.w[:, :k].copy()
    return Growth(
        end, times[:factors], logs[:factors], instant_t[:found], why[:found],
        np.nan if stopped < 0 else float(tape.values[stopped, 0]),
    )  # fmt: skip
