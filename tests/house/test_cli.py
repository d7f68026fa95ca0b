"""The command line: what it accepts, what it prints, how it ends.

Guards: paths/warmup.py, __main__.py.
"""

import re
import subprocess
import sys
import tomllib

import pytest
from typer.testing import CliRunner

from paper_figures import making as figures
from pwsmooth.cli import app
from pwsmooth.codegen.machine import units
from pwsmooth.studies.study import Names, StudyError


@pytest.fixture
def run():
    return lambda *arguments: CliRunner().invoke(app, list(arguments))


def test_the_list_names_every_figure(run):
    result = run("figures", "--list")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.output.splitlines()] == list(figures.discover())


def test_figures_are_made_where_out_says(run, tmp_path):
    result = run("figures", "4", "--fast", "--out", str(tmp_path / "new" / "place"))
    assert result.exit_code == 0, result.output
    assert (tmp_path / "new" / "place" / "figure_04.png").exists()


def test_an_unknown_figure_ends_with_2_and_says_which_exist(run, tmp_path):
    result = run("figures", "99", "--out", str(tmp_path))
    assert result.exit_code == 2 and "no figure is named 99" in result.output


def test_a_figure_that_fails_ends_with_1(run, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "make", lambda *a, **k: False)
    assert run("figures", "--out", str(tmp_path)).exit_code == 1


def test_an_interruption_ends_with_130_and_says_what_is_complete(run, tmp_path, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(figures, "make", interrupted)
    result = run("figures", "--out", str(tmp_path))
    assert result.exit_code == 130 and "complete" in result.output


def test_warmup_leaves_nothing_of_the_core_to_compile(run):
    result = run("warmup")
    assert result.exit_code == 0, result.output
    assert f"{len(units.ALL)} parts of the numerical core are compiled" in result.output
    assert all(units._read(name) for name in units.ALL)


def test_the_version_is_printed(run):
    from importlib.metadata import version

    assert run("--version").output.strip() == f"pwsmooth {version('pwsmooth')}"


def test_help_imports_neither_numba_nor_matplotlib_nor_sympy():
    code = (
        "import sys\nfrom pwsmooth.cli import app\n"
        "try:\n    app(['figures', '--help'])\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numba', 'matplotlib', 'sympy', 'scipy', 'numpy') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip().endswith("[]")


@pytest.mark.parametrize("arguments, code", [(["--version"], 0), (["figures", "99"], 2)])
def test_python_minus_m_is_the_same_command(run, arguments, code):
    here = run(*arguments)
    result = subprocess.run(
        [sys.executable, "-m", "pwsmooth", *arguments], capture_output=True, text=True, check=False
    )
    # Older runners of click do not keep the two streams apart.
    assert (result.returncode, result.stdout + result.stderr) == (here.exit_code, here.output)
    assert result.returncode == code and bool(result.stderr) == (code != 0)


def test_the_help_of_a_sweep_describes_the_file(run):
    """Its example is a study, and every key of a study stands in it."""
    from pwsmooth.studies.study import Study, SystemTable

    text = run("sweep", "--help").output
    example = re.search(r"An\s+example:\s(.*?)Keys\s+of\s+the\s+file:", text, flags=re.DOTALL)[1]
    study = Study.model_validate(tomllib.loads(example))
    assert study.system.scene == "friction_oscillator" and len(study.axes) == 2
    for key in (*Study.model_fields, *SystemTable.model_fields):
        assert re.search(rf"\b{key}\b", text), key


@pytest.mark.parametrize("width", [30, 60, 80])
def test_numbers_of_a_table_are_never_cut(width, monkeypatch, capsys):
    from pwsmooth.compare.exact import report
    from pwsmooth.compare.exact.contract import Check, ExactProblem

    monkeypatch.setenv("COLUMNS", str(width))
    check = Check("a quantity whose name takes more than one line", 1.76547949871234, 1.76547949871235, 1e-12)
    report.run([], of=[ExactProblem("one", "a statement", "exact", lambda: [check])])
    shown = re.split(r"^ +[\d.]+ s$", capsys.readouterr().out, flags=re.MULTILINE)[0]
    numbers = f"{check.computed:.15g} {check.exact:.15g} {check.error:.1e} {check.tolerance:.1e}"
    assert "…" not in shown
    assert sorted(re.findall(r"\d", shown)) == sorted(re.findall(r"\d", numbers))
    assert width < 80 or all(number in shown for number in numbers.split())


def test_flags_are_shown_without_a_type(run):
    for arguments in (["--help"], ["sweep", "--help"], ["explore", "--help"]):
        assert "<bool>" not in run(*arguments).output


def test_a_new_folder_is_said(tmp_path):
    from pwsmooth.cli import _telling

    with _telling(tmp_path):
        pass
    with _telling(tmp_path / "new") as nothing:
        (tmp_path / "new").mkdir()
    assert nothing is None


def test_a_file_without_a_name_and_a_misspelt_scene_are_said(run, tmp_path):
    assert "write m.py:NAME" in run("explore", "m.py").output
    assert "did you mean 'friction_oscillator'?" in run("explore", "friction_oscilator").output
    assert (
        "a contact law where a friction law belongs"
        in run("explore", "friction_oscillator", "--law", "Hertz").output
    )
    assert "Did you mean 'figure-4'?" in run("explore", "--preset", "figure_4").output


def test_a_page_without_python_is_written_from_the_command_line(run, tmp_path):
    file = tmp_path / "oscillator.html"
    done = run("explore", "friction_oscillator", "--export", str(file), "--over", "rho=1:3:3")
    assert done.exit_code == 0 and "a slider over rho=1:3:3" in done.output
    assert "</html>" in file.read_text()
    for over, said in (
        ("rho", "give NAME=LOW:HIGH:COUNT"),
        ("rho=1:3:1", "two values"),
        ("mu=1:2:3", "names 'mu'"),
    ):
        refused = run("explore", "friction_oscillator", "--export", str(file), "--over", over)
        assert refused.exit_code and said in refused.output
    assert "belongs to `--export`" in run("explore", "friction_oscillator", "--over", "rho=1:3:3").output


def test_functions_of_math_and_numpy_on_symbols_are_told_apart_in_a_file(tmp_path):
    for line, words in {
        "math.sin(x)": "sympy.sin",
        "np.sin(x)": r"sympy\.sin\(x\)",
        "np.sign(x)": "sympy.sign",
        "1 if x > 0 else 2": "Piecewise",
    }.items():
        (tmp_path / "m.py").write_text(
            f"import math, numpy as np, sympy as sp\nx = sp.Symbol('x')\nrate = {line}\n"
        )
        with pytest.raises(StudyError, match=words):
            Names(folder=tmp_path).get("m.py:rate", "what is explored")
