"""Many runs over settings and seeds: designs, execution, storage, statistics."""

from __future__ import annotations

from .plan import StudyOutcome, StudyPlan, StudyProgress
from .study import study

__all__ = ["StudyOutcome", "StudyPlan", "StudyProgress", "study"]
