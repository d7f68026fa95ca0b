"""Every page of the gallery runs, and its numbers are those of a closed form or of a computation by other means.

The references use nothing of the package: matrix exponentials, or DOP853 restarted at every event by loops here.
"""

import functools
import re
import runpy
import warnings
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from scipy.special import expit

GALLERY = Path(__file__).resolve().parents[2] / "docs" / "gallery"


@functools.cache
def page(name, folder="gallery/*"):
    """The names that a page's script leaves behind."""
    from matplotlib import pyplot

    (path,) = GALLERY.parent.glob(f"{folder}/plot_{name}.py")
    backend = matplotlib.get_backend()
    pyplot.switch_backend("Agg")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "FigureCanvasAgg is non-interactive")
            names = runpy.run_path(str(path))
        assert pyplot.get_fignums(), f"{name} draws nothing"
        return names
    finally:
        pyplot.close("all")
        pyplot.switch_backend(backend)


def until(rates, x, t, end, *surfaces, max_step=0.02):
    """DOP853 from (t, x) to `end` or the first zero of a surface h(t, x), given with its direction (h, sign).

    Steps are short because SciPy looks for zeros by the sign at their ends.
    """
    watched = []
    for surface, direction in surfaces:

        def event(s, y, surface=surface):
            return surface(s, y)

        event.terminal, event.direction = True, direction
        watched.append(event)
    run = solve_ivp(
        rates, (t, end), x, method="DOP853", rtol=1e-12, atol=1e-13, max_step=max_step, events=watched or None
    )
    fired = next((k for k, times in enumerate(run.t_events or []) if len(times)), None)
    return run.t[-1], run.y[:, -1], fired


def stick_slip(pull, strengths, weakening, V, x, end, section=None):
    """Blocks of mass 1 under pull(t, positions) on a ground of speed V, its friction strength/(1 + weakening |w|).

    The state at `end` or at the section's first rise, and the times of all events.
    """
    n = len(strengths)

    def slip(i, t, x):
        force = pull(t, x[:n])[i]
        return -int(np.sign(force)) if abs(force) > strengths[i] else 0

    t, x, log = 0.0, np.array(x, float), []
    slips = [int(np.sign(V - x[n + i])) or slip(i, t, x) for i in range(n)]
    while True:

        def rates(t, x, slips=tuple(slips)):
            forces = pull(t, x[:n])
            return [V if not s else v for s, v in zip(slips, x[n:])] + [
                s and f + s * strength / (1 + weakening * abs(V - v))
                for s, f, strength, v in zip(slips, forces, strengths, x[n:])
            ]

        surfaces = [
            ((lambda t, x, i=i: V - x[n + i]), -slips[i])
            if slips[i]
            else ((lambda t, x, i=i: abs(pull(t, x[:n])[i]) - strengths[i]), 1)
            for i in range(n)
        ]
        if section:
            surfaces.append((section, 1))
        t, x, fired = until(rates, x, t, end, *surfaces, max_step=0.1 if any(slips) or section else 100.0)
        if fired in (None, n):
            return x, log
        log.append(t)
        if slips[fired]:
            x[n + fired], slips[fired] = V, slip(fired, t, x)
        else:
            slips[fired] = -int(np.sign(pull(t, x[:n])[fired]))


def test_every_page_is_tested():
    named = set(re.findall(r'page\("(\w+)"\)', Path(__file__).read_text(encoding="utf-8")))
    assert named == {path.stem.removeprefix("plot_") for path in GALLERY.glob("*/plot_*.py")}


