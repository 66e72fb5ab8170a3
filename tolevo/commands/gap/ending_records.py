"""Records of an ending: effects with their parameters, rivals, and residuals of all rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...models.effects import EffectParameter
from ...section import Array
from .blocks import improvement
from .close import corrected
from .data import GapData
from .noise import outliers, whiteness
from .population import Scatter, exchanged_names
from .records import Detectable, FoundEffect, FoundParameter, Gate, Measurement, OutputGate, Recalibrated, Rival, Score
from .result import Ending, rmse
from .scan import scan
from .selection import correlation
from .separations import separating
from .setup import nominal
from .uncertainty import Spread

UNIMITATED = 0.01
"""Fraction of a column outside the span of the free ones, below which an effect is undetectable."""
SEPARATED = 4
"""Number of rivals for which a separating measurement is searched."""
MORE_UNITS_ADVICE = "measure more units of one lot: a mixture has two peaks or a shoulder, a wider spread has one peak"


def gate(end: Ending) -> Gate:
    """The test of the null model as a record."""
    analysis, null_model = end.analysis, end.analysis.initial_null_model
    setup, limit = null_model.setup, analysis.search.thresholds.generic
    output_gates = []
    for at, (output, noise) in enumerate(zip(setup.data.outputs, null_model.noises, strict=True)):
        level = null_model.residual_forms.evidence[null_model.generic.outputs == at].max(initial=0.0)
        rows = setup.data.rows_of(at)
        output_gates.append(
            OutputGate(
                output=output.name,
                unit=output.unit,
                noise=noise.level,
                noise_source=noise.source,
                rmse=rmse(setup.residual[rows] - end.before.fitted[rows], noise.good),
                statistic=float(level),
                threshold=limit,
                significant=bool(level > limit) or (analysis.significant and len(null_model.noises) == 1),
                autocorrelation=noise.rho,
                heteroscedastic=noise.varies_with,
                outliers=noise.outliers,
                whiteness=whiteness(end.fit.residual[rows]),
                uncertainty=noise.level * 2.0 / np.sqrt(len(setup.data)),
            )
        )
    return Gate(tuple(output_gates), recalibrated(end), *detectable_sizes(end))


def recalibrated(end: Ending) -> tuple[Recalibrated, ...]:
    """The free parameters before and after recalibration."""
    plan, records = end.setup.plan, []
    for name, value in end.model.free().items():
        before, tolerance = nominal(plan, name), plan.free[name]
        records.append(Recalibrated(name, "", before, value, tolerance, abs(value - before) > 0.98 * tolerance))
    return tuple(records)


def detectable_sizes(end: Ending) -> tuple[tuple[Detectable, ...], tuple[str, ...]]:
    """The smallest size at which each effect is detected with probability 0.9, and the names of the
    effects that are undetectable because the free columns span them.
    """
    search, setup = end.analysis.initial_null_model.search, end.setup
    wanted = np.sqrt(search.thresholds.library) + 1.2816
    white, raw = search.white.columns, search.dictionary.raw.columns
    total = np.einsum("ij,ij->j", white, white)
    squares = total - np.sum((search.fitter.q.T @ white) ** 2, axis=0)
    squares[squares < UNIMITATED**2 * total] = 0.0
    size, of_raw = np.sqrt(squares), np.sqrt(np.einsum("ij,ij->j", raw, raw) / len(raw))
    smallest: dict[str, Detectable] = {}
    pairs = zip(search.white.starts, search.dictionary.members, strict=True)
    linear = [(start, member) for start, member in pairs if member.candidate.linear]
    for start, member in linear:
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
    names = dict.fromkeys(member.name for _, member in linear)
    return tuple(smallest.values()), tuple(name for name in names if name not in smallest)


def scores(end: Ending) -> tuple[Score, ...]:
    """The gain of each candidate alone given the model's free parameters as records, best first."""
    search = end.analysis.initial_null_model.search
    candidates = scan(search.fitter, search.white, search.dictionary, ())
    pairs = [(candidate.member, candidate.gain) for candidate in candidates]
    limit = search.thresholds.library
    return tuple(Score(m.name, m.candidate.effect.family, gain, limit, dict(m.shape)) for m, gain in pairs)


def effects(end: Ending, spread: Spread | None) -> tuple[FoundEffect, ...]:
    """The identified effects, with intervals and evidence."""
    moving = [_effect(end, at, spread) for at in end.identified]
    return (*moving, *(_scatter_record(scatter_effect) for scatter_effect in end.analysis.scatter[:1]))


