"""Solution: names, segments, dense evaluation and other forms, on a trajectory known in closed form.

Guards: results/.
"""

import pickle
import types

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, System, Unilateral, solve
from pwsmooth.definition.model import LayerState, Model, Multiplier, Select
from pwsmooth.results.records import Ambiguity, Dense, EventLog, EventRecord, Outcome
from pwsmooth.results.solution import Solution

t, y, v, lam, rho, drive = sp.symbols("t y v lam rho drive", real=True)


def decelerating_block(**changes):
    """v' = drive - lam from v = 1 with drive = 0: slips until t = 1, then sticks at y = 1/2."""
    friction = lam * (1 + rho * (1 - lam**2))
    fields = dict(
        time=t,
        states=(y, v),
        parameters=(drive, rho),
        rhs=(v, drive - friction),
        multipliers=(Multiplier(lam, "switch", drive - friction, surface=v, hidden=True),),
        outputs=(("mu", friction), ("power", -lam * v), ("one", sp.Integer(1))),
    )
    fields.update(changes)
    return Model(**fields)


def block_solution(model=None, dense=True, **changes):
    model = model or decelerating_block()
    slip = np.linspace(0, 1, 5)
    stick = np.array([1.0, 1.5, 2.0])
    times = np.concatenate([slip, stick])
    x = np.array([np.r_[slip - slip**2 / 2, [0.5] * 3], np.r_[1 - slip, [0.0] * 3]])
    mult = np.array([np.r_[np.ones(5), np.zeros(3)]])
    coefficients = np.array([[[0, 1, -0.5], [1, -1, 0]], [[0.5, 0, 0], [0, 0, 0]]], dtype=float)
    polynomials = Dense(np.array([0.0, 1.0]), np.array([1.0, 2.0]), coefficients, np.array([[[1.0]], [[0.0]]]))
    arguments = dict(
        system=types.SimpleNamespace(model=model),
        t=times,
        x=x,
        mult=mult,
        status=np.array([[1] * 5 + [0] * 3], dtype=np.int8),
        events=[EventRecord(1.0, "lam", "stick")],
        dense=polynomials if dense else None,
        outcome=Outcome.FINISHED,
        cost={"steps": 2, "events": 1},
        tolerances={"rtol": 1e-9, "atol": 1e-12},
        ambiguities=[],
        parameters={drive: 0.0, rho: 3.0},
    )
    arguments.update(changes)
    return Solution(**arguments)


def test_states_multipliers_outputs_and_time_are_found_by_name_and_by_symbol():
    sol = block_solution()
    assert sol.states == ("y", "v") and sol.multipliers == ("lam",) and sol.outputs == ("mu", "power", "one")
    np.testing.assert_array_equal(sol[y], sol["y"])
    np.testing.assert_array_equal(sol["lam"], sol.mult[0])
    np.testing.assert_array_equal(sol["t"], sol.t)
    np.testing.assert_array_equal(sol["power"], -sol["v"] * sol["lam"])
    np.testing.assert_array_equal(sol["one"], np.ones(8))
    assert sol.y is sol.x


def test_an_unknown_name_is_refused_with_the_names_that_exist():
    with pytest.raises(KeyError, match="'w' is no state.*y, v, lam, mu"):
        block_solution()["w"]


def test_segments_are_the_intervals_of_constant_status_and_are_named_as_slip_and_stick():
    sol = block_solution()
    assert sol.itinerary == ("slip right (lam=+1)", "stick (lam sliding)")
    slip, stick = sol.segments
    assert (slip.start, slip.end, stick.start, stick.end) == (0.0, 1.0, 1.0, 2.0)
    assert slip.status == (1,) and stick.duration == 1.0
    np.testing.assert_array_equal(sol["v"][stick.columns], 0)


def test_a_surface_that_is_no_velocity_gets_no_words_of_friction():
    model = decelerating_block(multipliers=(Multiplier(lam, "switch", v, surface=y - 2),))
    assert block_solution(model).itinerary == ("lam=+1", "lam sliding")


def test_a_belt_velocity_still_counts_as_slip():
    model = decelerating_block(multipliers=(Multiplier(lam, "switch", -lam, surface=sp.cos(t) - v),))
    assert block_solution(model).itinerary[0] == "slip right (lam=+1)"


