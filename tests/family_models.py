"""Systems with families for the tests of their template, and both forms of them."""

import contextlib

import sympy as sp

from pwsmooth import Algebraic, Event, Family, Switch, System, Unilateral
from pwsmooth.definition import one_element

t, x, v, s = sp.symbols("t x v s", real=True)


def clipped(n):
    """n parallel elements of the differential-algebraic law in prescribed motion: nested switches, a sum as output."""
    elements = Family(n)
    (a,) = elements.symbols("a")
    kappa, sigma, share = elements.symbols("kappa sigma share", positive=True)
    speed = 10 * sp.cos(2 * sp.pi * t)
    force = sp.Max(-share * s, sp.Min(share * s, kappa * a + sigma * speed))
    system = {
        "rates": {s: (1 + sp.exp(-((speed / 8) ** 2)) - s) / 0.02, a: (force - kappa * a) / sigma},
        "parameters": {kappa: [2.5 / (i + 1) for i in range(n)], sigma: 0.01, share: 1 / n},
        "outputs": {"force": elements.sum(force), "share_of": force / elements.sum(force)},
    }
    return system, {s: 1.1, a: 0}, (0, 1)


def bristles(n):
    """A mass on n LuGre bristles: the sum feeds the speed, which moves the elements; a shared kink in each."""
    elements = Family(n)
    (z,) = elements.symbols("z")
    s0, s1, Fc, Fs = elements.symbols("s0 s1 Fc Fs", positive=True)
    rate = v - s0 * sp.Abs(v) * z / (Fc + (Fs - Fc) * sp.exp(-((v / sp.Rational(1, 10)) ** 2)))
    force = elements.sum(s0 * z + s1 * rate)
    values = {s0: [100.0 * (1 + i) / n**2 for i in range(n)], s1: 1 / n, Fc: 1 / n, Fs: 1.5 / n}
    rates = {x: v, v: 2 * sp.cos(3 * t) - force - 4 * v, z: rate}
    return {"rates": rates, "parameters": values, "outputs": {"force": force}}, {x: 0, v: 0.1, z: 0}, (0, 2)


def slip_stick(n):
    """Generalised Maxwell-slip: memories, guards, events of elements, a surface that all of them share."""
    elements = Family(n)
    (z,) = elements.symbols("z")
    kappa, share, sigma = elements.symbols("kappa share sigma", positive=True)
    slip = elements.memory("slip", 0)
    speed = 10 * sp.cos(2 * sp.pi * t)
    g = 1 + sp.exp(-((speed / 8) ** 2))
    rate = sp.Piecewise((speed, sp.Eq(slip, 0)), (50 * (share * sp.sign(speed) - kappa * z / g) / kappa, True))
    events = [
        Event(kappa * z - share * g, direction=1, update={slip: 1}, when=sp.Eq(slip, 0), name="up"),
        Event(kappa * z + share * g, direction=-1, update={slip: 1}, when=sp.Eq(slip, 0), name="down"),
        Event(speed, update={slip: 0}, when=sp.Eq(slip, 1), name="stop"),
    ]
    system = {
        "rates": {z: rate},
        "parameters": {kappa: [2.5 / (i + 1) for i in range(n)], share: 1 / n, sigma: 0.01},
        "events": events,
        "outputs": {"force": elements.sum(kappa * z + sigma * rate), "slipping": elements.sum(slip)},
    }
    return system, {z: 0}, (0, 1.2)


def smooth_chain(n, **options):
    """A chain of springs with a cubic term, a wall beyond its end, numbers of elements, no switch."""
    blocks = Family(n, **options)
    y, w = blocks.symbols("y w")
    k = sp.Symbol("k", positive=True)
    ahead = blocks.neighbour(y, 1) if options else blocks.neighbour(y, 1, outside=sp.sin(t))
    pull = ahead - 2 * y + blocks.neighbour(y, -1)
    far = blocks.neighbour(y, -2) - y
    rates = {y: w, w: k * pull - y**3 + far / (1 + w**2) + blocks.index / 10}
    start = {y: [0.1 * ((3 * i) % 7) / 7 for i in range(n)], w: 0}
    outputs = {"energy": blocks.sum(w**2 + k * (ahead - y) ** 2) / 2, "stretch": ahead - y}
    return {"rates": rates, "parameters": {k: 2.0}, "outputs": outputs}, start, (0, 3)


def mean_field(n):
    """Sums of functions of sums: every element follows the spread about the mean, the whole the sum of both."""
    elements = Family(n)
    (z,) = elements.symbols("z")
    rate = elements.symbols("r", positive=True)[0]
    mean = elements.sum(z) / n
    spread = elements.sum((z - mean) ** 2) / n
    rates = {
        v: spread - v,
        z: rate * (mean - z) + sp.sin(z) / (1 + spread) * sp.Abs(v - s) - elements.sum(z * v),
        s: 0,
    }
    start = {v: 0.2, z: [sp.sin(3 * i) for i in range(n)], s: 0.3}
    return {"rates": rates, "parameters": {rate: [1 + i / n for i in range(n)]}}, start, (0, 1)


def two_families(n):
    """A mass on n dampers with reset counters and n + 4 springs of their own rates: sums over both in one rate."""
    first, second = Family(n, name="first"), Family(n + 4, name="second")
    z, count = first.symbols("z")[0], first.memory("count", 0)
    (y,) = second.symbols("y")
    c, k = first.symbols("c", positive=True)[0], second.symbols("k", positive=True)[0]
    rates = {
        x: v,
        z: c * (v - z) + sp.sin((1 + c) * t) + t * z / 10,
        v: -x - first.sum(c * z) - second.sum(k * sp.tanh(y)) / (n + 4),
        y: k * v - y * (1 + sp.tanh(first.sum(z))) / n,
    }
    full = Event(z - sp.Rational(1, 2) / first.index, direction=1, update={count: count + 1, z: 0}, name="full")
    values = {c: [0.1 + 0.02 * i for i in range(n)], k: [1 + 0.1 * i for i in range(n + 4)]}
    start = {x: 1, z: 0, v: 0.3, y: [0.1 * i for i in range(n + 4)]}
    outputs = {"counted": first.sum(count), "share": k * y / second.sum(k * y)}
    return {"rates": rates, "parameters": values, "events": [full], "outputs": outputs}, start, (0, 3)


