"""From an analysis to the records that are written and drawn."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

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
from .abstain import acts_in
from .ambiguity import correlation
from .analysis import Analysis, without
from .blocks import HeldOut, improvement
from .close import Corrected, corrected
from .data import GapData
from .fit import Fit
from .linear import beside
from .misfit import misfit_of, of_weights
from .noise import outliers, whiteness
from .population import Scatter
from .scan import scan
from .separate import separating
from .settle import names_of, predicts_as_well
from .setup import Setup, nominal
from .uncertainty import Spread

SUPPLIERS = "note the supplier of each lot: a second supplier is off by the same in all of its lots"
MORE = "measure more units of one lot: a mixture has two peaks, or a shoulder, a wider spread one"
OWN = 0.01
"""Share of a column that what is free cannot do, below which nothing of it can be seen."""
FORM_OFF, FORM_ALIKE = 0.05, 0.3
"""What a name does that another one in its variables does not, as a share of what that one does,
and their correlation: below the one and above the other it may be no more than the form of the
larger one, which no formula has exactly.
"""
SEPARATED = 4
"""Rivals for which the separating measurement is searched."""


@dataclass(frozen=True)
class Ending:
    """An analysis with its final fit: only the effects that keep their name."""

    analysis: Analysis
    fit: Fit
    model: Corrected
    before: HeldOut
    after: HeldOut

    @property
    def setup(self) -> Setup:
        """What was analysed."""
        return self.analysis.setup

    @property
    def verdict(self) -> str:
        """The one word."""
        if not self.analysis.significant:
            return "no_gap"
        if not self.named and not self.analysis.scatter:
            return "unnamed"
        if self.remains:
            return "partial"
        rivals = self.analysis.others or len(self.analysis.scatter) > 1 or self.twin
        return "ambiguous" if rivals else "named"

    @property
    def named(self) -> tuple[int, ...]:
        """The places of the members that have a name."""
        return names_of(self.fit.members)

    @property
    def rows(self) -> bool:
        """Whether each row is a reading, not a unit of a population."""
        return not self.setup.data.target.population

    @property
    def remains(self) -> bool:
        """Whether rows show something that has no name beside what is named, or units scatter in a
        way that has none.
        """
        terms = len(self.named) < len(self.fit.members)
        forms_remain = self.rows and bool(self.analysis.judged.significant)
        return terms or forms_remain or self.analysis.misfit is not None

    @property
    def twin(self) -> bool:
        """Whether lots are off, which a second supplier would do as well."""
        names = {candidate.name for candidate in self.setup.on_scatter}
        return "lot_offset" in self.fit.names and "lot_mixture" in names


def ended(analysis: Analysis) -> Ending:
    """The final fit of what keeps its name, in the full model; a name whose numbers may all be 0
    beside the others, by their joint interval, is none, and the rest is fitted and tested again. So
    is one that may be the form of a larger name, unless held-out rows are predicted worse then.
    """
    ending, needed = _ended(analysis), set[str]()
    while ending.rows and (weak := _weak(ending, needed)) is not None:
        name, larger = weak
        reduced = without(analysis, name, larger)
        after = _ended(reduced)
        if larger and not _predicts_as_well(after):
            needed.add(name)
        else:
            analysis, ending = reduced, after
    return ending


def _weak(end: Ending, needed: Collection[str]) -> tuple[str, str] | None:
    """The first name that is none, and the larger one whose form it may be, empty where its own
    numbers may be 0; None where all are names. What is `needed` is not a form of another one.
    """
    for at in end.named:
        name = end.fit.names[at]
        larger = "" if name in needed else _form_of(end, at)
        if larger or end.model.nothing(end.fit.members[at]):
            return name, larger
    return None


def _predicts_as_well(end: Ending) -> bool:
    """Whether held-out rows are predicted as well as by every accepted step."""
    steps = [held_out for _, held_out in end.analysis.selection.accepted]
    return predicts_as_well(end.after, steps, end.analysis.search.labels)


def _form_of(end: Ending, at: int) -> str:
    """The larger name in the variables of a name which does little that the larger one does not: as
    much as the form of that one may be off. Empty where there is none.
    """
    members = end.fit.members
    mine = acts_in(members[at].candidate.effect.needs)
    others = [
        k
        for k in end.named
        if mine and k != at and mine <= acts_in(members[k].candidate.effect.needs)
    ]
    return next((members[k].name for k in others if _is_form(end, at, k)), "")


def _is_form(end: Ending, small: int, large: int) -> bool:
    """Whether what one member does may be the form of another one."""
    fitter, fit = end.analysis.search.fitter, end.fit
    a, b = (
        beside(fitter.white(fit.members[k]) @ fit.coefficients[k], fitter.q) for k in (small, large)
    )
    small_norm, large_norm = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    alike = abs(float(a @ b)) / max(small_norm * large_norm, 1e-300)
    apart = small_norm * np.sqrt(max(1.0 - alike**2, 0.0))
    return bool(small_norm < large_norm and alike > FORM_ALIKE and apart < FORM_OFF * large_norm)


def _ended(analysis: Analysis) -> Ending:
    search = analysis.search
    lost = analysis.judged.lost
    kept = [member for at, member in enumerate(analysis.fit.members) if at not in lost]
    fit = search.fitter.refined(kept) if kept else analysis.ground.empty
    if not lost and not analysis.scatter and not analysis.setup.data.target.population:
        fit = analysis.fit  # as it was tested
    model = corrected(analysis.setup, search.fitter.space, fit)
    null_model = analysis.bare
    end = Ending(
        analysis, fit, model, null_model.search.tested(null_model.empty), search.tested(fit)
    )
    extra_widths = misfit_of(analysis, fit)
    if end.named and end.rows and not analysis.setup.free and not search.fitter.space.is_plain:
        weighed = of_weights(model, corrected(analysis.setup, search.fitter.space, fit, plain=True))
        extra_widths = {
            key: extra_widths.get(key, 0.0) + weighed.get(key, 0.0)
            for key in {**extra_widths, **weighed}
        }
    return replace(end, model=model.widened(extra_widths))


def gate(end: Ending) -> Gate:
    """Stage 1 as a record."""
    analysis, null_model = end.analysis, end.analysis.bare
    setup, count = null_model.setup, len(null_model.setup.data)
    output_gates = []
    for at, (output, noise) in enumerate(zip(setup.data.outputs, null_model.noises, strict=True)):
        level = null_model.left.evidence[null_model.generic.outputs == at].max(initial=0.0)
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
                significant=bool(level > limit)
                or (analysis.significant and len(null_model.noises) == 1),
                autocorrelation=noise.rho,
                heteroscedastic=noise.varies_with,
                outliers=noise.outliers,
                whiteness=whiteness(end.fit.residual[rows]),
                uncertainty=noise.level * 2.0 / np.sqrt(count),
            )
        )
    return Gate(tuple(output_gates), recalibrated(end), *detectable(end))


def rmse(values: Array, good: object = None) -> float:
    """Root mean square, outliers left out."""
    inside = values if good is None else values[np.asarray(good, dtype=bool)]
    return float(np.sqrt(np.mean(inside**2)))


def recalibrated(end: Ending) -> tuple[Recalibrated, ...]:
    """What became of the free parameters."""
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
    """The smallest effect of each name that would have been seen nine times out of ten, and the
    names that cannot be seen at all, because what is free does the same.
    """
    search, setup = end.analysis.bare.search, end.setup
    wanted = np.sqrt(search.thresholds.library) + 1.2816
    white, raw = search.white.columns, search.book.raw.columns
    total = np.einsum("ij,ij->j", white, white)
    squares = total - np.sum((search.fitter.q.T @ white) ** 2, axis=0)
    squares[squares < OWN**2 * total] = 0.0
    size, of_raw = np.sqrt(squares), np.sqrt(np.einsum("ij,ij->j", raw, raw) / len(raw))
    smallest: dict[str, Detectable] = {}
    names: dict[str, None] = {}
    for start, member in zip(search.white.starts, search.book.members, strict=True):
        if member.candidate.alone:
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
            smallest[member.name] = Detectable(
                member.name, family, rms, unit, parameter.name, value
            )
    return tuple(smallest.values()), tuple(name for name in names if name not in smallest)


def scores(end: Ending) -> tuple[Score, ...]:
    """Stage 3 as records: every effect alone beside the model's parameters, best first."""
    search = end.analysis.bare.search
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
    """The effects that keep their name, with intervals and evidence."""
    moving = [_effect(end, at, spread) for at in end.named]
    return (*moving, *(_of_scatter(scatter_effect) for scatter_effect in end.analysis.scatter[:1]))


