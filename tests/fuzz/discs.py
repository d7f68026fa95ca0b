"""Vector friction: slips that come to rest, stick and begin again, in the plane and in space, one disc or two.

Kinds of structures: inclines (closed forms as well), oscillators, the same with h = M v or in turned coordinates, no
isotropy, starts at rest and out of stick, two bodies, a disc beside a switch, jumps of the velocity, a normal force
that swings, a Stribeck curve in |v|, a hidden static friction.
The oracle's model is linear but for the friction; the package gets the same in other coordinates, y = T z.
Chain: polar.py, judging.py -> discs.py (here) -> __main__.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import judging, polar
from .affine import draw_options
from .judging import ILL, RECORDED, REFUSED, RIGHT, UNDECIDED, WRONG, Played, Verdict

TITLE = "discs"
STEPS = 5_000  # more than any case of these spans needs
KINDS = ("incline", "oscillator", "ellipse", "onset", "two bodies", "beside a switch", "swinging", "hidden")
_WORDS = ("stick", "slip by tangency", "slip by fold", "slip by reset", "crossing", "reset")


@dataclass
class Model:
    """Which numbers stand where: masks of the oracle's tables behind the change of coordinates."""

    kind: str
    N: int
    d: list  # of each disc; 1: a switch
    index: list  # its surfaces among the oracle's states
    blocks: list  # states that a change of coordinates mixes, by groups of places in y: [(places, how)]
    frequencies: int = 0
    forced: list = field(default_factory=list)  # places in y
    stiff: bool = False
    damped: bool = False
    constant: bool = True
    swing: bool = False
    stribeck: bool = False
    hidden: bool = False
    event: bool = False
    normal: list = field(default_factory=list)


@dataclass
class Case:
    """Tables of one run, the change of coordinates, rho of hidden terms."""

    P: polar.Disc
    T: np.ndarray
    start: np.ndarray  # y
    t0: float
    instants: np.ndarray
    rho: float = 0.0
    options: dict = field(default_factory=dict)
    exact: tuple = ()  # (time, y) of rest, closed form


def structure(seed):
    """A random Model."""
    r = np.random.default_rng([41, seed])
    kind = KINDS[seed % len(KINDS)]
    dim = int(r.choice([2, 3], p=[0.7, 0.3]))
    how = str(r.choice(["as is", "turned", "mixed"]))
    if kind == "two bodies":
        coupled = r.random() < 0.7
        M = Model(kind, 8, [2, 2], [[2, 3], [6, 7]], [([0, 1], "as is"), ([2, 3], how)])
        M.stiff, M.frequencies, M.forced = True, 2, [2, 3, 6, 7]
        M.normal = [coupled]
        return M
    if kind == "beside a switch":
        return Model(kind, 2 * dim + 2, [dim, 1], [list(range(dim, 2 * dim)), [2 * dim + 1]],
                     [(list(range(dim, 2 * dim)), how)], 2, [*range(dim, 2 * dim), 2 * dim + 1], True,
                     r.random() < 0.5, normal=[r.random() < 0.7])  # fmt: skip
    v = list(range(dim, 2 * dim))
    M = Model(kind, 2 * dim, [dim], [v], [(list(range(dim)), "as is"), (v, how)])
    if kind == "incline":
        M.blocks = [(v, "turned" if how == "mixed" else how)]
        return M
    M.frequencies, M.forced = int(r.integers(1, 3)), v
    M.stiff, M.damped = kind != "onset" or r.random() < 0.5, r.random() < 0.4
    M.swing = kind == "swinging"
    M.stribeck = kind == "swinging" or (kind in ("oscillator", "ellipse") and r.random() < 0.3)
    M.hidden = kind == "hidden"
    M.event = kind in ("oscillator", "ellipse", "swinging") and r.random() < 0.5
    return M


def _orthogonal(r, n):
    q, _ = np.linalg.qr(r.normal(size=(n, n)))
    return q


