"""Friction laws: f opposes the sliding velocity v, m dv/dt = u - f."""

from .lugre import LuGre

__all__ = ["LuGre"]
