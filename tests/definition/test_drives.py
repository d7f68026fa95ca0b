"""Sampled drives: records that stand in a system as symbols."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from pwsmooth import Drive, Event, Family, Memory, Solution, System, solve, sweep
from pwsmooth.analysis.maps.first_order import variations
from pwsmooth.codegen.machine import cache

y, v, u, t = sp.symbols("y v u t", real=True)
TIMES = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.03, 700))
VALUES = np.cumsum(np.random.default_rng(2).normal(size=700)) / 10
LINEAR = {y: v, v: -25 * y - v / 2 - u}
SPAN = (float(TIMES[33]) + 0.004, float(TIMES[650]) - 0.003)


def _between(f):
    """The linear oscillator under u = f(t), from knot to knot."""
    state = np.zeros(2)
    knots = [SPAN[0], *TIMES[(TIMES > SPAN[0]) & (TIMES < SPAN[1])], SPAN[1]]
    for a, b in zip(knots, knots[1:], strict=False):
        middle = (a + b) / 2

        def rate(s, x, middle=middle):
            return [x[1], -25 * x[0] - x[1] / 2 - f(s, middle)]

        state = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    return state


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_a_spline_is_that_of_scipy(method):
    spline = CubicSpline(TIMES, VALUES)
    solution = solve(System(LINEAR, drives={u: (TIMES, VALUES)}), SPAN, {y: 0, v: 0}, method=method)
    assert np.allclose(solution.x[:2, -1], _between(lambda s, _: spline(s)), atol=1e-10)
    assert not solution.events
    assert np.allclose(solution["u"], spline(solution.t), atol=1e-12)


def test_lines_and_steps_between_samples():
    for kind, f in (
        ("line", lambda s, _: np.interp(s, TIMES, VALUES)),
        ("hold", lambda _, middle: VALUES[np.searchsorted(TIMES, middle) - 1]),
    ):
        drive = Drive(TIMES, VALUES, kind)
        solution = solve(System(LINEAR, drives={"u": drive}), SPAN, {y: 0, v: 0})
        assert np.allclose(solution.x[:2, -1], _between(f), atol=1e-10), kind
        assert np.allclose(drive.at(TIMES[:-1]), VALUES[:-1], atol=1e-12)


def test_a_step_that_is_held_is_followed_exactly():
    solution = solve(System(LINEAR, drives={u: Drive(TIMES, VALUES, "hold")}), SPAN, {y: 0, v: 0})
    state, a = np.zeros(3), SPAN[0]
    while a < SPAN[1]:
        k = int(np.searchsorted(TIMES, a, side="right")) - 1
        b = min(TIMES[k + 1], SPAN[1])
        state[2] = 1.0
        state = expm((b - a) * np.array([[0, 1, 0], [-25, -0.5, -VALUES[k]], [0, 0, 0]])) @ state
        a = b
    assert np.allclose(solution.x[:2, -1], state[:2], atol=1e-13)


def test_a_stick_is_left_where_the_record_says():
    """A block on rough ground under a force that is held: it moves off at the first sample above the friction."""
    force = np.array([0.2, 0.9, -0.99, 0.4, 1.5, 0.0, 0.0])
    block = System({y: v, v: u - sp.sign(v)}, drives={u: Drive(np.arange(7.0), force, "hold")})
    solution = solve(block, (0, 6), {y: 0, v: 0})
    assert [(event.kind, event.time) for event in solution.events] == [
        ("slip by reset", 4.0), ("stick", pytest.approx(5.5, abs=1e-12))
    ]  # fmt: skip
    # 0.5 for one second, then the brake: 1/4 + 1/8.
    assert solution["y"][-1] == pytest.approx(0.375, abs=1e-12)


def test_a_surface_may_be_a_drive():
    """A relay on a recorded signal switches at the signal's zeros."""
    relay = System({y: sp.sign(u)}, drives={u: Drive([0, 1, 2, 3.5], [1, -1, -1, 2], "line")})
    solution = solve(relay, (0, 3.5), {y: 0})
    assert [event.time for event in solution.events] == pytest.approx([0.5, 2.5], abs=1e-12)
    assert solution["y"][-1] == pytest.approx(0.5 - 2 + 1, abs=1e-12)


