r"""
Bring a mechanism from sympy.physics.mechanics
==============================================

Equations of motion from ``KanesMethod``, ``LagrangesMethod`` or a ``System`` of joints, exact friction and contacts
from here: :meth:`System.from_mechanics <pwsmooth.System.from_mechanics>` takes the model as it is. Friction is
named by the velocity that it acts along,

.. math::

    M(q)\,\dot u = Q(q, u) - \sum_k f_k(v_k)\,\frac{\partial v_k}{\partial u}, \qquad v_k = v_k(q, u),

so that nobody has to find generalized forces. Here a rod whose end pin slides on a table, in five steps.
"""

# %%
# 1. The model, without friction
# ------------------------------
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from sympy.physics import mechanics as me

from pwsmooth import System, Unilateral, solve
from pwsmooth.laws.friction import Contensou, Coulomb
from pwsmooth.plotting import COLOUR

q1, q2, theta, u1, u2, spin = me.dynamicsymbols("q1 q2 theta u1 u2 spin")
t = me.dynamicsymbols._t
N, O = me.ReferenceFrame("N"), me.Point("O")
O.set_vel(N, 0)
B = N.orientnew("B", "Axis", [theta, N.z])
B.set_ang_vel(N, spin * N.z)
G = O.locatenew("G", q1 * N.x + q2 * N.y)
G.set_vel(N, u1 * N.x + u2 * N.y)
rod = me.RigidBody("rod", G, B, 1, (me.inertia(B, 0, 0, sp.Rational(1, 3)), G))
pin = G.locatenew("pin", B.x / 2).v2pt_theory(G, N, B)
kane = me.KanesMethod(
    N, [q1, q2, theta], [u1, u2, spin],
    kd_eqs=[u1 - q1.diff(t), u2 - q2.diff(t), spin - theta.diff(t)],
)  # fmt: skip
kane.kanes_equations([rod], [(G, 0 * N.x)])

# %%
# 2. Friction, by the velocity that it opposes
# --------------------------------------------
# One velocity is a joint's name or an expression; **two in a tuple are a slip in the plane**, three of them with the
# spin a contact that turns. The mass matrix stays unsolved. Any law of :mod:`pwsmooth.laws.friction` will do;
# ``(law, load)`` is one per unit of load.
slip = (pin.dot(N.x), pin.dot(N.y))
energy = me.kinetic_energy(N, rod)
table = System.from_mechanics(kane, friction={slip: Coulomb(F_c=1.2)}, outputs={"energy": energy, "slip_x": slip[0]})
start = {"q1": 0, "q2": 0, "theta": 0.5, "u1": 0.4, "u2": 0.3, "spin": 1}
run = solve(table, (0, 6), start, rtol=1e-11, atol=1e-13, dense_output=True)
print(run.itinerary)

# %%
# 3. Look at it
# -------------
# The states have the model's names. The pin comes to rest; from then on it is a hinge, and the rod turns about it at a
# constant rate.
times = np.linspace(0, 6, 1500)
fig, (left, right) = plt.subplots(1, 2, figsize=(7.4, 2.9), layout="constrained")
for moment in np.linspace(0, 6, 25):
    place = np.array([run(moment, "q1"), run(moment, "q2")])
    along = np.array([np.cos(run(moment, "theta")), np.sin(run(moment, "theta"))])
    ends = np.array([place + along / 2, place - along / 2])
    left.plot(*ends.T, color=COLOUR["mark"], linewidth=0.6)
    left.plot(*ends[0], "o", color=COLOUR["right" if moment < run.events[0].time else "stick"], markersize=3)
left.set(xlabel="x", ylabel="y", aspect="equal", title="the rod and its pin")
right.plot(times, run(times, "spin"), color=COLOUR["right"], label="spin")
right.plot(times, run(times, "energy"), color=COLOUR["mark"], label="energy")
right.axvline(run.events[0].time, color=COLOUR["stick"], linewidth=0.8, label="the pin rests")
right.set(xlabel="t")
right.legend(fontsize=7)
plt.show()

# %%
# 4. A pin that has an area
# -------------------------
# The third component is the rod's spin, and the law one of a contact that turns: now the rod stops.
pad = System.from_mechanics(kane, friction={(*slip, spin): Contensou(F_c=1.2, R=0.1)}, outputs={"energy": energy})
stops = solve(pad, (0, 20), start)
print(stops.itinerary, f"at {stops.event_times('stick')[-1]:.4f}")

# %%
# 5. Contacts
# -----------
# A wall that the centre of the rod must not pass is a gap, a :class:`~pwsmooth.Unilateral` of the coordinates.
wall = Unilateral(1 - q1, restitution=0.5, name="wall")
walled = System.from_mechanics(kane, friction={slip: Coulomb(F_c=0.1)}, contacts=[wall])
bounced = solve(walled, (0, 6), start | {"u1": 1.5})
print([event.kind for event in bounced.events])

# %%
# What is refused is refused by name: constraints between speeds beyond rolling, a singular mass matrix, loops that are
# closed without multipliers. A double pendulum, a slider-crank, a four-bar linkage:
# :doc:`/auto/gallery/mechanics/plot_mechanisms`.
