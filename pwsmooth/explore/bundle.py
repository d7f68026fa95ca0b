"""The page's module and style as two texts, for a widget and for files that stand alone."""

from __future__ import annotations

import importlib.resources
import re

_PARTS = ("plot.js", "views.js", "explorer.js")


def static(name: str) -> bytes:
    """A file of the page."""
    return importlib.resources.files(__package__).joinpath("static", name).read_bytes()


def module() -> str:
    """The three parts as one ES module, which exports nothing: `mount` and `unpack` are names in it."""
    texts = (static(name).decode() for name in _PARTS)
    return "\n".join(re.sub(r"^import .*\n|^export (?=\w)", "", text, flags=re.M) for text in texts)


def style() -> str:
    """The style sheet."""
    return static("style.css").decode()
