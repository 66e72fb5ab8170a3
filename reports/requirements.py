"""Which requirement drives which part, and what relaxing each would save."""

from __future__ import annotations

from html import escape

import pandas as pd

from ..records import RunResult
from .document import section
from .tables import table

RELAXED = (
    "Each requirement at the knee of the front, or at its one point. The multiplier is by how "
    "much the least cost falls per unit of its limit. saves_at_least and saves_at_most hold for a "
    "limit "
    "that is relaxed by the percentage given, all others kept: the first by an allocation that was "
    "found, the second because nothing can cost less than the bound there. drives names the parts "
    "that it consists of most. requirements.csv has all digits."
)
DRIVEN = (
    "What holds the tolerance of each part down: at the least cost the slope of its cost curve is "
    "the sum of multiplier times sensitivity over the requirements, and these are their shares. "
    "A part without any is as loose as its range allows. drivers.csv has this table."
)


def requirement_sections(result: RunResult) -> tuple[str, ...]:
    """The section on requirements, none where there is one or nothing is proven."""
    if result.requirements is None or result.drivers is None:
        return ()
    binding = [float(value) > 0.0 for value in result.requirements["multiplier_cost_per_unit"]]
    first = f"<p>{escape(RELAXED)}</p>\n{table(result.requirements, binding)}"
    second = f"<p>{escape(DRIVEN)}</p>\n{table(_short(result.drivers))}"
    return (section("Requirements", f"{first}\n{second}"),)


def _short(drivers: pd.DataFrame) -> pd.DataFrame:
    """The table of drivers without requirements that drive nothing."""
    idle = [name for name in drivers if str(name).endswith("_percent") and not (drivers[name] != 0.0).any()]
    return drivers.drop(columns=idle)
