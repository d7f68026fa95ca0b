"""Derivatives of runs by parameters, initial values, instants of time and the start: closed forms, differences.

Guards: paths/derivatives/, kernels/tangent/, codegen/jacobian.py.
"""

import itertools

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Event, Family, Kicks, Memory, Switch, System, Unilateral, solve
from pwsmooth.costs import Objective, at, at_event, event_time, final
from pwsmooth.paths.derivatives.of_solution import NoDerivative
from pwsmooth.paths.derivatives.tangents import Readings

t, x, y, v, w, z = sp.symbols("t x y v w z", real=True)
a, b, g, e, p, rho, beta, sigma, omega = sp.symbols("a b g e p rho beta sigma omega", positive=True)
TIGHT = {"rtol": 1e-13, "atol": 1e-15}


def friction_oscillator():
    lam = Switch("lam", v)
    return System(
        {
            y: v,
            v: -2.4 * sp.sin(omega * t) - sigma * y - v / 10 - lam * (1 + z),
            z: (rho * (1 - lam**2) - z) / beta,
        },
        time=t,
        parameters={rho: 3, beta: 0.1, sigma: 3.1, omega: 1},
        outputs={"friction": lam * (1 + z), "power": sigma * y * v},
    )


def differences(run, quantities):
    """d(run)/dq by Richardson's extrapolation, and what two steps of it differ by."""
    at = np.array(list(quantities.values()), float)

    def central(k, h):
        step = np.zeros(len(at))
        step[k] = h
        high, low = (run(dict(zip(quantities, at + s))) for s in (step, -step))
        return (high - low) / (2 * h)

    columns, spread = [], []
    for k in range(len(at)):
        coarse, middle, fine = (central(k, h) for h in (2e-3, 1e-3, 5e-4))
        first, second = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        columns.append(second + (second - first) / 15)
        spread.append(np.abs(second - first))
    return np.stack(columns, -1), np.stack(spread, -1)


def assert_by_differences(system, span, start, quantities, look, **options):
    """Derivatives against differences of `look(solution)`, within ten times what these are unsure of."""

    def run(values):
        changed = {name: values[name] for name in values if name in start}
        parameters = {name: values[name] for name in values if name not in start and name != "t0"}
        first = values.get("t0", span[0])
        solution = solve(
            system, (first, span[1]), start | changed, parameters=parameters, dense_output=True, **options
        )
        return look(solution)

    options = TIGHT | options
    solution = solve(system, span, start, by=list(quantities), dense_output=True, **options)
    expected, unsure = differences(run, quantities)
    found = look(solution.derivatives, solution)
    assert np.all(np.abs(found - expected) <= 10 * unsure + 1e-9 * np.abs(expected).max())
    return solution


def states_at(times):
    def look(where, solution=None):
        found = where(times)
        return found.ravel() if solution is None else np.moveaxis(found, 1, -1).reshape(-1, found.shape[1])

    return look


# ---- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [0.55, 0.7, 0.99])
def test_a_reset_moves_with_its_level(level):
    system = System({x: 1}, events=[Event(x - p, update={x: 0})], parameters={p: level})
    d = solve(system, (0, 1), {x: 0}, by=[p], **TIGHT).derivatives
    assert d.end[0, 0] == pytest.approx(-1.0, abs=1e-12) and d.event_times() == pytest.approx(1.0, abs=1e-12)


def test_a_ball_moves_with_height_gravity_and_restitution():
    ground = Unilateral(x, restitution=e, name="R")
    ball = System({x: v, v: -g + ground.reaction}, parameters={g: 9.8, e: 0.8})
    d = solve(ball, (0, 5), {x: 50, v: 0}, by=["x", g, e], **TIGHT).derivatives
    assert d.end[0] == pytest.approx([0.21744565164973, 1.87472271249865, 56.5247584249853], rel=1e-12)
    assert d.end[1] == pytest.approx([0.56348913032995, -2.12505545750027, 31.304951684997], rel=1e-12)
    # The impact, at sqrt(2 h/g), and the speeds beside it.
    impact = d.at_event(0)
    fall = np.sqrt(2 * 50 / 9.8)
    assert impact.time == pytest.approx([fall / 100, -fall / 19.6, 0.0], rel=1e-12)
    assert impact.before[1] == pytest.approx([-9.8 / (9.8 * fall), -50 / (9.8 * fall), 0.0], rel=1e-11)
    assert impact.after[1] == pytest.approx(-0.8 * impact.before[1] + [0, 0, 9.8 * fall], rel=1e-11)


