"""Units do not decide: the same model in micrometres, in nanoseconds or centuries, with its surface times a constant,
or run late, has the same itinerary."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Event, Outcome, Switch, System, Unilateral, solve

t, y, v = sp.symbols("t y v", real=True)
size = sp.Symbol("size", positive=True)
FORCE = -sp.Rational(12, 10) * sp.sin(t)
ELASTIC = -sp.Rational(31, 10) * y - v / 10

# States, forces and the surface in other units; then the surface alone.
MODELS = {
    "states": System(
        {y: v, v: size * (FORCE - Switch("lam", v - size * sp.sin(t) / 7)) + ELASTIC},
        time=t,
        parameters={size: 1.0},
    ),
    "surface": System(
        {y: v, v: FORCE - Switch("lam", size * (v - sp.sin(t) / 7)) + ELASTIC}, time=t, parameters={size: 1.0}
    ),
    "exponential surface": System(
        {y: v, v: FORCE - Switch("lam", size * (sp.exp(v) - 1 - sp.sin(t) / 7)) + ELASTIC},
        time=t,
        parameters={size: 1.0},
    ),
}


# An exponential surface has a series of its own, whose rounding counts as 1e-15: below 1e-6 that is felt.
@pytest.mark.parametrize(
    ("name", "scale"),
    [(name, scale) for name in MODELS for scale in (1e-9, 1e-6, 1e6, 1e9) if name[0] != "e" or scale >= 1e-6],
)
def test_the_itinerary_is_that_of_any_unit(name, scale):
    def run(factor):
        unit = factor if name == "states" else 1.0
        return solve(
            MODELS[name],
            (0, 60),
            [0.5 * unit, 0.3 * unit],
            parameters={size: factor},
            rtol=1e-9,
            atol=1e-12 * unit,
            t_eval=np.linspace(0.5, 59.5, 119),
        )

    here, there = run(1.0), run(scale)
    assert [e.kind for e in here.events] == [e.kind for e in there.events] and len(here.events) > 30
    # Only roundings differ, in units of 1e-16 of t = 60, and at most a tenth of rtol where they choose other steps.
    late = [abs(a.time - b.time) for a, b in zip(here.events, there.events, strict=True)]
    assert np.max(late) < 1e-10
    # The multiplier is solved for as exactly: a residual of 1e-14 is large where the surface is small.
    assert np.max(np.abs(here["lam"] - there["lam"])) < 1e-10


# ---- units of time: autonomous systems at `pace` times their speed, from 0 and from any other time

x, w = sp.symbols("x w", real=True)
a, b, pace = sp.symbols("a b pace", positive=True)
FLOOR, SLIP = Unilateral(y, restitution=b, name="R"), Disc("slip", (v, w))


def paced(rates, **kinds):
    rates = {state: pace * rate for state, rate in rates.items()}
    return System(rates, parameters={symbol: 1.0 for symbol in (a, b, pace)}, **kinds)


PACED = {
    "friction": paced(
        {y: v, v: -y - a * v / 10 - b * Switch("lam", v)}, events=[Event(y - sp.Rational(1, 10))]
    ),
    "hidden friction": paced(
        {y: v, v: sp.sin(2 * y) - y - a * v / 10 - b * (lam := Switch("lam", v)) * (1.3 - lam**2 / 3)}
    ),
    "bounces": paced({y: v, v: -1 - a * y / 10 + FLOOR.reaction}),
    "bounces by resets": paced({y: v, v: -a}, events=[Event(y, direction=-1, update={v: -b * v})]),
    "relay": paced({y: v, v: -b * sp.sign(y) - a * v}),
    "relay and friction": paced({y: v, v: -a * y / 5 - sp.sign(y - sp.Rational(1, 20)) - b * sp.sign(v) / 2}),
    "touch": paced({y: v, v: -y - a * v / 10 - 5 * sp.Max(y - b / 2, 0) ** sp.Rational(3, 2)}),
    "disc": paced({y: v, x: w, v: -y - b * SLIP[0], w: -a * x - b * SLIP[1]}),
}


def drawn(name, seed):
    random = np.random.default_rng([seed, list(PACED).index(name)])
    start = random.normal(size=len(PACED[name].states))
    if name.startswith("bounces"):
        start[0] = 0.1 + abs(start[0])
    return random, {a: random.uniform(0.5, 2.0), b: random.uniform(0.2, 0.9)}, start


def paced_run(name, values, start, factor, begin):
    span = begin, begin + 6.0 / factor
    return solve(PACED[name], span, start, parameters=values | {pace: factor}, rtol=1e-9, atol=1e-11)


def assert_same(name, one, other, bound):
    assert one.outcome is other.outcome
    if "bounces" in name or "relay" in name:  # how many are seen before the limit is a matter of roundings
        assert [e.kind for e in one.events[-1:]] == [e.kind for e in other.events[-1:]]
    else:
        assert [(e.switch, e.kind) for e in one.events] == [(e.switch, e.kind) for e in other.events]
    np.testing.assert_allclose(other.x[:, -1], one.x[:, -1], rtol=0, atol=bound)


# Beside a disc's rest the direction turns ever faster: from 1e8 on twenty powers of its rate go beyond the numbers.
@pytest.mark.parametrize(
    ("name", "factor"),
    [(name, f) for name in PACED for f in (1e-10, 1e-7, 1e-4, 1e4, 1e7, 1e9) if name != "disc" or f < 1e8],
)
def test_the_itinerary_is_that_of_any_unit_of_time(name, factor):
    for seed in range(12):
        _, values, start = drawn(name, seed)
        assert_same(
            name, paced_run(name, values, start, 1.0, 0.0), paced_run(name, values, start, factor, 0.0), 1e-6
        )


@pytest.mark.parametrize("name", PACED)
def test_a_fast_motion_is_the_same_late(name):
    """The whole run takes 1e-11 to 1e-8 of the time: where that tells too little of it, the outcome says so."""
    lost = 0
    for seed in range(40):
        random, values, start = drawn(name, seed)
        late = 10 ** random.uniform(2, 6)
        factor = 10 ** random.uniform(8, 11) / late
        here, there = (paced_run(name, values, start, factor, begin) for begin in (0.0, late))
        if here.success and there.outcome in (Outcome.STEP_UNDERFLOW, Outcome.CHATTERING):
            lost += 1
        else:
            assert_same(name, here, there, 1e-6 + 2e-14 * late * factor)
    assert lost <= (4 if name in ("touch", "disc", "relay and friction") else 0)
