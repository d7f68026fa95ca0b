"""The built-in settings by name; each is made on first use."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from importlib import import_module

from ...door import checks
from .rungs import Setting

__all__ = ["scenes", "setting_of"]

# Name -> (module, factory).
_HOME: Mapping[str, tuple[str, str]] = {
    "oscillator": ("settings_friction", "hidden_oscillator"),
    "forced oscillator": ("settings_friction", "forced_oscillator"),
    "belt": ("settings_friction", "belt"),
    "presliding": ("settings_friction", "presliding"),
    "drift": ("settings_friction", "drift"),
    "impact": ("contact", "impact"),
    "ball": ("contact", "falling"),
    "slider-crank": ("joint", "crank"),
}


def scenes() -> tuple[str, ...]:
    """Names of the built-in settings.

    Returns
    -------
    tuple of str
        As `ladder` takes them.

    Examples
    --------
    >>> from pwsmooth.compare.ladders import scenes
    >>> "belt" in scenes()
    True
    """
    return tuple(_HOME)


@functools.cache
def _setting(name: str) -> Setting:
    module, factory = _HOME[name]
    make: Callable[[], Setting] = getattr(import_module(f".{module}", __package__), factory)
    return make()


@checks.door()
def setting_of(scene: str | Setting) -> Setting:
    """A setting by name, or one's own as it is.

    Parameters
    ----------
    scene : str or Setting
        One of `scenes()`, or a setting of one's own.

    Returns
    -------
    Setting
        Made on first use.

    Raises
    ------
    ValueError, TypeError
        An unknown name; something that is neither.

    >>> setting_of("impact").title
    'free impact'
    """
    if isinstance(scene, Setting):
        return scene
    if not isinstance(scene, str):
        raise TypeError(
            f"`scene` is {scene!r}; give one of {', '.join(_HOME)}, or a Setting: friction_setting(...) and "
            "contact_setting(...) make one of a law and a scene."
        )
    if scene not in _HOME:
        raise ValueError(f"`scene` is {scene!r}, which is none of {', '.join(_HOME)}.")
    return _setting(scene)
