"""The stand-in for a part that was written with faults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...models.inputs import Normal
from .definition import Part, Process


def stand_in(table: Mapping[str, Any], at: int) -> Part:
    """A part with the names of a faulty one, so that the other tables can be checked."""
    name = table.get("name")
    processes = (Process(0.0, 1.0), Process(0.0, 1.0))
    return Part(
        name if isinstance(name, str) else f"part_{at}", "", processes, Normal(), alternatives="process" in table
    )
