"""The promise of a run on its yield: cost by statement, the next measurements, the processes."""

from __future__ import annotations

from typing import Any

from ..records import Bars, RunResult, unit_of_cost
from ..units import split_unit
from .bars import bars_figure
from .control import CHARTS, control_figure
from .document import folded, picture, section
from .explained import configured
from .tables import described

STATEMENTS = (
    "The least cost that keeps the promise, by the meaning of the promise. plug_in: the estimates of "
    "the samples count as true. predictive: the expected yield counts, given the uncertainty "
    "of the samples. assured: the yield is kept with the confidence. assurance_percent is the "
    "probability, over what is not known of the processes, that the promised fraction of units "
    "conforms (20,000 draws of the posterior). promise.csv has this table."
)
NEXT = (
    "The processes of which twenty more measured parts lower the cost of the assured promise most. "
    "shadow_gain is by the multiplier of the promise at the present tolerances; expected_gain, of the "
    "first three, is the expected fall of the least cost over the possible results of the next sample. "
    "next_parts.csv has this table."
)
CAPABILITY = (
    "Cp and Cpk of every measured characteristic with 95 % confidence limits, and the distribution "
    "type of ISO 22514-2 as far as the tests show it. Means are from the mid-limit; a characteristic with "
    "one limit has no Cp, and its mean is from the nominal. capability.csv has this table."
)
CHARTED = (
    "Single values in the order in which the parts were made, with their mean and the control limits at 2.66 mean "
    "moving ranges from it; a cross marks a value beyond them."
)


def promise_sections(result: RunResult) -> tuple[str, ...]:
    """The section on the promise, on measured parts alone where nothing is promised, or none."""
    if result.promise is None or result.promise.empty:
        known = _process_knowledge(result)
        return (section("Measured parts", "\n".join(known)),) if known else ()
    statements = result.promise
    unit = unit_of_cost(result.summary)
    bars = Bars("least cost", unit, tuple(map(str, statements["statement"])), tuple(map(float, statements["cost"])))
    chosen = (result.summary.get("promise") or {}).get("statement")
    marked = [name == chosen for name in statements["statement"]]
    parts = [
        described(STATEMENTS, statements, marked),
        picture("promise", bars_figure(bars), "Cost of assurance: the least cost by statement."),
    ]
    if result.next_parts is not None:
        parts.append(described(NEXT, result.next_parts))
    parts += _process_knowledge(result)
    return (section("Promise", "\n".join(parts)),)


def _process_knowledge(result: RunResult) -> list[str]:
    """What is known of the processes of measured parts, and their control charts."""
    parts = []
    if result.capability is not None:
        parts.append(folded("What is known of the processes", described(CAPABILITY, result.capability)))
    charts = measured_parts(result.configuration)
    if charts:
        more = f" The first {CHARTS} of {len(charts)}." if len(charts) > CHARTS else ""
        parts.append(folded("Control charts", picture("control", control_figure(charts), CHARTED + more)))
    return parts


def measured_parts(configuration: str) -> list[tuple[str, str, list[float]]]:
    """Name, unit and values of every measured part or variable of a resolved configuration."""
    content: Any = configured(configuration)
    parts = content.get("part")
    owners = [
        (str(part.get("name", "")), part.get("unit"), part) for part in (parts if isinstance(parts, list) else ())
    ]
    variables = content.get("variables")
    owners += [
        (name, split_unit(name)[1], variable)
        for name, variable in (variables if isinstance(variables, dict) else {}).items()
        if isinstance(variable, dict)
    ]
    return [
        (name, str(measured.get("unit") or unit or ""), measured["values"])
        for name, unit, owner in owners
        if isinstance(measured := owner.get("measured"), dict) and len(measured.get("values") or ()) > 1
    ]
