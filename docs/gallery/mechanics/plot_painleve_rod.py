r"""
Painlevé's rod
==============

A rod slides with its lower end on rough ground, at the angle :math:`\theta` to it, and its end goes first: it is
pushed, as chalk that screeches. Friction :math:`\mu N` and reaction :math:`N` turn it, and the acceleration of its
end from the ground is

.. math::

    \ddot h = a N + b, \qquad a = \frac1m\bigl(1 + 3\cos\theta\,(\cos\theta + \mu\,\lambda\sin\theta)\bigr), \qquad
    b = l\,\dot\theta^2 \sin\theta - g, \qquad \lambda = \operatorname{sign} v.

For :math:`\mu > 4/3` and slip to the left there are angles with :math:`a < 0`: friction presses the end down more
than the reaction lifts it. **What does a rigid body do then?** With :math:`b < 0` no reaction keeps it off the ground
(*inconsistent*), with :math:`b > 0` two do (*indeterminate*), and on the way to :math:`a = b = 0` the
reaction grows beyond all bounds (*jam*; Painlevé 1895, Génot and Brogliato 1999).
"""

# %%
# The rod, of mass 1 kg and half-length 1 m, with a rigid contact, and with a spring of the stiffness :math:`k` in its
# place.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from sympy.physics import mechanics as me

from pwsmooth import Event, System, Unilateral, solve
from pwsmooth.laws.friction import Coulomb

x, y, theta = me.dynamicsymbols("x y theta")
mu, g = 1.6, 9.81
gap, slip = y - sp.sin(theta), x.diff() + sp.sin(theta) * theta.diff()


def rod(stiffness=None):
    frame, end = me.ReferenceFrame("N"), me.Point("end")
    end.set_vel(frame, slip * frame.x + gap.diff() * frame.y)
    kinetic = (x.diff() ** 2 + y.diff() ** 2) / 2 + theta.diff() ** 2 / 6
    floor = Unilateral(gap, name="N")
    N = floor.reaction if stiffness is None else stiffness * sp.Max(0, -gap)
    lagrange = me.LagrangesMethod(
        kinetic - g * y, [x, y, theta], frame=frame, forcelist=[] if stiffness is None else [(end, N * frame.y)]
    )
    lagrange.form_lagranges_equations()
    return System.from_mechanics(
        lagrange, contacts=[floor] if stiffness is None else [], friction={slip: (Coulomb(F_c=mu), N)},
        events=[] if stiffness is None else [Event(gap, direction=1, terminal=True, name="release")],
        outputs={"slip": slip, "gap": gap, "reaction": N},
    )  # fmt: skip


def start(angle, rate, slip):
    """A rod whose end touches the ground and slips there."""
    up, aside = np.sin(angle), np.cos(angle)
    return {"x": 0, "y": up, "theta": angle, "x_dot": slip - up * rate, "y_dot": aside * rate, "theta_dot": rate}


def a(angle):
    return 1 + 3 * np.cos(angle) * (np.cos(angle) - mu * np.sin(angle))


def b(angle, rate):
    return rate**2 * np.sin(angle) - g


# %%
# The four answers
# ----------------
# What a run says that starts at an angle and a rate, slipping to the left. Points are runs, lines are
# :math:`a = 0` and :math:`b = 0`.
rigid = rod()


def answer(angle, rate):
    run = solve(rigid, (0, 1e-4), start(angle, rate, -1.0))
    if run.outcome.name == "INCONSISTENT_CONTACT":
        return "inconsistent"
    if "indeterminate contact" in [found.kind for found in run.ambiguities]:
        return "indeterminate"
    return "slides" if "closed" in run.itinerary[0] else "parts"


angles, rates = np.linspace(0.62, 1.48, 25), np.linspace(0.2, 5.0, 25)
answers = np.array([[answer(angle, rate) for angle in angles] for rate in rates])
colours = {"slides": "#0072B2", "parts": "#56B4E9", "indeterminate": "#E69F00", "inconsistent": "#D55E00"}
marks = {"slides": "o", "parts": "^", "indeterminate": "s", "inconsistent": "x"}

