r"""
Add a contact law
=================

Grains yield: they load along a soft line and unload along a stiff one,

.. math::

    F = \max\bigl(0, \min(K_1 p,\; K_2\,(p - p_0))\bigr), \qquad
    p_0 = p_{\max}\,(1 - K_1/K_2),

where :math:`p_{\max}` is the largest indentation so far (Walton and Braun). The law needs a value that only
events change, a *memory*, and its restitution is known exactly: :math:`e = \sqrt{K_1/K_2}`.
"""

# %%
# The law
# -------
# The position of a contact is its indentation :math:`p`, and the force is a magnitude that
# repels. ``at.memory`` is a value that changes only in events; the event here is the turning
# point, where the velocity falls through zero.
import sympy as sp

from pwsmooth import Event
from pwsmooth.laws import Law, Pieces, law, parameter


@law
class YieldingContact(Law):
    """Soft loading, stiff unloading: a plastic indentation is left."""

    source = "Walton, Braun 1986"
    needs = ("position",)
    K_1: float = parameter(1e3, "N/m", "stiffness of loading")
    K_2: float = parameter(4e3, "N/m", "stiffness of unloading")

    def check(self):
        if self.K_2 < self.K_1:
            raise ValueError(
                f"`K_2` is {self.K_2:g}, below `K_1` = {self.K_1:g}: unloading would make "
                "energy; give K_2 >= K_1."
            )

    def pieces(self, at, p):
        deepest = at.memory("deepest", 0.0)
        left = deepest * (1 - p.K_1 / p.K_2)
        force = sp.Max(0, sp.Min(p.K_1 * at.x, p.K_2 * (at.x - left)))
        turn = Event(
            at.v,
            direction=-1,
            when=at.x > deepest,
            update={deepest: at.x},
            name=at.label("deepest"),
        )
        return Pieces(
            force=force,
            events=(turn,),
            outputs={"plastic": left},
            surfaces=(at.x,),
        )


# %%
# A check on relations between parameters is one method; the message names value and remedy:
try:
    YieldingContact(K_2=500.0)
except ValueError as error:
    print(error)

# %%
# Does it do what it should?
# --------------------------
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.scenes import falling_ball, free_impact

for ratio in (0.9, 0.5, 0.25, 0.1):
    scene = free_impact(YieldingContact(K_1=1e3, K_2=1e3 / ratio), speed=2.0)
    e = -scene.solve()["v"][-1] / 2.0
    print(
        f"K_1/K_2 = {ratio:<5} e = {e:.12f}   sqrt(K_1/K_2) = {np.sqrt(ratio):.12f}"
    )
    # sphinx_gallery_start_ignore
    assert abs(e - np.sqrt(ratio)) < 1e-9
    # sphinx_gallery_end_ignore

# %%
# In a scene: the ground yields at the first impact, is left with a dent, and carries the
# others, which are no harder, along the stiff line.
scene = falling_ball(YieldingContact(), height=0.3, m=0.1, t_span=(0, 1.5))
sol = scene.solve(dense_output=True)
times = np.linspace(0, 1.5, 3001)
fig, (left, right) = plt.subplots(1, 2, figsize=(7.4, 2.9))
left.plot(times, 1e3 * sol(times, "height"))
left.set(
    xlabel="t (s)", ylabel="height (mm)", title="A ball on yielding ground"
)
right.plot(1e3 * sol(times, "p"), sol(times, "force"))
right.set(xlabel="indentation (mm)", ylabel="force (N)", xlim=(-1, None))
right.set_title("Loading, unloading, reloading")
plt.show()

# %%
# To make it part of the package
# ------------------------------
# As for a friction law: its own file in ``pwsmooth/laws/contact/``, its name into
# ``__init__.py``, and a test of the closed form. Laws whose force has a power such as
# :math:`p^{3/2}` need nothing special: that it has no Taylor series at touch-down is the
# solver's business. Laws to read: ``elastic.py``, ``residual.py``.
