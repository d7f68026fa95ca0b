"""Laws of friction and contact: symbolic components that any scene can carry; the contract is in contract.py."""

from .contract import Joint, Law, Pieces, law, parameter

__all__ = ["Joint", "Law", "Pieces", "law", "parameter"]
