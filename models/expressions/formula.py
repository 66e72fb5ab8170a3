"""A formula: its text and its tree, evaluated over whole batches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...arrays import Array
from .functions import KINKED
from .parser import parse
from .tree import Call, Expression, Name


@dataclass(frozen=True)
class Formula:
    """An expression in named quantities, parsed and never executed.

    It may hold + - * / **, parentheses, numbers, pi, names and the functions of `FUNCTIONS`.
    Raises FormulaError (a ValueError) with the column where the text is something else.
    """

    text: str
    tree: Expression = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tree", parse(self.text))

    @cached_property
    def names(self) -> dict[str, int]:
        """The quantities that the formula depends on, each with the column of its first use."""
        positions: dict[str, int] = {}
        for node in self.tree.nodes():
            if isinstance(node, Name):
                positions[node.name] = min(node.at, positions.get(node.name, node.at))
        return positions

    @property
    def kinked(self) -> bool:
        """Whether it calls a function that has a kink."""
        return any(isinstance(node, Call) and node.function in KINKED for node in self.tree.nodes())

    @property
    def linear(self) -> bool:
        """Whether it is linear in its names as written: simplifications do not count."""
        return self.tree.degree <= 1.0

    def value(self, x: Mapping[str, Array]) -> Array:
        """The value at quantities that broadcast; NaN or infinite where it is not defined."""
        with np.errstate(all="ignore"):
            return _value(self.tree, x)

    def gradient(self, x: Mapping[str, Array]) -> dict[str, Array]:
        """Partial derivatives by name, exact to rounding (forward mode), at one or many points."""
        with np.errstate(all="ignore"):
            value, slopes = _dual(self.tree, x)
        return {name: np.broadcast_to(slope, value.shape) for name, slope in slopes.items()}

    def trouble(self, x: Mapping[str, Array]) -> str:
        """Where and why the formula has no value, empty where it has one everywhere.

        The quantities (m,) sample a connected set: between two samples of different sign a divisor
        is zero somewhere, even if no sample hits it.
        """
        with np.errstate(all="ignore"):
            return _trouble(self.tree, x)[1]


def _value(node: Expression, x: Mapping[str, Array]) -> Array:
    return node.value([_value(part, x) for part in node.parts], x)


def _dual(node: Expression, x: Mapping[str, Array]) -> tuple[Array, dict[str, Array]]:
    """Value and partial derivatives of a node; an omitted name has the derivative 0."""
    if isinstance(node, Name):
        return node.value((), x), {node.name: np.asarray(1.0)}
    below = [_dual(part, x) for part in node.parts]
    values = [value for value, _ in below]
    derivatives: dict[str, Array] = {}
    if any(inner for _, inner in below):
        for outer, (_, inner) in zip(node.slopes(values), below, strict=True):
            for name, slope in inner.items():
                derivatives[name] = derivatives.get(name, np.asarray(0.0)) + outer * slope
    return node.value(values, x), derivatives


def _trouble(node: Expression, x: Mapping[str, Array]) -> tuple[Array, str]:
    """Value of a node, and why it or a node below it has no value; empty where all have one."""
    below = []
    for part in node.parts:
        value, reason = _trouble(part, x)
        if reason:
            return value, reason
        below.append(value)
    value, reason = node.value(below, x), node.trouble(below)
    if not reason and not np.all(np.isfinite(value)):
        reason = "the value is not finite"
    return value, f"column {node.at}: {reason}" if reason else ""
