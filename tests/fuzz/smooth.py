"""Random smooth expressions in ordinary notation, against SciPy's DOP853 at 1e-13.

The oracle calls the expression through `math`, so that neither the recurrences nor the simplifications take part.
Chain: models.py, judging.py -> smooth.py (here) -> __main__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

from . import judging
from .affine import draw_options

TITLE = "random smooth expressions"
_UNARY = [
    "sp.sin({0})", "sp.cos({0})", "sp.tanh({0})", "sp.atan({0})", "sp.exp(-({0})**2)", "sp.exp(sp.sin({0}))",
    "sp.sqrt(1 + ({0})**2)", "sp.log(2 + ({0})**2)", "1/(1 + ({0})**2)", "({0})/(1 + ({0})**2)", "sp.asinh({0})",
    "sp.erf({0})", "sp.sinh(sp.sin({0}))", "sp.cosh(sp.cos({0}))", "(1 + ({0})**2)**sp.Rational(3, 4)",
    "(1.5 + sp.cos({0}))**p{1}", "sp.tan(sp.sin({0}))", "sp.asin(sp.sin({0})/2)", "sp.acos(sp.cos({0})/2)",
    "sp.atan2({0}, 2 + sp.sin({0}))", "sp.log(2 + sp.sin({0}))**2", "p{1}**(sp.sin({0}))", "sp.cbrt(2 + sp.cos({0}))",
    "sp.sin({0})**3", "({0})**2", "sp.tanh({0})**5", "sp.sec(sp.sin({0}))", "sp.cot(1 + sp.sin({0})/2)",
]  # fmt: skip
_MOST_EVALUATIONS = 100_000
_FINE = 20_000  # steps of a second look, which no pulse is narrow enough to hide from
_KICKS = 20  # errors of steps, put anywhere on the span


@dataclass
class Played:
    """Text, System, and the right-hand side as a Python function."""

    text: str
    system: object
    n: int
    parameters: int
    f: object


def _expression(r, leaves, depth, fresh):
    if depth == 0 or r.random() < 0.15:
        return str(r.choice(leaves))
    kind = r.random()
    if kind < 0.5:
        return str(r.choice(_UNARY)).format(_expression(r, leaves, depth - 1, fresh), fresh())
    a, b = (_expression(r, leaves, depth - 1, fresh) for _ in range(2))
    return f"({a} {'*' if kind < 0.75 else '+' if kind < 0.9 else '-'} {b})"


def _gaps(seed):
    """Whether runs begin where Taylor series lack orders: at t = 0 and x = 0, without terms that fill them."""
    return seed % 4 == 3


def structure(seed):
    """Text that makes a System S, and the numbers of its states and parameters."""
    r = np.random.default_rng([9, seed])
    n = int(r.integers(1, 4))

    def fresh():
        return int(r.integers(4))

    xs = [f"x{i}" for i in range(n)]
    leaves = [*xs, *xs, "t", "sp.sin(t)"]
    if _gaps(seed):
        leaves += ["t**3", "t**4", *(f"{x}**4" for x in xs)]
    rates = []
    for x in xs:
        # Bounded outside, damped, so that runs stay in one place.
        body = _expression(r, leaves, int(r.integers(2, 5)), fresh)
        rates.append(f"{x}: {r.choice(['sp.tanh', 'sp.sin', 'sp.atan'])}({body})")
        if not _gaps(seed):
            rates[-1] += f" + p{fresh()}*sp.cos(t) - {x}/4"
    ps = [f"p{q}" for q in range(4)]
    text = "\n".join(
        [
            "import sympy as sp",
            "from pwsmooth import System, solve",
            f't, {", ".join(xs)} = sp.symbols("t {" ".join(xs)}", real=True)',
            f'{", ".join(ps)} = sp.symbols("{" ".join(ps)}", positive=True)',
            f"rates = {{{', '.join(rates)}}}",
            "known = set().union(*(sp.sympify(rate).free_symbols for rate in rates.values()))",
            f"S = System(rates, time=t, parameters={{p: 1 for p in [{', '.join(ps)}] if p in known}})",
        ]
    )
    return text, n


def compiled(_, seed):
    """The System and its right-hand side."""
    text, n = structure(seed)
    space = {}
    exec(text, space)
    arguments = [space["t"], *(space[f"x{i}"] for i in range(n)), *(space[f"p{q}"] for q in range(4))]
    f = sp.lambdify(arguments, list(space["rates"].values()), modules="math", cse=True)
    return Played(text, space["S"], n, 4, f)


def case(n, seed):
    """Start, span, parameters and options."""
    r = np.random.default_rng([10, seed])
    t0 = float(r.choice([0.0, r.uniform(-5, 5)]))
    end = float(r.uniform(0.5, 5))
    instants = np.sort(np.append(t0 + end * r.uniform(0, 1, 3), t0 + end))
    start, p, options = r.uniform(-1.5, 1.5, n), r.uniform(0.3, 1.5, 4), draw_options(r)
    if _gaps(seed // 1000):
        start[r.random(n) < 0.5] = 0.0
        instants, t0 = instants - t0, 0.0
    return start, t0, instants, p, options


def play(played, seed):
    """The verdict on one case."""
    start, t0, instants, p, options = case(played.n, seed)

    def reference(start, p, t_eval=instants, begin=t0, **limits):
        left = iter(range(12 * _FINE + _MOST_EVALUATIONS if limits else _MOST_EVALUATIONS))

        def f(t, x):
            next(left)  # of rates as sin(t**81) there is no end
            return played.f(t, *x, *p)

        run = solve_ivp(
            f, (begin, t_eval[-1]), start, method="DOP853", t_eval=t_eval, rtol=1e-13, atol=1e-14, **limits
        )
        return run.y.T if run.success else None

    def moved(size):
        """The states at the instants where small errors are made all along."""
        random, found = np.random.default_rng(seed), []
        ends = np.union1d(np.linspace(t0, instants[-1], _KICKS), instants)
        x, begin = start * (1 + size), t0
        for end in ends[ends > t0]:
            x = reference(x, p * (1 - size), np.array([end]), begin)[-1]
            found += [x] if end in instants else []
            x, begin = x + size * (1 + np.abs(x)) * random.choice([-1, 1], len(x)), end
        return np.array(found)

    try:
        expected = reference(start, p)
    except (ValueError, OverflowError, ZeroDivisionError, TypeError, StopIteration):
        expected = None
    if expected is None or not np.isfinite(expected).all():
        return judging.Verdict(judging.UNDECIDED, "no reference")
    known = {q.name for q in played.system.parameters}
    values = {f"p{q}": float(v) for q, v in enumerate(p) if f"p{q}" in known}
    try:
        solution = judging.solve(
            played.system, (t0, float(instants[-1])), start.tolist(), t_eval=instants, parameters=values,
            max_steps=judging.STEPS, **options,
        )  # fmt: skip
    except Exception as error:  # what a solve raises is a finding
        return judging.Verdict(judging.WRONG, f"raised {type(error).__name__}: {error}"[:200])
    if not solution.success:
        return judging.Verdict(judging.REFUSED, solution.outcome.name)
    if not np.array_equal(solution.t, instants):
        return judging.Verdict(judging.WRONG, "other instants")
    scale = 1 + np.max(np.abs(expected))
    # Fast oscillations take thousands of steps, each as good as the tolerance.
    allowed = judging.tolerance(options, scale) * max(1.0, solution.cost["steps"] / 100)
    error = float(np.max(np.abs(solution.x.T - expected)))
    if error > allowed:
        # It is the oracle, perhaps, that has stepped over a pulse.
        expected = reference(start, p, max_step=(instants[-1] - t0) / _FINE)
        error = float(np.max(np.abs(solution.x.T - expected)))
    if error <= allowed:
        return judging.Verdict(judging.RIGHT, error=error)
    size = min(options.get("rtol", 1e-9), 1e-6)
    if error <= 100 * np.max(np.abs(moved(size) - expected)):
        return judging.Verdict(judging.ILL, "", error)
    return judging.Verdict(judging.WRONG, solution.outcome.name, error)


def script(number, seed):
    """A short program that shows the case."""
    text, n = structure(number)
    start, t0, instants, p, options = case(n, seed)
    return "\n".join(
        [
            text,
            f"p = {{q: float(v) for q, v in zip([p0, p1, p2, p3], {p.tolist()}) if q in S.parameters}}",
            f"span, start, instants = ({t0}, {instants[-1]}), {start.tolist()}, {instants.tolist()}",
            f"s = solve(S, span, start, t_eval=instants, parameters=p, **{options})",
            "print(s.outcome.name, s.x)",
            "from scipy.integrate import solve_ivp",
            "f = sp.lambdify([t, *S.states], [e.subs(p) for e in rates.values()], modules='math')",
            "print(solve_ivp(lambda t, x: f(t, *x), span, start, method='DOP853', t_eval=instants, rtol=1e-13,"
            " atol=1e-14).y)",
        ]
    )
