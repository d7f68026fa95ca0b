"""What do other tools make of the README's block, whose static friction exceeds the kinetic one?

The block is y'' = -2.4 sin t - 3.1 y - 0.1 y' - mu with mu = lambda (1 + 3 (1 - lambda^2)), lambda = sign(y').
The term with 3 vanishes in slip, where lambda is 1 or -1. In a stick it lets the friction reach 16/9.

Each tool is given the same formula in the way of its own examples:

* SciPy's `solve_ivp` with `numpy.sign`, by its default method and by its two implicit ones;
* SciPy with lambda = tanh(y'/eps), which is the usual remedy, for falling eps;
* solve_nivp, whose multiplier is an unknown that a projection holds in sign(y');
* nosnoc, which takes a convex combination of the two slips; a term that vanishes in both has no place there.

Usage: python experiments/other_tools.py [--fast] [--out DIR], or --draw FILE.json. It needs the extra `bench`; in its
fast form SciPy is enough.
"""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass

import numpy as np
import studytools

END, START = 25.0, (0.5, 0.3)
KINETIC, FULL = 0.0, 3.0  # strength of the hidden term
MOST = 300_000  # evaluations that a run may take
GRID = np.linspace(0, END, 501)


@dataclass(frozen=True)
class Config:
    """Widths of the tanh, and which of the other packages are run."""

    eps: tuple[float, ...]
    peers: bool


def ours(rho):
    """The exact run: values on GRID, and what became of it."""
    import sympy as sp

    from pwsmooth import Switch, System, solve

    t, y, v = sp.symbols("t y v", real=True)
    lam = Switch("lam", v)
    mu = lam * (1 + rho * (1 - lam**2))
    block = System({y: v, v: -2.4 * sp.sin(t) - 3.1 * y - 0.1 * v - mu}, time=t, outputs={"mu": mu})
    sol = solve(block, (0, END), START, dense_output=True)
    sticks = [[float(a), float(b)] for a, b, s in zip(sol.t[:-1], sol.t[1:], sol.status[0]) if s == 0]
    return {
        "ends": float(sol.t[-1]),
        "y": sol(GRID, "y"),
        "end": float(sol["y"][-1]),
        "work": int(sol.cost["steps"]),
        "largest": float(np.abs(sol["mu"]).max()),
        "sticks": sticks,
        "number": len(sol.event_times("stick")),
    }


class _Enough(RuntimeError):
    """More evaluations than MOST."""


def block(sign, rho=FULL):
    """The right-hand side with a sign of one's own; it counts its calls."""

    def rates(t, x):
        rates.calls += 1
        if rates.calls > MOST:
            raise _Enough(f"not past t = {t:.2f} after {MOST:,} evaluations")
        lam = sign(x[1])
        return [x[1], -2.4 * np.sin(t) - 3.1 * x[0] - 0.1 * x[1] - lam * (1 + rho * (1 - lam**2))]

    rates.calls = 0
    return rates


def scipy_run(sign, **options):
    """One run of `solve_ivp`."""
    from scipy.integrate import solve_ivp

    rates = block(sign)
    run = solve_ivp(rates, (0, END), START, dense_output=True, **options)
    return {
        "ends": float(run.t[-1]),
        "y": np.where(GRID <= run.t[-1], run.sol(GRID)[0], np.nan),
        "stops": None if run.success else float(run.y[0, -1]),
        "end": float(run.y[0, -1]) if run.success else None,
        "work": rates.calls,
        "message": str(run.message),
    }


