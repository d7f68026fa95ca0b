r"""
Twisting control: second-order sliding mode
===========================================

The twisting algorithm brings a position *and* its rate to zero in finite time, in spite of a bounded
disturbance, with a control that only knows two signs:

.. math::

    \dot x = v, \qquad \dot v = -a \operatorname{sign} x - b \operatorname{sign} v + d(t), \qquad a > b > 0

**When is the target reached?** Without disturbance the path is made of parabolas, each turn a factor
:math:`q = \sqrt{(a - b)/(a + b)}` smaller: infinitely many switchings in the time

.. math::

    T = \frac{v_0}{1 - q} \Bigl(\frac1{a + b} + \frac1{\sqrt{a^2 - b^2}}\Bigr) \quad\text{from } x = 0,\ v = v_0.
"""

# %%
# Most solvers stop or chatter where switchings accumulate; here the limit is computed, and passed.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import System, solve

t, x, v = sp.symbols("t x v", real=True)
d = sp.Symbol("d", real=True)
a, b = 2.0, 1.0
control = System(
    {x: v, v: d * sp.sin(2 * t) - a * sp.sign(x) - b * sp.sign(v)},
    time=t,
    parameters={d: 0},
    outputs={"control": -a * sp.sign(x) - b * sp.sign(v)},
)
sol = solve(control, (0, 6), {x: 0, v: 1}, dense_output=True)
q = np.sqrt((a - b) / (a + b))
exact = (1 / (a + b) + 1 / np.sqrt(a**2 - b**2)) / (1 - q)
reached = sol.event_times("accumulation")[-1]
print(f"at rest from {reached:.12f} after {len(sol.events)} events")
print(f"closed form  {exact:.12f}")

# %%
# With a disturbance it takes longer, and ends as exactly. From then on the mean control is minus the
# disturbance: it is an estimate of it that no filter has delayed.
run = solve(
    control, (0, 6), {x: 0, v: 1}, parameters={d: 0.8}, dense_output=True
)
times = np.linspace(run.event_times("accumulation")[-1], 6, 200)
total = run(times, "control") + 0.8 * np.sin(2 * times)
print(f"x and v: {np.abs(run(times)).max():g}")
print(f"control + d: {np.abs(total).max():.1e}")

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.2))
for name, result, colour in (
    ("d = 0", sol, "#0072B2"),
    ("d = 0.8 sin 2t", run, "#D55E00"),
):
    table = result.sample(names=["x", "v", "control"])
    left.plot(table["x"], table["v"], color=colour, label=name)
    right.plot(table.t, table["control"], color=colour, linewidth=0.8)
left.set(xlabel="x", ylabel="v")
left.legend()
right.set(xlabel="t", ylabel="control (its mean where it slides)")
plt.show()
