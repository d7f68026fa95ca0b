"""Work against precision: references of two paths, baselines, and points that are judged rightly.

Guards: compare/efficiency/.
"""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, System, Unilateral
from pwsmooth.compare.efficiency.case import case_of
from pwsmooth.compare.efficiency.cases import CASES
from pwsmooth.compare.efficiency.charts import best_width, envelope, plot_orders, plot_work
from pwsmooth.compare.efficiency.contract import CannotDo, Run
from pwsmooth.compare.efficiency.measuring import work_precision
from pwsmooth.compare.efficiency.methods import METHODS, Method
from pwsmooth.compare.efficiency.own import inside_layers
from pwsmooth.compare.efficiency.plain import elimination, plain
from pwsmooth.compare.efficiency.points import Point, WorkPrecision
from pwsmooth.compare.efficiency.restarting import restarted
from pwsmooth.compare.efficiency.rivals import statuses
from pwsmooth.compare.efficiency.timestepping import bouncing, stepper
from pwsmooth.scenes import Scene

x, v, t = sp.symbols("x v t", real=True)


@pytest.mark.parametrize("name", [name for name in CASES if name != "crossing"])  # as "sticking", and longer
def test_two_paths_without_common_code_agree(name):
    # `reference` raises where they differ by more than 1e-9 or in their events
    assert CASES[name].reference.uncertainty < 1e-9


def test_the_restarted_integration_bounces_without_a_reaction_in_flight():
    case = CASES["ball"]
    x, log, _ = restarted(
        plain(case.system), (0, 3.0), np.array(case.x0), rtol=1e-10, atol=1e-12, max_step=0.05
    )
    assert [kind for _, kind in log] == 6 * ["impact"]
    assert x == pytest.approx(case.exact(3.0), abs=1e-9)


def slope(run, x0, end, exact, sizes, last):
    errors = [np.max(np.abs(run(0.0, end, np.array(x0), n, last)[0][-1] - exact)) for n in sizes]
    return -np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_time_stepping_through_sticks_and_crossings_is_at_least_of_first_order():
    case = CASES["sticking"]
    measured = slope(
        stepper(plain(case.system)), case.x0, case.t_end, case.reference.states[-1], (500, 2000, 8000), 0.5
    )
    assert measured > 0.8  # second order between events, first through them: irregular in between


def test_time_stepping_of_impacts_is_of_first_order():
    case = CASES["ball"]
    run = bouncing(plain(case.system))
    measured = slope(run, case.x0, 3.0, case.exact(3.0), (4000, 16000, 64000), 0.8)
    assert measured == pytest.approx(1, abs=0.5)


def test_an_implicit_relay_slides_exactly():
    case = CASES["relay"]
    x, lam, _ = stepper(plain(case.system))(0.0, 4.0, np.array(case.x0), 1000, 0.5)
    start = case.reference.times[0]
    stuck = np.linspace(0, 4, 1001) > start + 0.01
    assert np.max(np.abs(x[stuck].sum(axis=1))) < 1e-12 and np.all(np.abs(lam[stuck]) < 1)


def test_parameters_that_stay_open_are_states_of_rate_zero():
    x, v, F, q = sp.symbols("x v F q")
    floor = Unilateral(x, restitution=q)
    ball = System({x: v, v: -F + floor.reaction}, parameters={F: 9.0, q: 0.5})
    numbers, one = plain(ball.with_parameters({q: 0.3})), plain(ball, ("q",))
    assert (numbers.n, one.n) == (2, 3)
    for e in (0.3, 0.8):
        # From height 1 under F = 9 the floor is met at sqrt(2/9) with speed sqrt(18), and again 2 e/sqrt(9/2) later.
        end, log, _ = restarted(one, (0, 0.6), np.array([1.0, 0.0, e]), rtol=1e-10, atol=1e-12, max_step=0.05)
        rise, since = e * math.sqrt(18), 0.6 - math.sqrt(2 / 9)
        assert [kind for _, kind in log] == ["impact"]
        assert end == pytest.approx([rise * since - 4.5 * since**2, rise - 9 * since, e], abs=1e-9)
    with pytest.raises(ValueError, match="`varied` names 'w'; the parameters are F, q"):
        plain(ball, ("w",))


