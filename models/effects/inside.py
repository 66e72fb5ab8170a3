"""Effects that act inside a model only."""

from __future__ import annotations

import numpy as np

from .effect import Action, Effect, EffectParameter, Measurements, Target, Values, value_or_zero

CHAINS = (1, 2, 3)
"""Numbers of the chains of a manipulator, each with an arm and its drive."""


class Inside(Effect):
    """Acts where a model has a quantity of its name, and nowhere else."""

    def own_applies(self, target: Target) -> bool:
        return False

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return ()

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        return Action()


class InsideSeveral(Inside):
    """Adds linear parameters to quantities of a model, each times a factor per row.

    Those quantities act on their own row of a table alone.
    """

    def own_applies(self, target: Target) -> bool:
        return target.changes(*(name for _, name in self.numbers(target))) and set(self.needs) <= target.roles()

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return tuple(number for number, _ in self.numbers(target))

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        factor = self.factor(measurements, values)
        numbers = self.numbers(target)
        return Action(changes={name: value_or_zero(values, number.name) * factor for number, name in numbers})

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        """The linear parameters, each with the quantity that it changes."""
        return ()

    def factor(self, measurements: Measurements, values: Values) -> np.ndarray:
        """The factor (n,) of the parameters."""
        return np.ones(len(measurements))
