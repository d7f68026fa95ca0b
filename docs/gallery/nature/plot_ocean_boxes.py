r"""
Ocean circulation that tips: Stommel's boxes
============================================

Two boxes of sea, one warm and salty, one cold, exchange water at a rate that does not ask for the
direction: :math:`|q|`. With a temperature difference that stays as it is, what remains is the difference of
salinity :math:`S`, fed by fresh water :math:`F`:

.. math::

    \dot S = F(t) - |q|\,S, \qquad q = 1 - S

For :math:`0 < F < \tfrac14` there are two stable circulations. One ends at a smooth fold, :math:`F =
\tfrac14, S = \tfrac12`; the other one, of opposite direction, at the switch itself, :math:`F = 0, S = 1`.
**At which** :math:`F` **does the circulation reverse if fresh water increases slowly,** :math:`F = \tfrac14
+ \mu t` **?**
"""

# %%
# ``Abs`` is written as it stands. The climate gets wetter, and then drier again.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.optimize import brentq
from scipy.special import ai_zeros, airy

from pwsmooth import System, solve

t, S = sp.symbols("t S", real=True)
mu, turn = 1e-3, 100.0
F = sp.Rational(1, 4) + mu * (turn - sp.Abs(t - turn))
ocean = System(
    {S: F - sp.Abs(1 - S) * S}, time=t, outputs={"F": F, "q": 1 - S}
)


def tracked(t):
    """S of the solution that has followed the stable branch for ever."""
    z = -np.cbrt(mu) * t
    value, slope, *_ = airy(z)
    return 0.5 + np.cbrt(mu) * slope / value


begin = -200.0
sol = solve(ocean, (begin, 520), {S: tracked(begin)}, dense_output=True)

# %%
# As long as :math:`q > 0` the equation is Riccati's, whose solution with a linear :math:`F` is a quotient
# of Airy functions: it is ``tracked``. The reversal is where that is 1, long after the fold.
reversal = sol.event_times("crossing")[0]
last = -ai_zeros(1)[0][0] / np.cbrt(mu)  # where the quotient has its pole
exact = brentq(lambda t: tracked(t) - 1, 0, last * (1 - 1e-9), xtol=1e-12)
print(f"reversal at F = {0.25 + mu * reversal:.12f}")
print(f"closed form     {0.25 + mu * exact:.12f}")

# %%
# The way back is another one. Black: rest states of a climate that does not change, dotted where they are
# unstable.
fig, ax = plt.subplots(figsize=(7, 3.6))
for low, high, line in ((-0.1, 0.5, "-"), (0.5, 1, ":"), (1, 1.3, "-")):
    at = np.linspace(low, high, 200)
    ax.plot(np.abs(1 - at) * at, 1 - at, line, color="#000000")
run = sol.sample(names=["F", "q"])
ax.plot(run["F"], run["q"], color="#0072B2", label="slow change")
ax.plot(0.25 + mu * reversal, 0, "o", color="#D55E00", label="reversal")
ax.set(xlabel="fresh water F", ylabel="circulation q", xlim=(-0.08, 0.36))
ax.legend()
plt.show()
