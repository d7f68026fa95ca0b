"""The contract of laws: parameters and their errors, joints, loads; the two statements on inclusions.

Guards: laws/joint.py.
"""

import dataclasses
import math
import pathlib
import random
import re

import matplotlib
import numpy as np
import pytest
import sympy as sp

from pwsmooth import solve
from pwsmooth.laws import Law, Pieces, friction, law, parameter
from pwsmooth.laws.inclusions import dio_defect, max_of_dio, sat_of_sgn, sgn_defect
from pwsmooth.scenes import assemble, force_driven, friction_oscillator, prescribed_motion, t

ALL = [getattr(friction, name) for name in friction.__all__]
v = sp.Symbol("v", real=True)


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_every_law_says_what_its_parameters_are_and_where_it_comes_from(kind):
    assert kind.source and set(kind.units()) == set(kind.meanings()) == set(kind().values)
    assert all(kind.units().values()) and all(kind.meanings().values())
    if kind.certainty:
        assert "reconstructed" in kind.source or "recalled" in kind.source


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_every_positive_parameter_refuses_zero_and_below_by_its_name(kind):
    for field in dataclasses.fields(kind):
        about = field.metadata
        bad = [math.nan, math.inf, "much"]
        bad += {"positive": [0.0, -1.0], "nonnegative": [-1.0], "real": []}[about["sign"]]
        for value in bad:
            with pytest.raises((ValueError, TypeError), match=f"`{field.name}` of {kind.__name__}"):
                kind(**{field.name: value})


@pytest.mark.parametrize(
    ("kind", "bad", "words"),
    [
        (friction.XKY, {"sigma": 0}, r"`sigma` of XKY is 0.0; the micro-damping, by which .* must be > 0"),
        (friction.LuGre, {"v_s": 0}, r"`v_s` of LuGre is 0.0; the Stribeck velocity must be > 0"),
        (friction.LuGre, {"sigma0": -1e5}, r"`sigma0` of LuGre is -100000.0; the bristle stiffness must be > 0"),
        (friction.LuGre, {"F_s": 0.5}, r"`F_s` of LuGre is 0.5, below `F_c` = 1"),
        (friction.ElastoplasticFixed, {"z_max": 13e-6}, r"`z_max` .* not above `z_ba`"),
        (friction.ElastoplasticFixed, {"z_max": 16e-6}, r"`z_max` .* above F_s/sigma0"),
        (friction.Elastoplastic, {"z_ba": 1e-5}, r"`z_ba` .* not below z_max"),
        (friction.ModifiedCoulomb, {"v_1": 1e-4}, r"`v_1` .* give v_1 > v_0"),
        (friction.MaxwellSlip, {"kappa": (1.0, 2.0), "strength": (1.0,)}, r"different lengths \[1, 2\]"),
        (friction.MultistateXKY, {"sigma": (0.01, 0.0) * 5}, r"`sigma` of MultistateXKY is 0.0"),
        (friction.BlimanSorine, {"eta": 1.0}, "eta < 1"),
        (friction.BlimanSorine, {"f_2": 3.0}, "`f_2` of BlimanSorine is 3, not below"),
        (friction.BoucWen, {"gamma": -6e4}, r"beta \+ gamma must be > 0"),
        (friction.BoucWen, {"n": 0.5}, "n >= 1"),
        (friction.Wojewoda, {"f_s": 0.5}, "would not be unique"),
    ],
)  # fmt: skip
def test_values_that_a_law_cannot_have_are_named_with_the_remedy(kind, bad, words):
    with pytest.raises(ValueError, match=words):
        kind(**bad)


def test_a_position_that_jumps_is_refused():
    for position in (sp.Heaviside(t - 0.5), sp.Piecewise((0, t < 0.5), (1, True)), sp.floor(3 * t)):
        with pytest.raises(ValueError, match="`position` jumps.*rise within a finite time"):
            prescribed_motion(friction.Dahl(), position=position)
    # A ramp is none, and a velocity may jump.
    prescribed_motion(friction.Dahl(), position=sp.Piecewise((0, t < 0.5), (t - 0.5, True)))
    prescribed_motion(friction.Dahl(), velocity=sp.Piecewise((0, t < 0.5), (1, True)))


def test_motions_are_given_once():
    for motion, said in (
        ({}, "neither `position` nor"),
        ({"position": t, "velocity": 1}, "`velocity` are both given"),
    ):
        with pytest.raises(ValueError, match=said):
            prescribed_motion(friction.Dahl(), **motion)
    with pytest.raises(TypeError, match="`velocity` is 'fast'"):
        prescribed_motion(friction.Dahl(), velocity="fast")
    with pytest.raises(ValueError, match="`m` is 0"):
        force_driven(friction.Dahl(), 1, m=0)


def test_an_input_that_a_law_needs_is_asked_for():
    with pytest.raises(
        ValueError, match=r"BoucWen needs the position of its joint; give attach\(position=...\)"
    ):
        friction.BoucWen().attach(velocity=v)


