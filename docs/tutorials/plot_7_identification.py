r"""
Parameters from records
=======================

A mass on a spring with friction was driven, and its displacement measured, with some samples missing:

.. math::

    \dot y = v, \qquad \dot v = -\sigma\sin t - k y - c v - N\lambda(1 + \varrho z), \qquad
    \beta\dot z = 1 - \lambda^2 - z

**Which friction, which spring, and how well are they known?** The record is made here from known parameters, so
that the answer can be checked.
"""

# %%
# A record
# --------
# :class:`~pwsmooth.fitting.Record` holds times, samples by the name of a state or output (nan where one is missing),
# their noise, and what is known of the beginning: numbers, or the names of states whose initial value is fitted
# as well.
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.fitting import Record, compare, fit
from pwsmooth.laws.friction import Coulomb, HiddenStatic
from pwsmooth.scenes import friction_oscillator

true = {"rho": 3.0, "beta": 0.1, "F_c": 1.0, "spring": 3.1, "damper": 0.1}
oscillator = friction_oscillator(HiddenStatic(rho=3.0, beta=0.1))
t = np.linspace(0, 40, 401)
rng = np.random.default_rng(4)
y = oscillator.solve(t_eval=t, t_span=(0, 40))["y"] + rng.normal(0, 0.01, t.size)
y[rng.random(t.size) < 0.2] = np.nan
record = Record(t, {"y": y}, unknown=["y", "v"])
record

# %%
# The fit
# -------
# Any :class:`~pwsmooth.System` or scene will do, with several records if there are. Parameters have a first guess;
# ``bounds`` and ``priors`` say what else is known of them. The misfit's slopes are exact: they go through every
# stick and slip of the run.
#
# The record is cut into intervals, and the runs over them need not join at first (multiple shooting). So
# a first guess that would be out of step after a few slips finds its way.
guess = {"rho": 2.2, "beta": 0.15, "F_c": 1.3, "spring": 2.7, "damper": 0.2}
found = fit(oscillator, record, guess)
found

# %%
for name, value in true.items():
    off = (found.values[name] - value) / found.errors[name]
    print(f"{name:8}{value:6.2f}{found.values[name]:9.4f}, off by {off:4.1f} standard errors")

# %%
# Data, model and what remains, with the noise as a band:
found.plot()
plt.show()

# %%
# What the data determine
# -----------------------
# Parameters are seldom known one by one. The singular values of the Jacobian say which products of powers are known
# and which are free; a product that is free has to be fixed, given a prior, or measured otherwise.
found.identifiability()

# %%
# Standard errors belong to the linearised problem. A profile tests them: one parameter is held at other values,
# and all others are fitted again.
profile = found.profile("beta", points=9)
print(f"beta between {profile.interval()[0]:.3f} and {profile.interval()[1]:.3f} at 95 %")
profile.plot()
plt.show()

# %%
# Models side by side
# -------------------
# Would Coulomb friction do? The Bayesian information criterion weighs the misfit against the number of
# parameters; the smallest is the best.
plain = fit(
    friction_oscillator(Coulomb()), record, {"F_c": 1.2, "spring": 3.0, "damper": 0.1}
)
compare({"hidden static": found, "Coulomb": plain})

# %%
# When it does not go well
# ------------------------
# * ``found.success`` and ``found.message`` say how the search ended; Ctrl-C ends it too, with the best until then.
# * Another minimum: the misfit of a stick-slip record has many. Try other first guesses or numbers of ``intervals``,
#   and measure another state.
# * ``found.problems`` lists instants of the runs without a derivative, such as a grazing contact. There the
#   deviation is taken on as it came: the fit goes on, and errors are a little less trustworthy.
# * A law under a prescribed motion has a shorter way, :func:`~pwsmooth.fitting.fit_law`.
