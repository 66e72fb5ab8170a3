"""The reducer of document B with its modification: the reducer where none is named."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ..rv_backlash import RvBacklash
from ..settings import Settings, VariableSetting
from .nested import Nested

MODIFICATION = {"stagger_arcmin": 0.0, "dr_rp_mm": -0.04, "dr_p_mm": -0.07}
"""Document B's equidistance and shift modification, without stagger."""
TABLES: dict[str, Any] = {
    "problem": "rv_backlash",
    "parameters": {"reading": "printed"},
    "variables": {name: {"value": value} for name, value in MODIFICATION.items()},
    "objectives": {"minimise": ["cost", "backlash_rms_arcmin"]},
}


@lru_cache(maxsize=1)
def documents_reducer() -> Nested:
    """An RV-40E-121 by document B's closed form as printed, its modification fixed."""
    fixed = {name: VariableSetting(value=value) for name, value in MODIFICATION.items()}
    problem = RvBacklash(
        Settings(parameters={"reading": "printed"}, variables=fixed, objectives=("cost", "backlash_rms_arcmin"))
    )
    return Nested("rv_backlash as printed, document B's modification", TABLES, problem)
