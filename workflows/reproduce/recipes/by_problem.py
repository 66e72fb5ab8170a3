"""Outputs of a problem at a design."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....declarations import number
from ....problems.interfaces import Accuracy
from ....problems.tolerance_problem import ToleranceProblem
from ..calculation import Quantity
from .recipe import Recipe, Recomputed, continuous


@dataclass(frozen=True)
class ByProblem(Recipe):
    """Outputs of a problem at one full design, in the order of its variables."""

    name: str
    problem: ToleranceProblem
    design: tuple[float, ...]
    outputs: tuple[str, ...]

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        whole = Accuracy.of(self.problem).reported().outputs_of(np.array([self.design]))
        errors = {output.error_of: output.name for output in self.problem.outputs if output.error_of}
        units = {output.name: output.unit for output in self.problem.outputs}
        return Recomputed(
            tuple(
                Quantity(
                    float(whole[name][0]), units[name] or "1", float(whole[errors[name]][0]) if name in errors else 0.0
                )
                for name in self.outputs
            )
        )

    @property
    def by(self) -> str:
        return f"problem {self.name}"

    def shift_units(self) -> dict[str, str | None]:
        variables = {variable.name: variable.unit for variable in self.problem.variables}
        return variables | continuous(self.problem.declaration.parameters)

    def shifted(self, name: str, step: float) -> ByProblem:
        if name in self.problem.names:
            at = self.problem.names.index(name)
            return replace(self, design=(*self.design[:at], self.design[at] + step, *self.design[at + 1 :]))
        settings = self.problem.given
        parameters = dict(settings.parameters) | {name: number(self.problem.settings.parameters[name]) + step}
        return replace(self, problem=type(self.problem)(replace(settings, parameters=parameters)))
