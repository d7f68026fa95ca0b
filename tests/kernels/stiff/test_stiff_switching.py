"""method="stiff": systems whose switches are passed and never slid on, by implicit steps between exact events.

Guards: kernels/stiff/events.py, paths/stiff_arrays.py.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, Kicks, Memory, Outcome, Strobe, System, Unilateral, solve, sweep
from pwsmooth.compare.efficiency.cases import CASES
from pwsmooth.laws.friction import GMS, Elastoplastic, ElastoplasticFixed, ModifiedCoulomb
from pwsmooth.scenes import block_on_belt

t, x, v, z = sp.symbols("t x v z", real=True)


def both(system, span, start, *, rtol=1e-10, atol=1e-14, **options):
    """The stiff run, and the explicit one at a tolerance near rounding."""
    return (
        solve(system, span, start, method="stiff", rtol=rtol, atol=atol, **options),
        solve(system, span, start, rtol=1e-13, atol=1e-16, **options),
    )


@pytest.mark.parametrize("name, bound", [("lugre", 1e-9), ("dahl", 1e-11), ("multistate", 1e-11)])
def test_friction_laws_with_inner_states_end_where_explicit_steps_do(name, bound):
    case = CASES[name]
    stiff, explicit = both(
        case.system, (0, case.t_end), case.x0, rtol=1e-9, atol=1e-9 * np.array(case.sizes) / 1e2
    )
    assert stiff.outcome is Outcome.FINISHED
    assert np.max(np.abs(stiff.x[:, -1] - explicit.x[:, -1]) / case.sizes) < bound
    assert [(e.switch, e.kind, e.note) for e in stiff.events] == [
        (e.switch, e.kind, e.note) for e in explicit.events
    ]
    assert np.allclose(stiff.event_times(), explicit.event_times(), rtol=0, atol=1e-8)
    assert stiff.itinerary == explicit.itinerary


@pytest.mark.parametrize("law, bound", [(Elastoplastic, 1e-8), (ElastoplasticFixed, 1e-9), (ModifiedCoulomb, 1e-8),
                                        (GMS, 1e-8)])  # fmt: skip
def test_blocks_on_a_belt_have_the_events_of_explicit_steps(law, bound):
    """Elastoplastic's bristle comes to its steady state from below and stays within rounding of it: a switch there must
    not be left on the wrong side. ModifiedCoulomb's velocity dips under its bound for a millisecond in long steps."""
    scene = block_on_belt(law())
    stiff, explicit = scene.solve(method="stiff"), scene.solve()
    size = np.max(np.abs(explicit.x), axis=1)
    assert np.max(np.abs(stiff.x[:, -1] - explicit.x[:, -1]) / size) < bound
    # What happens on a surface that stays within rounding of zero is rounding's.
    named = [{e.switch for e in run.events} - {"sgn3"} for run in (stiff, explicit)]
    assert named[0] == named[1]
    for switch in named[0]:
        assert np.allclose(
            stiff.event_times(switch=switch), explicit.event_times(switch=switch), rtol=0, atol=1e-6
        )


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_no_dip_is_too_short_for_the_events_of_a_smoothed_view(depth):
    """cos t + 1 < depth around t = pi, for 2 sqrt(2 depth): a ten-thousandth of a step at the least depth."""
    system = System({x: -sp.sign(x)}, time=t, events=[Event(1 + sp.cos(t) - depth, name="dip")])
    run = solve(system.smoothed(1e-2), (0, 6), (1.0,), rtol=1e-6)
    assert run.cost["steps"] < 400
    half = 2 * np.arcsin(np.sqrt(depth / 2))
    assert run.event_times(switch="dip").tolist() == pytest.approx([np.pi - half, np.pi + half], abs=1e-7)


@pytest.mark.parametrize("rate", [5, 20, 60])
def test_a_switch_whose_surface_hugs_zero_within_rounding_comes_off_on_the_right_side(rate):
    """x - y decays to nothing but rounding, of either sign, and grows again from t = 9 on."""
    y = sp.Symbol("y", real=True)
    push = sp.Max(0, t - 9)
    system = System({x: sp.cos(t) - rate * x, y: sp.cos(t) - rate * y - push, z: sp.Abs(x - y)}, time=t)
    run = solve(system, (0, 12), (1.0, 0.0, 0.0), method="stiff", dense_output=True)
    (j,) = (k for k, mu in enumerate(system.model.multipliers) if mu.surface.has(y))
    assert run.mult[j, -1] == 1.0
    # The integral of exp(-rate t), and of what the push makes: (s/rate - (1 - exp(-rate s))/rate^2).
    grown = 3**2 / 2 / rate - 3 / rate**2 + (1 - np.exp(-3 * rate)) / rate**3
    assert run.x[2, -1] == pytest.approx(1 / rate + grown, rel=1e-8)


