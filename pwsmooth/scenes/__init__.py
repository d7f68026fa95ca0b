"""Scenes: mechanism + law + drive; the contract is in scene.py."""

from .scene import Scene, assemble

__all__ = ["Scene", "assemble"]
