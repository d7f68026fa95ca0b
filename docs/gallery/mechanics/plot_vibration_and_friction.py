r"""
Vibration and friction in the plane
===================================

A block of coefficient :math:`\mu` is dragged at the speed :math:`V` over a plate that vibrates with the velocity
:math:`a\cos\omega t`. Friction acts along the slip,

.. math::

    m\dot v = k\,(Vt - x)\,e_x - \mu m g\,\frac{v - U(t)}{\lvert v - U(t)\rvert},

so that a fast vibration turns it to and fro. **How much of the drag is left, and does it matter in which direction the
plate shakes?** Across the pull it is the fraction

.. math::

    \frac{2}{\pi}\,\frac{s}{\sqrt{1 + s^2}}\,K\!\Bigl(\frac{1}{1 + s^2}\Bigr), \qquad \text{along it}\quad
    \frac{2}{\pi}\arcsin s, \qquad s = \frac{V}{a} < 1 .

**And what lies on a plate that shakes without a pull: where does it go?** Friction of a fast shaking pulls it towards
the plate's velocity from wherever that is, always with the same force: it drifts at the geometric median of the
velocities, not at their mean, which is 0. A plate that lifts while it moves forward carries it on, and a brush on
leaning bristles that shakes up and down runs on its own.
"""

# %%
# The drag that is left
# ---------------------
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.special import ellipk

from pwsmooth.laws.friction import Coulomb
from pwsmooth.plotting import COLOUR
from pwsmooth.scenes import bristle_bot, pulled_block, shaken_plate, t

OMEGA = 150.0
PERIOD = 2 * np.pi / OMEGA


def drag(s, across):
    """Mean force of the spring over its friction F_c = 1, with a = 1."""
    shaking = (0, sp.cos(OMEGA * t)) if across else (sp.cos(OMEGA * t), 0)
    pulled = pulled_block(Coulomb(), (s * t, 0), plate=shaking, k=1.0, c=2.0, period=PERIOD, t_span=(0, 20))
    times = 20 - 50 * PERIOD * (np.arange(10000) + 0.5) / 10000
    return np.mean(pulled.solve(dense_output=True)(times, "pull_x"))


ratios = np.array([0.1, 0.3, 0.5, 0.8, 1.2, 1.8])
left = {across: np.array([drag(float(s), across) for s in ratios]) for across in (True, False)}
fine = np.linspace(0.01, 2, 300)
exact = {
    True: lambda s: 2 / np.pi * s / np.sqrt(1 + s**2) * ellipk(1 / (1 + s**2)),
    False: lambda s: 2 / np.pi * np.arcsin(np.minimum(s, 1)),
}

# %%
# Where a plate that shakes takes what lies on it
# -----------------------------------------------
# The velocity of the plate goes along this curve, 100 times a second, and has the mean 0.
turn = np.linspace(0, 2 * np.pi, 400)
velocity = 3 * np.cos(turn) + 1.5 * np.cos(2 * turn), 2 * np.sin(turn)
plate = (3 * sp.cos(100 * t) + 1.5 * sp.cos(200 * t), 2 * sp.sin(100 * t))
carried = shaken_plate(Coulomb(F_c=0.1), plate, period=2 * np.pi / 100, t_span=(0, 60)).solve(dense_output=True)
times = np.linspace(0, 60, 4000)
drift = [(carried(60, q) - carried(40, q)) / 20 for q in ("x", "y")]
print(f"drift ({drift[0]:.3f}, {drift[1]:.3f}) m/s; the geometric median is (-0.833, 0)")

# %%
# A conveyor: it shakes along x and lifts with a phase between the two.
phases = np.linspace(0, 2 * np.pi, 17)


def speed(phase):
    lift = 6 * sp.cos(30 * t + phase)
    scene = shaken_plate(Coulomb(F_c=0.3), (sp.cos(30 * t) / 4, 0), lift=lift, period=np.pi / 15, t_span=(0, 12))
    run = scene.solve(dense_output=True)
    return (run(12, "x") - run(12 - 20 * np.pi / 15, "x")) / (20 * np.pi / 15)


speeds = [speed(float(phase)) for phase in phases]

# %%
# A bristle-bot: its speed over the rate of the motor, with a stroke of 1 mm. Its tips stand as long as friction can
# give the acceleration of the lean under the load that is left, up to
# :math:`\omega^2 = \mu g/(h\,(\tan\alpha + \mu))`.
rates = np.linspace(40, 98, 30)
robots = {
    mu: [bristle_bot(Coulomb(F_c=mu), omega=float(w), t_span=(0, 4)).solve()["x"][-1] / 4 for w in rates]
    for mu in (0.1, 0.3)
}

held = {mu: float(np.sqrt(mu * 9.81 / (1e-3 * (np.tan(0.5) + mu)))) for mu in robots}

fig, axes = plt.subplots(2, 2, figsize=(7.4, 5.2), layout="constrained")
axes = axes.ravel()
for across, colour, label in ((True, "right", "across the pull"), (False, "left", "along it")):
    axes[0].plot(fine, exact[across](fine), color=COLOUR[colour], label=label)
    axes[0].plot(ratios, left[across], "o", color=COLOUR[colour], markersize=4)
axes[0].set(xlabel=r"$V/a$", ylabel=r"mean drag over $\mu m g$", title="vibration", ylim=(0, 1.05))
axes[0].legend(loc="lower right")
axes[1].plot(*velocity, color=COLOUR["mark"], linewidth=1, label="plate")
axes[1].plot(carried(times, "v_x"), carried(times, "v_y"), color=COLOUR["right"], linewidth=0.8, label="body")
axes[1].plot(-5 / 6, 0, "x", color=COLOUR["exact"], label="geometric median")
axes[1].set(xlabel="velocity along x (m/s)", ylabel="along y (m/s)", title="shaken plate", aspect="equal")
axes[1].legend(loc="center", fontsize=7)
axes[2].plot(phases / np.pi, speeds, "o-", color=COLOUR["right"], markersize=3)
axes[2].axhline(0, color=COLOUR["mark"], linewidth=0.6)
axes[2].set(xlabel=r"phase of the lift ($\pi$)", ylabel="speed (m/s)", title="conveyor")
for (mu, along), dash in zip(robots.items(), ("-", "--"), strict=True):
    axes[3].plot(rates, along, dash, color=COLOUR["right"], label=rf"$\mu = {mu:g}$")
    axes[3].axvline(held[mu], color=COLOUR["stick"], linestyle=dash, linewidth=0.8)
axes[3].set(xlabel="rate of the motor (rad/s)", ylabel="speed (m/s)", title="bristle-bot")
axes[3].legend()
plt.show()

# %%
# The circles are runs with the mass of the block and 150 rad/s, the lines the closed forms of infinitely fast
# vibration. A vibration along the pull takes more of the drag than one across it while it is faster than the block, and
# none once the block outruns the plate, :math:`V > a`; across the pull some is always gained.
