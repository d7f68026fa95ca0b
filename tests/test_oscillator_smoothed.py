"""The smoothed oscillator: never over the layer, and towards the event-driven solution as eps -> 0."""

import pytest
from friction_oscillator import hidden
from smoothed_cases import count_wrong, grazing_cases, random_cases

SIGMOIDS = ("algebraic", "tanh", "erf")


@pytest.fixture(scope="module", params=SIGMOIDS)
def view(request):
    return hidden().smoothed(eps=1e-3, sigmoid=request.param)


@pytest.mark.parametrize("eps", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_no_random_start_takes_a_wrong_turn_at_the_loosest_tolerance(view, eps):
    wrong, boundary, unclear = count_wrong(view, random_cases(300, eps, seed=1), rtol=1e-3)
    assert wrong == []
    assert unclear == []
    assert len(boundary) <= 3


@pytest.mark.parametrize("eps", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_no_grazing_start_steps_over_the_layer(view, eps):
    wrong, boundary, unclear = count_wrong(view, grazing_cases(200, eps, seed=1), rtol=1e-3)
    assert wrong == []
    assert unclear == []
    assert len(boundary) <= 10
