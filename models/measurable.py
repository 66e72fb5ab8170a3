"""The interface of a model whose outputs can be measured."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..section import Array, Output, Parameter, Section, Value, Variable
from ..units import converted
from .gear import Gear
from .inputs import Distribution
from .propagation import ClippedSum, Term

# The toleranced inputs of a unit of a population, as far as a model has them.


@dataclass(frozen=True, slots=True)
class Source:
    """A toleranced input of a unit.

    `part` describes the quantity that is measured on parts. `tolerance` is the half-width of its
    zone, `law` the distribution in it, and `per_unit` the change of the sum per `unit` of it.
    `clipped` is whether it acts in the clipped part, `at` its place in that part. A zone
    `from_zero` grows from its lower end at zero.
    """

    name: str
    unit: str
    part: str
    tolerance: float
    per_unit: float
    clipped: bool
    at: int
    law: Distribution
    from_zero: bool = False
    widest: float = float("inf")
    """The largest factor on its half-width about its middle that is physical."""
    moves: bool = True
    """Whether an error common to all units moves them."""


@dataclass(frozen=True, slots=True)
class Sources:
    """The inputs of the single output of a population: it is `total`/`unit`, for one design.

    Where inputs of the clipped part do not add up, that part is a single term of all of them;
    `widened` returns it with the zone of an input widened by a factor, and `basis` states how
    inputs are then compared.
    """

    total: ClippedSum
    unit: float
    inputs: tuple[Source, ...]
    widened: Callable[[Source, float], Term] | None = None
    basis: str = ""

    def term(self, source: Source) -> Term:
        """The contribution of an input."""
        return (self.total.clipped if source.clipped else self.total.free)[source.at]


def ranks_of_units(table: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
    """Rank (n,) of each row of a table by the number of its unit, from 0: what is drawn for a unit
    follows its number, in whatever order the rows stand.

    Labels are ordered by the numbers in them (B2 before B10); where lots number their units anew, lot
    by lot. Rows of one label keep their order.
    """
    keys = [_label_numbers(table[name]) for name in ("unit", "lot") if name in table]
    if len(keys) == 2 and len(np.unique(keys[0])) == len(keys[0]):
        keys = keys[:1]
    ranks = np.empty(len(keys[0]) if keys else 0, dtype=np.int64)
    ranks[np.lexsort(keys)] = np.arange(len(ranks))
    return ranks


def _label_numbers(labels: NDArray[Any]) -> NDArray[Any]:
    """Numbers (n,) in the order of labels."""
    if labels.dtype.kind in "fiu":
        return labels
    names, inverse = np.unique(labels.astype(str), return_inverse=True)
    padded = [re.sub(r"\d+", lambda digits: digits[0].zfill(20), name) for name in names.tolist()]
    order = np.empty(len(names), dtype=np.int64)
    order[np.argsort(padded, kind="stable")] = np.arange(len(names))
    return np.asarray(order[inverse.ravel()])


class Role(StrEnum):
    """The role of a column of a measurement table in an effect."""

    ANGLE = "angle"
    TORQUE = "torque"
    FORCE = "force"
    DIRECTION = "direction"
    SPEED = "speed"
    TEMPERATURE = "temperature"
    TIME = "time"
    UNIT = "unit"
    LOT = "lot"
    PAYLOAD = "payload"
    POSITION = "position"
    INPUT = "input"
    REPEAT = "repeat"


@dataclass(frozen=True, slots=True)
class Column:
    """An input column of a measurement table; `text` columns are labels, not numbers.

    `sense` is -1 where the column counts against the convention; effects receive it negated.
    """

    name: str
    unit: str
    meaning: str
    needed: bool = True
    text: bool = False
    role: Role = Role.INPUT
    sense: int = 1

    @property
    def origin(self) -> float:
        """Where laws of it begin, in its unit: 20 degC of a temperature, else 0."""
        return float(converted(20.0, "C", self.unit)) if self.role is Role.TEMPERATURE else 0.0

    def from_origin(self, values: Array) -> Array:
        """Values (n,) relative to its origin, scaled to magnitude 1 at most."""
        away = values - self.origin
        return np.asarray(away / max(float(np.abs(away).max()), 1e-300))


@dataclass(frozen=True, slots=True)
class Changeable:
    """A quantity inside a model that an effect may change; 0 is the model as it stands.

    A quantity with the name of an effect (`bearing_clearance_mm`, without its unit) is where that
    effect acts in this model.
    """

    name: str
    unit: str
    meaning: str


NO_CHANGES: Mapping[str, Any] = MappingProxyType({})
Outside = Mapping[str, tuple[NDArray[np.bool_], str]]
"""Cells beyond a model's range, by column: which rows (n,), and what they must be."""


