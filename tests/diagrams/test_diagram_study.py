"""`pwsmooth diagram STUDY.toml`: what a study says is what the calls get, and its errors name key and line."""

import pytest
import sympy as sp
from typer.testing import CliRunner

from pwsmooth import Event, Strobe, System, diagram
from pwsmooth.cli import app
from pwsmooth.diagrams import read_diagram
from pwsmooth.diagrams.study import DiagramStudy, run_study
from pwsmooth.studies.study import StudyError, read_study

MODEL = """
import sympy as sp
from pwsmooth import Event, System

t, x, a, b = sp.symbols("t x a b", real=True)
step = Event(every=1, update={x: a - x**2 + b * x})
quadratic = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
"""
STUDY = """
seen = { period = 1, phase = 0.5 }
values = 5
x0 = [{ x = 0.1 }]

[system]
object = "model.py:quadratic"

[over]
a = [-0.5, 0.5]
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def command(*arguments):
    return CliRunner().invoke(app, ["diagram", *map(str, arguments), "--workers", "1"])


def test_one_parameter_makes_a_diagram_with_its_store_and_picture(study, tmp_path):
    done = command(study, "--out", tmp_path, "--allow-code")
    assert done.exit_code == 0 and "Diagram over a" in done.output, done.output
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")
    t, x, a, b = sp.symbols("t x a b", real=True)
    step = Event(every=1, update={x: a - x**2 + b * x})
    system = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    found = diagram(system, {a: (-0.5, 0.5)}, {x: 0.1}, Strobe(1, phase=0.5), values=5)
    stored = read_diagram(tmp_path / "study.zarr")
    assert found.specials
    assert [b.parameter for b in stored.specials] == [b.parameter for b in found.specials]


def test_two_parameters_make_a_bifurcation_set(study, tmp_path):
    study.write_text(STUDY + "b = [-0.5, 0.5]\n[lines]\nb = { from = -0.2, to = 0.2, count = 2 }\n")
    done = command(study, "--out", tmp_path, "--allow-code")
    assert done.exit_code == 0 and "Bifurcation set over a" in done.output, done.output
    assert read_diagram(tmp_path / "study.zarr").lines == (("b", -0.2), ("b", 0.2))


def test_a_store_that_is_there_is_gone_on_with_only_when_asked(study, tmp_path):
    assert command(study, "--out", tmp_path, "--allow-code").exit_code == 0
    again = command(study, "--out", tmp_path, "--allow-code")
    assert again.exit_code == 2 and "--resume" in again.output
    assert command(study, "--out", tmp_path, "--allow-code", "--resume").exit_code == 0


def test_code_is_run_only_when_allowed(study, tmp_path):
    done = command(study, "--out", tmp_path)
    assert done.exit_code == 2 and "--allow-code" in done.output
    assert not (tmp_path / "study.zarr").exists()


def test_a_registered_system_needs_no_code(study, tmp_path):
    x, a = sp.symbols("x a", real=True)
    fold = System({x: a - x**2}, parameters={a: 1})
    study.write_text("box = { x = [-2, 2] }\n[system]\nobject = 'fold'\n[over]\na = [-0.5, 1]\n")
    found, _ = run_study(study, tmp_path, workers=1, names={"fold": fold})
    assert [b.kind for b in found.specials] == ["fold"]


@pytest.mark.parametrize(
    "more, words",
    {
        "b = [0, 1]\nc = [0, 1]\n": "`over` names",
        "[lines]\na = [0]\n": "`lines` are for two parameters",
        "[steps]\nfirst = -1\n": "steps: `first` of Steps is -1",
    }.items(),
)
def test_what_diagram_refuses_is_told(study, tmp_path, more, words):
    study.write_text(STUDY + more)
    assert words in command(study, "--out", tmp_path, "--allow-code").output


@pytest.mark.parametrize(
    "more, words",
    {
        "max_dept = 3\n" + STUDY: r"line 1: max_dept: no such key; did you mean max_depth\?",
        STUDY.replace("phase = 0.5", "direction = -1"): "line 2: seen: `direction` does not belong to `period`",
        STUDY.replace("period = 1", "section = 'x', period = 1"): "line 2: seen: give `period` .* or `section`",
        STUDY.replace("phase", "fase"): r"seen.fase: no such key; did you mean phase\?",
        STUDY.replace("values = 5", "values = 'five'"): "line 3: values",
    }.items(),
)
def test_mistakes_are_told_with_key_and_line(study, more, words):
    study.write_text(more)
    with pytest.raises(StudyError, match=words):
        read_study(study, DiagramStudy)
