"""The next measurement of an analysis that has ended: its points and expected discrimination."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from ....gap_next_records import NextMeasurement, Sensitivity, Separation
from ....gap_records import Measurement
from ..ambiguity import Other
from ..fit import Fit
from ..plan import NextPlan
from ..result import Ending
from ..separate import OTHER_QUANTITIES
from .exchange import exchanged
from .field import Ahead, Field, ahead, field_of, like_now
from .sensitivities import contest, sensitivity, wanted_effects
from .separations import HOPELESS, LITTLE, NONE, SUPPORT, design, most, paired, separation
from .telling import decisive_inputs
from .units import further_units, of_scatter

FILE = "next_measurement.csv"
NOTHING = "a single effect fits these data: nothing has to be separated"
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
        return _of_rivals(end, wanted)
    if end.verdict in ("no_gap", "unnamed"):
        return _of_effects(end, wanted)
    return Planned(NextMeasurement(NOTHING))


def _of_rivals(end: Ending, wanted: NextPlan) -> Planned:
    """Points that separate the best explanation from each of its rivals."""
    plannable, measurements = [], dict[Key, Measurement]()
    for rival in end.analysis.rivals:
        if _acts_on_value(end, end.fit) or _acts_on_value(end, rival.fit):
            measurements[rival.names, rival.instead_of] = Measurement(ON_VALUE)
        else:
            plannable.append(rival)
    batch = end.setup.data.target.population
    records, new, inputs = (_of_batch if batch else _of_points)(end, wanted, plannable)
    for record in records:
        measurements[record.names, record.instead_of] = _measurement(record, new, inputs)
    for scatter_rival in end.analysis.scatter[1:]:
        record = of_scatter(end, end.analysis.scatter[0], scatter_rival, wanted.readings)
        records.append(record)
        measurements[record.names, record.instead_of] = Measurement(record.text, readings=record.needed)
    planned = new is not None and any(record.possible for record in records)
    return _planned(end, new if planned else None, inputs, tuple(records), measurements=measurements)


def _of_points(
    end: Ending, wanted: NextPlan, rivals: Sequence[Other]
) -> tuple[list[Separation], Ahead | None, tuple[str, ...]]:
    """Separations by chosen points; the points; the inputs that matter most."""
    if not rivals:
        return [], None, ()
    noises = end.analysis.search.fitter.space.noises
    place = field_of(end.setup, noises, wanted)
    pairs = [paired(end, rival, place) for rival in rivals]
    count = _count(place, wanted)
    gains = [most(pair, count) for pair in pairs]
    separable = [pair for pair, gain in zip(pairs, gains, strict=True) if gain > HOPELESS * count]
    useful = [pair for pair, gain in zip(pairs, gains, strict=True) if gain > LITTLE] or separable
    chosen, better = design(end, place, useful or pairs[:1], count)
    pairs = [next((b for b in better if b.rival is p.rival), p) for p in pairs]
    new = ahead(place, chosen)
    alike = like_now(end.setup, noises, len(new))
    records = [separation(end, pair, new, alike) for pair in pairs]
    records = [
        record if gain > HOPELESS * count else _inseparable(record, pair.rival)
        for record, pair, gain in zip(records, pairs, gains, strict=True)
    ]
    return records, new, decisive_inputs(place, (useful or pairs)[0].contests[0], chosen)


def _of_batch(
    end: Ending, wanted: NextPlan, rivals: Sequence[Other]
) -> tuple[list[Separation], Ahead | None, tuple[str, ...]]:
    """Separations by further units."""
    if not rivals:
        return [], None, ()
    noises = end.analysis.search.fitter.space.noises
    new, alike = (further_units(end.setup, noises, wanted, spread) for spread in (True, False))
    records = []
    for rival in rivals:
        record = separation(end, paired(end, rival), new, alike)
        gained = record.expected - record.now
        records.append(record if gained > HOPELESS * len(new) else _inseparable(record, rival))
    return records, new, tuple(wanted.ranges)


def _inseparable(record: Separation, rival: Other) -> Separation:
    """The record of a pair that no design separates, with the quantity that would."""
    names = frozenset(set(rival.names) ^ set(rival.instead_of))
    text = OTHER_QUANTITIES.get(names, "another quantity has to be measured")
    return replace(record, needed=0, text=f"{NONE}: {text}", possible=False)


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
        chosen = np.resize(exchanged(contests, min(count, SUPPORT)), count)
        new, inputs = ahead(place, chosen), decisive_inputs(place, contests[0], chosen)
        alike = like_now(setup, noises, len(new))
    sensitivities = tuple(sensitivity(end, effect, new, alike) for effect in sought)
    return _planned(end, new, inputs, effects=sensitivities, notes=tuple(notes))


def _planned(
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
        text = "; ".join(dict.fromkeys(pair.text for pair in pairs)) or NONE
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
