"""The jets of a model with families: the slip program, and the general one where something is solved for.

Chain: jets.py, sliding.py -> writing (here) -> codegen.compile_model.
"""

from __future__ import annotations

from ...definition.model import Model
from ..taylor.recurrences import NoRecurrence
from .coupled import FamilyCoupled
from .jets import FamilyJet
from .sliding import FamilyGeneral


def write_family_jets(model: Model, patch: bool = False) -> dict[str, str]:
    """Sources as of jets.write_jets, of all elements or of a patch of them (kernels/local)."""
    try:
        sources = {"slip": FamilyJet(model, patch).write()}
        general = (FamilyCoupled if model.families.template.linked else FamilyGeneral)(model, patch)
        return sources | ({"general": general.write()} if general.residuals else {})
    except NoRecurrence as reason:
        return {"none": f"# no jets: {reason}\n"}
