"""Random oscillators with one-sided springs: what `follow` names against shooting by matrix exponentials.

Guards: analysis/continuation/.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import brentq

from pwsmooth import Strobe, System, find_orbit, follow
from pwsmooth.analysis.continuation import Steps

t, x, v = sp.symbols("t x v", real=True)
F = sp.Symbol("F", positive=True)


def meets(A, state, longest):
    """When x is 1 on the way from a state."""
    return brentq(lambda h: (expm(A * h) @ state)[0] - 1, 0, longest, xtol=1e-14, rtol=1e-14)


class Oscillator:
    """x'' + c x' + k x + s max(0, x - 1) = F cos t, and its period map from exact pieces.

    The state is (x, v, cos t, sin t, 1), in which both sides are linear.
    """

    def __init__(self, seed):
        draw = np.random.default_rng(seed)
        self.c, self.k = draw.uniform(0.05, 0.3), draw.uniform(0.2, 1.6)
        self.s = draw.choice([-0.9 * self.k, draw.uniform(2, 30)], p=[0.2, 0.8])
        force = F * sp.cos(t) - self.c * v - self.k * x - self.s * sp.Max(0, x - 1)
        self.system = System({x: v, v: force}, time=t, parameters={F: 0.5})
        # The linear motion touches x = 1 at this force.
        self.touch = abs(self.k - 1 + 1j * self.c)

    def matrix(self, force, beyond):
        rows = np.zeros((5, 5))
        rows[0, 1] = 1
        rows[1] = [-self.k, -self.c, force, 0, 0]
        rows[2, 3], rows[3, 2] = -1, 1
        if beyond:
            rows[1, [0, 4]] += [-self.s, self.s]
        return rows

    def period(self, start, force, phase):
        """The state a period later, the derivative, and the largest x on the way."""
        state = np.array([*start, np.cos(phase), np.sin(phase), 1.0])
        total, left, beyond = np.eye(5), 2 * np.pi, state[0] > 1
        highest = state[0]
        while left > 1e-12:
            A = self.matrix(force, beyond)
            steps = np.linspace(0, left, max(3, int(10 * left)))
            powers = np.empty((len(steps), 5))
            powers[0], once = state, expm(A * (steps[1] - steps[0]))
            for n in range(1, len(steps)):
                powers[n] = once @ powers[n - 1]
            highest = max(highest, powers[:, 0].max())
            side = (powers[1:, 0] > 1) != beyond
            crossed = (
                np.flatnonzero(side[1:]) + 1
                if side[0] and abs(powers[0, 0] - 1) < 1e-12
                else np.flatnonzero(side)
            )
            time = left
            if crossed.size:
                n = int(crossed[0])
                time = steps[n] + meets(A, powers[n], steps[1] - steps[0])
            here = expm(A * time)
            state, total, left = here @ state, here @ total, left - time
            if crossed.size:
                state[0], beyond = 1.0, not beyond  # the field is continuous there: no saltation
        return state[:2], total[:2, :2], highest


@pytest.mark.parametrize("seed", range(2))
def test_every_name_on_a_branch_is_that_of_an_independent_shooting(seed):
    case = Oscillator(seed)
    low, high = 0.8 * case.touch, 4 * case.touch
    orbit = find_orbit(case.system.with_parameters({F: low}), {x: 0, v: 0}, seen=Strobe(2 * sp.pi, phase=0.1))
    branch = follow(orbit, {F: high}, steps=Steps(first=0.05))
    for found in branch.specials:
        one = found.point
        image, D, highest = case.period(one.x, found.parameter, one.map.start_time)
        assert image == pytest.approx(one.x, abs=1e-7)
        mu = np.linalg.eigvals(D)
        near = {
            "fold": np.abs(mu - 1).min(), "flip": np.abs(mu + 1).min(), "branch point": np.abs(mu - 1).min(),
            "torus": np.abs(np.abs(mu) - 1).min(), "grazing": abs(highest - 1), "corner": 1.0,
            "border collision": 1.0,
        }  # fmt: skip
        assert near.get(found.kind, 1.0) < 1e-3, str(found)
    (first,) = branch.of_kind("grazing")[:1]
    assert first.parameter == pytest.approx(case.touch, abs=1e-9)
    assert len(branch.specials) >= np.count_nonzero(np.diff(branch.stable.astype(int)))
