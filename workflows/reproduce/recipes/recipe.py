"""The interface of all recipes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ....claim_records import ComputedTable
from ....declarations import Parameter
from ..calculation import Quantity


@dataclass(frozen=True, slots=True, eq=False)
class Recomputed:
    """Computed quantities in the order asked for, and tables by a name for their file."""

    quantities: tuple[Quantity, ...]
    tables: Mapping[str, ComputedTable] = field(default_factory=dict)


class Recipe(ABC):
    """How one or more values are recomputed; a frozen dataclass that can be sent to a process."""

    @abstractmethod
    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        """The values, every random number from `rng`."""

    @property
    @abstractmethod
    def by(self) -> str:
        """What it computes by, in words."""

    def shift_units(self) -> Mapping[str, str | None]:
        """The unit of every input that a derivative may be taken by, None where it is not known."""
        return {}

    def unit_of(self, name: str) -> str | None:
        """Unit of the input `name` that can be shifted, None where there is no such input."""
        return self.shift_units().get(name)

    def shiftable(self) -> tuple[str, ...]:
        """Every input that a derivative may be taken by."""
        return tuple(self.shift_units())

    def shifted(self, name: str, step: float) -> Recipe:
        """The same recipe with an input moved by `step`, in its unit."""
        raise NotImplementedError(f"{type(self).__name__} has no input {name}")


def continuous(parameters: Iterable[Parameter]) -> dict[str, str | None]:
    """The units of the parameters that are real numbers, by name."""
    return {parameter.name: parameter.unit for parameter in parameters if isinstance(parameter.default, float)}
