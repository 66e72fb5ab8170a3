"""The interface of a cost-tolerance curve."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class CostCurve(ABC):
    """Relative cost C(t) of holding a tolerance t > 0 (in the unit of its variable).

    Manufacturing cost falls as the tolerance widens: `slope` is negative or zero everywhere.
    """

    @abstractmethod
    def cost(self, t: Array) -> Array:
        """C(t), same shape as t."""

    @abstractmethod
    def slope(self, t: Array) -> Array:
        """dC/dt, same shape as t."""

    def faults(self) -> list[tuple[str, str]]:
        """(field, message) for every coefficient that makes the curve rise or meaningless."""
        return []


def not_negative(curve: object, names: tuple[str, ...]) -> list[tuple[str, str]]:
    """A fault for each coefficient in `names` that is below 0."""
    values = [(name, float(getattr(curve, name))) for name in names]
    return [(n, f"must not be negative (the cost would rise with the tolerance), got {v:g}")
            for n, v in values if v < 0]  # fmt: skip
