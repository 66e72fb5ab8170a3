"""Tables of calculations from columns by name, with their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....records import Axis
from ....units import split_unit
from ..calculation import Chart, ComputedTable


def tabulated(
    name: str, meaning: str, columns: Mapping[str, Any], chart: Chart | None = None
) -> ComputedTable:
    """A table of columns (n,) by name; the unit is what the name ends with."""
    axes = tuple(Axis(one, split_unit(one)[1]) for one in columns)
    return ComputedTable(name, meaning, axes, tuple(map(np.asarray, columns.values())), chart)
