"""The text of `tolevo review`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..tables import ReadOptions
from ..workflows.promise.review import review
from .review import reopened


def reviewed(run: Path, parts: Sequence[Path], since: Sequence[Path], options: ReadOptions) -> str:
    """Sentences and the table of the parts. Raises InputError with every fault."""
    one = reopened(run, parts, since, options)
    found = review(
        one.before,
        one.design,
        one.now,
        one.reset,
        one.made,
        one.since,
        one.attributed,
        [name for name in one.made if name in one.earlier],
    )
    shown = found.parts.dropna(axis="columns", how="all")
    table = shown.to_string(index=False, float_format="%.4g", na_rep="-")
    return "\n".join([*found.lines, "", table])
