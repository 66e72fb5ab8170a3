"""Ranges of the next measurement that do not fit the data."""

from __future__ import annotations

from ....errors import Fault
from ....models.measurable import Role
from ..data import GapData
from ..plan import GapPlan
from .points import NO_POINT, RANGE, axes_of, candidates, inside


def range_faults(plan: GapPlan, data: GapData, place: str) -> list[Fault]:
    """Faults of ranges of missing columns, of past times, and of ranges without a point."""
    wanted = plan.next_measurement
    if wanted is None:
        return []
    known = {column.name: column for column in data.target.columns}
    faults = []
    for name, span in wanted.ranges.items():
        text = ""
        if name not in known:
            text = f"{place} has no such column, so the next table has none either; remove this range"
        elif known[name].role is Role.TIME:
            last = float(data.values(name).max())
            text = f"ends before the record, at {last:g}" if span.high <= last else ""
        if text:
            faults.append(Fault(f"{RANGE}.{name}", text))
    if not faults and not data.target.population:
        points = candidates(data, axes_of(data, wanted.ranges, wanted.readings), plan.seed)
        faults += [] if inside(plan.model, points).any() else [Fault(RANGE, NO_POINT)]
    return faults
