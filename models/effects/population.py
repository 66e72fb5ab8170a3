"""Effects on the population of units: how lots, processes and tools change it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...section import Array
from ...units import unit_key
from ..measurable import Role
from .effect import Action, Effect, EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .measurements import labels_of, unit_numbers
from .shapes import Weight


@dataclass(frozen=True)
class Law:
    """Log density of deviations from the model's `mean`, on a lattice of `low` + k `step`."""

    low: float
    step: float
    log: Array
    std: float
    mean: float = 0.0

    def __call__(self, x: Array) -> Array:
        """Log density at deviations x; beyond the lattice it falls as a normal's."""
        lattice = self.low + self.step * np.arange(len(self.log))
        beyond = np.maximum(lattice[0] - x, x - lattice[-1]).clip(0.0) / self.std
        return np.asarray(np.interp(x, lattice, self.log) - 0.5 * beyond**2 - 3.0 * beyond)

    @cached_property
    def histogram(self) -> Any:
        """The same as a distribution of scipy: probabilities, quantiles, draws."""
        edges = self.low + self.step * (np.arange(len(self.log) + 1) - 0.5)
        return scipy.stats.rv_histogram((np.exp(self.log), edges), density=True)

    def standardised(self, z: Array, about: float = 0.0) -> Array:
        """Log density at deviations z from `about`, in standard deviations."""
        return np.asarray(self(about + self.std * z) + np.log(self.std))

    def widened(self, growth: float) -> Law:
        """The law with every deviation multiplied by 1 + growth."""
        by = 1.0 + growth
        return replace(self, low=by * self.low, step=by * self.step, log=self.log - np.log(by), std=by * self.std)

    def mixed(self, offset: float, fraction: float) -> Law:
        """A `fraction` of the units off by `offset`: the mean moves by fraction times offset."""
        low, more = self.low + min(offset, 0.0), int(np.ceil(abs(offset) / self.step))
        x = np.asarray(low + self.step * np.arange(len(self.log) + more), dtype=np.float64)
        std = float(np.sqrt(self.std**2 + fraction * (1.0 - fraction) * offset**2))
        first, second = np.log1p(-fraction) + self(x), np.log(fraction) + self(x - offset)
        return replace(self, low=low, log=np.asarray(np.logaddexp(first, second)), std=std)


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


class LotOffset(OfUnits):
    """Single lots deviate by a step."""

    name = "lot_offset"
    family = "population"
    cause = "A lot was made, or set up, apart from the others."
    formula = "y + c_l in lot l"
    needs = (Role.LOT,)
    mistaken_for = ("lot_mixture", "process_mean_shift", "gauge_bias")
    separated_by: ClassVar[Mapping[str, str]] = {
        "lot_mixture": "note the supplier of each lot: a second supplier has the same offset in all of its lots"
    }
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


class ProcessMeanShift(MovedUnits):
    """All units deviate by the same amount."""

    name = "process_mean_shift"
    family = "population"
    cause = "The process mean is off its target: every unit deviates by the same amount."
    formula = "y + c"
    mistaken_for = ("gauge_bias", "lot_mixture", "differential_thermal_expansion")
    separated_by: ClassVar[Mapping[str, str]] = {
        "gauge_bias": "measure a reference unit, or some units on a second gauge: a bias stays, a shift does not"
    }
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    weight = Weight("shift", "c, shift of the mean", low=-inf)

    def pattern(self, measurements: Measurements) -> float:
        return 1.0


class SpreadInflation(OfUnits):
    """Units scatter more than the allocation assumes."""

    name = "spread_inflation"
    family = "population"
    cause = "The process scatters more than its capability implies."
    formula = "y + g (y - mean)"
    mistaken_for = ("lot_mixture", "tool_wear_drift")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (quantity("growth", "", "g, relative growth of the standard deviation"),)

    def law(self, law: Law, values: Values, target: Target) -> Law:
        return law.widened(value_or_zero(values, "growth"))

    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        return drawn + value_or_zero(values, "growth") * (drawn - mean)


class ToolWearDrift(MovedUnits):
    """Units drift as the tool wears."""

    name = "tool_wear_drift"
    family = "population"
    cause = "The tool wears, and each unit deviates a little more than the unit before it."
    formula = "y + a u, u the number of the unit from 0"
    needs = (Role.UNIT,)
    mistaken_for = ("drift", "spread_inflation", "lot_offset")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    along_units = True
    weight = Weight("rate_per_unit", "a, change from one unit to the next", low=-inf)

    def pattern(self, measurements: Measurements) -> NDArray[Any]:
        return unit_numbers(measurements)


DRAWS = 32
"""Draws that distinguish an effect on the scatter from fixed shifts of the units."""
STILL_LAW = 1e-9


def acts_on_scatter(effect: Effect, values: Mapping[str, float], measurements: Measurements, target: Target) -> bool:
    """Whether an effect on a population does more than shift each unit by a fixed amount."""
    act = effect.act(measurements, values, target).population if target.population else None
    if act is None:
        return False

    def moves(seed: int) -> Array:
        rng = np.random.default_rng(seed)
        drawn = rng.normal(size=len(measurements))
        return np.asarray(act(drawn, 0.0, rng) - drawn)

    first, *repeats = map(moves, range(DRAWS))
    size = max(float(np.abs(first).max(initial=0.0)), 1.0)
    return any(bool((np.abs(repeat - first) > STILL_LAW * size).any()) for repeat in repeats)
