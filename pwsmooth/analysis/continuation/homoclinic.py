"""Where a branch of cycles ends at a saddle: the period grows without bound, and the motion comes to rest on its way.

    homoclinic orbit      it leaves one saddle and comes back to it
    heteroclinic cycle    it passes several

A saddle has directions in which motion leaves it, and others, or a surface on which it slides, in which motion arrives.

Source: Kuznetsov, Elements of Applied Bifurcation Theory, ch. 6; di Bernardo, Budd, Champneys, Kowalczyk,
Piecewise-smooth Dynamical Systems, 2008, for saddles on a sliding surface.

Chain: equilibria -> **homoclinic** -> jumps.py.
"""

from __future__ import annotations

import numpy as np

from ..equilibria.equilibrium import Equilibrium
from ..equilibria.finding import find_equilibrium
from ..maps.sections import Section
from ..orbits.periodic_orbit import PeriodicOrbit

HOMOCLINIC, HETEROCLINIC = "homoclinic orbit", "heteroclinic cycle"
_NEAR = 1e-2  # of the motion's size: so near an orbit passes the saddle at which its branch ends
_SLOW = 0.05  # of the mean speed: what is slower may be beside an equilibrium


def saddles_met(orbit: PeriodicOrbit) -> list[Equilibrium]:
    """The saddles beside which a cycle nearly comes to rest, each once; empty for orbits of a driven system."""
    if not isinstance(orbit.map, Section) or not orbit.success:
        return []
    runs = orbit.runs()
    x = np.concatenate([run.x for run in runs], axis=1)
    size = np.ptp(x, axis=1)
    size[size <= 0] = 1.0
    found: list[Equilibrium] = []
    for run in runs:
        names = [str(s) for s in (*run.model.states, *(mu.symbol for mu in run.model.multipliers))]
        steps, times = np.diff(run.x / size[:, None], axis=1), np.diff(run.t)
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.linalg.norm(steps, axis=0) / times * orbit.period
        speed[~np.isfinite(speed)] = np.inf
        padded = np.concatenate([[np.inf], speed, [np.inf]])
        lowest = (speed <= padded[:-2]) & (speed <= padded[2:]) & (speed < _SLOW)
        for k in np.flatnonzero(lowest).tolist():
            at = dict(zip(names, map(float, (*run.x[:, k], *run.mult[:, k]))))
            e = find_equilibrium(
                orbit.system, {name: value for name, value in at.items() if np.isfinite(value)}
            )
            near = e.success and np.abs((e.x[:, None] - x) / size[:, None]).max(axis=0).min() <= _NEAR
            if (
                near
                and _leaves(e)
                and not any(np.allclose(e.x, one.x, rtol=0, atol=_NEAR * size.min()) for one in found)
            ):
                found.append(e)
    return found


def _leaves(e: Equilibrium) -> bool:
    """Whether motion leaves an equilibrium in some directions, and comes to it in others."""
    rates = e.eigenvalues.real
    return bool(np.any(rates > 0) and (np.any(rates < 0) or len(rates) < len(e.x)))