def test_the_smoothed_view_follows_the_same_record():
    rough = System({y: v, v: -25 * y - u - sp.sign(v) / 5}, drives={u: (TIMES, VALUES)})
    span = (float(TIMES[0]), float(TIMES[200]))
    exact, smooth = (solve(system, span, {y: 0, v: 0}) for system in (rough, rough.smoothed(1e-6)))
    assert np.allclose(exact.x[:2, -1], smooth.x[:2, -1], atol=1e-4)
    assert not any("sample" in event.switch for event in smooth.events)


def test_derivatives_of_a_run_see_the_drive():
    block = System({y: v, v: -25 * y - u - sp.sign(v) / 5}, drives={u: Drive(TIMES, VALUES, "hold")})
    span = (float(TIMES[0]), float(TIMES[40]))
    run = solve(block, span, {y: 0.1, v: 0.3}, dense_output=True)
    h = 1e-6
    ends = [solve(block, span, {y: 0.1, v: 0.3 + s}).x[:2, -1] for s in (h, -h)]
    assert run.events
    assert np.allclose(variations(run).matrix[:2, 1], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def test_drives_of_the_same_times_share_their_cells():
    drive = Drive(TIMES, VALUES)
    rate = sp.Symbol("rate", real=True)
    both = System({y: rate - u}, drives={u: drive, rate: drive.derivative()})
    assert [s.name for s in both.states] == ["y", "cell of u"]
    spline = CubicSpline(TIMES, VALUES)
    solution = solve(both, SPAN, {y: 0})
    exact = spline(SPAN[1]) - spline(SPAN[0]) - spline.integrate(*SPAN)
    assert solution["y"][-1] == pytest.approx(float(exact), abs=1e-11)


def test_elements_of_a_family_are_shaken_together():
    building = Family(10)
    x, w = building.symbols("x w")
    (k,) = building.symbols("k")
    rates = {x: w, w: -k * x - u}
    system = System(rates, parameters={k: [10 + i for i in range(10)]}, drives={u: (TIMES, VALUES)})
    solution = solve(system, SPAN, {x: 0, w: 0})
    alone = System({y: v, v: -t * y - u}, parameters={t: 17}, drives={u: (TIMES, VALUES)})
    assert solution["x_8"][-1] == pytest.approx(solve(alone, SPAN, {y: 0, v: 0})["y"][-1], abs=1e-10)


def test_another_record_needs_no_other_code():
    """The text of the model does not know the record: neither its length nor its values."""
    one, other = (System(LINEAR, drives={u: (TIMES[:k], VALUES[:k])}).model for k in (100, 600))
    assert one != other
    assert cache.fingerprint(one) == cache.fingerprint(other)
    ends = [
        solve(System(LINEAR, drives={u: (TIMES[:k], f * VALUES[:k])}), (TIMES[0], TIMES[50]), {y: 0, v: 0}).x[
            0, -1
        ]
        for k, f in ((100, 1), (100, 2), (600, 1))
    ]
    assert ends[1] == pytest.approx(2 * ends[0], rel=1e-9)
    assert ends[2] == pytest.approx(ends[0], rel=1e-3)  # another spline, at its end


def test_a_sweep_begins_inside_of_the_record():
    system = System({y: v, v: -t * y - u}, parameters={t: 10}, drives={u: (TIMES, VALUES)})
    stiffness = [5.0, 20.0]

    def end(run):
        return run["y"][-1]

    ends = sweep(system, {t: stiffness}, x0={y: 0, v: 0}, t_span=SPAN, measures=[end])["end"]
    alone = [solve(system, SPAN, {y: 0, v: 0}, parameters={t: k})["y"][-1] for k in stiffness]
    assert np.allclose(ends, alone, atol=1e-9)


def test_a_system_with_a_drive_survives_pickling():
    system = System(LINEAR, drives={u: (TIMES, VALUES)})
    one, other = (solve(s, SPAN, {y: 0, v: 0}) for s in (system, pickle.loads(pickle.dumps(system))))
    assert one.x.tobytes() == other.x.tobytes()


def test_a_record_is_read_from_a_file(tmp_path):
    path = tmp_path / "record.csv"
    rows = [f"{a!r};{b!r};0" for a, b in zip(TIMES.tolist(), VALUES.tolist(), strict=True)]
    path.write_text("time;acceleration;flag\n" + "\n".join(rows) + "\n")
    assert Drive.from_csv(path) == Drive(TIMES, VALUES)
    with pytest.raises(ValueError, match="line 2 .*columns"):
        Drive.from_csv(path, columns=(0, 7))
    assert Drive.from_csv(path, columns=("time", "acceleration")) == Drive(TIMES, VALUES)
    with pytest.raises(ValueError, match="no column 'speed'; it has time, acceleration, flag"):
        Drive.from_csv(path, columns=("time", "speed"))
    with pytest.raises(ValueError, match="`columns` has 3 entries"):
        Drive.from_csv(path, columns=(0, 1, 2))


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: Drive([0, 1, 1, 2], [0, 1, 2, 3]), "must increase; 1 follows 1"),
        (lambda: Drive([0, 1, 2, 3], [0, math.nan, 1, 2]), "nan at index 1"),
        (lambda: Drive([0, 1], [0, 1]), "at least 4"),
        (lambda: Drive([0, 1], [0, 1], "cubic"), "`kind`"),
        (lambda: Drive([0, 1], [0, 1], "hold").derivative(), "no derivative"),
        (lambda: System({y: -y}, drives={u: (TIMES, VALUES)}), "stands nowhere"),
        (lambda: System({y: -u}, drives={u: (TIMES, VALUES)}, parameters={u: 1}), "which is a drive"),
        (
            lambda: solve(System({y: -u}, drives={u: (TIMES, VALUES)}), (0, 1), {y: 0}),
            "record of the drive 'u'",
        ),
        (
            lambda: solve(System({y: -u}, drives={u: (TIMES, VALUES)}), (1, 99), {y: 0}),
            "record of the drive 'u'",
        ),
        (
            lambda: System({y: -u}, drives={u: (TIMES, VALUES)}, events=[Event(at=u, update={y: 0})]),
            "depend on u",
        ),
    ],
)
def test_bad_records_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_what_is_no_record_is_refused():
    with pytest.raises(TypeError, match="give \\(times, values\\) or a Drive"):
        System({y: -u}, drives={u: 3})