def _definite(r, n, spread):
    q = _orthogonal(r, n)
    return q @ np.diag(np.exp(r.uniform(-spread, spread, n))) @ q.T


def case(M, seed, options=True):
    """Random numbers for it."""
    r = np.random.default_rng([42, seed])
    N, K, S = M.N, len(M.d), M.frequencies
    T = np.eye(N)
    for places, how in M.blocks:
        if how == "turned":
            T[np.ix_(places, places)] = _orthogonal(r, len(places))
        elif how == "mixed":
            T[np.ix_(places, places)] = _orthogonal(r, len(places)) @ _definite(r, len(places), 0.4)
    L, c, B = np.zeros((N, N)), np.zeros(N), np.zeros((K, N, 3))
    cos, sin = np.zeros((S, N)), np.zeros((S, N))
    index = np.zeros((K, 3), np.int64)
    for k in range(K):
        index[k, : M.d[k]] = M.index[k]
    mu = r.uniform(0.4, 1.6, K)
    rho, thr = 0.0, np.ones(K)
    start = r.uniform(-1, 1, N)
    end = float(r.uniform(4, 14))
    exact = ()
    for k in range(K):  # positions
        for v in M.index[k]:
            L[v - M.d[k], v] = 1.0
    if M.kind == "incline":
        v = M.index[0]
        F = r.normal(size=len(v))
        kappa = float(1 + 10 ** r.uniform(-3, 2)) if r.random() < 0.85 else float(r.uniform(0.2, 0.99))
        F *= mu[0] / kappa / np.linalg.norm(F)
        if r.random() < 0.3:  # beside the line against the force
            away = r.normal(size=len(v))
            away -= away @ F * F / (F @ F)
            start[v] = (-F / np.linalg.norm(F) + 10 ** r.uniform(-12, -1) * away) * r.uniform(0.1, 2)
        c[v] = F
        B[0, v, range(len(v))] = -mu[0]
        if kappa > 1:
            exact = _rest(F, mu[0], start[: len(v)], start[v])
            end = exact[0] * float(r.uniform(1.01, 1.5))
        else:
            end = float(r.uniform(1, 5))
    elif M.kind == "two bodies":
        # A block on a block: u = v1 - v2 is the slip of the upper one, v2 that of the lower.
        m, k1, k2 = r.uniform(0.3, 3), r.uniform(0, 2), r.uniform(0.2, 3)
        both = mu[0] / m if M.normal[0] else 0.0
        for i in range(2):
            B[0, 2 + i, i], B[1, 6 + i, i] = -mu[0] - both, -mu[1]
            B[0, 6 + i, i], B[1, 2 + i, i] = both, mu[1] if M.normal[0] else 0.0
            L[6 + i, 4 + i] = -k2
            L[2 + i, 0 + i] = -k1
            if M.normal[0]:
                L[2 + i, 4 + i] = k2
    elif M.kind == "beside a switch":
        d = M.d[0]
        B[0, range(d, 2 * d), range(d)] = -mu[0]
        B[1, 2 * d + 1, 0] = -mu[1]
        for i in range(d):
            L[d + i, i] = -r.uniform(0.3, 2)
        L[2 * d + 1, 2 * d] = -r.uniform(0.3, 2)
        if M.normal[0]:  # inertia and springs couple them
            a = r.uniform(-0.4, 0.4, d) / np.sqrt(d)
            B[1, d : 2 * d, 0] = -mu[1] * a
            B[0, 2 * d + 1, range(d)] = -mu[0] * a
            L[d : 2 * d, 2 * d] = L[2 * d + 1, :d] = r.uniform(-0.3, 0.3)
    else:
        v, d = M.index[0], M.d[0]
        A = _definite(r, d, 0.8) if M.kind in ("ellipse", "onset") else np.eye(d) * r.uniform(0.5, 2)
        friction = A @ _definite(r, d, 0.3) if M.kind == "ellipse" else A
        if M.kind == "ellipse":  # so that it dissipates in every direction
            while np.linalg.eigvalsh(friction + friction.T)[0] < 0.1:
                friction = 0.7 * friction + 0.3 * np.eye(d)
        B[0, v[0] : v[-1] + 1, :d] = -mu[0] * friction
        if M.stiff:
            L[d:, :d] = -_definite(r, d, 0.7)
        if M.damped:
            L[d:, d:] = -r.uniform(0, 0.3) * np.eye(d)
        if M.hidden:
            rho = float(r.uniform(0.1, 4))
            thr[0] = 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5 if rho > 0.5 else 1.0
    w = r.uniform(0.2, 3, S)
    for s in range(S):
        for v in M.forced:
            cos[s, v], sin[s, v] = r.normal(size=2) * (1.5 if s == 0 else 0.6)
    if M.kind not in ("incline",):
        for v in M.forced:
            c[v] = r.normal() * 0.2
    if M.kind in ("onset", "hidden", "two bodies") or r.random() < 0.15:
        for k in range(K):
            if M.kind != "incline" and r.random() < 0.7:
                start[M.index[k]] = 0.0
    swing, pace = np.zeros(K), np.zeros(K)
    stribeck, width = np.zeros(K), np.ones(K)
    if M.swing:
        swing[0], pace[0] = r.uniform(-0.8, 0.8), r.uniform(0.3, 4)
    if M.stribeck:
        stribeck[0], width[0] = r.uniform(-0.4, 0.8), 10 ** r.uniform(-1.5, 0.5)
    event, level, jump = np.zeros(N), 0.0, np.zeros(N)
    if M.event:
        event[0], level = 1.0, r.uniform(-0.5, 0.8)
        jump[M.index[0]] = r.normal(size=M.d[0])
    P = polar.Disc(L, c, cos, sin, w, B, index, np.array(M.d), swing, pace, stribeck, width, thr, event, level,
                   jump, M.event)  # fmt: skip
    t0 = float(r.choice([0.0, 0.0, r.uniform(-5, 5)]))
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    chosen = {"rtol": 1e-12, "atol": 1e-14}
    if options and r.random() < 0.4:
        chosen = draw_options(r)
        chosen.pop("method", None)  # the pair is refused
    return Case(P, T, start, t0, instants, rho, chosen, exact)


