"""The interface of a model whose outputs can be measured."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..declarations import Output, Parameter, Value, Variable
from .inputs.distribution import Array, Distribution


@dataclass(frozen=True, slots=True)
class Column:
    """An input column of a measurement table; `text` columns are labels, not numbers."""

    name: str
    unit: str
    meaning: str
    needed: bool = True
    text: bool = False


class MeasurableModel(ABC):
    """A model that predicts the readings of a measurement table, row by row.

    `columns` are its inputs, `free` the parameters that a recalibration may move, each with its
    tolerance (half-width, in the parameter's unit). It is set up from `parameters` and `designs`
    (variables by name, in their units; what is left out keeps its default) and the distributions
    `inputs` of the variables by name.
    """

    columns: ClassVar[tuple[Column, ...]]
    outputs: ClassVar[tuple[Output, ...]]
    parameters: ClassVar[tuple[Parameter, ...]]
    variables: ClassVar[tuple[Variable, ...]] = ()
    free: ClassVar[Mapping[str, float]]

    @abstractmethod
    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None: ...

    @abstractmethod
    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator
    ) -> dict[str, Array]:
        """Every output (n,), in its unit, at the rows of a table of columns (n,)."""
