"""Diffusions on families: loops over their elements beside the same noise with every element written out.

The elements of assemblies.py and layers.py, as they are and in smoothed views; amplitudes that are constant or depend
on states, on time, on parameters of the elements; sources of each element and of all. The functions that the steps ask
for (amplitudes, Milstein's terms, the rate of the drift, what the noise does to surfaces) are compared at random
points, then paths.
Chain: layers.py, judging.py -> noises.py (here) -> __main__.py.
"""

from __future__ import annotations

import ctypes
import warnings
from dataclasses import replace

import numpy as np
import sympy as sp

from pwsmooth import Diffusion, System, solve
from pwsmooth.kernels.noise import state as names
from pwsmooth.noise.diffusion_run import DiffusionRun

from . import assemblies, judging, layers
from .assemblies import case, t
from .judging import ILL, REFUSED, RIGHT, WRONG, Played, Verdict

TITLE = "noises"
BOUND = 1e-11  # of values at a point, relative to the largest
KINDS = (*assemblies.KINDS, *(kind for kind in layers.KINDS if kind not in assemblies.KINDS))
STEP = 1 / 32


def structure(seed):
    """(Model, whether smoothed, Diffusion)."""
    r = np.random.default_rng([81, seed])
    kind, smooth = KINDS[seed % len(KINDS)], seed // len(KINDS) % 2 == 0
    if kind in assemblies.KINDS:
        first, step, make = assemblies.KINDS.index(kind), len(assemblies.KINDS), assemblies.structure
    else:
        first, step, make = layers.KINDS.index(kind), len(layers.KINDS), layers.structure
    first += 100 * step * seed
    M = next(M for M in map(make, range(first, first + 10**6, step)) if M.n <= layers.MOST)
    members = [x for x in M.states if hasattr(x, "family")]
    driven = [members[-1]] if r.random() < 0.7 else members
    amplitude = {}
    for x in driven:
        others = [y for y in members if y not in driven]
        scale = sp.Rational(1, 4) * (M.own[0] if r.integers(2) else 1)
        shape = int(r.integers(4))
        if shape == 1:
            scale *= sp.cos(t) + 2
        elif shape == 2:
            scale *= 1 + (x**2 / 9 if len(driven) == 1 else 0)
        elif shape == 3 and others:
            scale *= 1 + sp.sin(others[0]) / 2
        amplitude[x] = scale
        if shape < 2 and r.integers(2):
            amplitude[x] = {x.name: scale, "all": sp.Rational(1, 8)}
    convention = "stratonovich" if r.integers(2) else "ito"
    return M, smooth, Diffusion(amplitude, STEP, seed=seed, convention=convention, finest=3)