def _scatter_record(scatter_effect: Scatter) -> FoundEffect:
    """An effect on the scatter of a batch; its held-out gain is twice a log likelihood ratio."""
    effect = scatter_effect.candidate.effect
    return FoundEffect(
        name=effect.name,
        family=effect.family,
        cause=effect.cause,
        parameters=tuple(
            FoundParameter(p.name, scatter_effect.numbers[p.name], *scatter_effect.intervals[p.name], p.unit, p.meaning)
            for p in scatter_effect.candidate.parameters
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
    values, several = end.model.effect(member.name), len(member.candidate.linear) > 1
    total, gain = max(end.analysis.null_model.null_fit.rss - end.fit.rss, 1e-300), reduced.rss - end.fit.rss
    return FoundEffect(
        name=member.name,
        family=member.candidate.effect.family,
        cause=member.candidate.effect.cause,
        parameters=tuple(
            FoundParameter(p.name, values[p.name], *_ends(end, member.name, p, values, spread), p.unit, _meaning(p))
            for p in member.candidate.parameters
        ),
        gain=gain,
        threshold=search.thresholds.library,
        held_out_gain=better.gain,
        held_out_error=better.error,
        share=min(1.0, gain / total),
        frequency=float("nan") if spread is None else spread.frequency(member.name),
        at_bound=tuple(
            p.name
            for p in member.candidate.parameters
            if not p.choices and _is_at_bound(values[p.name], p.low, p.high, several)
        ),
    )


def _is_at_bound(value: float, low: float, high: float, several: bool) -> bool:
    """Whether a parameter is at a physical bound; 0 is one below if the effect has several sizes."""
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
    """The rivals as records; `planned` are measurements by the names of a rival and the replaced."""
    levels = end.analysis.search.fitter.space.level()
    rivals: list[Rival] = []
    for at, rival in enumerate(end.analysis.rivals):
        measurement = planned.get((rival.names, rival.instead_of))
        if measurement is None:
            measurement = separating(end.setup, levels, end.fit, rival.fit) if at < SEPARATED else rivals[0].measurement
        distance, alike = round(rival.distance, 9) + 0.0, correlation(end.analysis.search.fitter, end.fit, rival)
        rivals.append(Rival(rival.names, rival.instead_of, distance, measurement, alike))
    for other, name, text in end.on_scatter_instead:
        rivals.append(Rival((other,), (name,), 0.0, Measurement(text)))
    for scatter_rival in end.analysis.scatter[1:]:
        names, instead = exchanged_names(end.analysis.scatter[0], scatter_rival)
        measurement = planned.get((names, instead), Measurement(MORE_UNITS_ADVICE))
        rivals.append(Rival(names, instead, scatter_rival.distance, measurement))
    return tuple(rivals)


def residual_table(end: Ending, full: GapData) -> pd.DataFrame:
    """Every measurement with its predictions before and after correction, in measuring order."""
    setup = end.setup
    inputs = {c.name: full.measurements.table[c.name] for c in full.target.columns}
    frame = pd.DataFrame({"row": full.rows, **inputs})
    used = np.flatnonzero(np.isin(full.rows, setup.data.rows))
    start = end.analysis.initial_null_model
    null_model = corrected(start.setup, start.search.fitter.space, start.null_fit)
    before, after = null_model.predicted(full), end.model.predicted(full)
    for at, (output, noise) in enumerate(zip(setup.data.outputs, start.noises, strict=True)):
        name, measured = output.name, full.measured[output.name]
        frame[name] = measured
        frame[f"{name}_predicted"] = before[name]
        frame[f"{name}_corrected"] = after[name]
        frame[f"{name}_before"] = measured - before[name]
        frame[f"{name}_after"] = measured - after[name]
        for which, of, held in (("before", start.setup, end.before), ("after", setup, end.after)):
            part = (of.residual - held.fitted)[setup.data.rows_of(at)]
            frame[f"{name}_{which}_held_out"] = _spread_to_rows(part, used, len(full))
        frame[f"{name}_noise"] = _spread_to_rows(noise.sigma, used, len(full))
        frame[f"{name}_outlier"] = ~outliers(measured - after[name], np.full(len(full), noise.level))
    frame["block"] = _spread_to_rows(end.analysis.search.labels[: len(setup.data)].astype(float), used, len(full))
    return frame


def _spread_to_rows(values: Array, rows: NDArray[np.int64], count: int) -> Array:
    column = np.full(count, np.nan)
    column[rows] = values
    return column
