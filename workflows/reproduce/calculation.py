"""What recomputes a figure that is no output of a model or a problem."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...claim_records import Chart, ComputedTable
from ...declarations import Output, Parameter, Value, completed
from ...errors import Fault

__all__ = ["Calculation", "Chart", "Computed", "ComputedTable", "Quantity"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A computed number and its unit ("1": none); `standard_error` is 0 where nothing is drawn."""

    value: float
    unit: str
    standard_error: float = 0.0


@dataclass(frozen=True, eq=False)
class Computed:
    """The results of a calculation: numbers by name, and tables for the reader."""

    quantities: Mapping[str, Quantity]
    tables: tuple[ComputedTable, ...] = ()


class Calculation(ABC):
    """A plugin of the entry point group "tolevo.calculations".

    The defaults of `parameters` are the document's case; those that no document prints are marked
    as assumed. It is built without arguments and keeps no state.
    """

    name: ClassVar[str]
    about: ClassVar[str]
    """One sentence: what is computed."""
    reference: ClassVar[str]
    """Where the document has it."""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    outputs: ClassVar[tuple[Output, ...]] = ()
    """Every quantity that it computes, where they are the same whatever the parameters."""
    sampled: ClassVar[bool] = True
    """Whether it may draw from the generator; if not, it is computed once for all claims."""

    def completed(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """All parameters by name; those left out have their defaults."""
        return completed(self.parameters, values)

    def faults(self, values: Mapping[str, Value]) -> list[Fault]:
        """What is wrong with all parameters together, before anything is computed.

        The place of a fault is the name of a parameter.
        """
        return []

    @abstractmethod
    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        """The quantities at parameters by name (those left out have their defaults).

        Raises InputError where the values do not go together.
        """
