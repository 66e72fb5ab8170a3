"""Records of an ending: effects, rivals, residuals of all rows, the size of the gap, and what remains of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...models.effects import EffectParameter
from ...models.effects.memory import Memory
from ...models.effects.unresolved import CURVED, Offer
from ...section import Array
from .analysis import Analysis, variables_of
from .blocks import improvement
from .close import corrected
from .data import GapData
from .fit import FORGOTTEN, Member, is_term
from .generic import effect_of, table_of
from .linear import TIE, project_out, ranking, rms
from .noise import outliers, whiteness
from .population import Scatter, distance, exchanged_names, floor, held_out_units
from .records import (
    Detectable,
    FoundEffect,
    FoundParameter,
    Gate,
    Measurement,
    OutputGate,
    Recalibrated,
    Remainder,
    Rival,
    Score,
    UnresolvedTerm,
)
from .result import Ending, finish_analysis
from .scan import scan
from .selection import correlation
from .separations import separating
from .setup import nominal, residual_of
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
    output_gates, level_of = [], floors(end)
    for at, (output, noise) in enumerate(zip(setup.data.outputs, null_model.noises, strict=True)):
        level = null_model.residual_forms.evidence[null_model.generic.outputs == at].max(initial=0.0)
        rows = setup.data.rows_of(at)
        output_gates.append(
            OutputGate(
                output=output.name,
                unit=output.unit,
                noise=level_of[at][0],
                noise_source=level_of[at][1],
                rmse=rms((setup.residual[rows] - end.before.fitted[rows])[noise.counted]),
                statistic=float(level),
                threshold=limit,
                significant=analysis.significant and (bool(level > limit) or len(null_model.noises) == 1),
                autocorrelation=noise.rho,
                heteroscedastic=noise.varies_with,
                outliers=noise.outliers,
                whiteness=whiteness(end.fit.residual[rows]),
                uncertainty=level_of[at][0] * 2.0 / np.sqrt(len(setup.data)),
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
        column = int(ranking(member_sizes)[0])
        if member_sizes[column] <= 0.0:
            continue
        value = float(wanted / member_sizes[column])
        rms = value * float(of_raw[start + column])
        if member.name not in smallest or rms < (1.0 - TIE) * smallest[member.name].rms:
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
    """The identified effects, with intervals and evidence, of rows those first that explain most."""
    moving = [_effect(end, at, spread) for at in end.identified]
    if end.rows:
        moving = _explained(end, moving)
    return (*moving, *(_scatter_record(scatter_effect) for scatter_effect in end.analysis.scatter[:1]))


def _explained(end: Ending, found: Sequence[FoundEffect]) -> list[FoundEffect]:
    """The effects with what they explain before any generic term, by least squares with equal weights;
    each remainder counts as an error of the form of the first one that acts in its variables.
    """
    fit_of = end.analysis.search.plain_fit
    records, remainders, known = {effect.name: effect for effect in found}, list(remainder_of(end)), list[FoundEffect]()
    members, chosen = {member.name: member for member in end.fit.effects}, list[Member]()
    whole = rss = fit_of(()).rss
    while len(chosen) < len(members):
        fits = [fit_of([*chosen, member]) for name, member in members.items() if member not in chosen]
        best = min(fits, key=lambda fit: fit.rss)
        chosen, percent, rss = list(best.members), 100.0 * max(rss - best.rss, 0.0) / max(whole, 1e-300), best.rss
        inputs, turns = variables_of(chosen[-1], end.setup.data)
        own = [r for r in remainders if inputs & {*r.variables} or (turns and not inputs and r.turns)]
        remainders = [r for r in remainders if r not in own]
        error = float(np.sqrt(sum(r.rms**2 for r in own)))
        form, unit = (max(own, key=lambda r: r.rms).shape, own[0].unit) if own else ("", "")
        if isinstance(chosen[-1].candidate.effect, Memory) and "a memory of " in form:
            form += "; the memory of this record only resembles it"
        effect = records[chosen[-1].name]
        known.append(replace(effect, explains_percent=percent, form_error=error, form_unit=unit, form=form))
    return known


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
    shortest = (FORGOTTEN if isinstance(member.candidate.effect, Memory) else 1.0, 1.0)
    total, gain = max(end.analysis.null_model.null_fit.rss - end.fit.rss, 1e-300), reduced.rss - end.fit.rss
    return FoundEffect(
        name=member.name,
        family=member.candidate.effect.family,
        cause=member.candidate.effect.cause,
        parameters=tuple(
            FoundParameter(p.name, values[p.name], *_ends(end, member.name, p, values, spread), p.unit, p.words)
            for p in member.candidate.parameters
        ),
        gain=gain,
        threshold=search.thresholds.library,
        held_out_gain=better.gain,
        held_out_error=better.error,
        share=min(1.0, gain / total),
        frequency=float("nan") if spread is None else spread.frequency(member.name),
        at_bound=tuple(
            p.name for p in member.candidate.parameters if p.stops(values[p.name], shortest[p.linear], several)
        ),
    )


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
        frame[f"{name}_remainder"] = measured - after[name] + unnamed_part(end, full, at)
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
        return _population_gaps(end, before, after)
    levels = {o.name: level for o, (level, _) in zip(setup.data.outputs, floors(end), strict=True)}
    first, last = (_add_total(end, _by_output(end, raw)) for raw in (before, after))
    return Gaps(first, last, levels | {"total": 1.0}, OF_ROWS)


NEIGHBOURS = 0.02
"""Fraction of an input's range within which rows that follow each other are neighbours."""
LEAST_NEIGHBOURS = 100
"""Neighbours of both sides from which they show the noise."""


