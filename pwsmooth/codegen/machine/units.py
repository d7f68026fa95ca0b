"""The compiled units of the kernels, without numba once they are compiled.

A unit (kernels/machine) is self-contained: it calls generated functions and other units through addresses only, and
names nothing but functions of the C library. So its object code is kept, in a wheel for each level of processors, and
linked by llvmlite, without numba (a third of the time to the first solution).
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from pkgutil import iter_modules

from .cache import kernels, load_kernels
from .clock import preparing
from .objects import link, unit_marks
from .workers import announced, compile_beside

# Name in state.Problem -> (kernel module, function). The largest come first: parts are compiled beside each other.
UNITS = {
    "run": ("trajectory", "run"),
    "instant_unit": ("instant.instants", "at_instant"),
    "layer_unit": ("surface.layer", "layer"),
    "root_unit": ("step.roots", "isolate"),
    "approach_unit": ("step.singular", "approach"),
    "newton_unit": ("surface.sliding", "newton"),
    "others_unit": ("instant.other_motions", "report_other_motions"),
    "fold_unit": ("step.arc", "fold_jet"),
    "onset_unit": ("step.onset", "onset"),
}
# Those of the methods of one step, of which a run needs one at most: each is a file.
METHODS = {
    m.name: (f"step.methods.{m.name}", "step")
    for m in iter_modules([str(Path(__file__).parents[2] / "kernels/step/methods")])
}
# Units that only some runs need: they are no fields of the Problem.
MORE_UNITS = {
    "ensemble": ("sweeping.ensemble", "ensemble"),
    "kick_act": ("noise.kicks", "kick_act"),
    "kick_act_smooth": ("noise.kicks", "kick_act_smooth"),
    "diffuse": ("noise.path", "diffuse"),
    "replay": ("tangent.replay", "replay"),
    "growth": ("tangent.growth", "growth"),
    "diffuse_many": ("noise.many", "diffuse_many"),
    "local": ("local.loop", "run"),
    "stand_by": ("local.parts", "stand_by"),
}
# Those of the smoothed path; behind the loop in the order of stiff_call.ATTEMPT_UNIT and its successors.
STIFF_UNITS = {
    "stiff_run": ("stiff.loop", "integrate"),
    "attempt_unit": ("stiff.radau", "attempt_unit"),
    "taylor_unit": ("stiff.step", "taylor_unit"),
    "events_unit": ("stiff.events", "events_unit"),
    "sparse_factor": ("stiff.sparse", "sparse_factor"),
    "sparse_solve": ("stiff.sparse", "sparse_solve"),
}
ALL = UNITS | METHODS | MORE_UNITS | STIFF_UNITS
_kept: list = []  # engines, whose addresses are in use
_turn = threading.RLock()


def _read(name: str) -> bytes | None:
    """Object code of a unit that runs here, from the cache or the wheel."""
    module, function = ALL[name]
    found = (kernels().read(f"{module}.{function}.{mark}.o") for mark in unit_marks())
    return next((image for image in found if image is not None), None)


def unit_addresses(names: Iterable[str]) -> list[int]:
    """Addresses of units; those that are nowhere kept are compiled beside each other first."""
    names = list(names)
    missing = [name for name in names if _read(name) is None]
    if len(missing) > 1:
        with announced(f"compiling {len(missing)} parts of its numerical core", len(missing)) as one_more:

            def kept(name: str) -> bool:
                found = _read(name) is not None
                if found:
                    one_more()
                return found

            compile_beside(missing, kept)
    return [unit_address(name) for name in names]


def unit_address(name: str) -> int:
    """Address of a unit: from its object code, which numba makes now where none is kept."""
    with _turn:
        return _address(name)


@cache
def _address(name: str) -> int:
    module, function = ALL[name]
    image = _read(name)
    if image is None:
        file = f"{module}.{function}.{unit_marks()[-1]}.o"
        with announced("compiling one part of its numerical core"), kernels().alone(file):
            image = _read(name)  # another process may just have made it
            if image is None:
                image = getattr(load_kernels(module), function).compiled()
                kernels().write(file, image)
    engine = link(image)
    _kept.append(engine)
    return engine.get_function_address(f"pwsmooth.kernels.{module}.{function}")


def _function(name: str, *arguments: type):
    """A unit as a function of Python, of addresses and numbers, that gives a number."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *arguments)(unit_address(name))


@cache
def trajectory_loop():
    """kernels.trajectory.run as a Python function of the addresses of five Bundles."""
    return _function("run", *[ctypes.c_void_p] * 5)


@cache
def local_loop():
    """kernels.local.loop.run as a Python function of the address of each of six Bundles, and of that of the whole."""
    return _function("local", *[ctypes.c_void_p] * 7)


@cache
def stand_by():
    """kernels.local.parts.stand_by as a Python function of the address of an Assembly."""
    return _function("stand_by", ctypes.c_void_p)


@cache
def tangent_replay():
    """kernels.tangent.replay as a Python function of the addresses of two Bundles and a number of entries."""
    return _function("replay", ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)


@cache
def tangent_growth():
    """kernels.tangent.growth as a Python function of the addresses of two Bundles."""
    return _function("growth", *[ctypes.c_void_p] * 2)


@cache
@preparing()
def stiff_loop():
    """kernels.stiff.loop.integrate as a Python function of the address of a Core and a number of steps, and the
    addresses of the units that it calls."""
    _, *others = unit_addresses(STIFF_UNITS)
    return _function("stiff_run", ctypes.c_void_p, ctypes.c_int64), others
