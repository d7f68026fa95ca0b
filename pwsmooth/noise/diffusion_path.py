"""A diffusion as a path of solve(): what it refuses, and its run.

Chain: solve -> **this file** -> diffusion_run.py.
"""

from __future__ import annotations

import math

import numpy as np

from ..definition.model import Model
from ..paths.call import Call
from ..results.solution import Solution


def why_not(model: Model, call: Call) -> str:
    """Where no diffusion acts.

    Raises
    ------
    ValueError
        What no run of one has.
    """
    if call.noise is None:
        return "nothing acts at random"
    from .diffusion_run import DiffusionRun

    if not isinstance(call.random, DiffusionRun):
        return "no diffusion acts"
    options = call.options
    if options.method != "auto":
        raise ValueError(
            f"`method` is {options.method!r}, but a diffusion has its own; leave `method` out, and set `step` and "
            "`resolution` of the Diffusion."
        )
    if call.local or call.record is not None:
        what = "`local` is True" if call.local else "`record` is given"
        raise ValueError(f"{what}, but a diffusion is a run of the whole system; leave it out.")
    if call.wanted is not None:
        raise ValueError("`by` is given for a diffusion, which has no derivatives; leave `noise` out.")
    if options.dense:
        raise ValueError(
            "`dense_output` is True, but a diffusion has no polynomials; ask for times by `t_eval`."
        )
    if options.order is not None or options.max_step < math.inf:
        raise ValueError(
            "`order` and `max_step` do not act on a diffusion; set `step`, `level` and `resolution` of it."
        )
    return ""


def run(call: Call) -> Solution:
    """The Solution of one trajectory.

    Raises
    ------
    ValueError
        Times that are no multiples of its step.
    """
    from .diffusion_run import Path

    diffusion, start, times, spending = call.random, call.start, call.times, call.budget()
    first, last = (diffusion.interval(t, "`t_span`") for t in call.span)
    if first == last:
        raise ValueError(f"`t_span` is shorter than one `step` {diffusion.noise.step:g} of the diffusion.")
    for t in () if times is None else times:
        diffusion.interval(t, "an entry of `t_eval`")
    if diffusion.system is not call.system:  # its elements are written out
        named = dict(zip(map(str, call.system.states), start, strict=True))
        start = diffusion.system.initial_state(named, call.span[0])
    path = Path(diffusion, int(spending.left), call.options.strict)
    return path.diffuse(first, last, np.array(start), times, spending)
