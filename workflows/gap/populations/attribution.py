"""Attribution of a batch's difference to an input: by likelihood, and by the inputs' limits."""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter

import numpy as np

from ....arrays import Array
from ....gap_population_records import Attribution
from ....models.effects.measurements import unit_numbers
from ..data import GapData
from ..law import on_scatter
from ..result import Ending
from ..setup import LEAST_NAMED
from .input_changes import KINDS, Change, Tables
from .unit_law import UnitLaw
from .weighed import Weighed, parts_of


def of_batch(end: Ending) -> tuple[Attribution, ...]:
    """The inputs that may cause the gap of a batch; empty where there is no gap."""
    analysis, data = end.analysis, end.setup.data
    sources = None if end.setup.plan.model is None else end.setup.plan.model.sources()
    if not analysis.significant or sources is None or not data.target.population:
        return ()
    names, output = _names(end), data.outputs[0]
    if why := _refused(end):
        return (Attribution(names, output.name, "", (), "cannot tell", (), why),)
    y, u = _units(end)
    settings = end.setup.plan.settings
    tables = Tables(UnitLaw(sources), y, u, settings.parts_out_of_limits)
    weighed = Weighed(tables, settings.set_distance, settings.interval, *_rival(end, tables))
    if weighed.gain <= tables.chance(settings.false_rate, end.setup.plan.seed):
        given = _subtracted_effects(end)
        text = given or f"no change of an input is significant: cannot tell with n = {len(y)}"
        return (Attribution(names, output.name, "", (), "none" if given else "cannot tell", (), text),)
    attributions = decided(weighed, names, output.name, output.unit)
    basis = f" ({sources.basis})" if sources.basis else ""
    return tuple(replace(attribution, text=f"{attribution.text}{basis}") for attribution in attributions)


def decided(weighed: Weighed, effect: str, output: str, unit: str) -> tuple[Attribution, ...]:
    """A record for each remaining kind of change, or a single record with why none remains."""

    def of(kind: str, verdict: str, text: str, names: tuple[str, ...] = ()) -> Attribution:
        records = [weighed.record(change, unit) for change in weighed.tables.changes if change.kind == kind]
        records.sort(key=lambda record: (bool(record.excluded_because), record.distance))
        return Attribution(effect, output, kind, names, verdict, tuple(records), text)

    if not weighed.standing or not weighed.explained:
        if weighed.mixed:
            text = f"{weighed.rival} explain the batch; no change of one input alone does"
            return (of("", "none", text),)
        best = max(weighed.tables.changes, key=lambda change: change.best[1])
        text = f"no admissible change of one input alone explains the batch; nearest is a {best.kind} of {best.name}"
        return (of(best.kind, "none", text),)
    text = explanation(weighed, unit)
    if all(change.source is None for change in weighed.standing):
        text = f"no input alone explains it within its limits; {text}"
        return (of(weighed.standing[0].kind, "none", text),)
    alone = len(weighed.standing) == 1 and not weighed.mixed
    names = {kind: tuple(change.name for change in weighed.standing if change.kind == kind) for kind in KINDS}
    verdict = "attributed" if alone else "cannot tell"
    return tuple(of(kind, verdict, text, kind_names) for kind, kind_names in names.items() if kind_names)


def explanation(weighed: Weighed, unit: str) -> str:
    """A sentence on the remaining changes, and the measurement that would decide between them."""
    names = [_described(change) for change in weighed.standing]
    names += [weighed.rival] if weighed.mixed else []
    if len(names) == 1:
        change = weighed.standing[0]
        times = change.kind == "widening" and change.source is not None
        what = "times" if times else change.unit or unit
        sentence = f"{names[0]} ({change.shown(change.best[0]):.3g} {what}) alone would explain the batch"
        return f"{sentence}; several inputs together may do so as well"
    listed = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    text = f"cannot tell with n = {len(weighed.tables.y)} between {listed}"
    parts = {change.source: parts_of(change, change.best[0]) for change in weighed.standing if change.source}
    source, count = min(((s, k) for s, k in parts.items() if k), key=itemgetter(1), default=(None, 0))
    return text if source is None else f"{text}; measure the {source.part} of {count} parts"


def _described(change: Change) -> str:
    """The change of an input, or of the gauge, in words."""
    kind = "noise" if change.source is None and change.kind == "widening" else change.kind
    return f"{kind} of {change.name}"


def _names(end: Ending) -> str:
    return ", ".join([*end.fit.names, *(effect.candidate.name for effect in end.analysis.scatter[:1])])


def _refused(end: Ending) -> str:
    """Why no attribution to inputs is made; empty where it is."""
    count = len(end.setup.data)
    if not end.setup.plan.settings.effects_at_most or count < LEAST_NAMED:
        return f"cannot tell with n = {count} which input it is due to"
    setup = end.analysis.initial_null_model.setup
    measurements, target = setup.data.measurements, setup.data.target
    if any(on_scatter(active.effect, active.values, measurements, target) for active in setup.plan.active):
        return "cannot tell which input it is due to: the model contains an effect on the scatter already"
    return ""


def _rival(end: Ending, tables: Tables) -> tuple[str, float]:
    """The identified effect on the scatter that no input explains, and its log likelihood."""
    best = end.analysis.scatter[0] if end.analysis.scatter else None
    if best is None or not best.apart_from_inputs:
        return "", -np.inf
    return best.apart_from_inputs, tables.under(best.changed) - 0.5 * float(np.log(len(tables.y)))


def trends(end: Ending) -> tuple[str, ...]:
    """Effects along the order of the units: they act as an input that drifts."""
    return tuple(member.name for member in end.fit.members if member.candidate.effect.along_units)


def _subtracted_effects(end: Ending) -> str:
    """The sentence on effects that are subtracted before attribution, empty without any."""
    attributable = (*trends(end), *end.analysis.initial_null_model.batch.levels)
    subtracted = [name for name in end.fit.names if name not in attributable]
    return f"given {', '.join(subtracted)}, nothing remains to attribute to an input" if subtracted else ""


def _units(end: Ending) -> tuple[Array, Array]:
    """Units (n,) that count, given the effects on single units, and their order (n,)."""
    initial = end.analysis.initial_null_model
    units = initial.batch.units(end.fit, trends(end))
    return units.x + units.law.mean, order_of(initial.setup.data)[initial.noises[0].counted]


def order_of(data: GapData) -> Array:
    """The order (n,) of the units, from 0 to 1."""
    numbers = unit_numbers(data.measurements).astype(float)
    return np.asarray(numbers / max(numbers.max(), 1.0))
