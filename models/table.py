"""Predictions in a table: those of any simulator, next to the measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..declarations import Output, Parameter
from ..units import converted
from .gear import Gear
from .measurable import NO_CHANGES, Column, MeasurableModel, Role


class MeasuredTable(MeasurableModel):
    """`model = "table"`: predictions are read from a column, and nothing can change inside.

    `inputs` are the columns that effects may depend on; `predictions` names the column of each
    output and its unit; columns in `ignored` are omitted, predictions in `turned` count with the
    opposite sign.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    free: ClassVar[Mapping[str, float]] = {}

    def __init__(
        self,
        inputs: tuple[Column, ...],
        outputs: tuple[Output, ...],
        predictions: Mapping[str, tuple[str, str]],
        ignored: tuple[str, ...] = (),
        gear: Gear | None = None,
        turned: tuple[str, ...] = (),
    ) -> None:
        prediction_columns = tuple(
            Column(column, unit, f"prediction of {name}", role=Role.INPUT)
            for name, (column, unit) in predictions.items()
        )
        self.columns = (*inputs, *prediction_columns)  # type: ignore[misc]
        self.outputs = outputs  # type: ignore[misc]
        self.predictions = dict(predictions)
        self.ignored = ignored
        self.gear = gear
        self.turned = turned

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        return {
            output.name: np.asarray(
                converted(np.asarray(table[column], dtype=float), unit or output.unit, output.unit)
                * (-1.0 if column in self.turned else 1.0)
            )
            for output in self.outputs
            for column, unit in (self.predictions[output.name],)
        }
