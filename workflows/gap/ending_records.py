"""Records of an ending: effects with their parameters, rivals, and residuals of all rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...gap_records import (
    Detectable,
    FoundEffect,
    FoundParameter,
    Gate,
    Measurement,
    OutputGate,
    Recalibrated,
    Rival,
    Score,
)
from ...models.effects import EffectParameter
from ...models.inputs.distribution import Array
from .ambiguity import correlation
from .blocks import improvement
from .close import corrected
from .data import GapData
from .noise import outliers, whiteness
from .population import Scatter
from .result import Ending, rmse
from .scan import scan
from .separate import separating
from .setup import nominal
from .uncertainty import Spread

OWN = 0.01
"""Fraction of a column outside the span of the free columns, below which the effect is
undetectable.
"""
SEPARATED = 4
"""Number of rivals for which a separating measurement is searched."""
SUPPLIERS = "note the supplier of each lot: a second supplier has the same offset in all of its lots"
MORE = "measure more units of one lot: a mixture has two peaks or a shoulder, a wider spread has one peak"


def gate(end: Ending) -> Gate:
    """The test of the null model (stage 1) as a record."""
    analysis, null_model = end.analysis, end.analysis.initial_null_model
    setup, count = null_model.setup, len(null_model.setup.data)
    output_gates = []
    for at, (output, noise) in enumerate(zip(setup.data.outputs, null_model.noises, strict=True)):
        level = null_model.residual_forms.evidence[null_model.generic.outputs == at].max(initial=0.0)
        rows = slice(at * count, (at + 1) * count)
        raw = setup.residual[rows] - end.before.fitted[rows]
        limit = analysis.search.thresholds.generic
        output_gates.append(
            OutputGate(
                output=output.name,
                unit=output.unit,
                noise=noise.level,
                noise_source=noise.source,
                rmse=rmse(raw, noise.good),
                statistic=float(level),
                threshold=limit,
                significant=bool(level > limit) or (analysis.significant and len(null_model.noises) == 1),
                autocorrelation=noise.rho,
                heteroscedastic=noise.varies_with,
                outliers=noise.outliers,
                whiteness=whiteness(end.fit.residual[rows]),
                uncertainty=noise.level * 2.0 / np.sqrt(count),
            )
        )
    return Gate(tuple(output_gates), recalibrated(end), *detectable(end))


def recalibrated(end: Ending) -> tuple[Recalibrated, ...]:
    """The free parameters before and after recalibration."""
    plan = end.setup.plan
    return tuple(
        Recalibrated(
            name,
            "",
            nominal(plan, name),
            value,
            plan.free[name],
            abs(value - nominal(plan, name)) > 0.98 * plan.free[name],
        )
        for name, value in end.model.free().items()
    )


def detectable(end: Ending) -> tuple[tuple[Detectable, ...], tuple[str, ...]]:
    """The smallest size at which each effect is detected with probability 0.9, and the names of the
    effects that are undetectable because the free columns span them.
    """
    search, setup = end.analysis.initial_null_model.search, end.setup
    wanted = np.sqrt(search.thresholds.library) + 1.2816
    white, raw = search.white.columns, search.book.raw.columns
    total = np.einsum("ij,ij->j", white, white)
    squares = total - np.sum((search.fitter.q.T @ white) ** 2, axis=0)
    squares[squares < OWN**2 * total] = 0.0
    size, of_raw = np.sqrt(squares), np.sqrt(np.einsum("ij,ij->j", raw, raw) / len(raw))
    smallest: dict[str, Detectable] = {}
    names: dict[str, None] = {}
    for start, member in zip(search.white.starts, search.book.members, strict=True):
        if member.candidate.is_nonlinear:
            continue
        names.setdefault(member.name)
        member_sizes = size[start : start + len(member.candidate.linear)]
        column = int(np.argmax(member_sizes))
        if member_sizes[column] <= 0.0:
            continue
        value = float(wanted / member_sizes[column])
        rms = value * float(of_raw[start + column])
        if member.name not in smallest or rms < smallest[member.name].rms:
            parameter = member.candidate.linear[column]
            family, unit = member.candidate.effect.family, setup.data.outputs[0].unit
            smallest[member.name] = Detectable(member.name, family, rms, unit, parameter.name, value)
    return tuple(smallest.values()), tuple(name for name in names if name not in smallest)


def scores(end: Ending) -> tuple[Score, ...]:
    """The candidates (stage 3) as records: the gain of each effect alone given the model's free
    parameters, best first.
    """
    search = end.analysis.initial_null_model.search
    return tuple(
        Score(
            candidate.member.name,
            candidate.member.candidate.effect.family,
            candidate.gain,
            search.thresholds.library,
            dict(candidate.member.shape),
        )
        for candidate in scan(search.fitter, search.white, search.book, ())
    )


def effects(end: Ending, spread: Spread | None) -> tuple[FoundEffect, ...]:
    """The identified effects, with intervals and evidence."""
    moving = [_effect(end, at, spread) for at in end.identified]
    return (*moving, *(_of_scatter(scatter_effect) for scatter_effect in end.analysis.scatter[:1]))


def _of_scatter(scatter_effect: Scatter) -> FoundEffect:
    """An effect on the scatter of a batch as a record; its held-out gain is twice a log likelihood
    ratio.
    """
    effect = scatter_effect.candidate.effect
    numbers = (*scatter_effect.candidate.linear, *scatter_effect.candidate.shape)
    return FoundEffect(
        name=effect.name,
        family=effect.family,
        cause=effect.cause,
        parameters=tuple(
            FoundParameter(p.name, scatter_effect.numbers[p.name], *scatter_effect.intervals[p.name], p.unit, p.meaning)
            for p in numbers
        ),
        gain=scatter_effect.gain,
        threshold=scatter_effect.threshold,
        held_out_gain=scatter_effect.held_out.gain,
        held_out_error=scatter_effect.held_out.error,
    )


def _effect(end: Ending, at: int, spread: Spread | None) -> FoundEffect:
    search, member = end.analysis.search, end.fit.members[at]
    reduced = search.fitter.fit(end.fit.without(at))
    better = improvement(search.tested(reduced), end.after, search.labels)
    values = end.model.effect(member.name)
    several = len(member.candidate.linear) > 1
    numbers = (*member.candidate.linear, *member.candidate.shape)
    intervals = {parameter.name: _ends(end, member.name, parameter, values, spread) for parameter in numbers}
    total = max(end.analysis.null_model.empty.rss - end.fit.rss, 1e-300)
    return FoundEffect(
        name=member.name,
        family=member.candidate.effect.family,
        cause=member.candidate.effect.cause,
        parameters=tuple(
            FoundParameter(
                parameter.name, values[parameter.name], *intervals[parameter.name], parameter.unit, _meaning(parameter)
            )
            for parameter in numbers
        ),
        gain=reduced.rss - end.fit.rss,
        threshold=search.thresholds.library,
        held_out_gain=better.gain,
        held_out_error=better.error,
        share=min(1.0, (reduced.rss - end.fit.rss) / total),
        frequency=float("nan") if spread is None else spread.frequency(member.name),
        at_bound=tuple(
            parameter.name
            for parameter in numbers
            if not parameter.choices and _at_bound(values[parameter.name], parameter.low, parameter.high, several)
        ),
    )


def _at_bound(value: float, low: float, high: float, several: bool = False) -> bool:
    """Whether a parameter lies at a physical bound; a lower bound of 0 counts if the effect has
    several sizes.
    """
    width, stops = abs(value) * 1e-6, np.isfinite(low) and (low != 0.0 or several)
    return bool((np.isfinite(high) and value >= high - width) or (stops and value <= low + width))


def _meaning(parameter: EffectParameter) -> str:
    """The meaning of a parameter, with its choices where it was chosen instead of fitted."""
    choices = ", ".join(f"{choice:g}" for choice in parameter.choices)
    return f"{parameter.meaning} (chosen out of {choices}, not fitted)" if choices else parameter.meaning


def _ends(
    end: Ending, owner: str, parameter: EffectParameter, values: Mapping[str, float], spread: Spread | None
) -> tuple[float, float]:
    """The interval of a parameter, of width 0 where it was chosen."""
    if parameter.choices:
        return values[parameter.name], values[parameter.name]
    linear = end.model.interval(owner, parameter.name)
    return linear if spread is None else spread.interval(owner, parameter.name, linear)


def rival_records(
    end: Ending, planned: Mapping[tuple[tuple[str, ...], tuple[str, ...]], Measurement]
) -> tuple[Rival, ...]:
    """The rivals (stage 5) as records; `planned` holds measurements by the names of a rival and
    those it replaces.
    """
    levels = end.analysis.search.fitter.space.level()
    rivals: list[Rival] = []
    for at, rival in enumerate(end.analysis.rivals):
        measurement = planned.get((rival.names, rival.instead_of))
        if measurement is None:
            measurement = separating(end.setup, levels, end.fit, rival.fit) if at < SEPARATED else rivals[0].measurement
        distance = round(rival.distance, 9) + 0.0
        rivals.append(
            Rival(
                rival.names,
                rival.instead_of,
                distance,
                measurement,
                correlation(end.analysis.search.fitter, end.fit, rival),
            )
        )
    if end.twin:
        rivals.append(Rival(("lot_mixture",), ("lot_offset",), 0.0, Measurement(SUPPLIERS)))
    for scatter_rival in end.analysis.scatter[1:]:
        best_names = end.analysis.scatter[0].names
        common = set(best_names) & set(scatter_rival.names)
        names, instead = (tuple(n for n in of if n not in common) for of in (scatter_rival.names, best_names))
        measurement = planned.get((names, instead), Measurement(MORE))
        rivals.append(Rival(names, instead, scatter_rival.distance, measurement))
    return tuple(rivals)


def residual_table(end: Ending, full: GapData) -> pd.DataFrame:
    """Every measurement with its prediction before and after correction, in the order of
    measuring.
    """
    setup, n = end.setup, len(end.setup.data)
    inputs = {c.name: full.readings.table[c.name] for c in full.target.columns}
    frame = pd.DataFrame({"row": full.rows, **inputs})
    used = np.flatnonzero(np.isin(full.rows, setup.data.rows))
    start = end.analysis.initial_null_model
    null_model = corrected(start.setup, start.search.fitter.space, start.empty)
    before, after = null_model.predicted(full), end.model.predicted(full)
    for at, (output, noise) in enumerate(zip(setup.data.outputs, start.noises, strict=True)):
        name, measured = output.name, full.measured[output.name]
        frame[name] = measured
        frame[f"{name}_predicted"] = before[name]
        frame[f"{name}_corrected"] = after[name]
        frame[f"{name}_before"] = measured - before[name]
        frame[f"{name}_after"] = measured - after[name]
        for which, of, held in (("before", start.setup, end.before), ("after", setup, end.after)):
            part = (of.residual - held.fitted)[at * n : (at + 1) * n]
            frame[f"{name}_{which}_held_out"] = _at_rows(part, used, len(full))
        frame[f"{name}_noise"] = _at_rows(noise.sigma, used, len(full))
        good = outliers(measured - after[name], np.full(len(full), noise.level))
        frame[f"{name}_outlier"] = ~good
    labels = end.analysis.search.labels[:n].astype(float)
    frame["block"] = _at_rows(labels, used, len(full))
    return frame


def _at_rows(values: Array, rows: NDArray[np.int64], count: int) -> Array:
    column = np.full(count, np.nan)
    column[rows] = values
    return column
