"""The ladder of a joint: ideal -> clearance with rigid impacts -> elastic with damping -> with friction.

The slider-crank with half a millimetre of clearance at 200 rpm, in its second revolution. Matching: the rigid joint has
the restitution that the damping factor of the elastic one really gives, by its closed form.
Chain: scenes/slider_crank.py -> rungs.py -> **joint** -> catalogue.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...laws.contact import RigidImpact, effective_restitution
from ...scenes import IdealSliderCrank, slider_crank
from .contact import forces
from .observables import curve, peak
from .rungs import Rung, Setting

CLEARANCE, C_R, RPM = 5e-4, 0.9, 200.0


def _ideal(t: Any, name: Any = None) -> np.ndarray:
    """The ideal mechanism as a Motion."""
    mechanism = IdealSliderCrank(rpm=RPM)
    of = getattr(mechanism, "position" if str(name) == "x" else str(name))
    return of(mechanism.omega * np.asarray(t, float))


def crank() -> Setting:
    """The slider-crank with a clearance joint."""

    def build(normal=None, tangential=None):
        return slider_crank(normal, tangential, clearance=CLEARANCE, c_r=C_R, rpm=RPM, revolutions=2)

    e = effective_restitution("wang-liu-ma", C_R)
    rungs = (
        Rung("ideal", lambda: _ideal, "no clearance; in closed form"),
        Rung("rigid clearance", lambda: build(RigidImpact(e=e)),
             f"e = {e:.4f}, the restitution of the damping factor at c_r = {C_R:g}; no friction"),
        Rung("elastic clearance", build, "the contact law of the richest; no friction"),
    )  # fmt: skip
    words = "Liu's stiffness, the damping factor of Wang, Liu and Ma, modified Coulomb friction of 0.01"
    top = Rung("clearance with friction", lambda: build(None, "modified Coulomb"), words)
    observables = (
        curve("position", "x", "m"),
        curve("velocity", "velocity", "m/s"),
        peak("top speed", "velocity", "m/s"),
        forces(peak("top acceleration", "acceleration", "m/s^2")),
    )
    turn = 60 / RPM
    return Setting("slider-crank", "slider-crank with a clearance joint", top, lambda motion: rungs, observables,
                   (turn, 2 * turn), 40001)  # fmt: skip
