"""`pwsmooth sweep STUDY.toml`: what a study says is what sweep() gets, and its errors name key and line."""

import re
import textwrap
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import sympy as sp
import xarray
from friction_oscillator import coulomb, omega
from typer.testing import CliRunner

from pwsmooth import Strobe, System, sweep
from pwsmooth.cli import app
from pwsmooth.studies import Function
from pwsmooth.studies.study import Names, StudyError, arguments_of, read_study, run_study

MODEL = """
import sympy as sp
from pwsmooth import Switch, System

t, y, v = sp.symbols("t y v", real=True)
k, c, N, sigma, omega = sp.symbols("k c N sigma omega", nonnegative=True)
oscillator = System(
    {y: v, v: -sigma * sp.sin(omega * t) - k * y - c * v - N * Switch("lam", v)},
    time=t, parameters={k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1},
)

def last(solution):
    return solution["y"][-1]
"""
STUDY = """
title = "two sticks or none"
measures = ["sticks", "itinerary", "model.py:last"]
seen = { period = "2*pi/omega" }
transient = 3
periods = 2

[system]
object = "model.py:oscillator"
parameters = { c = 0.1 }

[axes]
sigma = { from = 1.2, to = 2.4, count = 2 }
k = [2, 3.1]

[x0]
y = 0.5
v = 0.3

[units]
k = "N/m"
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "model.py").write_text(textwrap.dedent(MODEL))
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def command(*arguments):
    return CliRunner().invoke(app, ["sweep", *map(str, arguments), "--allow-code"])


def test_a_study_gives_what_sweep_gives_and_resumes_only_when_asked(study, tmp_path):
    done = command(study, "--out", tmp_path)
    assert done.exit_code == 0, done.output
    assert "4 points: 4 finished" in done.output
    with xarray.open_zarr(tmp_path / "study.zarr", consolidated=False) as opened:
        stored = opened.load()
    expected = sweep(
        coulomb(), {"sigma": [1.2, 2.4], "k": [2, 3.1]}, x0={"y": 0.5, "v": 0.3}, seen=Strobe(2 * np.pi / omega),
        transient=3, periods=2, measures=["sticks", "itinerary", lambda s: s["y"][-1]],
    )  # fmt: skip
    assert stored.itinerary.values.tolist() == expected.itinerary.values.tolist()
    assert np.array_equal(stored.stick_time, expected.stick_time)
    assert np.array_equal(stored["last"], expected["value"])
    assert stored.k.attrs["units"] == "N/m"
    refused = command(study, "--out", tmp_path)
    assert refused.exit_code == 2 and "--resume" in refused.output
    assert command(study, "--out", tmp_path, "--resume").exit_code == 0


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("count = 2", "count = 0", ["line 13", "axes.sigma.count", "greater than or equal to 1", "0"]),
        ("count = 2", "count = '25'", ["line 13", "axes.sigma.count", "integer", "'25'"]),
        ("from = 1.2", "from = '1.2'", ["line 13", "axes.sigma.from", "number", "'1.2'"]),
        (
            'object = "model.py:oscillator"',
            'scene = "block_on_belt"\nlaw = "Coulomb"\narguments = { k = 2, omg = 3 }',
            ["system.arguments", "`omg`", "it has law, k, pull"],
        ),
        (
            'object = "model.py:oscillator"',
            'scene = "block_on_belt"\nlaw = "Coulomb"\narguments = { pul = 3 }',
            ["system.arguments", "block_on_belt() has no argument `pul`; did you mean `pull`?"],
        ),
        (
            'object = "model.py:oscillator"',
            'scene = "block_on_belt"',
            ["system.law is missing", "Coulomb, Dahl"],
        ),
        (
            'object = "model.py:oscillator"',
            'scene = "block_on_belt"\nlaw = "Hertz"',
            ["system.law is 'Hertz', a contact law where a friction law belongs", "Coulomb"],
        ),
        (
            'object = "model.py:oscillator"',
            'scene = "block_on_belt"\nlaw = "Lugre"',
            ["system.law is 'Lugre'; did you mean 'LuGre'?"],
        ),
        (
            'object = "model.py:oscillator"',
            'scene = "firing_lattice"\nlaw = "Coulomb"',
            ["firing_lattice takes no law by this name"],
        ),
        ('object = "model.py:oscillator"', 'scene = "block_on_bel"', ["did you mean 'block_on_belt'?"]),
        (
            'k = "N/m"',
            'spring = "N/m"',
            ["`units` names 'spring', which is no parameter, state, output or time"],
        ),
        ("model.py:oscillator", "model.py:oscilator", ["Did you mean 'oscillator'?"]),
        ("periods = 2", "wholly = 2", ["line 6", "wholly", "keys there are", "periods"]),
        ("from = 1.2", "from = -1, spacing = 'log'", ["line 13", "axes.sigma", "> 0"]),
        ("transient = 3", "transient = 'few'", ["line 5", "transient", "integer", "few"]),
        ("periods = 2", "period_count = 2", ["line 6", "period_count", "did you mean period"]),
        ("k = [2, 3.1]", "k = ['stiff']", ["line 14", "axes.k", "number", "stiff"]),
        ('object = "model.py:oscillator"', "", ["line 8", "system", "`object` or `scene`"]),
        ("[axes]", "[axes", ["no TOML", "line 12"]),
        ("model.py:oscillator", "nothing.py:oscillator", ["system.object", "no file"]),
        ("model.py:oscillator", "model.py:oscilator", ["system.object", "oscilator"]),
        ("model.py:oscillator", "model.py:k", ["system.object", "give a System"]),
        ('object = "model.py:oscillator"', 'scene = "swing"', ["system.scene", "swing", "block_on_belt"]),
        ("parameters = { c = 0.1 }", "parameters = { b = 0.1 }", ["system.parameters", "'b'"]),
        ('"sticks", ', '"stick", ', ["'stick'", "sticks"]),
        ("sigma = {", "sigmoid = {", ["sigmoid", "no parameter"]),
    ],
)
def test_errors_name_the_file_the_key_and_the_line(study, old, new, words):
    study.write_text(STUDY.replace(old, new, 1))
    done = command(study, "--out", study.parent)
    assert done.exit_code == 2
    for word in words:
        assert word in done.output, done.output
    assert not (study.parent / "study.zarr").exists()


def test_all_mistakes_are_named_at_once(study):
    study.write_text(STUDY.replace("count = 2", "count = 0").replace("y = 0.5", "y = 'up'"))
    with pytest.raises(StudyError) as caught:
        read_study(study)
    assert "axes.sigma.count" in str(caught.value) and "x0.y" in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    done = command(tmp_path / "none.toml")
    assert done.exit_code == 2 and "none.toml" in done.output


def test_a_scene_brings_its_start_period_and_units(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        'measures = ["sticks"]\n[system]\nscene = "block_on_belt"\nlaw = "Coulomb"\n[axes]\nspring = [1.0, 2.0]\n'
    )
    scene, arguments = arguments_of(read_study(path))
    found = sweep(scene, t_span=(0, 5), **{k: v for k, v in arguments.items() if k != "t_span"})
    assert (found.outcome >= 0).all() and found.sizes == {"spring": 2}


def test_a_study_may_count_returns_to_a_section(tmp_path):
    path = tmp_path / "belt.toml"
    path.write_text(
        'seen = { section = "v", direction = -1 }\ntransient = 5\nperiods = 4\nmeasures = ["period", "sticks"]\n'
        '[system]\nobject = "belt"\n[axes]\nk = [2, 3.1]\n'
    )
    y, v, k = sp.symbols("y v k", real=True)
    belt = System({y: v, v: -k * y + 2 * sp.sign(1 - v) / (1 + sp.Abs(v - 1))}, parameters={k: 3})
    system, arguments = arguments_of(read_study(path), Names({"belt": belt}))
    found = sweep(system, **arguments | {"x0": {y: 0, v: 0}})
    assert found.period.values.tolist() == [1, 1] and (found.sticks == 1).all() and (found.stick_time > 0).all()


def test_a_registered_name_needs_no_code(study):
    text = STUDY.replace("model.py:last", "last").replace("model.py:oscillator", "oscillator")
    study.write_text(text.replace("parameters = { c = 0.1 }", ""))
    registered = {"oscillator": coulomb(), "last": lambda s: {"last": s["y"][-1]}}
    data, _ = run_study(
        study, study.parent, names={**registered, "last": Function(registered["last"], names="last")}
    )
    assert (data.outcome == 0).all() and np.isfinite(data["last"]).all()


def test_code_runs_only_when_it_is_allowed_and_lies_beside_the_study(study, tmp_path):
    refused = CliRunner().invoke(app, ["sweep", str(study), "--out", str(tmp_path)])
    assert refused.exit_code == 2 and "--allow-code" in refused.output
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.py").symlink_to(tmp_path / "model.py")
    for reference in ("../model.py", str(tmp_path / "model.py"), "link.py"):
        (inner / "study.toml").write_text(STUDY.replace("model.py:oscillator", f"{reference}:oscillator"))
        refused = command(inner / "study.toml", "--out", tmp_path)
        assert refused.exit_code == 2 and "outside of the study's folder" in refused.output


@pytest.mark.parametrize(
    "text, words",
    [
        ("[system]\nscene = 'block_on_belt'\n[axes]\nspring = { from = 1, to = 2, count = 2000000000 }",
         ["count", "2000000000"]),
        ("x = " + "[" * 3000 + "]" * 3000, ["no TOML"]),
        ("\ufeffa = \x00", ["no TOML"]),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said_in_a_line(text, words, tmp_path):
    (tmp_path / "s.toml").write_text(text)
    done = command(tmp_path / "s.toml", "--out", tmp_path)
    assert done.exit_code == 2 and all(word in done.output for word in words), done.output


def test_a_disk_that_refuses_is_said_in_a_line(study, tmp_path):
    (tmp_path / "file").write_text("")
    done = command(study, "--out", tmp_path / "file" / "below")
    assert done.exit_code == 2 and "file" in done.output and "Traceback" not in done.output


def test_views_are_named_in_the_study(study):
    hidden = MODEL.replace('Switch("lam", v)', "sp.sign(v)")
    (study.parent / "model.py").write_text(hidden)
    study.write_text(STUDY.replace("parameters = { c = 0.1 }", "smoothed = { eps = 0.01, sigmoid = 'tanh' }"))
    system, _ = arguments_of(read_study(study), Names(folder=study.parent))
    assert system.model.smoothing and system.model.sigmoid == "tanh"


def test_the_page_on_sweeps_runs_as_it_stands(tmp_path):
    page = (Path(__file__).resolve().parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    code, circuit = re.findall(r"```{code-cell} python\n---\n.*?\n---\n(.*?)```", page, flags=re.DOTALL)
    data, text = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    matplotlib.use("Agg")
    names = {}
    # A tenth of the grid in each direction.
    exec(compile(code.replace("36)", "5)").replace("25)", "4)"), "sweeps.md", "exec"), names)
    assert names["found"].sizes == {"k": 5, "sigma": 4} and (names["found"].outcome == 0).all()
    exec(compile(circuit.replace("500)", "5)"), "sweeps.md", "exec"), names)
    assert names["shown"].points.shape == (5, 100, 3) and not any(names["shown"].reasons)
    study = tmp_path / "study.toml"
    study.write_text(text)
    assert read_study(study).axes["sigma"].values().size == 25
    study.write_text(data)
    scene, arguments = arguments_of(read_study(study))
    assert scene.system.states and arguments["axes"]["amplitude"].size == 25
