"""Smoothed views of families: loops over their elements beside the same view with every element written out.

The elements of assemblies.py that switch, and such as have a template in a smoothed view alone: friction between
neighbours, sums over all, hidden terms, vector multipliers, a memory beside a switch. The functions of the implicit
steps (rates at one point and at eight, Jacobian, surfaces and their gradients, Taylor coefficients) are compared at
random points, then runs.
Chain: assemblies.py, judging.py -> layers.py (here) -> __main__.py.
"""

from __future__ import annotations

import ctypes
import itertools

import numpy as np
import sympy as sp

from pwsmooth import Disc, Event, Family, Switch, System, solve
from pwsmooth.codegen.stiff import functions

from . import assemblies, judging
from .assemblies import Model, case, t, u
from .judging import ILL, REFUSED, RIGHT, WRONG, Played, Verdict

TITLE = "layers"
KINDS = ("sliding", "hidden", "relay", "driven", "weakening", "first order", "functions",
         "rub", "sum", "disc", "latch", "wall")  # fmt: skip
MOST = 12  # elements: more take long to write out
BOUND = 1e-11  # of values at a point, relative to the largest
ORDER, STRIDE = 12, 24
SIGMOIDS = ("algebraic", "tanh", "erf")


def structure(seed):
    """A Model."""
    kind = KINDS[seed % len(KINDS)]
    if kind in assemblies.KINDS:
        first = assemblies.KINDS.index(kind) + len(assemblies.KINDS) * 100 * seed
        tries = map(assemblies.structure, itertools.count(first, len(assemblies.KINDS)))
        return next(M for M in tries if M.n <= MOST)
    r = np.random.default_rng([71, seed])
    n, periodic = int(r.integers(3, 10)), bool(r.integers(2)) and kind != "wall"
    family = Family(n, periodic=periodic)
    y, w, v = family.symbols("y w v")
    F, k, c, e, g = family.symbols("F k c e g", positive=True)
    step, events = family.neighbour, []
    pull = step(y, 1) + step(y, -1) - 2 * y
    if kind == "rub":
        own = (F, k, g)
        there, here = sp.sign(step(w, 1) - w), sp.sign(w - step(w, -1))
        if r.integers(2):
            there = Switch("s", step(w, 1) - w)
            here = step(there, -1)
        rates = {y: w, w: F * there - (F + g) * here - k * y + u * sp.cos(t)}
    elif kind == "sum":
        own = (F, k, c, e)
        X, V = sp.symbols("X V", real=True)
        rub = family.sum(F * sp.sign(V - w) * (1 + e * V)) / n
        more = family.sum(sp.sin(y) * (w + rub) + V * y) / n
        rates = {
            y: w,
            w: -k * y - c * w + more * X + F * sp.sign(V - w),
            X: V,
            V: -X - rub - more**2 + u * sp.cos(t),
        }
    elif kind == "disc":
        own = (F, k, c, e, g)
        a, b = Disc("a", (w - u, v))
        more = 1 + e * (1 - a * a - b * b)
        rates = {y: w, w: c * pull - F * a - k * y, v: -F * more * b - g * v + sp.sin(2 * t)}
    elif kind == "latch":
        own = (F, k, c, e)
        on = family.memory("on", 1)
        rates = {y: w, w: c * pull - k * y - (F + on / 2) * sp.sign(w - u) + sp.cos(t) * (1 + on)}
        events = [
            Event(y - e / 2, direction=1, update={on: 0}, name="off"),
            Event(y + e / 2, direction=-1, update={on: 1, w: w * c}, name="on"),
        ]
    else:
        own = (F, k, c, e, g)
        ends, lam = step(y, 1, outside=sp.sin(t) / 5) + step(y, -1, outside=u) - 2 * y, sp.sign(w)
        rates = {y: w, w: ends * c - k * y - F * lam * (1 + e * (1 - lam**2)) - g * w + sp.cos(2 * t)}
    arguments = {"rates": rates, "time": t, "events": events, "parameters": {**dict.fromkeys(own, 1), u: 1}}
    return Model(kind, "ring" if periodic else "chain", n, arguments, tuple(rates), own)