def test_an_end_at_a_terminal_event_moves_along_with_it():
    throw = System(
        {x: v, v: a, y: 1}, parameters={a: 0.5}, events=[Event(x - 1, update={y: 3 * v}, terminal=True)]
    )
    d = solve(throw, (0, 5), {x: 0, v: 1, y: 0}, by=[a, "v"], **TIGHT).derivatives
    slopes = np.array([1, 1]) / np.sqrt(2)  # of the speed sqrt(v^2 + 2 a) at x = 1
    assert d.end == pytest.approx(np.array([0 * slopes, slopes, 3 * slopes]), abs=1e-12)
    assert d.x[0, :, -1] == pytest.approx(
        -d.event_times()[0] * np.sqrt(2), rel=1e-12
    )  # at that time, one goes on


def test_what_ends_at_a_stick_keeps_what_it_has_become():
    system = System({x: -a * sp.sign(x), y: b * sp.Abs(sp.sign(x))}, parameters={a: 1.3, b: 2.0})
    d = solve(system, (0, 3), {x: 1, y: 0}, by=[a, b, "x", "y"], **TIGHT).derivatives
    assert d.end[0] == pytest.approx(np.zeros(4), abs=1e-14)
    assert d.end[1] == pytest.approx([-2.0 / 1.3**2, 1 / 1.3, 2 / 1.3, 1.0], rel=1e-13)


def test_instants_of_the_clock_move_with_their_period():
    m = Memory("m", 0.0)
    system = System(
        {x: -x + m}, time=t, events=[Event(every=a, update={m: m + b * x, x: x / 2 + a})],
        parameters={a: 0.3, b: 0.4},
    )  # fmt: skip
    quantities = {"a": 0.3, "b": 0.4, "x": 1.0}
    assert_by_differences(system, (0, 2), {"x": 1.0}, quantities, states_at(np.array([0.55, 1.1, 1.95])))
    single = System({x: -x}, time=t, events=[Event(at=[a**2], update={x: x + 1})], parameters={a: 0.7})
    d = solve(single, (0, 1), {x: 2}, by=[a], **TIGHT).derivatives
    assert d.end[0, 0] == pytest.approx(1.4 * np.exp(0.49 - 1.0), rel=1e-12)


def test_the_start_of_the_span_moves_what_follows():
    system = System({x: -x * sp.sin(t)}, time=t)
    d = solve(system, (0.4, 2), {x: 1.5}, by=["t0"], **TIGHT).derivatives
    end = 1.5 * np.exp(np.cos(2) - np.cos(0.4))
    assert d.end[0, 0] == pytest.approx(end * np.sin(0.4), rel=1e-12)


def test_after_an_accumulation_nothing_of_the_fall_is_left():
    ground = Unilateral(x, restitution=e, name="R")
    ball = System({x: v, v: -g + ground.reaction}, parameters={g: 9.8, e: 0.6})
    d = solve(ball, (0, 30), {x: 1, v: 0}, by=["x", "v", g, e], **TIGHT).derivatives
    assert d.end == pytest.approx(np.zeros((2, 4)), abs=1e-12)


def end_of_chatter(amplitude, rate, restitution, gravity, height, speed, nearby):
    """When a ball comes to rest on a table A sin(rate t), thrown on it at t = 0; bounces are near to those given."""
    begun, position, late = mp.mpf(0), height, mp.mpf(0)
    for guess in itertools.chain(nearby, itertools.repeat(None)):
        late = late if guess is None else mp.mpf(guess)
        for _ in range(8):  # Newton's
            flown = late - begun
            gap = position + speed * flown - gravity * flown**2 / 2 - amplitude * mp.sin(rate * late)
            late -= gap / (speed - gravity * flown - amplitude * rate * mp.cos(rate * late))
        if late - begun < mp.mpf(10) ** -30:
            return late
        table = amplitude * rate * mp.cos(rate * late)
        left = restitution * (table - speed + gravity * (late - begun))
        begun, position, speed = late, amplitude * mp.sin(rate * late), table + left
        late += 2 * left / (gravity - amplitude * rate**2 * mp.sin(rate * late))


