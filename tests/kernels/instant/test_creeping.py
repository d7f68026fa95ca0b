"""Slips that creep, as slowly as a force exceeds a friction, to where it just holds them: stiff, at last rounding."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Disc, Switch, System, solve

SPAN = 200


def sliders(seed, discs, damping):
    """Two blocks on a table and one on a rail, or four on rails: springs, a constant force, and drag between them."""
    rng = np.random.default_rng(seed)
    n = 5 if discs else 4
    places, velocities = sp.symbols(f"z_1:{n + 1}", real=True), sp.symbols(f"v_1:{n + 1}", real=True)
    if discs:
        a, b = Disc("a", velocities[:2]), Disc("b", velocities[2:4])
        lams, groups = [*a.components, *b.components, Switch("s", velocities[4])], [[0, 1], [2, 3], [4]]
    else:
        lams, groups = [Switch(f"s{i}", velocities[i]) for i in range(n)], [[i] for i in range(n)]
    root = rng.normal(size=(n, n))
    drag, force = root @ root.T / 5 + damping * np.eye(n), rng.normal(size=n)
    springs = rng.uniform(0.5, 2, n)
    mobility = np.linalg.inv(np.eye(n) + (0 if discs or seed % 2 == 0 else root.T @ root / 10))

    def accelerations(z, v, lam):
        return mobility @ (force - springs * z - lam / 2 - drag @ v)

    def rates(_, y, soft):
        z, v, lam = y[:n], y[n:], np.empty(n)
        for group in groups:
            lam[group] = v[group] / np.hypot(np.linalg.norm(v[group]), soft)
        return np.concatenate([v, accelerations(z, v, lam)])

    system = System(
        dict(zip(places, velocities))
        | dict(zip(velocities, accelerations(*map(np.array, (places, velocities, lams)))))
    )
    return system, rates, rng, n


# Damped so strongly that nothing stops at once; each ended as a step underflow, as chattering, or not at all.
CASES = [
    (seed, k, True, damping)
    for seed, k, damping in [
        (3, 2, 0.4), (6, 1, 0.4), (9, 1, 0.4), (1, 2, 4), (4, 0, 4), (10, 2, 4), (22, 2, 4), (28, 1, 4), (17, 1, 0.05),
    ]
] + [(4, 2, False, 4), (14, 0, False, 0.05), (31, 1, False, 4)]  # fmt: skip


@pytest.mark.filterwarnings("ignore:lsoda")
@pytest.mark.parametrize(("seed", "which", "discs", "damping"), CASES)
def test_what_creeps_to_a_friction_that_just_holds_it_comes_to_rest(seed, which, discs, damping):
    """LSODA and a friction that begins softly are the judge: under loads near the largest friction it creeps on."""
    system, rates, rng, n = sliders(seed, discs, damping)
    start = rng.normal(size=(which + 1, 2 * n))[which] * 2
    run = solve(system, (0, SPAN), start, max_steps=20_000)
    assert run.success
    for soft in (1e-13, 3e-13, 1e-12, 1e-11):
        judge = solve_ivp(rates, (0, SPAN), start, "LSODA", args=(soft,), rtol=1e-10, atol=soft / 100)
        if judge.success:
            break
    assert run.x[:, -1] == pytest.approx(judge.y[:, -1], abs=2 * (SPAN * soft) ** (2 / 3))
