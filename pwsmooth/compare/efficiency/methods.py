"""The methods of a comparison, by name.

Chain: own.py, rivals.py -> **this file** -> measuring.py, stability.
"""

from __future__ import annotations

from functools import partial

from . import rivals
from .contract import Method
from .own import event_driven, smoothed
from .rivals import event_ignoring, restarting, time_stepping

__all__ = ["METHODS", "Method"]

RTOLS = tuple(10.0**-k for k in range(6, 14))
LOOSE = tuple(10.0**-k for k in range(3, 13))
COARSE = LOOSE[:7:2]  # of methods that ignore events: tighter tolerances only take longer
STEPS = tuple(0.5**k for k in range(0, 14, 2))
# eps is an accuracy knob of its own: which tolerance goes with which eps is for the measurement to say.
WIDTHS = tuple((10.0**-k, 10.0**-j) for k in range(1, 11) for j in (3, 5, 7, 9) if j <= k + 4)
NARROW = tuple((10.0**-k, 10.0 ** -(k + 2)) for k in range(1, 8))  # tighter ones only take longer
ORDERS = (8, 12, 16, 20, 24, 28)

#: The methods by name, as `work_precision` takes them.
METHODS = {
    method.name: method
    for method in (
        Method("event-driven", "event-driven", "rtol", RTOLS, event_driven, options="as called by a user"),
        *(
            Method(f"event-driven, order {k}", "event-driven", "rtol", RTOLS, partial(event_driven, order=k))
            for k in ORDERS
        ),
        Method("event-driven, 8(5,3) pair", "event-driven", "rtol", RTOLS, partial(event_driven, method="rk")),
        Method("event-driven, stiff", "event-driven", "rtol", RTOLS, partial(event_driven, method="stiff"),
               options="implicit steps, where no switch slides"),
        Method("smoothed, algebraic", "smoothed", "(eps, rtol)", WIDTHS, smoothed),
        Method("smoothed, tanh", "smoothed", "(eps, rtol)", WIDTHS, partial(smoothed, sigmoid="tanh")),
        Method("DOP853, restarted", "SciPy", "rtol", LOOSE, partial(restarting, "DOP853"),
               options="terminal events, longest step bounded, right-hand side compiled"),
        Method("RK45, restarted", "SciPy", "rtol", LOOSE, partial(restarting, "RK45"), options="as DOP853"),
        Method("Radau, restarted", "SciPy", "rtol", LOOSE[:7:2], partial(restarting, "Radau"), options="as DOP853"),
        Method("DOP853, bare sign", "SciPy", "rtol", COARSE, partial(event_ignoring, "DOP853"), options="default"),
        Method("BDF, bare sign", "SciPy", "rtol", COARSE, partial(event_ignoring, "BDF"), options="default"),
        Method("Moreau-Jean", "time stepping", "step", STEPS, time_stepping, options="theta = 1/2, compiled"),
        Method("heyoka, events", "heyoka", "rtol", LOOSE[2:], rivals.heyoka_events, "heyoka",
               "terminal events, one compiled integrator a mode, sides as parameters, fast_math"),
        Method("heyoka, smoothed", "heyoka", "(eps, rtol)", NARROW, rivals.heyoka_smoothed, "heyoka",
               "algebraic sigmoid, fast_math"),
        Method("CVODE, events", "CVODE", "rtol", LOOSE, partial(rivals.cvode_events, "Adams"), "scikit-sundae",
               "Adams, root finding, restarted, longest step bounded"),
        Method("CVODE, bare sign", "CVODE", "rtol", COARSE, partial(rivals.cvode_ignoring, "BDF"), "scikit-sundae",
               "BDF"),
        Method("numbalsoda DOP853, events", "numbalsoda", "rtol", LOOSE, rivals.compiled_events, "numbalsoda",
               "terminal events, restarted by a compiled loop, longest step bounded"),
        Method("numbalsoda LSODA, bare sign", "numbalsoda", "rtol", COARSE, rivals.lsoda_ignoring, "numbalsoda",
               "compiled callback"),
        Method("diffrax, events", "diffrax", "rtol", LOOSE, rivals.diffrax_events, "diffrax",
               "Dopri8, PID controller, Newton on the event, one compiled solve for all modes, longest step bounded"),
        Method("diffrax, bare sign", "diffrax", "rtol", COARSE, rivals.diffrax_ignoring, "diffrax", "Dopri8"),
        Method("nosnoc, 2 stages", "nosnoc", "steps", (60, 120), partial(rivals.nosnoc_steps, 2), "nosnoc",
               "FESD, Radau IIA, Stewart's representation, 2 finite elements a step, complementarity 1e-9"),
        Method("nosnoc, 4 stages", "nosnoc", "steps", (60, 120), partial(rivals.nosnoc_steps, 4), "nosnoc",
               "as with 2 stages"),
        Method("solve_nivp", "solve_nivp", "rtol", LOOSE[:4], rivals.nivp, "solve_nivp",
               "composite method, projection on sign, semismooth Newton, Richardson's control"),
    )
}  # fmt: skip
