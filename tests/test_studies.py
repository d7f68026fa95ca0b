"""The studies of orbits run in their fast form, and what they expect comes out."""

import importlib
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(autouse=True)
def scripts_importable(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "experiments"))
    monkeypatch.syspath_prepend(str(ROOT))
    yield
    sys.modules.pop("studytools", None)


# r* is printed with an error in its third decimal (spec/solid_friction.md section 3 against separatrix and bisection).
DIFFER = {"capture_map": {"critical ratio r*, algebraic", "critical ratio r*, tanh"}}


@pytest.mark.parametrize("name", ["capture_map", "ladder", "propositions", "symmetry_breaking", "wider_circle"])
def test_a_study_finds_what_it_expects(name, tmp_path):
    tools = importlib.import_module("studytools")
    study = importlib.import_module(name).STUDY
    content = tools.result(study, fast=True)
    differs = {claim["claim"] for claim in content["claims"] if claim["verdict"] == "differs"}
    assert differs == DIFFER.get(name, set())
    # The chart is drawn from what the data file holds, and from nothing else.
    tools.draw(study, json.loads(json.dumps(content)), tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["capture_map", "ladder", "propositions", "symmetry_breaking", "wider_circle"])
def test_the_kept_results_are_those_of_the_present_configuration(name):
    tools = importlib.import_module("studytools")
    study = importlib.import_module(name).STUDY
    kept = json.loads((ROOT / "experiments" / "results" / f"{name}.json").read_text())
    assert not kept["fast"]
    assert kept["config"] == tools.plain(study.full.__dict__)
    assert kept["claims"] == [claim.record() for claim in study.claims(kept["data"])]
