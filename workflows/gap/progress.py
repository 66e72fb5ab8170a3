"""Progress of a gap analysis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GapProgress:
    """The current phase; for replicates how many are done, of how many, the remaining time [s]."""

    phase: str
    done: int = 0
    total: int = 0
    remaining: float | None = None


Report = Callable[[GapProgress], None]


def silent(progress: GapProgress) -> None:
    """Ignore the progress."""
