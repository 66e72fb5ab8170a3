"""Variables and outputs of a stack, from its parts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ...declarations import Kind, Output, Variable
from ..promise import Promise
from .definition import Part, Requirement
from .joint import VARIATIONS, common_unit
from .measured import Measured
from .promises import promise_outputs

OBJECTIVES = ("cost", "variation")
_MEANING = {
    "worst_case": "worst case",
    "rss": "root sum square",
    "shifted_rss": "mean shifts and root sum square",
    "monte_carlo": "half-width at the coverage",
}
_WORST = ("sum of |sensitivity| times tolerance", "largest deviation over the corners of the tolerances")
"""Of a formula that its slopes describe, and of another."""


def variables_of(parts: Iterable[Part]) -> tuple[Variable, ...]:
    """`<part>_t`, and `<part>_process` where there is something to choose."""
    variables = []
    for part in parts:
        high = part.processes[0].high if part.fixed else part.high
        variables.append(
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
            variables.append(
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
    return tuple(variables)


def outputs_of(
    requirements: Sequence[Requirement],
    parts: Sequence[Part],
    measured: Sequence[Measured] = (),
    promise: Promise | None = None,
) -> tuple[Output, ...]:
    """The outputs of a stack, in the order of the tables.

    Without `measured`, all outputs that there may be.
    """
    outputs = [Output("cost", "", "cost of all parts", low=0.0)]
    if requirements[0].key:
        outputs += _joint(requirements)
    for at, requirement in enumerate(requirements):
        outputs += _of_requirement(requirement, measured[at] if measured else None, parts)
    return (*outputs, *promise_outputs(promise, requirements))


def _joint(requirements: Sequence[Requirement]) -> list[Output]:
    """Outputs over all of several requirements."""
    unit, outputs = common_unit(requirements), []
    if unit is not None:
        outputs = [
            Output(kind, unit, f"largest {kind.replace('_', ' ')} of all requirements, each times its weight", low=0.0)
            for kind in VARIATIONS
        ]
    return outputs + _yields("yield_percent", "units that keep every requirement within its limits")


def _of_requirement(requirement: Requirement, measured: Measured | None, parts: Sequence[Part]) -> list[Output]:
    """Outputs of one requirement."""
    unit, name = requirement.unit, requirement.name or "the requirement"
    of_what = "worst case" if requirement.method == "worst_case" else "variance"
    meaning = f"variation of {name}: {_MEANING[requirement.method]}"
    qualified = requirement.output
    shown = range(len(parts)) if measured is None else measured.shown
    rough = measured is not None and measured.rough
    outputs = [
        Output(qualified("variation"), unit, meaning, low=0.0),
        Output(qualified("worst_case"), unit, _WORST[rough], low=0.0),
        Output(qualified("rss"), unit, "three standard deviations of the linear model", low=0.0),
        *_yields(qualified("yield_percent"), f"units with {name} within its limits"),
    ]
    if measured is None or measured.partial:
        outputs.append(
            Output(
                qualified("domain_margin"),
                "",
                f"distance of {name} from the edge of its formula's domain, in units of that at the mid-limits",
                larger_is_better=True,
            )
        )
    return outputs + [
        Output(
            qualified(f"contribution_{parts[at].name}_percent"),
            "percent",
            f"fraction of the {of_what} due to part {parts[at].name}",
        )
        for at in shown
    ]


def _yields(name: str, meaning: str) -> list[Output]:
    return [
        Output(name, "percent", meaning, larger_is_better=True, low=0.0, high=100.0),
        Output(f"{name}_error", "percent", "standard error of the yield", error_of=name),
    ]
