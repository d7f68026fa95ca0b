"""The compiled units of the kernels, without numba once they are compiled.

A unit (kernels/machine) is self-contained: it calls generated functions and other units through addresses only.
So its object code is kept and linked by llvmlite in later processes, which then import no numba at all (a third of the
time to the first solution).
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from pkgutil import iter_modules

import llvmlite.binding as llvm

from .cache import kernels, load_kernels
from .objects import link, machine_mark
from .workers import announced, compile_beside, cores

# Name in state.Problem -> (kernel module, function). The largest come first: parts are compiled beside each other.
UNITS = {
    "run": ("trajectory", "run"),
    "instant_unit": ("instant.instants", "at_instant"),
    "start_unit": ("instant.starting", "start"),
    "layer_unit": ("surface.layer", "layer"),
    "root_unit": ("step.roots", "isolate"),
    "approach_unit": ("step.singular", "approach"),
    "newton_unit": ("surface.sliding", "newton"),
    "others_unit": ("instant.other_motions", "report_other_motions"),
    "fold_unit": ("step.arc", "fold_jet"),
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
    "diffuse_many": ("noise.many", "diffuse_many"),
}
# Those of the smoothed path; behind the loop in the order of stiff_call.ATTEMPT_UNIT and its successors.
STIFF_UNITS = {
    "stiff_run": ("stiff.loop", "integrate"),
    "attempt_unit": ("stiff.radau", "attempt_unit"),
    "taylor_unit": ("stiff.step", "taylor_unit"),
    "events_unit": ("stiff.events", "events_unit"),
    "dense_factor": ("stiff.dense", "dense_factor"),
    "dense_solve": ("stiff.dense", "dense_solve"),
}
# What numba's wrapper of a C function names for the case of an exception, which no kernel raises.
_NEVER_CALLED = (
    "numba_do_raise",
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_runtime_build_excinfo_struct",
    "numba_unpickle",
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
)
_PYTHON = (
    "PyBytes_FromStringAndSize",
    "PyErr_Clear",
    "PyErr_SetNone",
    "PyErr_SetString",
    "PyErr_WriteUnraisable",
    "PyExc_RuntimeError",
    "PyExc_StopIteration",
    "PyExc_SystemError",
    "PyUnicode_FromString",
    "Py_DecRef",
)
_kept: list = []  # engines and numba functions, whose addresses are in use


def _own_name(name: str) -> str:
    """A name of the same length that numba does not use: symbols of llvmlite are those of the whole process."""
    return "pws" + name[3:]


def _detached(image: bytes) -> bytes:
    """The object file with its references to numba's runtime renamed.

    Under their own names they would be resolved for numba too: a user's `@njit` function in the same process
    would free its arrays with our dummy.
    """
    for name in _NEVER_CALLED:
        image = image.replace(name.encode() + b"\0", _own_name(name).encode() + b"\0")
    return image


@cache
def _resolve_symbols() -> None:
    nothing = ctypes.CFUNCTYPE(ctypes.c_void_p)(lambda: None)
    _kept.append(nothing)
    for name in _NEVER_CALLED:
        llvm.add_symbol(_own_name(name), ctypes.cast(nothing, ctypes.c_void_p).value)
    for name in _PYTHON:
        llvm.add_symbol(name, ctypes.addressof(ctypes.c_char.in_dll(ctypes.pythonapi, name)))


def _stored(name: str) -> tuple[str, str, str]:
    """Module and function of a unit, and the file that its object code is kept in."""
    module, function = (UNITS | METHODS | MORE_UNITS | STIFF_UNITS)[name]
    return module, function, f"{module}.{function}.{machine_mark()}.o"


def unit_addresses(names: Iterable[str]) -> list[int]:
    """Addresses of units; those that no cache has are compiled beside each other first."""

    def kept(name: str) -> bool:
        return kernels().read(_stored(name)[2]) is not None

    missing = [name for name in names if not kept(name)]
    if len(missing) > 1 and cores() > 1:
        with announced(len(missing)):
            compile_beside(missing, kept)
    return [unit_address(name) for name in names]


@cache
def unit_address(name: str) -> int:
    """Address of a unit: from its object file, or compiled by numba now."""
    module, function, file = _stored(name)
    content = kernels().read(file)
    if content is None:
        with announced(1):
            compiled = getattr(load_kernels(module), function).compiled
        _kept.append(compiled)
        # numba has no public way to an object file; without this one every process would load numba.
        image = compiled._library._get_compiled_object()
        kernels().write(file, compiled._wrapper_name.encode() + b"\0" + image)
        return compiled.address
    symbol, _, image = content.partition(b"\0")
    _resolve_symbols()
    engine = link(_detached(image))
    _kept.append(engine)
    return engine.get_function_address(symbol.decode())


@cache
def trajectory_loop():
    """kernels.trajectory.run as a Python function of five Bundles."""
    prototype = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)
    run = prototype(unit_address("run"))
    return lambda P, C, S, R, W: run(P.address, C.address, S.address, R.address, W.address)


@cache
def stiff_loop():
    """kernels.stiff.loop.integrate as a Python function of a Core and a number of steps, and the addresses of the
    units that it calls."""
    loop, *others = unit_addresses(STIFF_UNITS)
    run = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64)(loop)
    return lambda core, steps: run(core.address, steps), others
