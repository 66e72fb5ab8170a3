"""A namer that always says the same."""

from __future__ import annotations

from typing import Any

from benchmarks.gap.generator.records import Record
from benchmarks.gap.namers.seen import said, seen


def always_compliance(record: Record) -> dict[str, Any]:
    """Whatever it is, something twists."""
    found = seen(record)
    return said(found, ["torsional_compliance"], found.points.torque[:, None])
