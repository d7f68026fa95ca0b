r"""
Add a friction law
==================

Rocks and rubber remember how long their contacts have been at rest. The law of Dieterich and Ruina, in
the form that stays finite at :math:`v = 0`, has one internal state :math:`\theta`, the age of the
contacts; per unit of normal load

.. math::

    f = a \operatorname{arsinh}\!\left[\frac{v}{2 v_0}
        \exp\frac{\mu_0 + b \ln (v_0 \theta/L)}{a}\right],
    \qquad \dot\theta = 1 - \frac{|v|\,\theta}{L}.

The package does not have it. Here it is added, in some fifteen lines.
"""

# %%
# The law
# -------
# A law is a frozen dataclass. Its fields are its parameters, each with unit, meaning and
# default; ``pieces`` gives the force and the rates of the internal states from the motion
# ``at`` a joint. Ordinary notation is enough: the ``Abs`` becomes a switch.
import sympy as sp

from pwsmooth.laws import Law, Pieces, law, parameter


@law
class RateAndState(Law):
    """Friction that depends on the velocity and on the age of the contacts."""

    source = "Dieterich 1979, Ruina 1983; regularised form"
    mu_0: float = parameter(0.6, "1", "friction coefficient at v_0")
    a: float = parameter(0.05, "1", "direct effect")
    b: float = parameter(0.08, "1", "effect of age", "nonnegative")
    L: float = parameter(
        1.0, "m", "sliding distance in which contacts are renewed"
    )
    v_0: float = parameter(1.0, "m/s", "reference velocity")

    def pieces(self, at, p):
        theta = at.state("theta", start=p.L / p.v_0, positive=True)
        strength = sp.exp((p.mu_0 + p.b * sp.log(p.v_0 * theta / p.L)) / p.a)
        return Pieces(
            force=p.a * sp.asinh(at.v / (2 * p.v_0) * strength),
            rates={theta: 1 - sp.Abs(at.v) * theta / p.L},
            surfaces=(at.v,),
        )

    def steady(self, v, p):
        age = p.L / sp.Abs(v)
        strength = sp.exp((p.mu_0 + p.b * sp.log(p.v_0 * age / p.L)) / p.a)
        return p.a * sp.asinh(v / (2 * p.v_0) * strength)


print(RateAndState())
print(RateAndState.units())

# %%
# A parameter that makes no sense is refused at the door, with its meaning:
try:
    RateAndState(a=-1)
except ValueError as error:
    print(error)

# %%
# Any scene takes it
# ------------------
# A block pulled at constant speed by a spring. Where :math:`b > a` friction falls with
# velocity, and steady sliding is unstable for soft springs. With mass :math:`m`, load 1 and
# pull :math:`V` the critical stiffness is known,
#
# .. math::  k_c = \frac{b - a}{L}\left(1 + \frac{m V^2}{a L}\right) .
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.scenes import block_on_belt

friction = RateAndState()
V, m = 1.0, 0.01
k_c = (
    (friction.b - friction.a)
    / friction.L
    * (1 + m * V**2 / (friction.a * friction.L))
)
times = np.linspace(0, 120, 4001)
fig, ax = plt.subplots(figsize=(7, 2.8))
for share in (0.97, 1.0, 1.03):
    k = share * k_c
    scene = block_on_belt(friction, k=k, pull=V, m=m, t_span=(0, 120))
    steady = friction.steady_force(V) / k
    start = {**scene.x0, "elongation": 1.01 * steady, "v": V}
    sol = scene.solve(x0=start, t_eval=times)
    ax.plot(times, sol["v"], label=f"k = {share:g} k_c")
    # sphinx_gallery_start_ignore
    early, late = (
        np.ptp(sol["v"][part]) for part in (slice(0, 500), slice(-500, None))
    )
    assert {0.97: late > 1.5 * early, 1.03: late < 0.67 * early}.get(
        share, abs(late / early - 1) < 0.05
    )
    # sphinx_gallery_end_ignore
ax.set(
    xlabel="t (s)",
    ylabel="v (m/s)",
    title="Growth below the critical stiffness, decay above",
)
ax.legend()
plt.show()

# %%
# To make it part of the package
# ------------------------------
# Put the class into its own file in ``pwsmooth/laws/friction/``, with the equation and its source
# on top, and its name into the list in ``__init__.py``. ``source`` says where the equations and the
# defaults come from; where the original was not available, add ``certainty = "reconstructed"``.
# Then write a test that knows the answer: here, that a small deviation grows at
# :math:`0.97\,k_c` and decays at :math:`1.03\,k_c`.
#
# The contract is :class:`~pwsmooth.laws.Law`; a good law to read is
# ``pwsmooth/laws/friction/dahl.py``.
