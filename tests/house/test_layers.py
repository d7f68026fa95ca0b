"""The layers of the package, as [tool.importlinter] of pyproject.toml has them. Nothing is imported, only read."""

import graphlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parents[2]
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"


def lint(folder):
    """Exit code and words of import-linter on the checkout in the folder."""
    done = subprocess.run(
        [sys.executable, "-c", LINT, "--no-cache"], cwd=folder, capture_output=True, text=True, encoding="utf-8"
    )
    return done.returncode, re.sub(r"\x1b\[[\d;]*m", "", done.stdout + done.stderr)


def test_imports_keep_to_the_layers():
    code, words = lint(ROOT)
    assert code == 0, words


def test_no_module_reaches_itself():
    # Also by way of a package's own `__init__`, which is nobody's sibling.
    graph = grimp.build_graph("pwsmooth", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    graphlib.TopologicalSorter(imports).prepare()  # raises CycleError


def test_no_folder_is_too_full_to_survey():
    full = {
        str(folder.relative_to(ROOT)): len(list(folder.glob("*.py")))
        for folder in [ROOT / "pwsmooth", *(p for p in (ROOT / "pwsmooth").rglob("*") if p.is_dir())]
    }
    assert full["pwsmooth"] <= 8
    assert {folder: count for folder, count in full.items() if count > 25} == {}


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("layers")
    shutil.copy(ROOT / "pyproject.toml", folder)
    shutil.copytree(ROOT / "pwsmooth", folder / "pwsmooth", ignore=shutil.ignore_patterns("__pycache__"))
    assert lint(folder)[0] == 0
    return folder


@pytest.mark.parametrize(
    "contract, file, line",
    [
        ("No circles, in any folder", "results/records.py", "def f():\n    from .solution import Solution\n"),
        ("pwsmooth", "kernels/state.py", "if TYPE_CHECKING:\n    from ..definition.model import Model\n"),
        ("pwsmooth", "definition/model.py", "from ..results import records\n"),
        ("pwsmooth", "analysis/orbits/finding.py", "def f():\n    from ...scenes import t\n"),
        ("pwsmooth.analysis", "analysis/maps/sections.py", "from ..orbits import finding\n"),
        ("pwsmooth", "door/checks.py", "from ..definition import model\n"),
        ("pwsmooth.definition", "definition/primitives.py", "from .families import family\n"),
        ("pwsmooth.codegen", "codegen/graph/nodes.py", "from .. import fields\n"),
        ("pwsmooth.kernels", "kernels/surface/sliding.py", "from ..instant import firing\n"),
        ("pwsmooth.kernels", "kernels/trajectory.py", "def f():\n    from .noise import path\n"),
        ("pwsmooth.compare", "compare/exact/report.py", "from ..ladders import chart\n"),
        ("Laws and systems are notation", "laws/inclusions.py", "from ..results import records\n"),
        ("What is built on solve()", "analysis/sticking/capture.py", "from ...codegen import layout\n"),
        ("The stiff loop does without", "kernels/stiff/sparse.py", "from ..work import Work\n"),
    ],
    ids=lambda text: text.split("\n")[0],
)
def test_an_import_against_the_layers_is_refused(copy, contract, file, line):
    path = copy / "pwsmooth" / file
    before = path.read_text(encoding="utf-8")
    path.write_text(before + "\n" + line, encoding="utf-8")
    try:
        code, words = lint(copy)
    finally:
        path.write_text(before, encoding="utf-8")
    lines = [" ".join(part.split()) for part in words.splitlines()]
    assert code == 1 and any(part.startswith(contract) and part.endswith("BROKEN") for part in lines), words


def test_a_new_folder_must_find_its_layer(copy):
    path = copy / "pwsmooth" / "unheard_of.py"
    path.write_text("", encoding="utf-8")
    try:
        code, words = lint(copy)
    finally:
        path.unlink()
    assert code == 1 and "unheard_of" in words, words
