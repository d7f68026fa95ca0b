"""Stable and unstable manifolds of saddles; the flow on a switching surface."""

from ... import on_first_use

_HOME = {
    "Arm": "arms",
    "FoldLine": "portrait",
    "Manifold": "manifolds",
    "Meeting": "arms",
    "SlidingPortrait": "portrait",
    "TwoFold": "portrait",
    "manifold": "manifolds",
    "sliding_portrait": "portraits",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
