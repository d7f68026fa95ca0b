"""Work against precision: references of two paths, baselines, and points that are judged rightly."""

import math

import numpy as np
import pytest

from pwsmooth.compare.cases import CASES
from pwsmooth.compare.charts import plot_work
from pwsmooth.compare.measuring import work_precision
from pwsmooth.compare.methods import METHODS, Method, Run
from pwsmooth.compare.own import inside_layers
from pwsmooth.compare.plain import plain
from pwsmooth.compare.restarting import restarted
from pwsmooth.compare.rivals import statuses
from pwsmooth.compare.timestepping import bouncing, stepper


@pytest.mark.parametrize("name", ["sticking", "hidden", "relay", "belt", "chain", "ball"])
def test_two_paths_without_common_code_agree(name):
    # `reference` raises where they differ by more than 1e-9 or in their events
    assert CASES[name].reference.uncertainty < 1e-9


def test_the_restarted_integration_bounces_without_a_reaction_in_flight():
    case = CASES["ball"]
    x, log, _ = restarted(
        plain(case.system), (0, 3.0), np.array(case.start), rtol=1e-10, atol=1e-12, max_step=0.05
    )
    assert [kind for _, kind in log] == 6 * ["impact"]
    assert x == pytest.approx(case.exact(3.0), abs=1e-9)


def slope(run, x0, end, exact, sizes, last):
    errors = [np.max(np.abs(run(0.0, end, np.array(x0), n, last)[0][-1] - exact)) for n in sizes]
    return -np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_time_stepping_through_sticks_and_crossings_is_at_least_of_first_order():
    case = CASES["sticking"]
    measured = slope(
        stepper(plain(case.system)), case.start, case.t_end, case.reference.states[-1], (500, 2000, 8000), 0.5
    )
    assert measured > 0.8  # second order between events, first through them: irregular in between


def test_time_stepping_of_impacts_is_of_first_order():
    case = CASES["ball"]
    run = bouncing(plain(case.system))
    measured = slope(run, case.start, 3.0, case.exact(3.0), (4000, 16000, 64000), 0.8)
    assert measured == pytest.approx(1, abs=0.5)


def test_an_implicit_relay_slides_exactly():
    case = CASES["relay"]
    x, lam, _ = stepper(plain(case.system))(0.0, 4.0, np.array(case.start), 1000, 0.5)
    start = case.reference.times[0]
    stuck = np.linspace(0, 4, 1001) > start + 0.01
    assert np.max(np.abs(x[stuck].sum(axis=1))) < 1e-12 and np.all(np.abs(lam[stuck]) < 1)


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
    assert len(axes.lines) >= 6


def _axes():
    from matplotlib.figure import Figure

    return Figure().subplots()


@pytest.mark.parametrize(
    ("options", "message"), [({"scene": ["balls"]}, "`scene`"), ({"methods": ["rk"]}, "`methods`")]
)
def test_unknown_names_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        work_precision(**options)
