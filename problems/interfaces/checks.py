"""What `tolevo check` reports on a problem in addition to its assumptions and its faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...arrays import Array
from ...errors import Fault
from ..limits import impossible
from ..money import rising
from ..slips import unit_slips
from .base import Interface
from .page import Page

if TYPE_CHECKING:
    from ...models.capability import PartSample


class Checks(Interface):
    """Cautions, measured samples, and faults of designs and searches."""

    def cautions(self) -> tuple[str, ...]:
        """How the configuration was understood, and what the user should know before a run."""
        problem = self._problem
        settings = problem.settings
        slips = map(str, unit_slips(problem))
        departures = (
            text
            for variable in problem.variables
            if (sample := settings.variables[variable.name].sample)
            for text in sample.departures(variable.name)
        )
        prices = filter(None, (rising(name, curve) for name, curve in settings.costs.items()))
        return (*settings.notes, *slips, *prices, *departures, *Page.of(problem).warnings())

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        """Name and unit of each measured quantity, and its sample."""
        problem = self._problem
        return tuple(
            (variable.name, variable.unit, sample)
            for variable in problem.variables
            if (sample := problem.settings.variables[variable.name].sample)
        )

    def out_of_reach(self) -> list[Fault]:
        """Limits that no design can meet."""
        return impossible(self._problem)

    def search_faults(self) -> list[Fault]:
        """What is wrong with a search of the problem, though its designs can be evaluated."""
        return []

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        """Messages, by column and row, on designs that break more than variables' bounds."""
        return {}
