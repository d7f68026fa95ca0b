"""Controls: inputs that are polynomials on a grid which may move, with exact derivatives by all of their numbers."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Control, Family, Solution, System, solve
from pwsmooth.costs import Objective, at_event, final, integral

t, x, v = sp.symbols("t x v", real=True)
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
TIMES = [0.0, 1.0, 2.5, 4.0]


def body(u, **more):
    return System({x: v, v: u - sp.sign(v) / 10}, **more)


def test_an_input_is_the_polynomial_of_bernstein_on_each_piece():
    c = [0.0, 1.0, -2.0, 3.0, 4.0, -1.0, 6.0]
    u = Control("u", TIMES, c, degree=2, continuous=True)
    run = solve(System({x: u}), (0, 4), {x: 0}, dense_output=True)
    at = np.array([0.3, 1.7, 3.9])
    s = (at - np.array(TIMES[:-1])) / np.diff(TIMES)
    expected = [
        c[2 * k] * (1 - r) ** 2 + 2 * c[2 * k + 1] * r * (1 - r) + c[2 * k + 2] * r**2 for k, r in enumerate(s)
    ]
    assert run(at, "u") == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    ("degree", "continuous", "names"),
    [
        (0, False, ["u_0", "u_1", "u_2"]),
        (1, False, ["u_0_0", "u_0_1", "u_1_0", "u_1_1", "u_2_0", "u_2_1"]),
        (1, True, ["u_0", "u_1", "u_2", "u_3"]),
    ],
)
def test_coefficients_have_names_by_piece(degree, continuous, names):
    u = Control("u", TIMES, degree=degree, continuous=continuous, movable=True)
    system = body(u)
    assert [p.name for p in system.parameters] == [*names, "u_t1", "u_t2"]


@pytest.mark.parametrize(("degree", "continuous"), [(0, False), (1, False), (1, True), (3, True)])
def test_gradients_by_coefficients_and_times_are_exact(degree, continuous):
    count = len(Control("u", TIMES, degree=degree, continuous=continuous).values)
    u = Control("u", TIMES, np.cos(np.arange(count)), degree, continuous, movable=True)
    names = [*u.coefficients, *u.instants, "v", "t0"]
    cost = integral(u**2) + final(x) + at_event(v, "u_t1")
    objective = Objective(body(u), cost, (0, 4), {x: 0, v: -1}, names, **TIGHT)
    _, gradient = objective(objective.start)
    steps = 1e-4 * np.eye(len(names))

    def central(step):
        return (objective(objective.start + step).value - objective(objective.start - step).value) / 2e-4

    assert gradient == pytest.approx([central(step) for step in steps], rel=1e-6, abs=1e-6)


def test_the_state_of_rates_does_not_grow_with_the_grid():
    sizes = {len(body(Control("u", np.linspace(0, 1, n), degree=1)).model.states) for n in (3, 30)}
    assert sizes == {2 + 5}


def test_what_holds_the_pieces_is_not_shown():
    system = body(Control("u", TIMES))
    run = solve(system, (0, 4), {x: 0, v: 0})
    assert "of u" not in repr(system) + repr(run) and "u: pieces 3, degree 0" in repr(system)


def test_values_of_the_system_replace_those_of_the_control():
    u = Control("u", [0, 2], 1.0)
    assert solve(System({x: u}, parameters={"u_0": 3}), (0, 2), {x: 0})["x"][-1] == pytest.approx(6, rel=1e-14)


def test_a_family_is_driven_by_one_input():
    (a,) = Family(9).symbols("a")
    run = solve(System({a: Control("u", [0, 1, 2], [1, 2]) - a}), (0, 2), {a: 0})
    expected = (1 - np.exp(-1)) * np.exp(-1) + 2 * (1 - np.exp(-1))
    assert [run[f"a_{k}"][-1] for k in range(1, 10)] == pytest.approx([expected] * 9, rel=1e-9)


def test_a_saved_run_knows_its_input(tmp_path):
    run = solve(body(Control("u", TIMES, [1, 2, 3], movable=True)), (0, 4), {x: 0, v: 0})
    run.save(tmp_path / "run.npz")
    loaded = Solution.load(tmp_path / "run.npz")
    assert np.array_equal(loaded["u"], run["u"]) and loaded.system._controls == run.system._controls


@pytest.mark.parametrize(
    ("times", "more", "message"),
    [
        ([0, 0], {}, "`times`.*increase"),
        ([0], {}, "`times`.*two or more"),
        ([0, 1], {"continuous": True}, "`continuous`.*degree 1 or more"),
        ([0, 1], {"values": [1, 2]}, "`values`.*one number, or 1"),
        ([0, 1], {"degree": -1}, "`degree`"),
        ([0, 1, 2], {"movable": True, "shortest": 1.5}, "`shortest`.*smaller"),
    ],
)
def test_controls_are_refused_at_the_door(times, more, message):
    with pytest.raises(ValueError, match=message):
        Control("u", times, **more)


def test_a_run_that_begins_on_a_later_piece_is_refused():
    system = body(Control("u", TIMES, movable=True))
    with pytest.raises(ValueError, match="changes at 1, 2.5"):
        solve(system, (1.5, 4), {x: 0, v: 0})
    with pytest.raises(ValueError, match="inner times that increase"):
        solve(system, (0, 4), {x: 0, v: 0}, parameters={"u_t2": 0.5})
