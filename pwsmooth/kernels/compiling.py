"""How kernels are compiled: small functions, and units that meet through addresses.

numba links every callee into its caller and optimises the whole again, level by level: a deep call graph compiled
for a minute. So the loop is cut into a few *units*, compiled once each and called through their address (`UNITS` of
state.py holds them); inside a unit, `kernel` functions are linked as usual.
"""

from numba import cfunc, njit

kernel = njit(cache=True, error_model="numpy")


def unit(signature):
    """Decorator: a function with this signature, reached by its `.address`."""
    return cfunc(signature, cache=True, error_model="numpy")
