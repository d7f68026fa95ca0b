"""Switch times are located: laws keep the method's order through a velocity reversal; stepping through loses it."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth.laws import friction
from pwsmooth.scenes import prescribed_motion, t

SIZE = 3e-5
# Two frequencies: reversals with long and short strokes, at instants that no step hits.
MOTION = SIZE * (sp.sin(2 * sp.pi * t) + 0.6 * sp.sin(3 * sp.pi * t + 1))
ODES = {
    "Dahl": friction.Dahl(),
    "Dahl, alpha 2": friction.Dahl(alpha=2.0),
    "LuGre": friction.LuGre(),
    "LuGre, fading": friction.LuGreFadingDamping(),
    "elastoplastic": friction.Elastoplastic(),
    "elastoplastic, fixed": friction.ElastoplasticFixed(),
    "XKY": friction.XKY(),
    "Bouc-Wen": friction.BoucWen(),
    "Bouc-Wen, n 2": friction.BoucWen(beta=6e9, gamma=-1e9, n=2),
    "Bliman-Sorine": friction.BlimanSorine(),
    "modified Dahl": friction.ModifiedDahl(slope=1e4),
}


def right_hand_side(scene):
    """The written rates as a function for SciPy: no switch, no event, nothing of the solver."""
    definition = scene.system.definition
    states = [state for state, _ in definition.rates]
    values = {p: scene.system.parameters[p] for p in scene.system.parameters}
    rates = [rate.subs(values) for _, rate in definition.rates]
    function = sp.lambdify([t, states], rates, "math")
    return lambda time, x: np.array(function(time, x), float)


@pytest.mark.parametrize("name", ODES)
def test_the_event_driven_solution_is_what_small_steps_tend_to(name):
    scene = prescribed_motion(ODES[name], position=MOTION, t_span=(0, 0.9))
    run = scene.solve()
    assert run.success
    begin = [scene.x0[str(s)] for s in scene.system.states]
    # Steps of 0.3 ms through kinks: each costs about h^2 |jump of the slope|, 1e-7 of a strength of 1 N.
    plain = solve_ivp(right_hand_side(scene), (0, 0.9), begin, "DOP853", rtol=1e-10, atol=1e-18, max_step=3e-4)
    scale = SIZE if abs(run.x[-1, -1]) < 1e-3 else 1.0
    assert np.abs(run.x[:, -1] - plain.y[:, -1]).max() <= 1e-6 * scale


# ---- order

REVERSAL = SIZE * 2 * sp.pi * sp.cos(2 * sp.pi * t)  # v turns at 0.25
END = 0.45
ORDER = 8
LAWS = {
    "Dahl": friction.Dahl(),
    "LuGre": friction.LuGre(),
    "elastoplastic": friction.Elastoplastic(z_ba=4e-6),
    "GMS": friction.GMS(F_c=1.0, F_s=1.5, v_s=1e-4, C=20.0, kappa=(1e5, 4e4), share=(0.5, 0.5), sigma=0.0),
}


# Where the leading term of the error has taken over and rounding has not.
COUNTS = {
    "Dahl": np.array([16, 24, 32]),
    "LuGre": np.array([16, 24, 32]),
    "elastoplastic": np.array([96, 128, 192]),
    "GMS": np.array([24, 32, 48]),
}


def errors(law, counts):
    """Errors of the force at the end with steps of at most END/count, order 8 and a tolerance that never acts."""
    scene = prescribed_motion(law, velocity=REVERSAL, t_span=(0, END))
    exact = scene.solve(rtol=1e-13, order=24, max_step=2e-3)["force"][-1]
    return np.array(
        [
            abs(scene.solve(rtol=1e-6, atol=1.0, order=ORDER, max_step=END / n)["force"][-1] - exact)
            for n in counts
        ]
    )


@pytest.mark.parametrize("name", LAWS)
def test_a_velocity_reversal_costs_no_order(name):
    counts = COUNTS[name]
    found = errors(LAWS[name], counts)
    assert found.min() > 3e-14  # above the rounding of a force of 1 N
    assert -np.polyfit(np.log(counts), np.log(found), 1)[0] > ORDER - 0.5


def step_through(law, count):
    """Error of the force after `count` classical Runge-Kutta steps over the reversal, which they do not notice."""
    scene = prescribed_motion(law, velocity=REVERSAL, t_span=(0, END))
    exact = scene.solve(rtol=1e-13, order=24, max_step=2e-3)
    f, x, h = right_hand_side(scene), np.array([scene.x0[str(s)] for s in scene.system.states]), END / count
    for k in range(count):
        a = f(k * h, x)
        b = f((k + 0.5) * h, x + h / 2 * a)
        c = f((k + 0.5) * h, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + f((k + 1) * h, x + h * c))
    return abs(x[-1] - exact.x[-1, -1]) / SIZE


@pytest.mark.parametrize("name", ["Dahl", "LuGre", "elastoplastic"])
def test_stepping_through_the_reversal_loses_the_order(name):
    counts = np.array([301, 599, 1201, 2399])
    found = np.array([step_through(LAWS[name], n) for n in counts])
    slope = -np.polyfit(np.log(counts), np.log(found), 1)[0]
    assert 1.0 < slope < 3.0  # 4 without the kink of |v|, which costs h^2 in one step
