"""Solutions in files: what comes back is what was saved, bit for bit, and nothing of a file is run.

Guards: results/files.py.
"""

import json
import zipfile

import numpy as np
import pytest
import sympy as sp

from pwsmooth import (
    Algebraic,
    Diffusion,
    Event,
    Family,
    Kicks,
    Memory,
    Solution,
    Switch,
    System,
    Unilateral,
    solve,
)
from pwsmooth.definition import tree
from pwsmooth.families import Histogram, Recorder
from pwsmooth.laws.friction import MaxwellSlip
from pwsmooth.results.saving import unpack
from pwsmooth.scenes import friction_oscillator

t, x, v, z, a = sp.symbols("t x v z a", real=True)
k, beta = sp.symbols("k beta", positive=True)
lam = Switch("lam", v)
HIDDEN = System(
    {x: v, v: -2 * sp.sin(t) - k * x - lam * (1 + 3 * z), z: (1 - lam**2 - z) / beta},
    time=t,
    parameters={k: 3.1, beta: 0.1},
    outputs={"mu": lam * (1 + 3 * z), "where": sp.Piecewise((x, (x > 0) & (v > 0)), (sp.Max(x, -v), True))},
)


def plain():
    return solve(System({x: v, v: -x - sp.sign(v)}), (0, 10), {x: 3.5, v: 0}, dense_output=True)


def with_everything():
    """A ball on a floor that counts its impacts, with drag in its own law, a clock and a stop."""
    floor = Unilateral(x, restitution=sp.Rational(1, 2), name="R")
    hits = Memory("hits", 0)
    system = System(
        {x: v, v: -1 + a + floor.reaction},
        time=t,
        events=[
            Event(v, direction=-1, update={hits: hits + 1}, name="top"),
            Event(every=sp.Rational(1, 3), update={"v": v}, when=(hits > 1) | sp.Eq(hits, 0)),
            Event(at=[4, 5], terminal=True, when=hits < 50),
        ],
        algebraic=[Algebraic(a, a + a**3 / 10 + v / 20)],
        outputs={"energy": x + v**2 / 2},
    )
    return solve(system, (0, 6), {x: 0.5, v: 0}, dense_output=True)


def family(**kind):
    chain = Family(9)
    u, w = chain.symbols("u w")
    (mu,) = chain.symbols("mu", positive=True)
    ahead, behind = chain.neighbour(u, 1), chain.neighbour(u, -1, outside=x)
    rates = {
        x: v,
        v: -x - chain.sum(u) / 9,
        u: w,
        w: ahead - 2 * u + behind - mu * sp.sign(w) + chain.index / 100,
    }
    system = System(rates, parameters={mu: np.linspace(0.01, 0.09, 9)}, outputs={"force": mu * w})
    return solve(system, (0, 3), {x: 1, v: 0, u: 0, w: 0}, dense_output=True)


def lattice():
    plate = Family(9)
    u, w = plate.symbols("u w")
    pull = plate.lattice((3, 3)).sum(lambda at: at(u) - u)
    system = System({u: w, w: pull - u - sp.sign(w) / 9})
    return solve(system, (0, 3), {u: np.linspace(-1, 1, 9).tolist(), w: 0}, t_eval=[0, 1, 3], local=True)


def of_a_law():
    return friction_oscillator(MaxwellSlip()).solve(dense_output=True)


def layered():
    return solve(HIDDEN.with_parameters({k: 3}).layered({z: 2}), (0, 8), {x: 0.2, v: 0.3}, dense_output=True)


def smoothed():
    return solve(HIDDEN.smoothed({lam: 1e-2}, "tanh"), (0, 3), {x: 0.2, v: 0.3, z: 0}, dense_output=True)


def stiff():
    bristle = System({x: v, v: sp.sin(t) - x - z, z: v - 50 * sp.Abs(v) * z}, time=t)
    return solve(bristle, (0, 5), {x: 0.2, v: 0.3, z: 0}, method="stiff", dense_output=True)


def ambiguous():
    return solve(System({x: sp.sign(x)}), (0, 1), {x: 0}, dense_output=True)


def kicked():
    return solve(HIDDEN, (0, 2), {x: 0, v: 0, z: 0}, noise=Kicks(0.1, every=0.25, on="v"), dense_output=True)