def test_two_laws_of_one_system_need_names():
    x, y, w = sp.symbols("x y w", real=True)
    one, two = friction.Dahl().attach(velocity=v), friction.Dahl(F_c=2).attach(velocity=w)
    rates = {x: v, v: -one.force, y: w, w: -two.force}
    start = dict.fromkeys(rates, 1.0)
    with pytest.raises(ValueError, match=r"use the name z; .*attach\(name=...\)"):
        assemble(rates, [one, two], x0=start)
    two = friction.Dahl(F_c=2).attach(velocity=w, name="rear")
    system, begin, _ = assemble({**rates, w: -two.force}, [one, two], x0=start)
    assert set(begin) == {"x", "v", "y", "w", "z", "z_rear"}
    assert {str(p) for p in system.parameters} == {"sigma0", "F_c", "sigma0_rear", "F_c_rear"}


def test_a_law_is_twenty_lines():
    @law
    class Bristle(Law):
        source = "Dahl 1968"
        stiffness: float = parameter(1e5, "N/m", "stiffness at rest")
        F_c: float = parameter(1.0, "N", "Coulomb force")

        def pieces(self, at, p):
            z = at.state("z")
            return Pieces(p.stiffness * z, {z: at.v - p.stiffness * sp.Abs(at.v) * z / p.F_c}, surfaces=(at.v,))

    motion = dict(position=3e-5 * sp.sin(t), t_span=(0, 10))
    mine, theirs = (
        prescribed_motion(each, **motion).solve(t_eval=[10.0])["force"] for each in (Bristle(), friction.Dahl())
    )
    # They differ in the tolerance of z alone: atol = 1e-12 here, times 1e5 N/m.
    assert mine == pytest.approx(theirs, abs=1e5 * 1e-12)


def test_with_a_load_a_law_is_per_unit_of_it_and_forgets_its_deflection_where_it_vanishes():
    load = 2 + 4 * sp.sin(t)
    rig = prescribed_motion(friction.Dahl(), velocity=1e-5, normal=sp.Max(0, load), t_span=(0, 6))
    times = np.array([1.0, 3.0, 5.0, 6.0])
    run = rig.solve(t_eval=times)
    lift, landing = math.pi + math.asin(0.5), 2 * math.pi - math.asin(0.5)
    since = np.where(times < lift, times, times - landing)
    exact = np.where((times > lift) & (times < landing), 0, (2 + 4 * np.sin(times)) * (1 - np.exp(-since)))
    assert run["force"] == pytest.approx(exact, abs=1e-7)


def test_changing_a_parameter_of_a_law_compiles_nothing_and_acts():
    scene = prescribed_motion(friction.Dahl(), position=3e-5 * sp.sin(t), t_span=(0, 2))
    weak = solve(scene.system, (0, 2), scene.x0, parameters={"F_c": 0.5}, t_eval=[1.5], atol=1e-18)
    assert weak["force"][0] == pytest.approx(0.5 * (1 - math.exp(-2e5 * 3e-5 * math.sin(1.5))), rel=1e-7)


@pytest.mark.parametrize("kind", [kind for kind in ALL if not kind.spins], ids=lambda kind: kind.__name__)
def test_every_law_drives_every_kind_of_scene(kind):
    unit = 1e-6 if "um" not in str(kind.units()) else 1.0
    few = {name: value[:2] for name, value in kind().values.items() if isinstance(value, tuple)}
    law_ = kind(**few)
    oscillator = friction_oscillator(law_, k=1e-3 / unit, m=1.0, amplitude=3.0, omega=2.0, t_span=(0, 0.5),
                                     x0=(0.0, 1e-3))  # fmt: skip
    pushed = force_driven(law_, 0.5 * sp.sin(t), t_span=(0, 0.5))
    for scene in (oscillator, pushed):
        run = scene.solve()
        assert run.success, run.message
        assert np.isfinite(run["friction"]).all()


@pytest.mark.thorough
def test_the_page_on_laws_runs():
    page = (pathlib.Path(__file__).parents[2] / "docs" / "laws.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```{code-cell} python\n(?:---\n.*?\n---\n)?(.*?)```", page, flags=re.S)
    assert len(blocks) == 3
    matplotlib.use("Agg")
    for block in blocks:
        names: dict = {}
        exec(block, names)
        runs = [value for value in names.values() if hasattr(value, "outcome")]
        assert runs and all(run.success for run in runs)


# ---- inclusions


def test_sgn_becomes_sat_and_dio_becomes_max():
    random.seed(1)
    for _ in range(500):
        x, L, sigma = random.gauss(0, 2), random.expovariate(1), 10 ** random.uniform(-3, 3)
        y = float(sat_of_sgn(x, L, sigma))
        # Rounding of sigma x, and of x - y/sigma.
        slack = 8 * np.spacing(abs(sigma * x) + L) * max(1, 1 / sigma, sigma)
        assert sgn_defect(y, x - y / sigma, L) <= slack
        A, B, c = random.gauss(0, 2), random.gauss(0, 2), random.expovariate(1)
        rate, force = (float(e) for e in max_of_dio(A, B, c))
        assert dio_defect(force, rate - B) <= 8 * np.spacing(abs(A) + abs(B))
        assert force == pytest.approx(c * (rate - A), abs=8 * np.spacing(c * (abs(A) + abs(B))))


def test_what_satisfies_neither_inclusion_is_told():
    assert (
        sgn_defect(1.0, 0.5, 2.0) == 0.5
        and sgn_defect(-2.0, 1.0, 2.0) == 1.0
        and sgn_defect(2.0, 7.0, 2.0) == 0
    )
    assert dio_defect(1.0, 1.0) == 1.0 and dio_defect(-1.0, 2.0) == 1.0 and dio_defect(3.0, 0.0) == 0
