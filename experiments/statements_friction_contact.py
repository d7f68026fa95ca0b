"""E16: what the texts on friction and contact models say beside their figures, checked one by one.

The multistate law of Xiong's thesis (its equations reconstructed): no drift, stick-slip, non-local memory, rate
independence, what each parameter does; and of its chapter 5 the theorem that turns (5.3) into (5.4), the restitution of
Kelvin-Voigt and of Hunt-Crossley, and how far the linear law is from Hertz's.

Usage: python experiments/statements_friction_contact.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures.contact import contact_curves
from paper_figures.figure_5_01 import MIDDLE, exponents
from pwsmooth.laws.contact import HuntCrossley, KelvinVoigt, LinearResidual
from pwsmooth.laws.friction import LuGre, MultistateXKY
from pwsmooth.laws.friction.realtime import real_time
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import block_on_belt, force_driven, free_impact, prescribed_motion, pressed_block, t

# The reference set in SI units: 1e5 N/m in all, 1 and 1.5 N.
SI = dict(
    F_s=1.5, v_s=1e-3, kappa=tuple(3.4e4 / i for i in range(1, 11)), share=(0.1,) * 10, sigma=30.0, sigma2=0.4
)
SIZE, RATE = sp.symbols("size rate", positive=True)


@dataclass(frozen=True)
class Config:
    """Cycles of the small force, and random cases of the theorems."""

    cycles: int = 20
    cases: int = 20_000


def finished(run):
    """The run, or an error with what happened."""
    if not run.success:
        raise RuntimeError(run.message)
    return run


def drift(law, cycles):
    """Displacement (m) at the end of each cycle of the force 0.75 + 0.5 sin(2 pi t) N on 1 kg."""
    drive = 0.75 + 0.5 * sp.sin(2 * sp.pi * t)
    run = finished(force_driven(law, drive, t_span=(0, cycles)).solve(dense_output=True))
    return run(np.arange(cycles + 1.0), "x")


def belt():
    """Times at which slip starts (v rises through 0.05 m/s) of a block on a spring that is pulled at 0.1 m/s."""
    run = finished(block_on_belt(MultistateXKY(**SI)).solve(dense_output=True))
    times = np.linspace(0, run.t[-1], 200_001)
    v = run(times, "v")
    return times[1:][(v[1:] >= 0.05) & (v[:-1] < 0.05)], float(np.abs(v).max())


def loop(rate, size=0.25, **parameters):
    """(position, force) over the second period of p = size sin(2 pi rate t), in um and N."""
    law = MultistateXKY(**({"sigma": 1e-3} | parameters))
    scene = prescribed_motion(
        law,
        position=SIZE * sp.sin(2 * sp.pi * RATE * t),
        t_span=(0, 2 / rate),
        parameters={SIZE: size, RATE: rate},
    )
    run = finished(scene.solve(dense_output=True))
    times = np.linspace(1 / rate, 2 / rate, 2001)
    return run(times, "position"), run(times, "force")


def loss(rate=0.25, size=0.5, **parameters):
    """Loss of a loop (N um)."""
    p, force = loop(rate, size, **parameters)
    return float(np.trapezoid(force, p))


def steady(speeds=(1.0, 4.0, 8.0, 20.0, 80.0)):
    """Force (N) that settles at each constant speed (um/s), from rest bristles, and the Stribeck curve there."""
    found = []
    for speed in speeds:
        span = (0, 1 + 3 / speed)  # 1 um of travel bends every bristle to its strength
        run = finished(prescribed_motion(MultistateXKY(), velocity=speed, t_span=span).solve())
        found.append((speed, float(run["force"][-1]), float(1 + np.exp(-((speed / 8) ** 2)))))
    return found


def memory():
    """Force at 0.6 um on the way up, without and with an inner loop from 0.5 um back to 0.3 um and up again."""
    slow = 0.1  # um/s
    found = []
    for corners in ((0, 0.6), (0, 0.5, 0.3, 0.6)):
        lengths = np.abs(np.diff(corners))
        ends = np.concatenate([[0], np.cumsum(lengths)]) / slow
        signs = np.sign(np.diff(corners))
        velocity = sp.Piecewise(
            *((slow * int(s), t < sp.Float(end)) for s, end in zip(signs, ends[1:])),
            (slow * int(signs[-1]), True),
        )
        law = MultistateXKY(sigma=1e-3)
        run = finished(prescribed_motion(law, velocity=velocity, t_span=(0, ends[-1])).solve(dense_output=True))
        found.append(float(run(ends[-1], "force")))
        if len(corners) > 2:
            # Back at the point where the inner loop began.
            found.append(float(run(ends[1], "force") - run(ends[2] + 0.2 / slow, "force")))
    return found


def theorems(cases, seed=1):
    """Largest violations over random numbers: of y in L Sgn(x - y/s) by y = clip(s x, L), and of (5.3) by (5.4)."""
    draw = np.random.default_rng(seed)
    x, L, s = draw.normal(0, 2, cases), draw.uniform(0.1, 2, cases), draw.uniform(0.1, 3, cases)
    y = np.clip(s * x, -L, L)
    w = x - y / s
    sgn = np.where(w > 1e-12, np.abs(y - L), np.where(w < -1e-12, np.abs(y + L), np.maximum(np.abs(y) - L, 0)))
    a, p = draw.normal(0, 1, (2, cases))
    beta, gamma, K = draw.uniform(0, 2, cases), draw.uniform(0.1, 50, cases), 7.0
    rate = np.maximum(-gamma * a / (1 + gamma * beta), gamma * (p - a))  # (5.4a)
    force = -K * np.maximum(0, p + beta * gamma * (p - a))  # (5.4b)
    y = a + (1 / gamma + beta) * rate  # in dio(w), (5.3a): y >= 0, w >= 0, y w = 0
    w = gamma * (a - p) + rate
    dio = np.maximum(np.maximum(-y, -w), np.minimum(y, w))
    return {"sgn": float(sgn.max()), "dio": float(dio.max()), "force": float(np.abs(force + K * y).max())}


def restitutions(law, speeds=(0.1, 0.3, 1.0, 3.0)):
    """Restitution at each impact speed."""
    found = []
    for speed in speeds:
        _, _, v, _ = contact_curves(free_impact(law, speed=speed))
        found.append(float(-v[-1] / speed))
    return found


def run(config):
    """All computations."""
    starts, fastest = belt()
    # The same stiffness at first, strength and micro-damping in all, by n elements.
    numbers = {}
    for n in (1, 2, 5, 10, 20):
        weights = 1 / np.arange(1, n + 1)
        kappa = 7.3224 * weights / weights.sum()
        numbers[n] = dict(kappa=tuple(map(float, kappa)), share=(1 / n,) * n, sigma=0.1 / n)
    reference = loop(0.025)
    return {
        "drift": {"multistate": drift(MultistateXKY(**SI), config.cycles), "LuGre": drift(LuGre(), config.cycles)},
        "starts": starts,
        "fastest": fastest,
        "steady": steady(),
        "memory": memory(),
        "rates": {str(rate): float(np.abs(loop(rate)[1] - reference[1]).max()) for rate in (0.05, 0.25, 2.5)},
        "largest": float(np.abs(reference[1]).max()),
        "sigma": {str(x): loss(sigma=x) for x in (1e-3, 1e-2, 3e-2)},
        "tau_d": {str(x): peak(x) for x in (0.005, 0.02, 0.08)},
        "number": {str(n): softness(**values) for n, values in numbers.items()},
        "theorems": theorems(config.cases),
        "kelvin_voigt": restitutions(KelvinVoigt(K=1000, b=0.02)),
        "hunt_crossley": restitutions(HuntCrossley(K=1000, b=1.0)),
        "one_step": one_step(),
        "pulled": {
            "Kelvin-Voigt": pulled(KelvinVoigt(K=1000, b=0.02)),
            "linear residual": pulled(LinearResidual(K=1000, beta=0.02, gamma=500)),
        },
        "spring": exponents(*contact_curves(free_impact(KelvinVoigt(K=1000, b=1e-9)), names=("p", "force"))[1:]),
        "linear": exponents(*contact_curves(free_impact(LinearResidual(K=1000, beta=0.02, gamma=500)),
                                            names=("p", "force"))[1:]),
    }  # fmt: skip


def pulled(law):
    """Least force over the largest while a pull of 3000 N/s beyond 0.08 s takes a contact off."""
    scene = pressed_block(law, -3000 * sp.Max(0, t - 0.08), t_span=(0, 0.4))
    force = contact_curves(scene, names=("force",), x0=dict(scene.x0) | {"p": 0.0, "v": 1.0})[1]
    return float(force.min() / force.max())


def one_step(cases=2000, seed=0):
    """Of the closed-form step of a mass with ten elements: largest defect of backward Euler's equation (N), and the
    processor time of a step (s)."""
    draw, worst = np.random.default_rng(seed), 0.0
    for _ in range(cases):
        law = real_time(MultistateXKY(sigma=0.1, v_s=1.0, sigma2=0.2))
        kappa = law.e[0]
        law.state[1:] = draw.uniform(-1, 1, len(kappa)) * law.e[2] / kappa
        before, (v, u), h = law.state[1:].copy(), draw.normal(0, 3, 2), 10 ** draw.uniform(-4, 0)
        w = law.move(v, u, 1.0, h)
        limit = law.e[2] * law.state[0]  # of the velocity before the step
        f = np.clip(kappa * before + (0.1 + h * kappa) * w, -limit, limit)
        worst = max(worst, abs((w - v) / h - (u - f.sum() - 0.2 * w)) / (abs(u) + (abs(v) + abs(w)) / h))
    v, begin = 0.0, time.process_time()
    for k in range(20_000):
        v = law.move(v, 3 * math.sin(1e-3 * k), 1.0, 1e-3)
    return {"defect": worst, "seconds": (time.process_time() - begin) / 20_000}


def peak(tau_d):
    """Largest force after a reversal of v = 10 sin(2 pi t) um/s (N)."""
    law = MultistateXKY(tau_d=tau_d)
    run = finished(
        prescribed_motion(law, velocity=10 * sp.sin(2 * sp.pi * t), t_span=(0, 2)).solve(dense_output=True)
    )
    return float(run(np.linspace(1, 2, 20_001), "force").max())


def softness(**parameters):
    """Largest jump of the stiffness df/dp along a loading branch, as a share of the whole stiffness."""
    p, force = loop(0.025, 1.0, **parameters)
    loading = slice(600, 1400)  # from one turn to the other, downwards
    stiffness = np.gradient(force[loading], p[loading])[20:-20]
    return float(np.abs(np.diff(stiffness)).max() / np.abs(stiffness).max())


def claims(data):
    """What the sources say beside what was found."""

    def said(statement, source, ours, holds, otherwise, place, *, origin="printed"):
        where = f"friction thesis, {place}"
        return claim(statement, source, ours, holds, otherwise, origin=origin, where=where)

    def shown(*parts):
        return said(*parts, "chapter 4, conclusion", origin="reconstruction")

    steps = {law: np.diff(path)[1:] for law, path in data["drift"].items()}
    periods = np.diff(data["starts"])
    without, inner, gap = data["memory"]
    off = {float(rate): apart / data["largest"] for rate, apart in data["rates"].items()}
    listed = lambda found: ", ".join(f"{value:.4g} ({name})" for name, value in found.items())  # noqa: E731
    rises = lambda found: list(found.values()) == sorted(found.values())  # noqa: E731
    kv, hc = np.array(data["kelvin_voigt"]), np.array(data["hunt_crossley"])
    random, linear = data["theorems"], data["linear"]
    return [
        shown("the multistate law does not drift under a small cyclic force", "no drift",
              f"{np.abs(steps['multistate']).max():.1e} m a cycle after the first; LuGre {steps['LuGre'].mean():.3e} m",
              np.abs(steps["multistate"]).max() < 1e-10, "it drifts"),
        shown("the multistate law has the Stribeck effect: its steady force falls with the speed", "on g(v)",
              ", ".join(f"{force:.6f} N at {speed:g} um/s" for speed, force, _ in data["steady"])
              + f"; off g(v) by {max(abs(force - g) for _, force, g in data['steady']):.1e} N",
              all(abs(force - g) < 1e-5 for _, force, g in data["steady"])
              and all(np.diff([force for _, force, _ in data["steady"]]) < 0), "it does not fall"),
        shown("the multistate law shows stick-slip oscillation", "stick-slip",
              f"a block on a spring pulled at 0.1 m/s slips every {periods[-1]:.4f} s, up to {data['fastest']:.3f} m/s",
              len(periods) >= 3 and np.ptp(periods[-2:]) < 1e-3, "it does not"),
        shown("hysteresis with non-local memory: after an inner loop the outer branch goes on", "the same force",
              f"{without:.6f} N without, {inner:.6f} N with an inner loop, left {abs(gap):.1e} N from its begin",
              abs(without - inner) < 1e-6, "the force remembers the inner loop"),
        shown("the loop is independent of the rate", "equal loops",
              ", ".join(f"{100 * share:.2f} % at {rate:g} Hz" for rate, share in off.items())
              + " from that at 0.025 Hz",
              max(off.values()) < 0.01,
              "as long as micro-damping sigma_i v is small: it is rate-independent for slow motion only"),
        claim("more micro-damping: more loss (N um, A = 0.5 um, 0.25 Hz)", "rises with sigma_i", listed(data["sigma"]),
              rises(data["sigma"]), "it does not"),
        claim("a longer lag: a lower peak after a reversal (N, 1 Hz)", "falls with tau_d", listed(data["tau_d"]),
              rises({k: -v for k, v in data["tau_d"].items()}), "it does not"),
        claim("more elements: a smoother loop (largest jump of stiffness, share of the stiffness)", "falls with n",
              listed(data["number"]), rises({k: -v for k, v in data["number"].items()}), "it does not"),
        said("theorem: with dio (5.3) is equivalent to the equations (5.4)", "equivalent",
             f"20 000 random cases: off by {max(random['dio'], random['force']):.1e} at most",
             max(random["dio"], random["force"]) < 1e-9, "it is not", "section 5.1, (5.3), (5.4)"),
        claim("theorem: y in L Sgn(x - y/s) is y = clip(s x, L)", "equivalent", f"off by {random['sgn']:.1e} at most",
              random["sgn"] < 1e-12, "it is not", origin="derived", where="the law of one state"),
        said("Kelvin-Voigt's restitution is independent of the impact's speed", "independent",
             f"{kv.min():.9f} to {kv.max():.9f} at 0.1 to 3 m/s", np.ptp(kv) < 1e-8, "it depends on it",
             "section 5.1, (5.1)"),
        claim("Hunt-Crossley's restitution falls with the impact's speed", "falls",
              ", ".join(f"{e:.4f}" for e in hc) + " at 0.1, 0.3, 1, 3 m/s", np.all(np.diff(hc) < 0), "it does not"),
        said("Kelvin-Voigt's force is linear in the indentation, unlike Hertz's", "exponent 1, Hertz 3/2",
             f"d ln F/d ln p = {', '.join(f'{x:.5f}' for x in data['spring'])} without damping",
             max(abs(x - 1) for x in data["spring"]) < 1e-4, "it is not", "section 5.1, (5.1)"),
        said("pulled off, (5.4) is never sticky, as Kelvin-Voigt is", "no tension; tension",
             f"least force {data['pulled']['linear residual']:.1e} of the largest; Kelvin-Voigt "
             f"{data['pulled']['Kelvin-Voigt']:.3f}",
             data["pulled"]["linear residual"] > -1e-9 and data["pulled"]["Kelvin-Voigt"] < -0.02, "it is not so",
             "section 5.1, (5.4)"),
        shown("the multistate law is cheap enough for real time, without iterations", "a step in closed form",
              f"it solves backward Euler's equation to {data['one_step']['defect']:.0e} of its terms, in "
              f"{1e6 * data['one_step']['seconds']:.1f} us of processor time with ten elements (10 % of a controller's "
              "1 ms are 100 us)", data["one_step"]["defect"] < 1e-12, "it is no solution"),
        said("the linear law (5.3) is not close to Hertz's curve", "exponent far from 3/2",
             f"d ln F/d ln p = {', '.join(f'{x:.2f}' for x in linear)} at {', '.join(f'{x:g}' for x in MIDDLE)} of the "
             "largest p", max(linear) < 1.2, "it is close", "section 5.1"),
    ]  # fmt: skip


def draw(data):
    """Drift, elements, restitution over speed."""
    figure = new_figure(3.5, 7.4)
    left, middle, right = figure.subplots(3, 1)
    for (name, path), colour, dash in zip(data["drift"].items(), ("right", "left"), ("-", "--")):
        left.plot(1e6 * np.array(path), dash, color=COLOUR[colour], label=name)
    left.set(xlabel="cycles", ylabel="displacement (µm)", title="drift")
    left.legend()
    middle.loglog(
        [int(n) for n in data["number"]],
        list(data["number"].values()),
        "o-",
        color=COLOUR["stick"],
        markersize=4,
    )
    middle.set(xlabel="elements n", ylabel="jump of stiffness, relative", title="more elements")
    speeds = (0.1, 0.3, 1.0, 3.0)
    right.semilogx(speeds, data["kelvin_voigt"], "o-", color=COLOUR["left"], label="Kelvin-Voigt", markersize=4)
    right.semilogx(
        speeds, data["hunt_crossley"], "s--", color=COLOUR["right"], label="Hunt-Crossley", markersize=4
    )
    right.set(xlabel="speed of the impact (m/s)", ylabel="restitution", ylim=(0, 1), title="restitution")
    right.legend()
    return figure


STUDY = Study(
    name="statements_friction_contact",
    question="Which properties do the texts on friction and contact models name beside their figures? Are they so?",
    expected="All of them; rate independence for slow motion only.",
    full=Config(),
    fast=Config(cycles=5),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
