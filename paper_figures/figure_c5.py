"""Contact figure 5: the slider-crank with a clearance joint against the ideal one."""

import numpy as np

from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, IDENTITY, clearance_joint, computed
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import IdealSliderCrank, slider_crank

NAME = "c5"
TITLE = "Slider-crank with a clearance joint"
CAPTION = """
Second revolution of the slider-crank with clearance 0.5 mm (left) and 1 mm (right) between rod and slider, at 200
rpm; Wang-Liu-Ma's contact, c_r = 0.9, modified Coulomb friction 0.01. Lengths and masses are the source's (Wang,
Liu, Ma 2016, Table 4); crank speed, rod's centre of mass, bearing radius 10 mm, joint length 15 mm, steel and
restitution are assumed, so that peak heights cannot be compared with the source's. Position and velocity are nearly
those of the ideal joint (grey, dashed), accelerations and torque carry the impacts: their axes are cut, and the
range of values is written in. The source's right column, an experiment, is left out: its data are not available.
Bottom: the journal's centre in its clearance circle. What one revolution shows is a matter of chance, the motion is
chaotic: how impacts depend on clearance and speed is judged over many, see the claims.
"""
CLEARANCES = (0.5e-3, 1e-3)
PERIOD, FRICTION = 0.3, 0.01
FIRST = {0.5e-3: 6.25854533558e-3, 1e-3: 8.86094991305e-3}  # first impacts (s): tests/reference/free_flight.py
SIZES = (0.1e-3, 0.25e-3, 0.5e-3, 1e-3)  # clearances, and speeds of the crank, of the statistics
SPEEDS = (60.0, 200.0, 400.0)


def run(clearance):
    """Two revolutions, and times in the second: the contacts last 0.2 ms and need their own points."""
    solution = slider_crank(clearance=clearance).solve((0, 2 * PERIOD), rtol=1e-9, dense_output=True)
    if not solution.success:
        raise RuntimeError(solution.message)
    ends = np.unique(np.concatenate([[PERIOD], solution.t[solution.t > PERIOD], [2 * PERIOD]]))
    ends = ends[np.diff(ends, prepend=0) > 1e-13]
    inner = ends[:-1, None] + np.diff(ends)[:, None] * np.linspace(1e-6, 1 - 1e-6, 12)
    return solution, inner.ravel()


