"""The roughness that a tolerance and the process behind its cost curve ask for."""

from __future__ import annotations

from collections.abc import Mapping

from ...declarations import Assumption
from ...problems.tolerance_problem import ToleranceProblem
from ...units import converted, fits
from .settings import ChoiceSettings

PREFERRED = (0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.3, 12.5, 25.0)
"""Preferred values of Ra [um], ISO 21920-1."""
USUAL: Mapping[str, tuple[float, float]] = {
    "superfinish": (0.05, 0.2),
    "lapp": (0.05, 0.4),
    "polish": (0.1, 0.4),
    "hon": (0.1, 0.8),
    "ground": (0.1, 1.6),
    "grind": (0.1, 1.6),
    "turn": (0.4, 6.3),
    "bor": (0.4, 6.3),
    "ream": (0.8, 3.2),
    "broach": (0.8, 3.2),
    "mill": (0.8, 6.3),
    "drill": (1.6, 6.3),
    "plan": (1.6, 12.5),
    "saw": (1.6, 25.0),
}
"""Ra [um] that a process usually reaches, by how its name begins (ASME B46.1, appendix B)."""
SHARE = 1.0 / 20.0
"""Ra as a fraction of the width of the zone at most: peaks, some five times Ra, take a quarter."""
WHY = "Ra is at most this fraction of the width of a zone: peaks, some five times Ra, take a quarter"


def share_of(settings: ChoiceSettings) -> float:
    """The most that Ra may be of the width of a zone."""
    return SHARE if settings.roughness_share is None else settings.roughness_share


def roughness_assumptions(problem: ToleranceProblem, settings: ChoiceSettings) -> tuple[Assumption, ...]:
    """The assumption behind a roughness, where a process of the problem implies one."""
    names = [label for v in problem.variables if v.name.endswith("_process") for label in v.labels]
    if not any(_usual(name) for name in names):
        return ()
    set_by = "default" if settings.roughness_share is None else "configuration"
    reason = WHY if settings.roughness_share is None else WHY.split(":")[0]
    return (Assumption("choice.roughness_share", share_of(settings), "", reason, set_by),)


def roughness(process: str, width: float, unit: str, largest_share: float = SHARE) -> float | None:
    """The largest preferred Ra [um] that a zone of a `width` takes, at most a `largest_share` of it
    and within what the process of its cost curve usually reaches; None where the process is not
    known by name, or it is no length.
    """
    usual = _usual(process)
    if usual is None or not unit or not fits(unit, "um"):
        return None
    finest, coarsest = usual
    most = min(coarsest, largest_share * float(converted(width, unit, "um")))
    return max((ra for ra in PREFERRED if finest <= ra <= most * (1.0 + 1e-9)), default=finest)


def _usual(process: str) -> tuple[float, float] | None:
    """Ra [um] that a process usually reaches; None where it is not known by name."""
    return next((ra for stem, ra in USUAL.items() if process.lower().startswith(stem)), None)
