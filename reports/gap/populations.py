"""Simulated and measured units line by line, and the inputs that may be behind a difference."""

from __future__ import annotations

from html import escape

import pandas as pd

from ...gap_population_records import Attribution
from ...gap_records import GapResult
from ..tables import table

CAPTION = "Simulated and measured units, with the model before correction and with the effects in it."


def population_table(result: GapResult) -> str:
    """Location, spread, shape, mixture and trend of the units; empty where rows are no units."""
    if not result.population:
        return ""
    rows = [
        {
            "model": line.model,
            "output": line.output,
            "aspect": line.aspect,
            "statistic": line.statistic,
            "unit": line.unit,
            "simulated": line.simulated,
            "measured": line.measured,
            "difference": line.difference,
            "90 % from": line.low,
            "to": line.high,
            "chance reaches": line.chance,
            "verdict": line.verdict,
        }
        for line in result.population
    ]
    return table(pd.DataFrame(rows), [line.differs for line in result.population], CAPTION)


def attribution_table(result: GapResult) -> str:
    """What every input alone would have to do, and why it is excluded."""
    return "\n".join(map(_attribution, result.attribution))


def _attribution(attribution: Attribution) -> str:
    rows = [
        {
            "input": c.input,
            "amount": c.amount,
            "90 % from": c.low,
            "to": c.high,
            "unit": c.unit,
            "in tolerances": c.share_of_tolerance,
            "explains worse by": c.distance,
            "excluded because": c.excluded_because,
            "parts to measure": c.parts or None,
            "units needed": c.readings or None,
        }
        for c in attribution.candidates
    ]
    marks = [not c.excluded_because for c in attribution.candidates]
    head = f"{attribution.kind}: {attribution.verdict}" if attribution.kind else attribution.verdict
    below = table(pd.DataFrame(rows), marks) if rows else ""
    return f"<h3>{escape(head)}</h3>\n<p>{escape(attribution.text)}</p>\n{below}"
