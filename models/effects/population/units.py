"""The base of effects on a population."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from ..effect import Action, Effect, EffectParameter, Measurements, Target, Values, value_or_zero
from ..shapes import Weight
from .law import Law


class OfUnits(Effect):
    """Acts on the units of a batch; it does not apply to a model of single measurements.

    `units` maps drawn units. Where it does not move each unit by its own amount, it acts on the
    distribution of the units: `law` may return that as a density.
    """

    apart_from_inputs: ClassVar[str] = ""
    """A cause other than the inputs of the batch; empty where inputs may have the same effect."""
    with_lots: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Parameters that apply where other effects move whole lots."""

    def own_applies(self, target: Target) -> bool:
        return target.population and super().own_applies(target)

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        return Action(population=partial(self.units, measurements, dict(values), target))

    def carried(self, values: Values, target: Target) -> float:
        """The shift of the mean of the units by an effect on their scatter."""
        return 0.0

    def law(self, law: Law, values: Values, target: Target) -> Law | None:
        """The law with the effect in it, about the mean without it; None: taken from `units`."""
        return None

    @abstractmethod
    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        """The units (n,) with the effect, from `drawn` units whose mean in the model is `mean`."""


class MovedUnits(OfUnits):
    """Moves every unit by a parameter times a pattern over the units."""

    weight: ClassVar[Weight]

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (self.weight.of(target.outputs[0], target),)

    @abstractmethod
    def pattern(self, measurements: Measurements) -> float | NDArray[Any]:
        """The factor of the parameter: a single value, or one per row (n,)."""

    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        return np.asarray(drawn + size_of(self.weight, values, target) * self.pattern(measurements))


def size_of(weight: Weight, values: Values, target: Target) -> float:
    """A linear parameter of the single output of a population, 0 where it is not given."""
    return value_or_zero(values, weight.of(target.outputs[0], target).name)
