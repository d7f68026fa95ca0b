"""Touch-down and lift-off on a curved surface, where the force's power has its branch point."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Event, Family, Memory, System, solve

x, y, u, v = sp.symbols("x y u v", real=True)


def journal(flagged):
    """A point of mass 1 inside a circle of radius 1e-3 with an elastic Hertz wall; `flagged`: with a contact flag."""
    c, K = sp.symbols("c K", positive=True)
    touch = Memory("touch", 0)
    square = x**2 + y**2
    r = sp.sqrt(square)
    surface = (square - c**2) / (2 * c)
    depth = (square - c**2) / (r + c)
    push = sp.Piecewise((K * depth ** sp.Rational(3, 2) / r, surface > 0), (0, True))
    events = [
        Event(surface, direction=1, update={touch: 1} if flagged else None, name="touch-down"),
        Event(surface, direction=-1, update={touch: 0} if flagged else None, name="lift-off"),
    ]
    rates = {x: u, y: v, u: -push * x, v: -push * y}
    outputs = {
        "energy": (u**2 + v**2) / 2 + sp.Piecewise((K * depth**2.5 / 2.5, surface > 0), (0, True)),
        "spin": x * v - y * u,
    }
    return System(rates, parameters={c: 1e-3, K: 1e9}, events=events, outputs=outputs)


@pytest.mark.parametrize("flagged", [False, True])
def test_a_journal_bounces_in_its_bearing_and_keeps_energy_and_spin(flagged):
    # The located zero of x^2 + y^2 - c^2 is one to rounding only, of either sign: delta^1.5 must exist from there.
    solution = solve(journal(flagged), (0, 0.5), {x: 2e-4, y: 1e-4, u: 0.11, v: 0.02}, rtol=1e-10, atol=1e-15)
    assert solution.success
    names = [e.switch for e in solution.events if e.kind == "reset"]
    assert len(names) == 52  # 26 chords of 0.0191 s in 0.5 s
    assert names == (["touch-down", "lift-off"] * len(names))[: len(names)]
    # The chord between two impacts on a circle is always the same, and so is the stay in the wall.
    chords = np.diff([e.time for e in solution.events if e.switch == "touch-down"])
    assert np.ptp(chords) < 1e-8 * chords[0] * len(chords)
    # The error of a step is rtol of the displacement 1e-3, a part rtol c/delta_max = 40 rtol of the wall's energy.
    steps = solution.cost["steps"]
    assert np.ptp(solution["energy"]) < 40 * 1e-10 * steps * solution["energy"][0]
    assert np.ptp(solution["spin"]) < 1e-10 * len(names) * abs(solution["spin"][0])


@pytest.mark.parametrize("n", [6, 12])
@pytest.mark.parametrize(("power", "k"), [(1, 1e4), (2, 1e6), (sp.Rational(3, 2), 1e5)])
def test_a_row_is_struck_whether_its_elements_touch_or_not(n, power, k):
    # Two switches of each gap, one of each neighbour; behind a touch the gaps close with ever higher powers of time.
    family = Family(n)
    x, v = family.symbols("x v")
    ahead, behind = (sp.Max(0, d) ** power for d in (x - family.neighbour(x, 1), family.neighbour(x, -1) - x))
    row = System({x: v, v: k * (behind - ahead)})

    def rates(t, z):
        push = k * np.maximum(0, z[: n - 1] - z[1:n]) ** float(power)
        return np.r_[z[n:], np.r_[0, push] - np.r_[push, 0]]

    for gap in (0, 1e-5):
        start = np.r_[-1e-3, gap * np.arange(1, n), 1, np.zeros(n - 1)]
        ends = solve_ivp(rates, (0, 0.1), start, method="DOP853", rtol=1e-11, atol=1e-13, max_step=1e-3)
        run = solve(row, (0, 0.1), {x: start[:n], v: start[n:]})
        assert run.success and np.abs(run.x[: 2 * n, -1] - ends.y[:, -1]).max() < 1e-6
