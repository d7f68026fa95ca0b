r"""
Add a figure
============

A figure of this project is one file that draws *and judges*: ``paper_figures/figure_NAME.py``
with ``NAME``, ``TITLE``, ``CAPTION`` and ``draw(fast)``, which returns a matplotlib figure and the
*claims* that it checks, each a statement of the source beside what the equations give. The gallery
and the replication report are made from these files; nothing is entered twice.

Below is a whole figure: the amplitude of a dry-friction oscillator, for which the source (Den Hartog
1931) has a closed form,

.. math::

    \ddot x + x = \sin \omega t - F \operatorname{sign} \dot x,

.. math::

    a = \sqrt{V^2 - F^2 U^2}, \quad V = \frac{1}{1 - \omega^2}, \quad
    U = \frac{1}{\omega}\,\frac{\sin(\pi/\omega)}{1 + \cos(\pi/\omega)} .
"""

# %%
# The file
# --------
import math

import numpy as np
import sympy as sp

from paper_figures.claims import Claim
from pwsmooth import Strobe, System, find_orbit
from pwsmooth.plotting import COLOUR, new_figure

NAME = "den-hartog"
TITLE = "Amplitude of a dry-friction oscillator"
CAPTION = """
Largest displacement of the symmetric periodic orbit without sticking, F = 0.3: Den Hartog's closed form
(line) and the periodic orbits of the event-driven solver (points).
"""

t, x, v = sp.symbols("t x v", real=True)
w, F = sp.symbols("w F", positive=True)
dry = System(
    {x: v, v: -x + sp.sin(w * t) - F * sp.sign(v)},
    time=t,
    parameters={w: 0.7, F: 0.3},
)


def closed(omega, force=0.3):
    """Den Hartog's amplitude."""
    V = 1 / (1 - omega**2)
    U = math.tan(math.pi / (2 * omega)) / omega
    return math.sqrt(V**2 - (force * U) ** 2)


def computed(omega):
    """Amplitude of the periodic orbit that the solver finds."""
    orbit = find_orbit(
        dry.with_parameters({w: omega}),
        {x: 1, v: 0.5},
        seen=Strobe(2 * sp.pi / w, symmetry={x: -x, v: -v}),
        transient=30,
    )
    return np.abs(orbit.solution()["x"]).max()


def draw(fast):
    """The curve and the points; one claim a point."""
    omegas = np.linspace(0.6, 0.9, 4 if fast else 13)
    amplitudes = [computed(omega) for omega in omegas]
    figure = new_figure(6, 3)
    ax = figure.subplots()
    fine = np.linspace(0.58, 0.92, 200)
    ax.plot(fine, [closed(omega) for omega in fine], color=COLOUR["exact"])
    ax.plot(omegas, amplitudes, "o", color=COLOUR["right"])
    ax.set(xlabel="ω", ylabel="amplitude")
    # 1e-8: ten times the relative tolerance of a run.
    claims = [
        Claim.number(
            f"amplitude at w = {omega:.3g}", closed(omega), a, 1e-8, digits=10,
            origin="printed", where="Den Hartog 1931",
        )  # fmt: skip
        for omega, a in zip(omegas, amplitudes)
    ]
    return figure, claims


# %%
# Run it
# ------
# ``pwsmooth figures den-hartog`` would draw it into a folder, with the table of claims. What
# that command does is below; ``figure.savefig("den-hartog.png")`` writes what is shown here.
from pwsmooth.plotting import style

with style():
    figure, claims = draw(fast=True)
for claim in claims:
    print(
        f"{claim.statement}: {claim.source}, ours {claim.ours}, {claim.verdict}"
    )
# sphinx_gallery_start_ignore
assert all(claim.holds for claim in claims)
# The house's figures need no display, and pyplot does not know them: show what was drawn.
import io

import matplotlib.pyplot as plt

buffer = io.BytesIO()
figure.savefig(buffer, dpi=200)
buffer.seek(0)
shown = plt.figure(figsize=figure.get_size_inches(), layout="none")
ax = shown.add_axes((0, 0, 1, 1), title=TITLE)
ax.imshow(plt.imread(buffer), aspect="auto")
ax.axis("off")
plt.show()
# sphinx_gallery_end_ignore

# %%
# A claim says where its value comes from, and why it differs
# ------------------------------------------------------------
# A replication reports what the equations give. Its claims have an `origin`: ``printed`` in a source
# (which section or equation is required), ``derived``, an ``independent`` computation, a
# ``reconstruction``, or an ``identity``, which is a check of the code. They are counted apart, and
# only what is printed can be called reproduced. Where a value does not come out, the claim says
# so with a reason, and the report shows both; without a reason there is no such claim.
try:
    Claim("the peak lies at 1.2", "1.2", "1.3", holds=False)
except ValueError as error:
    print(error)

# %%
# To make it part of the project: save the file as ``paper_figures/figure_den_hartog.py``.
# ``pwsmooth figures --list`` finds it, and the next build of these pages shows it in the
# gallery and in the replication report.
