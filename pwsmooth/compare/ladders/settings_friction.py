"""Settings with friction: forced oscillator, block on a belt, presliding rig, drift, and the hidden-term oscillator.

The richest law of the first four is the multistate one, ten elements with frictional lag: in SI units LuGre's standard
set spread over them, in micrometres the reference set of the multistate law.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import sympy as sp

from ...laws import Law
from ...laws.friction import Coulomb, HiddenStatic, MultistateXKY
from ...noise.kicks import Kicks
from ...scenes import block_on_belt, force_driven, friction_oscillator, prescribed_motion, t
from .friction import friction_setting
from .observables import amplitude, centre, curve, end_value, peak, period, share_below
from .rungs import Observable, Rung, Setting


def standard_multistate() -> Law:
    """Ten elements with LuGre's standard sums: 1e5 N/m, sqrt(1e5) N s/m, levels 1 and 1.5 N; stiffness as 1/i."""
    n = 10
    harmonic = sum(1 / i for i in range(1, n + 1))
    return MultistateXKY(F_c=1.0, F_s=1.5, v_s=1e-3, tau_d=0.02, sigma2=0.4, share=(1 / n,) * n,
                         kappa=tuple(1e5 / harmonic / i for i in range(1, n + 1)),
                         sigma=(math.sqrt(1e5) / n,) * n)  # fmt: skip


def _power(omega, size, velocity, unit):
    """Mean power of the drive -size sin(omega t): in a periodic motion what friction and damper take."""

    def measure(motion, window, points):
        times = np.linspace(window[0], window[1], points)
        power = -size * np.sin(omega * times) * motion(times, velocity)
        return float(np.mean(power[1:] + power[:-1]) / 2)  # trapezia

    return Observable("power", unit, "mean power of the drive", measure)


def forced_oscillator() -> Setting:
    """1 kg on a spring of 1000 N/m without a damper, driven by 5 N at 20 rad/s: it never sticks."""
    omega, size = 20.0, 5.0
    turn = 2 * math.pi / omega

    def build(law):
        return friction_oscillator(law, k=1000.0, c=0.0, amplitude=size, omega=omega, x0=(0.0, 0.0),
                                   t_span=(0.0, 40 * turn))  # fmt: skip

    observables = (
        amplitude("amplitude", "y", "m"), peak("top speed", "v", "m/s"), peak("top friction", "friction", "N"),
        share_below("slow share", "v", 0.005), _power(omega, size, "v", "W"),
    )  # fmt: skip
    return friction_setting("forced oscillator", "forced oscillator that never sticks", standard_multistate(), build,
                            observables, window=(36 * turn, 40 * turn))  # fmt: skip


def belt() -> Setting:
    """1 kg on a belt of 0.1 m/s, held by 2 N/m."""
    observables = (
        period("period", "v", 0.05), peak("top speed", "v", "m/s"), peak("top friction", "friction", "N"),
        peak("top elongation", "elongation", "m"), share_below("stick share", "v", 0.005),
    )  # fmt: skip
    return friction_setting("belt", "block on a belt", standard_multistate(), block_on_belt, observables,
                            window=(10.0, 35.0))  # fmt: skip


def presliding() -> Setting:
    """A rig that moves by a micrometre: a large cycle with a small one in it, 1 Hz."""
    place = sp.sin(2 * sp.pi * t) + sp.Rational(1, 2) * sp.sin(6 * sp.pi * t)

    def build(law):
        return prescribed_motion(law, position=place, t_span=(0.0, 4.0), period=1.0, work=True)

    def loss(begin, end):
        """Work from begin to end, from the start of the window."""

        def measure(motion, window, points):
            return float(motion(window[0] + end, "work") - motion(window[0] + begin, "work"))

        return measure

    # The small loop begins at a maximum and ends where that place is reached again: with s = 2 pi t,
    # x' = cos s (6 cos^2 s - 7/2) vanishes at cos^2 s = 7/12 and at s = pi/2, between the two equal maxima.
    s = math.acos(math.sqrt(7 / 12))
    small = loss(s / (2 * math.pi), 0.5 - s / (2 * math.pi))
    observables = (
        Observable("loss", "µN m", "work of friction in one cycle", loss(0.0, 1.0)),
        Observable("loss of the small loop", "µN m", "work from leaving the large loop to being back", small),
        peak("top force", "force", "N"),
        curve("force", "force", "N"),
    )
    return friction_setting("presliding", "presliding rig, a small loop in a large one", MultistateXKY(), build,
                            observables, window=(3.0, 4.0), velocity="velocity")  # fmt: skip


def drift() -> Setting:
    """1 kg under 0.75 + 0.5 sin(2 pi t) N, always below the 1.5 N at which it breaks away."""

    def build(law):
        return force_driven(law, 0.75 + 0.5 * sp.sin(2 * sp.pi * t), t_span=(0.0, 20.0), period=1.0)

    def per_cycle(motion, window, points):
        return float(motion(window[1], "x") - motion(window[1] - 1.0, "x"))

    observables = (
        end_value("displacement", "x", "m"),
        Observable("drift", "m", "displacement in the last cycle", per_cycle),
    )
    return friction_setting("drift", "mass under a small cyclic force", standard_multistate(), build, observables,
                            window=(0.0, 20.0))  # fmt: skip


EPS, KAPPA = 1e-3, 2e-4


def hidden_oscillator() -> Setting:
    """The oscillator of the solid-friction paper: rho = 3, beta = 0.1, eps = 0.001, kicks of kappa = 2e-4."""
    turn = 2 * math.pi
    law = HiddenStatic()
    whole = friction_oscillator(law, t_span=(0.0, 20 * turn), x0=(0.6, -1.07))
    motion_only = {name: value for name, value in whole.x0.items() if name != "z"}

    def limit(ratio):
        system = whole.system.layered({"z": ratio})
        return replace(whole, system=system, x0=motion_only, atol={})

    def smooth():
        return replace(whole, system=whole.system.smoothed(eps=EPS))

    def kicks(k):
        return Kicks(KAPPA, every=turn / 500, on=("y", "v"), seed=1, trajectory=k)

    def coulomb():
        return friction_oscillator(Coulomb(F_c=law.F_c), t_span=whole.t_span, x0=(0.6, -1.07))

    rungs = (
        Rung("Coulomb", coulomb, f"level {law.F_c:g}, the steady force at any speed (rho = 0)"),
        Rung("hidden static", lambda: limit(sp.oo), f"rho = {law.rho:g}, beta -> 0 with z slaved to the layer"),
        Rung("two-stage", lambda: limit(0), f"rho = {law.rho:g}, beta -> 0 after eps -> 0"),
        Rung("relaxing", lambda: whole, f"rho = {law.rho:g}, beta = {law.beta:g}, eps -> 0"),
        Rung("compliant", smooth, f"eps = {EPS:g}, no noise"),
    )
    top = Rung("noisy", smooth, f"all: rho, beta, eps and kicks of kappa = {KAPPA:g}", kicks, samples=8)
    observables = (
        peak("top displacement", "y", "1"), amplitude("amplitude", "y", "1"), centre("asymmetry", "y", "1"),
        peak("top speed", "v", "1"), share_below("stick share", "v", 0.02), _power(1.0, 2.4, "v", "1"),
    )  # fmt: skip
    title = "friction oscillator with a hidden static term"
    return Setting("oscillator", title, top, lambda motion: rungs, observables, (10 * turn, 20 * turn))
