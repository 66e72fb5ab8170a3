"""The next measurement: points that separate explanations, or that would show an effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import chndtr, ndtr

from ...models.effects.population import Law
from ...models.measurable import Role
from ...section import Array
from .ending_records import MORE_UNITS_ADVICE, UNIMITATED, correlation_ratio
from .fit import Fit, Member
from .next_field import (
    Ahead,
    Axis,
    Chosen,
    Contest,
    Field,
    Points,
    Predictions,
    add_label_columns,
    base_at,
    continue_record,
    distance,
    exchange_design,
    field_of,
    order_of_measuring,
    place_at_rows,
    predict_record,
)
from .noise import Noise
from .plan import NextPlan
from .population import BatchLikelihood, Scatter, exchanged_names
from .records import Measurement, NextMeasurement, Sensitivity, Separation
from .result import Ending
from .scan import scan
from .selection import Other
from .separations import (
    CERTAIN,
    FEWEST,
    HOPELESS,
    MIN_REACHABLE_GAIN,
    NO_SEPARATING_DESIGN,
    SUPPORT,
    design,
    joint_discrimination,
    most,
    other_quantity,
    pair_of_rival,
    separation,
)
from .setup import Setup

MAX_UNLISTED_EFFECTS = 2
"""Number of effects that are planned for where none is listed."""
NINE_OF_TEN = 1.2816
"""Standard normal quantile of 0.9."""
MIN_DISCRIMINATION = 1e-12


@dataclass(frozen=True)
class Sought:
    """An effect of the size to be detected, alone in the model; its prediction at the record, and
    the columns of the model's free parameters that may imitate it.
    """

    fit: Fit
    size: Array
    record: tuple[Predictions, Predictions]

    @property
    def member(self) -> Member:
        """The effect with its nonlinear parameters."""
        return self.fit.members[0]


def wanted_effects(end: Ending, wanted: NextPlan) -> tuple[list[Sought], list[str]]:
    """The listed effects, or those nearest to the threshold; and why others are not planned for."""
    search = end.analysis.initial_null_model.search
    candidates = scan(search.fitter, search.white, search.dictionary, ())
    members = {candidate.member.name: candidate.member for candidate in candidates}
    names = wanted.effects or tuple(wanted.amounts) or tuple(members)
    sought, notes = [], []
    listed = bool(wanted.effects or wanted.amounts)
    for name in names:
        member = members.get(name)
        if member is None or member.candidate.is_nonlinear:
            why = "it does not apply to these data" if member is None else "its form changes with its size"
            notes.append(f"{name}: no points can be planned: {why}")
            continue
        effect = _sought_effect(end, member, wanted.amounts.get(name))
        if effect is None:
            notes.append(f"{name}: cannot be detected in these data, because free parameters imitate it")
        elif listed or not _is_detected(end, effect):
            sought.append(effect)
        if not listed and len(sought) == MAX_UNLISTED_EFFECTS:
            break
    return sought, notes if listed else []


def _is_detected(end: Ending, effect: Sought) -> bool:
    """Whether the record shows the effect: then its form is in question, not its presence."""
    detectable_norm = float(np.sqrt(end.analysis.initial_null_model.search.thresholds.library)) + NINE_OF_TEN
    return distance(*effect.record) > detectable_norm**2


def _sought_effect(end: Ending, member: Member, amount: float | None) -> Sought | None:
    """The effect of the fitted or the relevant size; where the fit has none, of a detectable one."""
    search = end.analysis.initial_null_model.search
    fit = search.fitter.fit([member])
    raw = search.fitter.columns.of(member.candidate, member.shape)
    size = fit.coefficients[0]
    if amount is not None:
        rms = float(np.sqrt(np.mean((raw @ size) ** 2)))
        size = size * (amount / rms) if rms > 0.0 else _unit(raw) * amount
    record = _record(end, fit, size)
    level = distance(*record)
    if level <= 1e-6:
        size = _unit(raw)
        record = _record(end, fit, size)
        level = distance(*record)
        if level <= UNIMITATED**2 * float(np.sum(record[0].values ** 2)) or level <= 0.0:
            return None
        if amount is None:
            size = size * (np.sqrt(search.thresholds.library) + NINE_OF_TEN) / np.sqrt(level)
            record = _record(end, fit, size)
    return Sought(fit, size, record)


def _unit(raw: Array) -> Array:
    """The first coefficient alone, such that its column (N, m) has an rms of 1."""
    size = np.zeros(raw.shape[1])
    size[0] = 1.0 / max(float(np.sqrt(np.mean(raw[:, 0] ** 2))), 1e-300)
    return size


def _record(end: Ending, fit: Fit, size: Array) -> tuple[Predictions, Predictions]:
    """The predictions of an effect of that size, and of none, at the record; with free columns."""
    null_model = end.analysis.initial_null_model
    values = null_model.search.fitter.white(fit.members[0]) @ size
    columns = predict_record(null_model.search.fitter, null_model.null_fit).columns
    return Predictions(values, columns), Predictions(np.zeros_like(values), columns)


def _at(sought: Sought, at: Points) -> tuple[Predictions, Predictions]:
    """The same at further measurements."""
    candidate, shape = sought.member.candidate, sought.member.shape
    values = at.columns.of(candidate, shape) @ sought.size
    prediction = at.white(Predictions(values, at.base))
    return prediction, Predictions(np.zeros_like(prediction.values), prediction.columns)


def contest(field: Field, sought: Sought) -> Contest:
    """The effect against none."""
    return Contest.of(sought.record, _at(sought, field), field.values_per_candidate)


def sensitivity(end: Ending, sought: Sought, new: Ahead, alike: Ahead) -> Sensitivity:
    """The detection of an effect by the planned measurements, and by as many like present ones."""
    limit = end.analysis.initial_null_model.search.thresholds.library
    levels = [distance(*sought.record)]
    levels += [joint_discrimination(*sought.record, *_at(sought, at)) for at in (new, alike)]
    size, candidate = sought.size, sought.member.candidate
    now, then, like = (
        1.0 - float(chndtr(limit, max(len(size), 1), max(level, MIN_DISCRIMINATION))) for level in levels
    )
    column = int(np.argmax(np.abs(size)))
    detectable_size = abs(float(size[column])) * (np.sqrt(limit) + NINE_OF_TEN)
    least = [detectable_size / float(np.sqrt(max(level, MIN_DISCRIMINATION))) for level in levels]
    parameter = candidate.linear[column]
    return Sensitivity(
        candidate.name, parameter.name, parameter.unit, float(size[column]), now, then, like, least[0], least[1]
    )


def decisive_inputs(field: Field, contest: Contest, chosen: Chosen) -> tuple[str, ...]:
    """The two inputs on which the difference of the explanations depends most: by the correlation
    ratio of it, or of its square, over all candidates.
    """
    _, coefficients, _ = contest.level(chosen)
    residual = contest.residual - contest.columns @ coefficients
    signed = residual.reshape(len(residual), -1, field.per_candidate).sum(axis=1).ravel()

    def strength(axis: Axis) -> float:
        values = field.data.values(axis.column.name)
        return max(correlation_ratio(values, signed), correlation_ratio(values, signed**2))

    moving = [axis for axis in field.axes if axis.span.high > axis.span.low and axis.column.role is not Role.TIME]
    return tuple(axis.column.name for axis in sorted(moving, key=strength, reverse=True)[:2])


MAX_FURTHER_UNITS = 10**6
QUANTILES = 1000
"""Number of quantiles that represent a law."""


def further_units(setup: Setup, noises: Sequence[Noise], wanted: NextPlan, spread: bool) -> Ahead:
    """Units like those of the batch; with `spread` at the ends of the configured ranges in turn."""
    count, table = wanted.readings, setup.data.measurements.table
    rows = np.random.default_rng([setup.plan.seed, 11]).integers(len(setup.data), size=count)
    columns: dict[str, NDArray[Any]] = {}
    for column in setup.data.target.columns:
        if column.text or column.role is Role.REPEAT:
            continue
        columns[column.name] = np.asarray(table[column.name])[rows]
        span = wanted.ranges.get(column.name)
        if spread and span is not None:
            columns[column.name] = np.resize(span.values or (span.low, span.high), count)
    whole = add_label_columns(setup.data, columns or {"": np.zeros(count)})
    return Ahead(setup, noises, whole, base_at(setup, place_at_rows(setup.data, whole)))


def of_scatter(end: Ending, best: Scatter, rival: Scatter, count: int) -> Separation:
    """The separation of two effects on the scatter by further units: the log likelihood ratio of a
    unit has a mean and a variance, which add up over units.
    """
    law = end.analysis.initial_null_model.batch.law
    laws = [effect.changed(law) for effect in (best, rival)]
    kinds = [effect.likelihood(law)[0] for effect in (best, rival)]
    moments = [_moments(right, wrong) for right, wrong in zip(laws, kinds[::-1], strict=True)]
    names, instead = exchanged_names(best, rival)
    ahead, n = rival.distance, len(end.setup.data)
    chance = _chance(moments, ahead, count)
    tried = np.unique(np.geomspace(FEWEST, MAX_FURTHER_UNITS, 400).astype(int)).tolist()
    short = [k for k in tried if _chance(moments, ahead, k) < CERTAIN]
    needed = next((k for k in tried if not short or k > short[-1]), 0)
    settings = end.analysis.search.settings
    alone = _chance(moments, ahead, count, settings.set_distance)
    now, then = (2.0 * moments[0][0] * k for k in (n, n + count))
    text = f"{MORE_UNITS_ADVICE}: {count} further units: probability {chance:.2f} that the right one fits better; "
    text += f"{needed} units for {CERTAIN}" if needed else f"no number reaches {CERTAIN}"
    return Separation(names, instead, now, then, chance, chance, alone, needed, text)


def _moments(right: Law, wrong: BatchLikelihood) -> tuple[float, float]:
    """Mean and variance of the log likelihood ratio of a unit of the right law to the wrong one."""
    fractions = (np.arange(QUANTILES) + 0.5) / QUANTILES
    x = np.asarray(right.histogram.ppf(fractions), dtype=np.float64)
    ratio = right(x) - wrong.changed(wrong.best(x))(x)
    return float(max(ratio.mean(), 0.0)), float(ratio.var())


def _chance(moments: Sequence[tuple[float, float]], ahead: float, count: int, by: float = 0.0) -> float:
    """The probability that the right one is ahead by more than `by` after `count` units; the prior
    probability of each follows from its fit.
    """
    prior = 1.0 / (1.0 + np.exp(-0.5 * ahead))
    chance = 0.0
    for weight, (mean, variance), start in zip((prior, 1.0 - prior), moments, (ahead, -ahead), strict=True):
        gained = start + 2.0 * count * mean - by
        chance += weight * ndtr(gained / np.sqrt(max(4.0 * count * variance, 1e-12)))
    return float(chance)


FILE = "next_measurement.csv"
NOTHING_TO_SEPARATE = "a single effect fits these data: nothing has to be separated"
NO_FORM = "the gap is detected already, and more measurements do not give it a form of the library"
ON_VALUE = "it depends on the measured value itself: no points can be planned for it"
PREDICT = "put the simulator's prediction at these points into the table before it is analysed"
LIKE = "points of the record's kind: the mounting and its zero are assumed to stay unchanged"
Key = tuple[tuple[str, ...], tuple[str, ...]]


@dataclass(frozen=True)
class Planned:
    """The record, its points, and the measurement listed with each rival, by the names of both."""

    record: NextMeasurement
    points: pd.DataFrame | None = None
    rivals: Mapping[Key, Measurement] = field(default_factory=dict)


def next_measurement(end: Ending) -> Planned | None:
    """The next measurement, if requested. Raises InputError where the ranges contain no point."""
    wanted = end.setup.plan.next_measurement
    if wanted is None:
        return None
    if end.verdict == "ambiguous" or (end.verdict == "partial" and end.analysis.rivals):
        return _separate_rivals(end, wanted)
    if end.verdict in ("no_gap", "unnamed"):
        return _of_effects(end, wanted)
    return Planned(NextMeasurement(NOTHING_TO_SEPARATE))


def _separate_rivals(end: Ending, wanted: NextPlan) -> Planned:
    """Points that separate the best explanation from each of its rivals."""
    plannable, measurements = [], dict[Key, Measurement]()
    for rival in end.analysis.rivals:
        if _acts_on_value(end, end.fit) or _acts_on_value(end, rival.fit):
            measurements[rival.names, rival.instead_of] = Measurement(ON_VALUE)
        else:
            plannable.append(rival)
    batch = end.setup.data.target.population
    records, new, inputs = (_separations_by_units if batch else _separations_by_points)(end, wanted, plannable)
    for record in records:
        measurements[record.names, record.instead_of] = _measurement(record, new, inputs)
    for scatter_rival in end.analysis.scatter[1:]:
        record = of_scatter(end, end.analysis.scatter[0], scatter_rival, wanted.readings)
        records.append(record)
        measurements[record.names, record.instead_of] = Measurement(record.text, readings=record.needed)
    planned = new is not None and any(record.possible for record in records)
    return _planned_record(end, new if planned else None, inputs, tuple(records), measurements=measurements)


def _separations_by_points(
    end: Ending, wanted: NextPlan, rivals: Sequence[Other]
) -> tuple[list[Separation], Ahead | None, tuple[str, ...]]:
    """Separations by chosen points; the points; the inputs that matter most."""
    if not rivals:
        return [], None, ()
    noises = end.analysis.search.fitter.space.noises
    place = field_of(end.setup, noises, wanted)
    pairs = [pair_of_rival(end, rival, place) for rival in rivals]
    count = _count(place, wanted)
    gains = [most(pair, count) for pair in pairs]
    separable = [pair for pair, gain in zip(pairs, gains, strict=True) if gain > HOPELESS * count]
    useful = [pair for pair, gain in zip(pairs, gains, strict=True) if gain > MIN_REACHABLE_GAIN] or separable
    chosen, better = design(end, place, useful or pairs[:1], count)
    pairs = [next((b for b in better if b.rival is p.rival), p) for p in pairs]
    new = order_of_measuring(place, chosen)
    alike = continue_record(end.setup, noises, len(new))
    records = [separation(end, pair, new, alike) for pair in pairs]
    records = [
        record if gain > HOPELESS * count else _inseparable_record(end, record, pair.rival)
        for record, pair, gain in zip(records, pairs, gains, strict=True)
    ]
    return records, new, decisive_inputs(place, (useful or pairs)[0].contests[0], chosen)


def _separations_by_units(
    end: Ending, wanted: NextPlan, rivals: Sequence[Other]
) -> tuple[list[Separation], Ahead | None, tuple[str, ...]]:
    """Separations by further units."""
    if not rivals:
        return [], None, ()
    noises = end.analysis.search.fitter.space.noises
    new, alike = (further_units(end.setup, noises, wanted, spread) for spread in (True, False))
    records = []
    for rival in rivals:
        record = separation(end, pair_of_rival(end, rival), new, alike)
        gained = record.expected - record.now
        records.append(record if gained > HOPELESS * len(new) else _inseparable_record(end, record, rival))
    return records, new, tuple(wanted.ranges)


def _inseparable_record(end: Ending, record: Separation, rival: Other) -> Separation:
    """The record of a pair that no design separates, with the quantity that would."""
    text = other_quantity(end.fit, rival.fit) or "another quantity has to be measured"
    return replace(record, needed=0, text=f"{NO_SEPARATING_DESIGN}: {text}", possible=False)


def _of_effects(end: Ending, wanted: NextPlan) -> Planned:
    """Points at which the effects nearest to the threshold, or the listed ones, are detected."""
    null_model = end.analysis.initial_null_model
    noises, setup = null_model.search.fitter.space.noises, null_model.setup
    sought, notes = wanted_effects(end, wanted)
    sought = [effect for effect in sought if not _acts_on_value(end, effect.fit)]
    if not sought:
        text = NO_FORM if end.verdict == "unnamed" else "no effect can be planned for"
        return Planned(NextMeasurement(text, notes=tuple(notes)))
    if setup.data.target.population:
        new, inputs = further_units(setup, noises, wanted, True), tuple(wanted.ranges)
        alike = further_units(setup, noises, wanted, False)
    else:
        place = field_of(setup, noises, wanted)
        count = _count(place, wanted)
        contests = [contest(place, effect) for effect in sought]
        chosen = np.resize(exchange_design(contests, min(count, SUPPORT)), count)
        new, inputs = order_of_measuring(place, chosen), decisive_inputs(place, contests[0], chosen)
        alike = continue_record(setup, noises, len(new))
    sensitivities = tuple(sensitivity(end, effect, new, alike) for effect in sought)
    return _planned_record(end, new, inputs, effects=sensitivities, notes=tuple(notes))


def _planned_record(
    end: Ending,
    new: Ahead | None,
    inputs: tuple[str, ...],
    pairs: tuple[Separation, ...] = (),
    effects: tuple[Sensitivity, ...] = (),
    notes: tuple[str, ...] = (),
    measurements: Mapping[Key, Measurement] = MappingProxyType({}),
) -> Planned:
    """The record with the planned points, or the reasons why there are none."""
    if new is None:
        text = "; ".join(dict.fromkeys(pair.text for pair in pairs)) or NO_SEPARATING_DESIGN
        return Planned(NextMeasurement(text, pairs=pairs, effects=effects, notes=notes), None, measurements)
    text = f"{len(new)} measurements at the points in {FILE}"
    if effects:
        text += f": {effects[0]}"
    notes = (*notes, LIKE, *((PREDICT,) if end.setup.plan.model is None else ()))
    record = NextMeasurement(text, len(new), pairs, effects, notes, inputs, FILE)
    return Planned(record, pd.DataFrame(dict(new.table)), measurements)


def _measurement(record: Separation, new: Ahead | None, inputs: Sequence[str]) -> Measurement:
    """The measurement listed with a rival."""
    if new is None or not record.possible:
        return Measurement(record.text)
    ends = {name: (float(np.min(new.table[name])), float(np.max(new.table[name]))) for name in inputs}
    rms = float(np.sqrt(max(record.expected - record.now, 0.0) / len(new)))
    return Measurement(f"{record.text} ({FILE})", ends, rms, record.needed)


def _acts_on_value(end: Ending, fit: Fit) -> bool:
    """Whether an effect in a fit acts on the measurement itself, as rounding does."""
    data = end.setup.data
    return any(
        bool(m.candidate.effect.act(data.measurements, m.candidate.values(m.shape, c), data.target).reading)
        for m, c in zip(fit.members, fit.coefficients, strict=True)
    )


def _count(place: Field, wanted: NextPlan) -> int:
    """The number of candidates that give as many measurements."""
    return max(1, wanted.readings // place.per_candidate)
