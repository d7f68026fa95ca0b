"""Scenes: mechanism + law + drive; the contract is in scene.py."""

from .drive import t
from .prescribed import prescribed_motion
from .scene import Scene, assemble
from .sliding import block_on_belt, force_driven, friction_oscillator, position_control

__all__ = [
    "Scene",
    "assemble",
    "block_on_belt",
    "force_driven",
    "friction_oscillator",
    "position_control",
    "prescribed_motion",
    "t",
]
