"""Merging of tables: `--set`, and keys given in addition to an object, change a configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

INSTEAD = {"value": ("low", "high"), "low": ("value",), "high": ("value",)}
"""Keys that are removed when another is set: a fixed value replaces a range, and the reverse."""


def merge(table: dict[str, Any], over: Mapping[str, Any], whole: bool = False) -> bool:
    """Put the values of `over` into `table`, tables into tables.

    False where a table meets a value; if `whole`, it takes the place of that value.
    """
    for key, value in over.items():
        inner = table.get(key)
        meets = isinstance(value, dict) and bool(value) and key in table
        if meets and isinstance(inner, dict):
            if not merge(inner, value, whole):
                return False
            continue
        if meets and not whole:
            return False
        for replaced in INSTEAD.get(key, ()):
            table.pop(replaced, None)
        table[key] = value
    return True
