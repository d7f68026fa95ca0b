"""How kernels are compiled: small functions, and units that meet through addresses.

numba links every callee into its caller and optimises the whole again, level by level, each to machine code of its
own: most of what it did for a deep call graph. Here the parts of a unit wait, and are linked and optimised once. Units
are compiled and cached once each and called through their address; inside a unit, `kernel` functions are linked as
usual. They are registered, not jitted: a jitted function would be compiled anew for every literal argument.
"""

import gc
from contextlib import contextmanager

from llvmlite import binding, ir
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Flags, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.registry import cpu_target
from numba.core.targetconfig import ConfigStack
from numba.core.typing.templates import _OverloadFunctionTemplate
from numba.extending import overload, register_jitable

from . import NEVER_CALLED
from .bundle import bundle_type

_NOT_FROM_PYTHON = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
kernel = register_jitable(**_NOT_FROM_PYTHON)
# A few lines each, called every step: as calls they would cost more in passing arrays than in work.
inlined_kernel = register_jitable(forceinline=True, **_NOT_FROM_PYTHON)


def loop_kernel(function):
    """Decorator: a part of a loop that is called once in it.

    numba copies it into the loop before that is compiled: no cost of a call (8 % of a step), nothing optimised twice.
    """
    overload(function, inline="always", strict=False, jit_options={"error_model": "numpy"})(
        lambda *args: function
    )
    return function


class Part(JITCodeLibrary):
    """The code of one function of a unit, which waits for the unit to be linked, optimised and emitted."""

    def finalize(self):
        self._finalized = True

    def _callees(self):
        """All parts that this one needs, callers before callees: LLVM links of them what is already asked for."""
        found, ended = {self}, []

        def visit(part):
            for other in part._linking_libraries:
                if other not in found:
                    found.add(other)
                    visit(other)
            ended.append(part)

        visit(self)
        return ended[-2::-1]

    def _with_callees(self, module):
        for other in self._callees():
            module.link_in(JITCodeLibrary._get_module_for_linking(other), preserve=True)
        return module

    def _get_module_for_linking(self):
        """With its callees, for code of others: what numba compiles here of its own it keeps for them too."""
        return self._with_callees(super()._get_module_for_linking().clone())

    def object_code(self):
        """Machine code of this part and all its callees, as numba optimises and emits its own."""
        module = self._with_callees(self._final_module)
        self._optimize_final_module()
        module.verify()
        return self._codegen._tm.emit_object(module)


def _flags_of_kernels():
    """numba's flags of every kernel: those of a unit, of what it calls and of what is copied into it."""
    flags = Flags()
    flags.error_model, flags.nrt = "numpy", True
    flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
    return flags


@contextmanager
def parts_that_wait():
    """What numba compiles in this context becomes Parts, which Python does not call. numba has no public way to it."""
    kind = type(cpu_target.target_context.codegen())
    before, executable, collecting = kind._library_class, CPUContext.get_executable, gc.isenabled()
    implementation = _OverloadFunctionTemplate._get_impl
    nowhere = binding.address_of_symbol("abort")

    def never_called(context, library, described, environment):
        return _dynfunc.make_function(
            described.lookup_module(), described.qualname, "", nowhere, environment, (library,)
        )

    # numba compiles a function anew for callers with other flags, a third of all in a unit.
    def independent_of_caller(template, types, keywords):
        with ConfigStack().enter(_flags_of_kernels()):
            return implementation(template, types, keywords)

    kind._library_class, CPUContext.get_executable = Part, never_called
    _OverloadFunctionTemplate._get_impl = independent_of_caller
    gc.disable()  # looking through numba's many small objects took a sixth of the time, and finds nothing to free
    try:
        yield
    finally:
        kind._library_class, CPUContext.get_executable = before, executable
        _OverloadFunctionTemplate._get_impl = implementation
        if collecting:
            gc.enable()


class Unit:
    """A function reached by its address, compiled when that is asked for: its module may serve other units too."""

    def __init__(self, function, signature):
        self.function, self.signature = function, signature
        self.symbol = f"{function.__module__}.{function.__name__}"  # its name in the object code

    @global_compiler_lock
    def compiled(self):
        """Object code that needs nothing of Python's or numba's, and so serves every version of them.

        numba's own `cfunc` would name a dozen symbols of both, for exceptions, which no kernel raises.
        """
        flags = _flags_of_kernels()
        types, target, (kinds, kind) = cpu_target.typing_context, cpu_target.target_context, self.signature
        with parts_that_wait():
            made = compile_extra(types, target, self.function, kinds, kind, flags, locals={})
        module = target.create_module(self.symbol)
        inner = ir.Function(module, target.call_conv.get_function_type(kind, kinds), made.fndesc.llvm_func_name)
        outer = ir.FunctionType(target.get_value_type(kind), [target.get_value_type(k) for k in kinds])
        own = ir.Function(module, outer, self.symbol)
        builder = ir.IRBuilder(own.append_basic_block())
        _, result = target.call_conv.call_function(builder, inner, kind, kinds, own.args)
        builder.ret(result)
        made.library.add_ir_module(module)
        # numba frees an array by a function whose name is that of the whole process, so that numba would call what
        # stands in for it here.
        return made.library.object_code().replace(b"NRT_MemInfo_call_dtor\0", NEVER_CALLED.encode() + b"\0")


def unit(restype, *arguments):
    """Decorator: a function of these numba types and Bundles, as a Unit."""
    kinds = [bundle_type(kind) if isinstance(kind, type) else kind for kind in arguments]
    return lambda function: Unit(function, (kinds, restype))