def test_both_columns_of_the_page_for_newcomers_find_the_same():
    text = (GALLERY.parent / "coming_from.md").read_text(encoding="utf-8")
    theirs, ours, ball = re.findall(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    names = {}
    exec(theirs, names)
    sticks = names["sticks"]
    exec(ours, names)
    np.testing.assert_allclose(names["sol"].event_times("stick"), sticks, rtol=0, atol=1e-7)
    exec(ball, names)
    np.testing.assert_allclose(names["rests"], 2 * 20 / 9.8 / (1 - 0.9), rtol=1e-9)


# ---- mechanics and machines


def test_the_bouncing_ball_flips_where_the_closed_form_says():
    ball = page("bouncing_ball")
    assert abs(ball["flip"].parameter - ball["exact"]) < 1e-9
    # Phase of the bounce: the table's speed there is pi (1 - e)/(1 + e), so that e returns the ball to its height.
    orbit = ball["orbit"].solution()
    (bounce,) = orbit.event_times("impact")
    assert abs(1.4 * np.cos(bounce) - np.pi / 3) < 1e-9


def test_the_rocking_block_is_at_rest_when_its_infinite_sum_says():
    rocking = page("rocking_block")
    last = rocking["sol"].events[-1]
    assert last.kind == "accumulation" and abs(last.time - rocking["exact"]) < 1e-9
    assert np.all(rocking["sol"](np.linspace(last.time, 16, 9)) == 0)


def test_the_gears_lose_contact_where_the_linear_amplitude_says_and_move_as_dop853_says():
    gears = page("gear_backlash")
    grazings = [b.parameter for b in gears["branch"].of_kind("grazing")]
    np.testing.assert_allclose(grazings, gears["exact"], rtol=0, atol=1e-8)
    assert len(gears["branch"].of_kind("fold")) == 2
    # Orbits that lose contact, stable and unstable, return after a period of SciPy's as well.
    loose = [o for o in gears["branch"].points if len(o.word) == 2][::5]
    assert {o.stable for o in loose} == {True, False}
    for orbit in loose:
        omega = 2 * np.pi / orbit.period

        def rates(t, x, omega=omega):
            g = x[0] - 1 if x[0] > 1 else x[0] + 1 if x[0] < -1 else 0.0
            return [x[1], 0.1 + 0.05 * np.cos(omega * t) - 0.1 * x[1] - g]

        start = orbit.map.start_time
        _, x, _ = until(rates, orbit.x, start, start + orbit.period)
        # g is continuous: DOP853 crosses its kinks with an error of the third order of the step.
        assert np.abs(x - orbit.x).max() < 1e-6


def test_the_drill_string_sticks_and_slips_up_to_where_a_slip_of_dop853_just_touches_rest():
    J, k, c, T_c, T_s, omega_s = 400.0, 500.0, 150.0, 4000.0, 7000.0, 2.0

    def lowest(Omega):
        """Speed at the end of the slip that begins where the stick ends: 0 where the stick has length 0."""

        def rates(t, x):
            torque = T_c + (T_s - T_c) * np.exp(-max(x[1], 0) / omega_s)
            return [Omega - x[1], (k * x[0] + c * (Omega - x[1]) - torque) / J]

        def acceleration(t, x):
            return rates(t, x)[1]

        t, x, _ = until(rates, [(T_s - c * Omega) / k, 0], 0, 20, (acceleration, -1))
        return until(rates, x, t, 20, (acceleration, 1))[1][1]

    exact = brentq(lowest, 6.5, 7.5, xtol=1e-10)
    drill = page("drill_string")
    assert abs(drill["highest"] - exact) < 1e-5
    assert drill["branch"].of_kind("grazing-sliding")
    # The unstable branch leads to the Hopf point, as a square root does.
    last = drill["branch"].points[-1]
    assert drill["size"][-1] < 0.5 and abs(last.system.parameter_values[-1] - drill["hopf"]) < 0.02


@pytest.mark.thorough
def test_the_two_masses_double_their_period_where_a_map_of_dop853_has_the_multiplier_minus_one():
    blocks = page("two_masses_on_belt")
    V, kappa = blocks["flip"].parameter, 1.2
    K = np.array([[1 + kappa, -kappa], [-kappa, 1 + kappa]])

    def section(t, x):
        return x[0] - x[1] if t > 1 else 1.0  # not where it starts

    def image(y):
        """The return to x1 = x2 from (x, V, x, v2): block 1 sticks there."""
        start = [y[0], y[0], V, y[1]]
        x, _ = stick_slip(lambda t, u: -K @ u, [1, 1.3], 3.0, V, start, 20.0, section)
        return x[[0, 3]]

    y = blocks["flip"].orbit.x[[0, 3]]
    assert np.abs(image(y) - y).max() < 1e-7
    h = 1e-5
    jacobian = np.column_stack([(image(y + h * e) - image(y - h * e)) / (2 * h) for e in np.eye(2)])
    assert abs(np.linalg.eigvals(jacobian).real.min() + 1) < 1e-4


def test_the_antilock_brake_stops_where_dop853_does_and_the_locked_wheel_where_its_line_ends():
    brake = page("antilock_brake")
    assert abs(brake["locked"]["x"][-1] - brake["exact"]) < 1e-6
    m, j, g = 400.0, 10.0, 9.81

    def force(x):
        s = 1 - x[2] / x[1]
        return m * g * (1.28 * (1 - np.exp(-24 * s)) - 0.52 * s)

    t, x, valve, holds = 0.0, np.array([0, 30, 30, 0.0]), 1, False
    while True:

        def rates(t, x, valve=valve, holds=holds):
            f = force(x)
            return [x[1], -f / m, 0.0 if holds else (f - x[3]) / j, 2e4 * valve]

        t, x, fired = until(
            rates, x, t, 9,
            (lambda t, x: 1 - x[2] / x[1] - 0.25, 1) if valve > 0 else (lambda t, x: 1 - x[2] / x[1] - 0.1, -1),
            (lambda t, x: x[1] - 1, -1),
            (lambda t, x: force(x) - x[3], 1) if holds else (lambda t, x: x[2], -1),
        )  # fmt: skip
        if fired == 0:
            valve = -valve
        elif fired == 1:
            break
        else:
            holds, x[2] = not holds, 0.0
    assert abs(brake["antilock"]["x"][-1] - x[0]) < 1e-6
    assert len(brake["antilock"].event_times("stick")) >= 2


def test_the_force_of_the_lugre_law_is_that_of_radau_and_its_parameters_are_found():
    from scipy.interpolate import CubicSpline

    lugre = page("lugre_fit")
    t, true = lugre["t"], lugre["true"]
    position = CubicSpline(t, lugre["x"])

    def rate(t, z):
        v = position(t, 1)
        g = true.F_c + (true.F_s - true.F_c) * np.exp(-((v / true.v_s) ** 2))
        return v - true.sigma0 * abs(v) / g * z

    run = solve_ivp(rate, (0, 2), [0.0], method="Radau", rtol=1e-8, atol=1e-13, t_eval=t, max_step=5e-3)
    force = true.sigma0 * run.y[0] + true.sigma1 * rate(t, run.y[0]) + true.sigma2 * position(t, 1)
    assert np.abs(force - lugre["exact"]).max() < 1e-4
    found = lugre["found"]
    assert found.success and all(
        abs(value - getattr(true, name)) < 3 * found.errors[name] for name, value in found.values.items()
    )


# ---- control and electronics


def test_the_buck_converter_flips_where_its_saltation_matrix_says():
    T, R, L, C, gain = 0.4, 22, 20, 0.047, 8.4
    A = np.array([[-1 / (R * C), 1e-3 / C], [-1e3 / L, 0]])
    ramp = (8.2 - 3.8) / T

    def multiplier(E):
        """The smallest of the orbit that conducts from tau to the next clock."""
        drive = np.array([0, 1e3 * E / L])
        rest = np.linalg.solve(A, -drive)

        def at_switching(tau):
            on, off = expm(A * (T - tau)), expm(A * tau)
            return off @ np.linalg.solve(np.eye(2) - on @ off, rest - on @ rest)

        tau = brentq(lambda s: gain * (at_switching(s)[0] - 11.3) - 3.8 - ramp * s, 1e-6, T - 1e-6, xtol=1e-14)
        normal = np.array([gain, 0])
        salt = np.eye(2) + np.outer(drive, normal) / (normal @ (A @ at_switching(tau)) - ramp)
        return np.linalg.eigvals(expm(A * (T - tau)) @ salt @ expm(A * tau)).real.min()

    exact = brentq(lambda E: multiplier(E) + 1, 23, 26, xtol=1e-12)
    assert abs(page("buck")["flip"].parameter - exact) < 1e-7


def test_chuas_circuit_agrees_with_dop853_and_its_exponents_with_the_mean_divergence():
    chua = page("chua")

    def rates(side):
        slope, offset = (-8 / 7, 0) if side == 0 else (-5 / 7, -3 / 7 * side)
        return lambda t, x: [
            9 * (x[1] - x[0] - slope * x[0] - offset),
            x[0] - x[1] + x[2],
            -100 / 7 * x[1],
        ]

    right, left = lambda t, x: x[0] - 1, lambda t, x: x[0] + 1
    borders = {0: [((right, 1), 1), ((left, -1), -1)], 1: [((right, -1), 0)], -1: [((left, 1), 0)]}
    t, x, side, passages = 0.0, [0.1, 0, 0], 0, []
    while True:
        t, x, fired = until(rates(side), x, t, 15, *(surface for surface, _ in borders[side]))
        if fired is None:
            break
        side = borders[side][fired][1]
        passages.append(t)
    ours = chua["sol"].event_times()[: len(passages)]
    # The motion is chaotic: what DOP853 leaves open has grown by exp(0.32 * 15) and more.
    assert len(passages) > 5 and np.abs(ours - passages).max() < 1e-8
    assert np.abs(chua["sol"](15.0) - x).max() < 1e-8
    found = chua["found"]
    assert abs(found.exponents[1]) < 3 * found.errors[1] and found.exponents[0] > 10 * found.errors[0]
    assert abs(found.exponents.sum() - chua["divergence"]) < 3 * np.linalg.norm(found.errors)


def test_the_thermostat_cycles_as_its_exponentials_do_and_over_a_day_as_dop853_says():
    room = page("thermostat")
    assert abs(room["period"] - room["exact"]) < 1e-9
    t, x, on, log = 0.0, [19.0], 1, []
    while True:

        def rates(t, x, on=on):
            return [-(x[0] - 4 - 6 * np.cos(2 * np.pi * (t - 15) / 24)) / 8 + 5 * on]

        surface = (lambda t, x: x[0] - 21, 1) if on else (lambda t, x: x[0] - 19, -1)
        t, x, fired = until(rates, x, t, 48, surface)
        if fired is None:
            break
        on = 1 - on
        log.append(t)
    np.testing.assert_allclose(room["sol"].event_times(), log, rtol=0, atol=1e-7)


def test_the_motor_breaks_loose_at_its_peak_current_and_creeps_as_dop853_says():
    motor = page("dc_motor")
    assert motor["loose"].kind == "adding-sliding"
    assert abs(motor["loose"].parameter - motor["exact"]) < 1e-9
    # One period of the creep at d = 0.6: stick, slip from k i = M_c on, stick again where the speed is back at 0.
    U, R, L, k, J, b, M_c, T, d = 12.0, 1.0, 2e-3, 0.05, 1e-4, 1e-4, 0.15, 1e-3, 0.6
    x, slipping, travel = np.zeros(3), False, None
    for clock in range(60):
        for begin, end, volts in ((0, d, U), (d, 1, -U)):
            t = (clock + begin) * T
            while t < (clock + end) * T:

                def rates(t, x, volts=volts, slipping=slipping):
                    force = (k * x[0] - b * x[1] - M_c) / J if slipping else 0.0
                    return [(volts - R * x[0] - k * x[1]) / L, force, x[1]]

                surface = (lambda t, x: x[1], -1) if slipping else (lambda t, x: k * x[0] - M_c, 1)
                t, x, fired = until(rates, x, t, (clock + end) * T, surface, max_step=T / 20)
                if fired is not None:
                    slipping, x[1] = not slipping, 0.0
        travel, x[2] = x[2], 0.0
    duty = motor["duty"]
    ours = float(motor["found"]["omega_mean"][np.argmin(np.abs(duty - d))])
    assert abs(ours / (travel / T) - 1) < 1e-5


def test_the_relay_orbit_folds_where_the_map_of_its_slides_touches_the_diagonal():
    zeta, omega, kappa = 0.05, 10.0, 0.05

    def first(A, x, zero, end=3.0):
        """State at the first fall of `zero` through 0 along x' = A x."""
        flow = [expm(A * end / 600)]
        before = x
        for k in range(600):
            after = flow[0] @ before
            if k and zero(before) > 0 >= zero(after):
                s = brentq(lambda s, x=before: zero(expm(A * s) @ x), 0, end / 600, xtol=1e-15)
                return expm(A * s) @ before
            before = after
        return np.full(len(x), np.nan)

    def half_return(x3, rho):
        """x3 where the second slide from (0, 1, x3) ends, at (0, -1, x3), mirrored."""
        process = np.array(
            [
                [-2 * zeta * omega - kappa, 1, 0, -1],
                [-2 * zeta * omega * kappa - omega**2, 0, 1, -2 * rho],
                [-(omega**2) * kappa, 0, 0, -(rho**2)],
                [0, 0, 0, 0],
            ]
        )
        zeros = np.array([[-2 * rho, 1], [-(rho**2), 0]])
        for end in (1, -1):
            _, *slide, _ = first(process, np.array([0, 1, x3, 1.0]), lambda x: x[0])
            _, x3 = first(zeros, np.array(slide), lambda x, end=end: 1 - end * x[0])
        return -x3

    def gap(rho):
        """Smallest value of the map minus its argument: negative between two fixed points."""
        found = minimize_scalar(
            lambda x3: half_return(x3, rho) - x3, bounds=(2, 5), method="bounded", options={"xatol": 1e-9}
        )
        return found.fun

    fold = brentq(gap, -2.4, -2.2, xtol=1e-9)
    assert abs(page("relay_feedback")["fold"].parameter - fold) < 1e-7


def test_twisting_comes_to_rest_when_its_series_says_and_switches_when_dop853_says():
    twisting = page("twisting")
    assert abs(twisting["reached"] - twisting["exact"]) < 1e-9
    t, x, log = 0.0, np.array([0.0, 1.0]), []
    sx, sv = 1, 1
    while len(log) < 16:

        def rates(t, x, force=-2.0 * sx - sv):
            return [x[1], 0.8 * np.sin(2 * t) + force]

        t, x, fired = until(rates, x, t, 6, (lambda t, x: x[0], -sx), (lambda t, x: x[1], -sv))
        sx, sv = (-sx, sv) if fired == 0 else (sx, -sv)
        log.append(t)
    assert np.abs(twisting["run"].event_times()[:16] - log).max() < 1e-8
    assert np.all(twisting["run"](twisting["times"]) == 0)


def test_super_twisting_reaches_its_surface_when_its_linear_oscillator_says_and_stays_there():
    control = page("super_twisting")
    assert abs(control["reached"] - control["exact"]) < 1e-7
    run = control["run"]
    rest = run.event_times("accumulation")[-1]
    assert np.all(run(np.linspace(rest, 8, 50), "s") == 0)

    # Up to the first return to s = 0 in zeta = sqrt|s|, whose equations have no root: ds = 2 zeta dzeta.
    def rates(tau, y):
        zeta, w, t = y
        return [-1.5 * zeta + w, 2 * zeta * (-1.1 + 0.5 * np.cos(t)), 2 * zeta]

    _, y, _ = until(rates, [0, 1, 0], 0, 20, (lambda tau, y: y[0], -1))
    assert abs(run.event_times("crossing")[0] - y[2]) < 1e-8


# ---- earth, climate and life


def test_three_blocks_of_the_fault_slip_when_dop853_says():
    from pwsmooth import solve

    n, ell, alpha, nu, end = 3, 3.0, 2.5, 0.01, 250.0
    u0 = [0.1, -0.2, 0.3]
    ours = solve(page("burridge_knopoff")["fault"](n), (0, end), {"u": u0, "v": 0.0})
    K = ell**2 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]]) + np.eye(n)
    x, log = stick_slip(lambda t, u: nu * t - K @ u, [1, 1, 1], 2 * alpha, 0.0, [*u0, 0, 0, 0], end)
    times = ours.event_times()
    assert len(log) == len(times) > 20
    assert np.abs(times - log).max() < 1e-6
    assert np.abs(ours.x[:n, -1] - x[:n]).max() < 1e-6


