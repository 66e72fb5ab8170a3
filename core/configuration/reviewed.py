"""The text of `tolevo review`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..tables import ReadOptions
from ..workflows.promise.review import review
from .review import reopened


def reviewed(run: Path, parts: Sequence[Path], since: Sequence[Path], options: ReadOptions) -> str:
    """Sentences and the table of the parts. Raises InputError with every fault."""
    problem = reopened(run, parts, since, options)
    result = review(
        problem.before,
        problem.design,
        problem.now,
        problem.reset,
        problem.made,
        problem.since,
        problem.attributed,
        [name for name in problem.made if name in problem.earlier],
    )
    shown = result.parts.dropna(axis="columns", how="all")
    table = shown.to_string(index=False, float_format="%.4g", na_rep="-")
    return "\n".join([*result.lines, "", table])
