"""The same model said otherwise: the same answer. Two runs of the package are compared, no oracle says which is right.

Scales of states and of time (1e-9 to 1e9), shift of time, names and order of states and switches, a surface said twice
or as a multiple, cuts at random instants, what is returned, tolerances and methods; and the number of events at loose
and at tight tolerance, on runs whose error stays far below their distance to the nearest grazing.
The oracle only tells whether a difference is due to an ill-conditioned motion.
Chain: the fuzzers -> invariance.py (here) -> __main__.py.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from . import affine, hidden, judging, resets
from .judging import ILL, RECORDED, REFUSED, RIGHT, UNDECIDED, WRONG, Verdict
from .models import answer

TITLE = "invariances"
_BASES = (affine, affine, hidden, resets)


@dataclass
class Variant:
    """A System that says the same, its text, and the order of its states (old place of each new one)."""

    text: str
    system: object
    known: set
    order: list


def _variant(model, order=None, **changes):
    changes |= {"order": order} if order else {}
    return Variant(model.text(**changes), *model.system(**changes), order or list(range(model.n)))


def structure(seed):
    """The fuzzer that a structure is taken from, and its Model."""
    module = _BASES[seed % len(_BASES)]
    return module, module.structure(seed)


def _order(model, r):
    order = [i for i in r.permutation(model.n).tolist() if i not in model.bare]
    return [*order, *model.bare]


def compiled(_, seed):
    """The structure, itself and in other words."""
    module, model = structure(seed)
    r = np.random.default_rng([11, seed])
    as_is = _variant(model)
    order = _order(model, r)
    switch_order = r.permutation(len(model.surfaces)).tolist()
    variants = {"as is": as_is}
    variants["renamed, reordered"] = _variant(model, order, switch_order=switch_order, prefix="z")
    if model.surfaces:
        j = int(r.integers(len(model.surfaces)))
        factor = float(r.choice([1.0, -1.0, 2.5, -0.125, 1e3, 1e-3]))
        variants["said twice"] = _variant(model, repeat={j: factor})
    return judging.Played(module, model, variants, seed)


def _terms(model):
    """(row kind, row, term) of all terms; a surface that two events share stands once."""
    for row in model.rates:
        yield from (("rate", row, t) for t in row)
    for row in {id(row): row for row in [*model.surfaces, *(e.surface for e in model.events)]}.values():
        yield from (("surface", row, t) for t in row)


def _is_instant(model, row):
    return any(model.T in powers for _, _, powers in row)


def scaled(model, case, s):
    """The case with its states s times as large."""
    p = case.p.copy()
    for kind, row, (_, q, powers) in _terms(model):
        if q is not None and not (kind == "surface" and _is_instant(model, row)):
            p[q] *= s ** (1 - sum(power for v, power in powers.items() if v < model.n))
    for _, _, q, j, _ in model.kinks:
        p[q] *= s if _is_instant(model, model.surfaces[j]) else 1
    options = {**case.options, "atol": case.options.get("atol", 1e-12) * s}
    return dataclasses.replace(case, p=p, start=case.start * s, options=options)


def slowed(model, case, s):
    """The case with its time s times as long."""
    p = case.p.copy()
    for kind, row, (_, q, _) in _terms(model):
        if q is not None and kind == "rate":
            p[q] /= s
        if q is not None and kind == "surface" and _is_instant(model, row):
            p[q] *= s
    for _, _, q, j, _ in model.kinks:
        p[q] /= s * (s if _is_instant(model, model.surfaces[j]) else 1)
    options = dict(case.options)
    if "max_step" in options:
        options["max_step"] *= s
    return dataclasses.replace(
        case, p=p, w=case.w / s, t0=case.t0 * s, instants=case.instants * s, options=options
    )


def shifted(model, case, by):
    """The case, later."""
    p = case.p.copy()
    for kind, row, (_, q, powers) in _terms(model):
        if kind == "surface" and q is not None and not powers and _is_instant(model, row):
            p[q] -= by
    return dataclasses.replace(case, p=p, a=case.a - case.w * by, t0=case.t0 + by, instants=case.instants + by)


def _run(variant, case, instants=None, start=None, t0=None, **more):
    start = case.start if start is None else start
    instants = case.instants if instants is None else instants
    return judging.solve(
        variant.system, (case.t0 if t0 is None else t0, float(instants[-1])),
        start[variant.order].tolist(), parameters=case.parameters(variant.known),
        **{"max_steps": judging.STEPS, "t_eval": instants, **case.options, **more},
    )  # fmt: skip


def _states(variant, solution):
    """States at the instants, in the model's order; nan where the run did not come."""
    out = np.empty_like(solution.x)
    out[variant.order] = solution.x
    return out.T


