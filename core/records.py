"""Result records: what workflows hand to reports and to the user's scripts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Axis:
    """A column of a result that is drawn: its name, unit, and what it means."""

    name: str
    unit: str
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Bars:
    """A bar chart: what it shows, the unit of its values, and one value per label."""

    title: str
    unit: str
    labels: tuple[str, ...]
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RunResult:
    """One finished optimisation.

    `front`, `references`, `convergence` are the tables of the files of these names; `summary` is
    `summary.json`; `objectives` are the axes of the front, `variables` the design variables,
    `bars` charts of the problem itself, and `configuration` is the resolved TOML. Where effects act
    in the model, `before` is the front without them and `moved` how the allocation moves.
    """

    title: str
    front: pd.DataFrame
    references: pd.DataFrame
    convergence: pd.DataFrame
    summary: Mapping[str, Any]
    objectives: tuple[Axis, ...]
    variables: tuple[Axis, ...] = ()
    notes: tuple[str, ...] = ()
    bars: tuple[Bars, ...] = ()
    configuration: str = field(default="", repr=False)
    before: pd.DataFrame | None = None
    moved: pd.DataFrame | None = None
