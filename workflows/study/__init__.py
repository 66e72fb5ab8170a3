"""Many runs over settings and seeds: designs, execution, storage, statistics."""

from __future__ import annotations

from ..execution import Executor, executor_of
from .plan import StudyOutcome, StudyPlan, StudyProgress
from .study import study

__all__ = ["Executor", "StudyOutcome", "StudyPlan", "StudyProgress", "executor_of", "study"]
