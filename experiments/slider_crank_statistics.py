"""A thousand revolutions of the slider-crank with clearance: is a touch-down ever missed, and how hard are impacts?

Question: does the event-driven solver find every touch-down of a long chaotic run, and what are the statistics of
impacts and peak accelerations, which alone can be compared between such runs?
Expected: indentation at detection far below 1e-3 of the indentation scale; larger clearance, harder impacts.
One clearance takes less than a minute for 1000 revolutions, dense output included; a run is continued from its last
state every ten revolutions.

    python experiments/slider_crank_statistics.py [--revolutions 1000] [--clearance 5e-4] [--c-r 0.9] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass

import numpy as np
from benchtools import provenance, write_json

AT_ONCE = 10  # revolutions kept in memory at a time


@dataclass(frozen=True)
class Config:
    """What is run."""

    clearance: float = 5e-4
    c_r: float = 0.9
    revolutions: int = 1000
    rtol: float = 1e-9


def study(config):
    """Statistics over all revolutions but the first ten, as a dict; what was missed over all."""
    from pwsmooth.scenes import slider_crank

    scene = slider_crank(clearance=config.clearance, c_r=config.c_r)
    period, state, done = scene.period, scene.x0, 0
    impacts, speeds, peaks, depths = [], [], [], []
    worst, escape, steps, seconds = 0.0, 0.0, 0, 0.0
    while done < config.revolutions:
        count = min(AT_ONCE, config.revolutions - done)
        begin = time.process_time()
        run = scene.solve((done * period, (done + count) * period), state, rtol=config.rtol, dense_output=True)
        seconds += time.process_time() - begin
        if not run.success:
            return {"outcome": run.message, "revolutions": run.t[-1] / period}
        on, off = run.event_times("reset", "touch-down"), run.event_times("reset", "lift-off")
        columns = np.searchsorted(run.t, on)
        worst = max(worst, np.abs(run["indentation"][columns]).max(initial=0.0))
        # A missed touch-down would show as a journal outside its bearing that nothing repels.
        fine = (run.t[:-1, None] + np.diff(run.t)[:, None] * np.linspace(0.05, 0.95, 7)).ravel()
        depth, push = run(fine, "indentation"), run(fine, "normal")
        free = push == 0
        escape = max(escape, float(depth[free & (run(fine, "touching") == 0)].max(initial=-1.0)))
        depths.append(depth.max(initial=0.0))
        if done >= AT_ONCE:
            acceleration = np.abs(run(fine, "acceleration"))
            impacts += np.histogram(on, bins=(done + np.arange(count + 1)) * period)[0].tolist()
            speeds += run["speed"][columns + 1].tolist()
            for a in on:
                later = off[off > a]
                if len(later):
                    peaks.append(float(acceleration[(fine > a) & (fine < later[0])].max(initial=0.0)))
        steps += run.cost["steps"]
        state = run.x[:, -1]
        done += count
    scale = float(max(depths))
    levels = (5, 25, 50, 75, 95, 99, 100)
    return {
        "revolutions": done,
        "seconds": seconds,
        "steps a revolution": steps / done,
        "indentation scale (m)": scale,
        "largest |indentation| at a touch-down / scale": worst / scale,
        "largest indentation in free flight / scale": escape / scale,
        "impacts a revolution: mean, least, most": [float(np.mean(impacts)), min(impacts), max(impacts)],
        "peak |acceleration| of an impact (m/s^2), percentiles": dict(
            zip(levels, np.percentile(peaks, levels))
        ),
        "touch-down speed (m/s), percentiles": dict(zip(levels, np.percentile(speeds, levels).tolist())),
    }


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in asdict(Config()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(value), default=value)
    parser.add_argument("--out", help="write the result as JSON")
    options = vars(parser.parse_args())
    out = options.pop("out")
    result = study(Config(**options))
    for name, value in result.items():
        print(f"{name:58} {value}")
    if out:
        write_json(out, {"config": options, "result": result, "provenance": provenance()})


if __name__ == "__main__":
    main()
