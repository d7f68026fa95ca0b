"""Families event by event of their elements: what an event changes is renewed, and nothing else.

Numbers that stand here without a formula: the reference chain by order 32 with all elements renewed at every event, the
front's speeds from the closed form that stands beside them. Random assemblies: tests/fuzz/assemblies.py.

Guards: codegen/patch.py, codegen/families/memory.py, kernels/local/, kernels/fresh.py, paths/patches.py.
"""

import numpy as np
import pytest
import sympy as sp
from chain_models import BELT, belt, bistable, chain, networks, start_of, with_templates
from family_models import MODELS, template_from

from pwsmooth import Algebraic, Event, Family, Kicks, Switch, System, solve
from pwsmooth.laws.friction import LuGre, StaticKinetic
from pwsmooth.paths import locality
from tests.fuzz.assemblies import compared

TIGHT = {"rtol": 1e-14, "atol": 1e-15}
t, v, x = sp.symbols("t v x", real=True)


@pytest.fixture(scope="module")
def systems():
    """The reference systems, made once."""
    kept = {}

    def of(build, *arguments, **options):
        key = build, arguments, tuple(options.items())
        if key not in kept:
            kept[key] = with_templates(build, *arguments, **options)
        return kept[key]

    return of


def counted(system, span, start, **options):
    """(Solution, elements renewed) of a run by elements."""
    solution = solve(system, span, start, local=True, **({"t_eval": span} | options))
    return solution, solution.cost["renewed"]


# ---- reference problems

REFERENCE = [
    # n, Fs/Fk, events, releases, first event and its element from 0, x_0, x_4, sum x^2, sum v^2, stuck
    (10, 1.5, 51, 27, 1.344647279422, 3, 0.979159963080, 0.838784734864, 7.93246224366, 0.193677750626, 6),
    (10, 2**0.5, 76, 41, 1.161203949211, 1, 1.320844443416, 1.182240516588, 13.1986314599, 0.230180859529, 3),
    (1000, 1.5, 6834, 3483, 0.029554868305, 987, 0.971852199069, 0.842502954509, 1118.31806943, 20.4561374308, 620),
]  # fmt: skip


@pytest.mark.parametrize("row", REFERENCE, ids=lambda row: f"{row[0]} blocks, {row[1]:.3f}")
def test_the_reference_chain_moves_as_by_order_32(systems, row):
    n, r, events, releases, first, element, x_0, x_4, places, speeds, stuck = row
    system, start = systems(chain, n, r, work=True)
    run = solve(system, (0, 30), start, t_eval=[0, 30], local=True, **TIGHT)
    kinds = [e.kind for e in run.events]
    assert (len(kinds), kinds.count("slip by fold"), kinds.count("stick")) == (
        events,
        releases,
        events - releases,
    )
    assert run.events[0].switch == f"lam_{element + 1}"
    assert run.events[0].time == pytest.approx(first, abs=1e-11)
    y, w = run.x[:n, -1], run.x[n : 2 * n, -1]
    # Twelve digits are given; errors of 1e-13 an element.
    assert [y[0], y[4]] == pytest.approx([x_0, x_4], abs=2e-12)
    assert [np.sum(y**2), np.sum(w**2)] == pytest.approx([places, speeds], rel=1e-11)
    assert np.sum(run.status[:, -1] == 0) == stuck


@pytest.mark.parametrize("n", [10, 1000])
def test_energy_is_what_the_belt_gives_less_what_friction_takes(systems, n):
    system, start = systems(chain, n, 1.5, work=True)
    run = solve(system, (0, 30), start, t_eval=[0, 30], local=True, **TIGHT)
    y, w, given, taken = run.x.reshape(4, n, 2)
    energy = (((w - BELT) ** 2 + y**2) / 2).sum(axis=0) + (np.diff(y, axis=0) ** 2).sum(axis=0)  # kc/2 = 1
    residual = energy[1] - energy[0] - (given - taken)[:, 1].sum()
    # Slip by slip, friction takes a positive work.
    assert abs(residual) <= 1e-12 * (np.abs(given[:, 1]).sum() + taken[:, 1].sum())


@pytest.mark.parametrize(("n", "end", "slips"), [(1000, 60, 4), (100, 600, 44)])
def test_equal_blocks_slip_as_one_block_does(systems, n, end, slips):
    far, omega = 0.5, 1.0  # A = (Fs - Fk)/k, w = sqrt k
    system = systems(belt, n, 1.5, (1.0,) * n)
    run = solve(system, (0, end), start_of(system, np.zeros(n)), t_eval=[0, end], local=True, **TIGHT)
    slip = (2 * np.pi - 2 * np.arctan(far * omega / BELT)) / omega
    period = 2 * far / BELT + slip
    expected = np.sort([15 + m * period + late for m in range(slips) for late in (0, slip)])
    expected = np.repeat(expected[expected < end], n)
    assert len(run.events) == len(expected)
    assert np.abs(run.events.times - expected).max() <= 1e-11 * end / 60
    assert np.ptp(run.x[:n, -1]) <= 1e-14 and np.ptp(run.x[n:, -1]) <= 1e-14


