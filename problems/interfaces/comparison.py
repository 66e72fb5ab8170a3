"""What a reported allocation is compared with: finer models, units, changed assumptions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...arrays import Array
from ...records import UnitsShown
from .base import Interface

if TYPE_CHECKING:
    from ..tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class Variant:
    """A problem with one changed assumption: which one, its new value, and the problem."""

    assumption: str
    value: str
    problem: ToleranceProblem


class Comparison(Interface):
    """Verdicts of a finer model, one unit among many, other assumptions and other machines."""

    def finer_verdicts(self, designs: Array) -> tuple[str, ...]:
        """A finer model's verdict on each full design (n, all variables), such as "by contact this
        allocation keeps 1 arcmin in 43 % of units"; empty where there is none.
        """
        return ()

    def model_labels(self, designs: Array) -> tuple[str, ...]:
        """The model of each full design (n, all variables), and a finer model's verdict.

        Empty texts where there is only one model.
        """
        alone = self._problem.declaration.model_statement
        verdicts = self.finer_verdicts(designs)
        if not alone or not verdicts:
            return (alone,) * len(designs)
        return tuple(f"{alone}; {verdict}" for verdict in verdicts)

    def shown_limit(self) -> tuple[str, float] | None:
        """Output and upper limit that choose the point whose units are shown."""
        return None

    def shown_units(self, design: Array) -> UnitsShown | None:
        """One unit and the population of a full design (all variables,), None without units."""
        return None

    def variants(self) -> tuple[Variant, ...]:
        """The problem as it is, then with one assumption changed at a time.

        They search the same free variables; empty where no assumption needs trying.
        """
        return ()

    def alternatives(self) -> dict[str, ToleranceProblem]:
        """The machine with another choice, by a label of it: its least cost is reported."""
        return {}