@pytest.mark.parametrize("size", [1, 2, 5])
def test_elimination_solves_with_rows_exchanged(size):
    rng = np.random.default_rng(size)
    a, b = rng.normal(size=(size, size)), rng.normal(size=(size, 3))
    a[0, 0] = 0.0 if size > 1 else a[0, 0]
    x = b.copy()
    elimination()(a.copy(), x)
    # Its errors are those of numbers that are not small, times the condition.
    assert a @ x == pytest.approx(b, abs=100 * np.finfo(float).eps * np.linalg.cond(a))


def test_events_are_read_from_multipliers_and_layers():
    t = np.arange(8.0)
    assert statuses(t, np.array([[0, 1, 1, -1, -1, 0.2, 0.3, 1]]).T) == [
        (2, "crossing"),
        (4, "stick"),
        (6, "slip"),
    ]
    case = CASES["sticking"]
    view = METHODS["smoothed, algebraic"].runner(case, (1e-4, 1e-6))
    assert [kind for _, kind in view(case.t_end).log()] == list(case.reference.kinds)
    assert inside_layers(plain(case.system), np.array([0.0, 1.0]), np.array([[0, 0], [1.0, 2.0]]), 1e-3) == []


def test_points_say_what_was_right_wrong_and_impossible():
    half = Method(
        "half",
        "no events",
        "none",
        (1,),
        lambda case, s: lambda end: Run(0 * case.reference.states[0], None, 1),
    )
    chosen = ["event-driven", "BDF, bare sign", "smoothed, algebraic", half]
    few = [METHODS[m] if isinstance(m, str) else m for m in chosen]
    few = [Method(m.name, m.group, m.knob, m.settings[:1], m.runner) for m in few]
    sticking = {p.method: p for p in work_precision(["sticking"], few, repeats=1)}
    good = sticking["event-driven"]
    assert good.itinerary == "right" and good.error < 1e-6 and good.event_error < 1e-6
    assert "step size" in sticking["BDF, bare sign"].note and math.isnan(sticking["BDF, bare sign"].error)
    assert sticking["half"].itinerary == "wrong"
    (refused,) = work_precision(["ball"], [few[2]], repeats=1)
    assert refused.note == "cannot do: an impact has no smoothed form"
    axes = plot_work(list(sticking.values()), _axes())
    # A line for each method with an error, and open marks on the wrong ones.
    wrong = [p for p in sticking.values() if p.itinerary == "wrong"]
    named = [line for line in axes.lines if not line.get_label().startswith("_")]
    assert [line.get_label() for line in named] == ["event-driven", "smoothed", "half"]
    assert [line.get_markerfacecolor() for line in axes.lines if line not in named] == ["white"] * len(wrong)


def _axes():
    from matplotlib.figure import Figure

    return Figure().subplots()


def test_a_scene_of_ones_own_is_measured_against_its_reference():
    x, v = sp.symbols("x v", real=True)
    # x'' = -sign(x'), from rest at 1 under x'' = -sign v - x/2: sticks at once, |x/2| < 1
    scene = Scene("block", System({x: v, v: -x / 2 - sp.sign(v)}), {"x": 1.0, "v": 1.0}, (0, 6))

    def exact(time):
        # -x'' = 1 + x/2 until v = 0: x + 2 = A cos(w s) + B sin(w s), w^2 = 1/2; then it sticks where |x| <= 2
        w = math.sqrt(0.5)
        stop = math.atan2(1 / w, 3.0) / w
        s = min(time, stop)
        speed = math.cos(w * s) - 3 * w * math.sin(w * s)
        return 3 * math.cos(w * s) + math.sin(w * s) / w - 2, speed if time < stop else 0.0

    data = work_precision(
        scene, ["event-driven", "DOP853, restarted"], [1e-6, 1e-9], reference=exact, repeats=1
    )
    assert [p.setting for p in data] == [1e-6, 1e-9, 1e-6, 1e-9]
    assert data.references["block"]["source"] == "closed form" and data.references["block"]["events"] == 1
    # ten times the tolerance: the error of a step is kept, not that of the run
    assert all(p.itinerary == "right" and p.error < 10 * p.setting for p in data)
    assert list(data.cheapest(1e-8))[0] == "event-driven"
    assert [text.get_text() for text in data.plot().get_legend().texts] == ["event-driven", "SciPy DOP853"]


