"""What do derivatives and gradients cost, in plain solves of the same run?

Forward: the friction oscillator (rho = 3, beta = 0.1) over 20 periods, by its 3 initial values and 4 parameters.
Backward: a cost with an integral, by 50 parameters: of the oscillator under a drive of 50 Fourier coefficients, and of
a chain of 10 blocks with dry friction. Rounds are interleaved, in each a task is repeated for some milliseconds; the
least processor time is reported, compilation apart.

Goals: forward within 4 plain solves, backward within 6.

Peers, on the two oscillators, in the same rounds (gradient_peers.py). Both are given slip, stick and what ends them as
smooth pieces by hand, since neither slides: the stick's multiplier is solved on paper. Of several tolerances the
fastest whose gradient is within 1e-6 of the reference counts; the reference is pwsmooth at 1e-13, and what heyoka at
1e-15 differs from it is told.

heyoka    variational equations (`var_ode_sys`) of each piece with a terminal event. It has no jumps of derivatives at
          events and no adjoint: the saltation is added in NumPy, and 50 parameters are 50 columns forward
diffrax   Dopri8 to each event, in a compiled scan over as many pieces as the run has; forward mode, and reverse with
          recursive checkpoints through the events. XLA on one thread

Usage: python experiments/bench_derivatives.py [--rounds 40] [--no-peers] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import gc
import time

import numpy as np
import sympy as sp
from benchtools import provenance, write_json

from pwsmooth import Switch, System, solve
from pwsmooth.costs import Objective, final, integral

T, Y, V, Z, W = sp.symbols("t y v z w", real=True)
START = {Y: 0.5, V: 0.3, Z: 0}
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
BATCH = 3e-3  # s, for which a task is repeated: its first call after another one's pays for cold caches
WITHIN = 1e-6


def oscillator(pull, parameters):
    """(System, what a peer is given of it): the same pieces, by hand."""
    rho, beta = sp.symbols("rho beta", positive=True)
    lam = Switch("lam", V)
    values = parameters | {rho: 3, beta: 0.1}
    rates = {Y: V, V: -pull - V / 10 - lam * (1 + Z), Z: (rho * (1 - lam**2) - Z) / beta}

    def pieces(side):
        held = -pull / (1 + Z)
        slip = {Y: V, V: -pull - V / 10 - side * (1 + Z), Z: -Z / beta}
        return slip, {Y: sp.S.Zero, V: sp.S.Zero, Z: (rho * (1 - held**2) - Z) / beta}, held

    return System(rates, time=T, parameters=values), values, pieces


def forward():
    sigma, omega = sp.symbols("sigma omega", positive=True)
    system, values, pieces = oscillator(2.4 * sp.sin(omega * T) + sigma * Y, {sigma: 3.1, omega: 1})
    run = system, (0, 40 * np.pi), START
    names = ["rho", "beta", "sigma", "omega", "y", "v", "z"]
    tasks = {
        "plain": lambda: solve(*run),
        "derivatives": lambda: solve(*run, by=names).derivatives.end[0],
    }
    exact = solve(*run, by=names, **TIGHT)
    motion = dict(parameters=values, start=START, end=run[1][1], names=names, cost=Y)
    return tasks, (motion, pieces, exact.derivatives.end[0], len(exact.events))


def backward(system, span, start, cost, names):
    objective = Objective(system, cost, span, start, names)
    return {
        "plain": lambda: solve(system, span, start),
        "gradient": lambda: objective(objective.start).gradient,
    }


def driven(rng):
    c = sp.symbols("c1:51", real=True)
    waves = [f((j + 1) * T / 8) for j in range(25) for f in (sp.cos, sp.sin)]
    pull = 3.1 * Y + sum(a * wave for a, wave in zip(c, waves))
    system, values, pieces = oscillator(pull, dict(zip(c, (0.4 * rng.normal(size=50)).tolist())))
    span, cost = (0, 62.8), final(Y**2) + integral(V**2)
    tight = Objective(system, cost, span, START, list(c), **TIGHT)

    def with_area(side):
        slip, stick, held = pieces(side)
        return slip | {W: V**2}, stick | {W: sp.S.Zero}, held

    names = [s.name for s in c]
    motion = dict(parameters=values, start=START | {W: 0}, end=span[1], names=names, cost=Y**2 + W)
    exact, count = tight(tight.start).gradient, len(solve(system, span, START, **TIGHT).events)
    return backward(system, span, START, cost, list(c)), (motion, with_area, exact, count)


def chain(rng, n=10):
    y, v = sp.symbols(f"y1:{n + 1}", real=True), sp.symbols(f"v1:{n + 1}", real=True)
    bounds = {"k": (1, 2), "d": (0.05, 0.1), "f": (0.1, 0.3), "a": (0.5, 1.5), "b": (0.5, 1.5)}
    each = {name: sp.symbols(f"{name}1:{n + 1}", positive=True) for name in bounds}
    values = {s: float(rng.uniform(*bounds[name])) for name, row in each.items() for s in row}
    rates = {}
    for i, (k, d, f, a, b) in enumerate(zip(*each.values())):
        beside = [y[j] - y[i] for j in (i - 1, i + 1) if 0 <= j < n]
        rates[y[i]] = v[i]
        rates[v[i]] = -k * y[i] - d * v[i] - f * sp.sign(v[i]) + a * sp.cos(b * T) + sum(beside)
    start = dict(zip(rates, (0.5 * rng.normal(size=2 * n)).tolist()))
    cost = final(y[0] ** 2) + integral(v[3] ** 2)
    run = System(rates, time=T, parameters=values), (0, 20), start, cost, list(values)
    tight = Objective(run[0], cost, *run[1:3], run[4], **TIGHT)
    return backward(*run), (None, None, tight(tight.start).gradient, 0)


def peers(given, way):
    """Peer -> (plain, gradient, facts) at the loosest tolerance that is good enough; compiled and called once."""
    import gradient_peers as made

    motion, pieces, exact, count = given
    slip, stick, held = pieces(made.SIDE)
    symbols = {s.name: s for s in (*motion["parameters"], *motion["start"])}
    motion = made.Motion(
        T, slip=slip, stick=stick, lam=held, wall=V,
        **motion | {"names": tuple(symbols[name] for name in motion["names"])},
    )  # fmt: skip
    q, size = motion.values, np.abs(exact).max()

    def error(found):
        return float(np.abs(np.asarray(found[1]) - exact).max() / size)

    def heyoka(tol):
        integrators = [made.Variational(motion, tol, plainly) for plainly in (True, False)]
        return [lambda f=f: f(q) for f in integrators]

    compiled = [made.events(motion, count, how) for how in ("plain", way)]

    def diffrax(tol):
        from jax import block_until_ready

        return [lambda f=f: block_until_ready(f(q, tol, 1e-2 * tol, 0.3)) for f in compiled]

    best = error(heyoka(1e-15)[1]())
    print(f"  heyoka at 1e-15 and pwsmooth at 1e-13 differ by {best:.1e} of the gradient")
    found = {}
    for name, peer in (("heyoka", heyoka), ("diffrax", diffrax)):
        for tol in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
            began = time.process_time()
            plain, gradient = peer(tol)
            plain()
            off = error(gradient())
            spent = time.process_time() - began
            found.setdefault(name, {"compile_s": spent})  # of the first tolerance
            if off < WITHIN:
                found[name] |= {"plain": plain, "gradient": gradient, "tolerance": tol, "error": off}
                break
        else:
            print(f"  {name}: no tolerance is good enough; the last is {off:.1e} off")
            del found[name]
    return found, best


def measured(tasks, rounds):
    """Least processor time of a call of each task, s."""
    best = dict.fromkeys(tasks, np.inf)
    for task in tasks.values():
        task()
    gc.disable()
    for _ in range(rounds):
        for key, task in tasks.items():
            calls, began = 0, time.process_time()
            while not calls or time.process_time() - began < BATCH:
                task()
                calls += 1
            best[key] = min(best[key], (time.process_time() - began) / calls)
        gc.collect()
    gc.enable()
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--out", default=None)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    scenes = {
        "oscillator, 7 forward": forward(),
        "drive, 50 backward": driven(rng),
        "chain, 50 backward": chain(rng),
    }
    results, agreement = {}, {}
    for name, (tasks, given) in scenes.items():
        entrants = {"pwsmooth": dict(zip(("plain", "gradient"), tasks.values()))}
        motion, _, exact, _ = given
        off = np.abs(entrants["pwsmooth"]["gradient"]() - exact).max() / np.abs(exact).max()
        entrants["pwsmooth"] |= {"error": float(off)}
        if motion and not arguments.no_peers:
            others, agreement[name] = peers(given, "forward" if "forward" in name else "reverse")
            entrants |= others
        flat = {(who, key): one[key] for who, one in entrants.items() for key in ("plain", "gradient")}
        best = measured(flat, arguments.rounds)
        unit = best["pwsmooth", "plain"]
        for who, one in entrants.items():
            plain, gradient = best[who, "plain"], best[who, "gradient"]
            results[f"{name}: {who}"] = {
                "plain_ms": 1e3 * plain, "gradient_ms": 1e3 * gradient, "own plain solves": gradient / plain,
                "plain solves of pwsmooth": gradient / unit, "error": one["error"],
                "tolerance": one.get("tolerance"), "first calls with compilation (s)": one.get("compile_s"),
            }  # fmt: skip
            print(
                f"{name}: {who}: {1e3 * plain:.3f} ms plain, gradient {gradient / plain:.2f} of its own and "
                f"{gradient / unit:.2f} of pwsmooth's plain solves, error {one['error']:.1e}"
            )
    if arguments.out:
        content = {"options": vars(arguments), "provenance": provenance(), "results": results}
        write_json(arguments.out, content | {"heyoka at 1e-15 against pwsmooth at 1e-13": agreement})


if __name__ == "__main__":
    main()