def test_the_fault_keeps_up_with_the_plate_by_a_few_large_earthquakes():
    fault = page("burridge_knopoff")
    # Springs between blocks pull as much to both sides: while all stick their mean lags behind the plate by the mean
    # friction, which is -1 to 1. So it may have changed by 2 in the 1500 units of time that are looked at.
    assert abs(fault["speed"] - 0.01) < 2 / 1500 and fault["largest"] > 0.9


def test_neurons_spike_when_their_exponentials_say_and_end_in_the_common_beat():
    from pwsmooth import solve

    neurons = page("spiking_neurons")
    assert abs(neurons["beat"] - neurons["exact"]) < 1e-6
    n, I, epsilon, tau, end = 6, 1.1, 0.4, 0.05, 40.0
    v = np.random.default_rng(3).uniform(0, 1, n)
    ours = solve(neurons["network"](n), (0, end), {"v": list(v), "s": 0})
    t, s, log = 0.0, 0.0, []

    def later(v, s, wait):
        rest, fast = np.exp(-wait), np.exp(-wait / tau)
        return I + (v - I) * rest + s * (rest - fast) / (1 / tau - 1)

    while True:  # all charge alike: the fullest is the next
        k = int(np.argmax(v))
        wait = brentq(lambda wait, v=v[k], s=s: later(v, s, wait) - 1, 0, 10, xtol=1e-15) if v[k] < 1 else 0.0
        if t + wait > end:
            break
        t, v, s = t + wait, later(v, s, wait), s * np.exp(-wait / tau)
        v[k], s = 0.0, s + epsilon / n
        log.append((t, f"spike {k + 1}"))
    assert [e.switch for e in ours.events] == [name for _, name in log]
    assert np.abs(ours.event_times() - [t for t, _ in log]).max() < 1e-8