def nivp_run(rho):
    """solve_nivp: the unknowns are y, v, the surface h = v and the multiplier w in sign(h)."""
    from solve_nivp import solve_ivp_ns

    calls, reached = 0, 0.0

    def rates(t, z, *_):
        nonlocal calls, reached
        calls, reached = calls + 1, float(t)
        if calls > MOST:
            raise _Enough(f"not past t = {t:.2f} after {MOST:,} evaluations")
        y, v, h, w = z
        return np.array([v, -2.4 * np.sin(t) - 3.1 * y - 0.1 * v - w * (1 + rho * (1 - w * w)), v - h, 0.0])

    try:
        t, z, *_ = solve_ivp_ns(
            rates, (0.0, END), np.array([*START, START[1], 1.0]), method="composite", projection="sign",
            projection_opts=dict(y_indices=[2], w_indices=[3]), solver="semismooth_newton",
            solver_opts=dict(tol=1e-8, max_iter=50), A=np.diag([1.0, 1.0, 0.0, 0.0]), rtol=1e-4, atol=1e-6, h0=1e-3,
            component_slices=[slice(0, 2), slice(2, 3), slice(3, 4)], skip_error_indices=[1, 2],
        )  # fmt: skip
    except _Enough as enough:
        return {"ends": reached, "end": None, "work": calls, "message": str(enough)}
    if t[-1] < END * (1 - 1e-9):  # it returns what it has where a step fails, as for want of evaluations
        message = f"not past t = {t[-1]:.2f} after {MOST:,} evaluations"
        return {"ends": float(t[-1]), "end": None, "work": calls, "message": message}
    return {"ends": float(t[-1]), "end": float(z[-1][0]), "work": calls, "message": "reached the end"}


def nosnoc_run(steps=200, stages=4):
    """nosnoc: Stewart's form with the two slips; the hidden term is 0 in both."""
    import casadi as ca
    import nosnoc

    x = ca.SX.sym("x", 3)  # y, v, t
    pull = -2.4 * ca.sin(x[2]) - 3.1 * x[0] - 0.1 * x[1]
    slips = ca.horzcat(ca.vertcat(x[1], pull - 1, 1), ca.vertcat(x[1], pull + 1, 1))
    options = nosnoc.NosnocOpts()
    options.use_fesd = True
    options.pss_mode = nosnoc.PssMode.STEWART
    options.irk_scheme = nosnoc.IrkSchemes.RADAU_IIA
    options.n_s, options.N_finite_elements, options.N_stages = stages, 2, 1
    options.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    options.comp_tol = options.sigma_N = 1e-9
    options.homotopy_update_slope, options.terminal_time, options.print_level = 0.1, END / steps, 0
    start, signs = np.array([*START, 0.0]), [np.array([[1], [-1]])]
    model = nosnoc.NosnocModel(x=x, F=[slips], c=[x[1]], S=signs, x0=start, name="block")
    loop = nosnoc.NosnocSimLooper(nosnoc.NosnocSolver(options, model), start, steps)
    with contextlib.redirect_stdout(io.StringIO()):
        loop.run()
    failed = sum(status != nosnoc.nosnoc_types.Status.SUCCESS for status in loop.status)
    end = np.array(loop.xcurrent).ravel()
    return {
        "ends": float(end[2]),
        "end": float(end[0]) if not failed else None,
        "work": steps * 2 * stages,
        "message": f"{failed} of {steps} programmes failed" if failed else "reached the end",
    }


def run(config):
    """Tool -> its run."""
    found = {
        "ours": ours(FULL),
        "ours, kinetic friction alone": ours(KINETIC),
        "SciPy": scipy_run(np.sign),
        "SciPy, Radau": scipy_run(np.sign, method="Radau"),
        "SciPy, BDF": scipy_run(np.sign, method="BDF"),
    }
    for eps in config.eps:
        found[f"tanh, eps {eps:g}"] = scipy_run(
            lambda v, eps=eps: np.tanh(v / eps), method="LSODA", rtol=1e-8, atol=1e-11
        )
    if config.peers:
        found["solve_nivp"] = nivp_run(FULL)
        found["solve_nivp, kinetic friction alone"] = nivp_run(KINETIC)
        found["nosnoc"] = nosnoc_run()
    return found


def _slope(data):
    """Exponent of eps in the error of the tanh's runs."""
    rows = [
        (float(k.split()[-1]), abs(row["end"] - data["ours"]["end"])) for k, row in data.items() if "eps" in k
    ]
    eps, error = np.array(rows).T
    return float(np.polyfit(np.log(eps), np.log(error), 1)[0])