MODELS = {
    "two_families": two_families,
    "clipped": clipped,
    "bristles": bristles,
    "slip_stick": slip_stick,
    "smooth_chain": smooth_chain,
    "ring": lambda n: smooth_chain(n, periodic=True),
    "mean_field": mean_field,
}


@contextlib.contextmanager
def template_from(n):
    """Families have a template from n elements on."""
    before, one_element.TEMPLATE_FROM = one_element.TEMPLATE_FROM, n
    try:
        yield
    finally:
        one_element.TEMPLATE_FROM = before


def both(name, n):
    """(template system, the same with its elements written out, start, span)."""
    arguments, start, span = MODELS[name](n)
    arguments = {"time": t} | arguments
    with template_from(1):
        template = System(**arguments)
    with template_from(10**9):
        written = System(**arguments)
    assert template.model.families is not None and written.model.families is None
    return template, written, start, span


def friction_chain(n):
    """Blocks on a belt, coupled by springs: every block has its own switch, which slides."""
    blocks = Family(n)
    y, w = blocks.symbols("y w")
    (F,) = blocks.symbols("F", positive=True)
    u, k = sp.symbols("u k", positive=True)
    pull = blocks.neighbour(y, 1) - 2 * y + blocks.neighbour(y, -1)
    rates = {y: w, w: k * pull - y - F * Switch("lam", w - u)}
    values = {u: 0.1, k: 2.0, F: [1 + 0.3 * ((7 * i) % 5) / 5 for i in range(n)]}
    return (
        {"rates": rates, "parameters": values},
        {y: [0.1 * ((3 * i) % 7) / 7 for i in range(n)], w: 0},
        (0, 10),
    )


def implicit(n):
    """Unknowns of the whole and of elements that act on each other, and a switch in every element that slides.

    A + tanh(A)/2 + mean b = sin 3t,   b_i (1 + z_i^2/2) = z_i + 3 A/10 + lam_i/5,
    w_i' = b_i - (1 + i/10) lam_i - w_i: two multipliers an element, and A couples all.
    """
    elements = Family(n)
    z, w, b = elements.symbols("z w b")
    A = sp.Symbol("A", real=True)
    lam = Switch("lam", w)
    rates = {v: A - v, z: -z + b * v, w: b - (1 + elements.index / 10) * lam - w}
    algebraic = [
        Algebraic(A, A + sp.tanh(A) / 2 + elements.sum(b) / n - sp.sin(3 * t)),
        Algebraic(b, b * (1 + z**2 / 2) - z - sp.Rational(3, 10) * A + lam / 5),
    ]
    start = {v: 0.2, z: [0.6 * (-1) ** i for i in range(n)], w: [0.02 * i - 0.05 for i in range(n)]}
    return {"rates": rates, "algebraic": algebraic}, start, (0, 3)


def belt(n):
    """A block that rubs on a belt, loaded by n sliders on the floor: its residual has the switches of all elements."""
    elements = Family(n)
    y, w = elements.symbols("y w")
    (F,) = elements.symbols("F", positive=True)
    lam, mu = Switch("lam", v - sp.Rational(1, 10)), Switch("mu", w)
    rates = {
        x: v,
        v: -x - lam + elements.sum(F * mu + (w - v) / n),
        y: w,
        w: -(1 + elements.index / 5) * (y - sp.sin(2 * t)) - F * mu * (2 + sp.cos(x)),
    }
    start = {x: 0.1, v: 0.4, y: [0.1 * i / n for i in range(n)], w: 0.0}
    return {"rates": rates, "parameters": {F: [0.3 / n + 0.01 * i for i in range(n)]}}, start, (0, 6)


def floors(n):
    """Balls that bounce and come to rest, each on a floor of its own, joined by springs."""
    balls = Family(n)
    y, w = balls.symbols("y w")
    (e,) = balls.symbols("e", positive=True)
    floor = Unilateral(y, restitution=e, name="R")
    pull = 2 * (balls.neighbour(y, 1) - 2 * y + balls.neighbour(y, -1))
    rates = {y: w, w: floor.reaction - 1 + sp.sin(3 * t) / 2 + pull}
    start = {y: [0.1 + 0.07 * (5 * i % 7) for i in range(n)], w: 0.2}
    return (
        {"rates": rates, "parameters": {e: [0.3 + 0.3 * i / n for i in range(n)]}, "contacts": [floor]},
        start,
        (0, 3),
    )


def hits(n):
    """Equal balls on a ring that swap what they have where they meet."""
    balls = Family(n, periodic=True)
    y, w = balls.symbols("y w")
    beside = balls.neighbour(w, 1)
    hit = Event(balls.neighbour(y, 1) - y + 1, direction=-1, update={w: beside, beside: w}, name="hit")
    start = {y: [0.03 * (4 * i % 5) for i in range(n)], w: [0.5 * (5 * i % 7) - 1.5 for i in range(n)]}
    return {"rates": {y: w, w: -y / 10}, "events": [hit]}, start, (0, 2)


MODELS |= {"floors": floors, "hits": hits}
SLIDING = {"friction_chain": friction_chain, "implicit": implicit, "belt": belt}
MODELS |= SLIDING
