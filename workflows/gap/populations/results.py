"""The results of an analysis on units as a population: a table, and an attribution."""

from __future__ import annotations

from collections.abc import Sequence

from ....gap_population_records import Attribution, PopulationLine
from ....gap_records import Measurement, Rival
from ..result import Ending
from .attribution import of_batch
from .compared import has_units
from .recorded import of_recorded

SHOWN = 3


def attribution_of(end: Ending) -> tuple[Attribution, ...]:
    """The inputs that may cause a difference; empty where rows are no units."""
    if end.setup.data.target.population:
        return of_batch(end)
    return of_recorded(end) if has_units(end) else ()


def inputs_instead(end: Ending, attributions: Sequence[Attribution]) -> tuple[Rival, ...]:
    """A rival: a shift of the process mean, where a shifted input makes units look like a mixture.

    Clipped interference changes the shape of the distribution as a second supplier does.
    """
    levels = end.analysis.initial_null_model.batch.levels if end.setup.data.target.population else ()
    apart = [effect.candidate for effect in end.analysis.scatter[:1] if effect.apart_from_inputs]
    shifts = [
        attribution
        for attribution in attributions
        if attribution.kind == "shift" and attribution.inputs and attribution.verdict != "none"
    ]
    if not apart or not levels or not shifts or end.verdict not in ("named", "ambiguous"):
        return ()
    nearest = min((change.distance for change in shifts[0].candidates if not change.excluded_because), default=0.0)
    return (Rival(levels[:1], (apart[0].name,), nearest, Measurement(shifts[0].text)),)


def summary_messages(lines: Sequence[PopulationLine], attribution: Sequence[Attribution]) -> list[str]:
    """The summary: the differences before correction, and the inputs that may cause them."""
    before = [line for line in lines if line.model == "before"]
    differ = [
        f"{line.output} {line.statistic} ({line.simulated:.4g}, measured {line.measured:.4g} {line.unit}".rstrip() + ")"
        for line in before
        if line.differs
    ]
    sentences = []
    if differ:
        more = f" and {len(differ) - SHOWN} more" if len(differ) > SHOWN else ""
        sentences.append(f"units differ from the simulated ones in {', '.join(differ[:SHOWN])}{more}")
    elif any(not line.enough for line in before):
        sentences.append(f"units compared with the simulated ones: {before[0].verdict}")
    elif before:
        sentences.append(f"units as simulated: no difference detected in {len(before)} statistics")
    return sentences + [f"input: {text}" for text in dict.fromkeys(record.text for record in attribution)]
