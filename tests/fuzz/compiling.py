"""How the oracles are compiled: by one process, their parts as one piece.

numba links every callee into its caller and optimises the whole again, level by level, each to machine code of its
own. Here the callees of a function that Python calls wait, and are linked, optimised and emitted once, with it.
Chain: compiling.py (here) -> oracle.py, polar.py.
"""

from functools import wraps

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.cpu import CPUContext

from pwsmooth.codegen.machine.cache import models
from pwsmooth.kernels.machine.compiling import Part, parts_that_wait

# A function that others call, never Python. A number has the type of all of its kind, `np.int64(-1)` for -1:
# a function is compiled anew for every literal.
inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


class _Whole(Compiler):
    """Of a function that Python calls, which no compiled function may call: its parts have no machine code."""

    def _compile_core(self):
        executable = CPUContext.get_executable
        with parts_that_wait():
            never_called = CPUContext.get_executable

            def executable_or_none(context, library, *described):
                of = never_called if isinstance(library, Part) else executable
                return of(context, library, *described)

            CPUContext.get_executable = executable_or_none
            self.state.library = JITCodeLibrary(
                self.state.targetctx.codegen(), self.state.func_id.func_qualname
            )
            self.state.library.enable_object_caching()
            return super()._compile_core()


def whole(function):
    """Decorator: a function that Python calls; of several processes one compiles it, and the others find it kept."""
    compiled = njit(error_model="numpy", cache=True, pipeline_class=_Whole)(function)

    @wraps(function)
    def call(*arguments):
        if compiled.signatures:
            return compiled(*arguments)
        with models().alone(f"{function.__module__}.{function.__name__}"):
            return compiled(*arguments)

    return call
