r"""
Burridge and Knopoff's earthquake model
=======================================

A fault as a chain of blocks: each is coupled to its neighbours, pulled by a slowly moving plate, and held
by friction that weakens with speed:

.. math::

    \ddot u_i = \ell^2\,(u_{i+1} - 2u_i + u_{i-1}) + \nu t - u_i
    - \frac{\operatorname{sign} \dot u_i}{1 + 2\alpha|\dot u_i|}

**How are the sizes of its earthquakes distributed?**
"""

# %%
# A chain is written as one element with its neighbours. Blocks stick (exactly) for most of the time and
# slip one after another.
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Family, System, solve

t = sp.Symbol("t", real=True)


def fault(n, ell=3.0, alpha=2.5, nu=0.01):
    """A chain of n blocks with free ends."""
    blocks = Family(n, name="block")
    u, v = blocks.symbols("u v")
    pull = ell**2 * (blocks.neighbour(u, 1) - 2 * u + blocks.neighbour(u, -1))
    friction = sp.sign(v) / (1 + 2 * alpha * sp.Abs(v))
    return System({u: v, v: pull + nu * t - u - friction}, time=t)


n = 100
rng = np.random.default_rng(1)
start = {"u": list(rng.uniform(-0.5, 0.5, n)), "v": 0.0}
sol = solve(fault(n), (0, 2000), start)
print(f"{len(sol.events)} sticks and slips, {sol.cost['steps']} steps")

# %%
# An earthquake begins when a first block slips and ends when all stick again; its moment is the sum of the
# slips.
slips = np.any(sol.status != 0, axis=0)  # from each instant to the next
change = np.diff(slips.astype(int), prepend=0)
ends = np.flatnonzero(change == -1)
begins = np.flatnonzero(change == 1)[: len(ends)]
moved = sol.x[:n, ends] - sol.x[:n, begins]
late = sol.t[begins] > 500
moment, slipped = moved[:, late].sum(axis=0), moved[:, late] > 0
speed = moment.sum() / n / 1500
largest = np.sort(moment)[-len(moment) // 4 :].sum() / moment.sum()
print(f"{len(moment)} earthquakes over up to {slipped.sum(axis=0).max()} blocks")
print(f"mean speed of the fault {speed:.5f}, of the plate 0.01000")
print(f"the largest quarter carries {largest:.1%} of the slip")

# %%
# In the long run the fault keeps up with the plate; but most earthquakes are small, and a few large ones
# carry nearly all. That the chain is solved correctly was seen on three blocks, all of whose sticks and
# slips are where SciPy's DOP853, restarted at each of them, finds them.
fig, (left, right) = plt.subplots(
    1, 2, figsize=(7.5, 3.4), width_ratios=(2, 1)
)
first = np.argmax(slipped, axis=0) + 0.5
last = n - np.argmax(slipped[::-1], axis=0) + 0.5
left.vlines(sol.t[begins[late]], first, last, color="#0072B2", linewidth=1)
left.set(xlabel="t", ylabel="block", title="Ruptures", xlim=(1500, 2000))
right.loglog(
    np.sort(moment)[::-1], np.arange(1, len(moment) + 1), color="#0072B2"
)
right.set(xlabel="moment", ylabel="number of larger ones", title="Sizes")
plt.show()
