"""Names as they are written on the page: a letter, Greek where the name spells one, and a subscript."""

from __future__ import annotations

import re

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "eps": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "kappa": "κ", "lam": "λ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ",
    "tau": "τ", "phi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "Omega": "Ω", "Delta": "Δ", "Phi": "Φ",
}  # fmt: skip


def spelled(name: str) -> tuple[str, str]:
    """(letter, subscript) of a name; "h:lam" is the surface of the switch lam."""
    if name.startswith("h:"):
        return f"h of {written(name[2:])}" if name[2:].isidentifier() else "h", ""
    head, *rest = name.split("_")
    found = re.fullmatch(r"([A-Za-z]+?)(\d*)", head)
    stem, digits = found.groups() if found else (head, "")
    if stem in _GREEK and digits:
        rest.insert(0, digits)
    return _GREEK.get(stem, head), " ".join(_GREEK.get(r, r) for r in rest)


def written(name: str) -> str:
    """The name in one line."""
    head, sub = spelled(name)
    return f"{head}_{sub}" if sub else head


def short(value: float) -> str:
    """A number to three digits, with a minus sign."""
    return f"{value:.3g}".replace("-", "−")