def test_a_contact_is_closed_while_its_force_is_solved():
    model = decelerating_block(multipliers=(Multiplier(lam, "contact", v, surface=y),))
    assert block_solution(model).itinerary == ("contact (lam) open", "contact (lam) closed")


def test_an_instant_of_another_status_neither_makes_nor_splits_a_segment():
    status = np.array([[1, 1, 0, 1, 1, 0, 0, 0]], dtype=np.int8)
    times = np.array([0, 0.5, 0.5, 0.5, 1, 1, 1.5, 2])
    segments = block_solution(status=status, t=times).segments
    assert [(s.start, s.end, s.status) for s in segments] == [(0, 1, (1,)), (1, 2, (0,))]


@pytest.mark.parametrize("method", ["auto", "stiff"])
def test_segments_are_those_of_the_run_whatever_times_were_asked_for(method):
    w, u = sp.symbols("w u", real=True)
    spring = sp.Abs(w) / 3 if method == "stiff" else sp.sign(u) / 50
    swings = System({w: u, u: -w - spring + sp.cos(2 * t) / 5}, time=t)
    whole = solve(swings, (0, 10), {w: 3.5, u: 0}, method=method)
    assert len(whole.segments) > 3
    # None, one and several in a segment; at events, of which one is the end of what is asked for
    for asked in ([3.0], [0, 1, 2, 9, 10], [whole.events[1].time, 9.5], [whole.events[0].time]):
        thin = solve(swings, (0, 10), {w: 3.5, u: 0}, method=method, t_eval=asked)
        assert thin.itinerary == whole.itinerary
        assert [(s.start, s.end, s.status) for s in thin.segments] == [
            (s.start, s.end, s.status) for s in whole.segments
        ]
        assert sum((list(thin.t[s.columns]) for s in thin.segments), []) == list(thin.t)
        for s in thin.segments:
            assert np.all(thin.status[:, s.columns] == np.array(s.status)[:, None])


def test_dense_evaluation_agrees_with_the_closed_form_between_columns():
    sol = block_solution()
    at = np.array([0.1, 0.77, 1.0, 1.9])
    slipping = np.minimum(at, 1)
    np.testing.assert_allclose(sol(at, "y"), slipping - slipping**2 / 2, atol=1e-15)
    np.testing.assert_allclose(sol(at)[1], 1 - slipping, atol=1e-15)
    assert sol(0.25).shape == (2,) and sol(0.25, "y").shape == ()
    assert sol(at.reshape(2, 2)).shape == (2, 2, 2)


def test_dense_evaluation_takes_the_side_after_an_event():
    sol = block_solution()
    assert sol(1.0, "lam") == 0 and sol(np.nextafter(1, 0), "lam") == 1
    np.testing.assert_array_equal(sol([0.5, 1.5], "mu"), [1, 0])


