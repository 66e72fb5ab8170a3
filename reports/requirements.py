"""The requirements that determine the tolerance of each part, and the saving by relaxing them."""

from __future__ import annotations

import pandas as pd

from ..records import RunResult
from .document import section
from .tables import described

RELAXED = (
    "The requirements at the knee of the front, or at its only point. The multiplier states by how "
    "much the least cost falls per unit of the limit. saves_at_least and saves_at_most hold for a limit "
    "that is relaxed by the given percentage while all others stay: the first by a computed allocation, "
    "the second because nothing can cost less than the bound there. drives names the parts "
    "that contribute most, and row which limit of a yield it is. requirements.csv has all digits."
)
DRIVEN = (
    "The requirements that limit the tolerance of each part: at the least cost the slope of its cost "
    "curve is the sum of multiplier times sensitivity over the requirements, and the table has their "
    "fractions of it. A part without any is as loose as its range allows. drivers.csv has this table."
)


def requirement_sections(result: RunResult) -> tuple[str, ...]:
    """The section on requirements, none for a single requirement or without proven bounds."""
    if result.requirements is None or result.drivers is None:
        return ()
    binding = [float(value) > 0.0 for value in result.requirements["multiplier_cost_per_unit"]]
    parts = described(RELAXED, result.requirements, binding), described(DRIVEN, _short(result.drivers))
    return (section("Requirements", "\n".join(parts)),)


def _short(drivers: pd.DataFrame) -> pd.DataFrame:
    """The table of drivers without requirements that limit no tolerance."""
    idle = [name for name in drivers if str(name).endswith("_percent") and not (drivers[name] != 0.0).any()]
    return drivers.drop(columns=idle)
