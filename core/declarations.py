"""What a model or problem declares about itself: parameters, design variables, outputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf

from .counts import Need

Scalar = float | int | str | bool
Value = Scalar | tuple[float, ...] | Mapping[str, float]
"""A list has a fixed length; a table holds numbers by name."""


def number(value: Value) -> float:
    """The number that a scalar is. Raises TypeError where the value is a list or a table."""
    if isinstance(value, tuple | Mapping):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)


class Kind(StrEnum):
    """What the number of a design variable means."""

    HALF_WIDTH = "half-width t of the zone mid +- t"
    STANDARD_DEVIATION = "standard deviation"
    FULL_CLEARANCE = "full clearance c of the zone [0, c]"
    GRADE = "tolerance grade"
    NOMINAL = "nominal value"
    CHOICE = "choice"


TOLERANCES = frozenset({Kind.HALF_WIDTH, Kind.STANDARD_DEVIATION, Kind.FULL_CLEARANCE, Kind.GRADE})
"""The kinds that are tolerances: a narrower one is tighter and more expensive."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A named input of a physical model.

    `assumed` marks a default that no document prints; it is reported as an assumption. The default
    gives the type: a list keeps its length, the names in a table are `choices`, each with its unit.
    `need` is what an item takes where the parameter is a count: of units, positions, points.
    """

    name: str
    default: Value
    unit: str
    meaning: str
    source: str = ""
    assumed: bool = False
    low: float = -inf
    high: float = inf
    open_low: bool = False
    choices: tuple[str, ...] = ()
    need: Need | None = None
    readings: Mapping[str, Value] = field(default_factory=dict)
    """Other defaults, by the value of the parameter `reading`."""

    def default_in(self, reading: Value | None) -> Value:
        """The default where the parameter `reading` has this value."""
        return self.readings.get(str(reading), self.default)


READING = "reading"
"""Name of the parameter (an interpretation of a document) that sets several others together."""


def completed(parameters: Iterable[Parameter], stated: Mapping[str, Value]) -> dict[str, Value]:
    """Every parameter: as stated, else its default in the stated or the default interpretation."""
    declared = {parameter.name: parameter for parameter in parameters}
    reading = stated.get(READING, declared[READING].default if READING in declared else None)
    return {name: parameter.default_in(reading) for name, parameter in declared.items()} | dict(stated)


@dataclass(frozen=True, slots=True)
class Variable:
    """A design variable: its search range in `unit`, and the document's own choice.

    `labels` name the values 0, 1, ... of a choice: tables hold the name, designs the number.
    """

    name: str
    unit: str
    kind: Kind
    low: float
    high: float
    meaning: str
    document: float | None = None
    mid: float | None = None
    integer: bool = False
    valid_low: float = -inf
    valid_high: float = inf
    assumed: str = ""
    random: bool = False
    labels: tuple[str, ...] = ()

    @property
    def tolerance(self) -> bool:
        """Whether the variable is a tolerance rather than a nominal value."""
        return self.kind in TOLERANCES


@dataclass(frozen=True, slots=True)
class Output:
    """A named output of a model or problem.

    `scale` normalises a limit whose bound is 0. `larger_is_better` makes a bare number in
    `[limits]` a lower limit. `error_of` names the output whose numerical error this output states.
    """

    name: str
    unit: str
    meaning: str
    scale: float = 1.0
    larger_is_better: bool = False
    low: float = -inf
    high: float = inf
    error_of: str = ""


@dataclass(frozen=True, slots=True)
class Assumption:
    """A default that no document prints, as `tolevo check` and `summary.json` name it."""

    name: str
    value: Value
    unit: str
    reason: str
    set_by: str = "default"
