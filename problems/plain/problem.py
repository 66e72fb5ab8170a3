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
from .declared import MISSED, declaration_of, limits_of, mixed_designs, mixed_variables, names_of

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
        self._known: dict[tuple[float, ...], Array] = {}
        super().__init__(settings)

    def _completed(self, given: Settings) -> Settings:
        missed = number(given.parameters.get(MISSED.name, MISSED.default))
        limits = dict(limits_of(self.pymoo_problem, missed)) | dict(given.limits)
        return super()._completed(replace(given, limits=limits))

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        names = [name for group in names_of(self.pymoo_problem).values() for name in group]
        if not all(variable.integer for variable in self.variables):
            return dict(zip(names, self._evaluated(designs).T, strict=True))
        keys = list(map(tuple, designs.tolist()))  # designs of whole numbers come again and again
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        if new:
            self._known.update(zip(new, self._evaluated(np.array(new)), strict=True))
        values = np.array([self._known[key] for key in keys]).reshape(len(keys), len(names))
        return dict(zip(names, values.T, strict=True))

    def _evaluated(self, designs: Array) -> Array:
        """Objectives and constraints (n, all) of designs (n, variables), by pymoo's problem."""
        x = mixed_designs(self.pymoo_problem, designs) if mixed_variables(self.pymoo_problem) else designs
        values = self.pymoo_problem.evaluate(x, return_as_dictionary=True)
        used = [key for key, names in names_of(self.pymoo_problem).items() if names]
        return np.concatenate([np.asarray(values[key], dtype=float).reshape(len(x), -1) for key in used], axis=1)

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
