"""What a configuration that names a plain pymoo problem declares."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from pymoo.core.problem import Problem

from ...errors import raise_all, refuse
from ...section import Section
from ..declaration import ConfiguredProblem, Declaration
from .declared import declaration_of, faults_of
from .problem import PlainProblem


@dataclass(frozen=True, eq=False)
class PlainKind:
    """A pymoo problem in the place of a class of problems."""

    pymoo_problem: Problem

    @property
    def declaration(self) -> Declaration:
        """Variables, outputs and objectives as the problem declares them."""
        return declaration_of(self.pymoo_problem)

    def configured(self, top: Section) -> ConfiguredProblem:
        """The problem: it reads no further table."""
        return ConfiguredProblem(self.declaration, partial(PlainProblem, self.pymoo_problem))


def plain_kind(given: Any) -> PlainKind:
    """The kind of a pymoo problem, or of a class of them that is made without arguments.

    Raises InputError, at `problem`, where it is none or cannot be run.
    """
    name = given.__name__ if isinstance(given, type) else type(given).__name__
    if isinstance(given, type) and issubclass(given, Problem):
        try:
            given = given()
        except Exception as error:  # code of a foreign class
            text = f"{name} cannot be made without arguments ({type(error).__name__}: {error}): give an object"
            raise refuse("problem", text) from error
    if not isinstance(given, Problem):
        raise refuse("problem", f"{name} is no problem: it must be a ToleranceProblem or a pymoo Problem")
    raise_all(faults_of(given))
    return PlainKind(given)
