"""Constraints of a mechanism hold for its equilibria and orbits: of a pendulum in x and y, the length of its rod.

Guards: analysis/equilibria/statics.py, analysis/equilibria/stability.py, analysis/maps/constraints.py.
"""

import functools

import numpy as np
import pytest
import sympy as sp
from sympy.physics import mechanics as me

from pwsmooth import Return, Solution, Strobe, System, find_equilibrium, find_orbit, follow, solve
from pwsmooth.analysis.equilibria import equilibria
from pwsmooth.laws.friction import Coulomb

x, y = me.dynamicsymbols("x y")
g = sp.Symbol("g", positive=True)
L = sp.Symbol("L", positive=True)
DAMPING = sp.Rational(1, 10)


@functools.cache
def pendulum(dry=False):
    """Of length L in x, y, with viscous damping of the point, or with a dry guide along x."""
    N, O = me.ReferenceFrame("N"), me.Point("O")
    O.set_vel(N, 0)
    P = O.locatenew("P", x * N.x + y * N.y)
    P.set_vel(N, x.diff() * N.x + y.diff() * N.y)
    lagrangian = me.Lagrangian(N, me.Particle("p", P, 1)) - g * y
    damping = [(P, -DAMPING * (x.diff() * N.x + y.diff() * N.y))]
    method = me.LagrangesMethod(lagrangian, [x, y], hol_coneqs=[x**2 + y**2 - L**2], forcelist=damping, frame=N)
    method.form_lagranges_equations()
    friction = {"x_dot": Coulomb(F_c=0.3)} if dry else None
    return System.from_mechanics(method, parameters={g: 1.0, L: 1.0}, friction=friction)


# Of the angle: phi'' = -sin(phi) - phi'/10, with the eigenvalues of s**2 + s/10 + 1 below and s**2 + s/10 - 1 above.
BELOW, ABOVE = (np.roots([1, 0.1, sign]) for sign in (1, -1))


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize("begun, height", [((0.1, -0.99), -1), ((0.1, 0.99), 1), ((3.0, -3.0), -1)])
def test_a_rest_is_found_on_the_constraint_with_the_eigenvalues_of_the_angle(begun, height, unit):
    system = pendulum().with_parameters({g: unit, L: unit})
    rest = find_equilibrium(system, [begun[0] * unit, begun[1] * unit, 0, 0])
    assert rest.success and rest.isolated and rest.x[:2] / unit == pytest.approx([0, height], abs=1e-9)
    assert rest.stability == ("stable" if height < 0 else "unstable")
    wanted = BELOW if height < 0 else ABOVE
    assert np.sort_complex(rest.eigenvalues) == pytest.approx(np.sort_complex(wanted), abs=1e-9)


def test_all_rests_in_a_box_are_on_the_constraint():
    box = {"x": (-2, 2), "y": (-2, 2), "x_dot": (-1, 1), "y_dot": (-1, 1)}
    found = equilibria(pendulum(), box)
    assert [(round(e.x[1], 9), e.stability) for e in sorted(found, key=lambda e: e.x[1])] == [
        (-1, "stable"),
        (1, "unstable"),
    ]


def test_a_file_keeps_the_constraints_of_its_system(tmp_path):
    system = pendulum()
    solve(system, (0, 1), {"x": 0.6, "y": -0.8, "x_dot": 0, "y_dot": 0}).save(tmp_path / "run.npz")
    again = Solution.load(tmp_path / "run.npz").system
    rest = find_equilibrium(again, [0.1, -0.99, 0, 0])
    assert rest.x[:2] == pytest.approx([0, -1], abs=1e-9)


def test_a_dry_guide_holds_a_set_of_rests_on_the_constraint():
    # At the angle phi from below the guide along x bears up to F_c: |tan phi| <= 0.3.
    rest = find_equilibrium(pendulum(dry=True), [0.1, -0.99, 0, 0])
    assert rest.success and rest.x[0] ** 2 + rest.x[1] ** 2 == pytest.approx(1, abs=1e-9)
    assert not rest.isolated and len(rest.free_directions) == 1 and rest.held