def test_dense_evaluation_along_an_arc_resolves_a_square_root():
    # Beside a fold: s is the arc, t = s**2, so that y = s is sqrt(t), which no polynomial in t resolves.
    arc = Dense(
        np.array([0.0]),
        np.array([1.0]),
        np.array([[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]),
        np.array([[[1.0, 0.0, 0.0]]]),
        np.array([[0.0, 0.0, 1.0]]),
        np.array([1.0]),
    )
    at = np.array([0.0, 1e-12, 0.25, 1.0])
    states, _ = arc(at)
    np.testing.assert_allclose(states, [np.sqrt(at), at], atol=1e-14)


def test_dense_evaluation_outside_the_span_or_without_polynomials_is_refused():
    with pytest.raises(ValueError, match="leaves the solved span"):
        block_solution()(2.1)
    with pytest.raises(ValueError, match="`t` is nan"):
        block_solution()(np.nan)
    with pytest.raises(ValueError, match="dense_output=True"):
        block_solution(dense=False)(0.5)


def test_an_output_selects_its_branch_where_the_other_one_is_undefined():
    force = Select(lam, sp.Integer(0), -((v - 1) ** sp.Rational(3, 2)))  # (v - 1)**1.5 has no value for v < 1
    nested = Select(lam, Select(lam, y, sp.log(v - 2)), y**2)
    model = decelerating_block(outputs=(("force", force), ("nested", nested)))
    sol = block_solution(model, status=np.ones((1, 8), np.int8), mult=np.ones((1, 8)))
    np.testing.assert_array_equal(sol["force"], 0)
    np.testing.assert_array_equal(sol["nested"], sol["y"])
    model = decelerating_block(outputs=(("half", Select(lam, 3 * y, y)),))
    sliding = block_solution(model, mult=np.zeros((1, 8)))
    np.testing.assert_allclose(sliding["half"], 2 * sliding["y"])


def test_a_slaved_state_is_an_output_at_its_equilibrium():
    z = sp.Symbol("z", real=True)
    layer = LayerState(z, sp.oo, 1 - lam**2 - z, 1 - lam**2)
    sol = block_solution(decelerating_block(layer_states=(layer,)))
    np.testing.assert_array_equal(sol["z"], np.r_[np.zeros(5), np.ones(3)])


def test_events_are_chosen_by_kind_and_switch():
    events = [
        EventRecord(0.5, "a", "slip by fold"),
        EventRecord(0.7, "b", "slip by tangency"),
        EventRecord(1, "a", "stick"),
    ]
    sol = block_solution(events=events)
    np.testing.assert_array_equal(sol.event_times("slip"), [0.5, 0.7])
    np.testing.assert_array_equal(sol.event_times(switch="a"), [0.5, 1])
    for nothing in (("slip by fold", "b"), ("impact",), ("stick", lam)):
        np.testing.assert_array_equal(sol.event_times(*nothing), [])


def test_kinds_and_switches_that_do_not_exist_are_refused_with_those_that_do():
    system = System({y: v, v: -y - sp.sign(v) / 9}, events=[Event(y - 9, name="far")])
    run, smooth = (solve(s, (0, 5), [3.5, 0]) for s in (system, system.smoothed(1e-2)))
    assert run.event_times("stick").size == run.event_times(switch="far").size == 0
    with pytest.raises(ValueError, match="`kind` is 'stck'; kinds of events are crossing, stick, slip,"):
        run.event_times("stck")
    for wrong in ("nosuch", y):
        with pytest.raises(ValueError, match=rf"`switch` is '{wrong}'.*; they are sgn\(v\), far\."):
            run.event_times(switch=wrong)
    # The smoothed view knows its switches, which have no events there.
    assert smooth.event_times(switch="sgn(v)").size == 0


def test_a_name_in_the_place_of_a_kind_leads_to_switch():
    ball = System({y: v, v: -10 + Unilateral(y, restitution=0.5, name="ground").reaction})
    run = solve(ball, (0, 0.5), [0.2, 0])
    with pytest.raises(ValueError, match="give switch='ground'"):
        run.event_times("ground")
    with pytest.raises(ValueError, match=r"Did you mean 'impact'\?"):
        run.event_times("impct")
    with pytest.raises(TypeError, match="give its name, 'ground'"):
        run.event_times(switch=Unilateral(y, name="ground"))


def test_names_are_looked_for_in_a_solution():
    sol = block_solution()
    assert all(name in sol for name in ("y", v, "mu", "lam", "t")) and "nosuch" not in sol
    sampled = sol.sample()
    assert "y" in sampled and "t" in sampled and "nosuch" not in sampled
    assert list(sol) == ["y", "v", "lam", "mu", "power", "one"]


def test_names_of_scipy_and_misspelt_attributes_are_led_to_ours():
    sol = block_solution()
    for name, words in {"t_events": "event_times", "sol": "dense_output", "itinerery": "'itinerary'"}.items():
        with pytest.raises(AttributeError, match=words):
            getattr(sol, name)
    assert not hasattr(sol, "__array__") and pickle.loads(pickle.dumps(sol.t)).size == 8


def test_a_run_back_in_time_says_so_also_after_it_was_saved(tmp_path):
    run = solve(System({y: v, v: -y}), (5, 0), [1, 0])
    assert "5 to 0, backward in time" in str(run)
    assert "y = 0.283662185" in str(run)  # cos 5, where the run ended
    run.save(tmp_path / "run.pws")
    assert str(Solution.load(tmp_path / "run.pws")) == str(run)


def test_every_outcome_says_what_happened_and_every_failure_what_to_try():
    for outcome in Outcome:
        assert Outcome(int(outcome)) is outcome
        assert outcome.success == (outcome >= 0)
        assert outcome.success or len(outcome.text) > 60
        assert str(outcome).endswith(outcome.text)


def test_the_dataset_holds_every_name_and_its_provenance():
    pytest.importorskip("xarray")
    data = block_solution().to_dataset()
    assert {"y", "v", "lam", "mu", "status_lam", "event_kind"} <= set(data.variables)
    # The stick begins at t = 1, where the run has two columns: the data set has the second one.
    np.testing.assert_array_equal(data["mu"], block_solution()["mu"][[0, 1, 2, 3, 5, 6, 7]])
    assert data.attrs["parameter rho"] == 3.0 and data.attrs["tolerance rtol"] == 1e-9
    assert data["event_time"].item() == 1.0 and data["event_kind"].item() == "stick"


def bouncing():
    """A ball dropped from 1/2 at gravity 1 onto a floor with e = 1/2: at t = 1 it turns from -1 to 1/2."""
    wall = Unilateral(y, restitution=sp.Rational(1, 2), name="R")
    system = System({y: v, v: -1 + wall.reaction}, outputs={"energy": y + v**2 / 2})
    return solve(system, (0, 1.5), [0.5, 0], dense_output=True)


def test_the_dataset_can_be_interpolated_and_has_both_sides_of_a_jump():
    pytest.importorskip("xarray")
    data = bouncing().to_dataset()
    assert float(data["v"].sel(time=1.0, method="nearest")) == pytest.approx(0.5)
    assert data.interp(time=[0.25, 0.5]).sizes["time"] == 2
    for side, speed in (("states_before", -1), ("states_after", 0.5)):
        assert float(data[side].sel(state_name="v").item()) == pytest.approx(speed)


def test_a_table_has_a_row_an_instant_or_as_many_as_are_asked_for():
    pytest.importorskip("pandas")
    run = bouncing()
    table, sample = run.to_dataframe(), run.to_dataframe(7)
    assert table.index.is_unique and {"y", "v", "R", "status_R", "energy"} == set(table.columns)
    # Every 1/4; at the impact the side after it, then y = (t - 1)/2 - (t - 1)^2/2.
    assert list(sample.index) == [0, 0.25, 0.5, 0.75, 1, 1.25, 1.5]
    np.testing.assert_allclose(sample["y"], [0.5, 0.46875, 0.375, 0.21875, 0, 0.09375, 0.125], atol=1e-12)
    np.testing.assert_allclose(sample["v"], [0, -0.25, -0.5, -0.75, 0.5, 0.25, 0], atol=1e-12)
    with pytest.raises(ValueError, match="`n` is 1; give an integer >= 2"):
        run.to_dataframe(1)
    with pytest.raises(ValueError, match="dense_output=True"):
        solve(run.system, (0, 1), [0.5, 0]).to_dataframe(3)


def test_a_phase_portrait_has_the_colours_of_the_switch_that_changes():
    import matplotlib

    matplotlib.use("Agg")
    from pwsmooth import plotting

    run = solve(System({y: v, v: -y - sp.sign(v)}), (0, 20), [3.5, 0], dense_output=True)
    (ax,) = run.plot(phase=("y", v))
    colours = [line.get_color() for line in ax.lines]
    # From 3.5 to the left as far as -1.5, to the right as far as -0.5, where it sticks.
    assert colours == [plotting.COLOUR[k] for k in ("left", "right", "stick")]
    for wrong, said in ((("y",), "give two names"), ("yv", "give two names")):
        with pytest.raises(ValueError, match=said):
            run.plot(phase=wrong)
    with pytest.raises(ValueError, match="give one of the two"):
        run.plot(["y"], phase=("y", "v"))


def test_the_plot_is_smooth_with_dense_output_and_shades_the_stick():
    import matplotlib

    matplotlib.use("Agg")
    sol = block_solution()
    axes = sol.plot(["y", "mu"])
    times, values = axes[0].lines[0].get_data()
    slipping = np.minimum(times, 1)
    assert len(times) > 50 and np.all(np.diff(times) >= 0)
    np.testing.assert_allclose(values, slipping - slipping**2 / 2, atol=1e-14)
    # mu jumps from 1 to 0 at t = 1, upright: the last point of the slip keeps its own side.
    times, mu = axes[1].lines[0].get_data()
    (jump,) = np.flatnonzero(np.diff(mu))
    assert times[jump + 1] - times[jump] < 1e-15
    (shade,) = axes[0].patches
    assert (shade.get_x(), shade.get_width()) == (1.0, 1.0)
    with pytest.raises(ValueError, match="1 Axes for 2 names"):
        sol.plot(["y", "mu"], axes[:1])


@pytest.mark.parametrize("options", [{}, {"t_eval": [0, 5, 20]}, {"dense_output": True}])
@pytest.mark.parametrize("smoothed", [False, True])
def test_what_is_not_known_between_columns_is_not_drawn_as_a_curve(smoothed, options):
    import matplotlib

    matplotlib.use("Agg")
    system = System({y: v, v: -y - sp.sign(v) / 9})
    run = solve(system.smoothed(1e-3) if smoothed else system, (0, 20), [3.5, 0], **options)
    for ax in (run.plot()[0], run.plot(phase=("y", "v"))[0]):
        said = "at steps only: solve with dense_output=True or t_eval"
        drawn = {(line.get_marker(), line.get_linestyle()) for line in ax.lines}
        assert drawn == ({("None", "-")} if options else {(".", "--")})
        assert ax.get_title(loc="right") == ("" if options else said)


def test_few_wanted_times_leave_the_curve_of_dense_output_as_it_is():
    run = solve(System({y: v, v: -y}), (0, 20), [1, 0], t_eval=[0, 20], dense_output=True)
    times, drawn = run.plot(["y"])[0].lines[0].get_data()
    assert np.diff(times).max() < 0.5
    np.testing.assert_allclose(drawn, np.cos(times), atol=1e-7)


def test_extremes_of_the_motion_have_columns_where_the_velocity_is_an_event():
    run = solve(System({y: v, v: -y}, events=[Event(v)]), (0, 20), [0, 1])
    assert run["y"].max() == pytest.approx(1, abs=1e-8)
    assert run.event_times() == pytest.approx((np.arange(6) + 0.5) * np.pi, abs=1e-7)


def test_the_smoothed_run_has_its_segment_whatever_times_were_asked_for():
    view = System({y: v, v: -y - sp.sign(v) / 9}).smoothed(1e-3)
    (segment,) = solve(view, (0, 20), [3.5, 0], t_eval=[5, 10]).segments
    assert (segment.start, segment.end) == (0, 20)


def test_the_repr_tells_outcome_events_itinerary_cost_and_ambiguities():
    sol = block_solution(ambiguities=[Ambiguity(1.0, "lam", "two-fold", "sliding", ("sliding", "lam=+1"))])
    for text in (repr(sol), sol._repr_html_()):
        for piece in ("finished", "1 stick", "slip right", "steps 2", "two-fold", "rtol 1e-09"):
            assert piece in text
    failed = block_solution(outcome=Outcome.NOT_FINITE)
    assert not failed.success and "nan" in repr(failed)


def test_events_are_put_into_words_on_demand_and_pickled_as_records():
    asked = []

    def words(index, kind):
        asked.append((index, kind))
        return f"switch {index}", f"kind {kind}"

    log = EventLog(np.array([0.5, 0.7, 1.0]), np.array([[0, 3], [1, 3], [0, 4]]), words)
    assert len(log) == 3 and not asked
    assert log[-1] == EventRecord(1.0, "switch 0", "kind 4") and asked == [(0, 4)]
    assert [e.time for e in log[:2]] == [0.5, 0.7]
    sol = block_solution(events=log)
    assert pickle.loads(pickle.dumps(sol)).events == list(log)
    np.testing.assert_array_equal(sol.event_times("kind 3"), [0.5, 0.7])


def test_a_solution_survives_pickling():
    sol = block_solution()
    sol["mu"]
    again = pickle.loads(pickle.dumps(sol))
    np.testing.assert_array_equal(again["mu"], sol["mu"])
    assert again.outcome is Outcome.FINISHED and again.itinerary == sol.itinerary
