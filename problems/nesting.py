"""What a problem that contains other problems provides for a run; by default nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]


class Nesting:
    """Parts that take long to compute, and requirements that stand for outputs."""

    def kept(self) -> dict[str, Array]:
        """Arrays by name that took long to compute and depend on the configuration alone."""
        return {}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take what another process has `kept`; whether it belongs to this configuration."""
        return False

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement of the form that stands for a limit on an output."""
        return high

    def alternatives(self) -> dict[str, ToleranceProblem]:
        """The machine with another choice, by a label of it: its least cost is reported."""
        return {}

    def sketch(self) -> dict[str, Any]:
        """A drawing of the machine: `parts`, each a `name`, `points` [mm] of a line, and the
        columns of a front that are its shares; `poses` [mm]. Empty where there is none.
        """
        return {}
