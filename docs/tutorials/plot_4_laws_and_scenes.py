r"""
Friction and contact laws in scenes
===================================

A *law* is a symbolic component: internal states and their rates, a force, parameters with units.
A *scene* is a mechanism with a place for a law: a rig, a block on a belt, an oscillator, a falling
ball. Any law fits any scene of its kind, because both end in the same :class:`~pwsmooth.System`;
reversals, break-aways, touch-downs and mode changes are events and are located, not stepped over.
"""

# %%
# A law knows where it comes from
# -------------------------------
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.laws.friction import Dahl, LuGre, MaxwellSlip, StaticKinetic

dahl = Dahl(sigma0=4.0, F_c=1.0)
print(dahl, "--", Dahl.source)
for name, unit in Dahl.units().items():
    print(
        f"  {name:8} {dahl.values[name]:<6g} {unit:5} {Dahl.meanings()[name]}"
    )

# %%
# Units are those of the source and any consistent set will do. In what follows lengths are
# micrometres, so that ``sigma0`` is in N/µm.
#
# The rig: position in, force out
# -------------------------------
# No mass, no spring: the law alone, under a prescribed motion. This one goes forth and back and
# makes a small loop on its way, between about 0.2 and 0.8. What a contact remembers shows in
# whether the small loop *closes*: whether the force goes on from there as if the contact had
# never turned.
from scipy.optimize import brentq

from pwsmooth import Drive
from pwsmooth.scenes import block_on_belt, falling_ball, prescribed_motion

turns = np.array([0, 1, 0.2, 0.7, -1, 1])
times = np.concatenate([[0], np.cumsum(np.abs(np.diff(turns)))])
path = Drive(times, turns)  # a spline through the samples
laws = {
    "Dahl": dahl,
    "LuGre": LuGre(
        sigma0=4.0, sigma1=0.05, sigma2=0.0, F_c=1.0, F_s=1.2, v_s=2.0
    ),
    "Maxwell-slip, 4 elements": MaxwellSlip(
        kappa=(1.6, 1.2, 0.8, 0.4), strength=(0.25, 0.25, 0.25, 0.25)
    ),
}


def moment_of(loop, name, value, *between):
    """When the named quantity has the value."""
    return brentq(lambda s: loop(s, name) - value, *between, xtol=1e-15)


fig, axes = plt.subplots(
    1, 3, sharey=True, figsize=(7.8, 2.9), layout="constrained"
)
moments = np.linspace(0, times[-1], 4001)
for ax, (name, law) in zip(axes, laws.items()):
    loop = prescribed_motion(law, position=path).solve(dense_output=True)
    ax.plot(loop(moments, "position"), loop(moments, "force"))
    ax.set(title=name, xlabel="position (µm)")
    turn = moment_of(loop, "velocity", 0, 1.5, 2.0)
    back = moment_of(loop, "position", loop(turn, "position"), 2.6, 3.5)
    gap = loop(back, "force") - loop(turn, "force")
    print(f"{name:26} the small loop stays open by {abs(gap):.1e} N")
    # sphinx_gallery_start_ignore
    assert abs(gap) < 1e-12 if "Maxwell" in name else abs(gap) > 0.05
    # sphinx_gallery_end_ignore
axes[0].set_ylabel("force (N)")
plt.show()

# %%
# The Maxwell-slip law has one element a memory and closes the loop to rounding; Dahl's and
# LuGre's have one state for everything, and forget. That is a property of the laws, measured
# here to many digits because nothing of it is the solver's.
#
# The same objects in a mechanism
# -------------------------------
# A block on a moving belt, held by a spring. Static friction above the kinetic one makes it
# stick and slip.
fig, axes = plt.subplots(
    2, 1, sharex=True, figsize=(7, 3.6), layout="constrained"
)
for law in (StaticKinetic(), LuGre(F_s=1.5)):
    scene = block_on_belt(law)
    sol = scene.solve(dense_output=True)
    moments = np.linspace(*scene.t_span, 3001)
    for ax, quantity in zip(axes, ("v", "friction")):
        ax.plot(moments, sol(moments, quantity), label=type(law).__name__)
    print(
        f"{scene.name:32} {len(sol.events)} events in {sol.cost['steps']} steps"
    )
axes[0].set(ylabel="slip velocity (m/s)", title="Block on a belt")
axes[1].set(ylabel="friction (N)", xlabel="t (s)")
axes[0].legend()
plt.show()

# %%
# LuGre's bristles deflect by 1e-5 m: the scene passes ``solve`` an absolute tolerance for each
# state, at its usual size.
#
# Contacts
# --------
# Contact laws take an indentation and its rate. A rigid impact needs Newton's restitution alone
# and has its bounces accumulate; the compliant laws resolve every touch.
from pwsmooth.laws.contact import HertzImpact, RigidImpact

fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
for law in (RigidImpact(e=0.8), HertzImpact(c_r=0.8, K=1e9)):
    scene = falling_ball(law, height=0.1)
    sol = scene.solve(dense_output=True)
    moments = np.linspace(0, 1.4, 4001)
    ax.plot(moments, 1e3 * sol(moments, "height"), label=type(law).__name__)
    apexes = scene.observe(sol)["apexes"]
    print(f"{type(law).__name__:12} restitution of bounces 1 to 4:", end=" ")
    print(np.sqrt(apexes[:4] / np.append(0.1, apexes[:3])).round(6))
    if isinstance(law, RigidImpact):
        fall = np.sqrt(2 * 0.1 / 9.81)
        rest = sol.event_times("accumulation")[-1]
        print(f"{'':12} at rest from t = {rest:.12f} s,", end=" ")
        print(f"exactly fall (1 + e)/(1 - e) = {fall * 1.8 / 0.2:.12f} s")
ax.set(xlabel="t (s)", ylabel="height (mm)", title="A falling ball")
ax.legend()
plt.show()

# %%
# ``c_r=0.8`` of the Hertz law with Lankarani and Nikravesh's damping factor is *not* the
# restitution that it gives: :func:`~pwsmooth.laws.contact.effective_restitution` says what it
# is, in closed form, for all ten damping factors of the table. (The bounces above are a little
# below it: while the ball is in contact its weight acts too.)
from pwsmooth.laws.contact import effective_restitution
from pwsmooth.scenes import free_impact

for c_r in (0.2, 0.5, 0.8, 0.95):
    run = free_impact(HertzImpact(c_r=c_r), speed=0.5).solve()
    print(f"c_r = {c_r:<5} closed form", end=" ")
    print(f"{effective_restitution('lankarani-nikravesh', c_r):.9f}", end="  ")
    print(f"solved {-run['v'][-1] / 0.5:.9f}")
    # sphinx_gallery_start_ignore
    exact = effective_restitution("lankarani-nikravesh", c_r)
    assert abs(-run["v"][-1] / 0.5 - exact) < 1e-8  # ten times rtol
    # sphinx_gallery_end_ignore

# %%
# All laws with what they are for and where they fail are listed in :doc:`/laws`; to write one
# of your own see :ref:`sphx_glr_auto_howto_plot_1_friction_law.py`. Next: :ref:`sweeps, stores
# and a cluster <sphx_glr_auto_tutorials_plot_5_sweeps.py>`.
