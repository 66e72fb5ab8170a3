"""Effects that act inside a model only."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .effect import Action, Effect, EffectParameter, Readings, Target, value_or_zero


class Inside(Effect):
    """Acts where a model has a quantity of its name, and nowhere else."""

    def own_applies(self, target: Target) -> bool:
        return False

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return ()

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        return Action()


class InsideSeveral(Inside):
    """Adds linear parameters to quantities of a model, each times a factor per row.

    Those quantities act on their own row of a table alone.
    """

    def own_applies(self, target: Target) -> bool:
        quantities = (name for _, name in self.numbers(target))
        return target.changes(*quantities) and set(self.needs) <= target.roles()

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return tuple(number for number, _ in self.numbers(target))

    def own_action(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        factor = self.factor(readings, values)
        sizes = {name: value_or_zero(values, number.name) for number, name in self.numbers(target)}
        return Action(changes={name: size * factor for name, size in sizes.items()})

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        """Each linear parameter, and the quantity that it changes."""
        return ()

    def factor(self, readings: Readings, values: Mapping[str, float]) -> np.ndarray:
        """The factor (n,) of the parameters."""
        return np.ones(len(readings))
