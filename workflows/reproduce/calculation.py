"""What recomputes a figure that is no output of a model or a problem."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...declarations import Parameter, Value
from ...records import Axis


@dataclass(frozen=True, slots=True)
class Quantity:
    """A computed number and its unit ("1" for none); `standard_error` is 0 where nothing is drawn."""

    value: float
    unit: str
    standard_error: float = 0.0


@dataclass(frozen=True, slots=True)
class Chart:
    """How a table is drawn: columns `y` over column `x`, as "lines", "points" or "histogram".

    A histogram has the lower edges of its bins in `x` and the last upper edge in a last row of
    height 0. `marks` are lines across the drawing at a value of `x`, by what they mean.
    """

    kind: str
    x: str
    y: tuple[str, ...]
    marks: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ComputedTable:
    """A table of a calculation: one array (n,) of numbers or of text per column."""

    name: str
    meaning: str
    columns: tuple[Axis, ...]
    values: tuple[NDArray[Any], ...]
    chart: Chart | None = None


@dataclass(frozen=True, eq=False)
class Computed:
    """What a calculation has found: numbers by name, and tables for the reader."""

    quantities: Mapping[str, Quantity]
    tables: tuple[ComputedTable, ...] = ()


class Calculation(ABC):
    """A plugin of the entry point group "tolevo.calculations".

    The defaults of `parameters` are the document's case; those that no document prints are marked
    as assumed. It is built without arguments and keeps no state.
    """

    name: ClassVar[str]
    about: ClassVar[str]
    """One sentence: what is computed."""
    reference: ClassVar[str]
    """Where the document has it."""
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def completed(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """All parameters by name; those left out have their defaults."""
        return {one.name: one.default for one in self.parameters} | dict(values)

    @abstractmethod
    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        """The quantities at parameters by name (those left out have their defaults).

        Raises InputError where the values do not go together.
        """
