"""What a problem tells its readers beside numbers of a front; by default nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..records import Bars, UnitsShown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class Variant:
    """A problem in which one assumption is another: which one, what it is, and the problem."""

    assumption: str
    value: str
    problem: ToleranceProblem


class Shown:
    """What the page of a run has beside the front, where a problem knows it."""

    explained: ClassVar[Mapping[str, str]] = {}
    """By output without a derivative, the one whose derivative tells what contributes to it."""

    def bars(self) -> tuple[Bars, ...]:
        """Charts of what matters in this problem, whatever is optimised."""
        return ()

    def title(self) -> str:
        """The mechanism in words, for the heading of a page; empty where the name says it."""
        return ""

    def validity(self) -> tuple[str, ...]:
        """Limits of validity of the model, a sentence each."""
        return ()

    def shown_limit(self) -> tuple[str, float] | None:
        """Output and upper limit by which the point is chosen whose units are shown."""
        return None

    def shown_units(self, design: NDArray[np.float64]) -> UnitsShown | None:
        """One unit and the population of a full design (all variables,), None without units."""
        return None

    def variants(self) -> tuple[Variant, ...]:
        """The problem as it is, then with one assumption changed at a time.

        They search the same free variables; empty where no assumption is worth trying.
        """
        return ()