def other_run(played, case, r):
    """What was changed, the states at the instants (inf where none was asked for), and the solutions."""
    model, variants = played.model, played.system
    as_is = variants["as is"]
    changes = ["shift", "cuts", "steps", "dense", "method", *[k for k in variants if k != "as is"]]
    if played.module is not resets:
        changes += ["scale", "slow"]
    change = str(r.choice(changes))
    if change in variants:
        solution = _run(variants[change], case)
        return change, _states(variants[change], solution), [solution]
    if change == "scale":
        s = float(10 ** r.uniform(-9, 9))
        solution = _run(as_is, scaled(model, case, s))
        return f"scale 1e{np.log10(s):+.0f}", _states(as_is, solution) / s, [solution]
    if change == "slow":
        s = float(10 ** r.uniform(-6, 6))
        solution = _run(as_is, slowed(model, case, s))
        return f"slow 1e{np.log10(s):+.0f}", _states(as_is, solution), [solution]
    if change == "shift":
        solution = _run(as_is, shifted(model, case, float(r.uniform(-100, 100))))
        return change, _states(as_is, solution), [solution]
    if change == "steps":
        solution = _run(as_is, case, t_eval=None)
        unasked = np.full((len(case.instants) - 1, model.n), np.inf)
        return change, np.vstack([unasked, solution.x.T[-1:]]), [solution]
    if change == "dense":
        solution = _run(as_is, case, t_eval=None, dense_output=True)
        inside = case.instants[case.instants <= solution.t[-1]]
        return change, solution(inside).T, [solution]
    if change == "method":
        options = {"rtol": float(10 ** r.uniform(-12, -6)), "method": str(r.choice(["taylor", "rk"]))}
        case = dataclasses.replace(case, options={**case.options, **options})
        solution = _run(as_is, case)
        return f"method {options['method']}", _states(as_is, solution), [solution]
    cuts = np.sort(case.t0 + (case.instants[-1] - case.t0) * r.uniform(0, 1, int(r.integers(1, 5))))
    t0, start, rows, solutions = case.t0, case.start, [], []
    for end in [*cuts, case.instants[-1]]:
        inside = case.instants[(case.instants > t0) & (case.instants <= end)]
        wanted = inside if len(inside) and inside[-1] == end else np.append(inside, end)
        solution = _run(as_is, case, wanted, start, t0)
        solutions.append(solution)
        rows += list(solution.x.T[: len(inside)])
        if not solution.success:
            break
        t0, start = end, solution.x[:, -1]
    return "cuts", np.array(rows).reshape(-1, model.n), solutions


def events_agree(played, case):
    """(Whether loose and tight runs meet the same events, where the oracle says that they must; or None), tags."""
    as_is = played.system["as is"]
    if case.options.get("method") == "rk":
        return None, 0
    loose = _run(as_is, dataclasses.replace(case, options={"rtol": 1e-6, "atol": 1e-9}))
    tight = _run(as_is, dataclasses.replace(case, options={"rtol": 1e-12, "atol": 1e-15}))
    if not (loose.success and tight.success) or loose.ambiguities or tight.ambiguities:
        return None, 0
    # Which of those of one instant stands first is a matter of roundings.
    met = [
        [what for _, what in sorted((e.time, e.switch + e.kind) for e in run.events)] for run in (loose, tight)
    ]
    if met[0] == met[1]:
        return True, 0
    expected = answer(played.model, case)
    if expected.code:
        return None, 0
    growth = judging.spread(played.model, case, len(case.instants) - 1, 1e-8) / 1e-8
    close = 1e-6 * growth > 1e-3 * min(expected.graze.min(), 1.0)
    return None if close else False, expected.tags


def play(played, seed):
    """The verdict on one case."""
    model = played.model
    case = played.module.case(model, seed)
    r = np.random.default_rng([12, seed])
    try:
        if r.random() < 0.15:
            same, tags = events_agree(played, case)
            return Verdict({None: UNDECIDED, True: RIGHT, False: WRONG}[same], "events", tags=tags)
        one = _run(played.system["as is"], case)
        change, rows, others = other_run(played, case, r)
    except Exception as error:  # what a solve raises is a finding
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])
    failed = [s for s in others if not s.success]
    if not one.success or failed:
        if not one.success and failed and failed[-1].outcome == one.outcome:
            return Verdict(RIGHT, "both refused")
        which = (
            f"after {change}: {failed[-1].outcome.name}"
            if failed
            else f"not after {change}: {one.outcome.name}"
        )
        return Verdict(REFUSED, which)
    got = one.x.T
    if rows.shape != got.shape:
        return Verdict(WRONG, f"{change}: other instants")
    scale = 1 + float(np.max(np.abs(got)))
    options = {**case.options, "rtol": 1e-6 if change.startswith("method") else case.options.get("rtol", 1e-9)}
    allowed = 2 * judging.tolerance(options, scale)
    error = np.where(np.isposinf(rows), 0.0, np.abs(rows - got)).max(axis=1)
    if np.all(error <= allowed):
        return Verdict(RIGHT, change.split()[0], float(error.max()))
    worst = float(error.max())
    if any(s.ambiguities for s in [one, *others]):
        return Verdict(RECORDED, change.split()[0], worst)
    expected = answer(model, case)
    first = int(np.argmax(~(error <= allowed)))
    if not np.isfinite(expected.states[: first + 1]).all():
        return Verdict(UNDECIDED, f"differs, oracle {expected.code}", worst, expected.tags)
    size = min(options["rtol"], 1e-6) + case.options.get("atol", 1e-12) + 1e-12
    if worst <= 10 * judging.spread(model, case, first, size):
        return Verdict(ILL, "", worst)
    return Verdict(WRONG, change, worst, expected.tags)


def script(number, seed):
    """The case as it is, then the run that is compared with it."""
    from . import models

    played = compiled(None, number)
    case = played.module.case(played.model, seed)
    r = np.random.default_rng([12, seed])
    expected = answer(played.model, case)
    text = models.script(played.model, case, expected.states)
    if r.random() < 0.15:
        return text + "\n# compare the events at rtol 1e-6, atol 1e-9 with those at rtol 1e-12, atol 1e-15"
    calls, real = [], judging.solve

    def noted(system, span, start, **options):
        if options.get("t_eval") is not None:
            options["t_eval"] = options["t_eval"].tolist()
        which = next(v for v in played.system.values() if v.system is system)
        calls.append(f"{which.text}\ns = solve(S, {span}, {start}, **{options!r})")
        return real(system, span, start, **options)

    judging.solve = noted
    try:
        change = other_run(played, case, r)[0]
    finally:
        judging.solve = real
    other = "\n".join(calls)
    return f"{text}\n# {change}\n{other}\nprint(s.outcome.name, s.ambiguities, list(s.events), s.x)"
