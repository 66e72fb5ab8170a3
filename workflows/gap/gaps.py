"""The size of the gap before and after, and its floor where the model is right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .distance import distance, floor
from .population import held_out_units
from .result import Ending, ended, rmse

OF_ROWS = "RMSE on held-out rows; the floor is the noise"
OF_UNITS = (
    "distance of the held-out units from the population that the model predicts; it is the 2-Wasserstein "
    "distance, after the effects on single units are subtracted, and the floor is what all but 5 % of "
    "batches of this size stay below, drawn from the corrected model"
)
"""What comes before the semicolon says it in short."""


@dataclass(frozen=True)
class Gaps:
    """Gaps by output, in its unit, and `total` in noise units; `meaning` says what they are."""

    before: Mapping[str, float]
    after: Mapping[str, float]
    floor: Mapping[str, float]
    meaning: str


def gaps(end: Ending) -> Gaps:
    """The gaps of one analysis, without outliers."""
    initial, setup = end.analysis.initial_null_model, end.setup
    before = initial.setup.residual - end.before.fitted
    after = setup.residual - end.after.fitted
    if setup.data.target.population:
        return _of_units(end, before, after)
    levels = {o.name: noise.level for o, noise in zip(setup.data.outputs, initial.noises, strict=True)}
    first, last = (_with_total(end, _by_output(end, raw)) for raw in (before, after))
    return Gaps(first, last, levels | {"total": 1.0}, OF_ROWS)


def never_worse(end: Ending) -> Ending:
    """The same result, or one without effects if these bring a batch no nearer to the population.
    The selection on rows ensures this already.
    """
    if end.rows or not (end.identified or end.analysis.scatter):
        return end
    sizes = gaps(end)
    if all(sizes.after[name] <= sizes.before[name] for name in sizes.before):
        return end
    return ended(end.analysis.without_effects())


def _by_output(end: Ending, raw: Array) -> dict[str, float]:
    outputs, noises = end.setup.data.outputs, end.analysis.initial_null_model.noises
    parts = zip(outputs, np.split(raw, len(outputs)), noises, strict=True)
    return {output.name: rmse(part, noise.good) for output, part, noise in parts}


def _with_total(end: Ending, by_output: dict[str, float]) -> dict[str, float]:
    """Gaps by output with the total: their root mean square, each in units of its noise."""
    levels = [noise.level for noise in end.analysis.initial_null_model.noises]
    scaled = np.array(list(by_output.values())) / np.array(levels)
    return by_output | {"total": float(np.sqrt(np.mean(scaled**2)))}


def _of_units(end: Ending, before: Array, after: Array) -> Gaps:
    """The gaps of a population. Effects on the scatter act on its first output, where outliers then
    count as well.
    """
    first, last, least = dict[str, float](), dict[str, float](), dict[str, float]()
    initial, outputs = end.analysis.initial_null_model, end.setup.data.outputs
    parts = (np.split(x, len(outputs)) for x in (before, after))
    for at, (output, x, y) in enumerate(zip(outputs, *parts, strict=True)):
        kept = initial.noises[at].counted
        law = whole = initial.setup.laws[output.name]
        wider = end.analysis.scatter[:1] if at == 0 else ()
        for effect in wider:
            y = y + effect.moves
            y[kept] = held_out_units(initial.batch.units(end.fit), effect, y[kept])
            whole = effect.changed(law)
        if not wider:
            x, y = x[kept], y[kept]
        rng = np.random.default_rng([end.setup.plan.seed, 8, at])
        first[output.name] = distance(law, x)
        last[output.name] = distance(whole, y)
        least[output.name] = floor(whole, len(y), rng)
    return Gaps(_with_total(end, first), _with_total(end, last), _with_total(end, least), OF_UNITS)
