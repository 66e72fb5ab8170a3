"""Recalibration so large that it may hide a cause."""

from __future__ import annotations

from collections.abc import Iterable

from .ending_records import recalibrated
from .result import Ending

FAR = 0.5
"""Fraction of its tolerance from which a parameter has moved far."""
SURE = 4.0
"""Number of standard errors that it must have moved."""


def moved_far(end: Ending) -> str:
    """The note on parameters that moved far and beyond their errors; empty where none has."""
    model = end.model
    pairs = zip(model.numbers, model.errors.tolist(), strict=True)
    errors = {number.name: error for number, error in pairs if number.kind == "free"}
    return recalibration_message(
        (parameter.name, parameter.after - parameter.before, parameter.tolerance, errors[parameter.name])
        for parameter in recalibrated(end)
    )


def recalibration_message(moves: Iterable[tuple[str, float, float, float]]) -> str:
    """The same note from names, moves, tolerances and standard errors."""
    far = [name for name, move, tolerance, error in moves if abs(move) > max(FAR * tolerance, SURE * error)]
    if not far:
        return ""
    return (
        f"recalibrated by more than {100 * FAR:.0f} % of its tolerance: {', '.join(far)}; with an empty "
        "[free] this would be a gap, and its effect would be identified if the library contains it"
    )