@pytest.mark.parametrize("values", [
    (0.2639314, 2.2016707, 0.1095417, 0.7627777, 0.9439428, 0.1842316),
    (0.4758376, 2.2768698, 0.5174117, 1.587898, 0.8294604, -0.1082620),
    (0.3, 1.7, 0.2, 2.5, 0.8, 0),
])  # fmt: skip
def test_a_chatter_on_a_shaken_table_moves_as_bounces_in_60_digits_do(values):
    ground = Unilateral(x - a * sp.sin(omega * t), restitution=e, name="R")
    values = dict(zip((a, omega, e, g, x, v), values))
    ball = System({x: v, v: -g + ground.reaction}, time=t, parameters={q: values[q] for q in (a, omega, e, g)})
    run = solve(ball, (0, 12), {x: values[x], v: values[v]}, by=list(values), **TIGHT)
    met = run.event_times("impact")
    met = met[met < run.event_times("accumulation")[0]][:-4]
    with mp.workdps(60):
        step, exact = mp.mpf(10) ** -12, []
        for k, value in enumerate(values.values()):
            beside = [[mp.mpf(float(q)) for q in values.values()] for _ in range(2)]
            beside[0][k], beside[1][k] = value + step, value - step
            exact.append(
                float((end_of_chatter(*beside[0], met) - end_of_chatter(*beside[1], met)) / (2 * step))
            )
    found = run.derivatives.event_times("accumulation")[0]
    assert found == pytest.approx(exact, abs=3e-10 * max(map(abs, exact)))


def test_a_chatter_moves_with_its_table():
    """Of an accumulation point the closed form, of bounces whose speeds vanish beside that of the table."""
    ground = Unilateral(x - b * t, restitution=e, name="R")
    ball = System({x: v, v: -g + ground.reaction}, time=t, parameters={g: 9.8, e: 0.6, b: 0.7})
    names = ["x", g, e, b]
    run = solve(ball, (0, 5), {x: 1, v: 0}, by=names, **TIGHT)
    meets = sp.sqrt(b**2 + 2 * g * x)
    rests = (meets - b) / g + 2 * e * meets / (g * (1 - e))
    values = {x: 1, g: 9.8, e: 0.6, b: 0.7}
    exact = [float(rests.diff(q).subs(values)) for q in (x, g, e, b)]
    d = run.derivatives
    assert d.event_times("accumulation")[0] == pytest.approx(exact, rel=1e-9)
    (place,) = (i for i, event in enumerate(run.events) if event.kind == "accumulation")
    rest = d.at_event(place)
    assert rest.time == pytest.approx(exact, rel=1e-9)
    at = [0.7 * slope + (float(rests.subs(values)) if q is b else 0.0) for q, slope in zip((x, g, e, b), exact)]
    assert rest.after[0] == pytest.approx(at, rel=1e-9)
    assert d.end == pytest.approx(np.array([[0, 0, 0, 5], [0, 0, 0, 1]]), abs=1e-12)


# ---- against differences ---------------------------------------------------------------------------


def test_hidden_friction_states_outputs_and_events():
    times = np.array([1.0, 3.3, 7.0, 12.345, 20.0])

    def look(where, solution=None):
        rows = [*where(times)]
        if solution is None:
            rows += [where(times, name) for name in ("friction", "power", "lam")]
            return np.concatenate([np.ravel(row) for row in rows] + [where.event_times("stick")])
        rows += [where(times, name) for name in ("friction", "power", "lam")]
        return np.concatenate([row.T for row in rows] + [where.event_times("stick")])

    quantities = {"rho": 3.0, "sigma": 3.1, "omega": 1.0, "y": 0.5, "t0": 0.0}
    start = {"y": 0.5, "v": 0.3, "z": 0.0}
    solution = assert_by_differences(friction_oscillator(), (0, 25), start, quantities, look)
    # The same at wanted times, and at the solution's own.
    asked = solve(friction_oscillator(), (0, 25), start, t_eval=times, by=list(quantities), **TIGHT)
    d = solution.derivatives
    assert asked.derivatives.x == pytest.approx(d(times), rel=1e-11, abs=1e-11)
    assert asked.derivatives["friction"] == pytest.approx(d(times, "friction"), rel=1e-11, abs=1e-11)
    last = np.append(np.diff(solution.t) > 0, True)
    assert d.x[..., last] == pytest.approx(d(solution.t[last]), rel=1e-10, abs=1e-10)


