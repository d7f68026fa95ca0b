"""fit_law() recovers the law that made the data, with honest errors, and tells laws apart; measured drives."""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Drive
from pwsmooth.fitting import compare, fit_law
from pwsmooth.laws import friction
from pwsmooth.scenes import force_driven, prescribed_motion, t

TIMES = np.linspace(0, 3, 241)
# Presliding and sliding through the Stribeck range (1 mm/s), with reversals.
MOTION = 2e-4 * np.sin(2 * np.pi * TIMES) + 1.5e-4 * np.sin(2 * np.pi * 1.7 * TIMES) * TIMES / 3
TRUE = friction.LuGre(sigma0=9e4, sigma1=250.0, sigma2=20.0, F_c=1.1, F_s=1.6, v_s=1.2e-3)
NOISE = 0.01


@pytest.fixture(scope="module")
def data():
    clean = prescribed_motion(TRUE, position=Drive(TIMES, MOTION)).solve(t_eval=TIMES)["force"]
    return clean + NOISE * np.random.default_rng(3).normal(size=TIMES.size)


@pytest.fixture(scope="module")
def fits(data):
    guess = dict(sigma2=10.0, F_c=1.0, F_s=1.4, v_s=1e-3)
    laws = (
        friction.LuGre(sigma0=6e4, sigma1=300.0, **guess),
        friction.XKY(kappa=6e4, sigma=300.0, **guess),
        friction.Dahl(sigma0=6e4),
    )
    return compare(fit_law(law, TIMES, MOTION, data) for law in laws).fits


def test_the_law_that_made_the_data_is_recovered_within_its_errors(fits):
    found = fits["LuGre"]
    assert found.success and found.failures == 0
    # 240 degrees of freedom: the rms is known to 5 %, and four standard errors are exceeded once in 15 000.
    assert found.rms["force"] == pytest.approx(NOISE, rel=0.2)
    for name, value in found.values.items():
        assert abs(value - getattr(TRUE, name)) < 4 * found.errors[name]
    for name, precision in {"sigma0": 0.05, "F_c": 0.02, "F_s": 0.02, "v_s": 0.05}.items():
        assert found.errors[name] < precision * found.values[name]


def test_laws_are_told_apart_by_their_residuals(fits):
    assert list(fits) == sorted(fits, key=lambda name: fits[name].bic) and next(iter(fits)) == "LuGre"
    assert fits["Dahl"].rms["force"] > 5 * NOISE  # it has no Stribeck curve
    assert [fits[name].parameters for name in ("LuGre", "XKY", "Dahl")] == [6, 6, 2]
    assert all(0 < f.cost < 60 for f in fits.values())
    assert "F_c = 1.1" in str(fits["LuGre"])


def test_errors_are_what_the_linear_problem_says():
    # Force linear in the parameters: f = F_c sgn v + sigma2 v, whose errors are those of a straight line.
    v = 1 + 0.5 * np.sin(TIMES)
    force = 2 + 0.3 * v + NOISE * np.random.default_rng(5).normal(size=v.size)
    found = fit_law(friction.Coulomb(F_c=1.0, sigma2=1.0), TIMES, v, force, kind="velocity")
    matrix = np.column_stack([np.ones_like(v), v])
    best, residual, *_ = np.linalg.lstsq(matrix, force, rcond=None)
    spread = residual[0] / (v.size - 2)
    errors = np.sqrt(spread * np.diag(np.linalg.inv(matrix.T @ matrix)))
    assert list(found.values.values()) == pytest.approx(best, rel=1e-6)
    assert list(found.errors.values()) == pytest.approx(errors, rel=1e-4)


