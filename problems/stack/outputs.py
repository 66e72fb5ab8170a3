"""Variables and outputs of a stack, from its parts."""

from __future__ import annotations

from collections.abc import Iterable

from ...declarations import Kind, Output, Variable
from .definition import Part, Requirement

OBJECTIVES = ("cost", "variation")
_MEANING = {
    "worst_case": "worst case",
    "rss": "root sum square",
    "shifted_rss": "mean shifts and root sum square",
    "monte_carlo": "half-width at the coverage",
}


def variables_of(parts: Iterable[Part]) -> tuple[Variable, ...]:
    """`<part>_t`, and `<part>_process` where there is something to choose."""
    found = []
    for part in parts:
        high = part.processes[0].high if part.fixed else part.high
        found.append(
            Variable(
                name=f"{part.name}_t",
                unit=part.unit,
                kind=Kind.HALF_WIDTH,
                low=part.low,
                high=high,
                meaning=f"tolerance of part {part.name}",
                valid_low=0.0,
            )
        )
        if part.alternatives:
            found.append(
                Variable(
                    name=f"{part.name}_process",
                    unit="",
                    kind=Kind.CHOICE,
                    low=0.0,
                    high=float(len(part.processes) - 1),
                    meaning=f"process that part {part.name} is made by",
                    integer=True,
                    valid_low=0.0,
                    valid_high=float(len(part.processes) - 1),
                    labels=tuple(process.name for process in part.processes),
                )
            )
    return tuple(found)


def outputs_of(requirement: Requirement, parts: Iterable[Part]) -> tuple[Output, ...]:
    """The outputs of a stack, in the order of the tables."""
    unit, name = requirement.unit, requirement.name or "the requirement"
    of_what = "worst case" if requirement.method == "worst_case" else "variance"
    return (
        Output("cost", "", "cost of all parts", low=0.0),
        Output("variation", unit, f"variation of {name}: {_MEANING[requirement.method]}", low=0.0),
        Output("worst_case", unit, "sum of |sensitivity| times tolerance", low=0.0),
        Output("rss", unit, "three standard deviations of the linear model", low=0.0),
        Output("yield_percent", "percent", f"units with {name} within its limits",
               larger_is_better=True, low=0.0, high=100.0),
        Output("yield_percent_error", "percent", "standard error of the yield",
               error_of="yield_percent"),
        *(Output(f"contribution_{part.name}_percent", "percent",
                 f"share of part {part.name} in the {of_what}") for part in parts),
    )  # fmt: skip
