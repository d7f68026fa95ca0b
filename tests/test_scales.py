"""Units do not decide: the same model in micrometres, or with its surface times a constant, has the same itinerary."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Switch, System, solve

t, y, v = sp.symbols("t y v", real=True)
size = sp.Symbol("size", positive=True)
FORCE = -sp.Rational(12, 10) * sp.sin(t)
ELASTIC = -sp.Rational(31, 10) * y - v / 10

# States, forces and the surface in other units; then the surface alone.
MODELS = {
    "states": System(
        {y: v, v: size * (FORCE - Switch("lam", v - size * sp.sin(t) / 7)) + ELASTIC},
        time=t,
        parameters={size: 1.0},
    ),
    "surface": System(
        {y: v, v: FORCE - Switch("lam", size * (v - sp.sin(t) / 7)) + ELASTIC}, time=t, parameters={size: 1.0}
    ),
    "exponential surface": System(
        {y: v, v: FORCE - Switch("lam", size * (sp.exp(v) - 1 - sp.sin(t) / 7)) + ELASTIC},
        time=t,
        parameters={size: 1.0},
    ),
}


# An exponential surface has a series of its own, whose rounding counts as 1e-15: below 1e-6 that is felt.
@pytest.mark.parametrize(
    ("name", "scale"),
    [(name, scale) for name in MODELS for scale in (1e-9, 1e-6, 1e6, 1e9) if name[0] != "e" or scale >= 1e-6],
)
def test_the_itinerary_is_that_of_any_unit(name, scale):
    def run(factor):
        unit = factor if name == "states" else 1.0
        return solve(
            MODELS[name],
            (0, 60),
            [0.5 * unit, 0.3 * unit],
            parameters={size: factor},
            rtol=1e-9,
            atol=1e-12 * unit,
            t_eval=np.linspace(0.5, 59.5, 119),
        )

    here, there = run(1.0), run(scale)
    assert [e.kind for e in here.events] == [e.kind for e in there.events] and len(here.events) > 30
    # Only roundings differ, in units of 1e-16 of t = 60, and at most a tenth of rtol where they choose other steps.
    late = [abs(a.time - b.time) for a, b in zip(here.events, there.events, strict=True)]
    assert np.max(late) < 1e-10
    # The multiplier is solved for as exactly: a residual of 1e-14 is large where the surface is small.
    assert np.max(np.abs(here["lam"] - there["lam"])) < 1e-10
