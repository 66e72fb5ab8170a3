"""Positions of a serial arm, as measured by a laser tracker."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Output, Value
from ...section import Section
from ...units import MM
from ..inputs.distribution import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel
from . import declared
from .chain import positions
from .table import TABLES, read_chain


class SerialArm(MeasurableModel):
    """Positions of a point on the last link of a chain of revolute joints.

    Written as a Denavit-Hartenberg table (`[[joint]]` with `d_mm`, `a_mm`, `alpha_deg`,
    `offset_deg`), `[base]` and `[tool]`; the UR5 by default. Five errors a joint, and those of base
    and tool, may be recalibrated.
    """

    columns = tuple(
        Column(f"joint_{joint}_deg", "deg", f"commanded angle of joint {joint}")
        for joint in range(1, declared.MOST + 1)
    )
    outputs = tuple(Output(f"{axis}_mm", "mm", f"measured position, {axis}") for axis in "xyz")
    parameters = declared.PARAMETERS
    free: ClassVar[Mapping[str, float]] = declared.free_of({})
    tables = TABLES

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        self.chain = declared.chain_of(parameters or {})
        self.columns = type(self).columns[: len(self.chain.d)]  # type: ignore[misc]

    @classmethod
    def written(cls, top: Section) -> dict[str, Value]:
        return read_chain(top)

    @classmethod
    def free_of(cls, parameters: Mapping[str, Value]) -> Mapping[str, float]:
        return declared.free_of(parameters)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        angles = np.column_stack([np.radians(table[column.name]) for column in self.columns])
        position = positions(self.chain, angles) / MM
        return {output.name: position[:, at] for at, output in enumerate(self.outputs)}