def test_a_normal_mode_of_sliding_blocks_rings_on(systems):
    n, m, end = 300, 150, 200.0
    system = systems(belt, n, None, (1.0,) * n).with_parameters({"u": -2.0})
    shape = 0.3 * np.cos(np.pi * m * (np.arange(n) + 0.5) / n)
    omega = np.sqrt(1 + 8 * np.sin(np.pi * m / (2 * n)) ** 2)
    start = start_of(system, -1 + shape, 0.0)
    run = solve(system, (0, end), start, t_eval=[0, end], local=True, **TIGHT)
    assert not len(run.events)
    assert np.abs(run.x[:n, -1] - (-1 + shape * np.cos(omega * end))).max() <= 1e-12


# a = 1/2 - (1/pi) int_0^oo c dk/((1 + 4 D sin^2(k/2))^2 + c^2 k^2) for D = 1, solved for c.
SPEEDS = {0.2: 0.907986526, 0.25: 0.527544201}


@pytest.mark.parametrize("a", SPEEDS)
def test_a_front_runs_at_its_speed(systems, a):
    n = 50
    system = systems(bistable, n).with_parameters({"a": a})
    run = solve(
        system, (0, 30 / SPEEDS[a]), {"v": [1.0] * 10 + [0.0] * (n - 10)}, t_eval=[0], local=True, **TIGHT
    )
    times = run.event_times("crossing")
    # From the fifteenth element of the way on, with as many before the end: the start is forgotten to 1e-9.
    assert 10 / (times[25] - times[15]) == pytest.approx(SPEEDS[a], abs=2e-9)


def test_a_front_is_pinned_where_it_has_no_speed(systems):
    n = 40
    system = systems(bistable, n).with_parameters({"a": 0.28})  # pinned from 0.27639 on
    run = solve(system, (0, 100), {"v": [1.0] * 10 + [0.0] * (n - 10)}, t_eval=[0, 100], local=True)
    # Pinned: two geometric tails that meet, with z + 1/z = 3.
    z = (3 - 5**0.5) / 2
    tail = z ** np.arange(1, 8) / (1 + z)
    assert not len(run.events)
    assert run.x[10:17, -1] == pytest.approx(tail, abs=1e-7)


# ---- structure


def loners(strengths):
    return belt(len(strengths), 1.5, strengths, couple=None)


def test_elements_without_links_are_so_many_runs_to_the_bit(systems):
    strengths = tuple(1 + 0.06 * ((7 * i) % 5) for i in range(7))
    places = 0.3 * np.sin(1.7 * np.arange(7) + 0.3)
    order = [4, 2, 0, 6, 5, 1, 3]

    def run(chosen):
        system = systems(loners, tuple(strengths[i] for i in chosen))
        return solve(system, (0, 50), start_of(system, places[chosen]), t_eval=[0, 17.3, 50], local=True)

    together, shuffled = run(list(range(7))), run(order)
    assert len(together.events) > 20
    for i in range(7):
        alone = run([i])
        of = [e for e in together.events if e.switch == f"lam_{i + 1}"]
        k = order.index(i)
        for other, rows in ((together, (i, 7 + i)), (shuffled, (k, 7 + k))):
            np.testing.assert_array_equal(other.x[list(rows)], alone.x)
        assert [e.time for e in of] == alone.events.times.tolist()


def sliders(n):
    """Rate and state with the aging law, a.01 b.02: log of speed and of state, in D_c/V_pl; an event at 2.2e4 V_pl."""
    family = Family(n)
    speed, state = family.symbols("w p")
    moves, ages = sp.exp(speed), sp.exp(-state)
    pull = sp.Rational(1, 500) * (1 - moves) - sp.Rational(1, 50) * (ages - moves)
    rates = {state: ages - moves, speed: pull / (sp.Rational(1, 100) + 5.4e-11 * moves)}
    return System(rates, events=[Event(speed - 10, direction=1)]), speed, state


