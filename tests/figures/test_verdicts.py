"""Every verdict can fail: of the studies by their kept data, of the figures by what their claims are made of."""

import ast
from pathlib import Path

import pytest

from tests import verdicts

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = [*sorted((ROOT / "paper_figures").glob("figure_*.py")), *sorted((ROOT / "experiments").glob("*.py"))]


@pytest.mark.parametrize("name", verdicts.studies())
def test_every_verdict_of_a_study_is_turned_by_a_value_that_it_is_made_of(name):
    assert [statement for statement, by in verdicts.of_study(name).items() if not by] == []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_no_claim_has_a_verdict_that_is_written_down(path):
    fixed = [
        ast.unparse(node.args[0])
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in verdicts.MAKERS
        and len(node.args) > 3 and not any(isinstance(n, ast.Name) for n in ast.walk(node.args[3]))
    ]  # fmt: skip
    assert fixed == []


@pytest.mark.parametrize(
    "text, turns", [("abs(ours - 3) < 1e-3", True), ("abs(ours - 3) >= 0", False), ("ours == ours", False)]
)
def test_a_verdict_that_cannot_fail_is_told_from_one_that_can(text, turns):
    assert bool(verdicts.turned_by(text, {"ours": 3.0})) == turns
