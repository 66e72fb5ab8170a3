"""What effects on a population share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...inputs.distribution import Array
from ..effect import Action, Effect, EffectParameter, Readings, Target, known
from ..shapes import Weight
from .law import Law


class OfUnits(Effect):
    """Acts on the units of a batch, and has no place in a model of single readings.

    `units` is the map of drawn units. Where it moves no single unit by an amount of its own, the
    law of the units shows it: `law` may give that as a density.
    """

    apart_from_inputs: ClassVar[str] = ""
    """What may explain a batch instead of its inputs; empty where inputs may do the same."""
    beside_lots: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Parameters that hold where whole lots are moved by effects of their own."""

    def own_applies(self, target: Target) -> bool:
        return target.population and super().own_applies(target)

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        return Action(population=partial(self.units, readings, dict(values), target))

    def carried(self, values: Mapping[str, float], target: Target) -> float:
        """By how much an effect on the scatter moves the mean of the units."""
        return 0.0

    def law(self, law: Law, values: Mapping[str, float], target: Target) -> Law | None:
        """The law with the effect in it, about the mean without it; None: taken from `units`."""
        return None

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


class MovedUnits(OfUnits):
    """Moves every unit by one number times a pattern over the units."""

    weight: ClassVar[Weight]

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (self.weight.of(target.outputs[0], target),)

    @abstractmethod
    def pattern(self, readings: Readings) -> float | NDArray[Any]:
        """What the number is multiplied with: one value, or one per row (n,)."""

    def units(
        self,
        readings: Readings,
        values: Mapping[str, float],
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        size = known(values, number(self.weight, target))
        return np.asarray(drawn + size * self.pattern(readings))


def number(weight: Weight, target: Target) -> str:
    """Name of a linear parameter of the one output that a population has."""
    return weight.of(target.outputs[0], target).name