def compiled(_, seed):
    """The structure of this seed: its runs with loops and written out."""
    M, smooth, noise = structure(seed)
    with assemblies.templates(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system = System(**M.arguments)
        system = system.smoothed(1e-2) if smooth and system.switches else system
        if system.model.families is None:
            return Played(None, (M, noise), None, set())
        looped = DiffusionRun(system, noise)
    return Played(None, (M, noise), (looped, system, system._written_out()), set())


def play(played, seed):
    """The verdict on one case."""
    M, noise = played.model
    if played.system is None:
        return Verdict(RIGHT, "written out")  # in the exact system
    looped, *systems = played.system
    if looped.lowered.model.families is None:
        kept = M.way in ("lattice", "graph")
        return Verdict(RIGHT, "noise written out") if kept else Verdict(WRONG, f"no loops: {M.kind}, {M.way}")
    one, r = case(M, seed), np.random.default_rng([82, seed])
    one.start = {x: one.start[x] if hasattr(x, "family") else float(np.mean(one.start[x])) for x in one.start}
    # On a surface the side from which noise leaves it is nobody's choice.
    one.start = {x: (np.asarray(a) + r.uniform(0, 1e-2, np.shape(a))).tolist() for x, a in one.start.items()}
    if looped.lowered.model.smoothing:
        one.p |= {"eps": float(10 ** r.uniform(-3, -1))}
    noise = replace(noise, seed=seed)
    with assemblies.templates(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        runs = [DiffusionRun(each.with_parameters(one.p), noise) for each in systems]
        # Where two ways lead to one neighbour, what it does is not added up before it is squared.
        found = at_points(*runs, r, M.way == "lattice" or (M.way == "ring" and M.n < 5))
        if found:
            return Verdict(WRONG, *found)
        options = dict(parameters=one.p, noise=noise, max_steps=judging.STEPS)
        paths = [judging.solve(each, (0, 1), one.start, **options) for each in systems]
    if not all(path.success for path in paths):
        outcomes = [path.outcome.name for path in paths]
        return Verdict(REFUSED if outcomes[0] == outcomes[1] else WRONG, " and ".join(outcomes))
    error = layers.difference(*paths)
    if error <= 1e-8:
        return Verdict(RIGHT, error=error)
    # The same steps lead as far apart as roundings do; others, as rates differ a little, as far as finer ones.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if paths[0].cost != paths[1].cost:
            options["noise"] = replace(noise, resolution=noise.resolution / 3, finest=noise.finest + 2)
            moved = layers.difference(paths[1], judging.solve(systems[1], (0, 1), one.start, **options))
            return Verdict(ILL if error <= 3 * moved else WRONG, "states", error)
        base = solve(systems[1], (0, 1), one.start, **options)
        moved = max(
            layers.difference(base, solve(systems[1], (0, 1), layers.beside(one.start, k, 1e-12), **options))
            for k in range(4)
        )
    return Verdict(ILL if error <= 100 * moved else WRONG, "states", error)


class Quantities:
    """What the noise of a run is at a point, as dense arrays."""

    def __init__(self, run):
        self.of, self.p = run.lowered, np.array(run._view.parameter_values, float)
        self.bundle = run.bundle()
        kinds = [ctypes.c_double, *[ctypes.c_void_p] * 4]
        self.function = ctypes.CFUNCTYPE(None, *kinds)(self.bundle.outputs)

    def at(self, t0, x, mult):
        """Name -> values: amplitudes and Milstein's terms by state and source, the rate, the rest by surface."""
        of, out = self.of, np.zeros(int(self.of.parts[-1]))
        mult = np.full(len(of.model.multipliers), mult)
        self.function(t0, x.ctypes.data, mult.ctypes.data, self.p.ctypes.data, out.ctypes.data)
        n, at = len(x), of.parts
        G, terms = np.zeros((n, of.q)), np.zeros((n, of.q, of.q))
        row, source, place = of.G
        G[np.repeat(np.arange(n), np.diff(row)), source] = out[place]
        row, first, second, place = of.milstein
        terms[np.repeat(np.arange(n), np.diff(row)), first, second] = out[place]
        rate = sum(
            max(out[a:b], default=0.0) for a, b in zip(at[names.RATE : names.SPREAD], at[names.RATE + 1 :])
        )
        return {"G": G, "Milstein": terms, "rate": rate} | {
            name: out[at[part] : at[part + 1]]
            for name, part in (("gate", names.GATE), ("speed", names.SPEED), ("across", names.ACROSS),
                               ("spread", names.SPREAD), ("pull", names.PULL), ("slope", names.SLOPE))
        }  # fmt: skip


def at_points(looped, written, r, twice=False):
    """(what differs, by how much) between two runs at a random point, or None."""
    ours, theirs = looped.lowered.model, written.lowered.model
    order = [list(ours.states).index(x) for x in theirs.states]
    x, t0, mult = r.uniform(-1, 1, len(order)) * 10.0 ** r.uniform(-3, 1), r.uniform(0, 3), r.uniform(-1, 1)
    a = Quantities(looped).at(t0, np.ascontiguousarray(x), mult)
    b = Quantities(written).at(t0, np.ascontiguousarray(x[order]), mult)
    for name in b:
        mine, other = a[name], b[name]
        if name in ("G", "Milstein"):
            mine = mine[order]
        elif name == "rate":
            # What acts through a table or a sum is bounded or estimated.
            if not other / 2 <= mine <= 3 * other:
                return name, float(mine / other)
            continue
        elif name == "gate" or name == "speed":
            mine, other = np.sort(np.abs(mine)), np.sort(np.abs(other))
        else:
            mine, other = np.sort(mine), np.sort(other)
        if twice and name in ("across", "spread", "pull"):
            continue
        if name == "slope" and ours.families.template.levels:
            continue  # by sigma in place of lambda
        if len(mine) != len(other):
            if name in ("gate", "speed", "across", "spread", "pull", "slope"):
                continue  # a surface of two neighbours that is told once, or twice
            return f"{name}, its size", float(len(mine))
        error = np.abs(mine - other).max(initial=0) / np.abs(other).max(initial=1e-300)
        if not error <= BOUND:
            return name, float(error)
    return None


def script(number, seed):
    """The case as a program."""
    M, smooth, noise = structure(number)
    return (
        "from tests.fuzz import noises\n"
        f"played = noises.compiled(None, {number})\nprint(noises.play(played, {seed}))\n"
        f"# {M.kind}, {M.way}, n = {M.n}, smoothed: {smooth}: {M.arguments['rates']}\n# {noise}"
    )