def floors(end: Ending) -> list[tuple[float, str]]:
    """The noise floor of each output and its source: stated, from repeats, or else the smallest that
    the record supports, of generic forms, of the residual, and of neighbouring rows.
    """
    initial, setup, sources = end.analysis.initial_null_model, end.setup, list[tuple[float, str]]()
    near = _between_neighbours(setup.data) if end.rows else np.zeros(0, dtype=np.int64)
    left = np.split(residual_of(setup, end.fit), len(setup.data.outputs)) if end.rows else []
    numbers = len(end.fit.free) + sum(member.candidate.count for member in end.fit.members)
    for at, noise in enumerate(initial.noises):
        smallest = [(noise.level, noise.source)]
        if end.rows and noise.source == "estimated":
            good, counted = noise.counted, int(noise.counted.sum())
            squares = float(np.sum(left[at][good] ** 2)) / max(counted - numbers / len(initial.noises), 1.0)
            smallest.append((float(np.sqrt(squares)), "residual"))
            if len(near) >= LEAST_NEIGHBOURS:
                bends = left[at][near - 1] - 2.0 * left[at][near] + left[at][near + 1]
                smallest.append((float(np.sqrt(np.mean(bends**2) / 6.0)), "neighbouring rows"))
        sources.append(min(smallest, key=itemgetter(0)))
    return sources


def _between_neighbours(data: GapData) -> NDArray[np.int64]:
    """The rows between two neighbours in the order of measuring, close to both in every input."""
    close, steps = np.ones(len(data) - 1, dtype=bool), np.ones(len(data) - 1, dtype=bool)
    for column in data.inputs:
        x = np.asarray(data.values(column.name), dtype=float)
        close &= np.abs(np.diff(x)) <= NEIGHBOURS * np.ptp(x)
        steps &= np.abs(np.diff(x)) == 0.0
    close &= ~steps
    return np.flatnonzero(close[1:] & close[:-1]) + 1


def elsewhere(end: Ending) -> tuple[dict[str, float], dict[str, Any]]:
    """The error of rows held out by the coarsest split of the record, by output as `gap_after`, and that
    split: by what, of how many parts, and the errors of parts inside and at the ends of an input's range.
    """
    split = end.analysis.search.split
    if split is None:
        return {}, {}
    # the terms of the search: the form of a curve is that of all rows, its values those of the others
    tested = end.analysis.search.elsewhere.tested(end.analysis.fit)
    raw = end.setup.residual - tested.held_at_ends
    inside = ~np.isin(split.labels, split.ends) if split.ends else np.ones(len(split.labels), dtype=bool)
    parts = {"interpolation": inside, "extrapolation": ~inside} if split.ends else {}
    errors = {name: _by_output(end, raw, rows) for name, rows in parts.items() if rows.any()}
    return _add_total(end, _by_output(end, raw)), {"by": split.by, "parts": len(np.unique(split.labels)), **errors}