def _of_scatter(scatter_effect: Scatter) -> FoundEffect:
    """An effect on the scatter of a batch as a record; held out is twice its log likelihood."""
    effect = scatter_effect.candidate.effect
    numbers = (*scatter_effect.candidate.linear, *scatter_effect.candidate.shape)
    return FoundEffect(
        name=effect.name,
        family=effect.family,
        cause=effect.cause,
        parameters=tuple(
            FoundParameter(
                p.name,
                scatter_effect.numbers[p.name],
                *scatter_effect.intervals[p.name],
                p.unit,
                p.meaning,
            )
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
    intervals = {
        parameter.name: _ends(end, member.name, parameter, values, spread) for parameter in numbers
    }
    total = max(end.analysis.ground.empty.rss - end.fit.rss, 1e-300)
    return FoundEffect(
        name=member.name,
        family=member.candidate.effect.family,
        cause=member.candidate.effect.cause,
        parameters=tuple(
            FoundParameter(
                parameter.name,
                values[parameter.name],
                *intervals[parameter.name],
                parameter.unit,
                _meaning(parameter),
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
            if not parameter.choices
            and _at_bound(values[parameter.name], parameter.low, parameter.high, several)
        ),
    )


def _at_bound(value: float, low: float, high: float, several: bool = False) -> bool:
    """Whether physics stopped a number; a zero is a bound beside other numbers of its effect."""
    width, stops = abs(value) * 1e-6, np.isfinite(low) and (low != 0.0 or several)
    return bool((np.isfinite(high) and value >= high - width) or (stops and value <= low + width))


def _meaning(parameter: EffectParameter) -> str:
    """What a parameter means, and whether it was chosen instead of fitted."""
    choices = ", ".join(f"{choice:g}" for choice in parameter.choices)
    return (
        f"{parameter.meaning} (chosen out of {choices}, not fitted)"
        if choices
        else parameter.meaning
    )


def _ends(
    end: Ending,
    owner: str,
    parameter: EffectParameter,
    values: Mapping[str, float],
    spread: Spread | None,
) -> tuple[float, float]:
    """The interval of a number; one that was chosen has no width."""
    if parameter.choices:
        return values[parameter.name], values[parameter.name]
    linear = end.model.interval(owner, parameter.name)
    return linear if spread is None else spread.interval(owner, parameter.name, linear)


def rival_records(
    end: Ending, planned: Mapping[tuple[tuple[str, ...], tuple[str, ...]], Measurement]
) -> tuple[Rival, ...]:
    """Stage 5 as records; `planned` are the measurements by names and those they stand for."""
    levels = end.analysis.search.fitter.space.level()
    rivals: list[Rival] = []
    for at, rival in enumerate(end.analysis.others):
        measurement = planned.get((rival.names, rival.instead_of))
        if measurement is None:
            measurement = (
                separating(end.setup, levels, end.fit, rival.fit)
                if at < SEPARATED
                else rivals[0].measurement
            )
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
        both = set(best_names) & set(scatter_rival.names)
        names, instead = (
            tuple(n for n in of if n not in both) for of in (scatter_rival.names, best_names)
        )
        measurement = planned.get((names, instead), Measurement(MORE))
        rivals.append(Rival(names, instead, scatter_rival.distance, measurement))
    return tuple(rivals)


def residual_table(end: Ending, full: GapData) -> pd.DataFrame:
    """Every reading with its prediction before and after, in the order of measuring."""
    setup, n = end.setup, len(end.setup.data)
    inputs = {c.name: full.readings.table[c.name] for c in full.target.columns}
    frame = pd.DataFrame({"row": full.rows, **inputs})
    used = np.flatnonzero(np.isin(full.rows, setup.data.rows))
    start = end.analysis.bare
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
