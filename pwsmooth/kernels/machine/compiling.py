"""How kernels are compiled: small functions, and units that meet through addresses.

numba links every callee into its caller and optimises the whole again, level by level: a deep call graph compiled
for minutes. So the loop is cut into a few *units*, compiled and cached once each and called through their address;
inside a unit, `kernel` functions are linked as usual. They are registered, not jitted: a jitted function would be
compiled anew for every literal argument.
"""

from numba import cfunc
from numba.extending import register_jitable

from .bundle import bundle_type

kernel = register_jitable(error_model="numpy")
# A few lines each, called every step: as calls they would cost more in passing arrays than in work.
inlined_kernel = register_jitable(error_model="numpy", forceinline=True, fastmath={"reassoc", "contract"})


def unit(restype, *arguments):
    """Decorator: a function of these numba types and Bundles, reached by its `.address`."""
    kinds = [bundle_type(kind) if isinstance(kind, type) else kind for kind in arguments]
    return cfunc(restype(*kinds), error_model="numpy")
