"""What does a velocity reversal cost? Error of friction laws with located switch times, and stepped through.

Question: does the error of a run through v = 0 fall with the order of the method, for laws with a kink there (Dahl,
LuGre), with further thresholds (elastoplastic) and with hybrid modes (GMS)?
Expected: order 8 of the Taylor steps with located switch times; about 2 for classical Runge-Kutta steps (order 4) that
do not notice the kink of |v|, 1 where the rate jumps (GMS).

Usage: python experiments/order_reversal.py [--out FILE.json] [--chart FILE.png]
"""

from __future__ import annotations

import argparse

import numpy as np
import sympy as sp
from benchtools import provenance, write_json

from pwsmooth.laws import friction
from pwsmooth.scenes import prescribed_motion, t

SIZE, END, ORDER = 3e-5, 0.45, 8
VELOCITY = SIZE * 2 * sp.pi * sp.cos(2 * sp.pi * t)  # turns at 0.25 s
LAWS = {
    "Dahl": friction.Dahl(),
    "LuGre": friction.LuGre(),
    "elastoplastic": friction.Elastoplastic(z_ba=4e-6),
    "GMS": friction.GMS(F_c=1.0, F_s=1.5, v_s=1e-4, C=20.0, kappa=(1e5, 4e4), share=(0.5, 0.5), sigma=0.0),
}
LOCATED = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192)
THROUGH = (151, 301, 599, 1201, 2399, 4801)  # odd: no step ends on the reversal


def located(scene, exact, counts):
    """(count, error of the force) of runs with steps of at most END/count, few more than that with the events'."""
    rows = []
    for n in counts:
        run = scene.solve(rtol=1e-6, atol=1.0, order=ORDER, max_step=END / n)
        rows.append((n, abs(run["force"][-1] - exact["force"][-1])))
    return rows


def through(law, exact, counts):
    """The same of classical Runge-Kutta steps of the law written out, which notice no switch."""
    rates = _right_hand_side(law)
    rows = []
    for n in counts:
        h, x = END / n, np.zeros(len(exact))
        state = {"slip": np.zeros(2)}
        for k in range(n):
            a = rates(k * h, x, state)
            b = rates((k + 0.5) * h, x + h / 2 * a, state)
            c = rates((k + 0.5) * h, x + h / 2 * b, state)
            x = x + h / 6 * (a + 2 * b + 2 * c + rates((k + 1) * h, x + h * c, state))
            if isinstance(law, friction.GMS):
                _modes(law, (k + 1) * h, x, state)
        rows.append((n, float(np.abs(x - exact).max()) / SIZE))
    return rows


def _speed(time):
    return SIZE * 2 * np.pi * np.cos(2 * np.pi * time)


def _stribeck(law, v):
    return law.F_c + (law.F_s - law.F_c) * np.exp(-((v / law.v_s) ** 2))


def _right_hand_side(law):
    """dz/dt of a law in plain numpy."""
    if isinstance(law, friction.GMS):
        kappa, share = np.array(law.kappa), np.array(law.share)

        def rates(time, z, state):
            v = _speed(time)
            slip = state["slip"]
            attraction = law.C / kappa * share * (slip - kappa * z / (share * _stribeck(law, v)))
            return np.where(slip == 0, v, attraction)

    elif isinstance(law, friction.Elastoplastic):

        def rates(time, z, state):
            v = _speed(time)
            steady = _stribeck(law, v) / law.sigma0
            w = z * np.sign(v)
            rise = np.sin(np.pi * (w - (steady + law.z_ba) / 2) / (steady - law.z_ba))
            alpha = np.where(w <= law.z_ba, 0.0, np.where(w < steady, (1 + rise) / 2, 1.0))
            return v * (1 - alpha * w / steady)

    else:

        def rates(time, z, state):
            v = _speed(time)
            g = law.F_c if isinstance(law, friction.Dahl) else _stribeck(law, v)
            return v - law.sigma0 * abs(v) * z / g

    return rates


def _modes(law, time, z, state):
    """GMS's modes after a step, as a fixed-step simulation sets them."""
    v, kappa, share = _speed(time), np.array(law.kappa), np.array(law.share)
    slip = state["slip"]
    begins = (slip == 0) & (np.abs(kappa * z) >= share * _stribeck(law, v)) & (z * v > 0)
    ends = (slip != 0) & (slip * v < 0)
    state["slip"] = np.where(begins, np.sign(z), np.where(ends, 0.0, slip))


def slope(rows, floor, finest=0):
    """Observed order of the errors above rounding: all, or the finest few, where the leading term rules."""
    counts, error = np.array([r for r in rows if r[1] > floor][-finest:]).T
    return float(-np.polyfit(np.log(counts), np.log(error), 1)[0])


def study():
    """Law -> rows and observed orders."""
    results = {}
    for name, law in LAWS.items():
        scene = prescribed_motion(law, velocity=VELOCITY, t_span=(0, END))
        exact = scene.solve(rtol=1e-13, order=24, max_step=2e-3)
        states = [s for s in exact.states if s.startswith("z")]
        end = np.array([exact[s][-1] for s in states])
        ours, plain = located(scene, exact, LOCATED), through(law, end, THROUGH)
        results[name] = {
            "located": ours,
            "located_order": slope(ours, 5e-14, finest=3),
            "through": plain,
            "through_order": slope(plain, 1e-13),
        }
        print(f"{name:14} located: {results[name]['located_order']:5.2f}   stepped through: "
              f"{results[name]['through_order']:5.2f}", flush=True)  # fmt: skip
    return results


def chart(results, path):
    """Error against steps."""
    from pwsmooth.plotting import COLOUR, new_figure, style

    with style():
        figure = new_figure(6.6, 3.6)
        ax = figure.subplots()
        colours = dict(zip(LAWS, ("right", "stick", "left", "velocity")))
        for mark, (name, row) in zip("os^D", results.items()):
            for kind, line, label in (
                ("located", mark + "-", f"{name}, located"),
                ("through", mark + "--", f"{name}, stepped through"),
            ):
                steps, error = np.array(row[kind]).T
                ax.loglog(
                    steps,
                    np.maximum(error, 1e-16),
                    line,
                    color=COLOUR[colours[name]],
                    label=label,
                    markersize=3.5,
                    markerfacecolor="none" if kind == "through" else None,
                )
        ax.set(xlabel="steps (time over the longest one)", ylabel="error of the force (N) or of z/size")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        figure.savefig(path)


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", help="write the results as JSON")
    parser.add_argument("--chart", help="write the chart as PNG")
    options = parser.parse_args()
    results = study()
    if options.out:
        write_json(options.out, {"results": results, "order": ORDER, "end": END, "provenance": provenance()})
    if options.chart:
        chart(results, options.chart)


if __name__ == "__main__":
    main()
