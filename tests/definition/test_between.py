"""Elements that touch: contacts with a floor and between neighbours, springs with a gap, bonds that break.

Answers in closed form: hard rods that pass their speeds on, a blow through a row of balls, a pile at rest. Beside
elements that are written out: tests/definition/test_family_template.py; random ones: tests/fuzz/links.py.

Guards: definition/families/between.py.
"""

import numpy as np
import pytest
import sympy as sp
from family_models import template_from

from pwsmooth import Event, Family, Outcome, Switch, System, Unilateral, solve
from pwsmooth.codegen.families.fields import FamilyFields
from pwsmooth.codegen.families.writing import write_family_jets
from pwsmooth.paths.problem import compiled_problem
from tests.fuzz.assemblies import compared

TIGHT = {"rtol": 1e-13, "atol": 1e-15}
t = sp.Symbol("t", real=True)


def rods(n, e=1, outside=1):
    """Points between walls at 0 and 1."""
    family = Family(n)
    x, v = family.symbols("x v")
    right = Unilateral(family.neighbour(x, 1, outside=outside) - x, restitution=e, name="R")
    left = Unilateral(x, restitution=1, name="L")
    push = family.neighbour(right.reaction, -1) - right.reaction + left.reaction
    with template_from(1):
        return System({x: v, v: push}, contacts=[right, left])


def pile(n, e=0.3, g=1.0, least=1):
    """Balls of growing mass above each other, on a floor."""
    family = Family(n)
    x, v = family.symbols("x v")
    (m,) = family.symbols("m", positive=True)
    above = Unilateral(family.neighbour(x, 1) - x - 1, restitution=e, name="R")
    floor = Unilateral(x, restitution=e, name="L")
    push = floor.reaction + family.neighbour(above.reaction, -1) - above.reaction
    values = {m: [1 + 0.1 * i for i in range(n)]}
    with template_from(least):
        return System({x: v, v: push / m - g}, parameters=values, contacts=[above, floor])


def free_flights(x, v, end):
    """Places of elastic points of equal mass between walls at 0 and 1: of points that pass each other, in order."""
    y = np.abs((x + v * end) % 2)
    return np.sort(np.where(y > 1, 2 - y, y))


def test_hard_rods_are_where_points_that_pass_each_other_are():
    n, i = 50, np.arange(50)
    x, v = (i + 0.5) / n, np.sin(3 * i + 1)
    run = solve(rods(n), (0, 10), {"x": x, "v": v}, t_eval=[0, 10], local=True, **TIGHT)
    hits = [e.switch for e in run.events]
    assert {e.kind for e in run.events} == {"impact"} and not run.ambiguities
    walls = sum(name.startswith("L") or name == f"R_{n}" for name in hits)
    assert (len(hits) - walls, walls) == (9857, 316)
    assert run.x[:n, -1] == pytest.approx(free_flights(x, v, 10), abs=1e-12)
    assert np.sort(np.abs(run.x[n:, -1])) == pytest.approx(np.sort(np.abs(v)), abs=1e-13)  # they swap them


def test_a_collision_costs_two_elements_and_their_neighbours():
    each = []
    for n in (100, 1000):
        i = np.arange(n)
        start = {"x": (i + 0.5) / n, "v": np.sin(3 * i + 1)}
        run = solve(rods(n), (0, 3000 / n**2), start, t_eval=[0], local=True)
        each.append((run.cost["renewed"] - 2 * n) / len(run.events))
    assert max(each) < 5, each


def test_the_generated_text_of_touching_elements_does_not_know_how_many_there_are():
    texts = []
    for n in (9, 300):
        model = rods(n, outside=None).model
        texts.append(FamilyFields(model).write() | write_family_jets(model))
    assert texts[0] == texts[1]


@pytest.mark.parametrize("local", [False, True])
def test_a_pile_comes_to_rest_with_the_weight_of_what_is_above(local):
    n = 9
    start = {"x": [1.05 * i + 0.02 for i in range(n)], "v": 0}
    run = solve(pile(n), (0, 3), start, t_eval=[0, 3], local=local, **TIGHT)
    assert run.success and np.abs(run.x[:n, -1] - np.arange(n)).max() < 1e-12
    masses = 1 + 0.1 * np.arange(n)
    above = [masses[i:].sum() for i in range(n)]
    by_name = dict(zip(run.multipliers, run.mult[:, -1], strict=True))
    assert by_name["L_1"] == pytest.approx(above[0], rel=1e-11)
    assert [by_name[f"R_{i}"] for i in range(1, n)] == pytest.approx(above[1:], rel=1e-11)


