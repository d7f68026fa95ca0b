"""The built-in problems with exact answers, and the command that runs them.

Guards: compare/exact/.
"""

import math

import pytest
from typer.testing import CliRunner

from pwsmooth import cli
from pwsmooth.compare import exact
from pwsmooth.compare.exact import Check, ExactProblem, catalogue, report

RUNNER = CliRunner()


@pytest.mark.parametrize("name", exact.problems())
def test_the_exact_answer_is_met(name):
    (verdict,) = exact.verify([name])
    assert not verdict.failure
    assert verdict.checks
    assert [check for check in verdict.checks if not check.holds] == []


def test_the_command_prints_the_numbers_and_succeeds():
    result = RUNNER.invoke(cli.app, ["verify", "relays", "repelling"], env={"COLUMNS": "100"})
    assert result.exit_code == 0
    assert "start of sliding" in result.output and "2 problems: all 7 numbers agree" in result.output


def test_the_command_lists_the_problems():
    result = RUNNER.invoke(cli.app, ["verify", "--list"])
    assert result.exit_code == 0
    assert all(name in result.output for name in exact.problems())


def test_an_unknown_problem_is_refused_with_those_that_there_are():
    result = RUNNER.invoke(cli.app, ["verify", "spiral"])
    assert result.exit_code == 2
    assert "'spiral', which is no problem; choose from spirals, relays" in result.output


@pytest.mark.parametrize("computed", [1.0 + 2e-9, math.nan])
def test_a_miss_fails_the_command(monkeypatch, computed):
    wrong = ExactProblem("wrong", "1 = 1", "arithmetic", lambda: [Check("one", computed, 1.0, 1e-9)])
    monkeypatch.setattr(catalogue, "PROBLEMS", [wrong])
    result = RUNNER.invoke(cli.app, ["verify"])
    assert result.exit_code == 1
    assert "MISS" in result.output and "1 of 1 problem missed: wrong" in result.output


def test_a_problem_that_raises_is_a_miss_and_does_not_hide_the_next(capsys):
    def broken():
        raise ZeroDivisionError("division by zero")

    good = ExactProblem("good", "1 = 1", "arithmetic", lambda: [Check("one", 1.0, 1.0, 0.0)])
    bad = ExactProblem("bad", "1/0", "arithmetic", broken)
    empty = ExactProblem("empty", "nothing is checked", "arithmetic", list)
    assert not report.run([], of=[bad, empty, good])
    printed = capsys.readouterr().out
    assert "ZeroDivisionError: division by zero" in printed
    assert "2 of 3 problems missed: bad, empty" in printed
