"""Costs of the parts of a stack."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array, Integers
from ...models.costs.joint import Joint
from .definition import Part


@dataclass(frozen=True, eq=False)
class PartCosts:
    """Costs of `parts`, each made by one of its processes; tolerances t have shape (n, parts)."""

    parts: tuple[Part, ...]

    def by_part(self, t: Array, chosen: Integers, slope: bool = False) -> Array:
        """Cost, or its slope, of every part (n, parts) by the processes chosen (n, parts)."""
        if self._joint is not None and not slope:
            with np.errstate(divide="ignore"):
                return self._joint.cost(t) * self._counts
        costs = np.zeros_like(t)
        for at, part in enumerate(self.parts):
            for number, process in enumerate(part.processes):
                rows = chosen[:, at] == number
                if process.curve is not None and np.any(rows):
                    curve = process.curve.slope if slope else process.curve.cost
                    with np.errstate(divide="ignore", invalid="ignore"):
                        costs[rows, at] = part.count * curve(t[rows, at])
        return costs

    @cached_property
    def interval(self) -> tuple[float, float]:
        """Least and largest cost: every part in its cheapest and its most expensive process."""
        ends = np.zeros(2)
        for part in self.parts:
            costs = [
                process.curve.cost(np.array([process.high, process.low]))
                for process in part.processes
                if process.curve is not None
            ]
            if costs:
                ends += part.count * np.array([np.min(costs), np.max(costs)])
        return float(ends[0]), float(ends[1])

    @cached_property
    def _joint(self) -> Joint | None:
        """The curves of all parts as one, where each has one and there are no alternatives."""
        curves = [part.processes[0].curve for part in self.parts if not part.alternatives]
        known = [curve for curve in curves if curve is not None]
        return Joint.of(known) if len(known) == len(self.parts) else None

    @cached_property
    def _counts(self) -> Array:
        return np.array([float(part.count) for part in self.parts])
