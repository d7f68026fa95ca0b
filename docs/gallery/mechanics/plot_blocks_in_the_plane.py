r"""
A block on an incline, and a block on a plate
=============================================

A block is thrown across an incline that friction could hold: :math:`\mu = \kappa\tan\alpha`,
:math:`\kappa > 1`. **Where does it stop?** It turns downhill while it slows down, and there is a
closed form: after the time :math:`\kappa v_0/(G(\kappa^2 - 1))`, :math:`v_0^2/(4G(\kappa^2 - 1))` farther
down and :math:`2\kappa v_0^2/(G(4\kappa^2 - 1))` across, with :math:`G = g\sin\alpha`.

And a block slides onto a plate that lies on the ground: **does it take the plate along?** Two contacts, each of which
drives the other,

.. math::

    m\,\dot u = -\mu_1 m g\,\lambda_1, \qquad M\,\dot w = \mu_1 m g\,\lambda_1 - \mu_2 (m + M) g\,\lambda_2,

with :math:`\lambda_1` along :math:`u - w` and :math:`\lambda_2` along :math:`w`. Where both move askew, the plate is
drawn along a curve.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np

from pwsmooth.laws.friction import Coulomb
from pwsmooth.plotting import COLOUR
from pwsmooth.scenes import incline, stacked_plates

fig, axes = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
SLOPE = 0.3
pull = 9.81 * np.sin(SLOPE)
misses = []
for kappa in (1.05, 1.2, 1.5, 2.5):
    run = incline(Coulomb(F_c=kappa * np.tan(SLOPE)), slope=SLOPE, t_span=(0, 20)).solve(dense_output=True)
    stop = run.event_times("stick")[0]
    times = stop * (1 - np.linspace(1, 0, 300) ** 2)
    axes[0].plot(run(times, "y"), run(times, "x"), color=COLOUR["right"])
    down, across = 1 / (4 * (kappa**2 - 1)) / pull, 2 * kappa / (4 * kappa**2 - 1) / pull
    axes[0].plot(across, down, "o", color=COLOUR["mark"], markersize=4)
    axes[0].annotate(rf"{kappa:g}", (across, down), xytext=(5, -3), textcoords="offset points")
    misses += [run["x"][-1] - down, run["y"][-1] - across, stop - kappa / (kappa**2 - 1) / pull]
axes[0].invert_yaxis()
axes[0].set(xlabel="across (m)", ylabel="downhill (m)", title=r"incline, with $\mu/\tan\alpha$")
print(f"farthest from the closed form: {np.abs(misses).max():.1e}")

# The block comes in at 2 m/s along x, the plate is pushed off at 1 m/s along y.
stack = stacked_plates(Coulomb(F_c=0.4), Coulomb(F_c=0.1), block=(2, 0), plate=(0, 1))
run = stack.solve(dense_output=True)
marks = [*run.event_times("stick")]
print(", ".join(f"{event.switch} {event.kind}s at {event.time:.6f}" for event in run.events))
times = np.linspace(0, marks[-1], 600)
for body, colour in (("b", "right"), ("p", "left")):
    path = run(times, f"x_{body}"), run(times, f"y_{body}")
    axes[1].plot(*path, color=COLOUR[colour], label={"b": "block", "p": "plate"}[body])
    for mark in marks:
        axes[1].plot(run(mark, f"x_{body}"), run(mark, f"y_{body}"), "o", color=COLOUR[colour], markersize=4)
axes[1].set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="block and plate")
axes[1].legend()
plt.show()

# %%
# Circles: the block begins to ride on the plate, and both stand. From the first on they move as one body, straight on.
