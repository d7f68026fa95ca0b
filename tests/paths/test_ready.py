"""A run leaves nothing behind that the next one sees: solve() keeps its arrays from call to call."""

import threading

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Outcome, System, Unilateral, solve

t, x, v = sp.symbols("t x v", real=True)
mu = sp.Symbol("mu", positive=True)


def oscillator():
    return System({x: v, v: sp.cos(t) - x - mu * sp.sign(v)}, time=t, parameters={mu: 0.3})


def content(solution):
    """Everything that a Solution holds, in bytes and words."""
    arrays = [solution.t, solution.x, solution.mult, solution.status]
    if solution.dense is not None:
        arrays += [solution(np.linspace(solution.t[0], solution.t[-1], 50))]
    return [np.ascontiguousarray(a).tobytes() for a in arrays], repr(solution), list(solution.events)


def alone(*arguments, **options):
    """The content of a run in a thread of its own, which has nothing kept."""
    found = []
    thread = threading.Thread(target=lambda: found.append(content(solve(*arguments, **options))))
    thread.start()
    thread.join()
    return found[0]


def test_a_solution_does_not_change_when_the_next_run_begins():
    system = oscillator()
    for options in ({}, {"dense_output": True}, {"t_eval": np.linspace(0, 9, 20)}):
        first = solve(system, (0, 30), (1.0, 0.0), **options)
        before = content(first)
        solve(system, (0, 30), (-2.0, 1.0), **options)
        assert content(first) == before


def test_runs_one_after_another_have_the_bits_of_runs_of_their_own():
    cases = [((0, 5), (1.0, 0.0), 0.3), ((2, 40), (0.0, 0.0), 0.9), ((0, 0.1), (3.0, -1.0), 0.01)]
    apart = [alone(oscillator(), span, start, parameters={mu: m}) for span, start, m in cases]
    system = oscillator()
    for _ in range(2):
        for (span, start, m), expected in zip(cases, apart):
            assert content(solve(system, span, start, parameters={mu: m})) == expected


def test_a_run_after_one_that_grew_its_buffers_and_one_that_failed():
    system = oscillator()
    short = alone(system, (0, 5), (1.0, 0.0))
    long = solve(system, (0, 3000), (1.0, 0.0), max_step=0.1)
    assert len(long.t) > 5000
    kept = content(long)
    assert content(solve(system, (0, 5), (1.0, 0.0))) == short
    assert solve(system, (0, 3000), (1.0, 0.0), max_steps=7).outcome is Outcome.TOO_MANY_STEPS
    assert content(solve(system, (0, 3000), (1.0, 0.0), max_step=0.1)) == kept == content(long)


def test_events_of_time_follow_each_runs_own_span():
    floor = Unilateral(x, restitution=0.5)
    system = System({x: v, v: floor.reaction - 1}, events=[Event(every=1, update={v: 2})], contacts=[floor])
    for span, clock in (((0, 3.5), [1, 2, 3]), ((1.5, 5), [2, 3, 4, 5]), ((0, 3.5), [1, 2, 3])):
        times = solve(system, span, (1.0, 0.0)).event_times("reset")
        assert np.array_equal(times, clock)


@pytest.mark.parametrize(
    "option, bad",
    [("strict", 1), ("dense_output", 1), ("max_steps", True), ("atol", [1e-9, -1.0]), ("order", 7)],
)
def test_what_was_good_once_does_not_open_the_door_to_what_equals_it(option, bad):
    system = oscillator()
    for good in (
        {"strict": True},
        {"dense_output": True},
        {"max_steps": 1},
        {"atol": (1e-9, 1.0)},
        {"order": 8},
    ):
        solve(system, (0, 1), (1.0, 0.0), **good)
    with pytest.raises((TypeError, ValueError), match=option):
        solve(system, (0, 1), (1.0, 0.0), **{option: bad})


def test_tolerances_of_every_form_are_kept_apart():
    system, ends = oscillator(), {}
    for atol in (1e-3, [1e-3, 1e-3], (1e-3, 1e-12), np.array([1e-3, 1e-12]), np.array([1e-12, 1e-12]), 1e-12):
        ends[repr(atol)] = solve(system, (0, 20), (1.0, 0.0), rtol=1e-12, atol=atol).x[:, -1].tolist()
    same = list(ends.values())
    assert same[0] == same[1] != same[2] == same[3] != same[4] == same[5]


def test_wanted_times_are_the_solutions_own():
    times = np.linspace(0, 9, 20)
    solution = solve(oscillator(), (0, 9), (1.0, 0.0), t_eval=times)
    times[:] = -1
    assert solution.t[0] == 0 and solution.t[-1] == 9


def test_threads_do_not_share():
    system, found = oscillator(), {}
    starts = [(0.1 * k, 0.0) for k in range(8)]
    apart = [alone(system, (0, 20), start) for start in starts]

    def work(k):
        found[k] = [content(solve(system, (0, 20), starts[k])) for _ in range(20)]

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(all(run == apart[k] for run in found[k]) for k in range(8))
