r"""
Identifying the LuGre friction law
==================================

Friction force was measured along a slow motion with reversals. LuGre's law has bristles of mean deflection
:math:`z`:

.. math::

    \dot z = v - \sigma_0\,\frac{|v|}{g(v)}\,z, \qquad F = \sigma_0 z + \sigma_1 \dot z + \sigma_2 v, \qquad
    g(v) = F_c + (F_s - F_c)\,e^{-(v/v_s)^2}

**Which parameters, and how well are they known?** The "measurement" is made here, from known parameters and
with a noise of 0.02 N, so that the answer can be checked.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth import Drive
from pwsmooth.fitting import fit_law
from pwsmooth.laws.friction import LuGre
from pwsmooth.scenes import prescribed_motion

t = np.linspace(0, 2, 161)
x = 2e-3 * np.sin(3 * t) * np.sin(t) + 2e-5 * np.sin(14 * t)
true = LuGre(sigma0=8e4, sigma1=250, sigma2=30, F_c=1.2, F_s=1.7, v_s=1.5e-3)
exact = prescribed_motion(true, position=Drive(t, x)).solve(t_eval=t)["force"]
measured = exact + np.random.default_rng(1).normal(0, 0.02, t.size)

# %%
# Six parameters at once, from the textbook's values as a first guess. Every run of the fit is an exact one,
# with the reversals :math:`v = 0` located, and the force along the true law is that of SciPy's Radau.
found = fit_law(LuGre(sigma2=10), t, x, measured)
print(f"{'':8}{'true':>10}{'found':>12}{'error':>10}{'off by':>10}")
for name, value in found.values.items():
    wanted, error = getattr(true, name), found.errors[name]
    off = (value - wanted) / error
    print(f"{name:8}{wanted:10.4g}{value:12.5g}{error:10.2g}{off:8.1f} errors")
print(f"residual {found.rms['force']:.4f} N, {found.runs} runs")

# %%
fig, ax = plt.subplots(figsize=(7, 3.4))
ax.plot(1e3 * x, measured, ".", color="0.55", markersize=4, label="measured")
ax.plot(1e3 * x, found.predicted("force"), color="#0072B2", label="fitted LuGre")
ax.set(xlabel="position (mm)", ylabel="friction force (N)")
ax.legend(loc="center")
plt.show()