def test_lugre_costs_a_tenth_of_the_explicit_steps():
    case = CASES["lugre"]
    stiff, explicit = both(case.system, (0, case.t_end), case.x0)
    assert 10 * stiff.cost["steps"] < explicit.cost["steps"]


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_a_stiff_branch_is_left_where_the_ends_of_steps_say(rtol):
    # x follows sin t, at a distance of eps, until x' = -x/10 falls slower than the sine: tan t = -10. The surface is as
    # small as eps all along, and what a long step's polynomial says of it between its ends is nothing.
    eps = sp.Symbol("eps", positive=True)
    rectifier = System({x: sp.Max(sp.sin(t) - x, 0) / eps - x / 10}, time=t, parameters={eps: 1e-4})
    off = 3 * np.pi - np.arctan(10)
    for size in (1e-4, 1e-6):
        run = solve(rectifier, (0, 12), {x: 0}, method="stiff", rtol=rtol, parameters={eps: size})
        assert run.outcome is Outcome.FINISHED and len(run.events) == 3
        assert run["x"][-1] == pytest.approx(np.sin(off) * np.exp(-(12 - off) / 10), abs=1e-9 + size**1.5)


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-8, 1e-9])
def test_no_step_passes_over_the_strip_where_friction_rises(rtol):
    """exp(-(v/v_s)^2) is flat above: without a look at the strip the last slip ended 1.8 ms late, at any tolerance."""
    case = CASES["lugre"]
    stiff, explicit = both(case.system, (0, case.t_end), case.x0, **case.tolerances(rtol))
    assert np.allclose(stiff.event_times(), explicit.event_times(), rtol=0, atol=1e-5)


def test_dense_output_wanted_times_and_outputs():
    system = System(
        {x: v, v: sp.cos(t) - x - 1000 * (v + sp.Abs(v) / 2)}, time=t, outputs={"drag": v + sp.Abs(v) / 2}
    )
    stiff, explicit = both(system, (0, 9), (1.0, 0.5), dense_output=True)
    at = np.linspace(0, 9, 77)
    assert np.allclose(stiff(at), explicit(at), rtol=0, atol=1e-8)
    assert np.allclose(stiff(at, "drag"), explicit(at, "drag"), rtol=0, atol=1e-8)
    wanted = solve(system, (0, 9), (1.0, 0.5), method="stiff", rtol=1e-10, atol=1e-14, t_eval=at)
    assert np.array_equal(wanted.t, at) and np.allclose(wanted.x, explicit(at), rtol=0, atol=1e-8)
    assert set(np.unique(stiff.mult)) == {-1.0, 1.0} and np.array_equal(stiff.status, stiff.mult)


def test_the_side_is_that_of_the_surface_all_along():
    case = CASES["dahl"]
    run = solve(case.system, (0, case.t_end), case.x0, method="stiff", dense_output=True)
    h = sp.lambdify(case.system.model.time, case.system.model.multipliers[0].surface)
    inside = np.setdiff1d(np.linspace(*run.t[[0, -1]], 999), run.event_times())
    _, side = run.dense(inside)
    assert np.array_equal(side[0], np.sign(h(inside)))


def test_events_memories_and_branches_of_the_model_act():
    low = Memory("low", 0)
    system = System(
        {x: v, v: sp.Piecewise((-4 * x, x > 0), (-x, True)) - sp.Rational(1, 10) * v},
        time=t,
        events=[Event(v, direction=-1, update={low: low + 1}), Event(every=1, update={v: 2 * v}),
                Event(x + 5, name="far", terminal=True)],
    )  # fmt: skip
    stiff, explicit = both(system, (0, 40), (1.0, 0.0))
    assert stiff.outcome is explicit.outcome is Outcome.TERMINATED
    assert np.allclose(stiff.x[:, -1], explicit.x[:, -1], rtol=0, atol=1e-7)
    assert [e.switch for e in stiff.events] == [e.switch for e in explicit.events]
    assert {"far", "low"} <= {e.switch for e in stiff.events} | {str(s) for s in stiff.states}


@pytest.mark.parametrize("start, first", [((0.0, 0.0), 1.0), ((0.0, -1e-9), -1.0), ((1.0, 0.0), -1.0)])
def test_a_start_on_the_surface_goes_on_where_the_motion_does(start, first):
    system = System({x: v, v: t - x - sp.Abs(v)}, time=t)
    stiff, explicit = both(system, (0, 8), start)
    assert stiff.mult[0, 0] == first
    assert np.allclose(stiff.x[:, -1], explicit.x[:, -1], rtol=0, atol=1e-8)
    assert np.allclose(stiff.event_times(), explicit.event_times(), rtol=0, atol=1e-8)


