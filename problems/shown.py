"""What a problem shows its readers in addition to the numbers of a front; by default nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..records import Bars, UnitsShown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from ..models.costs import CostCurve
    from .settings import Settings
    from .tolerance_problem import ToleranceProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Variant:
    """A problem with one changed assumption: which one, its new value, and the problem."""

    assumption: str
    value: str
    problem: ToleranceProblem


def effect_notes(settings: Settings, counterparts: Sequence[str]) -> tuple[str, ...]:
    """A sentence for each active effect, from what it does in a problem: empty for nothing."""
    missing = "has no counterpart in this problem: it changes nothing here"
    notes = tuple(
        f"effect {effect.effect.name}: {does}" if does else f"effect {effect.effect.name} {missing}"
        for effect, does in zip(settings.effects, counterparts, strict=True)
    )
    zeros = ", ".join(settings.zero)
    why = "belongs to its instrument: it changes nothing in this problem"
    return (*notes, f"the zero of {zeros} {why}") if zeros else notes


class Shown:
    """What the page of a run shows in addition to the front, where a problem provides it."""

    settings: Settings

    explained: ClassVar[Mapping[str, str]] = {}
    """By output without a derivative, the output whose derivative gives its contributions."""

    model_name: ClassVar[str] = ""
    """Which of several models of one thing the numbers are of; empty where there is one."""
    model_statement: ClassVar[str] = ""
    """The same in words, printed wherever the numbers appear."""

    def contact_verdict(self, designs: Array) -> tuple[str, ...]:
        """The exact contact's verdict on each full design (n, all variables), such as "keeps 1
        arcmin in 43 % of units"; empty where it is not asked.
        """
        return ()

    def model_labels(self, designs: Array) -> tuple[str, ...]:
        """The model that evaluates each full design (n, all variables), and the contact's verdict.

        Empty texts where there is only one model.
        """
        alone, verdicts = self.model_statement, self.contact_verdict(designs)
        if not alone or not verdicts:
            return (alone,) * len(designs)
        return tuple(f"{alone}; by contact this allocation {verdict}" for verdict in verdicts)

    def warnings(self) -> tuple[str, ...]:
        """What the user should know before trusting a run of this problem."""
        return ()

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """Remarks on the reported points; `front` has a row for each, as `frame` makes them."""
        return ()

    def bars(self) -> tuple[Bars, ...]:
        """Charts of what matters in this problem, whatever is optimised."""
        return ()

    def title(self) -> str:
        """The mechanism in words, for the heading of a page; empty where the name says it."""
        return self.settings.labels.name

    def mechanism(self) -> dict[str, object]:
        """What readers know the mechanism by, for pages, terminal and exports: `name`,
        `description`, `drawing`, as far as they are stated.
        """
        return {**replace(self.settings.labels, name=self.title()).stated()}

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        """The cost curve of a variable and how often it is paid, one for each way of making it.

        Empty where nothing is paid, or where what is paid is no function of the variable alone.
        """
        curve = self.settings.costs.get(name)
        return () if curve is None else ((curve, 1.0),)

    def validity(self) -> tuple[str, ...]:
        """Limits of validity of the model, a sentence each."""
        return ()

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
