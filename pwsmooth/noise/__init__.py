"""Noise: kicks at instants, and diffusions."""

from .. import on_first_use

__getattr__, __dir__ = on_first_use(__name__, {"Kicks": "kicks", "Diffusion": "diffusion"})
