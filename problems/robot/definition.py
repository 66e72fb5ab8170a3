"""What a configuration declares of a machine: links, and a reducer on each drive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...declarations import Variable
from ...models.costs import CostCurve
from ..declaration import Declaration
from ..reducers.nested import Nested
from .gears import Fitted, gear_variables
from .outputs import LIMITS, OBJECTIVES, outputs_of


@dataclass(frozen=True)
class Drive:
    """A drive with a reducer: `key` numbers it, drives of one `group` have reducers alike.

    Cost, backlash and transmission error are the reducer's times a factor each.
    """

    key: str
    reducer: Nested
    cost_factor: float = 1.0
    backlash_factor: float = 1.0
    te_factor: float = 1.0
    group: str = ""


class Definition(ABC):
    """Links and reducers of a machine."""

    nested: bool
    """Reducers enter by two numbers each; else every tolerance of them is a variable."""
    per_drive: bool
    """Reducers may differ; else all are alike."""

    @property
    @abstractmethod
    def drives(self) -> tuple[Drive, ...]:
        """The drives with a reducer, in the order of the machine's."""

    @property
    @abstractmethod
    def link_variables(self) -> tuple[Variable, ...]:
        """The variables of the links."""

    @property
    @abstractmethod
    def link_costs(self) -> Mapping[str, CostCurve]:
        """Their costs by name."""

    @property
    @abstractmethod
    def link_references(self) -> Mapping[str, float]:
        """Their usual standard deviations by name."""

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Names of the links' variables."""
        return tuple(v.name for v in self.link_variables)

    @cached_property
    def gears(self) -> Mapping[str, Nested]:
        """The reducers that have separate variables, by the key of their first drive."""
        first: dict[str, Drive] = {}
        for fitted in self.drives:
            first.setdefault(self._group(fitted), fitted)
        return {drive.key: drive.reducer for drive in first.values()}

    @cached_property
    def fitted(self) -> tuple[Fitted, ...]:
        """The gear of each drive, with its factors."""
        names = [self._group(drive) for drive in self.drives]
        order = list(dict.fromkeys(names))
        return tuple(
            Fitted(order.index(name), drive.cost_factor, drive.backlash_factor, drive.te_factor)
            for name, drive in zip(names, self.drives, strict=True)
        )

    def _group(self, drive: Drive) -> str:
        return (drive.group or f"drive {drive.key}") if self.per_drive else ""


def declaration_of(definition: Definition, **more: Any) -> Declaration:
    """Variables, outputs and cost curves of links and reducers; `more` fields as they are."""
    gears = gear_variables(definition.gears, definition.nested)
    variables = (*definition.link_variables, *gears)
    names = [v.name for v in variables if v.tolerance]
    drives = [drive.key for drive in definition.drives]
    return Declaration(
        variables,
        outputs_of(drives, definition.links, names),
        costs=dict(definition.link_costs),
        limits=LIMITS,
        objectives=OBJECTIVES,
        algorithm="exact",
        **more,
    )
