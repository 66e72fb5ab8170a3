"""A plain pymoo problem with names, limits and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pymoo.core.problem import Problem

from ...arrays import Array
from ...declarations import number
from ..interfaces import WithEffects
from ..settings import Bound, Settings
from ..tolerance_problem import ToleranceProblem
from .declared import MISSED, declaration_of, limits_of, names_of

SPREAD = 6
"""Binary logarithm of the designs whose objectives span the box of the hypervolume."""


class PlainProblem(ToleranceProblem, WithEffects):
    """A pymoo `Problem` as it is: its objectives are minimised, its constraints are limits.

    Names and units are x1, ..., f1, ..., g1, ..., h1, ... without units unless the problem declares
    `variables` and `outputs` (tuples of `Variable` and `Output`). It needs no cost. Nothing is
    proven of it.
    """

    def __init__(self, pymoo_problem: Problem, settings: Settings | None = None) -> None:
        self.pymoo_problem = pymoo_problem
        self.declaration = declaration_of(pymoo_problem)
        super().__init__(settings)

    def _completed(self, given: Settings) -> Settings:
        missed = number(given.parameters.get(MISSED.name, MISSED.default))
        limits = dict(limits_of(self.pymoo_problem, missed)) | dict(given.limits)
        return super()._completed(replace(given, limits=limits))

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        evaluated = self.pymoo_problem.evaluate(designs, return_as_dictionary=True)
        return {
            name: column
            for key, names in names_of(self.pymoo_problem).items()
            if names
            for name, column in zip(names, np.asarray(evaluated[key], dtype=float).T, strict=True)
        }

    def _corners(self) -> Array:
        """The corners, and designs between them: extremes need not lie at the corners."""
        from scipy.stats import qmc  # takes long to import

        inside = qmc.Sobol(len(self.free), scramble=False).random_base2(SPREAD)
        between = self.complete(self.xl + inside * (self.xu - self.xl))
        return np.concatenate([super()._corners(), between])

    def relaxed(self, limits: Mapping[str, Bound]) -> PlainProblem:
        """The same problem with some limits replaced."""
        return PlainProblem(self.pymoo_problem, replace(self.given, limits={**self.given.limits, **limits}))

    def without_effects(self) -> PlainProblem:
        """The same problem: effects have no place in it."""
        return PlainProblem(self.pymoo_problem, replace(self.given, effects=()))
