"""Cost curves of a problem, at designs and over its search space."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .settings import Settings

Array = NDArray[np.float64]


class Priced:
    """The sum of the cost curves of the settings, each of one variable."""

    settings: Settings

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """Names of all variables, in the order of a full design."""

    @abstractmethod
    def column(self, designs: Array, name: str) -> Array:
        """One variable (n,) of full designs (n, all variables)."""

    @abstractmethod
    def _corner(self, tight: bool) -> Array:
        """The tightest or loosest full design (all variables,)."""

    @cached_property
    def cost_interval(self) -> tuple[float, float]:
        """Least and largest cost of the search space: costs fall with every tolerance."""
        ends = np.stack([self._corner(tight=False), self._corner(tight=True)])
        low, high = self.cost_of(ends)
        return float(low), float(high)

    def cost_of(self, designs: Array) -> Array:
        """Sum of the cost curves (n,) at full designs."""
        return np.asarray(np.sum(list(self.costs_of(designs).values()), axis=0))

    def cost_slopes(self, designs: Array) -> Array:
        """Derivatives of the cost (n, all variables) at full designs."""
        slopes = np.zeros_like(designs)
        for name, curve in self.settings.costs.items():
            slopes[:, self.names.index(name)] = curve.slope(self.column(designs, name))
        return slopes

    def costs_of(self, designs: Array) -> dict[str, Array]:
        """What each cost curve (n,) gives at full designs."""
        with np.errstate(divide="ignore"):
            return {n: c.cost(self.column(designs, n)) for n, c in self.settings.costs.items()}
