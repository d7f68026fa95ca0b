"""The yardstick: do two checkouts give the same bits?

    python tests/yardstick.py BEFORE [AFTER] [--only WORD]     (AFTER: the checkout that this file stands in)

Each checkout runs the same cases in a process of its own: the comparison scenes by every path and three tolerances,
impacts, accumulation, events, memories, families, layered and smoothed views, noise, friction laws, a sweep, orbits.
What a case gives (states, times, multipliers, events, itinerary, ambiguities, dense output, cost) is compared to the
last bit, and what differs is listed with its largest difference. Nothing is stored from run to run.
"""

from __future__ import annotations

import argparse
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOLERANCES = (1e-6, 1e-9, 1e-12)


def of_solution(sol):
    """The parts of a solution, each as what can be compared to the last bit."""
    import numpy as np

    parts = {
        "outcome": sol.outcome.name,
        "t": np.asarray(sol.t),
        "x": np.asarray(sol.x),
        "multipliers": np.asarray(sol.mult),
        "status": np.asarray(sol.status),
        "events": [(e.time, e.switch, e.kind, e.note) for e in sol.events],
        "ambiguities": [(a.time, a.switch, a.kind, a.taken) for a in sol.ambiguities],
        "itinerary": tuple(sol.itinerary),
        "cost": {name: n for name, n in sol.cost.items() if isinstance(n, int)},
    }
    if sol.dense is not None and len(sol.t) > 1:
        parts["dense"] = np.asarray(sol(np.linspace(sol.t[0], sol.t[-1], 101)))
    return parts


def cases():
    """(name, function that gives its parts), in order."""
    import family_models
    import numpy as np
    import sympy as sp

    from pwsmooth import (
        Diffusion,
        Event,
        Kicks,
        Memory,
        Strobe,
        Switch,
        System,
        Unilateral,
        find_orbit,
        solve,
        sweep,
    )
    from pwsmooth.compare.efficiency.cases import CASES
    from pwsmooth.laws import contact, friction
    from pwsmooth.scenes import block_on_belt, falling_ball, impact_oscillator, prescribed_motion

    t, x, y, v, w, z, u = sp.symbols("t x y v w z u", real=True)

    def run(*args, **options):
        return lambda: of_solution(solve(*args, **options))

    for name, case in CASES.items():
        for rtol in TOLERANCES:
            for method in ("taylor", "rk"):
                span = (0.0, case.t_end)
                yield (
                    f"{name} {method} {rtol:g}",
                    run(
                        case.system,
                        span,
                        case.x0,
                        method=method,
                        rtol=rtol,
                        atol=rtol / 1000,
                        dense_output=True,
                    ),
                )
    lugre = CASES["lugre"]
    for rtol in TOLERANCES:
        yield f"lugre stiff {rtol:g}", run(lugre.system, (0, 6), lugre.x0, method="stiff", rtol=rtol)
    lam, A, B = (
        Switch("lam", v),
        Unilateral(x, restitution=sp.Rational(1, 2), name="A"),
        Unilateral(y - x, name="B"),
    )
    m = Memory("m", 1)
    table = y - sp.sin(t) / 4
    shaken = Unilateral(table, restitution=sp.Rational(1, 2), name="A")
    hidden = System(
        {y: v, v: -2.4 * sp.sin(t) - 3.1 * y - v / 10 - lam * (1 + 3 * z), z: (1 - lam**2 - z) / 0.1}, time=t
    )
    instant = System({y: v, v: -2.4 * sp.sin(t) - 3.1 * y - v / 10 - lam * (4 - 3 * lam**2)}, time=t)
    systems = {
        "hidden instant": (instant, 40, [0.5, 0.3]),
        "layered oo": (hidden.layered({z: sp.oo}), 40, [0.5, 0.3]),
        "layered 1/2": (hidden.layered({z: sp.Rational(1, 2)}), 40, [0.5, 0.3]),
        "layered 0": (hidden.layered({z: 0}), 40, [0.5, 0.3]),
        "ball on a table": (System({y: v, v: -1 + shaken.reaction}, time=t), 20, [1, 0]),
        "two bodies": (
            System({x: w, w: -1 + A.reaction - B.reaction, y: v, v: -1 + B.reaction}),
            0.5,
            [0.2, 0, 1, 0],
        ),
        "twisting": (System({x: v, v: -2 * sp.sign(x) - sp.sign(v)}), 20, [1, 0]),
        "thermostat": (
            System(
                {x: m},
                events=[Event(x - 1, direction=1, update={m: -1}), Event(x, direction=-1, update={m: 1})],
            ),
            20,
            [0.3],
        ),
        "clock": (System({x: -x + m}, events=[Event(every=sp.Rational(1, 3), update={m: -m})]), 10, [0.3]),
        "neuron": (System({x: 2 - x, u: -u}, events=[Event(x - 1, update={x: 0, u: u + 1})]), 10, [0, 0]),
        "clip": (System({x: v, v: -sp.Max(-1, sp.Min(1, 3 * x)) + sp.cos(t)}, time=t), 30, [1, 0]),
        "hertz": (System({x: v, v: -1 + 50 * sp.Max(0, -x) ** sp.Rational(3, 2)}), 20, [1, 0]),
        "two switches": (
            System({x: -sp.sign(x) - sp.sign(y) / 2 + sp.sin(t), y: sp.sign(x) / 3 - sp.sign(y)}, time=t),
            20,
            [1, 1],
        ),
    }
    for name, (system, end, start) in systems.items():
        for method in ("taylor", "rk"):
            yield f"{name} {method}", run(system, (0, end), start, method=method, dense_output=True)
    yield "at asked times", run(instant, (0, 40), [0.5, 0.3], t_eval=np.linspace(0, 40, 57))
    for eps in (1e-2, 1e-4):
        for method in ("taylor", "radau5", "radau13"):
            view = hidden.smoothed(eps=eps, sigmoid="algebraic")
            yield (
                f"smoothed {eps:g} {method}",
                run(view, (0, 20), [0.5, 0.3, 0], method=method, dense_output=True),
            )
    for name in ("thermostat", "neuron"):
        system, end, start = systems[name]
        yield f"{name} stiff", run(system, (0, end), start, method="stiff")
    kicks = Kicks(2e-4, every=2 * sp.pi / 500, on=(y, v), seed=1)
    yield "kicked", run(instant, (0, 20), [0.5, 0.3], noise=kicks)
    yield "kicked smoothed", run(hidden.smoothed(eps=1e-3), (0, 5), [0.5, 0.3, 0], noise=kicks)
    yield "diffusion", run(instant, (0, 5), [0.5, 0.3], noise=Diffusion({v: 0.01}, step=1 / 64, seed=1))
    for name in family_models.MODELS:
        template, written, start, span = family_models.both(name, 6)
        yield f"family {name} template", run(template, span, start)
        yield f"family {name} written out", run(written, span, start)
    for name in (
        "Coulomb",
        "StaticKinetic",
        "Dahl",
        "LuGre",
        "GMS",
        "MaxwellSlip",
        "Masing",
        "Elastoplastic",
        "Wojewoda",
    ):
        law = getattr(friction, name)
        for scene in (block_on_belt(law()), prescribed_motion(law(), velocity=sp.cos(t))):
            yield f"{name}: {scene.name}", run(scene.system, scene.t_span, scene.x0)
    for law in (contact.RigidImpact(), contact.Hertz(), contact.HuntCrossley(), contact.ResidualIndentation()):
        for scene in (impact_oscillator(law), falling_ball(law)):
            yield f"{type(law).__name__}: {scene.name}", run(scene.system, scene.t_span, scene.x0)
    sigma = sp.Symbol("sigma", positive=True)
    block = System(
        {y: v, v: -sigma * sp.sin(t) - 3.1 * y - v / 10 - lam * (4 - 3 * lam**2)},
        time=t,
        parameters={sigma: 2.4},
    )

    def swept():
        data = sweep(
            block,
            {"sigma": np.linspace(1, 4, 13)},
            x0=[0.5, 0.3],
            seen=Strobe(2 * sp.pi),
            transient=3,
            periods=4,
        )
        return {name: data[name].values for name in data.variables}

    yield "sweep", swept

    def orbit():
        found = find_orbit(block, [0.5, 0.3], seen=Strobe(2 * sp.pi), transient=20)
        return {"x": np.asarray(found.x), "multipliers": np.asarray(found.multipliers), "period": found.period}

    yield "orbit", orbit


