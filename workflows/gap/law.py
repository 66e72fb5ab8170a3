"""The law that the units of a batch scatter by: convolved, or estimated from units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...models.effects.effect import Effect, Measurements, Target
from ...models.effects.measurements import measurements_of, target_of
from ...models.effects.population.law import Law
from ...models.effects.population.units import OfUnits
from ...models.measurable import Column
from ...models.sources import Sources
from .plan import GapPlan
from .populations.unit_law import UnitLaw

DRAWN = 200_000
"""Units from which the density is estimated."""
CELLS = 512
SMOOTHED = 0.1
"""Width of the kernel that smooths the drawn units, as a fraction of their standard deviation."""
LEAST = 1e-12
MAPPED = 8192
"""Units to which an effect without a density formula is applied."""
DRAWS = 32
"""Draws that distinguish an effect on the scatter from fixed shifts of the units."""
STILL = 1e-9


def estimated(drawn: Array, mean: float = 0.0, middle: float = 0.0) -> Law:
    """The smoothed law of units (m,), as deviations from `middle`."""
    from statsmodels.nonparametric.kde import KDEUnivariate  # imports all distributions of scipy

    std = float(drawn.std())
    smooth = KDEUnivariate(drawn - middle)
    smooth.fit(bw=SMOOTHED * std, gridsize=CELLS, cut=0.5 / SMOOTHED)
    chance = np.maximum(smooth.density, LEAST / std)
    return Law(float(smooth.support[0]), float(np.ptp(smooth.support)) / (CELLS - 1), np.log(chance), std, mean)


def law_of(plan: GapPlan, name: str) -> Law:
    """The law of the model's units with the effects on their scatter that the model contains.

    The inputs are convolved where they add up; otherwise the law is estimated from units.
    """
    assert plan.model is not None
    mean, sources = float(plan.model.means()[name]), plan.model.sources()
    columns = [c for c in plan.model.columns if c.needed]
    table = _units(columns, MAPPED)
    target = target_of(plan.model, plan.model_name, table)
    measurements = measurements_of(target.columns, table)
    if sources and not sources.widened:
        law = _exact(sources, mean)
    else:
        rng = np.random.default_rng([plan.seed, 5])
        outputs = plan.model.law_sample() or plan.model.predict(_units(columns, DRAWN), rng)
        drawn = np.asarray(outputs[name], dtype=float)
        law = estimated(drawn, mean, float(drawn.mean()))
    for active in plan.active:
        if on_scatter(active.effect, active.values, measurements, target):
            law = law_with(law, active.effect, active.values, target)
    return replace(law, low=law.low - float(law.histogram.mean()))


def _exact(sources: Sources, mean: float) -> Law:
    units = UnitLaw(sources)
    density = units.density()
    likely = np.flatnonzero(density > LEAST / units.std)
    kept = slice(likely[0], likely[-1] + 1)
    x, chance = units.x[kept], density[kept]
    std = float(np.sqrt(np.average((x - np.average(x, weights=chance)) ** 2, weights=chance)))
    return Law(float(x[0]) - mean, units.step, np.log(np.maximum(chance, LEAST / std)), std, mean)


def law_with(law: Law, effect: Effect, values: Mapping[str, float], target: Target) -> Law:
    """The law with an effect on the scatter: by its density formula, or by applying it to units."""
    effect_law = effect.law(law, values, target) if isinstance(effect, OfUnits) else None
    return effect_law or _mapped(law, effect, values, target)


def _mapped(law: Law, effect: Effect, values: Mapping[str, float], target: Target) -> Law:
    rng = np.random.default_rng(0)
    units = law.histogram.ppf((rng.permutation(MAPPED) + 0.5) / MAPPED) + law.mean
    table = _units((c for c in target.columns if c.text), MAPPED)
    action = effect.act(measurements_of(target.columns, table), values, target)
    assert action.population is not None
    return estimated(np.asarray(action.population(units, law.mean, rng)), law.mean, law.mean)


def on_scatter(effect: Effect, values: Mapping[str, float], measurements: Measurements, target: Target) -> bool:
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
    return any(bool((np.abs(repeat - first) > STILL * size).any()) for repeat in repeats)


def _units(columns: Iterable[Column], count: int) -> dict[str, NDArray[Any]]:
    """A table of units that differ only in their labels."""
    labels = np.arange(count).astype(str)
    return {c.name: labels if c.text else np.zeros(count) for c in columns}