def test_a_pile_is_that_of_its_elements_written_out():
    """Bounce by bounce, at both ends of the chain too, where an element has no neighbour."""
    start = {"x": [1.1 * i + 0.03 * (5 * i % 7) for i in range(5)], "v": [0.4 * (-1) ** i for i in range(5)]}
    runs = [
        solve(pile(5, least=least), (0, 2), start, t_eval=[0, 0.3, 2], local=local, **TIGHT)
        for least, local in ((1, False), (10**9, False), (1, True))
    ]
    whole, written, run = runs
    assert len(whole.events) == len(written.events) > 20
    for other in (written, run):
        assert other.success
        np.testing.assert_allclose(other.x, whole.x, rtol=0, atol=1e-11)


def test_every_contact_has_one_place_on_the_diagonal():
    """Where there is no neighbour its entry stands where the element's own does, and is 0."""
    fixed = compiled_problem(pile(9).model).fixed
    of = np.searchsorted(fixed["g_row"], fixed["g_diagonal"], side="right") - 1
    assert of.tolist() == fixed["g_col"][fixed["g_diagonal"]].tolist() == list(range(fixed["m"]))


def test_a_pile_that_starts_at_rest_stays_so():
    n = 120  # longer than what is put to its start together
    run = solve(pile(n), (0, 5), {"x": list(range(n)), "v": 0}, t_eval=[0, 5], local=True)
    masses = 1 + 0.1 * np.arange(n)
    assert run.success and not len(run.events)
    # A reaction at the bottom, of 12 000, is solved to rounding, and 25/2 times as much of it moves a ball.
    assert np.abs(run.x[:n, -1] - np.arange(n)).max() < 1e-10
    assert dict(zip(run.multipliers, run.mult[:, -1], strict=True))["L_1"] == pytest.approx(
        masses.sum(), rel=1e-10
    )


def test_more_contacts_at_rest_than_are_solved_for_together_are_refused():
    n = 140
    run = solve(pile(n), (0, 5), {"x": list(range(n)), "v": 0}, t_eval=[0, 5], local=True)
    assert run.outcome is Outcome.SINGULAR and "more than 128 contacts" in run.message


def test_a_ball_between_two_that_strike_it_at_once_stays():
    """Three bodies at one instant: as the run of all has it, and said to be a matter of order."""
    family = Family(5)
    x, v = family.symbols("x v")
    ball = Unilateral(family.neighbour(x, 1) - x - 1, restitution=1, name="R")
    rates = {x: v, v: family.neighbour(ball.reaction, -1) - ball.reaction}
    start = {"x": [0, 8.5, 10, 11.5, 20], "v": [0, 1, 0, -1, 0]}
    runs = []
    for least, local in ((10**9, False), (1, False), (1, True)):
        with template_from(least):
            system = System(rates, contacts=[ball])
        runs.append(solve(system, (0, 1), start, t_eval=[0, 1], local=local, **TIGHT))
    written, whole, run = runs
    np.testing.assert_allclose(run.x, written.x, rtol=0, atol=1e-14)
    assert compared(whole, run) is None
    assert run["v_3"][-1] == 0 and [run[f"v_{i}"][-1] for i in (2, 4)] == [-1, 1]
    assert str(written.ambiguities) == str(run.ambiguities)


def test_elastic_collisions_keep_energy_and_momentum():
    n, i = 200, np.arange(200)
    family = Family(n, periodic=True)
    x, v = family.symbols("x v")
    (m,) = family.symbols("m", positive=True)
    ball = Unilateral(family.neighbour(x, 1) - x + 1, restitution=1, name="R")
    masses = 1 + 0.5 * np.sin(7 * i)
    push = (family.neighbour(ball.reaction, -1) - ball.reaction) / m
    system = System({x: v, v: push}, parameters={m: masses.tolist()}, contacts=[ball])
    speeds = np.cos(5 * i)
    run = solve(system, (0, 10), {"x": 0.3 * np.sin(i), "v": speeds}, t_eval=[0, 10], local=True)
    assert len(run.events) > 500
    w = run.x[n:, -1]
    assert masses @ w == pytest.approx(masses @ speeds, abs=1e-11)
    assert masses @ w**2 == pytest.approx(masses @ speeds**2, rel=1e-12)