def _rest(F, mu, x, v):
    """Time and states of rest of v' = F - mu v/|v|, in closed form."""
    f, u = np.linalg.norm(F), np.linalg.norm(v)
    e, m = F / f, mu**2 - f**2
    along = v @ e
    across = v - along * e
    if along < 0:  # mu |v| + F.v without cancellation
        t = (across @ across * mu**2 + m * along**2) / (mu * u - f * along) / m
    else:
        t = (mu * u + f * along) / m
    moved = (f * (u**2 + along**2) + 2 * mu * u * along) / (4 * m) * e + (2 * mu * u + f * along) * across / (
        4 * mu**2 - f**2
    )
    return float(t), np.append(x + moved, np.zeros(len(v)))


# ---- the package's model


def _tables(M, case):
    """Numbers of the model in z, y = T z, by name."""
    P, T = case.P, case.T
    back = np.linalg.inv(T)
    out = {"L": back @ P.L @ T, "c": back @ P.c, "H": T, "J": back @ P.jump, "e": P.event @ T,
           "cos": P.cos @ back.T, "sin": P.sin @ back.T,
           "B": np.einsum("ij,kjl->kil", back, P.B)}  # fmt: skip
    return {k: np.where(np.abs(v) < 1e-15, 0.0, v) for k, v in out.items()}


def _masks(M):
    """Which numbers are not 0 in some case."""
    masks = {}
    for seed in range(6):
        found = _tables(M, case(M, seed))
        for k, v in found.items():
            masks[k] = masks.get(k, False) | (v != 0)
    return masks


