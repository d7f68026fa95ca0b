"""Notation that people write: Mod and floor, impulses, y(t), mass matrices, places in a family.

Guards: definition/notation.py, definition/reading.py.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from sympy.physics import mechanics

from pwsmooth import Drive, Event, Family, Memory, Strobe, Switch, System, Unilateral, find_orbit, follow, solve

t, x, v, w = sp.symbols("t x v w", real=True)
T, d, b, c, q = sp.symbols("T d b c q", real=True)


# ---- steps of time and of states


def test_a_duty_cycle_written_with_mod_has_its_closed_form():
    on = sp.Piecewise((1, sp.Mod(t, T) < d * T), (0, True))
    filtered = System({x: on - x}, time=t, parameters={T: 0.5, d: 0.3})
    solution = solve(filtered, (0, 20), {x: 0})
    exact = 0.0
    for _ in range(40):
        exact = (1 + (exact - 1) * math.exp(-0.15)) * math.exp(-0.35)
    assert abs(solution["x"][-1] - exact) < 1e-9


def test_floor_ceiling_and_frac_of_a_state_are_what_numpy_says():
    stairs = System({x: 1, v: sp.floor(x) * sp.frac(x) + sp.ceiling(2 * x) + sp.Mod(x, -1)})
    solution = solve(stairs, (0, 5.25), {x: -2.3, v: 0})

    def rate(at):
        return np.floor(at) * (at % 1) + np.ceil(2 * at) + at % -1

    jumps = [-2.3, *(k / 2 for k in range(-4, 6)), 2.95]
    exact = sum(quad(rate, a, e)[0] for a, e in zip(jumps, jumps[1:], strict=False))
    assert abs(solution["v"][-1] - exact) < 1e-9
    # Integers lie on one more surface than halves do: 2x = 2, 4, ... is one of the second as well.
    assert {round(event.time - 2.3, 6) for event in solution.events} == {k / 2 for k in range(-4, 6)}


def test_the_fraction_of_what_rests_between_events_is_its_own():
    """Of a parameter, of a drive that holds, of a memory in the rates and in its update."""
    held, last = sp.Symbol("held", real=True), Memory("last", 0.3)
    drive = Drive([0, 1, 2, 3], [0.3, 1.7, -0.4, 5.0], kind="hold")
    system = System(
        {x: sp.frac(d) + sp.frac(held) + last},
        time=t, parameters={d: 2.75}, drives={held: drive},
        events=[Event(at=[0.5, 1.5, 2.5], update={last: sp.frac(last + held)})],
    )  # fmt: skip
    solution = solve(system, (0, 3), {x: 0})
    # The memory is frac(.3 + .3) from 1/2 on, then frac(.6 + 1.7), then frac(.3 - .4).
    remembered = 0.3 / 2 + 0.6 + 0.3 + 0.9 / 2
    assert solution["x"][-1] == pytest.approx(3 * 0.75 + (0.3 + 0.7 + 0.6) + remembered, abs=1e-12)


def test_random_staircases_agree_with_exact_arithmetic():
    """x' = q + d floor(b x + c), followed from step to step in rational numbers; where both sides push, it stays."""
    model = System({x: q + d * sp.floor(b * x + c)}, parameters={q: 1, d: 1, b: 1, c: 0})
    rng = np.random.default_rng(7)
    stuck = 0
    for _ in range(200):
        values = [Fraction(int(rng.integers(-40, 41)), 8) for _ in range(5)]
        values[2] = values[2] or Fraction(1)
        Q, D, B, C, at = values
        start, left = at, Fraction(3)
        steps = 0
        while left > 0 and steps < 400:
            steps += 1
            u = B * at + C
            above = Q + D * math.floor(u)
            if u == math.floor(u):  # on a surface: the side to which it goes, or none
                under = Q + D * (math.floor(u) - 1)
                if B * above > 0 or B * under < 0:
                    if B * above > 0 and B * under < 0:
                        break  # it could go either way
                    speed = above if B * above > 0 else under
                else:
                    stuck += 1
                    break
            else:
                speed = above
            if speed == 0:
                break
            ahead = math.floor(u) + 1 if B * speed > 0 else math.ceil(u) - 1
            time = min(left, (ahead - u) / (B * speed))
            at, left = at + speed * time, left - time
        else:
            if left > 0:
                continue
        if B * at + C == math.floor(B * at + C) and at == start:
            continue  # a start on a surface with several ways
        solution = solve(
            model, (0, 3), {x: float(start)}, parameters={q: float(Q), d: float(D), b: float(B), c: float(C)}
        )
        # With a slope of 5*5 an error grows by e^75 at most between steps of the stairs: none does, they are flat.
        assert abs(solution["x"][-1] - float(at)) < 1e-7, values
    assert stuck > 20