def test_sliders_that_creep_cost_nothing_while_one_slips():
    """Over 19 decades of speed each element takes the steps that it would take alone."""
    system, speed, state = sliders(60)
    start, asked = (
        {speed: -1 - 0.01 * np.arange(60), state: 0},
        {"rtol": 1e-11, "atol": 1e-11, "max_steps": 10**6},
    )
    run, renewed = counted(system, (0, 700), start, **asked)
    times = np.array([event.time for event in run.events]).reshape(-1, 60)
    assert np.diff(times, axis=0)[1:] == pytest.approx(132.8624314, abs=1e-6)
    alone, speed, state = sliders(1)
    one = solve(alone, (0, 700), {speed: -1, state: 0}, **asked)
    assert len(one.events) == len(times) and renewed < 65 * one.cost["steps"]


def test_a_mirrored_chain_moves_as_a_mirror_image(systems):
    n, i = 60, np.arange(60)
    strengths, places = 1 + 0.06 * ((7 * i) % 5), 0.3 * np.sin(1.7 * i + 0.3)
    runs = []
    for way in (1, -1):
        system = systems(belt, n, 1.5, tuple(strengths[::way]))
        runs.append(
            solve(system, (0, 30), start_of(system, places[::way]), t_eval=[0, 30], local=True, **TIGHT)
        )
    y, w = runs[1].x.reshape(2, n, 2)
    np.testing.assert_allclose(np.concatenate([y[::-1], w[::-1]]), runs[0].x, rtol=0, atol=1e-12)


def test_a_ring_has_no_first_element(systems):
    n, i = 60, np.arange(60)
    strengths, places = 1 + 0.06 * ((7 * i) % 5), 0.3 * np.sin(1.7 * i + 0.3)
    runs = []
    for by in (0, 23):
        system = systems(belt, n, 1.5, tuple(np.roll(strengths, by)), couple="ring")
        start = start_of(system, np.roll(places, by))
        runs.append(solve(system, (0, 30), start, t_eval=[0, 30], local=True, **TIGHT))
    shifted = np.roll(runs[0].x.reshape(2, n, 2), 23, axis=1).reshape(2 * n, 2)
    np.testing.assert_allclose(runs[1].x, shifted, rtol=0, atol=1e-12)


def test_two_networks_without_a_link_are_one_network_twice(systems):
    n = 40
    table = networks(n)
    strengths, places = np.linspace(1, 1.3, n), 0.4 * np.sin(np.arange(n))
    one = with_templates(belt, n, 1.5, strengths, table=table)
    two = with_templates(belt, 2 * n, 1.5, np.tile(strengths, 2), table=np.concatenate([table, table + n]))
    runs = [
        solve(system, (0, 20), start_of(system, y), t_eval=[0, 20], local=True, **TIGHT)
        for system, y in ((one, places), (two, np.tile(places, 2)))
    ]
    both = np.tile(runs[0].x.reshape(2, n, 2), (1, 2, 1)).reshape(4 * n, 2)
    np.testing.assert_allclose(runs[1].x, both, rtol=0, atol=1e-12)
    assert len(runs[1].events) == 2 * len(runs[0].events) > 20


# ---- what it costs, counted


def test_an_event_renews_as_many_elements_in_a_long_chain_as_in_a_short_one(systems):
    each = []
    for n in (100, 1000):
        system, start = systems(chain, n, 1.5)
        run, renewed = counted(system, (0, 30), start)
        each.append(renewed / len(run.events))
    assert each[0] < 15  # of 100
    assert each[1] < 1.1 * each[0]


def test_what_is_at_rest_costs_nothing(systems):
    # 40 blocks move; the others have nothing to do before t = 10, when k V t reaches Fs - k x.
    cost = []
    for n in (400, 4000):
        system = systems(belt, n, 1.5, (1.0,) * n)
        places = np.zeros(n)
        places[100:140] = 0.9 * np.sin(3.0 * np.arange(40))
        start = start_of(system, places)
        run, renewed = counted(system, (0, 8), start)
        _, at_once = counted(system, (0, 1e-6), start)
        assert len(run.events) > 20
        cost.append(renewed - at_once)
    assert cost[0] == cost[1]


# ---- beside the run of all


@pytest.mark.parametrize(("kc", "size", "end"), [(1e-3, 3.0, 12), (1e4, 0.003, 2)])
def test_weak_and_strong_links_are_those_of_the_run_of_all(systems, kc, size, end):
    n, i = 40, np.arange(40)
    system = systems(belt, n, None, tuple(1 + 0.06 * ((7 * i) % 5))).with_parameters({"kc": kc})
    start = start_of(system, size * np.sin(1.7 * i + 0.3))
    times = np.linspace(0, end, 9)
    whole, run = (
        solve(system, (0, end), start, local=way, t_eval=times, rtol=1e-13, atol=1e-15) for way in (False, True)
    )
    assert len(run.events) > 50
    # With Fs = Fk a slip comes to rest beside a touch of w = u every time: roundings tell its events, not its motion.
    np.testing.assert_allclose(run.x, whole.x, rtol=0, atol=1e-11)


