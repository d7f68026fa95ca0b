"""Assemblies: many elements of one kind, of which an event concerns the neighbourhood alone.

    m x_i'' = coupling sum_j (x_j - x_i) - spring x_i - f(x_i' - pull)        blocks on a belt, in a row or a lattice
    u_i' = drive - leak u_i;   at u_i = 1 it fires: u_i = 0, and each neighbour gets share u_i
    m_i x_i'' = R_(i-1) - R_i,   0 <= gap + x_(i+1) - x_i  complementary to  R_i >= 0          balls in a row

    m v_i' = F_(i+1) lambda_(i+1) - F_i lambda_i,  lambda_i = sign(v_i - v_(i-1))              plates that rub

    V_i of rate-and-state friction, quasi-dynamic: creep and slip over 19 decades of speed      sliders in a row

They are small enough for a page by default; with `record=` a run of a hundred thousand elements is one of seconds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from ..definition.families.family import Family
from ..definition.primitives import Event, Switch, Unilateral
from ..door import checks
from ..laws import Law
from ..system import System
from . import sketches
from .drive import OF_FRICTION, check_continuous, door, expression, t
from .scene import Scene, scene_of

mass, spring, link, speed = sp.symbols("mass spring coupling pull", positive=True)
_NUMBERS = dict.fromkeys(("k", "coupling", "pull", "rough"), checks.positive)
_FEW = 60  # blocks that are told apart in a sketch


def _blocks(name, law, family, stretch, values, rough, seed, t_span, in_a_row=False):
    """The scene of blocks on a belt; `stretch(x)` is the sum of the ways to the neighbours."""
    x, v = family.symbols("x v")
    pieces = law.attach(position=x - speed * t, velocity=v - speed, time=t)
    rates = {x: v, v: (link * stretch(x) - spring * x - pieces.force) / mass}
    places = rough * np.random.default_rng(seed).uniform(-1, 1, family.n)
    names = [family.at(x, k) for k in range(1, family.n + 1)] if in_a_row and family.n <= _FEW else []
    return scene_of(
        name, law, t_span, rates, [pieces], ("x", "v"), parameters=dict(zip((mass, spring, link, speed), values)),
        x0=dict(zip(family.at(x, slice(None)), places.tolist())) | {v: values[-1]},
        sketch=sketches.chain_of_blocks(names) if names else None,
    )  # fmt: skip


@door(
    "m",
    law=OF_FRICTION,
    n=checks.integer(2, 10**7),
    seed=checks.integer(0, 2**31),
    periodic=checks.flag,
    **_NUMBERS,
)
def block_train(
    law: Law, *, n: int = 20, k: float = 1.0, coupling: float = 2.0, m: float = 1.0, pull: float = 0.1,
    rough: float = 0.5, seed: int = 0, periodic: bool = False, t_span: tuple[float, float] = (0.0, 60.0),
) -> Scene:  # fmt: skip
    """Blocks in a row on a belt, each on a spring of its own and joined to the next ones: Burridge and Knopoff's train.

    Parameters
    ----------
    n : int
        Blocks, at least 2.
    periodic : bool
        The last block is joined to the first one.

    Returns
    -------
    Scene
        States x, v and the law's, of each block.

    Raises
    ------
    ValueError, TypeError
        A number that is not positive; a law with elements of its own.

    Notes
    -----
    With a `Recorder`, or from 1000 blocks on, an event costs its neighbourhood (`VelocityWeakening`, `Coulomb`,
    `StaticKinetic`, ...); the `avalanches` of the catalogue are the earthquakes, with the pull as their `drift`.

    Source: Burridge, Knopoff, Bull. Seismol. Soc. Am. 57 (1967) 341-371.

    >>> train = block_train(VelocityWeakening(F_s=1.2), n=200, t_span=(0, 20))
    >>> quakes = train.solve(record=Recorder()).catalogue.avalanches(drift=0.1)
    >>> bool(quakes.area.max() > 1)
    True
    """
    family = Family(n, periodic=periodic)
    return _blocks(
        "train of blocks", law, family, lambda x: family.neighbour(x, 1) - 2 * x + family.neighbour(x, -1),
        (m, k, coupling, pull), rough, seed, t_span, in_a_row=True,
    )  # fmt: skip


@door("m", law=OF_FRICTION, seed=checks.integer(0, 2**31), periodic=checks.flag, **_NUMBERS)
def block_lattice(
    law: Law, *, shape: tuple[int, ...] = (6, 6), k: float = 1.0, coupling: float = 0.5, m: float = 1.0,
    pull: float = 0.1, rough: float = 0.5, seed: int = 0, periodic: bool = False,
    t_span: tuple[float, float] = (0.0, 60.0),
) -> Scene:  # fmt: skip
    """Blocks on a belt in a rectangular lattice, each with one displacement, along the belt.

    Parameters
    ----------
    shape : sequence of int
        Blocks along each axis.

    Returns
    -------
    Scene
        States x, v and the law's, of each block, row by row.

    Raises
    ------
    ValueError, TypeError
        A number that is not positive; a law with elements of its own.

    >>> plate = block_lattice(StaticKinetic(F_s=1.2), shape=(12, 12), t_span=(0, 20))
    >>> bool(plate.solve(record=Recorder()).catalogue.avalanches(drift=0.1).area.max() > 1)
    True
    """
    shape = tuple(checks.whole(side, "`shape`", 1) for side in checks.several(shape, "`shape`"))
    family = Family(math.prod(shape))
    links = family.lattice(shape, periodic)
    return _blocks(
        "lattice of blocks", law, family, lambda x: links.sum(lambda at: at(x) - x), (m, k, coupling, pull), rough,
        seed, t_span,
    )  # fmt: skip


@door(
    seed=checks.integer(0, 2**31), periodic=checks.flag, share=checks.positive, drive=checks.positive,
    leak=checks.number,
)  # fmt: skip
def firing_lattice(
    *, shape: tuple[int, ...] = (8, 8), share: float = 0.2, drive: float = 1.0, leak: float = 0.1, seed: int = 0,
    periodic: bool = False, t_span: tuple[float, float] = (0.0, 10.0),
) -> Scene:  # fmt: skip
    """Elements that are charged, fire when they are full, and give a share of what they have to each neighbour.

    Parameters
    ----------
    shape : sequence of int
        Elements along each axis; one number makes a chain.
    share : float, dimensionless
        What each neighbour gets of what fires, > 0; less than 1 in all, of 2 neighbours along each axis.
    drive : float, 1/s
        Rate of charging, > leak.
    leak : float, 1/s
        Rate of loss, >= 0.
    seed : int
        Of the random charges at the start, between 0 and 1.

    Returns
    -------
    Scene
        State u of each element; all that fires at one instant is an avalanche.

    Raises
    ------
    ValueError
        Elements that give all they have or more, or that never fire.

    Notes
    -----
    u' = drive - leak u; at u = 1 an element fires: it is put to 0, and each neighbour gets share u, which may make it
    fire at the same instant. In lattices what fires of one avalanche together never has a common link, so that every
    order of it gives the same. Two neighbours that are full at once by themselves both set and add: they fire in the
    order of their numbers, and the run records the ambiguity. For the same reason pulses of one size to all of many
    elements that fire together have no form here.

    Source: Olami, Feder, Christensen, Phys. Rev. Lett. 68 (1992) 1244-1247, where leak = 0.

    >>> run = firing_lattice(shape=(12, 12)).solve(t_eval=[0, 10])
    >>> len(run.events) > 1000 and not run.ambiguities
    True
    """
    shape = tuple(checks.whole(side, "`shape`", 1) for side in checks.several(shape, "`shape`"))
    if not share * 2 * len(shape) < 1:
        raise ValueError(
            f"`share` is {share:g} for each of {2 * len(shape)} neighbours; give less than {1 / (2 * len(shape)):g}, "
            "so that avalanches end."
        )
    if not drive > leak:
        raise ValueError(f"`drive` is {drive:g}, `leak` {leak:g}; give drive > leak, so that elements fill.")
    family = Family(math.prod(shape))
    (u,) = family.symbols("u")
    links = family.lattice(shape, periodic)
    beside = [links.neighbour(u, j) for j in range(1, 2 * len(shape) + 1)]
    given, rate, loss = sp.symbols("share drive leak", nonnegative=True)
    fire = Event(
        u - 1, direction=1, update={u: 0} | {other: other + given * u for other in beside}, name="fire",
        together="add",
    )  # fmt: skip
    system = System({u: rate - loss * u}, parameters={given: share, rate: drive, loss: leak}, events=[fire])
    start = np.random.default_rng(seed).uniform(0, 1, family.n)
    return Scene(
        "lattice that fires", system, dict(zip(system.groups["u"], start.tolist())), t_span,
        units={"u": "1", "share": "1", "drive": "1/s", "leak": "1/s"},
        note="Olami, Feder, Christensen, Phys. Rev. Lett. 68 (1992) 1244-1247, with a leak",
    )  # fmt: skip


@door(
    "m", n=checks.integer(2, 10**7), restitution=checks.nonnegative, stiffness=checks.optional(checks.positive),
    **dict.fromkeys(("gap", "speed", "taper"), checks.positive),
)  # fmt: skip
def granular_chain(
    *, n: int = 10, restitution: float = 1.0, stiffness: float | None = None, m: float = 1.0, taper: float = 1.0,
    gap: float = 0.1, speed: float = 1.0, t_span: tuple[float, float] = (0.0, 2.0),
) -> Scene:  # fmt: skip
    """Balls at rest in a row, the first of which is struck: a blow runs from ball to ball.

    Parameters
    ----------
    n : int
        Balls, at least 2.
    restitution : float, dimensionless
        Of two balls that meet, between 0 and 1.
    stiffness : float, N/m, optional
        Balls that touch are springs that push, instead of rigid ones; > 0.
    m : float, kg
        Mass of the first ball, > 0.
    taper : float, dimensionless
        Mass of each ball over that of the one before, > 0.
    gap : float, m
        Between two balls, > 0.
    speed : float, m/s
        Of the first ball at the start, > 0.

    Returns
    -------
    Scene
        States x (from its place) and v of each ball; outputs `energy` and `momentum`.

    Raises
    ------
    ValueError
        A restitution above 1; one below 1 of balls that are springs.

    Notes
    -----
    Of rigid balls each is struck once by the blow: v_(i+1) = (1 + e) v_i/(1 + m_(i+1)/m_i), after gap/v_i on the way.
    With equal masses and e = 1 the last one leaves with the speed of the first, Newton's cradle. Where e < 1 the balls
    behind catch up, and come to rest on each other in clusters.

    Balls that become smaller pass a blow on faster:

    >>> run = granular_chain(n=20, taper=0.9).solve(t_eval=[0, 2])
    >>> print(f"{run['v_20'][-1]:.6f}; {(2 / 1.9)**19:.6f}")
    2.650034; 2.650034
    """
    if restitution > 1:
        raise ValueError(f"`restitution` is {restitution:g}; give 0 to 1.")
    if stiffness is not None and restitution < 1:
        raise ValueError(
            f"`restitution` is {restitution:g}, of balls that are springs; leave it or `stiffness` out."
        )
    family = Family(n)
    x, v = family.symbols("x v")
    (own,) = family.symbols("mass", positive=True)
    room, e, k = sp.symbols("gap restitution stiffness", nonnegative=True)
    after, before = room + family.neighbour(x, 1) - x, room + x - family.neighbour(x, -1)
    values = {own: [m * taper**i for i in range(n)], room: gap}
    contacts: list[Unilateral] = []
    if stiffness is None:
        contact = Unilateral(after, restitution=e, name="R")
        contacts, values[e] = [contact], restitution
        force = family.neighbour(contact.reaction, -1) - contact.reaction
    else:
        values[k] = stiffness
        force = k * (sp.Max(0, -before) - sp.Max(0, -after))
    outputs = {"energy": family.sum(own * v**2 / 2), "momentum": family.sum(own * v)}
    system = System({x: v, v: force / own}, parameters=values, contacts=contacts, outputs=outputs)
    start = dict.fromkeys([*system.groups["x"], *system.groups["v"]], 0.0) | {"v_1": speed}
    names = [family.at(x, i) for i in range(1, n + 1)] if n <= _FEW else []
    return Scene(
        "chain of balls", system, start, t_span, observables={name: name for name in outputs},
        units={"x": "m", "v": "m/s", "mass": "kg", "gap": "m", "restitution": "1", "stiffness": "N/m", "energy": "J",
               "momentum": "kg m/s"},
        note="Newton's law of impact, from ball to ball",
        sketch=sketches.row_of_balls(names, gap) if names else None,
    )  # fmt: skip


@door(
    "m",
    n=checks.integer(2, 128),
    shear=checks.positive,
    **dict.fromkeys(("clamp", "weight"), checks.nonnegative),
)
def plate_stack(
    *, n: int = 20, m: float = 1.0, shear: float = 0.1, clamp: float = 1.0, weight: float = 0.0,
    t_span: tuple[float, float] = (0.0, 25.0),
) -> Scene:  # fmt: skip
    """Plates that slide on each other, ever faster towards the top, and come to rest on the ground.

    Parameters
    ----------
    n : int
        Plates, 2 to 128.
    m : float, kg
        Mass of a plate, > 0.
    shear : float, m/s
        Speed of each plate over that of the one below at the start, > 0.
    clamp : float, N
        Friction between any two plates that a clamp presses together, >= 0.
    weight : float, N
        Friction that the weight of one plate makes in all joints below it, >= 0; one of the two is > 0.

    Returns
    -------
    Scene
        States x and v of each plate, from the ground up; output `slip`, the speeds of all joints added up.

    Raises
    ------
    ValueError
        No friction.

    Notes
    -----
    What slides above and below pulls a clamped plate both ways alike: only the highest one is slowed down. It sticks
    to the next one after m shear/clamp, both together to the one below that after twice as long, so that k plates move
    as one from k (k - 1)/2 m shear/clamp on: rest comes from above, ever more slowly. Their own weight holds lower
    joints harder; all slow down alike, and the joints close one after the other from below, every m shear/weight.

    >>> run = plate_stack(n=20, clamp=1.0).solve((0, 25))
    >>> print(len(run.events), f"{run.events[-1].time:.6f}", run.events[0].switch)
    20 21.000000 joint_20
    """
    if clamp + weight == 0:
        raise ValueError("`clamp` and `weight` are 0; give friction, at least one of the two > 0.")
    family = Family(n)
    x, v = family.symbols("x v")
    (own,) = family.symbols("friction", nonnegative=True)
    joint = Switch("joint", v - family.neighbour(v, -1, outside=0))
    above = family.neighbour(own, 1, outside=0) * family.neighbour(joint, 1)
    system = System(
        {x: v, v: (above - own * joint) / mass},
        parameters={own: [clamp + weight * (n - i) for i in range(n)], mass: m},
        outputs={"slip": family.sum(sp.Abs(v - family.neighbour(v, -1, outside=0)))},
    )
    start = {f"x_{i}": 0.0 for i in range(1, n + 1)} | {f"v_{i}": shear * i for i in range(1, n + 1)}
    return Scene(
        "stack of plates", system, start, t_span, observables={"slip": "slip"},
        units={"x": "m", "v": "m/s", "friction": "N", "mass": "kg", "slip": "m/s"},
        note="Coulomb's law in every joint",
    )  # fmt: skip


@door(
    n=checks.integer(2, 10**7), periodic=checks.flag, seed=checks.integer(0, 2**31), coupling=checks.nonnegative,
    rough=checks.nonnegative, **dict.fromkeys(("k", "a", "b", "damping"), checks.positive),
)  # fmt: skip
def rate_state_train(
    *, n: int = 10, k: float = 0.2, coupling: float = 0.1, a: float = 0.01, b: float = 0.02, damping: float = 5.4e-11,
    rough: float = 0.5, seed: int = 0, periodic: bool = False, t_span: tuple[float, float] = (0.0, 400.0),
) -> Scene:  # fmt: skip
    """Sliders of rate-and-state friction in a row, which creep, slip and load each other.

    Parameters
    ----------
    n : int
        Sliders, at least 2.
    k : float, dimensionless
        Spring of each to what pulls, of the critical stiffness (b - a) sigma/D_c, > 0.
    coupling : float, dimensionless
        Spring between neighbours, of the same, >= 0.
    a, b : float, dimensionless
        Direct effect and evolution of friction, 0 < a < b.
    damping : float, dimensionless
        By waves that run away: of the stress at the speed of the pull, over sigma; > 0.
    rough : float, dimensionless
        Largest log of the initial speeds, drawn at random, >= 0.
    seed : int
        Of these.
    periodic : bool
        The last slider is a neighbour of the first.
    t_span : (float, float), dimensionless
        Suggested span, in D_c over the speed of the pull.

    Returns
    -------
    Scene
        States `log_rate` and `log_state` of each slider, logs of its speed over that of the pull and of the age of its
        contacts; output `mean_rate`. An event `slip` where a speed rises to e^10 of the pull's.

    Raises
    ------
    ValueError
        An a that is not less than b: nothing weakens.

    Notes
    -----
    Steady creep is stable if k >= 1; below, modes of the row with k + 4 coupling sin^2(pi m/(2 n)) < 1 grow (m = 0 is
    all alike), so that a coupling of (1 - k)/(4 sin^2(pi/(2 n))) and more leaves only the one in which all slip
    together.

    Source: Ruina, J. Geophys. Res. 88 (1983) 10359-10370 (critical stiffness); Rice, J. Geophys. Res. 98 (1993)
    9885-9907 (quasi-dynamic damping).

    >>> run = rate_state_train(n=5, rough=0).solve((0, 300))
    >>> print(len(run.events), f"{run.events[5].time - run.events[0].time:.4f}")
    15 132.8624
    """
    if not a < b:
        raise ValueError(f"`a` is {a:g}, `b` {b:g}; give a < b, so that friction weakens.")
    family = Family(n, periodic=periodic)
    rate, state = family.symbols("log_rate log_state")
    own, beside, direct, evolution, loss = sp.symbols("k coupling a b damping", nonnegative=True)
    moves, ages = sp.exp(rate), sp.exp(-state)
    stretch = sum(sp.exp(family.neighbour(rate, side)) - moves for side in (-1, 1))
    load = (evolution - direct) * (own * (1 - moves) + beside * stretch)
    rates = {state: ages - moves, rate: (load - evolution * (ages - moves)) / (direct + loss * moves)}
    system = System(
        rates, parameters={own: k, beside: coupling, direct: a, evolution: b, loss: damping},
        events=[Event(rate - 10, direction=1, name="slip")], outputs={"mean_rate": family.sum(moves) / n},
    )  # fmt: skip
    start = dict.fromkeys(system.groups["log_state"], 0.0)
    speeds = rough * np.random.default_rng(seed).uniform(-1, 1, n) - 1
    return Scene(
        "sliders in a row", system, start | dict(zip(system.groups["log_rate"], speeds.tolist())), t_span,
        observables={"mean_rate": "mean_rate"},
        units=dict.fromkeys(("log_rate", "log_state", "k", "coupling", "a", "b", "damping", "mean_rate"), "1"),
        note="Ruina, J. Geophys. Res. 88 (1983) 10359-10370; Rice, J. Geophys. Res. 98 (1993) 9885-9907",
    )  # fmt: skip


@door("period", "parameters", law=OF_FRICTION)
def element_cloud(
    law: Law, *, position: Any, t_span: tuple[float, float] = (0.0, 20.0), period: float | None = None,
    parameters: Any = None,
) -> Scene:  # fmt: skip
    """A law with elements of its own under a motion that is a formula of time: of many elements an event costs its own.

    Parameters
    ----------
    law : Law
        With elements in parallel, such as `MaxwellSlip` of a measured virgin curve.
    position : Expr of t
        In the unit of length of the law.

    Returns
    -------
    Scene
        States of the elements alone; outputs `force`, `position` and those of the law.

    Raises
    ------
    ValueError, TypeError
        A position that jumps; a law without states.

    Examples
    --------
    Ten thousand sliders whose strengths are spread evenly: the first loading is x - x^2/2.

    >>> n = 10_000
    >>> law = MaxwellSlip(kappa=(1 / n,) * n, strength=tuple((np.arange(n) + 0.5) / n**2))
    >>> run = element_cloud(law, position=t, t_span=(0, 0.8)).solve(t_eval=[0, 0.4, 0.8])
    >>> run["force"].round(6).tolist()
    [0.0, 0.32, 0.48]
    """
    values = dict(parameters or {})
    place = expression(position, "position")
    check_continuous(place, "position", t_span, values)
    pieces = law.attach(position=place, velocity=place.diff(t), time=t)
    if not pieces.rates:
        raise ValueError(f"`law` is {type(law).__name__}, which has no states; `prescribed_motion` takes it.")
    shown = {"force": pieces.force, "position": place}
    return scene_of(
        "cloud of elements", law, t_span, {}, [pieces], (*shown, *pieces.outputs), period=period, x0={},
        parameters=values, outputs=shown,
    )  # fmt: skip
