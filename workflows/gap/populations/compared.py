"""Units compared with the model's, before and after correction: a batch with the population, or
units that are simulated one by one with the values at the same inputs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....arrays import Array
from ....gap_population_records import PopulationLine
from ....models.effects.measurements import labels_of, unit_numbers
from ....models.measurable import Role
from ..predictor import predictor
from ..result import Ending
from ..setup import LEAST_NAMED, residual_of
from .lines import Compared, batches
from .statistics import Look, Statistic, along, between_lots, looks_of, two_of, unlike, values_of

EXACT = 1e-9
"""Fraction of the simulated scatter below which measurements are the simulation itself."""
PLAIN = ("mean", "two suppliers", "first to last unit")
SHAPES = ("standard deviation", "skewness", "kurtosis")
"""Statistics of the differences themselves, and those of the units with the differences added."""
NONE = "no difference detected: measured is as simulated"


def compared(end: Ending) -> tuple[PopulationLine, ...]:
    """Lines before, and after correction where an effect was identified; empty where rows are no
    units.

    A population has lines of its one output. Before correction the model of single units is
    uncorrected: not even the zero of an angle is subtracted.
    """
    if not (population := end.setup.data.target.population) and not has_units(end):
        return ()
    models = ("before", "after") if end.fit.members or end.analysis.scatter else ("before",)
    if population:
        return tuple(line for k, model in enumerate(models) for line in _of_batch(end, model, k))
    plain = predictor(end.setup.plan, end.setup.data)({})
    residuals = np.split(residual_of(end.setup, end.fit), len(end.setup.data.outputs))
    lines: tuple[PopulationLine, ...] = ()
    for stream, model in enumerate(models):
        for at, output in enumerate(end.setup.data.outputs):
            corrected = end.setup.data.measured[output.name] - residuals[at]
            simulated = plain[output.name] if model == "before" else corrected
            lines += _of_pairs(end, at, model, stream, simulated)
    return lines


def _of_batch(end: Ending, model: str, stream: int) -> tuple[PopulationLine, ...]:
    """The lines of the deviations of units from the model's prediction."""
    initial = end.analysis.initial_null_model
    setup, fit = (end.setup, end.fit) if model == "after" else (initial.setup, initial.null_fit)
    output, kept = setup.data.outputs[0], initial.noises[0].counted
    law, middle = initial.setup.laws[output.name], 0.0
    for effect in end.analysis.scatter[:1] if model == "after" else ():
        law, middle = effect.changed(law), effect.moves
    x = residual_of(setup, fit)[kept] + middle
    measurements = setup.data.measurements
    order = unit_numbers(measurements)[kept].astype(float)
    lots = between_lots(labels_of(measurements[Role.LOT])[1][kept]) if Role.LOT in measurements else None
    quantiles = law.histogram.ppf((np.arange(len(x)) + 0.5) / len(x))
    looks = looks_of(output.unit, order, two_of(law), unlike(quantiles), lots)
    rng = np.random.default_rng([setup.plan.seed, 14, stream])
    drawn = law.histogram.rvs(size=(batches(len(x)), len(x)), random_state=rng)
    shown = setup.data.measured[output.name][kept] - x
    mean, trend = float(shown.mean()), float(along(order)(shown[None])[0])
    offset = {"mean": mean, "median": mean, "first to last unit": trend}
    whole = Compared(looks, x, drawn, setup.plan.settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, offset, rng)


def _of_pairs(end: Ending, at: int, model: str, stream: int, simulated: Array) -> tuple[PopulationLine, ...]:
    setup = end.setup
    output, kept = setup.data.outputs[at], end.analysis.initial_null_model.noises[at].counted
    s, measured = simulated[kept], setup.data.measured[output.name][kept]
    r = measured - s
    order = unit_numbers(setup.data.measurements)[kept].astype(float)
    scale = max(float(np.std(s)), float(np.std(measured)), 1e-300)
    looks = _looks(output.unit, s, order)
    if float(np.std(r)) <= EXACT * scale and abs(float(r.mean())) <= EXACT * scale:
        shown = _shown(s, order)
        return tuple(_unchanged_line(look, model, output.name, shown.get(look.name, 0.0)) for look in looks)
    rng, count = np.random.default_rng([setup.plan.seed, 15, stream, at]), batches(len(r))
    drawn = rng.permuted(np.tile(r, (count, 1)), axis=1) * rng.choice([-1.0, 1.0], (count, len(r)))
    # one supplier is drawn as such: permuted measurements would keep a second one
    normal = float(np.std(r)) * rng.standard_normal((count, len(r)))
    looks = tuple(_drawn(look, normal) if look.name == "two suppliers" else look for look in looks)
    whole = Compared(looks, r, drawn, setup.plan.settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, _shown(s, order), rng)


def _looks(unit: str, s: Array, order: Array) -> tuple[Look, ...]:
    """Statistics of differences (b, n) from simulated s (n,): those of s + x minus those of s."""

    def beyond(of: Statistic) -> Statistic:
        return lambda x: of(s + x) - float(of(s[None])[0])

    moved = SHAPES if float(np.std(s)) > 0.0 else ()
    return tuple(
        replace(look, of=beyond(look.of)) if look.name in moved else look
        for look in looks_of(unit, order, two_of())
        if look.name in (*PLAIN, *moved)
    )


def _shown(s: Array, order: Array) -> dict[str, float]:
    """The statistics of simulated values s (n,) that differences are added to."""
    return {
        name: float(value[0])
        for name, value in values_of(looks_of("", order), s[None]).items()
        if name in (*PLAIN, *SHAPES)
    }


def _drawn(look: Look, normal: Array) -> Look:
    """The same statistic with normal simulated batches."""
    return replace(look, of=lambda x: look.of(x if len(x) == 1 else normal))


def _unchanged_line(look: Look, model: str, output: str, value: float) -> PopulationLine:
    difference = low = high = chance = would_show = 0.0
    return PopulationLine(
        model, output, look.aspect, look.name, look.unit, value, value, difference, low, high, chance, would_show, NONE
    )


def has_units(end: Ending) -> bool:
    """Whether rows are units that are simulated one by one."""
    data = end.setup.data
    named = any(c.role is Role.UNIT for c in data.target.columns)
    return named and not data.target.population and end.setup.plan.model is not None
