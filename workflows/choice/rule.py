"""A rule by which a point of a front is chosen, and the front that it takes: base of plugins."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.settings import Bound
from .settings import ChoiceSettings

COST = "cost"


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """A front in the form that the rules take.

    `objectives` (n, m) are called `names`, `cost` (n,) what each point costs, `weights` (m,)
    add up to one, `kept` (n,) says which points keep the limits of the choice, None without any.
    """

    objectives: Array
    names: tuple[str, ...]
    cost: Array | None
    weights: Array
    kept: NDArray[np.bool_] | None = None
    budget: float | None = None


class ChoiceRule(ABC):
    """A rule of choice: it names a row of a front of two or more objectives."""

    meaning: ClassVar[str]
    """What it chooses, in a few words, for `choices.csv` and the page."""

    @abstractmethod
    def row(self, points: Points) -> int | None:
        """The row that it chooses, None where it does not apply or chooses none."""

    def limits(self, settings: ChoiceSettings) -> Mapping[str, Bound]:
        """What it asks of the point that it chooses, and so of the rounded point as well."""
        return {}