def impacts(clearance, rpm, revolutions):
    """Of every ten revolutions but the first: (99th percentile of the impacts' speeds, largest |x''|)."""
    scene = slider_crank(clearance=clearance, rpm=rpm)
    state, found = scene.x0, []
    for block in range(revolutions // 10 + 1):
        span = 10 * scene.period * np.array([block, block + 1])
        solution = scene.solve(tuple(span), state, rtol=1e-9, dense_output=True)
        if not solution.success:
            raise RuntimeError(solution.message)
        state = solution.x[:, -1]
        # The column after a touch-down has latched its speed.
        at = np.searchsorted(solution.t, solution.event_times("reset", "touch-down")) + 1
        inner = (solution.t[:-1, None] + np.diff(solution.t)[:, None] * np.linspace(0.05, 0.95, 7)).ravel()
        speeds = solution["speed"][at] if len(at) else np.zeros(1)
        found.append((np.percentile(speeds, 99), np.abs(solution(inner, "acceleration")).max()))
    return np.array(found[1:])


def grows(sets):
    """(least rise of the means over its standard error, the means in words) of two columns."""
    means = np.array([rows.mean(axis=0) for rows in sets])
    errors = np.array([rows.std(axis=0, ddof=1) / np.sqrt(len(rows)) for rows in sets])
    rises = np.diff(means, axis=0) / np.hypot(errors[1:], errors[:-1])
    texts = [
        ", ".join(f"{m:.3g} +- {2 * e:.2g}" for m, e in zip(means[:, i], errors[:, i])) + unit
        for i, unit in enumerate((" m/s", " m/s^2"))
    ]
    return float(rises.min()), "99th percentile of the impacts' speeds " + texts[
        0
    ] + "; largest |x''| in ten revolutions " + texts[1]


def claims(runs, fast):
    """The published pictures in words, and the first impacts."""
    ideal = IdealSliderCrank()
    result = []
    peaks, gaps, worst = [], [], 0.0
    for clearance, (solution, times) in runs.items():
        on = solution.event_times("reset", "touch-down")
        result.append(
            Claim.number(
                f"c = {1e3 * clearance:g} mm: first impact (s)",
                FIRST[clearance],
                on[0],
                1e-12,
                digits=12,
                **computed("tests/reference/free_flight.py"),
            )
        )
        gaps.append(np.abs(solution(times, "x") - ideal.position(ideal.omega * times)).max() / clearance)
        peaks.append(np.abs(solution(times, "acceleration")).max())
        pressed, slip = solution(times, "normal"), solution(times, "slip")
        c_d = np.clip((np.abs(slip) - 1e-4) / 9e-4, 0, 1)
        off = np.abs(solution(times, "friction") - FRICTION * c_d * pressed * np.sign(slip)).max()
        worst = max(worst, off / np.abs(FRICTION * pressed).max())
    largest = np.abs(ideal.acceleration(np.linspace(0, 2 * np.pi, 721))).max()
    revolutions = 30 if fast else 100
    by_size, sizes = grows([impacts(c, 200.0, revolutions) for c in SIZES])
    by_rate, rates = grows([impacts(0.5e-3, rpm, revolutions) for rpm in SPEEDS])
    return [
        *result,
        Claim(
            "the friction force is F_T = -c_f c_d F_N sgn(V_T)",
            "c_d from 0 at v_0 to 1 at v_1",
            f"off by {worst:.1e} of its largest value along both runs",
            worst < 1e-9,
            "it is another force",
            **IDENTITY,
        ),
        Claim(
            "slider position nearly ideal",
            "nearly ideal",
            f"off by {gaps[0]:.3f} c and {gaps[1]:.3f} c at most",
            max(gaps) < 1.05,
            "it is not",
            **IDENTITY,
        ),
        Claim(
            "slider acceleration has sharp peaks on the ideal curve",
            "peaks",
            f"{peaks[0]:.0f} and {peaks[1]:.0f} m/s^2 on an ideal {largest:.1f}",
            min(peaks) > 5 * largest,
            "there are none",
            **clearance_joint("last figure"),
        ),
        Claim(
            f"impacts and peaks grow with the clearance, {revolutions} revolutions each",
            "grow with c = " + ", ".join(f"{1e3 * c:g}" for c in SIZES) + " mm",
            sizes,
            by_size > 2,
            "not by more than two standard errors",
            **EXPECTED,
        ),
        Claim(
            f"impacts and peaks grow with the speed of the crank, c = 0.5 mm, {revolutions} revolutions each",
            "grow with " + ", ".join(f"{rpm:g}" for rpm in SPEEDS) + " rpm",
            rates,
            by_rate > 2,
            "not by more than two standard errors",
            **EXPECTED,
        ),
    ]


def draw(fast):
    """Rows: position, velocity, acceleration, torque, orbit."""
    runs = {c: run(c) for c in CLEARANCES}
    ideal = IdealSliderCrank()
    figure = new_figure(6.2, 8.6)
    axes = figure.subplots(5, 2, height_ratios=(1, 1, 1, 1, 2.1))
    rows = (
        ("x", "position (m)", ideal.position, None),
        ("velocity", "velocity (m/s)", ideal.velocity, None),
        ("acceleration", r"acceleration (m/s$^2$)", ideal.acceleration, 300.0),
        ("torque", "torque (N m)", ideal.torque, 15.0),
    )
    for column, (clearance, (solution, times)) in zip(axes.T, runs.items()):
        angle = 360 * (times - PERIOD) / PERIOD
        phi = np.linspace(0, 2 * np.pi, 721)
        for ax, (name, label, exact, limit) in zip(column, rows):
            values = solution(times, name)
            ax.plot(angle, values, color="#0072B2", linewidth=0.9, label="with clearance")
            ax.plot(
                np.degrees(phi), exact(phi), color="#777777", linestyle="--", linewidth=1.1, label="ideal joint"
            )
            if limit:
                ax.set_ylim(-limit, limit)
                ax.text(
                    0.99,
                    0.95,
                    f"whole range {values.min():.0f} to {values.max():.0f}",
                    transform=ax.transAxes,
                    ha="right",
                    va="top",
                    fontsize=7,
                )
            ax.set(xlim=(0, 360), xticks=(0, 90, 180, 270, 360))
            ax.set_ylabel(label)
        column[0].set_title(f"clearance {1e3 * clearance:g} mm")
        column[3].set_xlabel("crank angle (deg)")
        ax = column[4]
        ax.plot(1e3 * solution(times, "e_x"), 1e3 * solution(times, "e_y"), color="#0072B2", linewidth=0.6)
        ax.plot(1e3 * clearance * np.cos(phi), 1e3 * clearance * np.sin(phi), color="#777777", linewidth=0.9)
        ax.set(aspect="equal", xlabel=r"journal in its bearing, $e_x$ (mm)", ylabel=r"$e_y$ (mm)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure, claims(runs, fast)
