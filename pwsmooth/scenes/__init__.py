"""Scenes: mechanism + law + drive; the contract is in scene.py."""

from .drive import t
from .impact import falling_ball, free_impact, grazing_amplitude, impact_oscillator, pressed_block
from .prescribed import prescribed_motion
from .scene import Scene, assemble
from .slider_crank import IdealSliderCrank, slider_crank
from .sliding import block_on_belt, force_driven, friction_oscillator, position_control

__all__ = [
    "IdealSliderCrank",
    "Scene",
    "assemble",
    "block_on_belt",
    "falling_ball",
    "force_driven",
    "free_impact",
    "friction_oscillator",
    "grazing_amplitude",
    "impact_oscillator",
    "position_control",
    "prescribed_motion",
    "slider_crank",
    "pressed_block",
    "t",
]
