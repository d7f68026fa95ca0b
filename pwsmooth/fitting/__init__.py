"""Identification: parameters of any system from records of its motion, with exact derivatives and honest errors.

records.py          what was measured                       fitting.py         fit(), for systems and scenes
coordinates.py      fitted quantities, of size 1            laws.py            fit_law(), for a law in the rig
shooting.py         runs along records, and their slopes    result.py          Fit, profiles, fits side by side
gauss_newton.py     the least misfit with closed gaps       identifiability.py what the data determine
routes.py           several ways to it, and whether they agree
noisy_drives.py     whether a measured drive may be taken as exact
"""

from .fitting import fit
from .gauss_newton import Iteration
from .identifiability import Combination, Identifiability
from .laws import fit_law
from .records import Record
from .result import Comparison, Fit, Profile, compare

__all__ = [
    "Combination", "Comparison", "Fit", "Identifiability", "Iteration", "Profile", "Record", "compare", "fit",
    "fit_law",
]  # fmt: skip
