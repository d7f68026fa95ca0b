"""The sketches of the scenes: block on a spring, on a belt, a stop, a ball, a slider-crank with its clearance, a chain.

Lengths that no equation has, such as a block's, are chosen for the eye: in proportion to how far the thing moves.

Chain: sketch.py -> **sketches** -> the scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from ..door import checks
from .drive import t
from .sketch import Arrow, Ball, Bar, Belt, Block, Clearance, Ground, Joint, Sketch, Spring

__all__ = ["chain_of_blocks"]


def block_on_spring(y: sp.Symbol, reach: float, strength: float, phase: str) -> Sketch:
    """A block that moves so far, on rough ground, held by a spring and driven by a force `drive`."""
    width, height = 0.8 * reach, 0.5 * reach
    wall = -2.6 * reach
    return Sketch((
        Ground("ground", wall, 0, 2.4 * reach, 0),
        Ground("wall", wall, 1.6 * height, wall, 0),
        Spring("spring", wall, height / 2, y - width / 2, height / 2, width=0.4 * height),
        Block("block", y, height / 2, width, height, phase=phase),
        Arrow("drive", y, 1.35 * height, sp.Symbol("drive", real=True) * reach / (2 * strength), 0),
    ))  # fmt: skip


def block_on_belt(e: sp.Symbol, pull: sp.Symbol, reach: float, phase: str) -> Sketch:
    """The block stands at -e on the belt, and its spring, longer by e, leads to a wall on the right."""
    width, height = 0.8 * reach, 0.5 * reach
    wall = 2.0 * reach
    return Sketch((
        Belt("belt", 2.4 * reach, 0, -3.2 * reach, 0, travel=pull * t, mark=0.4 * reach),
        Ground("wall", wall, 0, wall, 1.6 * height),
        Spring("spring", -e + width / 2, height / 2, wall, height / 2, width=0.4 * height),
        Block("block", -e, height / 2, width, height, phase=phase),
    ))  # fmt: skip


def block_before_a_stop(p: sp.Symbol, d: sp.Symbol, distance: float, reach: float) -> Sketch:
    """A block on a spring whose right side meets a stop at x = d."""
    width, height = 0.7 * reach, 0.5 * reach
    wall = -2.4 * reach - width
    return Sketch((
        Ground("ground", wall, 0, distance, 0),
        Ground("wall", wall, 1.6 * height, wall, 0),
        Ground("stop", d, 0, d, 1.6 * height),
        Spring("spring", wall, height / 2, p + d - width, height / 2, width=0.4 * height),
        Block("block", p + d - width / 2, height / 2, width, height),
    ))  # fmt: skip


def ball_above_ground(p: sp.Symbol, height: float) -> Sketch:
    """A ball of indentation p."""
    radius = 0.1 * height
    return Sketch(
        (Ground("ground", -0.6 * height, 0, 0.6 * height, 0), Ball("ball", 0, radius - p, radius)),
        bounds=(-0.7 * height, 0.7 * height, -0.15 * height, 1.3 * height),
    )


def slider_crank(crank: float, rod: float, clearance: float) -> Sketch:
    """With the journal's way in its bearing, and the gap between them, drawn so large that they are seen."""
    e_x, e_y, x = sp.symbols("e_x e_y x", real=True)
    r, phi = sp.Symbol("r", positive=True), sp.Symbol("omega", positive=True) * t
    seen = 0.25 * crank  # of the gap
    factor, journal = seen / clearance, 0.3 * crank
    pin = r * sp.cos(phi), r * sp.sin(phi)
    bearing = x - factor * e_x, -factor * e_y
    high = 0.9 * crank
    return Sketch(
        (
            Ground("guide", rod - 2.2 * crank, -high / 2, rod + 2.2 * crank, -high / 2),
            Block("slider", x, 0, 1.8 * crank, high),
            Bar("crank", 0, 0, *pin, width=0.2 * crank),
            Bar("rod", *pin, *bearing, width=0.16 * crank),
            Clearance("bearing", *bearing, radius=journal + seen),
            Ball("journal", x, 0, journal),
            Joint("pivot", 0, 0, radius=0.12 * crank),
            Joint("pin", *pin, radius=0.12 * crank),
        ),
        bounds=(-1.4 * crank, 2.4 * crank + rod, -1.5 * crank, 1.5 * crank),
        note=f"clearance drawn {factor:.3g} times too large",
    )


def row_of_balls(positions: Sequence[Any], gap: float) -> Sketch:
    """Balls in a row, of four times the size of the gaps between them."""
    size, n = 4 * gap, len(positions)
    balls = [Ball(f"ball {k + 1}", k * (size + gap) + x, size / 2, size / 2) for k, x in enumerate(positions)]
    return Sketch((Ground("ground", -2 * size, 0, (n + 1) * (size + gap), 0), *balls))


@checks.door()
def chain_of_blocks(positions: Sequence[Any], *, spacing: float = 1.0, switches: Sequence[Any] = ()) -> Sketch:
    """A sketch of blocks in a row, each joined to the next one by a spring, such as those of a Family.

    Parameters
    ----------
    positions : sequence of str or Symbol, length n
        States: how far each block is from its own place.
    spacing : float, in the unit of length
        From one place to the next.
    switches : sequence of str or Symbol, length n, optional
        Whose statuses colour the blocks.

    Returns
    -------
    Sketch
        Blocks "block 1" to "block n" on the ground.

    Raises
    ------
    ValueError
        No positions, another number of switches, or a spacing that is not positive.

    >>> [shape.name for shape in chain_of_blocks(["y_1", "y_2"]).shapes]
    ['ground', 'spring 1', 'block 1', 'block 2']
    """
    places = [
        sp.Symbol(str(checks.key(y, "`positions`")), real=True)
        for y in checks.several(positions, "`positions`")
    ]
    phases = [str(checks.key(s, "`switches`")) for s in checks.several(switches, "`switches`")]
    spacing, n = checks.positive(spacing, "`spacing`"), len(places)
    if not places or (phases and len(phases) != n):
        raise ValueError(
            f"`positions` has {n} names and `switches` {len(phases)}; give one or more, and as many."
        )
    width, height = 0.5 * spacing, 0.4 * spacing
    at = [y + k * spacing for k, y in enumerate(places)]
    springs = [
        Spring(f"spring {k + 1}", a + width / 2, height / 2, b - width / 2, height / 2, width=0.4 * height)
        for k, (a, b) in enumerate(zip(at, at[1:]))
    ]
    blocks = [
        Block(f"block {k + 1}", x, height / 2, width, height, phase=phase)
        for k, (x, phase) in enumerate(zip(at, phases or [""] * n))
    ]
    return Sketch((Ground("ground", -spacing, 0, (n + 0.5) * spacing, 0), *springs, *blocks))
