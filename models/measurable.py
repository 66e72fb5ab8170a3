"""The interface of a model whose predictions can be measured."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..declarations import Output, Parameter, Variable

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Column:
    """An input column of a measurement table; `label` columns are names, not numbers."""

    name: str
    unit: str
    meaning: str
    needed: bool = True
    label: bool = False


class MeasurableModel(ABC):
    """A model that predicts the outputs of a measurement table, row by row."""

    columns: ClassVar[tuple[Column, ...]]
    outputs: ClassVar[tuple[Output, ...]]
    parameters: ClassVar[tuple[Parameter, ...]]
    variables: ClassVar[tuple[Variable, ...]] = ()
    free: ClassVar[tuple[str, ...]] = ()
    """Names of the parameters that a comparison with measurements may recalibrate."""

    @abstractmethod
    def predict(self, table: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Array]:
        """Outputs (n,) by name for the n rows of a table of input columns."""
