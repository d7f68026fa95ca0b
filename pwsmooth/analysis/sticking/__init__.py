"""Where a contact sticks: regions, folds, capture."""

from ... import on_first_use

_HOME = {
    "Fold": "regions",
    "StickingRegion": "regions",
    "capture_threshold": "regions",
    "critical_ratio": "regions",
    "fold": "regions",
    "linear_sticking": "regions",
    "nonlinear_sticking": "regions",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
