"""Derivatives of outputs, and designs that a search by gradients begins from."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from .base import Interface


class Differentiable(Interface):
    """A problem whose model gives derivatives."""

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the outputs for which the model gives them."""
        return {}

    def cost_slopes(self, designs: Array) -> Array:
        """Derivatives of the cost (n, all variables) at full designs (n, all variables)."""
        problem = self._problem
        slopes = np.zeros_like(designs)
        for name, curve in problem.settings.costs.items():
            slopes[:, problem.names.index(name)] = curve.slope(problem.column(designs, name))
        return slopes

    def starts(self) -> Array:
        """Full designs (k, all variables) that a search by gradients does well to begin from."""
        return np.empty((0, len(self._problem.variables)))
