"""The definition of a machine that a configuration of `robot_joint` states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...declarations import Value, Variable, completed, number
from ...models.costs import CostCurve
from ..pose_accuracy.grouping import Grouping, costs_of
from ..reducers.documents import documents_reducer
from ..reducers.nested import Nested
from ..robot import definition
from ..robot.definition import Drive
from .links import TWENTY_ONE, reference_of, variables_of
from .outputs import PARAMETERS


@dataclass(frozen=True)
class Definition(definition.Definition):
    """Grouping of the links' errors, the reducers of drives 1 and 2, and how they enter."""

    grouping: Grouping
    reducers: tuple[Nested, ...]
    nested: bool = True
    per_drive: bool = True

    @property
    def drives(self) -> tuple[Drive, ...]:
        return tuple(Drive(str(at), reducer) for at, reducer in enumerate(self.reducers, 1))

    @property
    def link_variables(self) -> tuple[Variable, ...]:
        return variables_of(self.grouping)

    @property
    def link_costs(self) -> Mapping[str, CostCurve]:
        return costs_of(self.grouping, reference_of)

    @property
    def link_references(self) -> Mapping[str, float]:
        return {name: reference_of(sources[0]) for name, sources in self.grouping.items()}


def default_definition(parameters: Mapping[str, Value]) -> Definition:
    """Links in 21 kinds, and reducers of document B."""
    given = completed(PARAMETERS, parameters)
    return Definition(
        TWENTY_ONE, (documents_reducer(),) * 2, bool(number(given["nested"])), bool(number(given["per_drive"]))
    )
