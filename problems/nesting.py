"""What a problem with others inside it gives a run; by default nothing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Nesting:
    """Parts that take long to work out, and requirements that stand for outputs."""

    def kept(self) -> dict[str, Array]:
        """What took long to work out and depends on the configuration alone, by name."""
        return {}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take what another process has `kept`; whether it belongs to this configuration."""
        return False

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement of the form that stands for a limit on an output."""
        return high