def test_a_surface_that_a_run_starts_on_at_rest_is_watched_from_the_first_step_on():
    """v = t^2 - t^3 leaves 0 without a slope: the smoothed path took it for one that stays there."""
    system = System({x: -sp.sign(x), v: 2 * t - 3 * t**2}, time=t, events=[Event(v, name="back")])
    run = solve(system.smoothed(1e-2), (0, 2), (1.0, 0.0))
    assert run.event_times(switch="back").tolist() == pytest.approx([1.0], abs=1e-7)


@pytest.mark.parametrize(
    "system, what",
    [
        (System({x: -sp.sign(x)}), "can slide"),
        (System({x: v, v: Unilateral(x).reaction - 1}, contacts=[Unilateral(x)]), "is a contact"),
    ],
)
def test_what_slides_or_rests_is_refused_with_the_remedy(system, what):
    with pytest.raises(ValueError, match=what):
        solve(system, (0, 1), [1.0] * len(system.states), method="stiff")


def test_noise_order_and_strict_are_refused():
    system = System({x: v, v: -x - sp.Abs(v)})
    with pytest.raises(ValueError, match="noise"):
        solve(system, (0, 1), (1.0, 0.0), method="stiff", noise=Kicks(on="v", size=0.1, every=0.1, seed=1))
    for option in ({"order": 12}, {"strict": True}):
        with pytest.raises(ValueError, match="order.*strict"):
            solve(system, (0, 1), (1.0, 0.0), method="stiff", **option)


def test_a_sweep_takes_stiff_steps():
    """The largest friction of LuGre's block in stick-slip, over its mass, as by explicit steps."""
    case = CASES["lugre"]
    (mass,) = (p for p in case.system.parameters if p.name == "mass")
    found = [
        sweep(case.system, {mass: [0.5, 1.0]}, x0=case.x0, seen=Strobe(case.t_end), transient=0, periods=1,
              measures=["extremes(friction)", "counts"], method=method)
        for method in ("stiff", "auto")
    ]  # fmt: skip
    stiff, explicit = (np.asarray(f["friction_max"]) for f in found)
    assert np.allclose(stiff, explicit, rtol=1e-6) and stiff[0] != stiff[1]
    assert 10 * int(found[0].steps.sum()) < int(found[1].steps.sum())
    with pytest.raises(ValueError, match="can slide"):
        sweep(System({x: -sp.sign(x)}), {x: [1.0, 2.0]},  seen=Strobe(1), transient=0, periods=1, measures=["counts"],
              method="stiff")  # fmt: skip


def test_a_bound_on_steps_is_an_outcome():
    case = CASES["lugre"]
    run = solve(case.system, (0, case.t_end), case.x0, method="stiff", max_steps=20)
    assert run.outcome is Outcome.TOO_MANY_STEPS and 0 < run.t[-1] < case.t_end


@pytest.mark.parametrize("roundings", range(-3, 9))
def test_a_reset_at_the_instant_of_a_crossing_leaves_the_side_that_the_records_say(roundings):
    """u = x - 1 falls through 0 at t = 1 and is put to -1 there: u' = -1 - 3.5 u from then on."""
    put = Event(at=1 + roundings * np.spacing(1.0), update={x: 0}, name="put")
    system = System({x: -1 - 2 * (x - 1) + 3 * sp.Abs(x - 1) / 2}, time=t, events=[put])
    solution = solve(system, (0, 3), {x: 1 + 2 * math.expm1(0.5)}, rtol=1e-10, method="stiff")
    assert solution.x[0, -1] == pytest.approx(1 - 1 / 3.5 - (1 - 1 / 3.5) * math.exp(-7), abs=1e-9)
    assert solution.status[0, -1] == -1
    crossings = [event for event in solution.events if event.kind == "crossing"]
    assert crossings[-1].note == "+1 to -1"
    assert len(solution.event_times("reset")) == 1


# ---- switches at an instant, as kernels/instant/ has them


def when(condition):
    return sp.Piecewise((1, condition), (0, True))


