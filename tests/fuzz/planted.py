"""Planted faults: every fuzzer must see a wrong number, and the oracle must agree with closed forms.

A fault is planted where a defect of the package would show, in what `solve` returns; the share of runs that were right
without it and are WRONG with it is what a fuzzer sees.
Chain: the fuzzers -> planted.py -> __main__.py, test_fuzz.py.
"""

from __future__ import annotations

import importlib

import numpy as np

from . import judging
from .models import Case, Model, answer


def _wrong_number(s):
    s.x[:, -1] += 1e-3 * (1 + np.abs(s.x).max())


def _late(s):
    s.x[:, 1:] = 0.99 * s.x[:, 1:] + 0.01 * s.x[:, :1]


def _nan(s):
    s.x[0, -1] = np.nan


def _ends_early(s):
    s.t, s.x = s.t[:-1], s.x[:, :-1]


FAULTS = {"a wrong number": _wrong_number, "a lag": _late, "nan": _nan, "an early end": _ends_early}


def seen(name, fault, structures=4, cases=8):
    """(planted, seen): runs that are right, and those of them that are WRONG with the fault."""
    module = importlib.import_module(f".{name}", __package__)
    real, planted, found = judging.solve, 0, 0
    for k in range(structures):
        played = getattr(module, "compiled", judging.compiled)(module, k)
        play = getattr(module, "play", judging.play)
        for i in range(cases):
            calls = []

            def spoiled(*arguments, calls=calls, **options):
                solution = real(*arguments, **options)
                calls.append(solution)
                # The first of the runs that are compared stays as it is.
                if (
                    name not in ("invariance", "assemblies", "links", "layers", "noises", "compose")
                    or len(calls) > 1
                ):
                    FAULTS[fault](solution)
                return solution

            verdict = play(played, k * 1000 + i)
            if verdict.kind != judging.RIGHT or verdict.reason in ("events", "dense", "both refused"):
                continue
            judging.solve = spoiled
            try:
                again = play(played, k * 1000 + i)
            finally:
                judging.solve = real
            if again.kind == judging.UNDECIDED:
                continue  # without the oracle a difference is not called wrong
            planted += 1
            found += again.kind == judging.WRONG
    return planted, found


def closed_forms():
    """(what, the oracle's number, the closed form) of motions that are known."""
    # x' = v, v' = 1.5 - 2.5 sign(v) from v = -1: stops at 1/4 and sticks; x = -1/8.
    M = Model(2, [[(1.0, None, {1: 1})], [(1.5, None, {}), (-2.5, None, {5: 1})]])
    M.surfaces, M.notation = [[(1.0, None, {1: 1})]], ["Switch"]
    run = answer(M, Case(np.zeros(0), 1.0, 0.0, np.array([0.0, -1.0]), 0.0, np.array([2.0])))
    yield "friction stops", run.states[0, 0], -1 / 8
    # A ball that falls from 1 under 9.81 with restitution 1/2 is at rest from 3 sqrt(2/9.81) on, then a force lifts it.
    M = Model(2, [[(1.0, None, {1: 1})], [(-9.81, None, {}), (1.0, None, {5: 1}), (1.0, None, {6: 1})]])
    M.gaps, M.restitution, M.parameters = [[(1.0, None, {0: 1})]], [0], 1
    M.surfaces, M.notation = [[(1.0, None, {4: 1}), (-2.0, None, {})]], ["Switch"]
    M.rates[1] = [(-9.81, None, {}), (6.0, None, {5: 1}), (5.0, None, {}), (1.0, None, {6: 1})]
    # Before t = 2 the force is -9.81 + 5 - 6, after it 1.19.
    run = answer(M, Case(np.array([0.5]), 1.0, 0.0, np.array([1.0, 0.0]), 0.0, np.array([1.9, 4.0])))
    yield "a ball comes to rest", run.states[0, 0], 0.0
    yield "and is lifted", run.states[1, 0], 1.19 * 2**2 / 2
    # u' = 2 sin t - lam (4 - 3 lam^2) slides from u = 0 until 2 sin t reaches the fold's 16/9.
    M = Model(1, [[(2.0, None, {1: 1}), (-4.0, None, {4: 1}), (3.0, None, {4: 3})]])
    M.surfaces, M.notation = [[(1.0, None, {0: 1})]], ["Switch"]
    end = 1.5
    case = Case(np.zeros(0), 1.0, 0.0, np.array([0.0]), 0.0, np.array([end]), on=(0,))
    fold = np.arcsin(8 / 9)
    # The fold: max over lam of 4 lam - 3 lam^3 = 16/9 at lam = 2/3.
    yield "a fold ends a slide", answer(M, case).states[0, 0], 2 * (np.cos(fold) - np.cos(end)) - (end - fold)


def against_exponentials(cases=20):
    """Largest difference of the oracle from restarted matrix exponentials on smooth and on sliding affine motion."""
    from scipy.linalg import expm

    r = np.random.default_rng(0)
    worst = 0.0
    for _ in range(cases):
        A, b = r.uniform(-1, 1, (3, 3)), r.uniform(-1, 1, 3)
        rows = [[(A[i, k], None, {k: 1}) for k in range(3)] + [(b[i], None, {})] for i in range(3)]
        # On x0 = 0 the strong switch holds x0; the rest is affine with lam solved out.
        push = r.uniform(-1, 1, 3)
        push[0] = -60.0
        for i in range(3):
            rows[i].append((push[i], None, {6: 1}))
        M = Model(3, rows, surfaces=[[(1.0, None, {0: 1})]], notation=["Switch"])
        start = np.append(0.0, r.uniform(-1, 1, 2))
        run = answer(M, Case(np.zeros(0), 1.0, 0.0, start, 0.0, np.array([2.0]), on=(0,)))
        slid = A - np.outer(push, A[0]) / push[0]
        shift = b - push * b[0] / push[0]
        whole = expm(2.0 * np.block([[slid, shift[:, None]], [np.zeros((1, 4))]]))
        worst = max(worst, float(np.max(np.abs(run.states[0] - (whole @ np.append(start, 1.0))[:3]))))
    return worst


def main(names):
    """Prints what each fuzzer sees of each fault; 1 if one is blind."""
    blind = False
    for what, got, exact in closed_forms():
        print(f"oracle, {what}: {got - exact:.1e} from the closed form")
        blind |= not abs(got - exact) < 1e-9
    worst = against_exponentials()
    print(f"oracle, sliding: {worst:.1e} from matrix exponentials")
    blind |= not worst < 1e-11
    for name in names:
        for fault in FAULTS:
            planted, found = seen(name, fault)
            print(f"{name}, {fault}: {found} of {planted} seen", flush=True)
            blind |= planted == 0 or found < 0.9 * planted
    return int(blind)