def test_what_is_cheapest_counts_only_right_itineraries():
    def point(method, error, seconds, itinerary="right"):
        return Point("case", method, "smoothed", (error, 1e-3), error, 0.0, itinerary, seconds, 0.0, 1)

    data = WorkPrecision([point("a", 1e-5, 3.0), point("a", 1e-7, 5.0), point("a", 1e-2, 1.0), point("b", 1e-6, 2.0),
                          point("c", 1e-9, 0.1, "wrong")])  # fmt: skip
    assert {name: p.seconds for name, p in data.cheapest(1e-4).items()} == {"b": 2.0, "a": 3.0}
    assert [p.error for p in envelope([*data, point("a", 1e-3, 4.0)])] == [1e-2, 1e-6, 1e-7]
    assert best_width(data, 1e-6).setting == (1e-6, 1e-3) and best_width(data, 1e-8) is None


def a_point(case, name, error, seconds):
    return Point(case, name, METHODS[name].group, error, error, 0.0, "right", seconds, 0.0, 100)


def test_lines_of_a_page_are_told_apart_by_mark_and_colour_together_and_keep_theirs_in_every_panel():
    shown = ["event-driven", "event-driven, stiff", "heyoka, events", "CVODE, events", "diffrax, events",
             "numbalsoda DOP853, events", "Moreau-Jean", "DOP853, restarted", "Radau, restarted"]  # fmt: skip
    looks = []
    for names in (shown, shown[::-1][:5]):
        points = [a_point("case", name, rtol, 1e-3 / rtol) for name in names for rtol in (1e-4, 1e-9)]
        lines = plot_work(points, _axes(), methods=names).lines
        looks.append(dict(zip(names, ((line.get_marker(), line.get_color()) for line in lines), strict=True)))
    all_of, some = looks
    assert len({mark for mark, _ in all_of.values()}) == len(shown)  # in grey too
    assert some == {name: all_of[name] for name in some}


def test_a_fixed_order_is_compared_with_the_chosen_one_at_the_error():
    name = "event-driven, order 8"
    points = [a_point("relay", "event-driven", 1e-10, 2.0), a_point("relay", "event-driven", 1e-6, 1.0)]
    points += [
        a_point("relay", name, 1e-10, 5.0),
        a_point("relay", name, 1e-9, 4.0),
        a_point("ball", name, 1e-12, 1.0),
    ]
    (line,) = plot_orders(points, _axes(), error=1e-8).lines  # of the ball nothing is known at the chosen order
    assert line.get_xydata().tolist() == [[8.0, 2.0]] and line.get_label() == CASES["relay"].title


def test_a_peer_that_is_not_installed_is_listed_as_absent(monkeypatch):
    monkeypatch.setitem(sys.modules, "heyoka", None)
    (point,) = work_precision("relay", ["heyoka, events"], [1e-7], repeats=1)
    assert point.note == "not installed: heyoka" and math.isnan(point.error)


@pytest.mark.parametrize(
    ("package", "method"),
    [("heyoka", "heyoka, events"), ("sksundae", "CVODE, events"), ("numbalsoda", "numbalsoda DOP853, events"),
     ("diffrax", "diffrax, events"), ("nosnoc", "nosnoc, 4 stages"), ("solve_nivp", "solve_nivp")],
)  # fmt: skip
def test_a_peer_that_is_installed_slides(package, method):
    pytest.importorskip(package)
    (point,) = work_precision(
        "relay", [replace(METHODS[method], settings=METHODS[method].settings[1:2])], repeats=1
    )
    # the tolerances there are 1e-4 or less, of solve_nivp's second-order method too
    assert point.error < 1e-3 and point.itinerary != "wrong"


