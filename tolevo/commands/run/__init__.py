"""One optimisation: search, reported front, references, files."""

from __future__ import annotations

from .plan import RunOutcome, RunPlan
from .run import run

__all__ = ["RunOutcome", "RunPlan", "run"]