def test_a_parameter_that_the_data_does_not_see_has_no_finite_error():
    v = 1e-9 * (1 + np.sin(TIMES) / 2)  # so far below v_s that F_s alone shows
    force = 1.5 + NOISE * np.random.default_rng(6).normal(size=v.size)
    found = fit_law(
        friction.StribeckFriction(v_s=1.0, sigma2=0.0), TIMES, v, force, kind="velocity", by=["F_c", "F_s"]
    )
    assert found.values["F_s"] == pytest.approx(force.mean(), rel=1e-6)
    assert found.errors["F_s"] == pytest.approx(force.std(ddof=1) / math.sqrt(v.size), rel=0.01)
    assert math.isinf(found.errors["F_c"])
    assert f"F_c = {found.values['F_c']:.6g}: the data do not determine it" in repr(found)
    assert "inf" not in repr(found) and f"F_s = {found.values['F_s']:.6g} +- " in repr(found)


def test_a_fit_shows_its_law_residual_and_message(fits):
    found = fits["LuGre"]
    for text in (repr(found), str(found), found._repr_html_()):
        for part in ("LuGre", f"{found.rms['force']:.4g}", found.message, f"{found.runs}, 0 failed"):
            assert part in text
    assert len(repr(found)) < 500


def test_elements_are_fitted_one_by_one():
    x = 0.5 * np.sin(4 * TIMES) * (1 - TIMES / 6)
    law = friction.MaxwellSlip(kappa=(3.0, 1.0), strength=(0.3, 0.4))
    force = prescribed_motion(law, position=Drive(TIMES, x)).solve(t_eval=TIMES)["force"]
    found = fit_law(friction.MaxwellSlip(kappa=(2.5, 1.2), strength=(0.25, 0.5)), TIMES, x, force)
    assert list(found.values) == ["kappa_1", "kappa_2", "strength_1", "strength_2"]
    assert list(found.values.values()) == pytest.approx([3.0, 1.0, 0.3, 0.4], rel=1e-5)
    assert found.law.kappa == pytest.approx((3.0, 1.0), rel=1e-5)


def test_bad_data_is_named():
    law = friction.Dahl()
    with pytest.raises(ValueError, match="have the shapes"):
        fit_law(law, TIMES, MOTION[:-1], MOTION)
    with pytest.raises(ValueError, match="`by` names 'stiffness'; parameters of Dahl are sigma0, F_c"):
        fit_law(law, TIMES, MOTION, MOTION, by=["stiffness"])
    with pytest.raises(ValueError, match="`kind` is 'speed'"):
        fit_law(law, TIMES, MOTION, MOTION, kind="speed")
    with pytest.raises(ValueError, match="`motion` is nan at index 0"):
        fit_law(law, TIMES, np.full(TIMES.size, np.nan), MOTION)
    with pytest.raises(ValueError, match="nan everywhere"):
        fit_law(law, TIMES, MOTION, np.full(TIMES.size, np.nan))
    with pytest.raises(ValueError, match="`times` of a Drive must increase; 0.5 follows 1"):
        Drive([0, 1, 0.5, 2], [0, 0, 0, 0])
    with pytest.raises(ValueError, match="covers .*stay inside of it"):
        prescribed_motion(law, position=Drive(TIMES, MOTION), t_span=(0, 4))


# ---- measured drives


def test_a_table_is_followed_as_its_spline():
    times = np.concatenate([np.linspace(0, 1, 30), np.linspace(1.01, 2, 60)])
    values = 3e-5 * np.sin(5 * times)
    scene = prescribed_motion(friction.Dahl(), position=Drive(times, values))
    run = scene.solve(dense_output=True)
    spline = np.abs(run(times, "position") - values).max()
    assert spline < 1e-9 * 3e-5
    smooth = prescribed_motion(friction.Dahl(), position=3e-5 * sp.sin(5 * t), t_span=(0, 2)).solve(
        t_eval=times[1:]
    )
    # A natural cubic spline of this spacing is off by (5/384) h^4 |x''''|, 1e-5 of the amplitude, at its ends more.
    force_error = np.abs(run(times[1:], "force") - smooth["force"]).max()
    assert force_error < 1e-3


def test_a_force_may_be_a_table_too():
    times = np.linspace(0, 4, 81)
    run = force_driven(friction.Coulomb(F_c=1e-9), Drive(times, np.cos(times)), m=2.0).solve(t_eval=[4.0])
    assert run["v"][0] == pytest.approx(math.sin(4) / 2, abs=1e-5)
