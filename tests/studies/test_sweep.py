"""sweep(): the same numbers as single solves and closed forms, whatever the chunks and the threads.

Guards: kernels/sweeping/, studies/.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, omega, z

from pwsmooth import Event, Kicks, Outcome, Strobe, Switch, System, Unilateral, solve, sweep
from pwsmooth.studies import Function, Period, Points, Work
from pwsmooth.studies.chunk import run_chunk, solve_point
from pwsmooth.studies.plan import read_plan

EPS = np.finfo(float).eps
DRIVE = 2 * sp.pi / omega
SEEN = Strobe(DRIVE)
MOVING = {"y": 0.5, "v": 0.3}
t, x = sp.symbols("t x", real=True)
a = sp.symbols("a", positive=True)

SYSTEMS = {
    "slip and stick": (coulomb(), MOVING),
    "relaxing, with z": (hidden(), MOVING | {"z": 0}),
    "slaved, with folds": (hidden().layered({z: sp.oo}), MOVING),
}


def _plan(system, axes, start, measures, seen=SEEN, transient=10, periods=8, **options):
    return read_plan(
        system, axes, None, start, measures, None, None, seen, transient, periods, None, None, options
    )


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_point_has_the_bits_of_a_solve(name):
    system, start = SYSTEMS[name]
    axes = {"k": [1.7, 3.1, 4.6], "sigma": [0.8, 1.2, 2.4]}
    found = sweep(
        system, axes, x0=start, seen=Strobe(DRIVE), transient=3, periods=4, measures=["points", "counts"]
    )
    for k in axes["k"]:
        for sigma in axes["sigma"]:
            end = 3 * 2 * math.pi + 4 * 2 * math.pi
            single = solve(system, (0, end), start, parameters={"k": k, "sigma": sigma})
            here = found.sel(k=k, sigma=sigma)
            assert [float(here[f"{s}_points"][-1]) for s in single.states] == single.x[:, -1].tolist()
            assert int(here.steps) == single.cost["steps"]
            assert int(here.ambiguities) == len(single.ambiguities)


def test_a_phase_is_where_runs_begin_and_are_seen():
    found = sweep(
        coulomb(), {"sigma": [1.2, 2.4]}, x0=MOVING, seen=Strobe(DRIVE, phase=0.25), transient=3, periods=4,
        measures=["points"],
    )  # fmt: skip
    first = 0.25 * 2 * math.pi
    for sigma in (1.2, 2.4):
        single = solve(coulomb(), (first, first + 7 * 2 * math.pi), MOVING, parameters={"sigma": sigma})
        np.testing.assert_allclose(found.v_points.sel(sigma=sigma)[-1], single["v"][-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", SYSTEMS)
def test_compiled_measures_agree_with_those_of_the_solution(name):
    system, start = SYSTEMS[name]
    measures = ["sticks", "itinerary", "period", "counts", "points", "extremes(y, v, lam)", "statistics(y, v)",
                "amplitude(y)"]  # fmt: skip
    if system.model.outputs:
        measures += ["extremes(mu)", "statistics(mu)"]
    # Folds make t(s) of a Solution's polynomials costly to invert: few periods there.
    sigmas, periods = ([2.4], 2) if "folds" in name else ([0.8, 1.2, 2.4], 4)
    plan, axes = _plan(system, {"k": [1.7, 3.1], "sigma": sigmas}, start, measures, periods=periods)
    columns = axes.columns(0, axes.size)
    compiled = run_chunk(plan, columns)
    for i in range(axes.size):
        solution, window = solve_point(plan, columns, i, dense=True)
        for measure in plan.measures:
            for key, value in measure.of(solution, window, plan.setting).items():
                if isinstance(value, str):
                    assert compiled[key][i] == value, key
                else:
                    # Sums and polynomials in another order: some 500 terms of size up to 5, each rounded.
                    np.testing.assert_allclose(compiled[key][i], value, rtol=0, atol=500 * 5 * EPS, err_msg=key)


# The durations are the specification's, computed there independently (solid friction, section 4).
@pytest.mark.parametrize(
    "system, start, stick, sticks, words",
    [
        (hidden().layered({z: sp.oo}), {"y": 0.78, "v": -1.03}, 2 * 0.539389027, 2, ("S R S L",)),
        (hidden(rho=1).layered({z: sp.oo}), {"y": 0.78, "v": -1.03}, 2 * 0.070676656, 2, ("S R S L",)),
        (hidden(), {"y": 0.6, "v": -1.07, "z": 0}, 1.179049648, 1, ("S R L", "S L R")),
        (coulomb(), MOVING, 0.0, 0, ("R L",)),
    ],
)
def test_reference_orbits_of_the_specification(system, start, stick, sticks, words):
    found = sweep(system, {"sigma": [2.4]}, x0=start, seen=Strobe(DRIVE), transient=60, periods=10).squeeze()
    assert abs(float(found.stick_time) - stick) < 1.5e-9  # two rounded durations of nine digits
    assert float(found.sticks) == sticks and int(found.period) == 1
    assert str(found.itinerary.item()) in words


def test_den_hartog_amplitude():
    """x'' + x = sin(omega t) - F sign(x'): Den Hartog's closed form of the orbit that never sticks."""
    w, F = sp.symbols("w F", positive=True)
    u = sp.Symbol("u", real=True)
    block = System({x: u, u: sp.sin(w * t) - x - F * Switch("lam", u)}, time=t, parameters={w: 0.7, F: 0.2})
    found = sweep(
        block, {"w": [0.7, 0.8, 1.3]}, x0={"x": 0, "u": 1}, seen=Strobe(2 * sp.pi / w), transient=400, periods=4,
        measures=["amplitude(x)", "sticks"],
    )  # fmt: skip
    ws = found.w.values
    V, U = 1 / (1 - ws**2), np.tan(np.pi / (2 * ws)) / ws
    expected = np.sqrt(V**2 - (0.2 * U) ** 2)
    # Global error after 400 periods of an undamped resonator, of order 1e4 local errors of rtol 1e-9 |x|.
    np.testing.assert_allclose(found.x_amplitude, expected, rtol=1e-7)
    assert np.all(found.stick_time == 0)


def test_periods_of_a_subharmonic_drive():
    """Driven at periods 1, 2 and 3 times the strobe's, and at an incommensurable one."""
    q = sp.symbols("q", positive=True)
    follower = System({x: -a * x + sp.sin(q * t)}, time=t, parameters={a: 1, q: 1})
    found = sweep(
        follower, {"q": [1, 1 / 2, 1 / 3, math.sqrt(2)]}, x0={"x": 0}, seen=Strobe(2 * sp.pi), transient=10,
        periods=12,
        measures=[Period(max_count=4, tol=1e-7), "points"],
    )  # fmt: skip
    assert found.period.values.tolist() == [1, 2, 3, 0]
    w = found.q.values[:, None]
    times = 2 * math.pi * np.arange(10, 23)
    exact = (np.sin(w * times) - w * np.cos(w * times)) / (1 + w**2)  # the transient, e^(-63), is gone
    np.testing.assert_allclose(found.x_points, exact, rtol=0, atol=1e-8)


def test_rest_is_one_long_stick():
    found = sweep(
        coulomb(), {"sigma": [0.3, 0.9]}, x0={"y": 0, "v": 0}, seen=Strobe(DRIVE), transient=1, periods=5
    )
    np.testing.assert_allclose(found.stick_time, 2 * math.pi, rtol=20 * EPS)
    assert found.itinerary.values.tolist() == ["S", "S"] and found.sticks.values.tolist() == [0, 0]


@pytest.mark.parametrize("chunk, workers", [(1, 1), (7, 2), (None, 2), (1000, 1)])
def test_chunks_and_threads_change_no_bit(chunk, workers):
    def run(chunk, workers):
        return sweep(
            hidden().layered({z: sp.oo}), {"k": np.linspace(1.5, 5, 5), "sigma": np.linspace(0.6, 3, 5)}, x0=MOVING,
            seen=Strobe(DRIVE), transient=5, periods=4, measures=["sticks", "itinerary", "points", "statistics(y)"],
            work=Work(workers=workers, chunk=chunk),
        )  # fmt: skip

    whole, parts = run(25, 1), run(chunk, workers)
    assert whole.identical(parts)
    for name in whole.data_vars:
        assert whole[name].values.tobytes() == parts[name].values.tobytes(), name


def test_failures_are_recorded_and_cost_no_other_point():
    blow = System({x: x**2 - a}, parameters={a: 1})
    found = sweep(
        blow,
        {"x": [-3.0, 0.5, 1.5, 0.0]},
        t_span=(0, 5),
        measures=["extremes(x)", "points", lambda s: s.x[0, -1]],
    )
    assert (found.outcome.values >= 0).tolist() == [True, True, False, True]
    single = solve(blow, (0, 5), {"x": 1.5})
    assert found.outcome.values[2] == single.outcome and found.t_reached.values[2] == single.t[-1]
    # x = coth(c - t) from 1.5: the pole is at arcoth 1.5.
    assert abs(found.t_reached.values[2] - math.atanh(1 / 1.5)) < 1e-6
    assert np.isnan(found.x_max.values[2]) and not np.isnan(found.x_max.values[[0, 1, 3]]).any()
    words = dict(zip(found.outcome.attrs["flag_values"], found.outcome.attrs["flag_meanings"].split()))
    assert words[int(found.outcome[2])] == single.outcome.name.lower()


def test_too_many_steps_is_an_outcome():
    found = sweep(
        coulomb(), {"sigma": [1.2, 2.4]}, x0=MOVING, seen=Strobe(DRIVE), max_steps=50, measures="counts"
    )
    assert (found.outcome == Outcome.TOO_MANY_STEPS).all() and (found.steps == 50).all()


def test_a_terminal_event_ends_an_orbit_early():
    fall = System({x: -a}, parameters={a: 1}, events=[Event(x, terminal=True, name="floor")])
    found = sweep(fall, {"a": [0.5, 1, 2]}, x0={"x": 3}, t_span=(0, 4), measures=["extremes(x)", "counts"])
    assert found.outcome.values.tolist() == [Outcome.FINISHED, Outcome.TERMINATED, Outcome.TERMINATED]
    np.testing.assert_allclose(found.t_reached, [4, 3, 1.5], rtol=4 * EPS)
    np.testing.assert_allclose(found.x_min, [1, 0, 0], atol=4 * EPS)


def test_a_list_of_points_times_a_grid():
    found = sweep(
        coulomb(), {"v": [0.1, 0.3]}, points={"k": [2, 3, 4], "sigma": [0.7, 1.2, 2.4]}, x0={"y": 0.5},
        seen=Strobe(DRIVE),
        transient=2, periods=2, measures=Points("y", last=1), units={"k": "N/m", "v": "m/s", "y": "m"},
    )  # fmt: skip
    assert found.y_points.dims == ("point", "v", "last_1")
    assert found.k.dims == ("point",) and found.k.attrs["units"] == "N/m" and found.v.attrs["units"] == "m/s"
    assert found.y_points.attrs["units"] == "m"
    single = solve(coulomb(k=3, sigma=1.2), (0, 8 * math.pi), {"y": 0.5, "v": 0.3})
    assert float(found.y_points.isel(point=1).sel(v=0.3).squeeze()) == single["y"][-1]


def test_the_start_time_is_an_axis():
    found = sweep(
        coulomb(),
        {"t": [0, 1.5]},
        x0=MOVING,
        seen=Strobe(DRIVE),
        transient=0,
        periods=1,
        measures="points(y)",
    )
    late = solve(coulomb(), (1.5, 1.5 + 2 * math.pi), MOVING)
    assert float(found.y_points.sel(t=1.5)[-1]) == late["y"][-1]


def test_an_itinerary_does_not_depend_on_the_phase_at_which_it_is_read():
    found = sweep(
        hidden().layered({z: sp.oo}), {"t": [0, 1, 2, 3, 4, 5]}, x0=MOVING, seen=Strobe(DRIVE), transient=60,
        periods=6,
        measures=["itinerary", "sticks"],
    )  # fmt: skip
    assert found.itinerary.values.tolist() == ["S R S L"] * 6
    # The same orbit from every phase: 60 periods on, within the tolerance of its events.
    np.testing.assert_allclose(found.stick_time, 2 * 0.539389027, atol=1.5e-9)


def test_a_swept_layer_ratio_and_time_events_reach_the_orbit():
    layered = hidden().layered({z: 0.1})
    (name,) = [p.name for p in layered.parameters if p.name.startswith("ratio")]
    found = sweep(
        layered,
        {name: [0.01, 0.3]},
        x0=MOVING,
        seen=Strobe(DRIVE),
        transient=3,
        periods=2,
        measures="points(y)",
    )
    for r in (0.01, 0.3):
        single = solve(layered, (0, 10 * math.pi), MOVING, parameters={name: r})
        assert float(found.y_points.sel({name: r})[-1]) == single["y"][-1]
    every = sp.Symbol("every", positive=True)
    sampled = System({x: -x}, parameters={every: 1}, events=[Event(every=every, update={x: x + 1})])
    found = sweep(
        sampled, {"every": [0.3, 1, 7]}, x0={"x": 0}, t_span=(0, 5.05), measures=["points(x)", "counts"]
    )
    assert found.events.values.tolist() == [16, 5, 0]
    # After n kicks, d apart: a geometric sum, and the decay since the last one.
    exact = [
        (1 - q**n) / (1 - q) * math.exp(-(5.05 - n * d))
        for d, n in ((0.3, 16), (1.0, 5))
        for q in [math.exp(-d)]
    ]
    np.testing.assert_allclose(found.x_points.values[:, -1], [*exact, 0], rtol=1e-8)


def test_a_contact_is_closed_for_the_time_that_a_closed_form_says():
    """A ball at rest on a table, lifted ever more strongly: R = 1 - a t until it leaves."""
    u = sp.Symbol("u", real=True)
    table = Unilateral(x)
    ball = System({x: u, u: -1 + a * t + table.reaction}, time=t, parameters={a: 0.5})
    found = sweep(
        ball, {"a": [0.5, 0.25]}, x0={"x": 0, "u": 0}, t_span=(0, 8), measures=["sticks", "itinerary"]
    )
    np.testing.assert_allclose(found.stick_time, [2, 4], rtol=1e-9)
    assert found.itinerary.values.tolist() == ["c o", "c o"]


def test_functions_of_the_solution_and_what_they_raise():
    def late_events(solution, window):
        if solution.parameters["sigma"] > 2:
            raise RuntimeError("a bug of the user")
        return float(np.sum(np.array([e.time for e in solution.events]) > window.start))

    found = sweep(
        coulomb(), {"sigma": [1.2, 2.4]}, x0=MOVING, seen=Strobe(DRIVE), transient=4, periods=3,
        measures=["counts", late_events, Function(lambda s: {"a": s["y"][-1], "b": 2}, names=("a", "b"))],
    )  # fmt: skip
    assert float(found.late_events[0]) == int(found.events[0])
    assert np.isnan(found.late_events[1])
    meanings = dict(zip(found.outcome.attrs["flag_values"], found.outcome.attrs["flag_meanings"].split()))
    assert [meanings[int(o)] for o in found.outcome] == ["finished", "function_failed"]
    assert found.b.values.tolist() == [2, 2] and found.events.values[1] > 0


def test_a_smoothed_view_is_swept_point_by_point():
    smooth = hidden().smoothed(eps=0.1)
    found = sweep(
        smooth, {"sigma": [2.4]}, x0=MOVING | {"z": 0}, seen=Strobe(DRIVE), transient=400, periods=4,
        measures=["extremes(y)", "period", "points(y)", "statistics(y)"],
    ).squeeze()  # fmt: skip
    # The specification's table: smoothed, eps = beta = 0.1, max y = 1.2808, printed to four digits.
    assert abs(float(found.y_max) - 1.2808) < 5.1e-5 and int(found.period) == 1
    assert abs(float(found.y_mean)) < 1e-7  # symmetric


def test_the_window_excludes_the_transient():
    decay = System({x: -x}, parameters={})
    found = sweep(
        decay, {"x": [1.0, 2.0]}, t_span=(0, 3), measure_from=1, measures=["extremes(x)", "statistics(x)"]
    )
    start = found.x.values
    np.testing.assert_allclose(found.x_max, start * math.exp(-1), rtol=1e-9)
    np.testing.assert_allclose(found.x_mean, start * (math.exp(-1) - math.exp(-3)) / 2, rtol=1e-9)
    np.testing.assert_allclose(found.x_rms, start * np.sqrt((math.exp(-2) - math.exp(-6)) / 4), rtol=1e-9)


def test_extremes_between_steps_are_found():
    """sin(t) over a span that ends far from its extremes, with long steps."""
    u = sp.Symbol("u", real=True)
    spring = System({x: u, u: -a * x}, parameters={a: 1})
    found = sweep(
        spring,
        {"a": [1, 4, 9]},
        x0={"x": 0, "u": 1},
        t_span=(0, 6),
        measures=["extremes(x, u)", "amplitude(x)"],
    )
    w = np.sqrt(found.a.values)
    np.testing.assert_allclose(found.x_max, 1 / w, rtol=1e-9)
    np.testing.assert_allclose(found.x_min, -1 / w, rtol=1e-9)
    np.testing.assert_allclose(found.u_min, -1, rtol=1e-9)
    np.testing.assert_allclose(found.x_amplitude, 1 / w, rtol=1e-9)


def test_refused_combinations_are_recorded():
    c = sp.Symbol("c", real=True)
    pole = System({x: -x / (a - c)}, parameters={a: 1, c: 0.5})
    found = sweep(pole, {"a": [1, 2], "c": [0.5, 1]}, x0={"x": 1}, t_span=(0, 1), measures="points(x)")
    assert (found.outcome.values < 0).tolist() == [[False, True], [False, False]]


def test_noise_is_swept_by_trajectory_whatever_the_chunks():
    """Kicks of y and v at regular times: every trajectory has the bits of its own solve."""
    kicks = Kicks(1e-3, every=0.7, on=("y", "v"), seed=5)
    arguments = dict(
        x0=MOVING, seen=Strobe(DRIVE), transient=1, periods=2, measures=["points(y)", "sticks", "counts"]
    )
    found = sweep(coulomb(), {"trajectory": range(4)}, noise=kicks, work=Work(chunk=1), **arguments)
    assert found.identical(
        sweep(coulomb(), {"trajectory": range(4)}, noise=kicks, work=Work(workers=1, chunk=4), **arguments)
    )
    assert len(set(found.y_points.values[:, -1].tolist())) == 4
    for i in (0, 3):
        single = solve(coulomb(), (0, 6 * math.pi), MOVING, noise=replace(kicks, trajectory=i))
        assert float(found.y_points.sel(trajectory=i)[-1]) == single["y"][-1]
    still = sweep(coulomb(), {"seed": [1, 2]}, noise=replace(kicks, size=0.0), **arguments)
    plain = sweep(coulomb(), {"sigma": [2.4]}, **arguments)
    # Kicks of size 0 are the deterministic path; between steps its polynomials are summed in another order.
    assert still.y_points.values[0, -1] == plain.y_points.values[0, -1]
    np.testing.assert_allclose(still.y_points.values[0], plain.y_points.values[0], rtol=8 * EPS)


def test_the_largest_exponent_of_a_linear_system_is_its_real_part():
    u = sp.Symbol("u", real=True)
    spring = System({x: u, u: -4 * x - 2 * a * u + sp.sin(t)}, time=t, parameters={a: 0.1})
    found = sweep(
        spring, {"a": [0.1, 0.3]}, x0={"x": 1, "u": 0}, seen=Strobe(2 * sp.pi), transient=3, periods=40,
        measures=["lyapunov"],
    )  # fmt: skip
    # Both multipliers have modulus e^(-a T); the tangent vector turns, which the average feels as 1/T.
    np.testing.assert_allclose(found.lyapunov, [-0.1, -0.3], atol=math.log(4) / (80 * math.pi))


@pytest.mark.parametrize("by", ["clock", "end"])
def test_extremes_have_what_the_last_event_leaves(by):
    # x rises to 1 and is put to 5 at the very end of the window.
    c = sp.Symbol("c", positive=True)
    event = Event(at=1, update={x: 5}) if by == "clock" else Event(x - 1, update={x: 5}, terminal=True)
    system = System({x: c}, time=t, parameters={c: 1.0}, events=[event], outputs={"twice": 2 * x})
    found = sweep(system, {"c": [1.0]}, x0={"x": 0}, measures=["extremes(x, twice)"], t_span=(0, 1))
    assert found.x_max.values == pytest.approx([5]) and found.twice_max.values == pytest.approx([10])


def test_a_sweep_under_a_diffusion_has_numbers_or_says_why_not():
    from pwsmooth import Diffusion

    system = System({x: -x / 2})
    arguments = dict(axes={"trajectory": range(2)}, x0={"x": 0}, noise=Diffusion({x: 1}, 1 / 16))
    found = sweep(system, measures=["extremes(x)", "statistics(x)", "points"], t_span=(0, 50), **arguments)
    assert (np.abs(found.x_rms.values - 1) < 0.4).all() and (found.x_max.values > 0.5).all()  # variance 1
    assert np.isfinite(found.x_points.values).all()
    for measures, span, said in (("lyapunov", 50, "between steps"), ("extremes(x)", 50.03, "no multiple")):
        with pytest.raises(ValueError, match=said):
            sweep(system, measures=[measures], t_span=(0, span), **arguments)
    with pytest.raises(ValueError, match="'w', which is no state"):
        sweep(system, {"x": [1.0]}, t_span=(0, 1), measures=["extremes(x)"], noise=Kicks(1, every=0.1, on="w"))
