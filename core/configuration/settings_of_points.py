"""Every point of a design, read as a run configuration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..errors import Fault, InputError, raise_all
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Section
from ..workflows.study.plan import Point
from ..workflows.study.records import Factor, Level
from .configuration import Configuration
from .reader import read_table
from .search import read_search
from .source import Table
from .varied import variable_table, with_values

SHOWN = 10
"""Faults of points that are listed; the rest is counted."""


def built_points(
    design: pd.DataFrame, factors: tuple[Factor, ...], base: Configuration, run: Table
) -> tuple[tuple[Point, ...], tuple[ToleranceProblem, ...]]:
    """What runs at each point, and the different problems among them.

    Raises InputError with the faults of all points, each named once.
    """
    builder = _Builder(variable_table(run, [factor.key for factor in factors], base.resolved))
    faults: dict[str, Fault] = {}
    points = []
    for row in design[[factor.key for factor in factors]].to_dict("records"):
        values = {str(key): _toml_scalar(value) for key, value in row.items()}
        try:
            points.append(builder.point(values))
        except InputError as error:
            for fault in error.faults:
                placed = _placed(fault, values)
                faults.setdefault(str(placed), placed)
    listed = list(faults.values())
    if len(listed) > SHOWN:
        listed = [*listed[:SHOWN], Fault("vary", f"{len(listed) - SHOWN} more faults of this kind")]
    raise_all(listed)
    return tuple(points), tuple(builder.problems)


def some(design: pd.DataFrame, factors: tuple[Factor, ...], most: int) -> pd.DataFrame:
    """At most about `most` rows: the ends of every factor, and the others evenly."""
    if len(design) <= most:
        return design
    rows = set(np.linspace(0, len(design) - 1, most).astype(int).tolist())
    for factor in factors:
        order = design[factor.key].astype(str if factor.categorical else float).argsort()
        rows |= {int(order.iloc[0]), int(order.iloc[-1])}
    return design.iloc[sorted(rows)]


class _Builder:
    """Reads points; a problem that several points have in common is built once."""

    def __init__(self, run: Table) -> None:
        self.run = run
        self.problems: list[ToleranceProblem] = []
        self._numbers: dict[str, int] = {}

    def point(self, values: Mapping[str, Level]) -> Point:
        """The point with these values of the varied keys."""
        table = with_values(self.run, values)
        algorithm = table.pop("algorithm", {})
        key = json.dumps(table, sort_keys=True, default=str)
        if key not in self._numbers:
            return self._first(key, table | {"algorithm": algorithm})
        number = self._numbers[key]
        faults: list[Fault] = []
        section = Section({"algorithm": algorithm}, "", faults).section("algorithm")
        problem = self.problems[number]
        search = read_search(section, problem.n_obj, problem.declaration.algorithm)
        raise_all(faults)
        return Point(number, search["algorithm"], search["budget"], search["engine"])

    def _first(self, key: str, table: Table) -> Point:
        """The first point of a problem."""
        configuration = read_table(table, [])
        assert configuration.problem is not None
        assert configuration.algorithm is not None
        self._numbers[key] = len(self.problems)
        self.problems.append(configuration.problem)
        return Point(self._numbers[key], configuration.algorithm, configuration.budget, configuration.engine)


def _placed(fault: Fault, values: Mapping[str, Level]) -> Fault:
    """A fault at the varied key that causes it, else in the run, with the values of the point."""
    if fault.place in values:
        return Fault(f"vary.{fault.place}", fault.message)
    where = ", ".join(f"{key} = {value}" for key, value in values.items())
    return Fault(f"run.{fault.place}", f"{fault.message} (where {where})")


def _toml_scalar(value: Any) -> Level:
    """A value of a table as TOML would give it."""
    plain = value.item() if hasattr(value, "item") else value
    assert isinstance(plain, float | int | str)
    return plain