def test_a_hidden_fold():
    lam = Switch("lam", v)
    system = System(
        {y: v, v: -2.4 * sp.sin(t) - sigma * y - v / 10 - lam * (1 + rho * (1 - lam**2))},
        time=t, parameters={rho: 3, sigma: 3.1},
    )  # fmt: skip
    times = np.array([2.0, 5.0, 9.0])
    solution = assert_by_differences(
        system, (0, 10), {"y": 0.5, "v": 0.3}, {"rho": 3.0, "sigma": 3.1, "v": 0.3}, states_at(times)
    )
    assert any("fold" in event.kind for event in solution.events)


def test_a_fold_at_which_the_multiplier_is_not_determined():
    """An arc of Taylor steps ends on dg/dlambda = 0 to the last bit, and a rate reads lambda there."""
    lam = Switch("lam", v)
    system = System(
        {y: v, v: a * sp.sin(omega * t) - sigma * y - lam * (1 + z * (1 - lam**2)), z: (rho - z - lam**2 / 2) / 2},
        time=t,
        parameters={a: 2.353858167802729, omega: 0.554346216284981, sigma: 2.637606418934178, rho: 1.4139676364951437},
    )  # fmt: skip
    start = {"y": 0.17408618756119654, "v": 0.48935918261091427, "z": 1.435010587347752}
    quantities = {"rho": 1.4139676364951437, "omega": 0.554346216284981, "y": start["y"]}
    solution = assert_by_differences(system, (0, 3.2), start, quantities, states_at(np.array([1.3, 2.0, 3.1])))
    assert any("fold" in event.kind for event in solution.events)


def test_one_surface_twice_with_a_factor_that_is_a_parameter():
    """While lam slides, the kink of |k x| has another switch on the same surface, which leaves with it."""
    k = sp.Symbol("k", real=True)
    lam = Switch("lam", k * x)
    drive = -1.77 * sp.sin(1.43 * t + 5.03) - 1.094
    system = System(
        {x: -a * x + drive + b * lam - sp.Abs(k * x) / 2}, time=t, parameters={a: 0.43, b: 0.59, k: -0.39}
    )
    times = np.array([0.2, 1.0, 1.4])
    for turn in range(8):  # the roundings in which it leaves decide what else is met there
        start = {"x": -0.2 + 0.01 * turn}
        quantities = {"a": 0.43, "b": 0.59, "k": -0.39}
        solution = assert_by_differences(system, (0, 1.5), start, quantities, states_at(times))
        assert {"stick", "slip by tangency"} <= {event.kind for event in solution.events}


@pytest.mark.parametrize("seed", range(4))
def test_random_systems_with_crossings_slides_resets_and_impacts(seed):
    rng = np.random.default_rng(seed)
    gap = Unilateral(x + 1.2, restitution=e, name="R")
    m = Memory("m", 0.2)
    c = rng.uniform(0.5, 1.5, 6).round(3).tolist()
    system = System(
        {
            x: y,
            y: -c[0] * x - a * sp.sign(y - b) + c[1] * sp.cos(c[2] * t) + m + gap.reaction,
            z: -c[3] * z + sp.Max(x, p) * c[4],
        },
        time=t,
        events=[Event(z - c[5] / 2, update={m: -m, z: z / 2 + a}, direction=1)],
        parameters={a: 0.5, b: 0.1, p: 0.3, e: 0.7},
    )
    start = {"x": 0.4, "y": float(rng.normal()), "z": 0.0}
    quantities = {"a": 0.5, "b": 0.1, "p": 0.3, "e": 0.7, "x": 0.4, "z": 0.0}
    solution = assert_by_differences(system, (0, 6), start, quantities, states_at(np.array([1.5, 3.1, 6.0])))
    assert len(solution.events) > 3


def test_elements_of_a_family():
    blocks = Family(10)
    u, q = blocks.symbols("u q")
    pull = blocks.neighbour(u, 1) - 2 * u + blocks.neighbour(u, -1)
    system = System({u: q, q: pull - u - Switch("lam", q - b)}, parameters={b: 0.1})
    start = dict(zip(map(str, system.states), 0.1 * np.random.default_rng(1).normal(size=20)))
    quantities = {"b": 0.1, "u_2": start["u_2"]}
    assert_by_differences(system, (0, 6), start, quantities, states_at(np.array([2.0, 6.0])))


# ---- other steps and noise -------------------------------------------------------------------------


def with_resets():
    m = Memory("m", 0.2)
    return System(
        {x: v, v: -x - a * sp.sign(v), w: 1 - w * g},
        events=[
            Event(w - p, update={w: w / 3, m: -m + a * w}, direction=1, name="full"),
            Event(at=[b, 3 * b], update={v: v + g * x + m}, name="push"),
        ],
        parameters={a: 0.3, g: 0.4, p: 1.0, b: 1.3},
    )


