"""The whole numerical core compiled before it is needed: `pwsmooth warmup`."""

from ..codegen.machine.units import ALL, unit_addresses


def warm_up() -> int:
    """Compiles on all cores what no wheel and no earlier process has compiled; the number of parts that are ready."""
    return len(unit_addresses(ALL))