def text(M):
    """Source that makes the System S; names of its parameters say where the numbers stand."""
    masks = _masks(M)
    N, K = M.N, len(M.d)
    used = []

    def number(name, *place):
        if not masks[name][place]:
            return None
        used.append("_".join([name, *map(str, place)]))
        return used[-1]

    def scalar(name):
        used.append(name)
        return name

    def total(parts):
        return " + ".join(f"{p}" + (f"*{q}" if q else "") for p, q in parts if p) or "0"

    z = [f"z{i}" for i in range(N)]
    lines = ["import sympy as sp", "from pwsmooth import Disc, Event, Switch, System, solve", ""]
    for k in range(K):
        h = []
        for i in M.index[k]:
            row = masks["H"][i]
            plain = row.sum() == 1 and row[i] and not any(how != "as is" for p, how in M.blocks if i in p)
            h.append(z[i] if plain else total([(number("H", i, j), z[j]) for j in range(N)]))
        if M.d[k] == 1:
            lines.append(f'lam{k} = (Switch("lam{k}", {h[0]}),)')
        else:
            lines.append(f'lam{k} = Disc("lam{k}", ({", ".join(h)}))')
    rates = []
    factor = [""] * K
    if M.swing:
        factor[0] += f"*(1 + {scalar('swing')}*sp.cos({scalar('pace')}*t))"
    if M.stribeck:
        factor[0] += f"*(1 + {scalar('stribeck')}*sp.exp(-lam0.size/{scalar('width')}))"
    if M.hidden:
        factor[0] += f"*(1 + {scalar('rho')}*(1 - lam0.square))"
    for i in range(N):
        parts = [(number("L", i, j), z[j]) for j in range(N)] + [(number("c", i), "")]
        for s in range(M.frequencies):
            parts.append((number("cos", s, i), f"sp.cos(w{s}*t)"))
            parts.append((number("sin", s, i), f"sp.sin(w{s}*t)"))
        for k in range(K):
            parts += [(number("B", k, i, j), f"lam{k}[{j}]{factor[k]}") for j in range(M.d[k])]
        rates.append(f"{z[i]}: {total(parts)}")
    used += [f"w{s}" for s in range(M.frequencies)]
    events = ""
    if M.event:
        surface = total([(number("e", j), z[j]) for j in range(N)])
        update = ", ".join(f"{z[i]}: {z[i]} + {name}" for i in range(N) if (name := number("J", i)))
        events = f'Event({surface} - {scalar("level")}, direction=1, update={{{update}}}, name="E")'
    used = list(dict.fromkeys(used))
    symbols = [*z, "t", *used]
    lines[2] = f'{", ".join(symbols)} = sp.symbols("{" ".join(symbols)}", real=True)'
    lines.append(f"S = System({{{', '.join(rates)}}}, time=t, events=[{events}], "
                 f"parameters=dict.fromkeys([{', '.join(used)}], 1))")  # fmt: skip
    return "\n".join(lines)


def values(M, case, known):
    """Parameter -> its number."""
    tables, P = _tables(M, case), case.P
    scalars = {f"w{s}": P.w[s] for s in range(M.frequencies)} | {
        "swing": P.swing[0], "pace": P.pace[0], "stribeck": P.stribeck[0], "width": P.width[0],
        "rho": case.rho, "level": P.level,
    }  # fmt: skip
    found = {}
    for name in known:
        if name in scalars:
            found[name] = float(scalars[name])
        else:
            table, *place = name.split("_")
            found[name] = float(tables[table][tuple(map(int, place))])
    return found


def compiled(module, seed):
    """The structure of this seed."""
    M = structure(seed)
    space = {}
    exec(text(M), space)
    return Played(module, M, space["S"], {p.name for p in space["S"].parameters})


@dataclass
class Answer:
    """What the oracle says; events are (time, disc, word)."""

    code: int
    reached: float
    states: np.ndarray
    events: list
    margin: np.ndarray


