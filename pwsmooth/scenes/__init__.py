"""Scenes: mechanism + law + drive; the contract is in scene.py."""

from .assemblies import (
    block_lattice,
    block_train,
    element_cloud,
    firing_lattice,
    granular_chain,
    plate_stack,
    rate_state_train,
)
from .drive import t
from .impact import falling_ball, free_impact, grazing_amplitude, impact_oscillator, pressed_block
from .planar import bristle_bot, incline, planar_oscillator, pulled_block, shaken_plate
from .planar_bodies import billiard_ball, caster, gripped_bar, spinning_disc, stacked_plates
from .prescribed import prescribed_motion
from .scene import Scene, assemble
from .sketch import Sketch
from .sketches import chain_of_blocks
from .slider_crank import IdealSliderCrank, slider_crank
from .sliding import block_on_belt, force_driven, friction_oscillator, position_control

__all__ = [
    "IdealSliderCrank",
    "Scene",
    "Sketch",
    "assemble",
    "billiard_ball",
    "block_lattice",
    "block_on_belt",
    "block_train",
    "bristle_bot",
    "caster",
    "chain_of_blocks",
    "element_cloud",
    "falling_ball",
    "firing_lattice",
    "force_driven",
    "free_impact",
    "friction_oscillator",
    "granular_chain",
    "grazing_amplitude",
    "gripped_bar",
    "impact_oscillator",
    "incline",
    "planar_oscillator",
    "plate_stack",
    "position_control",
    "prescribed_motion",
    "slider_crank",
    "spinning_disc",
    "stacked_plates",
    "pressed_block",
    "pulled_block",
    "rate_state_train",
    "shaken_plate",
    "t",
]