def diffused():
    noise = Diffusion({v: 0.1 * k}, step=1 / 32)
    return solve(HIDDEN.smoothed(0.1), (0, 1), {x: 0, v: 0.2, z: 0}, noise=noise)


def without_dense_output():
    return solve(HIDDEN, (0, 9), {x: 0.2, v: 0.3, z: 0}, t_eval=np.linspace(1, 2, 5))


RUNS = [
    plain,
    with_everything,
    family,
    lattice,
    of_a_law,
    layered,
    smoothed,
    stiff,
    ambiguous,
    kicked,
    diffused,
    without_dense_output,
]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.__name__)
def test_a_solution_comes_back_bit_for_bit(run, tmp_path):
    solution = run()
    solution.save(tmp_path / "run.npz")
    again = Solution.load(tmp_path / "run.npz")
    for name in ("t", "x", "mult", "status"):
        np.testing.assert_array_equal(getattr(again, name), getattr(solution, name))
    for name in (
        "outcome",
        "cost",
        "tolerances",
        "parameters",
        "segments",
        "itinerary",
        "message",
    ):
        assert getattr(again, name) == getattr(solution, name), name
    assert list(again.events) == list(solution.events)
    assert list(again.ambiguities) == list(solution.ambiguities)
    np.testing.assert_array_equal(again.event_times(), solution.event_times())
    assert str(again.noise) == str(solution.noise) and repr(again) == repr(solution)
    names = (*solution.states, *solution.multipliers, *solution.outputs)
    for name in names:
        np.testing.assert_array_equal(again[name], solution[name])
    if solution.dense is not None:
        at = np.random.default_rng(1).uniform(solution.t[0], solution.t[-1], 50)
        for name in names:
            np.testing.assert_array_equal(again(at, name), solution(at, name))
    if run is not kicked:
        assert again.system.model == solution.system.model
        assert again.system.parameters == solution.system.parameters
        span, start = (solution.t[0], solution.t[0] + 1), solution.x[:, 0].tolist()
        runs = [solve(s, span, start).x for s in (again.system, solution.system)]
        np.testing.assert_array_equal(*runs)


def test_one_solution_is_one_content_and_replaces_an_older_file_as_a_whole(tmp_path):
    solution, path = plain(), tmp_path / "run"
    contents = []
    for _ in range(2):
        solution.save(path)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1] and [p.name for p in tmp_path.iterdir()] == ["run"]
    np.testing.assert_array_equal(np.load(path)["x"], solution.x)


def test_every_damaged_byte_is_refused_or_of_no_consequence(tmp_path):
    solution = solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1})
    solution.save(tmp_path / "run")
    content = (tmp_path / "run").read_bytes()
    refused = 0
    for i in range(0, len(content), 3):
        damaged = bytearray(content)
        damaged[i] ^= 0xFF
        try:
            found, _ = unpack(bytes(damaged))
        except ValueError:
            refused += 1
        else:  # times of writing, comments and the like
            np.testing.assert_array_equal(found["x"], solution.x)
            assert found["system"].model == solution.system.model
    assert refused > 0.6 * len(range(0, len(content), 3))
    for size in range(0, len(content), 50):
        with pytest.raises(ValueError):
            unpack(content[:size])


def changed(path, **entries):
    """The file again, with other entries in its text; a function changes what is there."""
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    text = json.loads(members["solution.json"])
    text.update({key: e(text[key]) if callable(e) else e for key, e in entries.items()})
    with zipfile.ZipFile(path, "w") as file:
        for name, member in members.items():
            file.writestr(name, json.dumps(text) if name == "solution.json" else member)


@pytest.mark.parametrize(
    "entries, said",
    [
        ({"format": "another"}, "its format is 'another'"),
        ({"version": 99}, "a later version of the package"),
        ({"outcome": "GOOD"}, "it has no 'GOOD'"),
        ({"system": []}, "no list of nodes"),
        ({"system": lambda nodes: [["eval", *n[1:]] if n[0] == "Mul" else n for n in nodes]}, "'eval' is no name"),
        ({"system": lambda nodes: [["sign", 0] if n[0] == "sign" else n for n in nodes]}, "'sign' has parts"),
        ({"system": lambda nodes: [["Mul", len(nodes)] if n[0] == "Mul" else n for n in nodes]}, "not among"),
        ({"event kinds": []}, "events of no kind"),
    ],
    ids=lambda value: None if isinstance(value, str) else next(iter(value)),
)  # fmt: skip
def test_a_file_of_another_kind_is_refused_in_words(entries, said, tmp_path):
    path = tmp_path / "run"
    solve(System({x: -2 * sp.sign(x)}), (0, 5), {x: 1}).save(path)
    changed(path, **entries)
    with pytest.raises(ValueError, match=f"`path` is .*damaged, or no file that Solution.save wrote: .*{said}"):
        Solution.load(path)


