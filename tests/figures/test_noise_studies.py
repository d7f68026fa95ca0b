"""Study E5: its theory against independent computations, its code on a small configuration, and its published data."""

import json
import math
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

EXPERIMENTS = Path(__file__).resolve().parents[2] / "experiments"
sys.path.insert(0, str(EXPERIMENTS))

import noise_diffusion  # noqa: E402
import noise_kicks  # noqa: E402
import noise_layer as layer  # noqa: E402
import studytools  # noqa: E402

STUDIES = [noise_kicks, noise_diffusion]


def test_the_stuck_state_and_the_saddle_are_equilibria_and_meet_at_the_fold():
    for force in (1.1, 1.4, 1.7):
        stuck, saddle = layer.roots(force)
        for u in (stuck, saddle):
            assert abs(layer.slope(u, force)) < 1e-12
        assert stuck < layer.place(2 / 3) < saddle
    assert layer.MU_S == pytest.approx(16 / 9, abs=1e-15)


def test_kicks_on_both_sides_of_the_way_out_go_to_different_ends():
    force = 1.4
    stuck, saddle = layer.roots(force)
    for factor, leaves in ((0.999, False), (1.001, True)):
        u = stuck + factor * layer.way_out(force)

        def rates(_, w):
            root = math.hypot(1, w[0])
            return [force - w[0] / root * (1 + 3 * w[1]), 1 / root**2 - w[1]]

        end = solve_ivp(rates, (0, 200), [u, 1 / (1 + stuck**2)], method="DOP853", rtol=1e-10, atol=1e-12).y[
            0, -1
        ]
        assert (end > saddle + 10) if leaves else abs(end - stuck) < 1e-6


def test_one_kick_probabilities_are_the_tails_of_the_laws():
    way = layer.way_out(1.4)
    assert layer.one_kick(1.4, 0.999 * way, "uniform") == 0.0
    assert layer.one_kick(1.4, 2 * way, "uniform") == pytest.approx(0.25)
    assert layer.one_kick(1.4, way, "normal") == pytest.approx(0.5 * math.erfc(1 / math.sqrt(2)))


def test_mean_exit_times_are_the_double_integral_and_tend_to_kramers():
    force, s2, far = 1.4, 0.7, 4.0
    stuck, _ = layer.roots(force)

    def potential(u):
        # U = int lam (1 + 3 (1 - lam^2)) du - F u = sqrt(1 + u^2) - 3/sqrt(1 + u^2) - F u
        return math.hypot(1, u) - 3 / math.hypot(1, u) - force * u

    def inner(u):
        return quad(lambda a: math.exp(-2 * potential(a) / s2), -12, u, epsabs=1e-12)[0]

    exact = 2 / s2 * quad(lambda u: math.exp(2 * potential(u) / s2) * inner(u), stuck, far, epsrel=1e-8)[0]
    assert layer.mean_exit_time(force, s2, far) == pytest.approx(exact, rel=1e-5)
    excess = (
        np.array([layer.mean_exit_time(force, s2, far) / layer.kramers(force, s2) for s2 in (0.1, 0.05, 0.025)])
        - 1
    )
    # Kramers' formula is the leading term, the next one of order s^2: half of s^2 leaves half of it.
    assert np.all(np.abs(excess[1:] / excess[:-1] - 0.5) < 0.1)


def test_the_slaved_stick_of_the_study_is_that_of_the_spec():
    # F from capture to release: the fold at 16/9 at the end; no noise leaves the whole of it.
    assert noise_diffusion.predicted(1e-3, 0.01) == pytest.approx(1, abs=0.1)
    assert noise_diffusion.predicted(1e-3, 3.0) < 0.1


@pytest.mark.parametrize("study", STUDIES)
def test_a_study_runs_on_a_small_configuration(study):
    small = {
        noise_kicks: dict(eps=(1e-3, 2.5e-4), sizes=(0.2, 5.0), kicks=150, escapes=10, seeds=2, periods=1),
        noise_diffusion: dict(s2=(1.0,), finite_s2=(1.0,), count=20, eps=(1e-3,), checked=(1.0,), orbit_eps=(4e-3,),
                              orbit_s2=(0.1, 1.0), seeds=2, periods=1),
    }[study]  # fmt: skip
    data = studytools.plain(study.run(study.Config(**small)))
    if study is noise_diffusion:
        assert set(data["orbit"]) == {"0.004 | slaved", "0.001 | eps = beta"}
    assert all(claim.ours for claim in study.claims(data))
    assert len(study.draw(data).axes) >= 2


@pytest.mark.parametrize("study", STUDIES)
def test_the_published_data_are_of_the_full_configuration_and_bear_their_claims(study):
    content = json.loads((EXPERIMENTS / "results" / f"{study.STUDY.name}.json").read_text())
    assert content["config"] == studytools.plain(asdict(study.STUDY.full)) and not content["fast"]
    assert [c.record() for c in study.claims(content["data"])] == content["claims"]
    assert (EXPERIMENTS / "results" / f"{study.STUDY.name}.json").stat().st_size < 200_000
