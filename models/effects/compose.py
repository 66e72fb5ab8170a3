"""Effects in a model: its predictions with them, composed in a fixed order.

1. Changes inside of the model, summed over the effects; 2. the model's prediction; 3. the
population, effect after effect; 4. the sum of what is added to the outputs; 5. the
measurement, effect after effect. Within 3 and 5 effects act in the order in which they are listed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ..measurable import NO_CHANGES, MeasurableModel
from .effect import Action, Effect, Measurements, Target, Values
from .measurements import Table, measurements_of, target_of


@dataclass(frozen=True, slots=True)
class Active:
    """An active effect of the model, with the values of its parameters by name."""

    effect: Effect
    values: Values


def predicted(
    model: MeasurableModel,
    name: str,
    table: Table,
    effects: Iterable[Active],
    rng: np.random.Generator,
    zero: Mapping[str, float] = NO_CHANGES,
) -> dict[str, Array]:
    """Every output (n,) of the model `name` at the rows of a table, with the effects in it.

    `zero` is added to the model's predictions, by output.
    """
    active = tuple(effects)
    if not active:
        return with_zero(model.predict(table, rng), zero)
    target = target_of(model, name, table)
    actions = acting(active, measurements_of(target.columns, table), target)
    changes = changes_of(actions) or NO_CHANGES
    outputs = with_zero(model.predict(table, rng, changes), zero)
    means = model.means(changes) if any(action.population for action in actions) else {}
    return added(outputs, actions, means, rng)


def with_zero(outputs: Mapping[str, Array], zero: Mapping[str, float]) -> dict[str, Array]:
    """Outputs (n,) with the zero of the instrument added to each of them."""
    return {name: values + zero[name] if name in zero else values for name, values in outputs.items()}


def acting(effects: Sequence[Active], measurements: Measurements, target: Target) -> list[Action]:
    """The action of each effect on the rows."""
    return [effect.effect.act(measurements, effect.values, target) for effect in effects]


def changes_of(actions: Iterable[Action]) -> dict[str, Array]:
    """Changes inside of the model, summed over the effects."""
    changes: dict[str, Array] = {}
    for action in actions:
        for name, change in action.changes.items():
            changes[name] = changes[name] + change if name in changes else change
    return changes


def added(
    outputs: Mapping[str, Array], actions: Sequence[Action], means: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Array]:
    """Predicted outputs (n,) with the effects that act on them; `means` are of a population."""
    total = dict(outputs)
    for action in actions:
        if action.population is not None:
            for name in total:
                total[name] = action.population(total[name], means[name], rng)
    for action in actions:
        for name, more in action.output.items():
            total[name] = total[name] + more
    for action in actions:
        for name, measured in action.reading.items():
            total[name] = measured(total[name])
    return total
