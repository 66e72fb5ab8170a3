"""What effects on a population share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import partial

import numpy as np

from ...inputs.distribution import Array
from ..effect import Action, Effect, Readings, Target
from ..shapes import Weight


class OfUnits(Effect):
    """Acts on the units of a batch, and has no place in a model of single readings."""

    def own_applies(self, target: Target) -> bool:
        return target.population and super().own_applies(target)

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        return Action(population=partial(self.units, readings, dict(values), target))

    @abstractmethod
    def units(
        self,
        readings: Readings,
        values: Mapping[str, float],
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        """What becomes of drawn units (n,), whose mean in the model is `mean`."""


def number(weight: Weight, target: Target) -> str:
    """Name of a linear parameter of the one output that a population has."""
    return weight.of(target.outputs[0], target).name