def answer(case):
    """The oracle's answer."""
    log, found = np.zeros((4000, 3)), np.zeros(1, np.int64)
    margin, steps = np.full(4, np.inf), np.zeros(1, np.int64)
    code, reached, states = polar.run(case.P, case.start, case.t0, case.instants, log, found, margin, steps)
    # What holds from the start is no event; nor is a speed of 0 that a disc passes.
    events = sorted(
        (float(t), int(k), _WORDS[int(what)])
        for t, k, what in log[: found[0]]
        if t > case.t0 and (what != polar.CROSSING or case.P.d[int(k)] == 1)
    )
    return Answer(code, reached, states, events, margin)


def start_of(case):
    """The start in z, with discs at rest exactly so."""
    z = np.linalg.solve(case.T, case.start)
    return z


@dataclass
class Run:
    """What is judged of one solve or of several that follow each other."""

    t: np.ndarray
    x: np.ndarray
    events: list
    success: bool
    outcome: object
    ambiguities: list


def run(played, one, how):
    """A Run: states at the instants asked for, from dense output, or of pieces that end and begin at the instants."""
    given = dict(parameters=values(played.model, one, played.known), max_steps=STEPS, **one.options)
    start, end, t0 = start_of(one).tolist(), float(one.instants[-1]), one.t0
    if how == "dense":
        s = judging.solve(played.system, (t0, end), start, dense_output=True, **given)
        inside = one.instants[one.instants <= s.t[-1]]
        x = s(inside)
        x[:, inside == s.t[-1]] = s.x[:, -1:]
        return Run(inside, x, list(s.events), s.success, s.outcome, list(s.ambiguities))
    if how != "pieces":
        s = judging.solve(played.system, (t0, end), start, t_eval=one.instants, strict=how == "strict", **given)
        return Run(s.t, s.x, list(s.events), s.success, s.outcome, list(s.ambiguities))
    out = Run(np.zeros(0), np.zeros((len(start), 0)), [], True, None, [])
    for end in one.instants:
        s = judging.solve(played.system, (t0, float(end)), start, t_eval=[end], **given)
        out.events += list(s.events)
        out.ambiguities += list(s.ambiguities)
        out.success, out.outcome = s.success, s.outcome
        if not s.success:
            break
        out.t, out.x = np.append(out.t, end), np.hstack([out.x, s.x[:, -1:]])
        t0, start = float(end), s.x[:, -1].tolist()
    return out


def play(played, seed):
    """The verdict on one case."""
    one = case(played.model, seed)
    expected = answer(one)
    how = _how(seed)
    try:
        got = run(played, one, how)
    except Exception as error:
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])
    verdict = judge(played.model, one, got, expected)
    verdict.reason = f"{how} {verdict.reason}" if verdict.kind not in (RIGHT, ILL) else verdict.reason
    return verdict


def _how(seed):
    return str(
        np.random.default_rng([43, seed]).choice(
            ["asked", "dense", "pieces", "strict"], p=[0.6, 0.15, 0.15, 0.1]
        )
    )


def told(M, events):
    """Events of a solution as the oracle has them."""
    names = {f"lam{k}": k for k in range(len(M.d))} | {"E": len(M.d)}
    found = [(e.time, names[e.switch], e.kind) for e in events if e.kind in _WORDS]
    # A disc that passes through 0 says so; the oracle does not tell it from one that passes beside.
    return [e for e in found if not (e[2] == "crossing" and e[1] < len(M.d) and M.d[e[1]] > 1)]


def _moved(one, size, tries=4):
    """Changes of states at the instants and of event times when numbers move by `size`; inf if events differ."""
    base = answer(one)
    r = np.random.default_rng(0)
    states, times = 0.0, np.zeros(len(base.events))
    for _ in range(tries):
        P = one.P
        change = {
            name: getattr(P, name) * (1 + size * r.uniform(-1, 1, np.shape(getattr(P, name))))
            for name in ("L", "c", "cos", "sin", "w", "B")
        }
        other = answer(Case(P._replace(**change), one.T, one.start * (1 + size * r.uniform(-1, 1, len(one.start))),
                            one.t0, one.instants))  # fmt: skip
        if [e[1:] for e in other.events] != [e[1:] for e in base.events] or other.code != base.code:
            return np.inf, times + np.inf
        states = max(states, np.nanmax(np.abs(other.states - base.states), initial=0))
        times = np.maximum(times, np.abs(np.array([e[0] for e in other.events]) - [e[0] for e in base.events]))
    return states, times


