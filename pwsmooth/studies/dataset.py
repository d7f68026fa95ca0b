"""The Dataset of a sweep: dimensions, coordinates with units, variables, provenance."""

from __future__ import annotations

import functools
import json
import platform
from typing import TYPE_CHECKING, Any

import numpy as np

from .axes import POINT, Axes
from .plan import Plan
from .stored import fixed_width

if TYPE_CHECKING:
    import xarray


@functools.cache  # what this process has loaded, whatever becomes of the files
def version_items() -> dict[str, str]:
    """What computes: two sweeps of equal versions on one kind of processor give equal bits."""
    from importlib.metadata import PackageNotFoundError, version

    from ..codegen.machine.cache import sources_key, versions
    from ..codegen.machine.objects import machine_mark

    try:
        package = version("pwsmooth")
    except PackageNotFoundError:
        package = "unknown"
    # With the versions of Python, numpy, numba, llvmlite and sympy.
    return {
        "pwsmooth": package,
        "sources": sources_key(besides=versions()),
        "scipy": version("scipy"),
        "C library": "-".join(platform.libc_ver()),
        "processor": machine_mark(),
    }


def coordinates(plan: Plan, axes: Axes) -> dict[str, Any]:
    """Name -> (dims, values, attrs), in xarray's form."""
    names = {"parameter": "{}", "state": "initial {}", "time": "start time", "noise": "{} of the noise"}
    coords: dict[str, Any] = {}
    for name, (dim, values) in axes.values.items():
        attrs = {"long_name": names[axes.kinds[name]].format(name), "kind": axes.kinds[name]}
        if unit := plan.setting.unit(name):
            attrs["units"] = unit
        coords[name] = ((dim,), values, attrs)
    if axes.dims[0] == POINT:
        coords[POINT] = ((POINT,), np.arange(axes.shape[0]), {"long_name": "number of the point"})
    if any("switch" in v.dims for v in plan.variables.values()):
        coords["switch"] = (("switch",), np.array(plan.setting.switches, dtype=object), {})
    return coords


def attributes(plan: Plan, axes: Axes) -> dict[str, str]:
    """Provenance of the whole Dataset."""
    return {
        "title": "pwsmooth sweep",
        "identity": json.dumps(plan.identity(axes), indent=1),
        "versions": json.dumps(version_items(), indent=1),
    }


def make_dataset(plan: Plan, axes: Axes, arrays: dict[str, np.ndarray]) -> xarray.Dataset:
    """The Dataset of flattened arrays."""
    import xarray

    data = {}
    for name, v in plan.variables.items():
        data[name] = ((*axes.dims, *v.dims), fixed_width(arrays[name].reshape(*axes.shape, *v.shape)), v.attrs)
    return xarray.Dataset(data, coords=coordinates(plan, axes), attrs=attributes(plan, axes))
