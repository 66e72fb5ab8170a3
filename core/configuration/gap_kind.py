"""Which configurations are those of a gap analysis."""

from __future__ import annotations

from .source import Source, load

OWN = ("run", "built_to", "free", "effects", "noise", "validation", "columns", "data", "settings", "next_measurement")
"""Keys of such a configuration in addition to those of its model."""
OTHERS_HAVE = ("run", "columns")


def is_gap(source: Source) -> bool:
    """Whether a configuration has a table that only that of a gap analysis has."""
    table = load(source, [])
    return table is not None and "model" in table and bool((set(OWN) - set(OTHERS_HAVE)) & set(table))