def test_predators_slide_to_the_pseudo_equilibrium_as_the_linear_equation_says():
    world = page("predator_prey")
    sol = world["sol"]
    (arrival,) = sol.event_times("stick")

    def hunting(t, x):
        return [x[0] * (1 - x[0] / 4) - x[0] * x[1], 0.5 * x[0] * x[1] - 0.4 * x[1]]

    t, x, _ = until(hunting, [2.5, 0.3], 0, 60, (lambda t, x: x[0] - 1, -1))
    assert abs(t - arrival) < 1e-8
    times = np.linspace(arrival, 60, 7)
    exact = 1 + (x[1] - 1) * np.exp(-0.3 * (times - t))  # y* = 1 and m - b = 0.3 of the page
    assert np.abs(sol(times, "y") - exact).max() < 1e-8 and np.all(sol(times[1:], "x") == 1)
    assert abs(sol["u"][-1] - 0.75) < 1e-8 and abs(world["exact"] - 1) < 1e-12


def test_the_ocean_reverses_where_airy_functions_say_and_returns_as_dop853_says():
    ocean = page("ocean_boxes")
    assert abs(ocean["reversal"] - ocean["exact"]) < 1e-6
    mu = 1e-3

    def drier(t, x):
        return [0.25 + mu * (200 - t) - abs(1 - x[0]) * x[0]]

    t, x = 100.0, [float(ocean["sol"](100.0, "S"))]
    t, x, _ = until(drier, x, t, 520, (lambda t, x: x[0] - 1, -1), max_step=1.0)
    assert abs(t - ocean["sol"].event_times("crossing")[-1]) < 1e-6