def claims(data):
    """What was expected of each."""
    exact, kinetic = data["ours"], data["ours, kinetic friction alone"]
    plain, slope = data["SciPy"], _slope(data)
    implicit = [data["SciPy, Radau"], data["SciPy, BDF"]]
    made = [
        studytools.claim(
            "Our friction reaches the height of the fold, and the block sticks eight times",
            "16/9, 8", f"{exact['largest']:.9f}, {exact['number']}",
            abs(exact["largest"] - 16 / 9) < 1e-9 and exact["number"] == 8, "another run", origin="derived",
        ),
        # The layer's passage of a fold delays by eps^(2/3): Krupa and Szmolyan, SIAM J. Math. Anal. 33 (2001) 286.
        studytools.claim(
            "A steep tanh comes to our end as eps^(2/3)", "0.667", f"{slope:.3f}",
            abs(slope - 2 / 3) < 0.1, "another order", origin="independent",
        ),
        studytools.claim(
            "SciPy's default reports success, and ends where a block without the hidden term does",
            f"y = {kinetic['end']:.3f}", f"y = {plain['end']:.3f}; ours {exact['end']:.3f}",
            abs(plain["end"] - kinetic["end"]) < 1e-3 < abs(exact["end"] - kinetic["end"]), "another end",
        ),
        studytools.claim(
            "SciPy's implicit methods stop in a stick", "an error message, v = 0",
            ", ".join(f"t = {row['ends']:.2f}" for row in implicit),
            all(any(a < row["ends"] for a, _ in exact["sticks"]) and row["end"] is None for row in implicit),
            "they went on",
        ),
    ]  # fmt: skip
    if "nosnoc" in data:
        peers = data["nosnoc"]["end"], data["solve_nivp, kinetic friction alone"]["end"]
        made += [
            studytools.claim(
                "nosnoc, and solve_nivp without the hidden term, solve the block of kinetic friction alone",
                f"y = {kinetic['end']:.3f}", ", ".join(f"y = {end:.3f}" for end in peers),
                all(abs(end - kinetic["end"]) < 2e-3 for end in peers), "another end",
            ),
            studytools.claim(
                "solve_nivp with the hidden term does not come past the first reversal", "it is at t = 0.11",
                data["solve_nivp"]["message"], data["solve_nivp"]["end"] is None, "it reached the end",
            ),
        ]  # fmt: skip
    return made


def draw(data):
    """The block's place by us and by SciPy."""
    from pwsmooth.plotting import COLOUR, new_figure

    figure = new_figure(6.4, 2.4)
    ax = figure.subplots()
    for a, b in data["ours"]["sticks"]:
        ax.axvspan(a, b, color="0.87", linewidth=0)
    values = {
        name: np.array([np.nan if v is None else v for v in data[name]["y"]]) for name in ("ours", "SciPy")
    }
    ax.plot(GRID, values["ours"], color=COLOUR["exact"], linewidth=1.6, label="pwsmooth (sticks shaded)")
    ax.plot(GRID, values["SciPy"], "--", color=COLOUR["SciPy"], label="SciPy's solve_ivp with sign(v)")
    stopped = data["SciPy, Radau"]
    ax.plot(
        stopped["ends"], stopped["stops"], "X", color=COLOUR["mark"],
        markersize=7, label="its Radau and BDF stop here", zorder=5,
    )  # fmt: skip
    ax.set(xlabel="t", ylabel="y", xlim=(0, END))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure


STUDY = studytools.Study(
    name="other_tools",
    question="What do other tools make of the README's block, whose static friction exceeds the kinetic one?",
    expected="They solve a block without its static friction, or stop; a steep tanh comes near the exact run.",
    full=Config(eps=(1e-2, 1e-3, 1e-4), peers=True),
    fast=Config(eps=(1e-2, 1e-3), peers=False),
    run=run,
    claims=claims,
    draw=draw,
    verdict=lambda data: (
        f"SciPy's default reports success and ends at y = {data['SciPy']['end']:.3f}; the block's end is "
        f"{data['ours']['end']:.3f}. A tanh with eps = {min(float(k.split()[-1]) for k in data if 'eps' in k):g} is "
        "close, at many more steps."
    ),
)


if __name__ == "__main__":
    studytools.command(STUDY)