def measured(only):
    """Every case's parts; an exception is a part too."""
    results = {}
    for name, parts in cases():
        if only in name:
            try:
                results[name] = parts()
            except Exception as error:  # a checkout may refuse what the other one runs
                results[name] = {"raises": f"{type(error).__name__}: {error}"}
    return results


def difference(a, b):
    """What differs, in words; empty where nothing does."""
    import numpy as np

    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        if a.shape != b.shape:
            return f"shape {a.shape} / {b.shape}, ends {a[..., -1:].ravel()} / {b[..., -1:].ravel()}"
        if a.dtype == b.dtype and a.tobytes() == b.tobytes():
            return ""
        if a.dtype.kind == "f":
            return f"up to {np.nanmax(np.abs(a - b)):.1e}"
        return "" if a.dtype.kind in "OUT" and (a == b).all() else f"in {np.sum(a != b)} places"
    if isinstance(a, list) and isinstance(b, list) and a != b:
        first = next((i for i, (p, q) in enumerate(zip(a, b, strict=False)) if p != q), min(len(a), len(b)))
        return f"{len(a)} / {len(b)} of them, first {first}: {a[first : first + 1]} / {b[first : first + 1]}"
    return "" if a == b else f"{a} / {b}"


def results_of(checkout, only):
    """The results of a checkout, from a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "results")
        paths = os.pathsep.join([str(checkout), str(HERE)])
        command = [sys.executable, "-W", "ignore", __file__, "--write", str(out), "--only", only]
        subprocess.run(command, env=os.environ | {"PYTHONPATH": paths}, cwd=folder, check=True)
        return pickle.loads(out.read_bytes())  # of our own process


def main():
    """Compare, or with --write be one of the two processes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", nargs="?", type=Path)
    parser.add_argument("after", nargs="?", type=Path, default=HERE.parent)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.write:
        options.write.write_bytes(pickle.dumps(measured(options.only)))
        return 0
    if options.before is None:
        parser.error("name the checkout to compare with")
    before, after = (results_of(path.resolve(), options.only) for path in (options.before, options.after))
    moved = 0
    for name in before:
        raised = [results[name].get("raises", "") for results in (before, after)]
        if raised[0] != raised[1]:
            moved += 1
            print(f"{name}: raises {raised[0] or 'nothing'} / {raised[1] or 'nothing'}")
            continue
        parts = sorted(before[name].keys() | after[name].keys())
        words = {part: difference(before[name].get(part), after[name].get(part)) for part in parts}
        if any(words.values()):
            moved += 1
            print(f"{name}:")
            for part, how in words.items():
                if how:
                    print(f"    {part}: {how}")
    print(f"{len(before)} cases, {moved} moved")
    return moved > 0


if __name__ == "__main__":
    sys.exit(main())