def judge(M, one, solution, expected):
    """States at the instants, then kinds and order of events, then their times."""
    judged = int(np.isfinite(expected.states).all(axis=1).sum())
    if judged == 0:
        return Verdict(UNDECIDED, f"oracle {expected.code}")
    if not (len(solution.t) >= judged and np.array_equal(solution.t[:judged], one.instants[:judged])):
        if solution.success:
            return Verdict(WRONG, f"{solution.outcome.name}, but ends early")
        if solution.outcome.name == "AMBIGUITY":
            return Verdict(RECORDED, solution.ambiguities[0].kind)
        return Verdict(REFUSED, solution.outcome.name)
    got = (one.T @ solution.x[:, :judged]).T
    want = expected.states[:judged]
    until = one.instants[judged - 1]
    rtol = min(one.options.get("rtol", 1e-9), 1e-6)
    size = rtol + one.options.get("atol", 1e-12)
    scale = 1 + float(np.abs(want).max())
    allowed = 100 * size * scale + 1e-9 * scale
    error = float(np.abs(got - want).max())
    ours = [e for e in expected.events if e[0] <= until]
    theirs = sorted(e for e in told(M, solution.events) if e[0] <= until)
    same = [e[1:] for e in ours] == [e[1:] for e in theirs]
    late = np.array([a[0] - b[0] for a, b in zip(ours, theirs, strict=True)]) if same else np.zeros(0)
    # A state that is 1 at rest in one and not in the other shows in the states as well.
    if one.exact and same and len(theirs) == 1:
        t, rest = one.exact
        late = np.append(late, theirs[0][0] - one.t0 - t)
        if until - one.t0 > t:
            error = max(error, float(np.abs(got[-1] - rest).max()))
    if same and error <= allowed and np.all(np.abs(late) <= allowed):
        return Verdict(RIGHT, error=max(error, np.abs(late).max(initial=0)) / scale)
    if solution.ambiguities and not same:
        return Verdict(RECORDED, solution.ambiguities[0].kind, error)
    states, times = _moved(one, size + 1e-12)
    if not same and error <= allowed and np.isfinite(states):
        return Verdict(WRONG, f"events {[e[1:] for e in ours][:9]} but {[e[1:] for e in theirs][:9]}", error)
    on_time = not same or np.all(np.abs(late[: len(times)]) <= np.maximum(allowed, 20 * times[: len(late)]))
    if not np.isfinite(states) or (error <= max(allowed, 20 * states) and on_time):
        return Verdict(ILL, "" if np.isfinite(states) else "other events", error)
    what = "" if same else f" events {ours[:6]} but {theirs[:6]}"
    return Verdict(WRONG, f"states {error:.1e} late {np.abs(late).max(initial=0):.1e}{what}", error)


def script(number, seed):
    """The case as a program, with what the oracle expects."""
    M = structure(number)
    one = case(M, seed)
    space = {}
    source = text(M)
    exec(source, space)
    given = values(M, one, {p.name for p in space["S"].parameters})
    expected = answer(one)
    return "\n".join([
        source, f"values = {given!r}", f"instants = {one.instants.tolist()}",
        f"s = solve(S, ({one.t0!r}, {float(one.instants[-1])!r}), {start_of(one).tolist()}, t_eval=instants, "
        f"parameters=values, **{one.options!r})",
        "print(s.outcome.name, s.ambiguities, *s.events, sep='\\n')", "print(s.x.T)",
        f"# {_how(seed)}; oracle: code {expected.code}, {M.kind}, margin {expected.margin}, events {expected.events}",
        f"# states in z {(np.linalg.solve(one.T, expected.states.T).T).tolist()}",
    ])  # fmt: skip