RESETS = {"x": 1.0, "v": 0.2, "w": 0.1}
BY_RESETS = {"a": 0.3, "g": 0.4, "p": 1.0, "b": 1.3, "x": 1.0, "w": 0.1, "m": 0.2, "t0": 0.0}


def test_steps_of_the_pair_have_the_derivatives_of_series():
    start, names = {"y": 0.5, "v": 0.3, "z": 0.0}, ["rho", "sigma", "y", "t0"]
    pair, series = (
        solve(friction_oscillator(), (0, 25), start, method=method, by=names, **TIGHT).derivatives
        for method in ("rk", "auto")
    )
    assert pair.end == pytest.approx(series.end, rel=1e-9, abs=1e-11)
    assert pair.event_times() == pytest.approx(series.event_times(), rel=1e-9, abs=1e-11)


def test_smoothed_runs_with_resets_and_memories():
    smooth, start = with_resets().smoothed(eps=0.01), RESETS | {"m": 0.2}
    quantities = BY_RESETS | {"eps": 0.01}
    options = {"rtol": 1e-12, "atol": 1e-14}

    def look(where, solution=None):
        rows = where(np.array([0.7, 2.6, 5.1, 7.0]))
        times = where.event_times("reset")
        if solution is None:
            return np.concatenate([rows.ravel(), times])
        return np.concatenate([np.moveaxis(rows, 1, -1).reshape(-1, len(quantities)), times])

    solution = assert_by_differences(smooth, (0, 7), start, quantities, look, **options)
    times = np.linspace(0, 7, 15)
    asked = solve(smooth, (0, 7), start, t_eval=times, by=list(quantities), **options)
    assert np.array_equal(asked.derivatives.x, solution.derivatives(times))
    ends = np.append(np.diff(solution.t) > 0, True)
    assert solution.derivatives.x[..., ends] == pytest.approx(
        solution.derivatives(solution.t[ends]), rel=1e-10, abs=1e-10
    )


def test_a_power_at_its_branch_point_and_a_stick():
    """Steps that begin where a power has no series are the pair's: a fall onto a bed that friction ends."""
    lam, depth = Switch("lam", v), sp.Max(0, -x)
    system = System(
        {x: v, v: -1 + a * depth**p - g * lam},
        parameters={a: 5.0, p: 1.5, g: 0.3},
        outputs={"pull": g * lam * a},
    )
    start, times = {"x": 0.6, "v": 0.0}, np.array([1.2, 1.6, 2.4, 9.0])
    quantities, options = {"a": 5.0, "p": 1.5, "g": 0.3, "x": 0.6}, {"rtol": 1e-12, "atol": 1e-14}

    def look(where, solution=None):
        rows = [*where(times), where(times, "lam"), where(times, "pull")]
        return np.concatenate([np.ravel(row) if solution is None else row.T for row in rows])

    solution = assert_by_differences(system, (0, 9), start, quantities, look, **options)
    assert not solution.tape.by_series and solution.status[0, -1] == 0
    d = solution.derivatives
    asked = solve(system, (0, 9), start, t_eval=times, by=list(quantities), **options).derivatives
    assert asked.x == pytest.approx(d(times), rel=1e-11, abs=1e-12)
    assert asked["lam"] == pytest.approx(d(times, "lam"), rel=1e-9, abs=1e-11)
    objective = Objective(system, at(lam * x, 9.0), (0, 9), start, list(quantities), **options)
    forward = solution(9.0, "lam") * d(9.0, "x") + solution(9.0, "x") * d(9.0, "lam")
    assert objective(objective.start).gradient == pytest.approx(forward, rel=1e-9, abs=1e-12)


def test_stiff_steps_have_the_derivatives_of_series():
    zd = v - p * sp.Abs(v) * z / (1 + b * sp.exp(-100 * v**2))
    lugre = System(
        {x: v, v: 2 * sp.cos(t) - x - p * z - g * zd, z: zd}, time=t, parameters={p: 1e3, g: 10, b: 0.5}
    )
    start, names = {x: 0.5, v: 0.2, z: 0}, ["p", "g", "b", "x", "v", "t0"]
    rtol = 1e-10
    stiff, series = (
        solve(lugre, (0, 8), start, by=names, **options).derivatives
        for options in ({"method": "stiff", "rtol": rtol, "atol": rtol / 100}, TIGHT)
    )
    assert stiff.end == pytest.approx(series.end, rel=100 * rtol, abs=100 * rtol * np.abs(series.end).max())
    assert stiff.event_times("crossing") == pytest.approx(series.event_times("crossing"), rel=1e-7, abs=1e-9)
    stopped = solve(lugre, (0, 8), start, by=names, method="stiff", max_steps=1)
    assert not stopped.success and stopped.derivatives.end.shape == (3, 6)


