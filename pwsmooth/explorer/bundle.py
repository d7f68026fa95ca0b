"""The page's module and style as texts, for the server, a widget and files that stand alone.

Delivered without what only readers need, where `rjsmin` and `rcssmin` are there, as the extras bring them; without
these the files are as they are written, and larger.
"""

from __future__ import annotations

import functools
import importlib.resources
import re
from importlib import import_module

NARROW = 760  # px, below which the page has the layout of a phone
WIDE = 1100  # px, from which on three views stand in a row
_PARTS = ("plot.js", "views.js", "explorer.js")


@functools.cache
def static(name: str) -> bytes:
    """A file of the page as it is delivered."""
    return _short(_source(name), name.rpartition(".")[2]).encode()


@functools.cache
def module(narrow: int = NARROW) -> str:
    """The parts as one ES module, which exports nothing: `mount` is a name in it."""
    text = re.sub(r"^import .*\n|^export (?=\w)", "", "\n".join(map(_source, _PARTS)), flags=re.M)
    return _short(text, "js").replace(f"{NARROW - 1}px", f"{narrow - 1}px")


@functools.cache
def style(narrow: int = NARROW, wide: int = WIDE) -> str:
    """The style sheet, with the layout of a phone below `narrow` pixels, and three views in a row from `wide` on."""
    text = static("style.css").decode().replace(f"{WIDE - 1}px", f"{wide - 1}px")
    return text.replace(f"{NARROW - 1}px", f"{narrow - 1}px").replace(f"{NARROW}px", f"{narrow}px")


def _source(name: str) -> str:
    return importlib.resources.files(__package__).joinpath("static", name).read_text(encoding="utf-8")


def _short(text: str, ending: str) -> str:
    try:
        if ending == "js":
            return str(import_module("rjsmin").jsmin(text))
        if ending == "css":
            return str(import_module("rcssmin").cssmin(text))
    except ImportError:
        pass
    return text
