"""All laws of the package by name, and which of them a place takes: a scene, the command line and the page ask here.

Chain: laws/friction, laws/contact -> **catalogue** -> scenes/drive.py, studies/study.py, explorer/subject.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..door import calls, checks
from . import contact, friction
from .contract import Law


def known_laws() -> dict[str, Any]:
    """Name -> class of every law of the package."""
    found = {n: getattr(module, n) for module in (friction, contact) for n in module.__all__}
    return {n: law for n, law in found.items() if isinstance(law, type) and issubclass(law, Law)}


@dataclass(frozen=True)
class Takes:
    """Which laws a place takes; as a test of an argument it gives the law back or says why not."""

    kind: str = ""  # "friction" or "contact"; "" takes both
    in_plane: bool = False  # its velocity has two components
    spins: bool | None = False  # whether its contact spins; None: either

    def why_not(self, law: Any) -> str:
        """Why a law, or a class of laws, has no place there; empty if it fits."""
        if self.kind and law.kind not in ("", self.kind):
            return f"a {law.kind} law where a {self.kind} law belongs"
        if self.spins and not law.spins:
            return "which knows no spin"
        if self.spins is False and law.spins:
            return "a law of a contact that slides and spins"
        if self.in_plane and not law.in_plane:
            return "a law of one velocity, where it has two components"
        return ""

    def names(self) -> list[str]:
        """The laws of the package that fit."""
        return [name for name, law in known_laws().items() if not self.why_not(law)]

    def __call__(self, value: Any, what: str) -> Law:
        if isinstance(value, type) and issubclass(value, Law):
            raise TypeError(f"{what} is the class {value.__name__}; give a law, {value.__name__}().")
        if not isinstance(value, Law):
            usual = ("Coulomb", "Hertz", *self.names())
            near = calls.closest(value, self.names()) if isinstance(value, str) else ""
            near = near or next(name for name in usual if name in self.names())
            raise TypeError(f"{what} is {checks.shown(value)}; give a law of pwsmooth.laws, such as {near}().")
        if reason := self.why_not(value):
            fits = ", ".join(self.names())
            raise ValueError(f"{what} is {type(value).__name__}, {reason}; those that fit are {fits}.")
        return value
