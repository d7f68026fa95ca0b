"""Bad input to solve() is refused at the door: the argument, its value and the remedy; nothing else happens.

Guards: door/.
"""

import math
import re

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, Strobe, Switch, System, solve, sweep
from pwsmooth.definition.model import Model
from pwsmooth.paths.event_driven import EventDriven, Options
from pwsmooth.studies import Work

t, x, v, z = sp.symbols("t x v z", real=True)
k, beta = sp.symbols("k beta", positive=True)
START = {"x": 3, "v": 0}


def block():
    return System({x: v, v: -k * x - sp.sign(v)}, parameters={k: 1})


def oscillator():
    lam = Switch("lam", v)
    return System(
        {x: v, v: -k * x - lam * (1 + z), z: (1 - lam**2 - z) / beta},
        parameters={k: 1, beta: 0.1},
        events=[Event(x, update={Memory("latch", 0): v})],
    )


def gap(**options):
    p = sp.Symbol("p", positive=True)
    return solve(System({p: -p}), (0, 1), **options)


def refused(error, *parts, **options):
    """solve(block()) with bad options raises `error`, whose message holds all the parts."""
    with pytest.raises(error) as caught:
        solve(block(), **({"t_span": (0, 1), "x0": START} | options))
    for part in parts:
        assert part in str(caught.value)


# ---- t_span


@pytest.mark.parametrize(
    ("t_span", "shown"),
    [((2, 2), "(2.0, 2.0)"), ((-0.0, 0), "(-0.0, 0.0)"), ((0, math.nan), "nan"), ((0, math.inf), "inf"),
     ((math.inf, 0), "inf")],
)  # fmt: skip
def test_a_span_that_is_empty_or_not_finite_is_refused(t_span, shown):
    refused(ValueError, "`t_span` is ", shown, "give finite times that differ", t_span=t_span)


@pytest.mark.parametrize("t_span", [(1, 0), (1, 1 - 1e-12)])
def test_a_span_that_runs_backward_is_taken_by_solve_alone(t_span):
    assert solve(System({x: 1}), t_span, {x: 0})["x"][0] == pytest.approx(
        t_span[1] - t_span[0]
    )  # times increase
    with pytest.raises(ValueError, match="start < end"):
        sweep(block(), {"k": [1.0]}, x0=START, t_span=t_span)


@pytest.mark.parametrize("t_span", [5, None, (0,), (0, 1, 2), "ab", (0, "end"), (0, 1j)])
def test_a_span_that_is_no_pair_of_numbers_is_refused(t_span):
    refused(TypeError, f"`t_span` is {t_span!r}", "give two numbers, (start, end)", t_span=t_span)


# ---- x0


@pytest.mark.parametrize(
    ("x0", "error", "message"),
    [
        ({"x": 1, "v": 0}, ValueError, "`x0` has no value for z; give every state of this view"),
        ({"x": 1, "v": 0, "z": 0, "w": 1}, ValueError, "'w', which is no state of this system; its states are"),
        ({"x": 1, "v": 0, "z": 0, "lam": 1}, ValueError, "`x0` names 'lam', which is no state"),
        ({"x": 1, "v": 0, "z": 0, x: 2}, ValueError, "`x0` gives 'x' twice"),
        ({"x": 1, "v": math.nan, "z": 0}, ValueError, "`x0`, value of 'v' is nan; give a finite number"),
        ({"x": 1, "v": 0, "z": -math.inf}, ValueError, "`x0`, value of 'z' is -inf; give a finite number"),
        ({"x": 1, "v": 0, "z": 0, "latch": math.nan}, ValueError, "`x0`, value of 'latch' is nan"),
        ({"x": 1j, "v": 0, "z": 0}, TypeError, "`x0`, value of 'x' is 1j; give a number"),
        ({"x": [1, 2], "v": 0, "z": 0}, TypeError, "`x0`, value of 'x' is [1, 2]; give a number"),
        ([1, 0], ValueError, "`x0` has 2 values; this view has 3 states (x, v, z) and 1 memories (latch)"),
        ([1, 0, 0, 0, 0], ValueError, "`x0` has 5 values"),
        ([], ValueError, "`x0` has 0 values"),
        ([1, 0, math.nan], ValueError, "`x0`, value of 'z' is nan"),
        (None, TypeError, "`x0` is None; give a dict of states, or a sequence in their order"),
        (3.0, TypeError, "`x0` is 3.0"),
        ("abc", TypeError, "`x0`, value of 'x' is 'a'"),
    ],
)  # fmt: skip
def test_an_initial_state_that_does_not_fit_is_refused(x0, error, message):
    with pytest.raises(error, match=re.escape(message)):
        solve(oscillator(), (0, 1), x0)


def test_an_initial_value_outside_its_symbols_assumptions_is_refused():
    with pytest.raises(ValueError, match=r"`x0`, value of 'p' is -1; p must be > 0"):
        gap(x0={"p": -1})


