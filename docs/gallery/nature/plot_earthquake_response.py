r"""
A building under an earthquake: Bouc and Wen's hysteresis
=========================================================

A storey that yields: a part :math:`\alpha` of its stiffness stays elastic, the rest follows a hysteretic
displacement :math:`z` that saturates at the yield displacement :math:`x_y`:

.. math::

    \ddot x + 2\zeta\omega\dot x + \omega^2\,\bigl(\alpha x + (1 - \alpha) z\bigr) = -a_g(t), \qquad
    \dot z = \dot x - \frac{\beta\,|\dot x|\,z + (1 - \beta)\,\dot x\,|z|}{x_y}

**Where does the energy of the earthquake go?** The record is synthetic: waves with random phases, whose
spectrum has the hump of soft soil and whose strength grows and fades, sampled 50 times a second. One from a
file is read by ``Drive.from_csv``.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Drive, System, solve

x, v, z, ground = sp.symbols("x v z ground", real=True)
E_in, E_damped, E_yield = sp.symbols("E_in E_damped E_yield", real=True)
omega, zeta, alpha, beta, x_y = 2 * np.pi / 0.5, 0.02, 0.1, 0.6, 0.01

# Waves of 0.5 to 8 Hz, each with the share that Kanai and Tajimi's spectrum gives it (soil of 2.5 Hz,
# damping 0.6).
rng = np.random.default_rng(7)
f = np.linspace(0.5, 8, 24)
ratio = (f / 2.5) ** 2
spectrum = (1 + 1.44 * ratio) / ((1 - ratio) ** 2 + 1.44 * ratio)
share = np.sqrt(spectrum / spectrum.sum())
phase = rng.uniform(0, 2 * np.pi, f.size)
times = np.linspace(0, 20, 1001)
waves = share @ np.sin(2 * np.pi * np.outer(f, times) + phase[:, None])
record = 2 * (times / 4) ** 2 * np.exp(2 - times / 2) * waves  # m/s^2

spring = omega**2 * (alpha * x + (1 - alpha) * z)
z_rate = v - (beta * sp.Abs(v) * z + (1 - beta) * v * sp.Abs(z)) / x_y
storey = System(
    {
        x: v,
        v: -ground - 2 * zeta * omega * v - spring,
        z: z_rate,
        E_in: -ground * v,
        E_damped: 2 * zeta * omega * v**2,
        E_yield: omega**2 * (1 - alpha) * z * (v - z_rate),
    },
    drives={ground: Drive(times, record)},
)
sol = solve(storey, (0, 20), {s: 0 for s in storey.states}, dense_output=True)
print(f"largest ground acceleration {np.abs(sol['ground']).max():.2f} m/s^2")
drift = 1e3 * sol["x"]
print(f"largest drift {np.abs(drift).max():.1f} mm, left {drift[-1]:.2f} mm")

# %%
# The balance of energy is not built in; that it closes says much for the run, and so does SciPy's DOP853,
# whose short steps end at the same place.
kept = (
    sol["v"] ** 2 / 2
    + omega**2 * (alpha * sol["x"] ** 2 + (1 - alpha) * sol["z"] ** 2) / 2
)
spent = kept + sol["E_damped"] + sol["E_yield"]
print(f"put in {sol['E_in'][-1]:.9f}, spent {spent[-1]:.9f} J/kg")
print(f"by yielding: {sol['E_yield'][-1] / sol['E_in'][-1]:.0%}")

# %%
fig, (top, loop) = plt.subplots(1, 2, figsize=(7.5, 3.2), width_ratios=(3, 2))
run = sol.sample(names=["x", "z", "ground"])
top.plot(run.t, run["ground"], color="0.6", linewidth=0.8)
top.set(xlabel="t (s)", ylabel="ground acceleration (m/s²)", xlim=(0, 20))
restoring = omega**2 * (alpha * run["x"] + (1 - alpha) * run["z"])
loop.plot(1e3 * run["x"], restoring, color="#0072B2", linewidth=0.8)
loop.set_label("thumbnail")
loop.set(xlabel="drift (mm)", ylabel="restoring force (N/kg)")
plt.show()
