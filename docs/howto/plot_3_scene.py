r"""
Add a scene
===========

A scene bundles what figures, sweeps and charts need of a model: a system, a start, a span, the period of its
forcing, and named observables. A mechanism with a place for a law becomes one in a single function.

The mechanism here is a pendulum whose pivot has friction,

.. math::

    m l^2 \ddot\varphi = -m g l \sin\varphi - l_b\, f(l_b \dot\varphi),

with any friction law :math:`f` acting at the bearing's radius :math:`l_b`.
"""

# %%
# The function
# ------------
# The law is attached to the sliding velocity of the bearing and brings its own states,
# parameters, events and start; :func:`~pwsmooth.scenes.assemble` puts both together, with
# absolute tolerances that fit each state.
import numpy as np
import sympy as sp

from pwsmooth.laws import Law
from pwsmooth.scenes import Scene, assemble, t

phi, w = sp.symbols("phi w", real=True)
m, g, length, radius = sp.symbols("m g length radius", positive=True)


def pendulum(
    law: Law, *, mass=1.0, arm=1.0, bearing=0.1, angle=2.0, t_span=(0.0, 20.0)
) -> Scene:
    """A pendulum with friction in its pivot, let go at rest.

    Parameters
    ----------
    law : Law
        A friction law.
    mass, arm, bearing : float
        m (kg), l (m) and the bearing's radius (m).
    angle : float
        At the start (rad).
    """
    if not 0 < abs(angle) < np.pi:
        raise ValueError(f"`angle` is {angle!r}; give 0 < |angle| < pi.")
    pieces = law.attach(velocity=radius * w, position=radius * phi, time=t)
    torque = -m * g * length * sp.sin(phi) - radius * pieces.force
    energy = m * length**2 * w**2 / 2 + m * g * length * (1 - sp.cos(phi))
    system, start, atol = assemble(
        {phi: w, w: torque / (m * length**2)},
        pieces,
        time=t,
        x0={phi: angle, w: 0.0},
        parameters={m: mass, g: 9.81, length: arm, radius: bearing},
        outputs={"friction": pieces.force, "energy": energy},
    )
    return Scene(
        name=f"pendulum, {type(law).__name__}",
        system=system,
        x0=start,
        t_span=t_span,
        observables={
            "phi": "phi",
            "energy": "energy",
            "rest angle": lambda sol: float(sol["phi"][-1]),
        },
        units={"phi": "rad", "w": "rad/s", "energy": "J", **law.units()},
        note=law.source,
        atol=atol,
    )


# %%
# Every law fits
# --------------
import matplotlib.pyplot as plt

from pwsmooth.laws.friction import Coulomb, Dahl, StribeckFriction

times = np.linspace(0, 20, 4001)
fig, ax = plt.subplots(figsize=(7, 3))
for law in (
    Coulomb(F_c=8.0),
    StribeckFriction(F_c=8.0, F_s=12.0),
    Dahl(F_c=8.0, sigma0=4e3),
):
    scene = pendulum(law)
    sol = scene.solve(t_eval=times)
    ax.plot(times, sol["phi"], label=type(law).__name__)
    print(
        f"{scene.name:28} rest angle {scene.observe(sol)['rest angle']:+.6f} rad"
    )
ax.set(
    xlabel="t (s)",
    ylabel="φ (rad)",
    title="A pendulum with friction in its pivot",
)
ax.legend()
plt.show()

# %%
# Is it right?
# ------------
# Under Coulomb friction the energy lost is the constant torque times the angle that was swept;
# the solver does not know that.
scene = pendulum(Coulomb(F_c=8.0))
sol = scene.solve(rtol=1e-12)
swept = np.abs(np.diff(sol["phi"])).sum()
lost = sol["energy"][0] - sol["energy"][-1]
print(f"lost {lost:.12f} J, torque times angle {0.1 * 8.0 * swept:.12f} J")
# sphinx_gallery_start_ignore
assert abs(lost - 0.1 * 8.0 * swept) < 1e-9
# sphinx_gallery_end_ignore

# %%
# From here on it is a scene like the others: ``sweep`` takes it with its start and units.
from pwsmooth import sweep
from pwsmooth.studies import Function


def rest_angle(solution):
    """Where the pendulum stays."""
    return solution["phi"][-1]


found = sweep(
    scene,
    {"F_c": np.linspace(4, 20, 33)},
    t_span=(0, 60),
    measures=[Function(rest_angle)],
)
fig, ax = plt.subplots(figsize=(7, 2.6))
bound = np.arcsin(0.1 * found.F_c / 9.81)
ax.fill_between(
    found.F_c, -bound, bound, color="0.9", label="where it can rest"
)
ax.plot(found.F_c, found.rest_angle, ".-", label="where it does")
ax.set(xlabel="Coulomb force (N)", ylabel="rest angle (rad)")
ax.set_title("Rest angles")
ax.legend()
plt.show()

# %%
# To make it part of the package
# ------------------------------
# Put the function into a file of its own in ``pwsmooth/scenes/``, with the equations on top,
# its name into ``__init__.py``, and the balance above into a test.