@pytest.mark.parametrize(
    "view", [lambda s: s.layered({z: sp.oo}), lambda s: s.layered({z: sp.oo}).smoothed(1e-2)]
)
def test_a_state_that_the_view_does_not_have_is_refused_with_the_reason(view):
    with pytest.raises(
        ValueError, match=r"'z', which is no state of this view: it is layered, z = .* Leave it out"
    ):
        solve(view(oscillator()), (0, 1), {"x": 1, "v": 0, "z": 0})


# ---- t_eval


@pytest.mark.parametrize(
    ("t_eval", "error", "message"),
    [
        ([-0.1, 0.5], ValueError, "`t_eval` contains -0.1, outside of `t_span` (0.0, 1.0)"),
        ([0.5, 1 + 1e-9], ValueError, "`t_eval` contains 1.000000001, outside of"),
        ([0.5, 0.4], ValueError, "`t_eval` decreases from 0.5 to 0.4; give increasing times"),
        ([0.1, math.nan], ValueError, "`t_eval` contains nan; give finite times"),
        ([], ValueError, "`t_eval` has the shape (0,); give a sequence of times, or leave it out"),
        (0.5, ValueError, "`t_eval` has the shape ()"),
        ([[0, 1]], ValueError, "`t_eval` has the shape (1, 2)"),
        ("noon", TypeError, "`t_eval` is 'noon'; give a sequence of times"),
        ([1j], TypeError, "`t_eval` is [1j]"),
    ],
)
def test_times_that_the_run_cannot_give_are_refused(t_eval, error, message):
    refused(error, message, t_eval=t_eval)


# ---- tolerances and bounds


@pytest.mark.parametrize("rtol", [0, -1e-9, 1, math.nan, math.inf])
def test_a_relative_tolerance_outside_of_0_to_1_is_refused(rtol):
    refused(ValueError, f"`rtol` is {rtol}", "give a", rtol=rtol)


@pytest.mark.parametrize("rtol", [None, "tight", [1e-9, 1e-9]])
def test_a_relative_tolerance_that_is_no_number_is_refused(rtol):
    refused(TypeError, f"`rtol` is {rtol!r}; give a number", rtol=rtol)


@pytest.mark.parametrize(
    ("atol", "error", "message"),
    [
        (-1, ValueError, "`atol` is -1; give a number >= 0, or one for each of the states x, v"),
        (math.nan, ValueError, "`atol` is nan"),
        ([1e-9, math.inf], ValueError, "`atol` is [1e-09, inf]"),
        (
            [1e-9] * 3,
            ValueError,
            "`atol` has the shape (3,); give a number >= 0, or one for each of the states x, v",
        ),
        ("small", TypeError, "`atol` is 'small'"),
        ({"x": 1e-9}, TypeError, "`atol` is {'x': 1e-09}"),
    ],
)
def test_an_absolute_tolerance_that_does_not_fit_the_states_is_refused(atol, error, message):
    refused(error, message, atol=atol)


@pytest.mark.parametrize(("max_step", "error"), [(0, ValueError), (-1, ValueError), (math.nan, ValueError),
                                                 (None, TypeError), ("long", TypeError), ([1], TypeError)])  # fmt: skip
def test_a_bound_on_the_step_that_is_not_positive_is_refused(max_step, error):
    refused(error, f"`max_step` is {max_step!r}; give a number > 0", max_step=max_step)


@pytest.mark.parametrize(
    ("max_steps", "error"),
    [
        *((bad, ValueError) for bad in (0, -5, 1.5, True, math.inf, 10**30)),
        (None, TypeError),
        ("many", TypeError),
    ],
)
def test_a_bound_on_the_number_of_steps_that_is_no_count_is_refused(max_steps, error):
    refused(error, f"`max_steps` is {max_steps!r}; give an integer >= 1", max_steps=max_steps)


@pytest.mark.parametrize(("order", "error"), [(7, ValueError), (32, ValueError), (8.5, ValueError), (True, ValueError),
                                              (math.nan, ValueError), ("high", TypeError)])  # fmt: skip
def test_an_order_that_no_taylor_polynomial_here_has_is_refused(order, error):
    refused(error, f"`order` is {order!r}; give an integer from 8 to 31", order=order)


@pytest.mark.parametrize("flag", ["strict", "dense_output"])
@pytest.mark.parametrize("value", ["yes", None, 3])
def test_a_flag_that_is_no_truth_value_is_refused(flag, value):
    refused(TypeError, f"`{flag}` is {value!r}; give True or False", **{flag: value})


# ---- methods, contradictions, parameters


@pytest.mark.parametrize("method", ["RK45", "radau5", "Taylor", ""])
def test_a_method_that_an_event_driven_run_does_not_have_is_refused(method):
    refused(ValueError, f"`method` is {method!r}", "choose 'auto', 'taylor', 'rk' or 'stiff'", method=method)


def test_a_misspelt_method_is_led_to_the_one_that_was_meant():
    refused(ValueError, "`method` is 'taylr'", "Did you mean 'taylor'?", method="taylr")
    with pytest.raises(ValueError, match="`method` is 'raddau5'.*Did you mean 'radau5'"):
        solve(block().smoothed(1e-2), (0, 1), START, method="raddau5")


