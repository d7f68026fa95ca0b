"""The ladder of models: what it measures, what it recommends, and when it must not.

Guards: compare/ladders/.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from pwsmooth.cli import app
from pwsmooth.compare import ladder
from pwsmooth.compare.ladders import (
    Ladder,
    Observable,
    Rung,
    Setting,
    Step,
    amplitude,
    contact_rungs,
    curve,
    friction_rungs,
    judge,
    peak,
    period,
    recommend,
    scenes,
    setting_of,
    share_below,
)
from pwsmooth.laws import contact, friction
from pwsmooth.scenes import block_on_belt, friction_oscillator


def step(name, verdict, seconds=1.0, error=0.0, value=1.0, failure=""):
    return Step(name, "", np.array(value), error, 0.0, seconds, 1, failure, 0.0, error, verdict)


# ---- what it recommends


def test_a_distance_is_judged_with_its_bar():
    assert judge(0.5, 0.1, 1.0) == "within"
    assert judge(1.5, 0.1, 1.0) == "outside"
    assert judge(0.95, 0.1, 1.0) == judge(1.05, 0.1, 1.0) == "undecided"
    assert judge(math.inf, 0.0, 1.0) == "outside"


def test_the_cheapest_rung_within_is_recommended_also_above_a_poorer_one():
    steps = [step("poor", "within", 5.0), step("middle", "within", 1.0), step("rich", "richest", 9.0)]
    assert recommend(steps, 0.1)[0] == "middle"


def test_of_rungs_of_one_cost_the_poorer_is_recommended():
    steps = [step("poor", "within", 1.2), step("middle", "within", 1.0), step("rich", "richest", 9.0)]
    name, reason = recommend(steps, 0.1)
    assert name == "poor" and "as good as equal" in reason


@pytest.mark.parametrize(
    ("seconds", "steps", "chosen"),
    [(9e-4, 2, "poor"), (9e-4, 30, "middle"), (3e-3, 2, "middle")],
)
def test_in_runs_of_a_millisecond_steps_decide(seconds, steps, chosen):
    rungs = [step("poor", "within", seconds), step("middle", "within", 5e-4), step("rich", "richest", 9.0)]
    rungs = [replace(rung, steps=n) for rung, n in zip(rungs, (steps, 18, 21))]
    assert recommend(rungs, 0.1)[0] == chosen


def test_the_richest_is_recommended_where_nothing_coarser_is_cheaper():
    steps = [step("poor", "within", 20.0), step("rich", "richest", 1.0)]
    assert recommend(steps, 0.1)[0] == "rich"


def test_none_is_where_no_coarser_rung_is_surely_within():
    steps = [step("a", "outside"), step("b", "undecided"), step("c", "failed"), step("d", "richest")]
    name, reason = recommend(steps, 0.1)
    assert name is None and reason.startswith("none is") and "undecided: b" in reason


@pytest.mark.parametrize(
    ("top", "word"),
    [
        (step("d", "richest", error=0.2), "own error"),
        (step("d", "failed", failure="too many steps"), "failed"),
        (step("d", "richest", value=math.nan), "no such quantity"),
    ],
)
def test_nothing_is_recommended_where_the_richest_rung_has_no_answer(top, word):
    name, reason = recommend([step("a", "within"), top], 0.1)
    assert name is None and word in reason


# ---- exact cases


def den_hartog(level, *, size=5.0, stiffness=1000.0, omega=20.0, mass=1.0):
    """Amplitude of the steady motion without sticks, Den Hartog, Trans. ASME 53 (1931) 107-115."""
    ratio = omega / math.sqrt(stiffness / mass)
    response = 1 / (1 - ratio**2)
    loss = math.sin(math.pi / ratio) / (ratio * (1 + math.cos(math.pi / ratio)))
    return size / stiffness * math.sqrt(response**2 - (level / size * loss) ** 2)


def test_coulomb_suffices_for_the_amplitude_without_sticks_and_is_den_hartogs():
    found = ladder("forced oscillator", "amplitude", "1%")
    assert found.recommended == "Coulomb"
    low = found["Coulomb"]
    level = float(low.matched.split("F_c = ")[1].split(",")[0])
    # The level is printed with five digits.
    slope = (den_hartog(level + 1e-3) - den_hartog(level - 1e-3)) / 2e-3
    assert float(low.value) == pytest.approx(den_hartog(level), abs=low.error + abs(slope) * 5e-5)


def test_coulombs_distance_from_stiffening_bristles_vanishes_as_the_root_of_their_length():
    turn = 2 * math.pi / 20

    def build(law):
        return friction_oscillator(law, k=1000.0, c=0.0, amplitude=5.0, omega=20.0, x0=(0.0, 0.0),
                                   t_span=(0, 40 * turn))  # fmt: skip

    def distance(stiffness):
        law = friction.XKY(kappa=stiffness, sigma=10.0, F_c=1.0, F_s=1.0, sigma2=0.0)
        setting = Setting("limit", "limit", Rung("XKY", lambda: build(law), "itself"),
                          lambda motion: friction_rungs(law, build, 0.1)[:1], [amplitude("amplitude", "y", "m")],
                          (36 * turn, 40 * turn))  # fmt: skip
        low = ladder(setting, "amplitude", 1e-4, repeats=1)["Coulomb"]
        assert float(low.value) == pytest.approx(den_hartog(1.0), abs=low.error + 1e-12)
        return low.distance

    # After a reversal with acceleration a the bristle, 2 F_c/kappa long, is wound up for a time sqrt(4 F_c/(kappa a)),
    # in which the friction differs: the next order is smaller by that time over a quarter period, 0.08 at 3e4 N/m.
    assert distance(3e4) / distance(3e5) == pytest.approx(math.sqrt(10), rel=0.08)


def test_coulomb_on_the_belt_only_swings_and_two_levels_have_their_closed_period():
    found = ladder("belt", "period", "2%", repeats=1)
    assert float(found["Coulomb"].value) == pytest.approx(2 * math.pi / math.sqrt(2), abs=1e-6)
    low = found["static + kinetic"].matched
    kinetic = float(low.split("level ")[1].split(",")[0])
    V, A, w = 0.1, (1.5 - kinetic) / 2, math.sqrt(2)
    exact = 2 * (math.pi - math.atan(A * w / V)) / w + 2 * A / V
    # dT/dA < 2/V = 20, times the rounding of the printed level, half of 5e-5.
    assert float(found["static + kinetic"].value) == pytest.approx(exact, abs=20 * 2.5e-5)
    assert found["Stribeck curve"].verdict == "within" and found["LuGre"].verdict == "outside"
    assert found.recommended == "Stribeck curve"


def test_only_the_relaxing_hidden_term_gives_the_asymmetric_orbit():
    found = ladder("oscillator", "top displacement", "1%", repeats=1, samples=4)
    assert [found[name].verdict for name in ("Coulomb", "hidden static", "two-stage")] == ["outside"] * 3
    assert found.recommended == "relaxing"
    # Listed: max y = 1.3559 at eps = 0.001, beta = 0.1 (an independent stiff solver).
    assert float(found["compliant"].value) == pytest.approx(1.3559, abs=5e-5)
    # A mean over kicks has an interval, and the kicks are addressed: another run gives the same bits.
    again = ladder("oscillator", "top displacement", "1%", repeats=1, samples=4)
    assert found.steps[-1].spread > 0 and again.steps[-1].value == found.steps[-1].value


@pytest.mark.thorough
def test_nothing_short_of_the_multistate_law_has_the_presliding_loss():
    found = ladder("presliding", "loss", "2%", repeats=1)
    assert found.recommended is None and found.reason.startswith("none is")
    # Rate-independent elements: 4 L (a - d)+ of a loop of half range a; the large one, and two small ones (Masing).
    s = math.acos(math.sqrt(7 / 12))
    top, bottom = math.sin(s) + math.sin(3 * s) / 2, 1 - 0.5
    level = float(found["Maxwell slip"].matched.split("shares of ")[1].split(",")[0])
    elements = friction.MaxwellSlip(kappa=tuple(2.5 / i for i in range(1, 11)), strength=(0.1 * level,) * 10)
    exact = elements.loss(top) + 2 * elements.loss((top - bottom) / 2)
    assert float(found["Maxwell slip"].value) == pytest.approx(exact, rel=1e-4)  # five digits of the level


def test_the_rigid_wall_has_the_restitution_of_the_richest_law_and_no_duration():
    found = ladder("impact", "restitution", "2%", repeats=1)
    for name in ("rigid impact", "Hertz with damping"):
        assert found[name].distance <= found[name].bar + 1e-9  # rtol of the run that gives e
    assert found["linear with residual"].verdict == "outside"
    assert ladder("impact", "duration", "2%", repeats=1)["rigid impact"].value == 0
    force = ladder("impact", "top force", "2%", repeats=1)["rigid impact"]
    assert np.isnan(force.value) and force.verdict == "outside"


@pytest.mark.thorough
def test_the_ideal_joint_has_the_position_and_not_the_acceleration():
    assert ladder("slider-crank", "position", 1e-3, repeats=1).recommended == "ideal"
    found = ladder("slider-crank", "top acceleration", "10%", repeats=1)
    assert found["ideal"].verdict == "outside"
    # x'' at phi = pi, in closed form: listed 18.277 m/s^2.
    assert float(found["ideal"].value) == pytest.approx(18.277, abs=5e-4)


# ---- matching


def test_levels_are_the_richest_laws_own_steady_force():
    richest = friction.LuGre(sigma2=2.0)
    rungs = {rung.name: rung for rung in friction_rungs(richest, block_on_belt, 0.3)}
    assert list(rungs) == ["Coulomb", "Stribeck curve", "Dahl"]  # 1.6 N at 0.3 m/s: no static excess over that
    system = rungs["Coulomb"].scene().system
    assert {str(k): v for k, v in system.parameters.items()}["F_c"] == pytest.approx(1.0 + 2.0 * 0.3, rel=1e-12)
    slow = [rung.name for rung in friction_rungs(richest, block_on_belt, 0.1)]
    assert slow == ["Coulomb", "static + kinetic", "Stribeck curve", "Dahl"]


def test_the_linear_contact_does_the_same_slow_work():
    law = contact.ResidualIndentation()
    from pwsmooth.compare.ladders.contact import first_impact
    from pwsmooth.scenes import free_impact

    depth = first_impact(law, 1.0, 1.0).depth
    rung = contact_rungs(law, lambda law: free_impact(law), 1.0, 1.0)[2]
    K = {str(k): v for k, v in rung.scene().system.parameters.items()}["K"]
    assert K * depth**2 / 2 == pytest.approx(law.K * depth**2.5 / 2.5, rel=1e-12)


# ---- failures and doors


def test_a_rung_that_fails_is_said_and_the_others_stand():
    # Too few steps for implicit ones to be looked at.
    found = ladder("belt", "period", "2%", repeats=1, max_steps=10_000)
    assert found["Dahl"].verdict == found["LuGre"].verdict == "failed" and "steps" in found["Dahl"].failure
    assert found.recommended == "Stribeck curve"
    assert "failed" in repr(found)
    Ladder.from_records(found.records()).chart()


def test_a_wandering_observable_makes_its_own_error_known():
    # A quantity that follows the last digits of the run: nothing can be said of its distance.
    wild = Observable("digits", "1", "digits", lambda m, w, n: float(np.sin(1e9 * m(w[1], "v"))))
    found = ladder("belt", wild, 1e-3, repeats=1)
    assert found.recommended is None and "own error" in found.reason


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        (("belts", "period", 0.1), ValueError, ("`scene`", "'belts'", "oscillator")),
        ((3, "period", 0.1), TypeError, ("`scene`", "friction_setting")),
        (("belt", "periods", 0.1), ValueError, ("`observable`", "'periods'", "top speed")),
        (("belt", "period", -1.0), ValueError, ("`tolerance`", "-1.0")),
        (("belt", "period", "5"), ValueError, None),
        (("belt", "period", "abc"), TypeError, ("`tolerance`", "'abc'", "5%")),
        (("belt", "period", "0%"), ValueError, ("`tolerance`", "0%")),
    ],
)
def test_errors_at_the_door(arguments, kind, words):
    if words is None:  # a number in a string is a number
        assert ladder(*arguments, repeats=1, max_steps=2000).tolerance == 5.0
        return
    with pytest.raises(kind) as caught:
        ladder(*arguments)
    assert all(word in str(caught.value) for word in words)


def test_laws_that_stand_on_no_rung_are_refused():
    with pytest.raises(ValueError, match="BoucWen.*Coulomb"):
        friction_rungs(friction.BoucWen(), block_on_belt, 1.0)
    with pytest.raises(ValueError, match="`speed`"):
        friction_rungs(friction.LuGre(), block_on_belt, 0.0)
    with pytest.raises(ValueError, match="KelvinVoigt"):
        contact_rungs(contact.KelvinVoigt(), None, 1.0, 1.0)
    with pytest.raises(ValueError, match="`mass`"):
        contact_rungs(contact.ResidualIndentation(), None, 1.0, -1.0)


# ---- observables, on a motion in closed form


def motion(t, name=None):
    return {"sine": np.sin(t), "jump": np.sign(np.sin(t)), "line": t}[name] * np.ones(np.shape(t))


def test_observables_of_a_sine():
    window, n = (0.0, 8 * math.pi), 2001
    assert peak("", "sine", "1").measure(motion, window, n) == pytest.approx(1.0, abs=1e-12)
    assert amplitude("", "sine", "1").measure(motion, window, n) == pytest.approx(1.0, abs=1e-12)
    assert period("", "sine", 0.5).measure(motion, window, n) == pytest.approx(2 * math.pi, rel=1e-14)
    exact = 2 * math.asin(0.1) / math.pi
    # Straight lines between samples: |sin''| h^2/8 at each of the 16 ends.
    assert share_below("", "sine", 0.1).measure(motion, window, n) == pytest.approx(exact, abs=1e-5)
    assert curve("", "line", "1", 4).measure(motion, (0.0, 1.0), n).tolist() == [0.125, 0.375, 0.625, 0.875]
    assert np.isnan(period("", "line", 0.5).measure(motion, window, n))


def test_a_peak_is_a_value_that_occurs():
    # A parabola through samples beside a jump from -1 to 1 would give 1.25.
    assert peak("", "jump", "1").measure(motion, (0.1, 8 * math.pi), 2001) == 1.0


# ---- forms of the result, and the command


def closed_setting():
    """Three models of sin t, in closed form: 0, the parabola of its first half wave, and itself."""
    arch = 4 / math.pi**2

    def model(f):
        return lambda: lambda t, name=None: f(np.asarray(t, float))

    rungs = [
        Rung("zero", model(lambda t: 0 * t), "nothing"),
        Rung("arch", model(lambda t: arch * t * (math.pi - t)), "top"),
    ]
    return Setting("sine", "a half wave", Rung("sine", model(np.sin), "itself"), lambda motion: rungs,
                   [peak("top", "y", "1"), curve("curve", "y", "1")], (0.0, math.pi))  # fmt: skip


def test_closed_models_have_their_distances():
    found = ladder(closed_setting(), "curve", 0.1)
    assert found["zero"].distance == pytest.approx(1.0, abs=1e-5)
    # max |sin t - (4/pi^2) t (pi - t)| = 0.05601, where cos t = (4/pi^2)(pi - 2 t)
    assert found["arch"].distance == pytest.approx(0.05601, abs=1e-4)
    assert found.recommended == "arch"
    assert ladder(closed_setting(), "curve", 0.05).recommended is None


def test_records_and_dataset_carry_everything():
    found = ladder("impact", "top force", "20%", repeats=1)
    again = Ladder.from_records(json.loads(json.dumps(found.records(), allow_nan=False)))
    assert repr(again) == repr(found)
    data = found.to_dataset()
    assert data.attrs["recommended"] == found.recommended
    assert data.distance.sel(rung="Hertz with damping") == found["Hertz with damping"].distance
    assert ladder(closed_setting(), "curve", 0.1).to_dataset().value.dims == ("rung", "point")


def test_the_chart_has_a_row_a_rung_and_marks_the_recommended():
    left, right = ladder(closed_setting(), "top", 0.1).chart()
    labels = left.get_yticklabels()
    assert [label.get_text() for label in labels] == ["zero", "arch", "sine"]
    assert [label.get_fontweight() for label in labels] == ["normal", "bold", "normal"]


def run(*arguments):
    return CliRunner().invoke(app, ["ladder", *arguments])


def test_the_command_lists_scenes_and_observables():
    shown = run("--list")
    assert shown.exit_code == 0 and all(f"{name}: " in shown.output for name in scenes())
    assert "top friction" in run("belt", "--list").output and "restitution" not in run("belt", "--list").output


def test_the_command_prints_and_writes(tmp_path):
    shown = run("impact", "--observable", "duration", "--tolerance", "3%", "--out", str(tmp_path / "new"))
    assert shown.exit_code == 0, shown.output
    assert "recommended: none is" in shown.output
    assert ", 3 % of the richest rung's value" in shown.output and "surely so" in shown.output
    data = json.loads((tmp_path / "new" / "ladder_impact_duration.json").read_text())
    assert data["recommended"] is None and data["provenance"]["pwsmooth"]
    assert (tmp_path / "new" / "ladder_impact_duration.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "arguments", [("belts", "--observable", "x"), ("belt", "--observable", "x"), ("belt",), (),
                  ("belt", "--observable", "period", "--tolerance", "much")],
)  # fmt: skip
def test_the_command_ends_with_2_on_bad_input(arguments):
    shown = run(*arguments)
    assert shown.exit_code == 2 and "pwsmooth ladder: " in shown.output


def test_every_setting_has_observables_and_a_richest_rung():
    for name in scenes():
        setting = setting_of(name)
        assert setting.name == name and setting.observables and setting.richest.matched
