"""Some units come from a second supplier."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import ClassVar

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from ..measurements import labels_of, unit_numbers
from ..shapes import Weight
from .law import Law
from .units import OfUnits, size_of

WITHIN = EffectParameter(
    "within_lots",
    "",
    "1: units of a lot come from both suppliers; 0: whole lots from either",
    0.0,
    1.0,
    linear=False,
    choices=(0.0, 1.0),
)


class LotMixture(OfUnits):
    """Some units come from a second supplier.

    Where lots are known, whole lots come from it; the optional `within_lots = 1` mixes each lot.
    """

    name = "lot_mixture"
    family = "population"
    cause = "Parts come from two suppliers, and those of the second deviate by a step."
    formula = "y + c of a fraction p of the units (of the lots, where they are known, unless `within_lots` is 1)"
    mistaken_for = ("lot_offset", "spread_inflation", "process_mean_shift")
    reference = "McLachlan and Peel, Finite Mixture Models, 2000"
    apart_from_inputs = "two suppliers"
    with_lots: ClassVar[Mapping[str, float]] = {WITHIN.name: 1.0}
    weight = Weight("offset", "c, deviation of the second supplier", low=-inf)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "p, fraction of the second supplier"
        fraction = quantity("share", "", meaning, 0.02, 0.98, linear=False)
        return (self.weight.of(target.outputs[0], target), fraction)

    def parameter(self, name: str, target: Target) -> EffectParameter | None:
        """Its parameters, including the optional one."""
        return WITHIN if name == WITHIN.name else super().parameter(name, target)

    def carried(self, values: Values, target: Target) -> float:
        """The fraction of the second supplier times its offset."""
        return values["share"] * size_of(self.weight, values, target)

    def law(self, law: Law, values: Values, target: Target) -> Law:
        return law.mixed(size_of(self.weight, values, target), values["share"])

    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        of_group = unit_numbers(measurements)
        if Role.LOT in measurements and not value_or_zero(values, WITHIN.name):
            of_group = labels_of(measurements[Role.LOT])[1]
        second = rng.random(int(of_group.max(initial=-1)) + 1) < values["share"]
        return drawn + size_of(self.weight, values, target) * second[of_group]