def fire(n):
    """v' = 1 + sum of neighbours' differences, back to 0 at 1."""
    cells = Family(n)
    (u,) = cells.symbols("u")
    k = sp.Symbol("k", nonnegative=True)
    count = cells.memory("count", 0)
    pull = cells.neighbour(u, 1) - 2 * u + cells.neighbour(u, -1)
    event = Event(u - 1, direction=1, update={u: 0, count: count + 1}, name="fire")
    return System({u: 1 + k * pull}, parameters={k: 0.25}, events=[event])


@pytest.mark.parametrize(
    ("case", "start", "end"),
    [
        ("all at one instant, at the end and at times asked for", [0.0] * 10, 3.0),
        ("some start on the surface", [1.0, 0.5] * 5, 2.5),
        ("waves", [0.125 * (i % 8) for i in range(10)], 4.0),
    ],
)
def test_resets_at_instants_that_are_asked_for_are_those_of_the_run_of_all(systems, case, start, end):
    system = systems(fire, 10)
    times = np.arange(0, end + 0.25, 0.25)
    whole, run = (
        solve(system, (0, end), {"u": start, "count": 0}, t_eval=times, local=way, rtol=1e-13, atol=1e-15)
        for way in (False, True)
    )
    assert compared(whole, run) is None
    assert len(run.events) >= 10


def test_blocks_that_stick_for_ever_and_blocks_that_never_do(systems):
    n = 12
    system = systems(belt, n, None, (50.0,) * n)
    start = start_of(system, np.zeros(n), np.where(np.arange(n) < 6, BELT, 30.0))
    whole, run = (
        solve(system, (0, 3), start, t_eval=[0, 1, 3], local=way, rtol=1e-13, atol=1e-15)
        for way in (False, True)
    )
    assert compared(whole, run) is None
    assert np.all(run.status[:, -1] == 0) and np.allclose(run.x[n:, -1], BELT, atol=1e-15)


def test_a_span_of_nearly_no_length_ends_where_it_starts(systems):
    system, start = systems(chain, 10, 1.5)
    run = solve(system, (3, 3.0 + 1e-9), start, t_eval=[3], local=True)
    assert run.success and run.x[:, 0] == pytest.approx(system.initial_state(start), abs=0)


# ---- doors

blocks = Family(9)
y, w, a = blocks.symbols("y w a")
other = Family(9, name="other")
(z,) = other.symbols("z")
REASONS = {
    "its elements are written out": {"rates": {y: w, w: -sp.sign(y) - w}},
    "elements read the multipliers of others": {
        "rates": {
            y: blocks.neighbour(own := Switch("own", w), -1),
            w: (rub := Switch("s", blocks.neighbour(w, 1) - w)) - blocks.neighbour(rub, -1) - own,
        }
    },
    "it has several families": {"rates": {y: -y, z: -z}},
    "a sum over the elements acts on them": {"rates": {y: blocks.sum(y) - y}},
    "some of its states belong to no element": {"rates": {y: v - y, v: -v}},
    "multiplier A belongs to no element": {
        "rates": {y: sp.Symbol("A", real=True) - y},
        "algebraic": [Algebraic(sp.Symbol("A", real=True), sp.Symbol("A", real=True) - sp.cos(t))],
    },
    "it has sampled drives, or instants that differ": {
        "rates": {y: -y},
        "events": [Event(at=(blocks.index,), update={y: y + 1}, name="kick")],
    },
    "some function has no Taylor series everywhere": {"rates": {y: 1 / (y + 2) - sp.sqrt(y)}},
    "some function has a singular argument": {"rates": {y: -1 / (y + 2)}},
}


@pytest.mark.parametrize("reason", REASONS)
def test_a_run_that_cannot_go_by_elements_says_why(reason):
    system = System(**({"time": t} | REASONS[reason]))
    start = {s.name: 0.5 for s in (y, w, z, v) if s in REASONS[reason]["rates"]}
    with pytest.raises(ValueError, match=f"`local` is True, but {reason}"):
        solve(system, (0, 0.1), start, local=True)
    assert solve(system, (0, 0.1), start).success