@pytest.mark.parametrize("method", [None, 3, ["rk"]])
def test_a_method_that_is_no_name_is_refused(method):
    refused(TypeError, f"`method` is {method!r}; give a string", method=method)


@pytest.mark.parametrize("method", ["rk", "RK45"])
def test_a_method_that_a_smoothed_run_does_not_have_is_refused(method):
    message = rf"`method` is {method!r}, which no smoothed view has; choose one of auto, radau5"
    with pytest.raises(ValueError, match=message):
        solve(block().smoothed(1e-2), (0, 1), START, method=method)


def test_an_order_for_the_runge_kutta_pair_is_a_contradiction():
    refused(ValueError, "`order` is 12, but method='rk' has its own; leave `order` out", method="rk", order=12)


def test_taylor_for_a_function_without_a_recurrence_is_refused_with_the_other_method():
    # Lifting leaves none without one: only a model written by hand can hold a corner where no switch is.
    model = Model(t, (x,), (), (sp.Abs(x),))
    message = "`method` is 'taylor', but a function of this system has no Taylor recurrence; use 'rk'"
    options = Options("taylor", 1e-8, np.array([1e-9]), True, math.inf, 1000, None, False)
    with pytest.raises(ValueError, match=message):
        EventDriven(model, options)
    assert EventDriven(model, options._replace(method="auto")).one_step == "rk"


@pytest.mark.parametrize("option", [{"order": 12}, {"strict": True}])
def test_options_of_the_event_driven_path_are_refused_for_a_smoothed_view(option):
    with pytest.raises(ValueError, match="`order` and `strict` belong to Taylor steps and the pair"):
        solve(block().smoothed(1e-2), (0, 1), START, **option)


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"k": -1}, ValueError, "`parameters`, value of 'k' is -1; k must be > 0"),
        ({"k": 0}, ValueError, "`parameters`, value of 'k' is 0; k must be > 0"),
        ({k: math.nan}, ValueError, "`parameters`, value of 'k' is nan; give a finite number"),
        ({"q": 1}, ValueError, "names 'q', which is no parameter of this system; it has k"),
        ({"x": 1}, ValueError, "names 'x', which is no parameter"),
        ({"k": "stiff"}, TypeError, "`parameters`, value of 'k' is 'stiff'; give a number"),
        ([1.0], TypeError, "`parameters` is [1.0]; give a dict"),
        ("k", TypeError, "`parameters` is 'k'; give a dict"),
    ],
)
def test_parameters_that_the_system_cannot_take_are_refused(parameters, error, message):
    refused(error, message, parameters=parameters)


def test_the_width_of_a_smoothed_view_stays_positive_in_a_run():
    with pytest.raises(ValueError, match="value of 'eps' is -0.1; eps must be > 0"):
        solve(block().smoothed(1e-2), (0, 1), START, parameters={"eps": -0.1})


@pytest.mark.parametrize("system", [None, System, lambda t, y: -y, {x: -x}])
def test_what_is_no_system_is_refused(system):
    with pytest.raises(TypeError, match="`system` is .*; give a System"):
        solve(system, (0, 1), START)


def test_good_input_in_unusual_types_is_taken():
    solution = solve(block(), np.array([0, 1]), np.array([3.0, 0.0]), rtol=np.float32(1e-7), atol=[1e-9, 1e-10],
                     max_steps=1e5, order=np.int64(12), strict=np.bool_(True), t_eval=(0, 0.5, 0.5, 1),
                     parameters={})  # fmt: skip
    assert solution.success and solution.t.tolist() == [0, 0.5, 0.5, 1]


# ---- a run's end as the next one's start


LEVEL = sp.Symbol("level", nonnegative=True)
SWING = System({LEVEL: v, v: -LEVEL})


def test_a_nonnegative_state_that_a_run_has_ended_within_rounding_below_zero_starts_the_next():
    below = 0
    for k in range(1, 12):
        end = solve(SWING, (0, k * math.pi), [0, 1], rtol=1e-12).x[:, -1]
        below += end[0] < 0
        for start in (end, end.tolist(), {"level": end[0], v: end[1]}):
            run = solve(SWING, (0, math.pi / 2), start)
            assert run["level"][-1] == pytest.approx((-1) ** k, abs=1e-9)
    assert below > 3


def test_every_start_takes_it():
    many = sweep(SWING, points={"level": [-7e-18, 0.0, 1.0]}, x0={v: 1}, seen=Strobe(2 * sp.pi),
                 measures=["points(level)"], work=Work(progress=False))  # fmt: skip
    assert (many.outcome.values == 0).all()
    assert SWING.initial_state([-7e-18, 1]) == [0.0, 1.0]


@pytest.mark.parametrize("value", [-1e-9, -1.0])
def test_what_is_below_zero_by_more_than_rounding_is_refused(value):
    with pytest.raises(ValueError, match="must be >= 0"):
        solve(SWING, (0, 1), [value, 1])


def test_a_positive_state_may_not_be_zero_within_rounding():
    with pytest.raises(ValueError, match="declared positive"):
        gap(x0={"p": -7e-18})
