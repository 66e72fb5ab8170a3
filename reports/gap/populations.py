"""Simulated and measured units line by line, and the inputs that may cause a difference."""

from __future__ import annotations

from html import escape

from ...gap_population_records import Attribution
from ...gap_records import GapResult
from ..tables import listed, table

CAPTION = "Simulated and measured units, with the model before correction and with the effects in it."


def population_table(result: GapResult) -> str:
    """Location, spread, shape, mixture and trend of the units; empty where rows are no units."""
    if not result.population:
        return ""
    columns = (
        "model, output, aspect, statistic, unit, simulated, measured, difference, low: 90 % from, high: to, "
        "chance: size by chance, verdict"
    )
    return table(listed(result.population, columns), [line.differs for line in result.population], CAPTION)


def attribution_table(result: GapResult) -> str:
    """The change of every input that alone would cause the difference, and why it is excluded."""
    return "\n".join(map(_attribution, result.attribution))


def _attribution(attribution: Attribution) -> str:
    rows = listed(
        attribution.candidates,
        "input, amount, low: 90 % from, high: to, unit, share_of_tolerance: in tolerances, "
        "distance: explains worse by, excluded_because: excluded because, parts: parts to measure, "
        "readings: units needed",
    )
    counts = ["parts to measure", "units needed"]
    rows[counts] = rows[counts].mask(rows[counts] == 0)
    marks = [not c.excluded_because for c in attribution.candidates]
    head = f"{attribution.kind}: {attribution.verdict}" if attribution.kind else attribution.verdict
    below = table(rows, marks) if len(rows) else ""
    return f"<h3>{escape(head)}</h3>\n<p>{escape(attribution.text)}</p>\n{below}"
