r"""
Drill string: stick-slip of the bit
===================================

Kilometres of pipe twist by :math:`\varphi` between a top drive that turns with :math:`\Omega` and a bit of
speed :math:`\omega`; the torque of the rock falls with the speed of the bit:

.. math::

    \dot\varphi = \Omega - \omega, \qquad J\dot\omega = k\varphi + c\,(\Omega - \omega) - T(\omega), \qquad
    T = \bigl(T_c + (T_s - T_c)\,e^{-|\omega|/\omega_s}\bigr) \operatorname{sign}\omega

Even turning is stable where :math:`c > -T'(\Omega)`, that is, above the Hopf bifurcation at

.. math::

    \Omega_{\rm H} = \omega_s \ln\frac{T_s - T_c}{c\,\omega_s} .

**From which speed on is one rid of stick-slip?** Not from there.
"""

# %%
# The values have the size of a real string (SI units).
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Return, System, find_orbit, follow, solve
from pwsmooth.analysis.continuation import Steps

phi, omega = sp.symbols("phi omega", real=True)
Omega = sp.Symbol("Omega", positive=True)
J, k, c, T_c, T_s, omega_s = 400.0, 500.0, 150.0, 4000.0, 7000.0, 2.0
torque = (T_c + (T_s - T_c) * sp.exp(-sp.Abs(omega) / omega_s)) * sp.sign(
    omega
)
string = System(
    {
        phi: Omega - omega,
        omega: (k * phi + c * (Omega - omega) - torque) / J,
    },
    parameters={Omega: 4},
)
sol = solve(string, (0, 60), {phi: 0, omega: 0}, dense_output=True)

# %%
# The orbit that sticks and slips, followed upwards in the speed of the top drive. Its stick shrinks to
# nothing; what goes on from there slips only, is unstable, and leads back down to :math:`\Omega_{\rm H}`.
orbit = find_orbit(
    string, {phi: 10, omega: 0}, seen=Return(omega - 5), transient=30
)
branch = follow(orbit, {Omega: 10}, steps=Steps(longest=0.05))
highest = branch.values.max()
hopf = omega_s * np.log((T_s - T_c) / (c * omega_s))
print(f"even turning is stable from  Omega = {hopf:.5f} rad/s")
print(f"stick-slip is possible up to Omega = {highest:.5f} rad/s")

# %%
# Between the two a jolt decides. A slip that SciPy's DOP853 integrates from the end of a stick, and that
# just touches rest, gives the same upper speed: the page's test.
size = [np.ptp(o.solution().sample(300)["omega"]) / 2 for o in branch.points]
fig, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.2))
sol.plot(["omega"], [left])
left.set(xlabel="t (s)", ylabel="speed of the bit (rad/s)", xlim=(0, 60))
left.set_title(r"$\Omega = 4$ rad/s")
right.plot(branch.values, size, ":", color="#D55E00", label="unstable")
right.plot(
    branch.values,
    np.where(branch.stable, size, np.nan),
    color="#0072B2",
    label="stick-slip",
)
right.plot([hopf, 9], [0, 0], color="#009E73", label="even turning")
right.set(xlabel=r"top drive $\Omega$ (rad/s)", ylabel="amplitude (rad/s)")
right.legend()
right.set_label("thumbnail")
plt.show()
