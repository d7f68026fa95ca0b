"""Maps of hazards: the rules that tell failures apart, borders that lie where theory puts them, maps that travel.

Guards: compare/hazards/.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from pwsmooth.compare.hazards import HAZARDS, Axis, Finding, Hazard, stability
from pwsmooth.compare.hazards.charts import page, plot_map
from pwsmooth.compare.hazards.failures import Collapsed, Stalled, attempt, held
from pwsmooth.compare.hazards.fixed import compiled, fixed, longest_stable
from pwsmooth.compare.hazards.maps import built_in
from pwsmooth.compare.hazards.stability_map import StabilityMap
from pwsmooth.compare.hazards.tables import markdown, what_happens


def made(methods=None, worse="right"):
    """A hazard whose method fails beyond x = 1."""
    methods = methods or {"event-driven": lambda x, row: Finding("stall" if x > 1 else "right", x)}
    return Hazard("made", "a made one", Axis("x", (0.1, 0.5, 2.0, 10.0)), Axis("row", (1.0, 2.0)), methods,
                  lambda method, row: 1.0, worse=worse)  # fmt: skip


# ---- rules


def test_a_run_is_put_into_its_kind():
    def collapse():
        raise Collapsed

    def stall():
        raise Stalled

    assert attempt(collapse, None).kind == "step collapse" and attempt(stall, None).kind == "stall"
    assert attempt(lambda: 3, lambda got: Finding("right", got)).size == 3
    with pytest.raises(ZeroDivisionError):  # a bug is no way of failing
        attempt(lambda: 1 / 0, None)
    assert held(np.array([1.0, 1.0]), 1.0) is None
    assert held(np.array([1.0, 2.0]), 1.0) == Finding("energy growth", 2.0)
    assert held(np.array([1.0, math.nan]), 1.0).kind == "blow-up"
    assert held(np.array([1.0, 2e6]), 1.0).kind == "blow-up"
    with pytest.raises(ValueError, match="`kind` is 'bad'"):
        Finding("bad")


@pytest.mark.parametrize("method", ["explicit Euler", "Runge-Kutta 4"])
@pytest.mark.parametrize("eigenvalue", [-3.0, -1 + 5j])
def test_the_longest_stable_step_is_the_last_that_does_not_grow(method, eigenvalue):
    a, b = eigenvalue.real, eigenvalue.imag
    matrix = np.array([[a, b], [-b, a]])
    rates = compiled(lambda t, x, p: np.array([p[0] * x[0] + p[1] * x[1], p[2] * x[0] + p[3] * x[1]]))
    h = longest_stable(method, matrix)
    for factor, grows in ((0.98, False), (1.02, True)):
        x = fixed(method, rates, 0.0, (1.0, 0.3), factor * h, 2000, matrix.ravel())
        assert (np.linalg.norm(x[-1]) > np.linalg.norm(x[0])) == grows


def test_backward_euler_solves_its_equation():
    rates = compiled(lambda t, x, p: np.array([-(x[0] ** 3) + p[0] * t, x[0] - 50 * x[1], x[1] - x[2]]))
    x = fixed("backward Euler", rates, 0.0, (1.0, 2.0, -1.0), 0.1, 10, (0.3,))
    for k in range(10):
        f = rates(0.1 * (k + 1), x[k + 1], np.array([0.3]))
        assert x[k + 1] - x[k] - 0.1 * f == pytest.approx(0, abs=1e-12)


# ---- maps


def test_a_map_counts_failures_and_agrees_with_its_border():
    found = stability(made())
    assert found.tally("event-driven") == {"right": 4, "stall": 4}
    assert (
        found.agreement("event-driven") == 1.0
        and stability(made(worse="left")).agreement("event-driven") == 0.0
    )
    assert what_happens(found, "event-driven") == "stall 50 %, at theory's border"
    several = {"event-driven": lambda x, row: [Finding("right"), Finding("recorded")]}
    assert what_happens(stability(made(several)), "event-driven") == "right or recorded"


def test_a_map_survives_its_file_and_is_a_dataset():
    found = stability(made())
    again = StabilityMap.from_record(json.loads(json.dumps(found.record())))
    assert again.record() == found.record()
    data = again.data
    assert int(data.runs.sel(solver="event-driven", failure="stall", x=2.0).sum()) == 2
    assert data.border.values.tolist() == [[1.0, 1.0]]


def test_charts_and_the_table_show_every_method():
    found = stability(made())
    assert [label.get_text() for label in plot_map(found).get_yticklabels()] == ["event-driven"]
    assert len(page([found] * 4).axes) >= 4
    partly = stability(made({"event-driven": lambda x, row: [] if x > 1 else Finding("right")}))
    words = [[text.get_text() for text in page([one]).legends[0].texts] for one in (found, partly)]
    assert words == [["right", "s  stall", "border by theory"], ["right", "not run", "border by theory"]]
    # One letter in the band that fails, for readers who do not tell the colours apart.
    letters = [text.get_text() for text in plot_map(found).texts]
    assert [letter for letter in letters if letter.isalpha()] == ["s"]
    text = markdown({"data": {"maps": [found.record()]}})
    assert text.splitlines()[2] == "| a made one | event-driven: stall 50 %, at theory's border |"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("lugres",), "`hazard` is 'lugres'"), (("lugre", ["Euler"]), "`methods` contains 'Euler'")],
)
def test_unknown_names_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        stability(*arguments)


@pytest.mark.parametrize("name", ["lugre", "dai-friction", "dai-contact", "stiff-contact"])
def test_explicit_steps_fail_where_theory_says(name):
    found = stability(name, ["explicit Euler", "Runge-Kutta 4"], fast=True)
    for method in found.methods:
        assert found.failed(method).any()
        # What disagrees are cells beside the border: less than one in twenty.
        assert found.agreement(method) >= 0.95


@pytest.mark.parametrize("name", list(HAZARDS))
def test_every_hazard_says_what_it_is(name):
    one = built_in(name, fast=True)
    assert one.name == name and one.title and one.truth and len(one.x) > 1
    assert not one.rows.words or len(one.rows.words) == len(one.rows)
    assert any(m.startswith(("event-driven", "smoothed path")) for m in one.methods)


# ---- this package's own paths survive

OWN = [
    (name, method)
    for name in HAZARDS
    for method in built_in(name, fast=True).methods
    if method in ("event-driven", "event-driven, layered", "event-driven, 8(5,3) pair", "smoothed path")
]
# A smoothed contact creeps, follows its folds with delay and holds small kicks: another answer than the limit's.
STAND_IN = {"near-fold", "noise", "long-stick"}


@pytest.mark.parametrize(
    ("name", "method"),
    [o for o in OWN if o[1] != "smoothed path" or o[0] not in STAND_IN],
)
def test_our_methods_are_right_or_say_that_they_cannot_decide(name, method):
    found = stability(name, [method], fast=True)
    failed = found.failed(method)
    assert int(found.total(method).sum()) > 0
    assert int(failed.sum()) == 0, found.tally(method)


def test_folds_nearer_than_rounding_are_recorded():
    found = stability("near-fold", ["event-driven"])
    assert int(found.failed("event-driven").sum()) == 0


@pytest.mark.parametrize("name", sorted(STAND_IN))
def test_the_smoothed_stand_in_leaves_the_limit_where_theory_says(name):
    found = stability(name, ["smoothed path"], fast=True)
    assert found.failed("smoothed path").any()
    assert found.agreement("smoothed path") >= 0.95


def test_sticks_of_a_thousand_cycles_are_exactly_at_rest():
    # size is the largest |x| and |v|
    assert built_in("long-stick").methods["event-driven"](1000.0, 0.99) == Finding("right", 0.0)


@pytest.mark.parametrize("distance", [10.0**-k for k in range(3, 13)])
def test_grazing_is_decided_down_to_1e_12(distance):
    one = built_in("grazing")
    for row in one.rows.values:
        found = one.methods["event-driven"](distance, row)
        assert found.kind == "right" or (found.kind == "recorded" and distance < 1e-11)


def test_the_pair_holds_its_surfaces_together():
    # z counts how long both slid: arrivals between 1e-16 and 0.1 apart
    one = built_in("simultaneous")
    for separation in one.x.values:
        for row in one.rows.values:
            assert one.methods["event-driven"](separation, row).kind == "right"


# ---- the kept data

KEPT = Path(__file__).resolve().parents[2] / "experiments" / "results" / "stability.json"


def test_the_kept_maps_are_those_of_the_present_hazards():
    kept = {record["name"]: record for record in json.loads(KEPT.read_text(encoding="utf-8"))["data"]["maps"]}
    assert list(kept) == list(HAZARDS)
    for name, record in kept.items():
        found, one = StabilityMap.from_record(record), built_in(name)
        assert not record["fast"] and (found.x, found.rows, found.law) == (one.x, one.rows, one.law)
        assert set(found.methods) | set(found.left_out) == set(one.methods)
        for method in found.methods:
            border = [one.border(method, row) if one.border else math.nan for row in one.rows.values]
            assert found.border[method] == pytest.approx(border, rel=1e-6, nan_ok=True)
