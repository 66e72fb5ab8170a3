"""Quantities and tables of calculations, with the units of their names."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from ....declarations import Output, Parameter, Value
from ....models.propagation.power_sums import Stated
from ....records import Axis
from ....units import split_unit
from ..calculation import Chart, ComputedTable, Quantity


def parameter(
    name: str, default: Value, meaning: str, source: str, low: float = -inf, high: float = inf, **more: Any
) -> Parameter:
    """An input of a calculation; its unit is what the name ends with."""
    return Parameter(name, default, split_unit(name)[1], meaning, source, low=low, high=high, **more)


def assumed(
    name: str, default: Value, meaning: str, source: str = "assumed", low: float = -inf, high: float = inf, **more: Any
) -> Parameter:
    """An input whose default no document prints."""
    return parameter(name, default, meaning, source, low, high, assumed=True, **more)


def output(name: str, meaning: str) -> Output:
    """A quantity that a calculation declares; its unit is what the name ends with."""
    return Output(name, split_unit(name)[1], meaning)


def quantities(numbers: Mapping[str, float | Stated]) -> dict[str, Quantity]:
    """Numbers by name, with the unit that the name ends with and their standard error, if any."""
    stated = {
        name: number if isinstance(number, Stated) else Stated(float(number), 0.0) for name, number in numbers.items()
    }
    return {
        name: Quantity(estimate.value, split_unit(name)[1] or "1", estimate.error) for name, estimate in stated.items()
    }


def tabulated(name: str, meaning: str, columns: Mapping[str, Any], chart: Chart | None = None) -> ComputedTable:
    """A table of columns (n,) by name; the unit is what the name ends with."""
    axes = tuple(Axis(column, split_unit(column)[1]) for column in columns)
    return ComputedTable(name, meaning, axes, tuple(map(np.asarray, columns.values())), chart)
