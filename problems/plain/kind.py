"""What a configuration that names a plain pymoo problem declares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from pymoo.core.problem import Problem

from ...declarations import Output, Parameter, Variable
from ...errors import raise_all, refuse
from ...models.costs import CostCurve
from ...section import Section
from ..settings import Settings
from .declared import faults_of, objectives_of, outputs_of, parameters_of, variables_of
from .problem import PlainProblem


@dataclass(frozen=True, eq=False)
class PlainKind:
    """A pymoo problem as a configuration sees it; called with settings, it makes the problem."""

    own: Problem
    default_costs: ClassVar[Mapping[str, CostCurve]] = {}
    default_model: ClassVar[str] = ""
    default_algorithm: ClassVar[str] = ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The tolerance of equality constraints, where there are any."""
        return parameters_of(self.own)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """One variable per column of X."""
        return variables_of(self.own)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Objectives and constraints."""
        return outputs_of(self.own)

    @property
    def default_objectives(self) -> tuple[str, ...]:
        """All objectives."""
        return objectives_of(self.own)

    def configured(self, top: Section) -> PlainKind:
        """Itself: its declarations do not depend on the configuration."""
        return self

    def __call__(self, settings: Settings) -> PlainProblem:
        return PlainProblem(self.own, settings)


def plain_kind(given: Any) -> PlainKind:
    """The kind of a pymoo problem, or of a class of them that is made without arguments.

    Raises InputError, at `problem`, where it is none or cannot be run.
    """
    name = given.__name__ if isinstance(given, type) else type(given).__name__
    if isinstance(given, type) and issubclass(given, Problem):
        try:
            given = given()
        except TypeError as error:
            text = f"{name} cannot be made without arguments ({error}): give an object instead"
            raise refuse("problem", text) from error
    if not isinstance(given, Problem):
        text = f"{name} is no problem: it must be a ToleranceProblem or a pymoo Problem"
        raise refuse("problem", text)
    raise_all(faults_of(given))
    return PlainKind(given)