@pytest.mark.parametrize("level", [0, sp.Rational(1, 2), 1])
@pytest.mark.parametrize(
    "read",
    [
        when(v > 0), when(v >= 0), when(v < 0), when(v <= 0), when(sp.exp(v) > 1), when(sp.Max(v, 0) > 0),
        sp.floor(2 * v), sp.ceiling(v), sp.frac(3 * v), sp.Mod(v, 1),
    ],
)  # fmt: skip
def test_a_condition_on_what_an_event_has_put_on_its_surface_means_what_it_says(read, level):
    # v stays at the level from t = 1 on; at 2 it leaves it.
    put = Event(at=1, update={v: level, z: -sp.Rational(1, 2)})
    for rate in (0, z * when(t > 2)):
        system = System({x: read, v: rate, z: 0}, time=t, events=[put])
        for start in (0.8, -0.7):
            stiff, explicit = both(system, (0, 3), {x: 0, v: start, z: 0})
            before, there = (float(read.subs(v, value).doit()) for value in (sp.Rational(start), level))
            assert stiff.success and stiff["x"][-1] == pytest.approx(explicit["x"][-1], abs=1e-8)
            if rate == 0:
                assert stiff["x"][-1] == pytest.approx(before + 2 * there, abs=1e-8)


def test_a_condition_in_a_family_on_what_an_event_has_put_to_zero_means_what_it_says():
    family = Family(3)
    (rate,) = family.symbols("rate", positive=True)
    a, b, c = family.symbols("a b c")
    rates = {b: when(a > 0) + sp.floor(2 * c) * rate, a: -a / 4, c: sp.Integer(0)}
    put = [Event(a - sp.Rational(1, 2), update={a: 0, c: sp.Rational(1, 2)})]
    system = System(rates, events=put, parameters={rate: [1, 2, 3]})
    values = {rate: [1, 2, 3], a: [0.8, 1, 1.2], b: 0, c: 0.6}
    stiff, explicit = both(system, (0, 6), {k: values[k] for k in (a, b, c)}, parameters={rate: values[rate]})
    assert stiff.success
    np.testing.assert_allclose(stiff.x[:, -1], explicit.x[:, -1], atol=1e-8)
    ends = 4 * np.log(np.array([0.8, 1, 1.2]) / 0.5)
    expected = ends + np.array([1, 2, 3]) * 6
    np.testing.assert_allclose([stiff[f"b_{k}"][-1] for k in (1, 2, 3)], expected, atol=1e-8)


def test_an_event_whose_surface_holds_a_switch_that_it_turns_itself_fires_once():
    # The outer condition comes true at t = 0.42, and carries the surface through 0; the memory makes it false again. It
    # comes true once more at 0.82, with the memory, and stays so.
    m = Memory("m", 0)
    inner = when(m / 2 - v / 2 - 0.15 > 0) / 4
    bell = Event(x / 2 + v / 2 - 0.74 + when(v / 2 - x - inner + 0.35926 > 0), update={m: 1 - m}, name="bell")
    stiff, explicit = both(System({x: -x, v: 0.3, z: m}, events=[bell]), (0, 3), {x: 0.87, v: 0.3, z: 0})
    assert stiff.success and len(stiff.event_times(switch="bell")) == 2
    np.testing.assert_allclose(stiff.event_times(), explicit.event_times(), atol=1e-8)
    np.testing.assert_allclose(stiff.x[:, -1], explicit.x[:, -1], atol=1e-8)


@pytest.mark.parametrize("start", [-0.6, -0.5, -0.3])
def test_switches_that_an_update_moves_take_their_sides_from_the_inner_ones_on(start):
    inner = sp.sign(2 * x - 0.2)
    system = System({x: -x / 2, z: sp.sign(x - inner / 4)}, events=[Event(at=1, update={x: x + 0.5})], time=t)
    stiff, explicit = both(system, (0, 2), {x: start, z: 0})
    assert stiff.success and len(stiff.events) == len(explicit.events)
    np.testing.assert_allclose(stiff.x[:, -1], explicit.x[:, -1], atol=1e-8)


@pytest.mark.parametrize("slope", [-1, 1])
def test_teeth_that_step_as_an_event_strikes_turn_the_conditions_on_them(slope):
    # v passes 1/2 as the event strikes there: the tooth steps, and carries the condition on it through.
    tooth = sp.Mod(v - sp.Rational(1, 2), sp.Rational(3, 4))
    bell = Event(v - sp.Rational(1, 2), update={z: -z})
    system = System({x: when(tooth > 0.3) + sp.frac(v + tooth / 3), v: slope, z: 0}, events=[bell])
    stiff, explicit = both(system, (0, 1), {x: 0, v: 0.5 - slope * 0.47, z: 1})
    assert stiff.success
    np.testing.assert_allclose(stiff.x[:, -1], explicit.x[:, -1], atol=1e-8)
