"""The interface of a physical effect that a model may miss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...declarations import Output
from ..inputs.distribution import Array
from ..measurable import Changeable, Column, Role


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A number of an effect; physics bounds it, sign included.

    In `unit`, the word `output` stands for the unit of the output that is acted on (`output/K`).
    What the effect does is proportional to a `linear` parameter, the others held.
    """

    name: str
    unit: str
    meaning: str
    low: float = 0.0
    high: float = inf
    linear: bool = True
    default: float = 0.0


@dataclass(frozen=True, slots=True)
class Target:
    """What an effect is added to: a model's name, its outputs, the columns that the table has,
    what may be changed inside, and whether each row is a unit of a population.
    """

    model: str
    outputs: tuple[Output, ...]
    columns: tuple[Column, ...]
    changeable: tuple[Changeable, ...] = ()
    population: bool = False

    def roles(self) -> frozenset[Role]:
        """The roles of the columns that are there."""
        return frozenset(column.role for column in self.columns)


@dataclass(frozen=True, slots=True)
class Readings:
    """The rows of a table as effects see them: by column name, and by role in fixed units.

    By role: angle [rad], torque [N m], force [N], direction [+1, -1], speed [rpm], temperature
    [degC], time [s], payload [kg], position [m]; unit and lot are labels. Rows stand in the order
    of measuring (`time` where there is one, else the order of the table).
    """

    table: Mapping[str, NDArray[Any]]
    by_role: Mapping[Role, NDArray[Any]]

    def __len__(self) -> int:
        return len(next(iter(self.table.values()))) if self.table else 0

    def __getitem__(self, role: Role) -> NDArray[Any]:
        """The first column (n,) of that role. Raises KeyError where there is none."""
        return self.by_role[role]


def _empty() -> Mapping[str, Array]:
    return {}


@dataclass(frozen=True, slots=True)
class Action:
    """What an effect does to n rows; it acts in exactly one of the places.

    - `changes`: added to changeable quantities inside of the model, by name, (n,);
    - `output`: added to outputs, by name, (n,), in their units;
    - `reading`: what the instrument makes of an output, by name: a function of the output (n,);
    - `population`: what becomes of the units of a batch: a function of the drawn values (n,), the
      model's mean and a generator.
    """

    changes: Mapping[str, Array] = field(default_factory=_empty)
    output: Mapping[str, Array] = field(default_factory=_empty)
    reading: Mapping[str, Callable[[Array], Array]] = field(default_factory=dict)
    population: Callable[[Array, float, np.random.Generator], Array] | None = None


class Effect(ABC):
    """A named physical effect: its cause, what it needs to be seen, and what it does.

    Composed in a fixed order: changes inside of the model, then the population, then the outputs,
    then the readings of the instrument.
    """

    name: ClassVar[str]
    family: ClassVar[str]
    cause: ClassVar[str]
    """One sentence."""
    needs: ClassVar[tuple[Role, ...]] = ()
    mistaken_for: ClassVar[tuple[str, ...]] = ()
    """Names of the effects that it is easily mistaken for."""
    reference: ClassVar[str] = ""

    def applies(self, target: Target) -> bool:
        """Whether the effect has a place in this model, with the columns of this table."""
        return set(self.needs) <= target.roles()

    @abstractmethod
    def parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        """Its numbers, for this target."""

    @abstractmethod
    def act(self, readings: Readings, values: Mapping[str, float], target: Target) -> Action:
        """What it does to the rows, with `values` of its parameters by name."""