def test_a_quantised_feedback_slides_on_its_step():
    solution = solve(System({x: sp.Rational(5, 2) - sp.floor(x)}), (0, 5), {x: 0.2})
    assert solution["x"][-1] == pytest.approx(3.0, abs=1e-12)
    assert solution.itinerary[-1].endswith("sliding")
    # Between floor = 2 and floor = 3 half of each: lambda 0.
    assert solution["sgn(sin(pi*x))"][-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("method", ["auto", "rk"])
def test_an_angle_taken_modulo_a_turn(method):
    wheel = System({x: v, v: sp.pi - sp.Mod(x, 2 * sp.pi)})
    solution = solve(wheel, (0, 10), {x: 40.0, v: 5}, method=method, max_step=0.5)
    # Between the jumps the exact solution of x'' = pi + 2 pi n - x.
    state, time = np.array([40.0, 5.0]), 0.0
    while time < 10:
        middle = math.pi + 2 * math.pi * math.floor(
            state[0] / (2 * math.pi) + (1e-9 if state[1] > 0 else -1e-9)
        )

        def at(s, state=state, middle=middle):
            y = state[0] - middle
            return np.array(
                [middle + y * math.cos(s) + state[1] * math.sin(s), state[1] * math.cos(s) - y * math.sin(s)]
            )

        grid = np.linspace(1e-6, 10 - time, 20001)
        out = [s for s in grid if abs(at(s)[0] - middle) >= math.pi]
        if not out:
            state, time = at(10 - time), 10.0
            break
        hit = brentq(
            lambda s, at=at, middle=middle: abs(at(s)[0] - middle) - math.pi,
            out[0] - grid[1] + grid[0],
            out[0],
            xtol=1e-15,
        )
        state, time = at(hit), time + hit
    assert np.allclose(solution.x[:, -1], state, atol=1e-7)


def test_a_ramp_of_mod_has_the_flip_of_its_linear_maps():
    """The buck converter with the standard values; the flip of its period-1 orbit from matrix exponentials."""
    i, E = sp.symbols("i E", real=True)
    L, C, R, A, reference, low, high, period = 20e-3, 47e-6, 22.0, 8.4, 11.3, 3.8, 8.2, 400e-6
    ramp = low + (high - low) * sp.Mod(t / T, 1)
    buck = System(
        {v: i / C - v / (R * C), i: -v / L + E / L * sp.Heaviside(ramp - A * (v - reference))},
        time=t, parameters={T: period, E: 24},
    )  # fmt: skip
    (flip,) = follow(find_orbit(buck, {v: 12, i: 0.5}, seen=Strobe(T), transient=200), {"E": 25}).specials
    M = np.array([[-1 / (R * C), 1 / C], [-1 / L, 0]])

    def lowest(voltage):
        on = np.linalg.solve(M, [0, -voltage / L])

        def start(off):
            before, after = expm(M * off), expm(M * (period - off))
            return np.linalg.solve(np.eye(2) - after @ before, on - after @ on)

        def above(off):
            return low + (high - low) * off / period - A * ((expm(M * off) @ start(off))[0] - reference)

        grid = np.linspace(1e-7, period - 1e-7, 400)
        signs = np.sign([above(off) for off in grid])
        first = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
        off = brentq(above, grid[first], grid[first + 1], xtol=1e-18)
        f0 = M @ expm(M * off) @ start(off)
        f1, normal = f0 + [0, voltage / L], np.array([-A, 0])
        saltation = np.eye(2) + np.outer(f1 - f0, normal) / ((high - low) / period + normal @ f0)
        return np.linalg.eigvals(expm(M * (period - off)) @ saltation @ expm(M * off)).real.min()

    exact = brentq(lambda voltage: lowest(voltage) + 1, 24.3, 24.8, xtol=1e-12)
    assert flip.kind == "flip"
    assert abs(flip.parameter - exact) < 10 * max(flip.uncertainty, 1e-9)


def test_steps_in_the_elements_of_a_family_are_those_of_one_element():
    chain = Family(12)
    (y,) = chain.symbols("y")
    (a,) = chain.symbols("a")
    values = [1 + k / 7 for k in range(12)]
    together = solve(System({y: a - sp.floor(y) * y / 3}, parameters={a: values}), (0, 6), {y: 0.3})
    alone = System({x: b - sp.floor(x) * x / 3}, parameters={b: 1})
    for k in (0, 3, 11):
        one = solve(alone, (0, 6), {x: 0.3}, parameters={b: values[k]})["x"][-1]
        assert together.x[k, -1] == pytest.approx(one, abs=1e-9)


# ---- impulses


def test_an_impulse_is_a_jump_of_its_strength():
    t0, J = sp.symbols("t0 J", positive=True)
    swing = System({x: w, w: -x + J * sp.DiracDelta(2 * t - 2 * t0)}, time=t, parameters={t0: 1, J: 4})
    solution = solve(swing, (0, 3), {x: 0, w: 0})
    assert np.allclose(solution.x[:, -1], [2 * math.sin(2), 2 * math.cos(2)], atol=1e-8)
    assert solution.events[0].time == 1.0


@pytest.mark.parametrize(
    "impulse, said",
    [
        (sp.DiracDelta(x - 1), "What the state decides is an Event"),
        (sp.DiracDelta(t**2 - 1), "an impulse is DiracDelta"),
        (sp.DiracDelta(t - 1, 1), "an impulse is DiracDelta"),
        (sp.DiracDelta(t - 1) ** 2, "not linear"),
        (w * sp.DiracDelta(t - 1), "the product has no value"),
    ],
)
def test_what_is_no_impulse_is_refused(impulse, said):
    with pytest.raises(ValueError, match=said):
        System({x: w, w: -x + impulse}, time=t)


# ---- states as functions of time


def test_states_may_be_functions_of_time():
    y, u = sp.Function("y"), sp.Function("u")
    clock = mechanics.dynamicsymbols._t
    Y, U = y(clock), u(clock)
    count = Memory("n", 0)
    floor = Unilateral(Y + 3, restitution=0.5, name="R")

    def written(Y, U, clock):
        return dict(
            events=[Event(Y, when=U > 0, update={count: count + 1}, name="up")],
            outputs={"energy": (Y**2 + U**2) / 2 + count},
            contacts=[floor],
        )

    lam = Switch("lam", U)
    rates = {Y: U, U: -Y - lam / 5 + sp.cos(clock) + floor.reaction}
    functions = System(rates, **written(Y, U, clock))
    a, e = sp.symbols("y u", real=True)
    plain_floor = Unilateral(a + 3, restitution=0.5, name="R")
    floor = plain_floor
    plain = System(
        {a: e, e: -a - Switch("lam", e) / 5 + sp.cos(clock) + plain_floor.reaction},
        time=clock, **written(a, e, clock),
    )  # fmt: skip
    one = solve(functions, (0, 20), {Y: 2, U: 0})
    other = solve(plain, (0, 20), {a: 2, e: 0})
    assert one.x.tobytes() == other.x.tobytes()
    assert one["n"][-1] == other["n"][-1] > 0
    assert one[Y].tobytes() == one["y"].tobytes()
    # Keys may be the derivatives themselves, as those of KanesMethod.kindiffdict().
    assert System({Y.diff(): U, U: -Y}).states == System({Y: U, U: -Y}).states


def test_functions_of_other_times_are_refused():
    y = sp.Function("y")
    with pytest.raises(ValueError, match="at the present time"):
        System({y(t): -y(t - 1)})
    with pytest.raises(ValueError, match="write the state or the expression"):
        System({y(t): -(y(t).diff(t) ** 3)})


# ---- mass matrices


def _links(n):
    """Kane's equations of n links of a pendulum with Coulomb friction in its joints."""
    angles, speeds = mechanics.dynamicsymbols(f"q:{n}"), mechanics.dynamicsymbols(f"u:{n}")
    frame, point = mechanics.ReferenceFrame("N"), mechanics.Point("O")
    point.set_vel(frame, 0)
    bodies, loads, before = [], [], None
    for k in range(n):
        link = frame.orientnew(f"A{k}", "axis", [angles[k], frame.z])
        link.set_ang_vel(frame, speeds[k] * frame.z)
        end = point.locatenew(f"P{k}", link.x)
        end.v2pt_theory(point, frame, link)
        bodies.append(mechanics.Particle(f"B{k}", end, 1))
        friction = sp.sign(speeds[k] - (speeds[k - 1] if k else 0)) / 10
        loads += [(end, 9.81 * frame.x), (link, -friction * frame.z)]
        loads += [(before, friction * frame.z)] if before else []
        point, before = end, link
    kane = mechanics.KanesMethod(
        frame, q_ind=list(angles), u_ind=list(speeds), kd_eqs=[a.diff() - u for a, u in zip(angles, speeds)]
    )
    kane.kanes_equations(bodies, loads)
    return kane, list(angles), list(speeds)


def test_a_mass_matrix_gives_what_its_inverse_by_hand_gives():
    kane, angles, speeds = _links(3)
    start = dict.fromkeys(angles, 0.8) | dict.fromkeys(speeds, 0)
    forcing = dict(zip(speeds, kane.forcing))
    short = System(kane.kindiffdict(), mass_matrix=kane.mass_matrix, forcing=forcing)
    full = System(mass_matrix=kane.mass_matrix_full, forcing=dict(zip(angles + speeds, kane.forcing_full)))
    by_hand = System(dict(zip(angles + speeds, kane.mass_matrix_full.LUsolve(kane.forcing_full))))
    ends = [solve(system, (0, 4), start, t_eval=[4.0]).x[:, 0] for system in (short, full, by_hand)]
    assert np.allclose(ends[0], ends[1], atol=1e-9)
    assert np.allclose(ends[0], ends[2], atol=1e-6)
    assert solve(short, (0, 4), start).events


def test_a_mass_matrix_that_fits_no_states_is_refused():
    with pytest.raises(ValueError, match="belong together"):
        System({x: v}, forcing={v: -x})
    with pytest.raises(ValueError, match="shape"):
        System({x: v}, mass_matrix=sp.eye(2), forcing={v: -x})
    with pytest.raises(ValueError, match="own column"):
        System(mass_matrix=sp.Matrix([[0, 1], [1, 0]]), forcing={x: v, v: -x})
    with pytest.raises(TypeError, match="give a matrix"):
        System({x: v}, mass_matrix="eye", forcing={v: -x})


def test_columns_of_forces_belong_to_the_states_that_are_listed():
    kane, angles, speeds = _links(2)
    full = {"mass_matrix": kane.mass_matrix_full, "forcing": kane.forcing_full}
    named = System(**full | {"forcing": dict(zip(angles + speeds, kane.forcing_full))})
    for states in (angles + speeds, tuple(angles + speeds), kane.q.col_join(kane.u)):
        assert System(states, **full).model == named.model
    for states, forcing in (
        (kane.kindiffdict(), kane.forcing),
        (angles, kane.forcing_full),
        ((), kane.forcing_full),
        (angles + speeds, kane.forcing_full.T),
        (list(kane.kindiffdict().items()), kane.forcing),
    ):
        with pytest.raises(
            ValueError, match=r"`forcing` is a matrix.*give a mapping forcing=dict\(zip\(states"
        ):
            System(states, mass_matrix=kane.mass_matrix, forcing=forcing)


def test_the_methods_of_mechanics_are_told_what_to_write():
    kane, _, _ = _links(1)
    (a,) = mechanics.dynamicsymbols("a:1")
    lagrange = mechanics.LagrangesMethod(a.diff() ** 2 / 2 + sp.cos(a), [a])
    lagrange.form_lagranges_equations()
    for K in (kane, lagrange):
        with pytest.raises(TypeError, match=rf"is a {type(K).__name__} K; write System.from_mechanics\(K\)"):
            System(K)
        assert solve(System.from_mechanics(K), (0, 1), [0.1, 0]).success


def test_a_mass_matrix_that_moves_agrees_with_scipy():
    """(2 + cos x) v' + v w' = -x,  v v' + (3 + x**2) w' = -w, in one block."""
    M = sp.Matrix([[2 + sp.cos(x), v / 3], [v / 3, 3 + x**2]])
    system = System({x: v}, mass_matrix=M, forcing={v: -x, w: -w})
    solution = solve(system, (0, 8), {x: 1, v: 0.5, w: 1})

    def rate(_, y):
        inertia = np.array([[2 + np.cos(y[0]), y[1] / 3], [y[1] / 3, 3 + y[0] ** 2]])
        return [y[1], *np.linalg.solve(inertia, [-y[0], -y[2]])]

    exact = solve_ivp(rate, (0, 8), [1, 0.5, 1], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert np.allclose(solution.x[:, -1], exact, atol=1e-8)


# ---- places in a family


def test_a_chain_is_coupled_to_what_stands_at_its_end():
    chain = Family(9)
    y, u = chain.symbols("y u")
    (end,) = (sp.symbols("end", real=True),)
    tip = chain.at(y, -1)
    force = chain.neighbour(y, -1, outside=0) - 2 * y + chain.neighbour(y, 1, outside=end)
    system = System({y: u, u: force, end: tip - end})
    solution = solve(system, (0, 5), {y: 0, u: 0, end: 1})
    assert tip.name == "y_9" and chain.at(y, 2).name == "y_2"
    assert [s.name for s in chain.at(y, slice(7, None))] == ["y_7", "y_8", "y_9"]
    assert [s.name for s in chain.at(y, slice(None, None, 4))] == ["y_1", "y_5", "y_9"]
    M = np.zeros((19, 19))
    for k in range(9):
        M[k, 9 + k] = 1
        M[9 + k, k] = -2
        if k:
            M[9 + k, k - 1] = 1
        M[9 + k, k + 1 if k < 8 else 18] = 1
    M[18, 8], M[18, 18] = 1, -1
    exact = expm(5 * M) @ np.eye(19)[18]
    assert solution[tip][-1] == pytest.approx(exact[8], abs=1e-8)
    for place in (0, 10, -10):
        with pytest.raises(ValueError, match="`place`"):
            chain.at(y, place)
    with pytest.raises(TypeError, match="this family"):
        Family(3).at(y, 1)


# ---- nests of functions, and logic


def test_switches_of_nested_functions_of_parameters_are_values():
    # sgn(max(p, q)) = 1 for p = 0.3, q = 0.7, and so on: x' = 1 - x from 0.
    p, q = sp.symbols("p q", real=True)
    nests = (
        sp.sign(sp.Max(p, q)),
        sp.sign(1 + sp.sign(sp.Abs(p) - 1) / 2),
        sp.Heaviside(sp.Max(p, 1) - sp.Rational(1, 2)),
        sp.Abs(sp.Piecewise((1, q > sp.Rational(1, 2)), (p, True))),
        sp.Heaviside(sp.Piecewise((p, q > sp.Rational(1, 2)), (q, p < 0), (1, True)) + sp.Rational(1, 2)),
    )
    for nest in nests:
        values = {s: value for s, value in ((p, 0.3), (q, 0.7)) if nest.has(s)}
        run = solve(System({x: nest - x}, parameters=values), (0, 1), {x: 0})
        assert run["x"][-1] == pytest.approx(1 - np.exp(-1), abs=1e-8)


@pytest.mark.parametrize(
    ("condition", "ticks"),
    [
        (sp.Xor(x > sp.Rational(1, 2), x > sp.Rational(3, 2)), 1),
        (sp.Implies(x > sp.Rational(1, 2), x > sp.Rational(3, 2)), 1),
        (sp.Equivalent(x > sp.Rational(1, 2), x > sp.Rational(3, 2)), 1),
        (sp.ITE(x > sp.Rational(3, 2), x > 0, x > 5), 1),
    ],
)
def test_a_guard_takes_every_logical_function(condition, ticks):
    # Ticks at 1 and 2 with x = t.
    n = Memory("n", 0)
    run = solve(System({x: 1}, events=[Event(every=1, when=condition, update={n: n + 1})]), (0, 2.5), {x: 0})
    assert run["n"][-1] == ticks


def test_a_power_of_minus_one_with_a_sign_above_is_a_cosine():
    # cos(pi sign x), which sympy writes so, is -1 on both sides.
    assert solve(System({x: sp.cos(sp.pi * sp.sign(x)) + 2}), (0, 1), {x: -0.5})["x"][-1] == pytest.approx(
        0.5, abs=1e-9
    )
