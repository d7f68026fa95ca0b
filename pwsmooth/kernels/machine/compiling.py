"""How kernels are compiled: small functions, and units that meet through addresses.

numba links every callee into its caller and optimises the whole again, level by level: a deep call graph compiled
for minutes. So the loop is cut into a few *units*, compiled and cached once each and called through their address;
inside a unit, `kernel` functions are linked as usual. They are registered, not jitted: a jitted function would be
compiled anew for every literal argument.
"""

from llvmlite import ir
from numba.core.compiler import Flags, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.extending import overload, register_jitable

from . import NEVER_CALLED
from .bundle import bundle_type

kernel = register_jitable(error_model="numpy")
# A few lines each, called every step: as calls they would cost more in passing arrays than in work.
inlined_kernel = register_jitable(error_model="numpy", forceinline=True)


def loop_kernel(function):
    """Decorator: a part of a loop that is called once in it.

    numba copies it into the loop before that is compiled: no cost of a call (8 % of a step), nothing optimised twice.
    """
    overload(function, inline="always", strict=False, jit_options={"error_model": "numpy"})(
        lambda *args: function
    )
    return function


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
        flags = Flags()
        flags.error_model, flags.nrt = "numpy", True
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        types, target, (kinds, kind) = cpu_target.typing_context, cpu_target.target_context, self.signature
        made = compile_extra(types, target, self.function, kinds, kind, flags, locals={})
        module = target.create_module(self.symbol)
        inner = ir.Function(module, target.call_conv.get_function_type(kind, kinds), made.fndesc.llvm_func_name)
        outer = ir.FunctionType(target.get_value_type(kind), [target.get_value_type(k) for k in kinds])
        own = ir.Function(module, outer, self.symbol)
        builder = ir.IRBuilder(own.append_basic_block())
        _, result = target.call_conv.call_function(builder, inner, kind, kinds, own.args)
        builder.ret(result)
        made.library.add_ir_module(module)
        made.library.get_pointer_to_function(self.symbol)
        # numba has no public way to it. It frees an array by a function whose name is that of the whole process, so
        # that numba would call what stands in for it here.
        return made.library._get_compiled_object().replace(
            b"NRT_MemInfo_call_dtor\0", NEVER_CALLED.encode() + b"\0"
        )


def unit(restype, *arguments):
    """Decorator: a function of these numba types and Bundles, as a Unit."""
    kinds = [bundle_type(kind) if isinstance(kind, type) else kind for kind in arguments]
    return lambda function: Unit(function, (kinds, restype))
