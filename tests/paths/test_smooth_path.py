"""solve() on smoothed views: the stiff path as a Solution, beside SciPy's methods.

Guards: paths/smoothed.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Switch, System, solve
from pwsmooth.results.records import Outcome

t, y, v = sp.symbols("t y v", real=True)
EPS = 1e-3
TIMES = np.linspace(0, 6, 61)


def block(**arguments):
    lam = Switch("lam", v)
    system = System({y: v, v: sp.sin(t) - y - lam}, time=t, outputs={"force": 2 * lam}, **arguments)
    return system.smoothed(eps=EPS)


START = {y: 1.5, v: 0.4}


@pytest.mark.parametrize("method", ["radau5", "radau13", "taylor", "LSODA", "BDF"])
def test_every_method_gives_the_same_orbit(method):
    reference = solve(block(), (0, 6), START, t_eval=TIMES, rtol=1e-11)
    other = solve(block(), (0, 6), START, t_eval=TIMES, method=method, rtol=1e-8, atol=1e-11)
    # rtol 1e-8 on a contracting problem; BDF's local errors add up the most.
    np.testing.assert_allclose(other.x, reference.x, atol=2e-6)
    assert other.tolerances["method"] == method and other.success


def test_dense_output_agrees_with_the_times_asked_for_and_outputs_have_their_names():
    dense = solve(block(), (0, 6), START, dense_output=True)
    asked = solve(block(), (0, 6), START, t_eval=TIMES)
    np.testing.assert_allclose(dense(TIMES), asked.x, atol=1e-8)
    u = dense(TIMES, "v") / EPS
    np.testing.assert_allclose(dense(TIMES, "force"), 2 * u / np.sqrt(1 + u**2), rtol=1e-12)
    np.testing.assert_array_equal(2 * dense(TIMES, "lam"), dense(TIMES, "force"))
    assert dense.multipliers == () and dense.itinerary == ("smooth",)


def test_a_terminal_event_stops_the_run_and_the_times_beyond_it_are_left_out():
    stop = Event(y - 1, direction=-1, terminal=True, name="below one")
    sol = solve(block(events=[stop]), (0, 6), START, t_eval=TIMES)
    assert sol.outcome is Outcome.TERMINATED
    (event,) = sol.events
    assert (event.switch, event.kind) == ("below one", "terminal")
    assert sol.t[-1] <= event.time < sol.t[-1] + 0.1 and np.isfinite(sol.x).all()


@pytest.mark.parametrize("method", ["auto", "radau9", "Radau", "BDF", "LSODA", "DOP853"])
@pytest.mark.parametrize("times", [None, [0.0, 5.0, 6.0]])
def test_a_bound_on_steps_is_an_outcome_with_what_was_reached(method, times):
    sol = solve(block(), (0, 6), START, method=method, max_steps=5, t_eval=times)
    assert sol.outcome is Outcome.TOO_MANY_STEPS and 0 < sol.t[-1] < 5 and np.isfinite(sol.x).all()
    assert sol.cost["steps"] <= 5


def test_steps_of_scipy_are_counted_and_not_the_times_asked_for():
    whole = solve(block(), (0, 6), START, method="LSODA")
    asked = solve(block(), (0, 6), START, method="LSODA", t_eval=[6.0])
    assert asked.cost["steps"] == whole.cost["steps"] == len(whole.t) - 1 > 100


def test_a_method_of_the_other_path_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="'rk'.*radau9.*LSODA"):
        solve(block(), (0, 6), START, method="rk")
