"""What does a family of n elements cost: to set up, per right-hand side, per step, per period?

Question: is the cost O(n), and does setting up depend on n at all? Expected: symbolic work, generated text and its
machine code are those of one element, whatever n; everything at run time is proportional to n from some 100 elements
on, where overheads no longer count; written out, both grow, the compile time faster than n.

Models (tests/family_models.py)
-------------------------------
slip_stick      generalised Maxwell-slip in prescribed motion: a Memory and three events an element
clipped         the multistate differential-algebraic law in prescribed motion: two kinks an element
bristles        a mass on n LuGre bristles: a sum in the equation of motion
friction_chain  blocks on a belt coupled by springs: a switch an element that slides
implicit        an algebraic unknown and a sliding switch an element, and an unknown of the whole

With implicit steps: `friction_chain` in its smoothed view (eps = 1e-3), `bristles` with method="stiff"; `run` is the
whole span at rtol 1e-7. Under noise: `friction_chain` in its smoothed view (eps = 0.05), white noise on each velocity.

Columns: `setup` from the equations to machine code, without the kernels, which all models share (processor time, no
cache); `lines` of the generated text; `rhs` and `jet` (order 16) one call of the compiled function, the crossing from
Python taken off (nothing stands where the call is lost in it); `step` a step without an event (short steps over a
stretch that has few); `period` one period of the drive with all its steps and events, or the whole span. Times are
medians over rounds.

Usage: python experiments/bench_family.py [--n 10 100 1000] [--rounds 5] [--copies 10 40] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import time

import numpy as np
from benchtools import provenance, write_json
from family_models import MODELS, t, template_from

from pwsmooth import Diffusion, System, solve
from pwsmooth.codegen import compile_model
from pwsmooth.codegen.families.fields import FamilyFields
from pwsmooth.codegen.families.writing import write_family_jets
from pwsmooth.codegen.fields import write_fields
from pwsmooth.codegen.machine import native, vectors
from pwsmooth.codegen.stiff import elements, functions
from pwsmooth.codegen.taylor.jets import write_jets
from pwsmooth.noise.diffusion_run import DiffusionRun
from pwsmooth.paths.stiff_events import switched_by_events

NAMES = ("slip_stick", "clipped", "bristles", "friction_chain", "implicit")
ORDER, SHORT, STEPS = 16, 1e-6, 400


def setup(name, n):
    """(system, start, span, seconds of processor time, lines of text) without any cache."""
    begin = time.process_time()
    arguments, start, span = MODELS[name](n)
    system = System(**({"time": t} | arguments))
    model = system.model
    if model.families:
        texts = FamilyFields(model).write() | write_family_jets(model)
    else:
        texts = write_fields(model) | write_jets(model)
    for text in texts.values():
        native.build(text)
    spent = time.process_time() - begin
    return system, start, span, spent, sum(text.count("\n") for text in texts.values())


def per_call(function, arguments, repeats=200):
    """Seconds of one call through ctypes."""
    begin = time.process_time()
    for _ in range(repeats):
        function(*arguments)
    return (time.process_time() - begin) / repeats


def calls(system, start, rounds):
    """Medians of one right-hand side and of one jet, the crossing from Python taken off."""
    code = compile_model(system.model)
    x = np.array(system.initial_state(start))
    p = np.append(np.array(system.parameter_values), 0.0)
    kinds = [m.kind for m in system.model.multipliers]
    # On the sides that a start would give them; unknowns at 0.
    mult = np.array([0.0 if m.kind == "algebraic" else 1.0 for m in system.model.multipliers] or [0.0])
    out = [np.empty(code.n), np.empty(code.m + code.ne + 1), np.empty(code.m + 1)]
    at = [a.ctypes.data for a in (x, mult, p, *out)]
    stride = 40
    count, own = code.nrows_general if "algebraic" in kinds else code.nrows_slip
    rows = np.zeros((count + own, stride))
    mask = np.array([int(m.kind == "algebraic") for m in system.model.multipliers] or [0], np.int64)
    pointer, number, real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    fields = ctypes.CFUNCTYPE(None, real, *[pointer] * 6)(code.fields)
    if mask.any():
        jet = ctypes.CFUNCTYPE(number, real, *[pointer] * 4, number, number, pointer, number)(code.jet_general)
        jet_arguments = (0.1, *at[:3], mask.ctypes.data, ORDER, stride, rows.ctypes.data, count * stride)
    else:
        jet = ctypes.CFUNCTYPE(number, real, *[pointer] * 3, number, number, pointer, number)(code.jet_slip)
        jet_arguments = (0.1, *at[:3], ORDER, stride, rows.ctypes.data, count * stride)
    # Event 10**9 does not exist: nothing but the crossing.
    nothing = ctypes.CFUNCTYPE(number, number, real, *[pointer] * 4)(code.act)
    times = [
        (
            per_call(fields, (0.1, *at)),
            per_call(jet, jet_arguments, 20),
            per_call(nothing, (10**9, 0.1, *at[:3], out[0].ctypes.data)),
        )
        for _ in range(rounds)
    ]
    rhs, one_jet, crossing = (statistics.median(part) for part in zip(*times))
    return rhs - crossing, one_jet - crossing


def runs(system, start, span, rounds):
    """(seconds of one step without events, seconds of a period, its steps and events)."""
    solve(system, span, start)
    step, period = [], []
    for _ in range(rounds):
        begin = time.process_time()
        full = solve(system, span, start)
        period.append(time.process_time() - begin)
        end = span[0] + STEPS * SHORT
        begin = time.process_time()
        solve(system, (span[0], end), start, max_step=2 * STEPS * SHORT)
        base = time.process_time() - begin
        begin = time.process_time()
        short = solve(system, (span[0], end), start, max_step=SHORT)
        step.append((time.process_time() - begin - base) / (short.cost["steps"] - 1))
    return statistics.median(step), statistics.median(period), full


def measure(name, n, rounds, copies=False):
    with template_from(10**9 if copies else 1):
        system, start, span, spent, lines = setup(name, n)
    assert (system.model.families is None) == copies
    rhs, jet = calls(system, start, rounds)
    step, period, full = runs(system, start, span, rounds)
    return {
        "model": name, "n": n, "written out": copies, "setup": spent, "lines": lines, "rhs": rhs, "jet": jet,
        "step": step, "period": period, "steps": full.cost["steps"], "events": full.cost["events"],
        "outcome": full.outcome.name,
    }  # fmt: skip


def implicit_steps(name, n, rounds, copies=False):
    """Set-up and run of a model with implicit steps, without a cache."""
    with template_from(10**9 if copies else 1):
        begin = time.process_time()
        arguments, start, span = MODELS[name](n)
        system = System(**({"time": t} | arguments))
        system, method = (system.smoothed(1e-3), "auto") if name == "friction_chain" else (system, "stiff")
        model = switched_by_events(system.model) if method == "stiff" else system.model
        looped = model.families is not None
        vectors.build(elements.FamilyStiff(model).texts()["stiff"] if looped else functions.stiff_text(model))
        spent = time.process_time() - begin
        return row(name, n, model, spent, rounds, system, span, start, method=method, rtol=1e-7)


def under_noise(n, rounds, copies=False):
    """The same of a smoothed view under white noise on every velocity."""
    with template_from(10**9 if copies else 1):
        begin = time.process_time()
        arguments, start, span = MODELS["friction_chain"](n)
        system = System(**({"time": t} | arguments)).smoothed(0.05)
        noise = Diffusion({"w": 0.1}, step=(span[1] - span[0]) / 1024)
        model = DiffusionRun(system, noise).lowered.model
        for text in (FamilyFields(model).write() if model.families else write_fields(model)).values():
            native.build(text)
        spent = time.process_time() - begin
        return row("under noise", n, model, spent, rounds, system, span, start, noise=noise)


def row(name, n, model, spent, rounds, system, span, start, **options):
    """A line of the table, with the median time of a run."""
    solve(system, span, start, **options)
    taken = []
    for _ in range(rounds):
        begin = time.process_time()
        full = solve(system, span, start, **options)
        taken.append(time.process_time() - begin)
    return {
        "model": name, "n": n, "form": "written out" if model.families is None else "looped", "setup (s)": spent,
        "run (ms)": 1e3 * statistics.median(taken), "steps": full.cost["steps"], "events": full.cost["events"],
        "outcome": full.outcome.name,
    }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--n", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--copies", type=int, nargs="*", default=[10, 40])
    parser.add_argument("--models", nargs="+", default=NAMES, choices=MODELS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out")
    arguments = parser.parse_args()
    results = []
    print(f"{'model':16}{'n':>6} {'form':8}{'setup s':>9}{'lines':>7}{'rhs ns/n':>10}{'jet us/n':>10}"
          f"{'step us/n':>11}{'period ms':>11}{'steps':>7}{'events':>8}")  # fmt: skip
    for name in arguments.models:
        for n, copies in [*((n, False) for n in arguments.n), *((n, True) for n in arguments.copies)]:
            r = measure(name, n, arguments.rounds if n < 1000 else min(arguments.rounds, 3), copies)
            results.append(r)
            print(f"{name:16}{n:6d} {'copies' if copies else 'looped':8}{r['setup']:9.3f}{r['lines']:7d}"
                  f"{1e9 * r['rhs'] / n:10.2f}{1e6 * r['jet'] / n:10.3f}{1e6 * r['step'] / n:11.3f}"
                  f"{1e3 * r['period']:11.2f}{r['steps']:7d}{r['events']:8d}", flush=True)  # fmt: skip
    print(f"\n{'implicit steps':16}{'n':>6} {'form':12}{'setup s':>9}{'run ms':>11}{'steps':>7}{'events':>8}")
    implicit = []
    for name in ("friction_chain", "bristles", "under noise"):
        for n, copies in [
            *((n, False) for n in arguments.n if n < 1000),
            *((n, True) for n in arguments.copies),
        ]:
            if name == "under noise":
                r = under_noise(n, arguments.rounds, copies)
            else:
                r = implicit_steps(name, n, arguments.rounds, copies)
            implicit.append(r)
            print(f"{name:16}{n:6d} {r['form']:12}{r['setup (s)']:9.3f}{r['run (ms)']:11.2f}{r['steps']:7d}"
                  f"{r['events']:8d}", flush=True)  # fmt: skip
    if arguments.out:
        rows = [
            {
                "model": r["model"], "n": r["n"], "form": "written out" if r["written out"] else "looped",
                "setup (s)": r["setup"], "lines": r["lines"],
                "rhs/n (ns)": 1e9 * r["rhs"] / r["n"] if r["rhs"] > 0 else None,
                "jet/n (µs)": 1e6 * r["jet"] / r["n"], "step/n (µs)": 1e6 * r["step"] / r["n"],
                "period (ms)": 1e3 * r["period"], "steps": r["steps"], "events": r["events"], "outcome": r["outcome"],
            }
            for r in results
        ]  # fmt: skip
        write_json(
            arguments.out,
            {"options": vars(arguments), "provenance": provenance(), "results": rows, "implicit": implicit},
        )


if __name__ == "__main__":
    main()
