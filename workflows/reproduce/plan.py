"""What `reproduce` needs and what it returns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...claim_records import ClaimsResult
from .claims import ClaimsFile


@dataclass(frozen=True, slots=True)
class Source:
    """A claims file that has been read; `tables` is all its content, as JSON."""

    file: ClaimsFile
    tables: str


@dataclass(frozen=True, slots=True)
class ReproducePlan:
    """The claims of one or more documents."""

    sources: tuple[Source, ...]

    @property
    def total(self) -> int:
        """Number of claims."""
        return sum(len(source.file.claims) for source in self.sources)


@dataclass(frozen=True, slots=True)
class ReproduceOutcome:
    """How it ended: "done" or "interrupted", and where its files are."""

    status: str
    folder: Path
    lines: tuple[str, ...]
    result: ClaimsResult | None = None


@dataclass(frozen=True, slots=True)
class ClaimsProgress:
    """State of the work: claims done of all, the time since it began [s], those done `before`."""

    done: int
    total: int
    seconds: float
    note: str = ""
    before: int = 0

    @property
    def remaining(self) -> float | None:
        """Remaining time [s] if all claims take as long as those so far; None before the first."""
        checked_now = self.done - self.before
        return self.seconds * (self.total - self.done) / checked_now if checked_now else None
