"""A measured motion or force is taken as exact only where its noise moves nothing by more than the stated errors.

Guards: fitting/noisy_drives.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import System, solve
from pwsmooth.fitting import Record, fit, fit_law
from pwsmooth.fitting.noisy_drives import level
from pwsmooth.laws.friction import Coulomb

T = np.linspace(0, 20, 801)
MOTION = np.sin(1.2 * T) * (0.3 + 0.7 * np.sin(0.16 * T) ** 2) + 0.02 * np.sin(5 * T)
SPEED = np.gradient(MOTION, T, edge_order=2)
FORCE = np.sign(SPEED) + 0.2 * SPEED


def noise(size, seed=0):
    return size * np.random.default_rng(seed).normal(size=T.size)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_a_noisy_motion_is_no_success_in_any_unit(unit):
    law = Coulomb(F_c=0.9, sigma2=0.25 / unit)
    clean = fit_law(law, T, unit * MOTION, FORCE + noise(0.012, 1), settle=1.0)
    noisy = fit_law(law, T, unit * (MOTION + noise(1e-3)), FORCE + noise(0.012, 1), settle=1.0)
    assert clean.success and abs(clean.values["F_c"] - 1) < 4 * clean.errors["F_c"]
    assert not noisy.success and noisy.message.startswith("`motion` has noise of about")
    assert "Smooth it, or measure it better." in noisy.message


def test_a_rough_drive_that_is_exact_is_told_from_a_smooth_one_with_noise():
    x, v, u = sp.symbols("x v u", real=True)
    F, k, c = sp.symbols("F k c", positive=True)
    t = T[:401]
    drive = 2 * np.cos(1.3 * t) + np.cos(0.7 * t)

    def driven(values):
        rates = {x: v, v: u - k * x - c * v - F * sp.sign(v)}
        return System(rates, parameters={F: 0.4, k: 1.5, c: 0.1}, drives={u: (t, values)})

    measured = driven(drive + noise(0.05)[:401])
    for true, success in ((measured, True), (driven(drive), False)):
        data = solve(true, (0, t[-1]), {x: 0, v: 0}, t_eval=t)["x"] + noise(1e-3, 2)[:401]
        found = fit(measured, Record(t, {"x": data}, x0={"x": 0, "v": 0}), {"F": 0.38, "k": 1.45, "c": 0.12})
        assert found.success is success and ("The drive 'u' has noise" in found.message) is not success


def test_the_noise_of_samples_is_told_from_their_motion():
    assert level(MOTION) == 0.0 and level(np.ones(801)) == 0.0 and level(noise(1.0)) == 0.0
    # The mean square of 800 differences, which share samples, is known to 10 % or so.
    assert level(MOTION + noise(1e-3)) == pytest.approx(1e-3, rel=0.3)
    # Steps of an encoder: uniform within one, 1e-3/sqrt(12).
    assert level(np.round(MOTION, 3)) == pytest.approx(1e-3 / np.sqrt(12), rel=0.3)