def test_a_blow_runs_through_springs_that_touch_in_half_their_time_of_contact():
    """Balls far enough apart: each contact lasts pi sqrt(m/(2 k)), while the next ball gets half way."""
    n, k, gap = 30, 400.0, 0.2
    family = Family(n)
    x, v = family.symbols("x v")
    before, after = x - family.neighbour(x, -1) + gap, family.neighbour(x, 1) - x + gap
    system = System({x: v, v: k * (sp.Max(0, -before) - sp.Max(0, -after))})
    start = {x: 0, v: [1.0] + [0.0] * (n - 1)}
    run = solve(system, (0, 8), start, t_eval=[0, 8], local=True, **TIGHT)
    contact = np.pi * np.sqrt(1 / (2 * k))
    begins = run.events.times[::2]  # each is met twice, at either end of its contact, and told once
    np.testing.assert_allclose(begins, gap + np.arange(n - 1) * (gap + contact / 2), rtol=0, atol=1e-11)
    assert run.x[n:, -1] == pytest.approx([0.0] * (n - 1) + [1.0], abs=1e-11)


@pytest.mark.parametrize("way", ["chain", "ring", "lattice", "graph", "wall", "touching"])
@pytest.mark.parametrize("local", [False, True])
def test_what_happens_between_two_elements_is_one_event(way, local):
    """As where the elements are written out: there a surface stands once, whoever reads it."""
    n = 6
    family = Family(n, periodic=way == "ring")
    x, v = family.symbols("x v")
    if way in ("lattice", "graph"):
        table = [[k % n + 1, (k - 2) % n + 1, (k + 2) % n + 1] for k in range(1, n + 1)]
        over = family.lattice((2, 3)).sum if way == "lattice" else family.links(table).sum
        push = over(
            lambda at: sp.Max(0, at(x) - x - sp.Rational(1, 5)) - sp.Max(0, x - at(x) - sp.Rational(1, 5))
        )
    else:
        outside = 1 if way == "wall" else None
        before, after = family.neighbour(x, -1, outside), family.neighbour(x, 1)
        gap = 0 if way == "touching" else sp.Rational(1, 5)  # without one there is no surface at the ends
        push = sp.Max(0, before - x - gap) - sp.Max(0, x - after - gap)
    start = {x: np.sin(3 * np.arange(n)), v: np.cos(np.arange(n) ** 2)}
    runs = []
    for least in (1, 10**9):
        with template_from(least):
            system = System({x: v, v: 4 * push - x})
        assert (system.model.families is None) == (least > 1)
        runs.append(solve(system, (0, 9), start, t_eval=[0, 9], local=local and least == 1, **TIGHT))
    run, written = runs
    assert len(run.events) == len(written.events) > 20
    np.testing.assert_allclose(np.sort(run.events.times), np.sort(written.events.times), rtol=0, atol=1e-10)
    np.testing.assert_allclose(run.x, written.x, rtol=0, atol=1e-11)


def test_gaps_of_the_elements_themselves_are_told_by_each_of_them():
    n = 6
    family = Family(n)
    x, v = family.symbols("x v")
    (g,) = family.symbols("g", positive=True)
    push = sp.Max(0, family.neighbour(x, -1) - x - g) - sp.Max(0, x - family.neighbour(x, 1) - g)
    start = {x: np.sin(3 * np.arange(n)), v: 0}
    runs = []
    for least in (1, 10**9):
        with template_from(least):
            system = System({x: v, v: 4 * push - x}, parameters={g: [0.1 + 0.02 * i for i in range(n)]})
        runs.append(solve(system, (0, 9), start, t_eval=[0, 9], **TIGHT))
    assert len(runs[0].events) == len(runs[1].events) > 20


