"""How far a gap analysis is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GapProgress:
    """What is being done; of replicates how many of them are, and the time left [s]."""

    phase: str
    done: int = 0
    total: int = 0
    remaining: float | None = None


Tell = Callable[[GapProgress], None]


def silent(progress: GapProgress) -> None:
    """Tells nobody."""
