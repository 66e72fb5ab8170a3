"""What the page of a run shows of a problem in addition to the front."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...records import Bars
from .base import Interface

if TYPE_CHECKING:
    import pandas as pd


class Page(Interface):
    """Title, charts and remarks of a problem."""

    def title(self) -> str:
        """The mechanism in words, for the heading of a page; empty where the name says it."""
        return self._problem.settings.labels.name

    def mechanism(self) -> dict[str, object]:
        """What readers know the mechanism by, for pages, terminal and exports: `name`,
        `description`, `drawing`, as far as they are stated.
        """
        return {**replace(self._problem.settings.labels, name=self.title()).stated()}

    def sketch(self) -> dict[str, Any]:
        """A drawing of the machine: `parts`, each a `name`, `points` [mm] of a line, and the
        columns of a front that are its shares; `poses` [mm]. Empty where there is none.
        """
        return {}

    def bars(self) -> tuple[Bars, ...]:
        """Charts of what matters in this problem, whatever is optimised."""
        return ()

    def warnings(self) -> tuple[str, ...]:
        """What the user should know before trusting a run of this problem."""
        return ()

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """Remarks on the reported points; `front` has a row for each, as `frame` makes them."""
        return ()

    def validity(self) -> tuple[str, ...]:
        """Limits of validity of the model, a sentence each."""
        return ()
