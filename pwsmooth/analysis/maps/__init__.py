"""The map of one period or return: sections, segments, symmetry, and its derivative through sticks and impacts."""

from ... import on_first_use

_HOME = {
    "Image": "sections",
    "Return": "seen",
    "Section": "sections",
    "Strobe": "seen",
    "Stroboscopic": "sections",
    "Variations": "first_order",
    "variations": "first_order",
    "word_of": "sections",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