# %%
# Sliding rods that tip over
# --------------------------
# No rod slides across :math:`a = 0`: those that neither stop nor part before are drawn into the point where both lines
# meet, and jam there.
jams = [solve(rigid, (0, 0.3), start(0.5, rate, -6.0), dense_output=True) for rate in (1.8, 2.1, 2.4, 2.7, 3.0)]
for run in jams:
    print(f"{run.outcome.name} at t = {run.t[-1]:.6f}, a = {a(run['theta'][-1]):.1e}, N = {run['N'].max():.0f} N")

fig, ax = plt.subplots(figsize=(7, 4.2))
for name, colour in colours.items():
    rows, columns = np.nonzero(answers == name)
    ax.plot(angles[columns], rates[rows], marks[name], color=colour, markersize=3.5, label=name)
for edge in np.arctan(np.roots([1, -3 * mu, 4]).real):  # a = 0: 1 + tan^2 + 3 - 3 mu tan = 0
    ax.axvline(edge, color="k", linewidth=0.8)
ax.plot(angles, np.sqrt(g / np.sin(angles)), color="k", linewidth=0.8, linestyle="--")
for k, run in enumerate(jams):
    way = run(np.linspace(0, run.t[-1], 300))
    ax.plot(way[2], way[5], color="0.35", linewidth=1.2, label=None if k else "runs")
ax.set(xlim=(0.5, 1.5), ylim=(0, 5.2), xlabel=r"$\theta$ (rad)", ylabel=r"$\dot\theta$ (rad/s)")
ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=5, fontsize=8, frameon=False, handletextpad=0.2)
plt.show()

# %%
# What it is the limit of
# -----------------------
# In the place of the rigid contact a spring that is ever stiffer, at an inconsistent start. The end sinks in, the force
# grows with the indentation, and within a time that shrinks as :math:`\ln k/\sqrt k` its friction has stopped the slip,
# in a *tangential impact*, or impact without collision. Then the end sticks and is thrown up, with
#
# .. math::
#
#     \dot h^+ = |v_0|\,\frac{|a|}{c}\sqrt{1 + \frac{a_s}{|a|}}, \qquad
#     c = \mu + 3\sin\theta\,(\mu\sin\theta - \cos\theta), \qquad a_s = \frac{4}{1 + 3\sin^2\theta}
#
# in the limit: :math:`c N` is the acceleration of the slip, and :math:`a_s N` that of the end while it sticks.
angle, released = 1.1, []
sine, cosine = np.sin(angle), np.cos(angle)
c, a_s = mu + 3 * sine * (mu * sine - cosine), 4 / (1 + 3 * sine**2)
limit = -a(angle) / c * np.sqrt(1 - a_s / a(angle))
fig, (left, right) = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
for k, colour in ((1e4, "#56B4E9"), (1e6, "#0072B2"), (1e8, "#D55E00"), (1e10, "#000000")):
    run = solve(rod(k), (0, 1), start(angle, 0.0, -1.0), dense_output=True, rtol=1e-11)
    released.append(run["y_dot"][-1] - np.cos(run["theta"][-1]) * run["theta_dot"][-1])
    times = np.linspace(0, run.t[-1], 1000)
    label = f"$10^{{{np.log10(k):.0f}}}$ N/m"
    left.plot(times * np.sqrt(k), run(times, "slip"), color=colour)
    right.plot(times * np.sqrt(k), run(times, "reaction") / np.sqrt(k), color=colour, label=label)
    print(f"k = {k:.0e} N/m: thrown up with {released[-1]:.5f} m/s")
print(f"limit           : thrown up with {limit:.5f} m/s")
left.set(xlabel=r"$t\,\sqrt{k/m}$", ylabel="slip (m/s)")
right.set(xlabel=r"$t\,\sqrt{k/m}$", ylabel=r"$N/\sqrt{km}$ (m/s)")
right.legend(title="k", fontsize=8, title_fontsize=8, frameon=False)
plt.show()