# ---- orbits


def test_a_driven_orbit_has_the_multipliers_of_the_angle():
    # phi'' = -sin(phi) - phi'/10 + A cos(w t) cos(phi) in x = sin(phi), y = -cos(phi).
    A, w = 0.3, 1.5
    N, O = me.ReferenceFrame("N"), me.Point("O")
    O.set_vel(N, 0)
    P = O.locatenew("P", x * N.x + y * N.y)
    P.set_vel(N, x.diff() * N.x + y.diff() * N.y)
    force = A * sp.cos(w * me.dynamicsymbols._t) * N.x - DAMPING * P.vel(N)
    method = me.LagrangesMethod(
        me.Lagrangian(N, me.Particle("p", P, 1)) - y, [x, y], hol_coneqs=[x**2 + y**2 - L**2], forcelist=[(P, force)],
        frame=N,
    )  # fmt: skip
    method.form_lagranges_equations()
    rod = System.from_mechanics(method, parameters={L: 1.0})
    t, phi, u = sp.symbols("t phi u", real=True)
    angle = System({phi: u, u: -sp.sin(phi) - u / 10 + A * sp.cos(w * t) * sp.cos(phi)}, time=t)
    wanted = find_orbit(angle, {phi: -0.23, u: 0.04}, seen=Strobe(2 * np.pi / w))
    found = find_orbit(rod, {"x": -0.2, "y": -1.0, "x_dot": 0, "y_dot": 0}, seen=Strobe(2 * np.pi / w))
    assert found.success and found.stable and found.isolated
    assert found.x[:2] == pytest.approx([np.sin(wanted.x[0]), -np.cos(wanted.x[0])], abs=1e-9)
    sizes = np.sort(np.abs(found.multipliers))
    assert sizes[2:] == pytest.approx(np.sort(np.abs(wanted.multipliers)), abs=1e-8) and sizes[1] < 1e-9


def test_a_cycle_is_followed_along_the_length_of_its_rod():
    # phi'' = -sin(phi)/L + 0.3 (1 - 10 L**2 sin(phi)**2) phi'
    N, O = me.ReferenceFrame("N"), me.Point("O")
    O.set_vel(N, 0)
    P = O.locatenew("P", x * N.x + y * N.y)
    P.set_vel(N, x.diff() * N.x + y.diff() * N.y)
    pushed = [(P, sp.Rational(3, 10) * (1 - 10 * x**2) * P.vel(N))]
    method = me.LagrangesMethod(
        me.Lagrangian(N, me.Particle("p", P, 1)) - y, [x, y], hol_coneqs=[x**2 + y**2 - L**2], forcelist=pushed,
        frame=N,
    )  # fmt: skip
    method.form_lagranges_equations()
    rod = System.from_mechanics(method, parameters={L: 1.0})
    phi, u = sp.symbols("phi u", real=True)
    rate = -sp.sin(phi) / L + sp.Rational(3, 10) * (1 - 10 * L**2 * sp.sin(phi) ** 2) * u
    angle = System({phi: u, u: rate}, parameters={L: 1.0})
    across = next(s for s in rod.states if s.name == "x_dot")
    wanted = follow(find_orbit(angle, {phi: 0.66, u: 0}, seen=Return(u, direction=-1)), {"L": 1.2})
    begun = find_orbit(rod, {"x": 0.6, "y": -0.8, "x_dot": 0, "y_dot": 0}, seen=Return(across, direction=-1))
    assert begun.success and begun.stable and begun.isolated
    found = follow(begun, {"L": 1.2})
    last, other = found.points[-1], wanted.points[-1]
    assert last.system.parameters[L] == pytest.approx(1.2) == other.system.parameters[L]
    assert np.hypot(*last.x[:2]) == pytest.approx(1.2, abs=1e-9)
    assert last.period == pytest.approx(other.period, rel=1e-9)
    assert abs(last.multipliers[0]) == pytest.approx(abs(other.multipliers[0]), abs=1e-7)
