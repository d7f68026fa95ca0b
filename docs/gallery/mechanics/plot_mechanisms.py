r"""
Mechanisms with dry friction
============================

A double pendulum, a slider-crank, a four-bar linkage and a disc that rolls, each written with
``sympy.physics.mechanics`` as its users write it, and with friction where its parts rub. **Where does
the energy go, and when does it stand still?** The mass matrices stay unsolved, loops are closed by
Lagrange's multipliers, and every stick is exact: a velocity that is 0, until the load exceeds the friction.
"""

# %%
# Double pendulum with dry joints
# -------------------------------
# Bodies and joints; friction goes by the name of a joint.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from sympy.physics import mechanics as me

from pwsmooth import System, solve
from pwsmooth.laws.friction import Coulomb

q1, q2, u1, u2 = me.dynamicsymbols("q1 q2 u1 u2")
wall, upper, lower = (me.RigidBody(name) for name in ("wall", "upper", "lower"))
for rod in (upper, lower):
    rod.mass, rod.inertia = 1, (me.inertia(rod.frame, 0, 0, sp.Rational(1, 12)), rod.masscenter)
arm = me.System.from_newtonian(wall)
arm.add_joints(
    me.PinJoint("shoulder", wall, upper, q1, u1, child_point=-upper.x / 2, joint_axis=wall.z),
    me.PinJoint("elbow", upper, lower, q2, u2, upper.x / 2, -lower.x / 2, joint_axis=upper.z),
)
arm.apply_uniform_gravity(9.81 * wall.x)
height = sum(-9.81 * body.masscenter.pos_from(arm.fixed_point).dot(wall.x) for body in (upper, lower))
pendulum = System.from_mechanics(
    arm, friction={"shoulder": Coulomb(F_c=0.8), "elbow": Coulomb(F_c=0.3)},
    outputs={"energy": me.kinetic_energy(wall.frame, upper, lower) + height},
)  # fmt: skip
swing = solve(
    pendulum, (0, 8), {"q1": 1.2, "q2": 0.5, "u1": 0, "u2": 0}, rtol=1e-12, atol=1e-13, dense_output=True
)
swing.plot(["q1", "q2", "energy"])
plt.show()

# %%
# Slider-crank
# ------------
# One coordinate, the angle of the crank: the slider's place follows from it. Its guide rubs, and a
# weight of 1 N pulls at it; the flywheel runs down, and then friction holds the slider.
theta = me.dynamicsymbols("theta")
r, L = sp.Rational(1, 2), 2
place = r * sp.cos(theta) + sp.sqrt(L**2 - r**2 * sp.sin(theta) ** 2)
kinetic = theta.diff() ** 2 / 4 + place.diff() ** 2 / 2  # of a flywheel and a slider of 1 kg
lagrange = me.LagrangesMethod(kinetic - place, [theta])
lagrange.form_lagranges_equations()
crank = System.from_mechanics(
    lagrange,
    friction={place.diff(): Coulomb(F_c=1.5)},
    outputs={"slider": place, "slip": place.diff(), "energy": kinetic + place},
)
turning = solve(crank, (0, 8), {"theta": 0.4, "theta_dot": 6}, rtol=1e-12, atol=1e-13, dense_output=True)
turning.plot(["slider", "slip", "energy"])
plt.show()
print(f"it stands still from {turning.events[-1].time:.6f} s")

# %%
# Four-bar linkage
# ----------------
# Three moving bars and a ground of length 2; the loop is closed by two equations between the angles, whose
# multipliers are the forces in the last pin. The pin of the first bar is dry.
a, b, c = me.dynamicsymbols("a b c")
bars = {a: 1, b: 2, c: sp.Rational(3, 2)}
gap = [sum(n * f(s) for s, n in ((a, 1), (b, 2), (c, -bars[c]))) - end for f, end in ((sp.cos, 2), (sp.sin, 0))]
middle = {a: ((a, 0.5),), b: ((a, 1), (b, 1)), c: ((c, 0.75),)}  # of each bar, from a pin at the ground
kinetic, height = 0, 0
for s, length in bars.items():
    X, Y = (sum(k * f(q) for q, k in middle[s]) for f in (sp.cos, sp.sin))
    kinetic += length * (X.diff() ** 2 + Y.diff() ** 2) / 2 + length**3 * s.diff() ** 2 / 24  # 1 kg per metre
    height += 9.81 * length * Y
lagrange = me.LagrangesMethod(kinetic - height, [a, b, c], hol_coneqs=gap)
lagrange.form_lagranges_equations()
linkage = System.from_mechanics(
    lagrange, friction={"a": Coulomb(F_c=6)}, outputs={"energy": kinetic + height}
)
first = np.array([float(s) for s in sp.nsolve([e.subs(a, 1.2) for e in gap], (b, c), (0.4, 1.6))])
start = {"a": 1.2, "b": first[0], "c": first[1], "a_dot": 0, "b_dot": 0, "c_dot": 0}
fall = solve(linkage, (0, 5), start, rtol=1e-12, atol=1e-13, dense_output=True)
fall.plot(["a", "c", "energy"])
plt.show()

# %%
# A disc that slips until it rolls
# --------------------------------
# A disc of 1 kg and radius :math:`R` is thrown with backspin. Friction acts along the velocity of the point
# that touches the ground, :math:`v = \dot x - R\,\dot\varphi`; where it comes to 0 the disc rolls.
x, phi = me.dynamicsymbols("x phi")
R, load = sp.Rational(1, 5), 9.81
lagrange = me.LagrangesMethod(x.diff() ** 2 / 2 + R**2 * phi.diff() ** 2 / 4, [x, phi])
lagrange.form_lagranges_equations()
disc = System.from_mechanics(
    lagrange, friction={x.diff() - R * phi.diff(): Coulomb(F_c=0.3 * load)},
    outputs={"slip": x.diff() - R * phi.diff(), "energy": x.diff() ** 2 / 2 + R**2 * phi.diff() ** 2 / 4},
)  # fmt: skip
start = {"x": 0, "phi": 0, "x_dot": 2, "phi_dot": -30}
thrown = solve(disc, (0, 1.5), start, rtol=1e-12, atol=1e-13, dense_output=True)
thrown.plot(["x", "x_dot", "slip"])
plt.show()
print(f"rolls from {thrown.events[0].time:.12f} s")
print(f"v0/(3 mu g) {(2 + 0.2 * 30) / (3 * 0.3 * load):.12f} s, v0 the slip at the start")
