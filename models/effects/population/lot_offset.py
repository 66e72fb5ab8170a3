"""Single lots deviate by a step."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ....units import unit_key
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values
from ..measurements import labels_of
from ..shapes import Weight
from .units import OfUnits, size_of


class LotOffset(OfUnits):
    """Single lots deviate by a step."""

    name = "lot_offset"
    family = "population"
    cause = "A lot was made, or set up, apart from the others."
    formula = "y + c_l in lot l"
    needs = (Role.LOT,)
    mistaken_for = ("lot_mixture", "process_mean_shift", "gauge_bias")
    reference = "Searle, Casella and McCulloch, Variance Components, 1992"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        """An offset for each lot of the table except the first, in the order of their labels."""
        lots = target.labels.get(Role.LOT, ())[1:]
        return tuple(_offset(lot).of(target.outputs[0], target) for lot in lots)

    def parameter(self, name: str, target: Target) -> EffectParameter | None:
        """The offset of any lot: only the table shows which lots exist."""
        output = target.outputs[0]
        prefix, _, lot = name.removesuffix(f"_{unit_key(output.unit)}").partition("offset_")
        return _offset(lot).of(output, target) if lot and not prefix else None

    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        lots, of_lot = labels_of(measurements[Role.LOT])
        offsets = [size_of(_offset(str(lot)), values, target) for lot in lots]
        return np.asarray(drawn + np.array(offsets)[of_lot])


def _offset(lot: str) -> Weight:
    return Weight(f"offset_{lot}", f"c, deviation of lot {lot}", low=-inf)