def test_text_in_the_place_of_an_expression_is_not_evaluated():
    text = "__import__('os').abort()"
    for name in ("sin", "Add", "Pow", "Piecewise", "Equality"):
        with pytest.raises(ValueError, match=f"'{name}' has parts that it cannot have"):
            tree.read([["value", text], [name, 0]])
    assert tree.read([["value", text], ["dict"], ["Symbol", 0, 1]]) == sp.Symbol(text)


def test_arithmetic_of_a_file_is_not_carried_out():
    nine = [["Integer", 9], ["Pow", 0, 0], ["Pow", 0, 1], ["Pow", 0, 2]]
    assert tree.read(nine).args[1].args[1].args == (9, 9)


def test_expressions_come_back_as_they_were_built():
    y = sp.Symbol("y", positive=True)
    for e in (
        sp.factor(x * y + x), sp.Mul(2, x + y, evaluate=False), sp.Float(0.1) * x, sp.Float("0.1", 40),
        sp.Rational(2, 3), sp.exp(-(x**2)), sp.sqrt(y) / 3, sp.Heaviside(x, 1), sp.atan2(x, y), sp.pi * sp.E * x,
        sp.Mod(x, 2), sp.Min(x, y, 2),
        sp.Piecewise((x, sp.Xor(x > 0, y > 2)), (y, sp.Not(sp.And(x > 1, y < 5)) | sp.Eq(x, 7)), (0, True)),
    ):  # fmt: skip
        again = tree.read(json.loads(json.dumps(tree.write(e))))
        assert again == e and sp.srepr(again) == sp.srepr(e)


def test_shared_parts_are_written_once():
    e = x
    for _ in range(40):
        e = sp.sin(e) + sp.cos(e)
    assert len(tree.write(e)) < 200


def test_what_no_file_can_hold_is_refused_by_its_name_when_it_is_saved(tmp_path):
    smooth = HIDDEN.smoothed(1e-2)
    run = solve(smooth, (0, 1), {x: 0.2, v: 0.3, z: 0}, method="Radau", dense_output=True)
    with pytest.raises(ValueError, match="dense output is SciPy's.*`t_eval`"):
        run.save(tmp_path / "run")
    with pytest.raises(TypeError, match=r"gamma\(x\) is a gamma, which no file can hold"):
        tree.write({x: sp.gamma(x)})
    with pytest.raises(TypeError, match="`path` is 3; give a path"):
        plain().save(3)
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileNotFoundError):
        Solution.load(tmp_path / "none")


def test_what_a_run_was_made_for_and_no_file_holds_is_named(tmp_path):
    x, a = sp.symbols("x a", real=True)
    (u,) = Family(120).symbols("u")
    reset = Event(u - 1, direction=1, update={u: 0})
    record = Recorder(elements=[1], statistics={"waits": Histogram("waiting", np.linspace(0, 2, 21))})
    asked = solve(System({x: a - sp.sign(x)}, parameters={a: 0.5}), (0, 1), {x: 1}, by=[a])
    kept = solve(
        System({u: 1 + 0 * u}, events=[reset]),
        (0, 5),
        {u: np.linspace(0, 0.9, 120)},
        record=record,
        t_eval=[0, 5],
    )
    for run, said in ((asked, "no derivatives of"), (kept, "no statistics of")):
        with pytest.warns(UserWarning, match=said) as told:
            run.save(tmp_path / "run.npz")
        assert told[0].filename == __file__
    again = Solution.load(tmp_path / "run.npz")
    assert (again.recorded.t == [0, 5]).all() and (again.recorded["u"] == kept.recorded["u"]).all()
    for name in ("t", "element", "surface", "kind", "came", "went"):
        one, other = getattr(kept.catalogue, name), getattr(again.catalogue, name)
        assert one.dtype == other.dtype and (one == other).all() and len(one) > 400
    assert (again.catalogue.states["u"] == kept.catalogue.states["u"]).all()
