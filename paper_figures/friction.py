"""The multistate friction model and its rival GMS under prescribed motion: what figures 4.8 to 4.11 draw.

The equations (4.13a-c) and every parameter besides those in the captions are reconstructed: the original was not
available. Units um, N, s.
"""

import numpy as np
import sympy as sp

from pwsmooth.laws.friction import GMS, MultistateXKY
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import prescribed_motion, t

SIZE, RATE = sp.symbols("size rate", positive=True)  # amplitude and frequency of the drive
NOTE = (
    "Reconstructed: equations (4.13a-c) and all parameters that the caption does not give (F_c = 1 N, F_s = 2 N, "
    "v_s = 8 um/s, kappa_i = 2.5/i N/um, lambda_i = 0.1, n = 10) are a best guess, so that this is no reproduction "
    "of the published curves."
)


def rig(law, *, t_span, position=None, velocity=None, **values):
    """The prescribed-motion scene of a drive with `size` and `rate`."""
    drive = position if position is not None else velocity
    used = {s: values.get(s.name, 1.0) for s in drive.free_symbols & {SIZE, RATE}}
    motion = {"position": position} if position is not None else {"velocity": velocity}
    return prescribed_motion(law, **motion, t_span=t_span, parameters=used)


def lag_panels(velocity, cases, times):
    """Figures 4.9 and 4.10: the drive over time, and the axes with force over velocity for every (rate, lag, colour).

    Returns the figure, those axes, and the runs by (rate, lag).
    """
    scene = rig(MultistateXKY(), velocity=velocity, t_span=(0, 2))
    runs = {(rate, lag): run(scene, rate=rate, tau_d=lag) for rate, lag, _ in cases}
    figure = new_figure(5.8, 3.4)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
    whole = np.linspace(0, 2, 4001)
    for rate, width in ((10, 0.5), (1, 1.6)):
        left.plot(whole, runs[rate, 0.02](whole, "velocity"), color=COLOUR["mark"], linewidth=width,
                  label=f"{rate} Hz")  # fmt: skip
    left.set(xlabel="time (s)", ylabel="velocity v (µm/s)", xlim=(0, 2))
    left.set_title("(a) input")
    left.legend(loc="upper left", bbox_to_anchor=(-0.15, -0.2), ncols=2, handlelength=1.5, columnspacing=0.8)
    for rate, lag, colour in cases:
        # The last cycle alone: ten cycles on one another are one broad line.
        cycle = times[times >= times[-1] - 1 / rate]
        v, force = (runs[rate, lag](cycle, name) for name in ("velocity", "force"))
        right.plot(
            v, force, "-" if lag == cases[0][1] else "--", color=colour, linewidth=1.7 if rate == 1 else 1.1,
            label=f"{rate} Hz, $\\tau_d$ = {lag} s",
        )  # fmt: skip
    right.set(xlabel="velocity v (µm/s)", ylabel="friction force f (N)")
    right.set_title("(b) force, last cycle")
    return figure, right, runs


def run(scene, **values):
    """A finished run with dense output, at other values of parameters."""
    system = scene.system
    values = {
        name: value for name, value in values.items() if name in system.groups or _is_parameter(system, name)
    }
    solution = scene.solve(dense_output=True, parameters=values)
    if not solution.success:
        raise RuntimeError(f"The run did not finish: {solution.message}")
    return solution


def _is_parameter(system, name):
    return any(str(p) == name for p in system.parameters)


def work(force, position):
    """Closed integral of f dx by the trapezoidal rule."""
    return float(np.trapezoid(force, position))


def events_between(solution, start, end):
    """Instants in an interval at which the count of presliding elements changes, with the new count."""
    times = np.unique(np.round([e.time for e in solution.events], 12))
    times = times[(times > start) & (times < end)]
    counts = solution(np.nextafter(times + 1e-9, np.inf), "presliding") if times.size else np.array([])
    before = solution(times - 1e-9, "presliding") if times.size else np.array([])
    changed = np.abs(counts - before) > 0.5
    return times[changed], np.round(counts[changed]).astype(int)


__all__ = ["GMS", "NOTE", "RATE", "SIZE", "MultistateXKY", "events_between", "rig", "run", "t", "work"]
