"""Contact laws: F >= 0 repels; the joint's position is the indentation, its velocity the indentation's rate.

Start reading in impact.py (one law, a table of damping factors) and residual.py.
"""

from .elastic import Anagnostopoulos, Hertz, HuntCrossley, KelvinVoigt
from .eta import ETA, damping_factor, effective_restitution
from .impact import BaiImpact, HertzImpact, LiuImpact
from .residual import LinearResidual, ResidualHuntCrossley, ResidualIndentation
from .restitution import contact_duration, exact_eta, maximal_indentation, phase_curve, restitution
from .rigid import RigidImpact
from .stiffness import composite_modulus, hertz_stiffness, journal_stiffness

__all__ = [
    "ETA",
    "Anagnostopoulos",
    "BaiImpact",
    "Hertz",
    "HertzImpact",
    "HuntCrossley",
    "KelvinVoigt",
    "LinearResidual",
    "LiuImpact",
    "ResidualHuntCrossley",
    "ResidualIndentation",
    "RigidImpact",
    "composite_modulus",
    "contact_duration",
    "damping_factor",
    "effective_restitution",
    "exact_eta",
    "hertz_stiffness",
    "journal_stiffness",
    "maximal_indentation",
    "phase_curve",
    "restitution",
]
