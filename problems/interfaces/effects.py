"""What physical effects change in a problem."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from .base import Interface

if TYPE_CHECKING:
    from ..tolerance_problem import ToleranceProblem


class WithEffects(Interface):
    """A problem in whose model effects of measured machines have a place."""

    def counterparts(self) -> tuple[str, ...]:
        """What each active effect does in this problem, in words; empty where it does nothing."""
        return ("",) * len(self._problem.settings.effects)

    def without_effects(self) -> ToleranceProblem:
        """The same problem with no effect in its model."""
        problem = self._problem
        return type(problem)(replace(problem.given, effects=()))

    def effect_notes(self) -> tuple[str, ...]:
        """A sentence for each active effect, those without a counterpart included."""
        settings = self._problem.settings
        missing = "has no counterpart in this problem: it changes nothing here"
        notes = tuple(
            f"effect {effect.effect.name}: {does}" if does else f"effect {effect.effect.name} {missing}"
            for effect, does in zip(settings.effects, self.counterparts(), strict=True)
        )
        zeros = ", ".join(settings.zero)
        why = "belongs to its instrument: it changes nothing in this problem"
        return (*notes, f"the zero of {zeros} {why}") if zeros else notes