@pytest.mark.parametrize("method", ["auto", "rk", "smoothed"])
def test_kicks_of_a_seed(method):
    system = with_resets().smoothed(eps=0.02) if method == "smoothed" else with_resets()
    options = {"noise": Kicks(0.05, every=0.37, on=(x, v), seed=4)}
    if method != "auto":
        options |= {"rtol": 1e-12, "atol": 1e-14}
    if method == "rk":
        options["method"] = method
    look = states_at(np.array([1.9, 4.4, 6.0]))
    quantities = {name: value for name, value in BY_RESETS.items() if name != "t0"}
    solution = assert_by_differences(system, (0, 6), RESETS | {"m": 0.2}, quantities, look, **options)
    assert len(solution.event_times("reset", "kicks")) == 16


# ---- backward --------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["auto", "rk", "smoothed", "stiff"])
def test_costs_backward_agree_with_derivatives_forward_on_every_path(path):
    system, method = with_resets(), path
    if path == "smoothed":
        system, method = system.smoothed(eps=0.01), "auto"
    elif path == "stiff":  # a kink, on which nothing slides
        system = System({x: v, v: -x - a * sp.Abs(v) - g * v, w: 1}, parameters={a: 0.3, g: 0.4})
    names = [
        name for name in BY_RESETS if name in (*map(str, (*system.parameters, *system.model.states)), "t0")
    ]
    event = ("sgn(v)", "crossing") if path == "stiff" else ("full", "reset")
    cost = final(x * v) + 2 * final(w) - event_time(*event) + at_event(x * w, *event)
    start = {name: value for name, value in RESETS.items() if name in map(str, system.states)}
    objective = Objective(system, cost, (0, 7), start, names, method=method, rtol=1e-12, atol=1e-14)
    gradient = objective(objective.start).gradient
    run = objective.solve(objective.start)
    d, end = run.derivatives, dict(zip(run.states, run.x[:, -1]))
    place = [i for i, e in enumerate(run.events) if (e.switch, e.kind) == event][0]
    at, before = d.at_event(place), int(np.searchsorted(run.t, run.events[place].time))
    i, j, k = (run.states.index(name) for name in "xvw")
    forward = end["x"] * d.end[j] + end["v"] * d.end[i] + 2 * d.end[k] - at.time
    forward = forward + run.x[k, before] * at.before[i] + run.x[i, before] * at.before[k]
    assert np.abs(gradient - forward).max() <= 1e-11 * np.linalg.norm(forward)


@pytest.mark.parametrize("name", ["friction", "ball", "chatter", "surfaces", "arc"])
def test_backward_and_forward_agree(name):
    if name == "chatter":  # of the last bounces each time deviates by a rounding over their speed
        table = Unilateral(x - a * sp.sin(t), restitution=e, name="R")
        rates = {x: v, v: -g + table.reaction, z: table.reaction * sp.cos(t) - z}
        system = System(rates, time=t, parameters={g: 2.0, e: 0.4, a: 0.3})
        span, start = (0, 6), {"x": 1.0, "v": 0.0, "z": 0.2}
    elif name == "surfaces":  # y slides on one surface, and on it passes the others, all at a zero of sin(t)
        others = [Switch(f"lam{k}", y - 1 + k * sp.sin(t) / 4) for k in (1, 2, 3)]
        system = System(
            {y: a * sp.cos(t) - 2 * others[1] - others[0] / 3 - others[2] / 5}, time=t, parameters={a: 0.4}
        )
        span, start = (0.3, 9), {"y": 2.0}
    elif name == "arc":  # it ends on a step along its multiplier
        lam = Switch("lam", v)
        rates = {y: v, v: a * sp.sin(omega * t) - sigma * y - b * v - lam * (1 + rho * (1 - lam**2))}
        values = [
            1.6248832386288377,
            0.7835597413978335,
            2.124411241201235,
            0.11003096122167727,
            2.6481608353620882,
        ]
        system = System(rates, time=t, parameters=dict(zip([a, omega, sigma, b, rho], values)))
        span = 1.8037349407735186, 6.267105948579497
        start = {"y": -0.887179126043641, "v": 1.0604201249207503}
    elif name == "friction":
        system, span, start = friction_oscillator(), (0, 40), {"y": 0.5, "v": 0.3, "z": 0.0}
    else:
        ground = Unilateral(x, restitution=e, name="R")
        system = System({x: v, v: -g + ground.reaction}, parameters={g: 9.8, e: 0.8})
        span, start = (0, 12), {"x": 5.0, "v": 0.0}
    names = [*map(str, system.parameters), *map(str, system.states)]
    solution = solve(system, span, start, by=names, **TIGHT)
    n, m = len(system.states), len(system.model.multipliers)
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(*span, 9))
    times[-1] = span[1]
    run = solution.derivatives._replay(times, points=False)
    end, at = rng.normal(size=n), rng.normal(size=(len(times), n + m))
    forward = end @ run.end + np.einsum("ti,tik->k", at, run.at_sample)
    none = np.zeros(0, np.int64), np.zeros((0, 2 * n + 1))
    slopes = solution.tape.pull_back(Readings(end, times, at, *none))
    assert slopes.why is None
    order = [system.model.parameters.index(sp.Symbol(q, positive=True)) for q in names[:-n]]
    backward = np.concatenate([slopes.parameters[order], slopes.start])
    assert np.abs(forward - backward).max() <= 1e-11 * np.abs(forward).max()