def test_bonds_break_from_where_they_are_pulled():
    n, strength = 40, 1.0
    family = Family(n)
    x, v = family.symbols("x v")
    whole = family.memory("whole", 1)
    stretch = family.neighbour(x, 1) - x
    behind = family.neighbour(whole, -1) * (x - family.neighbour(x, -1))
    broken = Event(stretch - strength, direction=1, update={whole: 0}, when=sp.Eq(whole, 1), name="break")
    system = System({x: v, v: whole * stretch - behind}, events=[broken])
    start = {x: 0, v: [0.0] * (n - 1) + [3.0]}
    whole_run, run = (
        solve(system, (0, 20), start, t_eval=[0, 5, 20], local=way, **TIGHT) for way in (False, True)
    )
    assert compared(whole_run, run) is None
    # The last ball is torn off, and goes on with what it has; what is left keeps the rest of the momentum.
    assert [e.switch for e in run.events] == [f"break {n - 1}"]
    assert run.x[n:-n, -1].sum() == pytest.approx(3.0, abs=1e-11)
    assert run[f"v_{n}"][-1] == run[f"v_{n}"][1]


def test_what_has_no_neighbour_has_no_event_and_no_contact():
    family = Family(4)
    x, v = family.symbols("x v")
    ball = Unilateral(family.neighbour(x, 1) - x - 1, restitution=0.5, name="R")
    hit = Event(family.neighbour(x, 1) - x - 2, name="near")
    push = family.neighbour(ball.reaction, -1) - ball.reaction
    system = System({x: v, v: push}, contacts=[ball], events=[hit])
    assert [str(m.symbol) for m in system.model.multipliers] == ["R_1", "R_2", "R_3"]
    assert [e.name for e in system.model.events] == ["near 1", "near 2", "near 3"]
    other = Family(5)
    with pytest.raises(TypeError, match="`member`"):
        other.neighbour(ball.reaction, 1)
    with pytest.raises(ValueError, match="restitution e_3 of contact 'R_3' is 1.5"):
        several = Family(9)
        y, w = several.symbols("y w")
        (e,) = several.symbols("e")
        floor = Unilateral(y, restitution=e, name="R")
        values = {e: [0.5, 0.5, 1.5, *[0.5] * 6]}
        System({y: w, w: floor.reaction - 1}, parameters=values, contacts=[floor])


def test_a_model_with_contacts_between_neighbours_is_written_and_read():
    from pwsmooth.definition.tree import read, write

    system = pile(9)
    again = System._read(read(write(system._written())))
    assert again.model == system.model


# ---- friction between neighbours


def plates(n, friction=0.5, notation=False, least=1):
    """Plates of mass 1 on each other, which rub; the lowest one on the ground."""
    family = Family(n)
    (v,) = family.symbols("v")
    below = Switch("s", v - family.neighbour(v, -1, outside=0))
    down, up = below, family.neighbour(below, 1)
    if notation:
        down, up = sp.sign(v - family.neighbour(v, -1, outside=0)), sp.sign(family.neighbour(v, 1) - v)
    with template_from(least):
        return System({v: friction * (up - down)}, time=t)


@pytest.mark.parametrize("notation", [False, True])
@pytest.mark.parametrize(("least", "local"), [(1, False), (1, True), (10**9, False)])
def test_plates_come_to_rest_on_each_other_from_above(notation, least, local):
    """v_i = i: all but the highest are pulled and held back alike; k plates slow down together from k n on."""
    n = 12
    if notation and least == 1:
        pytest.skip("the lowest rubs on the ground, which is no neighbour's: written out")
    system = plates(n, notation=notation, least=least)
    assert (system.model.families is not None) == (least == 1)
    run = solve(system, (0, 200), {"v": np.arange(1.0, n + 1)}, t_eval=[0, 200], local=local or None, **TIGHT)
    assert run.success and {e.kind for e in run.events} == {"stick"}
    sticks = np.arange(1, n + 1)
    assert run.event_times("stick") == pytest.approx(sticks * (sticks + 1) / 2 / 0.5, rel=1e-12)
    assert np.abs(run.x[:, -1]).max() < 1e-14


def shaken(n, notation=False, least=1, periodic=False):
    """Sliders of different mass on springs of their own, each shaken in its own phase, that rub on the next one."""
    family = Family(n, periodic=periodic)
    x, v = family.symbols("x v")
    (m,) = family.symbols("m", positive=True)
    after = family.neighbour(v, 1)
    rub = Switch("s", after - v)
    pull = rub - family.neighbour(rub, -1)
    if notation:
        pull = sp.sign(after - v) - sp.sign(v - family.neighbour(v, -1))
    force = 0.3 * pull - x + 1.2 * sp.sin(t + (0 if periodic else family.index))
    with template_from(least):
        return System({x: v, v: force / m}, time=t, parameters={m: [1 + 0.1 * i for i in range(n)]})