def test_events_with_memories_are_followed_without_the_kernels():
    case = CASES["slider-crank"]
    functions = plain(case.system)
    # touch-down, slow touch-down and lift-off lie on the wall's surface: one wall, three events
    assert [k for k, _, _ in functions.events] == [0, 0, 0]
    assert [d for _, d, _ in functions.events] == [1, 1, -1]
    # in flight the force, and with it the second switch, plays no part
    assert functions.matters((-1, 1)) == (True, False) and functions.matters((1, 1)) == (True, True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scene": ["balls"]}, "`scene`"),
        ({"methods": ["rk"]}, "`methods`"),
        ({"scene": "ball", "tolerances": [0.0]}, "`tolerances`"),
        ({"scene": "ball", "reference": lambda t: (0.0, 0.0)}, "`reference`"),
    ],
)
def test_unknown_names_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        work_precision(**options)


def test_a_scene_that_begins_late_and_no_scene_are_refused():
    x = sp.Symbol("x", real=True)
    late = Scene("late", System({x: -sp.sign(x)}), {"x": 1.0}, (1, 2))
    with pytest.raises(ValueError, match="begins at t = 1"):
        work_precision(late, ["event-driven"])
    with pytest.raises(TypeError, match="`scene` is 3"):
        work_precision(3, ["event-driven"])


def scene_points(system, start, end, methods, **options):
    return work_precision(Scene("own", system, start, (0, end)), methods, repeats=1, **options)


def test_the_restitution_of_a_scene_is_that_of_its_contact():
    ball = CASES["ball"]
    scene = Scene("own", ball.system, {"y": 1.0, "v": 0.0}, (0, 3))
    points = work_precision(scene, ["Moreau-Jean"], reference=ball.exact, repeats=1)
    assert points[-1].error < points[0].error / 100 and points[-1].itinerary == "right"
    e = sp.Symbol("e", positive=True)
    for restitution, read in ((e, 0.7), (e / (1 - v / 4), math.nan)):
        fall = System({x: v, v: -1 + Unilateral(x, restitution=restitution).reaction}, parameters={e: 0.7})
        case = case_of(Scene("own", fall, {"x": 1.0, "v": 0.0}, (0, 2)))
        assert case.restitution == pytest.approx(read, nan_ok=True)
    with pytest.raises(CannotDo, match="one number for the restitution"):
        METHODS["Moreau-Jean"].runner(case, 0.5)
    assert CASES["relay"].restitution is None


def test_resets_of_a_scene_are_met_by_both_references():
    # The reset turns the slip, and what a memory adds pushes the body on; on the way back the surface is no event.
    on = Memory("on", 1)
    struck = System(
        {x: v, v: -x - sp.sign(v) / 5 + on}, events=[Event(x - 1, direction=1, update={v: -v / 2, on: 1 - on})]
    )
    scene = Scene("own", struck, {"x": 2.9, "v": -1.0, "on": 0}, (0, 12))
    points = work_precision(scene, ["event-driven", "DOP853, restarted"], [1e-9], repeats=1)
    assert [p.itinerary for p in points] == ["right", "right"] and max(p.error for p in points) < 1e-8


def test_a_smoothed_view_that_starts_in_a_stick_has_the_itinerary_of_the_scene():
    driven = System({x: v, v: 6 * sp.sin(t) / 5 - x / 4 - sp.sign(v)}, time=t)
    method, eps = METHODS["smoothed, algebraic"], 1e-8
    scene = Scene("own", driven, {"x": 0.0, "v": 0.0}, (0, 6))
    (point,) = work_precision(scene, [replace(method, settings=((eps, 1e-10),))], repeats=1)
    assert point.itinerary == "right" and point.error < math.sqrt(eps)