# ---- what has no derivative ------------------------------------------------------------------------


def test_a_grazing_impact_is_refused_from_there_on():
    ground = Unilateral(x, restitution=e, name="R")
    swing = System({x: v, v: -x + 1 + ground.reaction}, parameters={e: 0.8})  # x = 1 - cos(t) + ...
    run = solve(swing, (0, 9), {x: 2, v: 0}, by=["x"], **TIGHT)
    d = run.derivatives
    assert d(1.0)[0, 0] == pytest.approx(np.cos(1.0), rel=1e-11)
    with pytest.raises(NoDerivative, match=r"from t = 3\.14"):
        _ = d.x
    with pytest.raises(NoDerivative, match="R"):
        d(5.0)


def test_two_surfaces_at_once_are_refused_and_one_surface_twice_is_not():
    meet = System({x: -1, y: -1, z: sp.sign(x) * a + sp.sign(x + y) * sp.sign(y)}, parameters={a: 0.5})
    d = solve(meet, (0, 3), {x: 1, y: 1, z: 0}, by=["x", a], **TIGHT).derivatives
    with pytest.raises(NoDerivative, match="several surfaces"):
        _ = d.end
    twice = System({x: -1, z: sp.sign(x) * a + sp.sign(2 * x)}, parameters={a: 0.5})
    d = solve(twice, (0, 3), {x: 1, z: 0}, by=["x", a], **TIGHT).derivatives
    assert d.end[1] == pytest.approx([2 * (0.5 + 1), 1 - 2], rel=1e-13)


def test_where_there_is_none_the_sides_are_told_if_they_have_one():
    ground = Unilateral(x, restitution=e, name="R")
    swing = System({x: v, v: -x + 1 + ground.reaction}, parameters={e: 0.8})
    d = solve(swing, (0, 5), {x: 2, v: 0}, by=["x"], **TIGHT).derivatives
    below, above = d.sides("x")
    assert below == pytest.approx([np.cos(5), -np.sin(5)], abs=1e-9)  # it misses the ground
    assert above is None  # the impact's share grows as the root of the distance
    meet = System({x: -1, y: -1, z: sp.sign(x) * a + sp.sign(x + y) * sp.sign(y)}, parameters={a: 0.5})
    d = solve(meet, (0, 3), {x: 1, y: 1, z: 0}, by=["x", a], **TIGHT).derivatives
    # z(3) = (x0 - (3 - x0)) a + ..., where sign(x + y) sign(y) is -1 for |x0 - 1|/2, before or behind t = 1.
    below, above = d.sides("x")
    assert (below[2], above[2]) == pytest.approx((2 * 0.5 + 1, 2 * 0.5 - 1), abs=1e-9)
    below, above = d.sides(a)
    assert (below[2], above[2]) == pytest.approx((-1, -1), abs=1e-9)
    with pytest.raises(ValueError, match="differentiated is by x, a"):
        d.sides("y")