def compiled(_, seed):
    """The structure of this seed: its views with loops and written out."""
    model = structure(seed)
    sigmoid = SIGMOIDS[0 if model.kind == "disc" else seed // len(KINDS) % 3]
    with assemblies.templates():
        looped = System(**model.arguments).smoothed(1e-3, sigmoid)
    if looped.model.families is None:
        raise AssertionError(f"no loops for {model.kind}")
    return Played(None, model, (looped, looped._written_out()), set())


def play(played, seed):
    """The verdict on one case."""
    one, r = case(played.model, seed), np.random.default_rng([72, seed])
    one.start = {x: one.start[x] if hasattr(x, "family") else float(np.mean(one.start[x])) for x in one.start}
    one.p |= {"eps": float(10 ** r.uniform(-5, -2))}
    try:
        found = at_points(played.system, one, r)
        if found:
            return Verdict(WRONG, *found)
        runs = [run(view, one) for view in played.system]
    except Exception as error:
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])
    if not all(each.success for each in runs):
        outcomes = [each.outcome.name for each in runs]
        bounded = outcomes[0] == outcomes[1] or "TOO_MANY_STEPS" in outcomes
        return Verdict(REFUSED if bounded else WRONG, " and ".join(outcomes))
    error = difference(*runs)
    if error <= 1e-8:
        return Verdict(RIGHT, error=error)
    written = played.system[1]
    base = run(written, one, by=solve)
    moved = max(difference(base, run(written, one, k, by=solve)) for k in range(3))
    return Verdict(ILL if error <= 10 * moved else WRONG, "states", error)


def beside(start, seed, by):
    """A start that is off by so much of it."""
    r = np.random.default_rng(seed)
    return {x: (np.asarray(a) * (1 + by * r.uniform(-1, 1, np.shape(a)))).tolist() for x, a in start.items()}


def run(view, one, off=None, by=None):
    """The solution; from a start that is `off` by the tolerance."""
    start = one.start if off is None else beside(one.start, off, 1e-10)
    options = dict(parameters=one.p, t_eval=one.instants, rtol=1e-10, atol=1e-13, max_steps=judging.STEPS)
    return (by or judging.solve)(view, (0, float(one.instants[-1])), start, **options)


def difference(a, b):
    """Of the states of two runs, relative to their size; inf where other events are recorded."""
    events = [[(e.switch, e.kind) for e in each.events] for each in (a, b)]
    if sorted(events[0]) != sorted(events[1]) or a.x.shape != b.x.shape:
        return np.inf
    return float(np.abs(a.x - b.x).max() / (1 + np.abs(b.x).max()))


