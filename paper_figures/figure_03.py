"""Figure 3: the mechanism, a mass on a shaken plate: what x, q, y and v are, and which way the drive pushes.

    m x'' = -k (x - q) - c (x' - q') - N mu(v)     (eqs. 11 and 14)

so that y = x - q, v = y' give m v' = -m q'' - k y - c v - N mu(v).
"""

import numpy as np

from pwsmooth.plotting import COLOUR, new_figure

NAME = "3"
TITLE = "The shaken oscillator"
CAPTION = """
A mass m on a plate that is shaken vertically with displacement q(t), held by two springs of together k and a dashpot
c, and pressed against a pillar of the plate by the normal load N. Displacements x of the mass and q of the plate are
counted upwards from rest (dotted); y = x - q stretches the springs, v = y' is the speed of slip, and friction N mu acts
against it. From its eqs. (11) and (14) the source prints v' = q'' - k y - c v - N mu as (15); y = x - q gives -q''. The
other figures keep the printed sign with q'' = -sigma sin(omega t), a shift of the drive by half a period. A drawing
without scale.
"""
Q, X = 0.35, 0.9  # displacements of the plate and of the mass, in units of the drawing
PLATE, MASS = 0.0, 1.75  # upper edge of the plate and lower edge of the mass at rest


def spring(ax, x, bottom, top, coils=5, width=0.16):
    """A zigzag with straight ends."""
    height = np.linspace(bottom + 0.18, top - 0.18, 2 * coils + 2)
    side = np.concatenate([[0], width * (-1.0) ** np.arange(2 * coils), [0]])
    ax.plot(x + np.concatenate([[0], side, [0]]), [bottom, *height, top], color=COLOUR["exact"], linewidth=1.2)


def dashpot(ax, x, bottom, top, width=0.2):
    """A cup on the plate, and a piston in it."""
    line = dict(color=COLOUR["exact"], linewidth=1.2)
    middle = (bottom + top) / 2
    ax.plot([x, x], [bottom, bottom + 0.35], **line)
    ax.plot(
        [x - width, x - width, x + width, x + width],
        [middle + 0.35, *2 * [bottom + 0.35], middle + 0.35],
        **line,
    )
    ax.plot([x - 0.8 * width, x + 0.8 * width], [middle, middle], color=COLOUR["exact"], linewidth=2.5)
    ax.plot([x, x], [middle, top], **line)


def arrow(ax, start, end, colour, style="-|>"):
    """A straight arrow."""
    look = dict(arrowstyle=style, color=colour, linewidth=1.5, shrinkA=0, shrinkB=0, mutation_scale=11)
    ax.annotate("", end, start, arrowprops=look)


def displacement(ax, x, start, size, name, reach):
    """An arrow from the dotted level of rest to where the part is now."""
    ax.plot([x - 0.25, reach], [start, start], ":", color=COLOUR["mark"], linewidth=1.0)
    ax.plot([x - 0.25, reach], [start + size] * 2, color=COLOUR["mark"], linewidth=0.6)
    arrow(ax, (x, start), (x, start + size), COLOUR["exact"])
    ax.text(x - 0.12, start + size / 2, name, ha="right", va="center")


def draw(fast):
    """Plate, mass, what is between them, and the forces."""
    from matplotlib.patches import Rectangle

    figure = new_figure(4.4, 3.7)
    ax = figure.subplots()
    ax.set_axis_off()
    plate, low = PLATE + Q, MASS + X
    high = low + 1.0
    solid = dict(facecolor="#E6E6E6", edgecolor=COLOUR["exact"], linewidth=1.2)
    ax.add_patch(Rectangle((0, plate - 0.35), 4.1, 0.35, hatch="////", **solid))
    ax.add_patch(Rectangle((3.7, plate), 0.4, high + 0.35 - plate, hatch="////", **solid))
    ax.add_patch(Rectangle((0.3, low), 2.5, 1.0, **solid | {"facecolor": "#BDBDBD"}))
    ax.text(1.2, low + 0.5, r"$m$", ha="center", va="center", fontsize=11)
    for x in (0.65, 1.35):
        spring(ax, x, plate, low)
    ax.text(1.0, (plate + low) / 2, r"$\frac{k}{2}$", ha="center", va="center", fontsize=12)
    ax.text(0.3, (plate + low) / 2, r"$\frac{k}{2}$", ha="center", va="center", fontsize=12)
    dashpot(ax, 2.15, plate, low)
    ax.text(2.5, (plate + low) / 2, r"$c$", ha="left", va="center", fontsize=11)

    # The slider: a pad, pressed from the pillar against the mass.
    ax.add_patch(Rectangle((2.8, low + 0.2), 0.16, 0.6, facecolor=COLOUR["mark"], edgecolor=COLOUR["exact"]))
    arrow(ax, (3.7, low + 0.5), (2.98, low + 0.5), COLOUR["right"])
    ax.text(3.35, low + 0.6, r"$N$", ha="center", va="bottom", color=COLOUR["right"])
    arrow(ax, (2.62, low + 0.85), (2.62, low + 0.15), COLOUR["left"])
    ax.text(2.54, low + 0.5, r"$N\mu(v)$", ha="right", va="center", color=COLOUR["left"])

    displacement(ax, -0.35, PLATE - 0.35, Q, r"$q(t)$", 0.0)
    displacement(ax, -0.35, MASS, X, r"$x$", 0.3)
    arrow(ax, (0.9, high + 0.1), (0.9, high + 0.6), COLOUR["stick"])
    ax.text(1.05, high + 0.36, r"$v=\dot y=\dot x-\dot q$", va="center", color=COLOUR["stick"])
    told = (
        r"$y=x-q$:  $m\dot v=-m\ddot q-ky-cv-N\mu(v)$"
        "\n"
        r"printed as (15), $m=1$:  $\dot v=+\ddot q-ky-cv-N\mu(v)$"
    )
    ax.text(1.7, PLATE - 0.75, told, ha="center", va="top", fontsize=9, linespacing=1.6)
    ax.set(xlim=(-1.3, 4.7), ylim=(PLATE - 1.75, high + 0.75), aspect="equal")
    return figure, []