def test_what_takes_the_whole_system_is_named(systems):
    system, start = systems(chain, 10, 1.5)
    for name, value in {
        "dense_output": True, "by": ["u"], "noise": Kicks(0.1, 1, on=("w_1",), seed=1),
    }.items():  # fmt: skip
        with pytest.raises(ValueError, match=f"`local` is True, but `{name}` takes the whole system"):
            solve(system, (0, 1), start, local=True, **{name: value})
    with pytest.raises(ValueError, match="`local` is True, but method 'rk'"):
        solve(system, (0, 1), start, local=True, method="rk")
    with pytest.raises((ValueError, TypeError), match="`local`"):
        solve(system, (0, 1), start, local="yes")


def test_derivatives_are_those_of_the_run_of_all(monkeypatch):
    monkeypatch.setattr(locality, "LOCAL_FROM", 10)
    with template_from(1):
        arguments, start, _ = MODELS["friction_chain"](10)
        system = System(**({"time": t} | arguments))
    derived = solve(system, (0, 1), start, t_eval=[0, 1], by=["u"])
    plain = solve(system, (0, 1), start, t_eval=[0, 1])
    np.testing.assert_allclose(plain.x, derived.x, rtol=0, atol=1e-8)
    assert derived.derivatives is not None


def test_tables_of_links_and_offsets_are_the_same_chain(systems):
    n, i = 60, np.arange(60)
    table = np.stack([np.maximum(i, 1), np.minimum(i + 2, n)], axis=1)  # an end: its own number
    strengths, places = tuple(1 + 0.06 * ((7 * i) % 5)), 0.3 * np.sin(1.7 * i + 0.3)
    offsets = systems(belt, n, 1.5, strengths)
    linked = with_templates(belt, n, 1.5, strengths, table=table)
    runs = [
        solve(s, (0, 20), start_of(s, places), t_eval=[0, 20], local=True, **TIGHT) for s in (offsets, linked)
    ]
    np.testing.assert_allclose(runs[1].x, runs[0].x, rtol=0, atol=1e-12)


def test_a_switch_of_all_at_known_times_meets_every_element():
    n = 30
    with template_from(1):
        family = Family(n)
        y, w = family.symbols("y w")
        pull = family.neighbour(y, 1) - 2 * y + family.neighbour(y, -1)
        drive = 3 * sp.sign(sp.sin(2 * t))
        system = System({y: w, w: pull - y - Switch("lam", w) + drive}, time=t)
    start = {"y": [0.1 * (i % 7) for i in range(n)], "w": 0}
    whole, run = (
        solve(system, (0, 5), start, t_eval=np.linspace(0, 5, 11), local=way, rtol=1e-13, atol=1e-15)
        for way in (False, True)
    )
    assert compared(whole, run) is None
    assert run.mult.shape == whole.mult.shape == (n + 1, 11)


def test_a_law_makes_what_it_needs_for_every_block_and_one_that_sticks_is_a_wall():
    blocks = Family(120)
    y, w = blocks.symbols("y w")
    pull = blocks.neighbour(y, 1) - 2 * y + blocks.neighbour(y, -1)
    # Static friction of two levels: formulas that hold for F_s >= F_c alone.
    law = StaticKinetic(F_s=1.5).attach(velocity=w - sp.Rational(1, 10))
    assert locality.walls(
        System({y: w, w: pull - y - law.force}, parameters=law.parameters).model.families.template
    )
    # A bristle of its own for each.
    law = LuGre().attach(velocity=w - sp.Rational(1, 10))
    system = System({y: w, w: pull - y - law.force, **law.rates}, parameters=law.parameters)
    assert [len(system.groups[name]) for name in ("y", "w", "z")] == [120] * 3


def test_blocks_whose_friction_has_a_state_of_its_own_are_walls_too():
    """What others read of one that sticks, its position, is known for ever, though its friction ages."""
    each, runs = [], []
    for n in (120, 480):
        blocks = Family(n)
        y, w, z = blocks.symbols("y w z")
        lam = Switch("lam", w - sp.Rational(1, 10))
        pull = blocks.neighbour(y, 1) - 2 * y + blocks.neighbour(y, -1)
        system = System({y: w, w: 2 * pull - y - lam * (1 + z / 2), z: 1 - lam**2 - z})
        start = {y: 0.5 * np.sin(np.arange(n) ** 2), w: 0.1, z: 1.0}
        run, renewed = counted(system, (0, 30), start, rtol=1e-11)
        each.append(renewed / len(run.events))
        runs.append((system, start, run))
    assert each[1] < 1.2 * each[0], each
    system, start, run = runs[0]
    whole = solve(system, (0, 30), start, t_eval=[0, 30], rtol=1e-11, local=False)
    assert len(whole.events) == len(run.events) > 100
    np.testing.assert_allclose(run.x, whole.x, rtol=0, atol=1e-8)
