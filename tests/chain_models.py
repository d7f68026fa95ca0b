"""Assemblies with known answers: blocks on a belt, elements without links, a front in a bistable chain."""

import numpy as np
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Family, Switch, System
from pwsmooth.definition import one_element

BELT = 0.1


def rho_of(r):
    """rho of the hidden law lam (1 + rho (1 - lam^2)) whose peak is r > 1 within its bounds."""
    return brentq(lambda q: 2 / 3 * (1 + q) * np.sqrt((1 + q) / (3 * q)) - r, 0.5, 100)


def with_templates(build, *arguments, **options):
    """What `build` makes, families of any size by their template."""
    before, one_element.TEMPLATE_FROM = one_element.TEMPLATE_FROM, 1
    try:
        return build(*arguments, **options)
    finally:
        one_element.TEMPLATE_FROM = before


def belt(n, r, strengths, *, couple="chain", table=None, work=False):
    """n blocks on a belt of speed u, Fs = r Fk by the hidden law; `r` None: Fs = Fk. y'' = -y + kc sum (y_j - y) - f.

    `work` adds states that count the belt's work k V int x dt and what friction takes, int f (w - u) dt.
    """
    blocks = Family(n, periodic=couple == "ring")
    y, w = blocks.symbols("y w")
    (F,) = blocks.symbols("F", positive=True)
    u = sp.Symbol("u", real=True)
    kc, rho = sp.symbols("kc rho", positive=True)
    if table is not None:
        pull = blocks.links(table).sum(lambda at: at(y) - y)
    else:
        pull = blocks.neighbour(y, 1) - 2 * y + blocks.neighbour(y, -1)
    lam = Switch("lam", w - u)
    friction = F * lam * (1 if r is None else 1 + rho * (1 - lam**2))
    rates = {y: w, w: (kc * pull if couple else 0) - y - friction}
    values = {u: BELT, F: [float(a) for a in strengths]}
    values |= ({kc: 2.0} if couple else {}) | ({} if r is None else {rho: rho_of(r)})
    if work:
        given, taken = blocks.symbols("given taken")
        rates |= {given: u * y, taken: friction * (w - u)}
    return System(rates, parameters=values)


def chain(n, r=1.5, **options):
    """(System, start) of the reference chain: Fk_i = 1 + 0.06 ((7 i) mod 5), u = 0.1, kc = 2."""
    i = np.arange(n)
    system = belt(n, r, 1 + 0.06 * ((7 * i) % 5), **options)
    # 0.37 i*i, in this order: of i**2 the roundings at i = 987 move the first event by 2e-10.
    places = 0.3 * np.sin(1.7 * i + 0.3) + 0.2 * np.sin(0.37 * i * i)
    return system, start_of(system, places)


def start_of(system, places, speeds=BELT):
    """All on the belt, the counters of work at 0."""
    start = {"y": list(map(float, places)), "w": speeds if np.isscalar(speeds) else list(map(float, speeds))}
    return start | (
        {"given": 0.0, "taken": 0.0} if any(s.startswith("given") for s in map(str, system.states)) else {}
    )


def bistable(n):
    """v_i' = D (v_(i+1) - 2 v_i + v_(i-1)) - v_i + H(v_i - a), D = 1."""
    cells = Family(n)
    (v,) = cells.symbols("v")
    a = sp.Symbol("a", positive=True)
    pull = cells.neighbour(v, 1) - 2 * v + cells.neighbour(v, -1)
    return System({v: pull - v + sp.Heaviside(v - a)}, parameters={a: 0.2})


def networks(n, degree=4, seed=0):
    """A random graph in which every vertex has that many neighbours, as a table: a union of random cycles."""
    r = np.random.default_rng(seed)
    table = np.empty((n, degree), int)
    for k in range(0, degree, 2):
        cycle = r.permutation(n)
        table[cycle, k], table[cycle, k + 1] = np.roll(cycle, 1), np.roll(cycle, -1)
    return table + 1


def train(n):
    """Blocks on a belt, with hidden static friction: 1.09 times that of slip."""
    blocks = Family(n)
    x, v = blocks.symbols("x v")
    V, k = sp.symbols("V k", positive=True)
    lam = Switch("lam", v - V)
    pull = blocks.neighbour(x, 1) - 2 * x + blocks.neighbour(x, -1)
    system = System({x: v, v: -x + k * pull - lam * (1 + (1 - lam**2))}, parameters={V: 0.1, k: 2.0})
    return system, {x: 0.5 * np.sin(np.arange(n) ** 2), v: 0.1}
