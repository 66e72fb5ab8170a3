"""The roughness that a tolerance and the process behind its cost curve ask for."""

from __future__ import annotations

from collections.abc import Mapping

from ...units import converted, fits

PREFERRED = (0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.3, 12.5, 25.0)
"""Preferred values of Ra [um], ISO 21920-1."""
USUAL: Mapping[str, tuple[float, float]] = {
    "superfinish": (0.05, 0.2), "lapp": (0.05, 0.4), "polish": (0.1, 0.4), "hon": (0.1, 0.8),
    "ground": (0.1, 1.6), "grind": (0.1, 1.6), "turn": (0.4, 6.3), "bor": (0.4, 6.3),
    "ream": (0.8, 3.2), "broach": (0.8, 3.2), "mill": (0.8, 6.3), "drill": (1.6, 6.3),
    "plan": (1.6, 12.5), "saw": (1.6, 25.0),
}  # fmt: skip
"""Ra [um] that a process usually reaches, by how its name begins (ASME B46.1, appendix B)."""
SHARE = 1.0 / 20.0
"""Ra as a share of the width of the zone at most: peaks, some five times Ra, take a quarter."""


def roughness(process: str, width: float, unit: str) -> float | None:
    """The largest preferred Ra [um] that a zone of a `width` takes, within what the process of its
    cost curve usually reaches; None where the process is not known by name, or it is no length.
    """
    stem = next((one for one in USUAL if process.lower().startswith(one)), None)
    if stem is None or not unit or not fits(unit, "um"):
        return None
    finest, coarsest = USUAL[stem]
    most = min(coarsest, SHARE * float(converted(width, unit, "um")))
    return max((one for one in PREFERRED if finest <= one <= most * (1.0 + 1e-9)), default=finest)