def test_the_storey_moves_as_dop853_says_and_its_energy_balances():
    from scipy.interpolate import CubicSpline

    storey = page("earthquake_response")
    end = storey["sol"].x[:, -1]
    assert abs(storey["sol"]["E_in"][-1] - storey["spent"][-1]) < 1e-8
    omega, zeta, alpha, beta, x_y = 4 * np.pi, 0.02, 0.1, 0.6, 0.01
    record = CubicSpline(storey["times"], storey["record"])

    def rates(t, y):
        x, v, z = y
        a = -record(t) - 2 * zeta * omega * v - omega**2 * (alpha * x + (1 - alpha) * z)
        return [v, a, v - (beta * abs(v) * z + (1 - beta) * v * abs(z)) / x_y]

    # Its kinks are crossed in steps that are short instead of located.
    _, y, _ = until(rates, [0, 0, 0], 0, 20, max_step=4e-3)
    assert np.abs(y - end[:3]).max() < 1e-6 * np.abs(storey["sol"].x[:3]).max()


def test_a_rate_and_state_slider_loses_creep_where_its_jacobian_does():
    found = page("rate_and_state")["found"]
    a, b, m = 0.01, 0.016, 0.002  # L = V = 1

    def growth(k):
        rates = [[0, -1, 0], [k / m, -a / m, -b / m], [0, -1, -1]]
        return np.linalg.eigvals(rates).real.max()

    expected = brentq(growth, 0.005, 0.01, xtol=1e-14)
    assert set(found) == {"aging", "slip"}
    for hopf in found.values():
        assert hopf.kind == "Hopf" and abs(hopf.parameter - expected) < 1e-11


