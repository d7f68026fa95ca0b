"""How kernels are compiled: small functions, and units that meet through addresses.

numba links every callee into its caller and optimises the whole again, level by level: a deep call graph compiled
for minutes. So the loop is cut into a few *units*, compiled and cached once each and called through their address;
inside a unit, `kernel` functions are linked as usual. They are registered, not jitted: a jitted function would be
compiled anew for every literal argument.
"""

from functools import cached_property

from numba import cfunc
from numba.extending import overload, register_jitable

from .bundle import bundle_type

kernel = register_jitable(error_model="numpy")
# A few lines each, called every step: as calls they would cost more in passing arrays than in work.
inlined_kernel = register_jitable(error_model="numpy", forceinline=True, fastmath={"reassoc", "contract"})


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

    @cached_property
    def compiled(self):
        """numba's C function."""
        return cfunc(self.signature, error_model="numpy")(self.function)


def unit(restype, *arguments):
    """Decorator: a function of these numba types and Bundles, as a Unit."""
    kinds = [bundle_type(kind) if isinstance(kind, type) else kind for kind in arguments]
    return lambda function: Unit(function, restype(*kinds))