def test_tables_pictures_and_text_leave_the_cell_of_the_record_out():
    import matplotlib

    matplotlib.use("Agg")
    latch = Memory("latch", 0)
    rate = sp.Symbol("rate", real=True)
    drive = Drive(TIMES, VALUES)
    system = System(
        {y: v, v: -y - rate - u},
        drives={u: drive, rate: drive.derivative(), "other": (TIMES[::2], VALUES[::2])},
        outputs={"sum": sp.Symbol("other", real=True)},
        events=[Event(v, update={latch: latch + 1})],
    )
    run = solve(system, SPAN, {y: 0, v: 0}, dense_output=True)
    for states in (
        list(run.to_dataframe())[:3], list(run.to_dataframe(3))[:3], list(run.sample().names),
        [ax.get_ylabel() for ax in run.plot()],
        run.to_dataset()["state_name"].values.tolist(),
    ):  # fmt: skip
        assert states == ["y", "v", "latch"]
    assert run.to_dataset()["states_after"].shape == (len(run.events), 3)
    assert not any("cell of" in str(told) for told in (run, run.to_dataframe().columns, run._none_of_these))


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_an_event_is_met_where_the_run_starts_at_a_knot_and_on_its_surface(method):
    drive = Drive([64, 64.5, 65, 65.5], [-0.58, 0.35, 0.78, 0.88], kind="line")
    latch = Memory("latch", 0)
    system = System(
        {y: u - 0.3 - 4 * (t - 64.5)}, time=t, drives={u: drive}, events=[Event(y, update={latch: latch + 1})]
    )
    run = solve(system, (64.5, 65), {y: 0}, method=method)
    # y = 0.05 s - 1.57 s^2 behind the knot.
    assert run["latch"][-1] == 1
    np.testing.assert_allclose(run.event_times(), [64.5 + 0.05 / 1.57], rtol=1e-12)


def test_a_saved_solution_has_its_record(tmp_path):
    drive = Drive(TIMES, VALUES)
    rate = sp.Symbol("rate", real=True)
    solution = solve(System({y: rate - u}, drives={u: drive, rate: drive.derivative()}), SPAN, {y: 0})
    solution.save(tmp_path / "run")
    loaded = Solution.load(tmp_path / "run")
    assert loaded["u"].tobytes() == solution["u"].tobytes()
    assert solve(loaded.system, SPAN, {y: 0}).x.tobytes() == solution.x.tobytes()
    assert "Drive(700 samples" in repr(loaded.system)
