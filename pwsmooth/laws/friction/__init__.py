"""Friction laws: f opposes the sliding velocity v, m dv/dt = u - f.

A law is some twenty lines: parameters with units, then force, rates and surfaces (dahl.py is a good first one to read).
"""

from .boucwen import BoucWen
from .coulomb import Coulomb, HiddenStatic, ModifiedCoulomb, StaticKinetic, StribeckFriction, VelocityWeakening
from .dahl import BlimanSorine, BlimanSorineFirst, Dahl, ModifiedDahl
from .elastoplastic import Elastoplastic, ElastoplasticFixed
from .gms import GMS
from .lugre import LuGre, LuGreFadingDamping
from .maxwell_slip import Masing, MaxwellSlip
from .rolling import RollingResistance, TorsionalResistance
from .spinning import Contensou, LimitEllipsoid
from .wojewoda import Wojewoda
from .xky import XKY, MultistateXKY

__all__ = [
    "GMS",
    "XKY",
    "BlimanSorine",
    "BlimanSorineFirst",
    "BoucWen",
    "Contensou",
    "Coulomb",
    "Dahl",
    "Elastoplastic",
    "ElastoplasticFixed",
    "HiddenStatic",
    "LimitEllipsoid",
    "LuGre",
    "LuGreFadingDamping",
    "Masing",
    "MaxwellSlip",
    "ModifiedCoulomb",
    "ModifiedDahl",
    "MultistateXKY",
    "RollingResistance",
    "StaticKinetic",
    "StribeckFriction",
    "TorsionalResistance",
    "VelocityWeakening",
    "Wojewoda",
]
