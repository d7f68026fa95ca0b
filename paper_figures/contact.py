"""What the contact figures share: colours and dashes of the laws, and an impact's curves on a fine grid."""

import numpy as np

# Okabe and Ito's palette; a law keeps its colour in every figure.
COLOUR = {
    "Kelvin-Voigt": "#D55E00",
    "Hunt-Crossley": "#0072B2",
    "linear residual": "#E69F00",
    "R1": "#009E73",
    "R2": "#CC79A7",
    "Lankarani-Nikravesh": "#56B4E9",
    "Wang-Liu-Ma": "#000000",
    "Hertz": "#999999",
    "Wang-Liu 2015": "#B2182B",
    "Flores": "#7A5195",
    "Bai": "#8C6D31",
    "rigid": "#555555",
}
# In grey the dashes tell the laws apart.
DASH = {
    "Kelvin-Voigt": (0, (6, 1.5)),
    "Hunt-Crossley": "--",
    "linear residual": (0, (3, 1, 1, 1)),
    "R1": "-",
    "R2": (0, (1, 1)),
    "Lankarani-Nikravesh": "-.",
    "Wang-Liu-Ma": "-",
    "Hertz": "-",
    "Wang-Liu 2015": ":",
    "Flores": (0, (3, 1, 1, 1, 1, 1)),
    "Bai": (0, (8, 2)),
    "rigid": "-",
}


def contact_curves(scene, *, names=("p", "v", "force"), count=1500, **options):
    """(first contact's times, its curves): closer at both ends, the last point still on the contact's side."""
    solution = scene.solve(
        **(dict(rtol=1e-10, atol=[1e-14] * len(scene.system.states), dense_output=True) | options)
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    on, off = solution.event_times("reset", "touch-down"), solution.event_times("reset", "lift-off")
    start = on[0] if len(on) and (not len(off) or on[0] < off[0]) else solution.t[0]
    end = off[0] if len(off) else solution.t[-1]
    times = start + (end - start) * (1 - np.cos(np.linspace(0, np.pi, count))) / 2
    times[-1] = end - 1e-9 * (end - start)  # where the force is 0 to rounding its power may not exist
    return times, *(solution(times, name) for name in names)
