"""The page's module and style as two texts, for a widget and for files that stand alone."""

from __future__ import annotations

import importlib.resources
import re

NARROW = 760  # px, below which the page has the layout of a phone
WIDE = 1100  # px, from which on three views stand in a row
_PARTS = ("plot.js", "views.js", "explorer.js")


def static(name: str) -> bytes:
    """A file of the page as it is delivered: without indentation and lines of comment, which only its readers need."""
    text = importlib.resources.files(__package__).joinpath("static", name).read_text(encoding="utf-8")
    return re.sub(r"^[ \t]*(?://.*)?\n|^[ \t]+", "", text, flags=re.M).encode()


def module(narrow: int = NARROW) -> str:
    """The parts as one ES module, which exports nothing: `mount` is a name in it."""
    texts = (static(name).decode() for name in _PARTS)
    text = "\n".join(re.sub(r"^import .*\n|^export (?=\w)", "", text, flags=re.M) for text in texts)
    return text.replace(f"{NARROW - 1}px", f"{narrow - 1}px")


def style(narrow: int = NARROW, wide: int = WIDE) -> str:
    """The style sheet, with the layout of a phone below `narrow` pixels, and three views in a row from `wide` on."""
    text = static("style.css").decode().replace(f"{WIDE - 1}px", f"{wide - 1}px")
    return text.replace(f"{NARROW - 1}px", f"{narrow - 1}px").replace(f"{NARROW}px", f"{narrow}px")
