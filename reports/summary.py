"""The summary of a result as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from .tables import shown, table

ELSEWHERE = frozenset(
    {
        "assumptions",
        "notes",
        "choices",
        "rounding",
        "axes",
        "bars",
        "files",
        "units",
        "validity",
        "assumptions_at",
        "mechanism",
    }
)
"""Keys that the page shows in other places, or uses itself."""


def summary_table(summary: Mapping[str, Any]) -> str:
    """`summary.json` by name and value, without the keys that are shown elsewhere."""
    rows = [(name, _flat(value)) for name, value in summary.items() if name not in ELSEWHERE]
    return table(pd.DataFrame(rows, columns=["name", "value"], dtype=object))


def _flat(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_flat(part)}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_flat, value))
    return shown(value)