def never_worse(end: Ending) -> Ending:
    """The same result, or one without effects if these bring a batch no nearer to the population.
    The selection on rows ensures this already.
    """
    if end.rows or not (end.identified or end.analysis.scatter):
        return end
    sizes = gaps(end)
    if all(sizes.after[name] <= sizes.before[name] for name in sizes.before):
        return end
    return finish_analysis(end.analysis.without_effects())


def _by_output(end: Ending, raw: Array, rows: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """The RMSE of residuals (N,) by output, without outliers, at some `rows` (n,) or all."""
    outputs, noises = end.setup.data.outputs, end.analysis.initial_null_model.noises
    parts = zip(outputs, np.split(raw, len(outputs)), noises, strict=True)
    kept = True if rows is None else rows
    return {o.name: rms(part[noise.counted & kept]) for o, part, noise in parts}


def _add_total(end: Ending, by_output: dict[str, float]) -> dict[str, float]:
    """Gaps by output with the total: their root mean square, each in units of its noise."""
    levels = [noise.level for noise in end.analysis.initial_null_model.noises]
    scaled = np.array(list(by_output.values())) / np.array(levels)
    return by_output | {"total": float(np.sqrt(np.mean(scaled**2)))}


def _population_gaps(end: Ending, before: Array, after: Array) -> Gaps:
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
    return Gaps(_add_total(end, first), _add_total(end, last), _add_total(end, least), OF_UNITS)


CELLS = 12
"""Number of stretches of an input over which means are taken."""
MAX_REMAINDERS = 3
"""Number of forms listed in addition to the terms."""


def removed_effects(analysis: Analysis) -> tuple[str, ...]:
    """Effects that were accepted and are not in the answer: their form is not that of the data."""
    return (*(analysis.fit.names[at] for at in analysis.identified.withdrawn), *analysis.removed)


def terms_of(end: Ending) -> tuple[UnresolvedTerm, ...]:
    """The generic terms that are in the corrected model."""
    terms = []
    for at, member in enumerate(end.fit.members):
        if is_term(member):
            term, table = effect_of(member).term, table_of(member, end.model.effect(member.name))
            gain = end.analysis.search.fitter.fit(end.fit.without(at)).rss - end.fit.rss
            terms.append(UnresolvedTerm(term.output, term.variables, term.words, gain, table))
    return tuple(terms)


def remainder_of(end: Ending) -> tuple[Remainder, ...]:
    """The remainder given the identified effects: the generic terms, and other significant forms."""
    if not end.remains:
        return ()
    if not end.rows:
        return _scatter_remainder(end)
    together: dict[tuple[str, frozenset[str]], list[Member]] = {}
    for member in end.fit.terms:
        term = effect_of(member).term
        together.setdefault((term.output, frozenset(term.variables)), []).append(member)
    remainders = (*(_term_remainders(end, members) for members in together.values()), *_form_remainders(end))
    pairs = zip(end.setup.data.outputs, floors(end), strict=True)
    floor_of = {output.name: max(level, 1e-300) for output, (level, _) in pairs}
    return tuple(replace(r, ratio=r.rms / floor_of[r.output], against=_telling_inputs(end, r)) for r in remainders)


def _telling_inputs(end: Ending, part: Remainder) -> tuple[str, ...]:
    """Two inputs: those of a remainder, else those over which means explain most of what the effects leave."""
    data = end.setup.data
    at = [output.name for output in data.outputs].index(part.output)
    rest = (end.setup.residual - end.after.fitted)[data.rows_of(at)] + unnamed_part(end, data, at)
    ratio = {column.name: correlation_ratio(data.values(column.name), rest) for column in data.inputs}
    return tuple(sorted(ratio, key=lambda name: (name not in part.variables, -ratio[name])))[:2]


def correlation_ratio(values: Array, of: Array) -> float:
    """Fraction of the variance of `of` (n,) explained by its means over stretches of values (n,)."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, CELLS + 1)))
    cell = np.searchsorted(edges[1:-1], values, side="right")
    count = np.bincount(cell)
    means = np.bincount(cell, of) / np.maximum(count, 1)
    total = float(np.var(of))
    between = float(count @ (means - of.mean()) ** 2) / len(of)
    return between / total if total > 0.0 else 0.0


def unnamed_part(end: Ending, data: GapData, output: int) -> Array:
    """What the terms without a name add (n,) to an output at rows of a table."""
    total, name = np.zeros(len(data)), end.setup.data.outputs[output].name
    for member in end.fit.terms:
        if effect_of(member).term.output == name:
            total = total + effect_of(member).term.columns(data.measurements) @ _weights(end, member)
    return total


def _weights(end: Ending, member: Member) -> Array:
    """The coefficients of a term."""
    return effect_of(member).coefficients(end.model.effect(member.name))


def _scatter_remainder(end: Ending) -> tuple[Remainder, ...]:
    """Units with a scatter that no effect explains; the floor is what chance reaches."""
    misfit, output = end.analysis.misfit, end.setup.data.outputs[0]
    if misfit is None:
        return ()
    whole = gaps(end).before[output.name]
    text = f"{misfit.ratio:.2f} times the standard deviation of the population"
    text = f"a shape that differs from the population's, {text}" if misfit.stretched else text
    fraction = min(1.0, (misfit.distance / max(whole, 1e-300)) ** 2)
    far, ratio = misfit.distance, misfit.distance / misfit.limit
    return (Remainder(output.name, ("scatter of the units",), text, far, output.unit, ratio, fraction),)


def _excess_over_noise(end: Ending) -> float:
    """The squared gap in excess of the noise, in noise units."""
    return max(end.analysis.null_model.null_fit.rss - end.analysis.search.fitter.space.count, 1e-300)


def _term_remainders(end: Ending, members: Sequence[Member]) -> Remainder:
    """Terms of the same variables as one: each may be many times larger than their sum."""
    terms, setup = [effect_of(member).term for member in members], end.setup
    first = terms[0]
    at = [o.name for o in setup.data.outputs].index(first.output)
    fitter = end.analysis.search.fitter
    added, white = np.zeros(len(setup.data)), np.zeros(len(fitter.y))
    for member in members:
        coefficients = end.fit.coefficients[end.fit.members.index(member)]
        whole = setup.columns.of(member.candidate, member.shape) @ coefficients
        added = added + whole[setup.data.rows_of(at)]
        white = white + fitter.white(member) @ coefficients
    rms, unit, level = float(np.std(added)), setup.data.outputs[at].unit, end.analysis.null_model.noises[at].level
    white = project_out(white, fitter.q)  # without the part that the zeros and free parameters span
    fraction = min(1.0, float(white @ white) / _excess_over_noise(end))
    turns = any(term.turns for term in terms)
    words = dict.fromkeys(term.words for term in terms)
    if len(words) > 1 and all(t.shape in CURVED and (t.turns, t.times) == (turns, "") for t in terms):
        words = {f"a curve over {first.variable}" + (", opposite in the two directions" if turns else ""): None}
    resembled = [str(end.resembled[member.name]) for member in members]
    text = ", ".join([", and ".join(words), *filter(None, resembled)])
    offer = Offer(terms, [_weights(end, member) for member in members], setup.data.target.columns, text)
    texts = offer.formula(), offer.plugin()
    return Remainder(first.output, first.variables, text, rms, unit, rms / level, fraction, turns, (), *texts)


def _form_remainders(end: Ending) -> tuple[Remainder, ...]:
    """The strongest form of each variable that is still significant given the terms."""
    generic, remaining = end.analysis.null_model.generic, end.analysis.identified.residual_forms
    remainders: dict[tuple[int, str], Remainder] = {}
    for at in end.analysis.identified.significant:
        form, output = generic.forms[at], int(generic.outputs[at])
        key = (output, form.variable)
        if key in remainders or len(remainders) >= MAX_REMAINDERS:
            continue
        declared_output = end.setup.data.outputs[output]
        ratio = float(np.sqrt(max(remaining.gains[at], 0.0) / end.analysis.search.fitter.space.rows_per_output))
        remainders[key] = Remainder(
            declared_output.name,
            form.variables,
            ", ".join(form.words),
            ratio * end.analysis.null_model.noises[output].level,
            declared_output.unit,
            ratio,
            min(1.0, float(remaining.gains[at]) / _excess_over_noise(end)),
            bool(form.direction),
        )
    return tuple(remainders.values())
