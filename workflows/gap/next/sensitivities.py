"""Points at which a barely present effect would be detected, and the probability of detection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chndtr

from ....arrays import Array
from ....gap_next_records import Sensitivity
from ..ending_records import UNIMITATED
from ..fit import Fit, Member
from ..plan import NextPlan
from ..result import Ending
from ..scan import scan
from .contest import Contest
from .field import Ahead, Field
from .rows import Predictions, distance, of_record
from .separations import joined

NEAREST = 2
"""Number of effects that are planned for where none is listed."""
NINE_OF_TEN = 1.2816
"""Standard normal quantile of 0.9."""
TINY = 1e-12


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
        effect = _sought(end, member, wanted.amounts.get(name))
        if effect is None:
            notes.append(f"{name}: cannot be detected in these data, because free parameters imitate it")
        elif listed or not _detected(end, effect):
            sought.append(effect)
        if not listed and len(sought) == NEAREST:
            break
    return sought, notes if listed else []


def _detected(end: Ending, effect: Sought) -> bool:
    """Whether the record shows the effect: then its form is in question, not its presence."""
    detectable_norm = float(np.sqrt(end.analysis.initial_null_model.search.thresholds.library)) + NINE_OF_TEN
    return distance(*effect.record) > detectable_norm**2


def _sought(end: Ending, member: Member, amount: float | None) -> Sought | None:
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
    columns = of_record(null_model.search.fitter, null_model.null_fit).columns
    return Predictions(values, columns), Predictions(np.zeros_like(values), columns)


def _at(sought: Sought, at: Ahead | Field) -> tuple[Predictions, Predictions]:
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
    levels += [joined(*sought.record, *_at(sought, at)) for at in (new, alike)]
    size, candidate = sought.size, sought.member.candidate
    now, then, like = (1.0 - float(chndtr(limit, max(len(size), 1), max(level, TINY))) for level in levels)
    column = int(np.argmax(np.abs(size)))
    detectable_size = abs(float(size[column])) * (np.sqrt(limit) + NINE_OF_TEN)
    least = [detectable_size / float(np.sqrt(max(level, TINY))) for level in levels]
    parameter = candidate.linear[column]
    return Sensitivity(
        candidate.name, parameter.name, parameter.unit, float(size[column]), now, then, like, least[0], least[1]
    )
