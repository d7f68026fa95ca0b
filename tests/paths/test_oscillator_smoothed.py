"""The smoothed oscillator: never over the layer, and towards the event-driven solution as eps -> 0."""

import pytest
from friction_oscillator import hidden
from smoothed_cases import count_wrong, grazing_cases, random_cases
from smoothed_limit import CASES, SIGMOIDS, study


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


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
@pytest.mark.parametrize("sigmoid", SIGMOIDS)
def test_the_smoothed_orbit_tends_to_the_event_driven_one_at_the_expected_order(case, sigmoid):
    result = study(case, sigmoid, epsilons=(1e-6, 1e-7))
    # The next term of the expansion is still felt at 1e-7: measured deviations reach 0.06 (tanh).
    assert result["measured"] == pytest.approx(result["expected"], abs=0.08)
    # Extrapolated, the two paths agree better than the smallest eps does by itself, or to the integration
    # error: by two orders at a fold, least (3.3 times) for tanh at |lam| = 1, where log(1/eps) interferes.
    assert result["extrapolated"] < max(result["distances"][-1] / 2.5, 1e-9)