def test_genes_settle_where_steep_hill_functions_do():
    sol = page("gene_network")["sol"]
    found = np.array([sol["Z1"][-1], sol["Z2"][-1]])
    assert np.abs([found.sum() - 2 * found.prod() - 0.6, 1 - found.prod() - 0.9]).max() < 1e-10

    def rates(_, x):
        above = expit(4000 * np.log(x))  # x^n/(1 + x^n)
        return [above.sum() - 2 * above.prod() - 0.6 * x[0], 1 - above.prod() - 0.9 * x[1]]

    run = solve_ivp(rates, (0, 40), [0.3, 0.2], method="Radau", rtol=1e-8, atol=1e-10)
    assert np.abs(expit(4000 * np.log(run.y[:, -1])) - found).max() < 1e-3


def test_a_decision_is_taken_at_the_largest_value_of_the_relay_and_changed_as_without_hidden_terms():
    runs, decided = (page("decision")[name] for name in ("runs", "decided"))
    for rho, run in runs.items():
        top = -minimize_scalar(
            lambda q, rho=rho: -q * (1 + rho * (1 - q * q)),
            bounds=(0, 1),
            method="bounded",
            options={"xatol": 1e-12},
        ).fun
        assert abs(2.5 * np.sin(decided[rho] / 20) - max(top, 1.0)) < 1e-9

        def rates(t, x):
            return [2 * (-x[0] + 2.5 * np.sin(t / 20) - 1)]

        begin = decided[rho] + 1  # past the zero from which it starts
        x = solve_ivp(rates, (decided[rho], begin), [0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        back, _, _ = until(rates, x, begin, 100, (lambda t, x: x[0], -1))
        hesitates = [s.start for s in run.segments if s.status[0] == 0][1]
        assert abs(hesitates - back) < 1e-8


def test_an_adhering_block_slips_and_stops_where_two_loops_say():
    names = page("adhesion")

    def hold(t, adhesion):
        return 0.5 * max(0.0, 1 + 1.2 * np.sin(2 * t) + adhesion)

    slip = names["run"].segments[1]
    begins = brentq(lambda t: hold(t, 0.3) - 0.3, 1.0, 2.3, xtol=1e-14)

    def gained(t):
        return 0.3 * (t - begins) - 0.5 * (1.3 * (t - begins) - 0.6 * (np.cos(2 * t) - np.cos(2 * begins)))

    stops = brentq(gained, begins + 0.5, begins + 2.5, xtol=1e-14)
    assert abs(slip.start - begins) < 1e-11 and abs(slip.end - stops) < 1e-11
    assert abs(names["holds"] - 0.8) < 1e-12  # mu (N_0 (1 - q) + N_a) = P
    moved = names["far"][names["adhesions"] < 0.79]
    assert np.all(moved > 0) and np.all(names["far"][names["adhesions"] > 0.8] == 0)


def test_a_tip_jumps_late_by_the_power_of_a_passed_fold():
    names = page("afm_tip")
    assert abs(names["exponent"] - 2 / 3) < 0.002

    def rates(t, x):
        return [x[1], 1e-2 * t - x[0] - 3 * np.sin(x[0]) - 4 * x[1]]

    t, x = 0.0, [0.0, 0.0]
    for jump in range(3):
        t, x, _ = until(
            rates, x, t, 2000, (lambda t, x, top=np.pi * (2 * jump + 1): x[0] - top, 1), max_step=1.0
        )
    fold = np.arccos(-1 / 3) + np.sqrt(8.0)
    assert abs(1e-2 * t - fold - 4 * np.pi - names["late"][-1]) < 1e-8


def work_of_friction(run, pairs):
    """The work between start and end that outputs (force, velocity) take, by Gauss and Legendre between events."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    times = np.unique(np.concatenate([run.t, *(np.linspace(s.start, s.end, 60) for s in run.segments)]))
    total = 0.0
    for a, b in zip(times, times[1:]):
        at = (a + b) / 2 + (b - a) / 2 * nodes
        total += (b - a) / 2 * sum(run(at, force) * run(at, speed) for force, speed in pairs) @ weights
    return total


def test_the_energy_of_each_mechanism_goes_into_its_friction():
    found = page("mechanisms")
    for name, pairs in (
        ("swing", [("friction shoulder", "u1"), ("friction elbow", "u2")]),
        ("turning", [("friction", "slip")]),
        ("fall", [("friction a", "a_dot")]),
        ("thrown", [("friction", "slip")]),
    ):
        run = found[name]
        lost = run["energy"][0] - run["energy"][-1]
        assert lost > 0.5, name
        assert abs(lost - work_of_friction(run, pairs)) < 1e-9, name
        assert run.event_times("stick").size, name


def test_each_mechanism_takes_25_lines_from_its_model_to_its_picture():
    (path,) = GALLERY.glob("*/plot_mechanisms.py")
    _, _, *sections = re.split(r"^# %%$", path.read_text().partition('"""\n\n')[2], flags=re.M)
    sections = [path.read_text().partition("# %%\n")[2].partition("# %%\n")[0], *sections]
    for section in sections:
        lines = [line for line in section.splitlines() if line.strip() and not line.startswith("#")]
        assert 10 < len(lines) <= 25 + 6 * ("import sympy" in section), lines


def test_the_disc_rolls_when_its_slip_is_used_up():
    """v' = -mu g (1 + 2) of a disc."""
    run = page("mechanisms")["thrown"]
    assert abs(run.events[0].time - 8 / (9 * 0.981)) < 1e-12


def test_painleves_rod_answers_as_the_signs_of_its_closed_form():
    found = page("painleve_rod")
    a = found["a"](found["angles"])[None, :] * np.ones_like(found["rates"])[:, None]
    b = found["b"](found["angles"][None, :], found["rates"][:, None])
    expected = np.where(
        a > 0, np.where(b < 0, "slides", "parts"), np.where(b < 0, "inconsistent", "indeterminate")
    )
    assert np.array_equal(expected, found["answers"])
    assert {run.outcome.name for run in found["jams"]} == {"JAM"}


def test_the_stiff_springs_of_painleves_rod_have_the_limit_of_a_tangential_impact():
    """What is away from it is due to the weight during the impact, whose length is arccosh(sqrt(k)...)/sqrt(|a| k)."""
    found, k = page("painleve_rod"), np.array([1e6, 1e8, 1e10])
    a = -found["a"](found["angle"])
    length = np.arccosh(a**1.5 * np.sqrt(k) / found["c"] / 9.81) / np.sqrt(a * k)
    away = (np.array(found["released"])[1:] - found["limit"]) / (9.81 * length)
    assert np.all((away > 1) & (away < 2.5))


def test_a_building_on_bearings_comes_to_rest_where_a_stiff_solver_takes_it():
    """The smoothed direction v/sqrt(v.v + eps^2) creeps, and is elsewhere by eps^(4/5)."""
    names = page("sliding_bearing")
    t, values = names["t"], {names["strength"]: 1.5}
    ground = sp.lambdify(t, [e.subs(values) for e in names["ground"]])

    def rates(now, z):
        push, v = ground(now), z[2:]
        size = np.sqrt(v @ v + 1e-12)
        return [*v, *(-0.6 * z[i] - 0.6 * v[i] / size - push[i] for i in range(2))]

    stiff = solve_ivp(rates, (0, 12), [0, 0, 0, 0], method="Radau", rtol=1e-8, atol=1e-10).y[:2, -1]
    assert [names["runs"]["vector law"](12.0, c) for c in "xy"] == pytest.approx(stiff, abs=2e-4)
    apart = names["runs"]["a law for each axis"]
    assert np.hypot(*(apart(12.0, c) - s for c, s in zip("xy", stiff, strict=True))) > 0.02


@pytest.mark.thorough
def test_sticks_are_born_where_the_velocity_is_zero_on_the_friction_circle():
    names = page("circular_sticks")
    assert len(names["born"]) == 2
    # Of the stiff equation with h/|h| blunted at 1e-10, from the orbit at the first of them.
    point = names["born"][0]

    def rates(now, z):
        push = [1.6 * np.cos(now / 4), np.sin(now / 4)]
        size = np.sqrt(z[2] ** 2 + z[3] ** 2 + 1e-20)
        return [*z[2:], *(push[i] - z[i] - point.parameter * z[2 + i] / size for i in range(2))]

    run = solve_ivp(rates, (0, 8 * np.pi), point.orbit.x, method="Radau", rtol=1e-10, atol=1e-12)
    slowest = np.hypot(*run.y[2:]).argmin()
    now, where = run.t[slowest], run.y[:, slowest]
    force = np.hypot(1.6 * np.cos(now / 4) - where[0], np.sin(now / 4) - where[1])
    assert np.hypot(*where[2:]) < 1e-5 and force == pytest.approx(point.parameter, abs=1e-3)
    stops = [len(one.solution().event_times("stick")) for one in names["orbits"]]
    assert stops[0] == 0 < stops[1] < stops[2]


@pytest.mark.thorough
def test_vibration_page_has_the_closed_forms_and_a_conveyor_that_turns_with_its_phase():
    names = page("vibration_and_friction")
    for across in (True, False):
        # The block itself shakes by F_c/(m omega) and more, where the plate's fastest is its own speed.
        assert names["left"][across] == pytest.approx(names["exact"][across](names["ratios"]), abs=5e-3)
    assert names["drift"] == pytest.approx([-5 / 6, 0], abs=1e-2)
    for mu, along in names["robots"].items():
        # Held tips move by the lean of a stroke, either way, and at the start until they are held.
        moves, fast = np.abs(along) > 1.5 * np.tan(0.5) * 1e-3 / 4, names["rates"] > 1.1 * names["held"][mu]
        assert not moves[names["rates"] < names["held"][mu]].any() and moves[fast].all() and fast.any()
    speeds = np.array(names["speeds"])
    assert speeds[:8] == pytest.approx(-speeds[8:16], abs=5e-3) and speeds.max() > 0.08


@pytest.mark.thorough
def test_spinning_disc_page_ends_where_force_and_moment_fall_alike():
    names = page("spinning_disc")
    for spin in (0.25, 4.0):
        assert names["ends"]["disc", spin][2] == pytest.approx(0.653001789205597639, abs=3e-4)
        assert names["ends"]["ring", spin][2] == pytest.approx(1, abs=1e-6)
        assert names["ends"]["disc by an ellipsoid", spin][2] < 0.65
    assert names["ends"]["disc", 0.25][:2] == pytest.approx([1.0405289019957545, 0.5079062007600681], abs=1e-11)
    assert names["grips"] == pytest.approx(9.81 / 0.5 * np.hypot(1, names["arms"] / 0.02), abs=1e-7)
    for aside, slow in names["stones"].values():
        assert aside == pytest.approx(slow, rel=0.03)
    assert names["stones"][-0.5][0] == pytest.approx(-names["stones"][0.5][0], rel=1e-9)


def test_table_on_legs_goes_as_legs_that_creep_a_little():
    """Against SciPy on friction that is steep in the velocity, and against rest."""
    names = page("table_on_legs")
    legs, inertia, run, eps = names["LEGS"] @ [1, 1j], names["INERTIA"], names["run"], 1e-5

    def rates(time, q):
        arms = legs * np.exp(1j * q[2])
        slip = q[3] + 1j * q[4] + 1j * q[5] * arms
        friction = slip / np.sqrt(eps**2 + np.abs(slip) ** 2)
        force = 4.5 * np.sin(time) + 0.5j - friction.sum()
        moment = -0.8 * np.sin(time) - (arms.conj() * friction).imag.sum()
        return [*q[3:], force.real, force.imag, moment / inertia]

    with np.errstate(over="ignore"):  # of steps in the differences of SciPy's Jacobian
        smooth = solve_ivp(rates, (0, run.t[-1]), np.zeros(6), method="Radau", rtol=1e-8, atol=1e-10)
    assert smooth.y[:3, -1] == pytest.approx(run.x[:3, -1], abs=5e-4)
    assert len(run.events) == 32 and len(run.ambiguities) >= 1
    assert np.abs(run.x[3:, -1]).max() < 1e-12


def test_a_light_block_follows_on_the_tractrix_and_the_cue_ball_stands_where_its_parabola_ends():
    names = page("corner_and_ball")
    assert names["misses"][1e-3] < np.sqrt(1e-3) < names["misses"][0.1]
    (spin_x, spin_y), R, mu, arm = names["spins"], names["radius"], names["mu"], 0.02 * names["radius"]

    def slip(_, q):
        return np.array([q[2] - R * q[5], q[3] + R * q[4]])

    def rates(time, q):
        f, M = mu * 9.81 * slip(time, q), arm * 9.81 * q[4:]
        f, M = f / np.hypot(*slip(time, q)), M / np.hypot(*q[4:])
        return [*q[2:4], *-f, (-R * f[1] - M[0]) / (0.4 * R**2), (R * f[0] - M[1]) / (0.4 * R**2)]

    slow = (lambda time, q: np.hypot(*slip(time, q)) - 1e-7, -1)
    time, q, _ = until(rates, [0, 0, 0.8, 0.4, spin_x, spin_y], 0, 2, slow)
    assert names["rolls"] == pytest.approx(time, abs=1e-6)
    # From there on it rolls straight on, slower by M_c g/(R (1 + 2/5)).
    far = np.hypot(*q[2:4]) / (2 * 0.02 * 9.81 / 1.4)
    assert names["run"].x[:2, -1] == pytest.approx(q[:2] + far * q[2:4], abs=1e-5)


def test_blocks_stop_on_the_closed_form_and_a_block_rides_on_its_plate_when_another_integrator_says():
    names = page("blocks_in_the_plane")
    assert np.abs(names["misses"]).max() < 1e-8

    def rates(_, q):
        q = np.asarray(q)
        f = 0.4 * 9.81 * (q[4:6] - q[6:8]) / np.hypot(*(q[4:6] - q[6:8]))
        return [*q[4:], *-f, *(f - 0.2 * 9.81 * q[6:8] / np.hypot(*q[6:8]))]

    start = np.array([0.0, 0, 0, 0, 2, 0, 0, 1])
    rides, q, _ = until(rates, start, 0, 2, (lambda _, q: np.hypot(q[4] - q[6], q[5] - q[7]) - 1e-7, -1))
    stands = rides + np.hypot(*q[6:8]) / (0.1 * 9.81)
    assert names["marks"] == pytest.approx([rides, stands], abs=1e-6)
    far = np.hypot(*q[6:8]) * q[6:8] / (2 * 0.1 * 9.81)
    assert names["run"].x[:4, -1] == pytest.approx(q[:4] + np.tile(far, 2), abs=1e-6)


@pytest.mark.thorough
def test_a_pin_that_slides_on_a_table_becomes_a_hinge():
    run = page("6_mechanics", "howto")["run"]
    assert run.itinerary[:2] == ("slip (lam)", "stick (lam sliding)")
    # In stick the pin is a fixed joint, and the rod turns about it at constant speed.
    assert np.ptp(run["spin"][run.t > run.events[0].time]) < 1e-10
    times = np.linspace(0, run.events[0].time, 20001)
    energy, turn, rate = (run(times, name) for name in ("energy", "theta", "spin"))
    power = 1.2 * np.hypot(
        run(times, "u1") - rate * np.sin(turn) / 2, run(times, "u2") + rate * np.cos(turn) / 2
    )
    lost = np.sum((power[1:] + power[:-1]) / 2 * np.diff(times))
    assert energy[0] - energy[-1] == pytest.approx(lost, abs=1e-8)