class Functions:
    """The generated functions of a view, called at one point and at eight."""

    def __init__(self, view):
        self.of = functions.compile_stiff(view.model).with_taylor()
        self.p = np.array(view.parameter_values, float)

    def call(self, name, *arguments):
        address = int(self.of.address[functions.NAMES.index(name)])
        kinds = {float: ctypes.c_double, int: ctypes.c_int64}
        function = ctypes.CFUNCTYPE(None, *(kinds.get(type(a), ctypes.c_void_p) for a in arguments))(address)
        function(*(a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments))

    def taylor(self, t0, x):
        """Coefficients of the states and of the surfaces, or None."""
        if not self.of.address[functions.NAMES.index("taylor")]:
            return None
        rows = np.zeros(self.of.rows_length)
        self.call("taylor", t0, x, self.p, ORDER, STRIDE, rows)
        table = rows[: rows.size // STRIDE * STRIDE].reshape(-1, STRIDE)[:, : ORDER + 1]
        return table[: self.of.n], table[self.of.surface_row]

    def values(self, t8, x8):
        """Name -> values: of the states first, as of surfaces; columns are states in gradients and Jacobians."""
        of, p, t0, x = self.of, self.p, float(t8[0]), np.ascontiguousarray(x8[:, 0])
        n, q, e = of.n, of.n_surfaces, of.n_events
        hoisted, entries = np.zeros((max(1, of.n_hoisted), 8)), np.zeros(len(of.pattern[0]))
        surf, sizes = np.zeros(3 * q + len(of.slopes[1])), {"rates8": n, "surfaces8": q, "watch8": e}
        found = {"rates1": np.zeros(n)} | {name: np.zeros((size, 8)) for name, size in sizes.items()}
        if of.n_hoisted:
            self.call("hoist", t8, p, hoisted)
        self.call("rates1", t0, x, p, found["rates1"])
        self.call("rates8", t8, hoisted, x8, p, found["rates8"])
        self.call("jacobian", t0, x, p, entries)
        self.call("surfaces", t0, x, p, surf)
        self.call("surfaces8", t8, x8, p, found["surfaces8"])
        if e:
            self.call("watch8", t8, x8, p, found["watch8"])
        gradient = np.zeros((q, n))
        rows = np.repeat(np.arange(q), np.diff(of.slopes[0]))
        np.add.at(gradient, (rows, of.slopes[1]), surf[3 * q :])
        return found | {"J": of.matrix(entries), "surfaces": surf[: 3 * q].reshape(q, 3), "gradient": gradient}


def at_points(views, one, r):
    """(what differs, by how much) between the generated functions of two views at a random point, or None."""
    looped, written = (view.with_parameters(one.p) for view in views)
    ours, theirs = Functions(looped), Functions(written)
    order = [looped.states.index(x) for x in written.states]  # state of ours that is this one of theirs
    x8 = r.uniform(-1, 1, (ours.of.n, 8)) * 10.0 ** r.uniform(-4, 1, 8)
    t8 = r.uniform(0, 3, 8)
    a, b = ours.values(t8, x8), theirs.values(t8, np.ascontiguousarray(x8[order]))
    for name in a:
        if "surface" in name or name == "gradient":
            mine = a[name][:, order] if name == "gradient" else a[name]
            error = _unmatched(mine, b[name])
        else:
            mine = a[name] if name == "watch8" else a[name][order]
            mine = mine[:, order] if name == "J" else mine
            error = np.abs(mine - b[name]).max(initial=0) / np.abs(b[name]).max(initial=1e-300)
        if not error <= BOUND:
            return name, float(error)
    x = np.ascontiguousarray(x8[:, 0])
    series, expected = ours.taylor(float(t8[0]), x), theirs.taylor(float(t8[0]), np.ascontiguousarray(x[order]))
    if series is None or expected is None:
        return None
    expected, found = expected[0], series[0][order]
    beside = [ours.taylor(float(t8[0]), x * (1 + 1e-15 * r.uniform(-1, 1, len(x))))[0][order] for _ in range(3)]
    moved = np.max([np.abs(other - found).max(axis=0) for other in beside], axis=0)  # what rounding makes of it
    error, size = np.abs(found - expected).max(axis=0), np.abs(expected).max(axis=0)
    orders = np.arange(1, ORDER + 1)
    # Far from a layer high orders are what cancellation leaves: they count on the way that they allow.
    reach = np.min((size[0] / np.maximum(size[1:], 1e-300)) ** (1 / orders))
    scale = reach ** np.arange(ORDER + 1) / size[0]
    error, allowed = error * scale, BOUND + 1e3 * moved * scale
    return None if np.all(error <= allowed) else ("taylor", float(np.max(error)))


def _unmatched(a, b):
    """How far the rows of b are from their nearest in a, up to sign: a surface of neighbours is that of both."""
    worst = 0.0
    for row in b:
        beside = min((min(np.abs(other - row).max(), np.abs(other + row).max()) for other in a), default=np.inf)
        worst = max(worst, beside / (np.abs(row).max() + 1e-300))
    return float(worst)


def script(number, seed):
    """The case as a program."""
    return (
        "from tests.fuzz import layers\n"
        f"played = layers.compiled(None, {number})\nprint(layers.play(played, {seed}))\n"
        f"# {played_text(number)}"
    )


def played_text(number):
    M = structure(number)
    return f"{M.kind}, {M.way}, n = {M.n}: {M.arguments['rates']}"
