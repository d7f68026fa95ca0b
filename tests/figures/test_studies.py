"""The studies of orbits run in their fast form, and what they expect comes out."""

import importlib
import json
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def scripts_importable(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "experiments"))
    monkeypatch.syspath_prepend(str(ROOT))


# What is held against a source, or another computation, and does not come out; the reasons stand in the claims.
DIFFER = {
    "propositions": {
        "simulations of (26) lie eps-close to the discontinuous system",
        "for N mu_s < |q''| there no longer exist pure sticking periodic orbits",
        "proposition 5, beta > 0: the same strip",
        "the orbits of proposition 5 have a fixed z",
        "corollary: at N mu_s = |q''| the one sticking orbit has z = 0",
    },
    # One value is off by 1.7e-5; two other computations agree on ours.
    "rest_limit": {"values of an independent computation"},
    # Hypotheses that were refuted.
    "avalanches": {
        "The exponent depends on the rate at which friction weakens",
        "A layer slower than a slip does",
    },
    "contact_laws": {
        "hypothesis 1: with one e at one speed the eight laws do the same",
        "hypothesis 2: laws with the same e at all speeds do the same",
    },
    "noise_recapture": {
        "oscillator: a tenth is left of the time stuck beyond N at kicks that grow alike",
        "oscillator: half of the half periods have a static peak, |mu| > 1.6 before kicks at kicks that grow alike",
        "oscillator: where it departs as without static friction nothing else tells of it",
    },
}


# Claims on speed, which no test judges.
SPEED = {"An error of 1e-6 costs least by events", "A period in the plane costs at most 8 of those on a line"}

# The misprints and slips that the studies of the sources' statements list: how many.
MISPRINTS = {"statements_solid_friction": 11, "statements_friction_contact": 1}
STUDIES = [
    "avalanches", "capture_bifurcation", "capture_exponents", "capture_map", "contact_laws", "continuum", "drive_map",
    "fronts", "gradient_optimum", "ladder", "noise_recapture", "other_tools", "planar_friction", "propositions",
    "rest_limit", "symmetry_breaking", "wider_circle", *MISPRINTS,
]  # fmt: skip


# Those that take a minute and more, fast as they are.
THOROUGH = {
    "avalanches", "capture_bifurcation", "capture_exponents", "contact_laws", "noise_recapture", "propositions",
    "rest_limit",
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.thorough) if n in THOROUGH else n for n in STUDIES]
)
def test_a_study_finds_what_it_expects(name, tmp_path):
    tools = importlib.import_module("studytools")
    study = importlib.import_module(name).STUDY
    content = tools.result(study, fast=True)
    differs = {claim["claim"] for claim in content["claims"] if not claim["holds"]} - SPEED
    assert differs == DIFFER.get(name, set()) if name not in MISPRINTS else len(differs) == MISPRINTS[name]
    # The chart is drawn from what the data file holds, and from nothing else.
    tools.draw(study, json.loads(json.dumps(content)), tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 10_000


def test_the_parts_of_a_killed_study_are_found_again_and_the_others_computed(monkeypatch):
    tools = importlib.import_module("studytools")
    monkeypatch.setattr(tools, "_parts", {"first": 1.0})
    # What was found is not computed again: of 16 it would be another number.
    assert tools.parts({"third": (math.sqrt, 81), "first": (math.sqrt, 16), "second": (math.sqrt, 4)}) == [
        9,
        1,
        2,
    ]
    assert set(tools._parts) == {"first", "second", "third", "spent"}
    assert tools.part("alone", math.sqrt, 25) == 5
    with pytest.raises(ValueError, match="math domain error"):
        tools.parts({"broken": (math.sqrt, -1), "fifth": (math.sqrt, 1)})
    assert "broken" not in tools._parts


# Gradients are measured beside peers that the tests do without; bifurcation sets take minutes, in the fast form too.
@pytest.mark.parametrize("name", [*STUDIES, "bifurcation_sets", "gradients"])
def test_the_kept_results_are_those_of_the_present_configuration(name):
    tools = importlib.import_module("studytools")
    study = importlib.import_module(name).STUDY
    kept = json.loads((ROOT / "experiments" / "results" / f"{name}.json").read_text())
    assert not kept["fast"]
    assert kept["config"] == tools.plain(study.full.__dict__)
    assert kept["claims"] == [claim.record() for claim in study.claims(kept["data"])]


@pytest.mark.parametrize("scene", ["crossing", "sticking", "ball"])
def test_the_references_of_gradients_are_those_of_the_runs(scene):
    gradients = importlib.import_module("gradients")
    system, motion = gradients.SCENES[scene]()
    names = [s.name for s in motion.names]
    exact, events = gradients.reference(scene, motion.values)
    run = gradients.solve(system, (0, motion.end), motion.start, by=names, rtol=1e-13, atol=1e-15)
    assert len(run.events) == events
    assert run.derivatives.end[0] == pytest.approx(exact, abs=1e-12 * abs(exact).max())


@pytest.mark.thorough
def test_the_work_precision_study_draws_its_charts_and_its_reading(tmp_path):
    tools = importlib.import_module("studytools")
    study = importlib.import_module("work_precision").STUDY
    content = json.loads(json.dumps(tools.result(study, fast=True)))
    # Speed is no test: of its claims only that on itineraries is held here.
    held = {claim["claim"]: claim["holds"] for claim in content["claims"]}
    assert held["The event-driven itineraries are right at every tolerance from 1e-6 down."]
    tools.draw(study, content, tmp_path / "chart.png")
    assert {path.name for path in tmp_path.iterdir()} == {"chart.png", "chart_evaluations.png", "chart_eps.png"}
    reading = importlib.import_module("work_precision_reading")
    (tmp_path / "data.json").write_text(json.dumps(content))
    said = reading.sentences(reading.Reading(reading.load(tmp_path / "data.json")[0]))
    assert len(said) >= 6 and "on 3 and below 1e-12 on 3 of the 3 scenes" in said[0]


def test_the_page_of_the_methods_says_what_its_data_say():
    reading = importlib.import_module("work_precision_reading")
    assert reading.PAGE.read_text() == reading.page(*reading.load())
