r"""
Friction in the plane
=====================

On a line, dry friction has a sign. In the plane it has a direction: against the slip while the body slides,

.. math::

    m\,\dot v = F - \mu N\,\lambda, \qquad \lambda = \frac{v}{\lvert v\rvert} \;\text{ in slip,} \qquad
    \lvert\lambda\rvert \le 1 \;\text{ at rest,}

and at rest whatever force holds, up to :math:`\mu N` in any direction. :class:`~pwsmooth.Disc` is this multiplier.
**What is new against a line, and what goes wrong with a law for each axis?**
"""

# %%
# A body that is thrown
# ---------------------
# Two components of a velocity, one multiplier. A slip in ordinary notation, ``u/sqrt(u**2 + v**2)``, becomes one too.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Disc, System, solve
from pwsmooth.plotting import COLOUR

x, y, u, v = sp.symbols("x y u v", real=True)
mu = sp.Symbol("mu", positive=True)
lam = Disc("lam", (u, v))
thrown = System({x: u, y: v, u: -mu * lam[0], v: -mu * lam[1]}, parameters={mu: 0.5})
run = solve(thrown, (0, 4), {x: 0, y: 0, u: 0.6, v: 0.8})
print(run)

# %%
# It stops after 1/0.5 = 2, in a straight line. With a sign for each axis it does not: the force is
# :math:`\sqrt 2\,\mu` along a diagonal, and one component stops before the other.
axes_law = System({x: u, y: v, u: -mu * sp.sign(u), v: -mu * sp.sign(v)}, parameters={mu: 0.5})
angles = np.linspace(0, 2 * np.pi, 37)
rest = {}
for name, system in (("one law", thrown), ("a law for each axis", axes_law)):
    rest[name] = [solve(system, (0, 4), {x: 0, y: 0, u: np.cos(a), v: np.sin(a)}).x[:2, -1] for a in angles]
fig, ax = plt.subplots(figsize=(3.4, 3.2), layout="constrained")
for (name, places), colour in zip(rest.items(), ("right", "left"), strict=True):
    ax.plot(*np.transpose(places), ".-", color=COLOUR[colour], label=name)
ax.set(xlabel="x", ylabel="y", aspect="equal", title="where it comes to rest")
ax.legend(fontsize=7, loc="center")
plt.show()

# %%
# How it stops, and how it leaves
# -------------------------------
# Under a force the slip turns into the direction of the force while the body stops, ever faster; the time and the place
# are exact all the same. From rest it leaves where :math:`\lvert\lambda\rvert` reaches 1, in the direction of
# :math:`\lambda` and without acceleration. In the disc of :math:`\lambda` slip is the circle, and rest its inside.
t = sp.Symbol("t", real=True)
force = (sp.Rational(8, 5) * sp.cos(t / 4), sp.sin(t / 4))
forced = System({x: u, y: v, u: force[0] - x - lam[0], v: force[1] - y - lam[1]}, time=t)
run = solve(forced, (0, 30), {x: 0.3, y: 0.1, u: 0.5, v: -0.4}, dense_output=True)
for event in run.events:
    print(f"{event.kind:16} {event.time:.12f}")
edges = [0, *run.event_times(), 30]
fig, (left, right) = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
for k, (begin, end) in enumerate(zip(edges, edges[1:], strict=False)):
    times = np.linspace(begin + 1e-9, end - 1e-9, 600)
    colour = COLOUR["stick" if k % 2 else "right"]
    left.plot(run(times, "x"), run(times, "y"), color=colour, marker="o" if k % 2 else None, markersize=5)
    right.plot(run(times, "lam_x"), run(times, "lam_y"), color=colour, label=("slip", "stick")[k] if k < 2 else None)
left.set(xlabel="x", ylabel="y", aspect="equal", title="the path, with its two rests")
right.set(xlabel=r"$\lambda_x$", ylabel=r"$\lambda_y$", aspect="equal", title="the multiplier")
right.legend(fontsize=7)
plt.show()

# %%
# Any law
# -------
# Friction laws take a velocity with components. Static friction, Stribeck curves and bristles stay what they are on a
# line, and do not know the axes. A break-away: the force rises slowly, in a direction that turns.
from pwsmooth.laws.friction import Coulomb, LuGre, StaticKinetic
from pwsmooth.scenes import planar_oscillator
from pwsmooth.scenes import t as time

angle = time / 20
pull = tuple(time / 10 * f(angle) for f in (sp.cos, sp.sin))
for law in (Coulomb(F_c=1.0), StaticKinetic(F_c=1.0, F_s=1.5), LuGre(sigma0=1e3, sigma1=30.0, F_c=1.0, F_s=1.5)):
    broken = planar_oscillator(law, pull, k=0.0, t_span=(0, 16)).solve(dense_output=True)
    moves = 16 - np.linspace(0, 15.9, 4000)[::-1]
    far = np.hypot(broken(moves, "x"), broken(moves, "y"))
    at = moves[np.argmax(far > 0.01)]
    print(f"{type(law).__name__:13} has gone 1 cm at the force {at / 10:.2f}")

# %%
# Under Coulomb's law it goes from 1 on, held statically from 1.5; bristles creep towards their break-away.

# %%
# What is different
# -----------------
# **Static friction does not catch a slip.** On a line a body is captured by :math:`\mu_s` where the force is between
# :math:`\mu` and :math:`\mu_s`; in the plane only what comes exactly against the force is. Any other slip passes by, as
# near to rest as it likes. The run says so: a "near miss" is an ambiguity.
hidden = System({u: 1.4 - lam[0] * (1 + 3 * (1 - lam.square)), v: -lam[1] * (1 + 3 * (1 - lam.square))})
for across in (0, 1e-3):
    run = solve(hidden, (0, 3), {u: -1, v: across})
    print(f"v = {across:g}: {run.itinerary[-1]}, ambiguities: {[a.kind for a in run.ambiguities]}")

# %%
# **A contact that spins** has force and moment in one bound. :class:`~pwsmooth.laws.friction.Contensou` takes
# :math:`(v_x, v_y, \omega)`: a disc that spins slides farther, and stops sliding and spinning at once.
from pwsmooth.laws.friction import Contensou
from pwsmooth.scenes import spinning_disc

for spin in (0.0, 1.0, 4.0):
    thrown = spinning_disc(Contensou(F_c=1.0, R=1.0), velocity=(1, 0), spin=spin).solve()
    print(f"spin {spin:g}: rests after {thrown.event_times('stick')[0]:.4f} at {thrown['x'][-1]:.4f}")

# %%
# More: the mathematics in :doc:`/theory/vector_switch`, laws and scenes in :doc:`/laws`, mechanisms with such contacts
# in :doc:`/auto/howto/plot_6_mechanics`, and what accuracy costs in the study ``experiments/planar_friction.py``.
