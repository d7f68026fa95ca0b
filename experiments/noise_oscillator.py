"""What kicks leave of static friction on the friction oscillator, by three measures, and where it is gone.

    y' = v,   v' = -sigma sin(t) - k y - c v - Lambda(v/eps) (1 + rho z) + kicks,   beta z' = 1 - Lambda^2 - z

(oscillator.py of the figures, smoothed, beta = eps), beside the same with rho = 0 and the same kicks. Of every half
period:

    departure   from the first v >= -2 eps to the last v <= 2 eps, in the direction in which the force pushes
    stuck       the time with |v| <= 2 eps and a force beyond N
    peak        whether |mu| exceeds 1.6, just before kicks (as figures 11 to 13 look), and at all times

Static friction is gone where the mean departure is 3/2 of that of rho = 0 (the criterion of noise_recapture.py under a
constant force), where a tenth is left of the noise-free time stuck, and where half of the half periods have a peak.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from noise_layer import LAWS, MU_S, RATIO, crossing, excess, way_out
from scipy.optimize import brentq
from scipy.special import logit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Diffusion, Kicks, solve
from pwsmooth.studies import ensemble

START = {"y": 0.78, "v": -1.03, "z": 0.0}
PEAK = 1.6
PHASE = 1.0  # the half periods are counted from here: between two sticks
# Level of each measure, and what is nearly a straight line over log sd near it (and within which bounds).
LEVELS = {
    "departure": (RATIO, excess, (1.15, 3.0)),
    "stuck": (0.1, np.log, (0.04, 0.3)),
    "peak": (0.5, lambda share: logit(np.clip(share, 0.01, 0.99)), (0.1, 0.9)),
}


def measured(rho, eps, T, sd, law, config):
    """Of every half period of all trajectories: rows departure, stuck, peak, peak at all times."""
    view = osc.oscillator(beta=eps).smoothed(eps=eps).with_parameters({"rho": rho})
    count, periods = config.trajectories, config.periods
    if law == "diffusion":
        step = osc.PERIOD / 2000
        before = after = step * np.arange(1, 2000 * periods)
        noise = Diffusion({"v": sd * math.sqrt(eps)}, step=step, seed=7)
        many = ensemble(view, (0, 2000 * periods * step), START, noise, count, t_eval=before, max_steps=10**9)
    else:
        every = T * eps
        kicks = np.arange(1, int(periods * osc.PERIOD / every))
        before, after = (kicks - 1e-3) * every, (kicks + 1e-3 * min(1, 1 / T)) * every
        noise = Kicks(LAWS[law][1] * sd * eps, every, on="v", law=law, seed=7)
        times = np.column_stack([before, after]).ravel()
        many = ensemble(view, (0, periods * osc.PERIOD), START, noise, count, t_eval=times, rtol=1e-6)
    if not all(o.success for o in many.outcomes):
        raise RuntimeError(f"not every trajectory finished: {set(many.outcomes)}")
    look = slice(None) if law == "diffusion" else slice(0, None, 2)
    t, u, y = before, many["v"][:, look] / eps, many["y"][:, look]
    mu = np.abs(many["v"] / np.hypot(many["v"], eps) * (1 + rho * many["z"]))
    half = np.floor((t - PHASE) / math.pi).astype(int)
    which = np.repeat(half, many.x.shape[2] // len(t))
    push = -(3.1 * y + 2.4 * np.sin(t))
    between = t[1] - t[0]
    rows = []
    for h in range(2, 2 * periods - 1):
        now = half == h
        sign = 1 if h % 2 == 0 else -1
        forward, force = sign * u[:, now], sign * push[:, now]
        back, fast = (forward <= 2) & (force > 0), (forward >= -2) & (force > 0)
        last = now.sum() - np.argmax(back[:, ::-1], axis=1)
        departure = np.where(back.any(axis=1) & fast.any(axis=1), last - np.argmax(fast, axis=1), 0)
        stuck = ((np.abs(forward) <= 2) & (force > 1)).sum(axis=1)
        seen = (mu[:, look][:, now] > PEAK).any(axis=1), (mu[:, which == h] > PEAK).any(axis=1)
        rows.append([between * np.maximum(departure, 0), between * stuck, *seen])
    # Friction leaves nothing of a half period to the next: each is a sample of its own.
    return np.concatenate(rows, axis=1).astype(float)


def free(eps):
    """(time stuck beyond N in a half period without noise, forces of the stick at 4000 times a period)."""
    view = osc.oscillator(beta=eps).smoothed(eps=eps)
    times = osc.PERIOD * (2 + np.arange(4000) / 4000)
    run = solve(view, (0, 3 * osc.PERIOD), START, t_eval=np.append(times, 3 * osc.PERIOD), rtol=1e-6)
    force = np.abs(3.1 * run["y"] + 2.4 * np.sin(run.t))[:-1]
    held = (np.abs(run["v"][:-1]) <= 2 * eps) & (force > 1)
    first = np.flatnonzero(held & (times < times[0] + math.pi))
    return held.sum() / 2 * osc.PERIOD / 4000, force[first]


def if_one_ends_it(forces, eps, T, law):
    """sd at which a tenth of the noise-free time is left if the first kick that leads out ends the stick."""
    nodes = np.linspace(1.02, MU_S - 1e-3, 12)
    ways = np.interp(forces, nodes, [way_out(f) for f in nodes], right=0.0)
    kicks_between = osc.PERIOD / 4000 / (T * eps)

    def left(log_sd):
        out = LAWS[law][0].sf(ways / math.exp(log_sd))
        return np.exp(np.cumsum(np.log1p(-out)) * kicks_between).mean() - LEVELS["stuck"][0]

    return math.exp(brentq(left, math.log(0.05), math.log(100)))


def thresholds(eps, T, law, config):
    """Where each measure reaches its level, [sd, standard error] or None, and what was seen on the way.

    From kicks at which static friction is gone down, those of rho = 0 beside them until the departures differ
    clearly; then from 16 eps down at most, as what one kick ends is lost there.
    """
    still, forces = free(eps)
    sd = 3.5 if law == "diffusion" else 3.5 * (math.sqrt(T) + 0.8 * T)
    departed, seen = False, {name: [] for name in (*LEVELS, "peak at all times", "stuck, rho = 0")}

    def note(name, values):
        seen[name].append([sd, float(values.mean()), float(values.std(ddof=1)) / math.sqrt(values.size)])

    for _ in range(40):
        departure, stuck, *peaks = measured(3.0, eps, T, sd, law, config)
        note("stuck", stuck / still)
        note("peak", peaks[0])
        note("peak at all times", peaks[1])
        if not departed:
            alone = measured(0.0, eps, T, sd, law, config)
            note("stuck, rho = 0", alone[1] / still)
            ratio = departure.mean() / alone[0].mean()
            # Both under the same kicks: what they have in common drops out of the error.
            error = (departure - ratio * alone[0]).std(ddof=1) / alone[0].mean() / math.sqrt(departure.size)
            seen["departure"].append([sd, float(ratio), float(error)])
            departed = ratio > 2.5
        if departed and seen["stuck"][-1][1] > 0.3 and seen["peak"][-1][1] > 0.9:
            break
        sd = min(sd / 1.4, 16.0 if departed and law != "diffusion" else math.inf)
    return {
        "eps": eps, "T": T, "law": law, "free": still, "seen": seen,
        **{name: crossing(*zip(*seen[name]), *LEVELS[name]) for name in LEVELS},
        "one kick": None if T < 10 else if_one_ends_it(forces, eps, T, law),
    }  # fmt: skip
