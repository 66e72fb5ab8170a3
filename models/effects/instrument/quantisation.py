"""Measurements in steps."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from ....arrays import Array
from ..effect import Action, Effect, EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .lattice import step_of


class Quantisation(Effect):
    """Measurements are multiples of the instrument's resolution."""

    name = "quantisation"
    family = "instrument"
    cause = "The instrument resolves whole steps only."
    formula = "y becomes q round(y/q)"
    mistaken_for = ()
    reference = "Widrow and Kollar, Quantization Noise, 2008"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "q, the step; 0 is no quantisation"
        return tuple(
            quantity(f"{target.prefix(output)}step", output.unit, meaning, linear=False) for output in target.outputs
        )

    def shown(self, measured: Mapping[str, Array], target: Target) -> dict[str, float] | None:
        numbers = zip(target.outputs, self.own_parameters(target), strict=True)
        steps = {number.name: step_of(measured[output.name]) for output, number in numbers}
        if not any(steps.values()):
            return None
        return {name: step or 0.0 for name, step in steps.items()}

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        numbers = zip(target.outputs, self.own_parameters(target), strict=True)
        steps = {output.name: value_or_zero(values, number.name) for output, number in numbers}
        return Action(reading={name: partial(rounded, step=q) for name, q in steps.items() if q > 0.0})


def rounded(values: Array, step: float) -> Array:
    """Values (n,) in whole steps."""
    return np.asarray(step * np.round(values / step))
