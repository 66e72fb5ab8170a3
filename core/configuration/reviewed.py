"""The text of `tolevo review`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..tables import ReadOptions
from ..workflows.promise.review import review
from .review import reopened


def reviewed(run: Path, parts: Sequence[Path], since: Sequence[Path], options: ReadOptions) -> str:
    """Sentences and the table of the parts. Raises InputError with every fault."""
    reopened_run = reopened(run, parts, since, options)
    result = review(
        reopened_run.before,
        reopened_run.design,
        reopened_run.now,
        reopened_run.reset,
        reopened_run.measured_parts,
        reopened_run.since,
        reopened_run.attributed,
        [name for name in reopened_run.measured_parts if name in reopened_run.earlier],
    )
    shown = result.parts.dropna(axis="columns", how="all")
    table = shown.to_string(index=False, float_format="%.4g", na_rep="-")
    return "\n".join([*result.lines, "", table])