class MeasurableModel(ABC):
    """A model that predicts the outputs of a measurement table, row by row.

    `columns` are its inputs, `free` the parameters that a recalibration may move, each with its
    tolerance (half-width, in the parameter's unit), `changeable` what effects may change in it. A
    model of a `population` draws a unit for each row: it is compared with data as a distribution,
    not row by row. `corrects` names the problems whose allocation can be repeated with the
    identified effects; a problem whose `default_model` it is belongs to it as well. For units that
    are `made_to_a_drawing` a gap analysis takes geometry and zones from that problem's
    configuration; `geometry` are the parameters that distinguish drawings, `of_the_bench` those of
    the measurement, and `omits` those of the problem that units of the model do not follow. `tables` of a
    configuration define some of its parameters. It is set up from
    `parameters` and `designs` (variables by name, in their units; omitted ones keep their default)
    and the distributions `inputs` of the variables by name.
    """

    columns: ClassVar[tuple[Column, ...]]
    outputs: ClassVar[tuple[Output, ...]]
    parameters: ClassVar[tuple[Parameter, ...]]
    variables: ClassVar[tuple[Variable, ...]] = ()
    free: ClassVar[Mapping[str, float]]
    changeable: ClassVar[tuple[Changeable, ...]] = ()
    population: ClassVar[bool] = False
    corrects: ClassVar[tuple[str, ...]] = ()
    gear: Gear | None = None
    made_to_a_drawing: ClassVar[bool] = False
    geometry: ClassVar[tuple[str, ...]] = ()
    of_the_bench: ClassVar[tuple[str, ...]] = ()
    omits: ClassVar[tuple[str, ...]] = ()
    tables: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None: ...

    @abstractmethod
    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        """Every output (n,), in its unit, at the rows of a table of columns (n,).

        `changes` holds, by name, what is added to a changeable quantity: a number, or one per row.
        """

    @classmethod
    def written(cls, top: Section) -> dict[str, Value]:
        """The parameters defined by its `tables` of a configuration, with their faults reported."""
        return {}

    @classmethod
    def free_of(cls, parameters: Mapping[str, Value]) -> Mapping[str, float]:
        """The parameters that a recalibration may move, with their tolerances."""
        return cls.free

    @classmethod
    def gear_of(cls, parameters: Mapping[str, Any]) -> Gear | None:
        """The gear of a model with these parameters, None where it has none."""
        return cls.gear

    def row_by_row(self, columns: Collection[str]) -> bool:
        """Whether rows of a table with these columns are predicted independently, so that a long
        table may be split into blocks; False where several rows belong to one drawn unit.
        """
        return True

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        """Cells of a table of columns (n,) that are beyond the range of the model."""
        return {}

    def means(self, changes: Mapping[str, Array] = NO_CHANGES) -> Mapping[str, float]:
        """Mean of every output over the units of a population, by name, at the mean change."""
        return {}

    def law_sample(self) -> Mapping[str, Array]:
        """Outputs (k,) of units that represent the law of a population, by name; empty where those
        drawn by `predict` do.
        """
        return {}

    def sources(self) -> Sources | None:
        """The toleranced inputs of a unit of a population, None where they cannot be named."""
        return None


# Predictions in a table: those of any simulator, next to the measurements.


class MeasuredTable(MeasurableModel):
    """`model = "table"`: predictions are read from a column, and nothing can change inside.

    `inputs` are the columns that effects may depend on; `predictions` names the column of each
    output and its unit; columns in `ignored` are omitted, predictions in `turned` count with the
    opposite sign.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    free: ClassVar[Mapping[str, float]] = {}

    def __init__(
        self,
        inputs: tuple[Column, ...],
        outputs: tuple[Output, ...],
        predictions: Mapping[str, tuple[str, str]],
        ignored: tuple[str, ...] = (),
        gear: Gear | None = None,
        turned: tuple[str, ...] = (),
    ) -> None:
        prediction_columns = tuple(
            Column(column, unit, f"prediction of {name}", role=Role.INPUT)
            for name, (column, unit) in predictions.items()
        )
        self.columns = (*inputs, *prediction_columns)  # type: ignore[misc]
        self.outputs = outputs  # type: ignore[misc]
        self.predictions = dict(predictions)
        self.ignored = ignored
        self.gear = gear
        self.turned = turned

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        return {
            output.name: np.asarray(
                converted(np.asarray(table[column], dtype=float), unit or output.unit, output.unit)
                * (-1.0 if column in self.turned else 1.0)
            )
            for output in self.outputs
            for column, unit in (self.predictions[output.name],)
        }
