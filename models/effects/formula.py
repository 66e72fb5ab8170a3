"""An effect that a configuration states by its formula, which is parsed and never executed."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from ...section import Array
from ..expressions import Formula
from .effect import Action, Effect, EffectParameter, Measurements, Target, Values


class OfFormula(Effect):
    """Adds a formula of columns of the table to an output; its free letters are the parameters.

    The letters that it is linear in are linear parameters, the others have `bounds`. Columns are in
    the units of the table.
    """

    family = "own"
    of_rows = True

    def __init__(self, name: str, formula: Formula, letters: tuple[str, ...], stated: Mapping[str, Any]) -> None:
        self.name = name  # type: ignore[misc]
        self.cause = "Stated in the configuration."  # type: ignore[misc]
        self.formula = formula.text  # type: ignore[misc]
        self.tree = formula
        self.letters = letters
        self.stated_keys = dict(stated)
        self.linear_letters = linear_letters(formula, letters)

    def place(self, target: Target) -> None:
        """It never acts inside a model."""

    def own_applies(self, target: Target) -> bool:
        columns = {column.name for column in target.columns}
        return (
            set(self.tree.names) - {*self.letters} <= columns and bool(self._output(target)) and not target.population
        )

    def own_reason(self, target: Target) -> str:
        missing = set(self.tree.names) - {*self.letters} - {column.name for column in target.columns}
        return f"no column {', '.join(sorted(missing))}" if missing else super().own_reason(target)

    def _output(self, target: Target) -> str:
        """The output that it acts on, empty where the target has none of that name."""
        names = [output.name for output in target.outputs]
        wanted = self.stated_keys.get("output", names[0] if len(names) == 1 else "")
        return str(wanted) if wanted in names else ""

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        bounds = self.stated_keys.get("bounds", {})
        ends = {letter: bounds.get(letter, (-inf, inf)) for letter in self.letters}
        return tuple(
            EffectParameter(
                letter,
                "",
                f"{letter} of the formula",
                ends[letter][0],
                ends[letter][1],
                linear=letter in self.linear_letters,
            )
            for letter in self.letters
        )

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        names = set(self.tree.names) - {*self.letters}
        given: dict[str, Array] = {name: np.asarray(measurements.table[name], dtype=float) for name in names}
        given |= {letter: np.asarray(values.get(letter, 0.0), dtype=float) for letter in self.letters}
        whole = np.broadcast_to(self.tree.value(given), (len(measurements),))
        return Action(output={self._output(target): np.asarray(whole, dtype=float)})

    def stated(self) -> dict[str, Any]:
        return {"formula": self.tree.text, **self.stated_keys}


def linear_letters(formula: Formula, letters: tuple[str, ...]) -> tuple[str, ...]:
    """The letters in which a formula is linear together, as it is written."""
    constant = dict.fromkeys(formula.names, 0.0)
    linear: list[str] = []
    for letter in letters:
        if formula.degree({**constant, **dict.fromkeys([*linear, letter], 1.0)}) <= 1.0:
            linear.append(letter)
    return tuple(linear)
