"""
Sticks in the plane are born by grazing
=======================================

A block on springs is driven around an ellipse, and dry friction holds it back. With little friction it never stops: its
velocity turns once in a period and keeps away from 0. **How does it come to stop**, as a block on a line does twice a
period under any friction?

The velocity 0 is two conditions at once, so that a motion passes by in general. On the branch of its orbits over the
friction it gets there nevertheless, at the one value at which the force is on the friction circle just when the
velocity is 0: a stick of no length is born, a *grazing-sliding bifurcation* in the plane.
"""

# %%
import matplotlib.pyplot as plt
import numpy as np
import sympy as sp

from pwsmooth import Disc, Strobe, System, find_orbit, follow
from pwsmooth.plotting import COLOUR

t, x, y, u, v = sp.symbols("t x y u v", real=True)
mu = sp.Symbol("mu", positive=True)
lam = Disc("lam", (u, v))
force = sp.Rational(8, 5) * sp.cos(t / 4), sp.sin(t / 4)
block = System(
    {x: u, y: v, u: force[0] - x - mu * lam[0], v: force[1] - y - mu * lam[1]}, time=t, parameters={mu: 1}
)
search = dict(seen=Strobe(8 * sp.pi, symmetry={x: -x, y: -y, u: -u, v: -v}), transient=20)
orbit = find_orbit(block, {x: 0.3, y: 0.1, u: 0.5, v: -0.4}, **search)
branch = follow(orbit, {mu: 1.25})
born = branch.of_kind("grazing-sliding")
print(*born, sep="\n")

# %%
# Paths over a period, and the speed. Beyond the first value the block rests at two places of its path, beyond the
# second at four.
strengths = (1.0, 1.19, 1.25)
orbits = [find_orbit(block.with_parameters({mu: s}), orbit.x, **search) for s in strengths]
fig, (path, speed) = plt.subplots(1, 2, figsize=(7.4, 3.2), layout="constrained")
for strength, one, colour in zip(strengths, orbits, (COLOUR["left"], COLOUR["right"], COLOUR["mark"]), strict=True):
    run = one.solution(2 if one.symmetric else 1, dense_output=True)
    times = np.linspace(0, 8 * np.pi, 3000)
    path.plot(run(times, "x"), run(times, "y"), color=colour, linewidth=1, label=rf"$\mu$ = {strength:g}")
    speed.semilogy(times, np.hypot(run(times, "u"), run(times, "v")), color=colour)
    for stop in run.event_times("stick"):
        path.plot(run(stop, "x"), run(stop, "y"), "o", color=colour, markersize=4)
path.set(xlabel="x", ylabel="y", aspect="equal")
speed.set(xlabel="t", ylabel="speed", ylim=(1e-5, 1))
fig.legend(*path.get_legend_handles_labels(), loc="outside upper center", ncols=3)
plt.show()