@pytest.mark.parametrize("notation", [False, True])
def test_sliders_that_rub_are_those_written_out_and_those_by_elements(notation):
    start = {"x": 0.0, "v": [0.1 * (-1) ** i * i for i in range(5)]}
    whole, written, by_elements = (
        solve(shaken(5, notation, least), (0, 20), start, t_eval=[0, 5, 20], local=local, **TIGHT)
        for least, local in ((1, False), (10**9, False), (1, True))
    )
    assert len(whole.events) == len(written.events) == len(by_elements.events) == 28
    kinds = [e.kind for e in whole.events]
    assert kinds == [e.kind for e in written.events] == [e.kind for e in by_elements.events]
    for other in (written, by_elements):
        np.testing.assert_allclose(other.x, whole.x, rtol=0, atol=1e-11)


def test_the_generated_text_of_friction_between_neighbours_does_not_know_how_many_there_are():
    texts = []
    for n in (9, 300):
        model = shaken(n).model
        texts.append(FamilyFields(model).write() | write_family_jets(model))
    assert texts[0] == texts[1]


def test_friction_between_neighbours_is_smoothed_and_its_momentum_stays():
    n = 9
    speeds = [(-1) ** i * (1 + 0.1 * i) for i in range(n)]
    family = Family(n, periodic=True)
    (v,) = family.symbols("v")
    rub = Switch("s", family.neighbour(v, 1) - v)
    with template_from(1):
        ring = System({v: rub - family.neighbour(rub, -1)})
    assert ring.model.families is not None
    exact = solve(ring, (0, 0.6), {"v": speeds}, **TIGHT)
    smooth = solve(ring.smoothed(1e-4, "tanh"), (0, 0.6), {"v": speeds}, rtol=1e-9, atol=1e-11)
    assert len(exact.events) == 2
    assert exact.x[:, -1].sum() == pytest.approx(sum(speeds), abs=1e-13)
    np.testing.assert_allclose(smooth.x[:n, -1], exact.x[:, -1], rtol=0, atol=1e-3)


def test_a_multiplier_of_another_family_is_no_neighbours():
    (v,), other = Family(9).symbols("v"), Family(9, name="other")
    with pytest.raises(TypeError, match="give a symbol of this family"):
        other.neighbour(Switch("s", v), 1)


def test_a_hundred_plates_that_stick_as_one_are_told_without_a_layer():
    """Where friction on masses holds them all, what their layer would come to is one zero: nothing is integrated."""
    n = 110
    run = solve(plates(n), (0, 30_000), {"v": np.arange(1.0, n + 1)}, t_eval=[0], **TIGHT)
    sticks = np.arange(1, n + 1)
    assert run.success and run.event_times("stick") == pytest.approx(sticks * (sticks + 1), rel=1e-11)
    assert run.cost["layers"] <= 1


def test_a_plate_in_a_row_carries_along_those_that_are_held_harder_to_it():
    """Joints 6 to 9 hold 3/2, the others 1/2: as the highest one slows down, those below it speed up together."""
    family = Family(9)
    (v,) = family.symbols("v")
    (strength,) = family.symbols("F", positive=True)
    joint = Switch("s", v - family.neighbour(v, -1, outside=0))
    above = family.neighbour(strength, 1, outside=0) * family.neighbour(joint, 1)
    values = {strength: [0.5 if i < 5 else 1.5 for i in range(9)]}
    runs = []
    for least in (1, 10**9):
        with template_from(least):
            system = System({v: above - strength * joint}, parameters=values)
        runs.append(solve(system, (0, 20), {"v": [0.0] * 8 + [3.0]}, t_eval=[0, 1, 20], **TIGHT))
    one, other = runs
    smooth = solve(
        system.smoothed(1e-6, "tanh"),
        (0, 20),
        {"v": [0.0] * 8 + [3.0]},
        rtol=1e-9,
        atol=1e-11,
        t_eval=[0, 1, 20],
    )
    np.testing.assert_allclose(one.x, other.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(smooth.x[:9], one.x, rtol=0, atol=5e-5)
    assert one.event_times("stick") == pytest.approx([12 / 7, 6], rel=1e-12)
