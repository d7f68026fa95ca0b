"""The ladder of models: how much model a scene needs for one of its observables.

Start reading in climbing.py; the matching of parameters is in friction.py and contact.py.
"""

from .catalogue import scenes, setting_of
from .climbing import ladder
from .contact import contact_rungs, contact_setting
from .friction import friction_rungs, friction_setting
from .judging import Step, judge, recommend
from .observables import amplitude, centre, curve, end_value, least, peak, period, share_below
from .result import Ladder
from .rungs import Motion, Observable, Rung, Setting

__all__ = [
    "Ladder",
    "Motion",
    "Observable",
    "Rung",
    "Setting",
    "Step",
    "amplitude",
    "centre",
    "contact_rungs",
    "contact_setting",
    "curve",
    "end_value",
    "friction_rungs",
    "friction_setting",
    "judge",
    "ladder",
    "least",
    "peak",
    "period",
    "recommend",
    "scenes",
    "setting_of",
    "share_below",
]
