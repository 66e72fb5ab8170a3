"""Which configurations are those of a gap analysis."""

from __future__ import annotations

from pathlib import Path

from .source import load

OWN = ("run", "built_to", "free", "effects", "noise", "validation", "columns", "data", "settings",
       "next_measurement")  # fmt: skip
"""What such a configuration may have beside that of its model."""
OTHERS_HAVE = ("run", "columns")


def is_gap(path: Path) -> bool:
    """Whether a file has a table that only the configuration of a gap analysis has."""
    table = load(path, [])
    return (
        table is not None and "model" in table and bool((set(OWN) - set(OTHERS_HAVE)) & set(table))
    )
