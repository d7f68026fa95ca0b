"""A system with noise, ready to run: kicked, or driven by a diffusion.

Chain: kicks.py, diffusion_run.py -> prepared (here) -> solve.
"""

from __future__ import annotations

from typing import Any

from ..door import checks
from .kicks import KickedRun, Kicks


def prepared(system: Any, noise: Any, method: str) -> Any:
    """The run of a system with noise: a KickedRun or DiffusionRun; None where the noise changes nothing.

    ValueError or TypeError where `noise` is none, names what does not exist, or the method cannot run with it.
    """
    from ..paths.stiff_steps import SCIPY_METHODS
    from .diffusion import Diffusion
    from .diffusion_run import DiffusionRun

    if isinstance(noise, Diffusion):
        if method != "auto":
            raise ValueError(
                f"`method` is {method!r}, but a diffusion has its own; leave `method` out, and set `step` and "
                "`resolution` of the Diffusion."
            )
        diffusion = DiffusionRun(system, noise)
        return diffusion if diffusion.acts else None
    if not isinstance(noise, Kicks):
        raise TypeError(
            f"`noise` is {checks.shown(noise)}; give Kicks(...), such as Kicks(1e-4, every=0.01, on=('y', 'v')), or "
            "Diffusion(...), such as Diffusion({v: 0.1}, step=0.01)."
        )
    if method in SCIPY_METHODS:
        raise ValueError(
            f"`method` is {method!r}, which runs without events and so without kicks; use 'auto' with `noise`."
        )
    run = KickedRun(system, noise)
    return run if len(run.where) else None
