"""Figures 11 to 13: what is counted as sticking, and what small and large kicks leave of it."""

import numpy as np
import pytest

from paper_figures import figure_11, figure_12, figure_13, kicked


def test_the_longest_run_is_counted():
    assert kicked.longest(np.array([0, 1, 1, 0, 1, 1, 1, 0, 1])) == 3
    assert kicked.longest(np.array([1, 1])) == 2 and kicked.longest(np.array([0, 0])) == 0


def test_without_noise_the_stick_is_that_of_the_spec():
    found = kicked.half_periods(kicked.free_orbit(), 0.0, "uniform", 0, 1)
    # 0.539389027 in the limit eps -> 0 (spec); smoothed sticks are longer by O(eps^(2/3)) = 0.01 at the fold, and
    # samples come every 0.0126.
    assert found[:, 0] == pytest.approx(0.539389027, abs=2 * 0.0126 + 0.01)
    assert np.all(found[:, 0] == found[:, 1])


def test_small_kicks_keep_nonlinear_sticking_and_large_ones_break_it_up():
    small, large = (kicked.statistics(kappa, 3, 5) for kappa in (figure_11.KAPPA, figure_12.KAPPA))
    free = small[None][:, 0].mean()
    for law in kicked.LAWS:
        assert small[law][:, 0].mean() > 0.95 * free
        assert large[law][:, 0].mean() < 0.6 * free  # measured 0.48 and 0.22 of it over 60 seeds
        assert small[law][:, 2].min() > 1.7 > large[law][:, 2].mean()
    assert large["normal"][:, 0].mean() < large["uniform"][:, 0].mean()


@pytest.mark.parametrize("figure", [figure_11, figure_12, figure_13])
def test_the_figure_is_drawn_with_its_claims(figure):
    drawn, claims = figure.draw(fast=True)
    assert len(drawn.axes) >= 2 and len(claims) == 2
