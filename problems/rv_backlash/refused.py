"""Refused before a search: a promise that interference would keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import Fault

if TYPE_CHECKING:
    from ..limits import Limit
    from .problem import RvBacklash

INTERFERENCE = "interference_probability"
OPENING = "dr_rp_mm", "dr_p_mm", "stagger_arcmin"
"""Variables that move phi_2 of every unit and cost nothing."""


def refused(problem: RvBacklash) -> list[Fault]:
    """A promise without a limit on interference, where modification or stagger are searched."""
    opened = [variable.name for variable in problem.free if variable.name in OPENING]
    if problem.promise is None or INTERFERENCE in problem.settings.limits or not opened:
        return []
    return [
        Fault(
            f"limits.{INTERFERENCE}",
            "is missing: without a limit on interference the promise is kept by units that are nearly all preloaded "
            "(92 to 95 % of them in the document's case, at half the cost); set, for example, 0.05 (1 allows any), "
            f"or fix {', '.join(f'variables.{name}.value' for name in opened)}",
        )
    ]


def allows_any(limit: Limit) -> bool:
    """Whether a limit says that units may interfere as they like."""
    return limit.name == INTERFERENCE and limit.low <= 0.0 and limit.high >= 1.0