@pytest.mark.parametrize(
    "more", [0, sp.Max(0, y - 0.9) ** sp.Rational(3, 2)], ids=["by series", "by collocation"]
)
def test_a_start_on_a_surface_that_holds_it_is_refused_across_it_alone(more):
    system = System({x: -2 * sp.sign(x) + y, y: -a * y, z: more}, parameters={a: 1.0})
    start, options = {x: 0, y: 1, z: 0}, TIGHT if more == 0 else {"rtol": 1e-12, "atol": 1e-14}
    run = solve(system, (0, 1), start, by=["x"], **options)
    with pytest.raises(NoDerivative, match="x leads out of that"):
        _ = run.derivatives.end
    with pytest.raises(NoDerivative, match="x leads out of that"):
        objective = Objective(system, final(y), (0, 1), start, ["x"], **options)
        objective(objective.start)
    d = solve(system, (0, 1), start, by=["y", a], **options).derivatives
    assert d.end[:2] == pytest.approx(np.array([[0, 0], [np.exp(-1), -np.exp(-1)]]), abs=1e-11)


def test_an_ambiguity_is_refused():
    run = solve(System({x: a * sp.sign(x)}, parameters={a: 1.0}), (0, 1), {x: 0}, by=[a])
    with pytest.raises(NoDerivative, match="not unique"):
        _ = run.derivatives.end


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["q"], "'q', which has no derivative here"),
        (["lam"], "'lam', which has no derivative here"),
        (["rho", "rho"], "twice"),
        ("rho", "by"),
        ([3], "by"),
    ],
)
def test_names_that_have_none_are_refused_at_the_door(names, message):
    with pytest.raises((ValueError, TypeError), match=message):
        solve(friction_oscillator(), (0, 1), {"y": 0.5, "v": 0.3, "z": 0}, by=names)


def test_diffusions_scipys_methods_and_backward_runs_say_that_they_have_none():
    start, smooth = {"y": 0.5, "v": 0.3, "z": 0}, friction_oscillator().smoothed(1e-3)
    with pytest.raises(ValueError, match="SciPy"):
        solve(smooth, (0, 1), start, method="Radau", by=["rho"])
    with pytest.raises(ValueError, match="diffusion"):
        solve(smooth, (0, 1), start, noise=Diffusion({v: 0.1}, step=0.01), by=["rho"])
    with pytest.raises(ValueError, match="decreases"):
        solve(friction_oscillator(), (1, 0), start, by=["rho"])


def test_times_outside_the_span_and_unknown_names():
    d = solve(friction_oscillator(), (0, 1), {"y": 0.5, "v": 0.3, "z": 0}, by=["rho"]).derivatives
    with pytest.raises(ValueError, match="leaves the solved span"):
        d(2.0)
    with pytest.raises(KeyError, match="no state"):
        d["nothing"]
    with pytest.raises(ValueError, match="dense"):
        d(0.5, "friction")
    assert "rho" in repr(d) and d(0.5, "y").shape == (1,)


@pytest.mark.parametrize("rests", ["guarded", "clipped"])
@pytest.mark.parametrize("fall", [1, sp.Rational(7, 3)])
def test_a_state_that_leaves_its_bound_as_the_input_jumps_has_forgotten_how_it_came_to_it(rests, fall):
    """z falls to 0, rests there until t = 1 and then grows as a (t - 1): dz/da = t - 1, dz/dz0 = 0."""
    rate = sp.Piecewise((-fall, t < 1), (a, True))
    clipped = sp.Piecewise((rate, z > 0), (sp.Max(rate, 0), True))
    guarded = sp.Piecewise((0, sp.And(z <= 0, rate < 0)), (rate, True))
    system = System({z: guarded if rests == "guarded" else clipped}, time=t, parameters={a: 2})
    run = solve(system, (0, 1.5), {z: 0.3}, by=[a, "z"])
    assert run.x[0, -1] == pytest.approx(1, abs=1e-12)
    assert run.derivatives.end[0] == pytest.approx([0.5, 0], abs=1e-12)


def test_a_start_at_rest_on_a_surface_that_others_begin_beside_has_no_derivative_by_that_start():
    """x' = 0 for x > 0 until t = 1, then x' = a + sign(x): from beside 0 it would go on otherwise."""
    system = System({x: sp.Piecewise((0, t < 1), (a / 2 + sp.sign(x), True))}, time=t, parameters={a: 1})
    with pytest.raises(NoDerivative):
        solve(system, (0, 2), {x: 0.0}, by=["x"]).derivatives.end  # noqa: B018
