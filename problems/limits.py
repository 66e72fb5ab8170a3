"""Limits on outputs: their normalised violation, their margin, and when they cannot be met."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..declarations import Output, Variable
from ..errors import Fault
from .settings import Bound

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class Limit:
    """low <= `name` <= high; `scale` normalises where the bound is 0."""

    name: str
    low: float
    high: float
    scale: float
    unit: str

    @property
    def count(self) -> int:
        """Number of inequality constraints."""
        return int(np.isfinite(self.low)) + int(np.isfinite(self.high))

    def _by(self, bound: float) -> float:
        return abs(bound) if bound != 0.0 else self.scale

    def violations(self, value: Array) -> list[Array]:
        """One column (n,) per bound, above 0 where it is broken, normalised by the bound."""
        columns = []
        if np.isfinite(self.low):
            columns.append((self.low - value) / self._by(self.low))
        if np.isfinite(self.high):
            columns.append((value - self.high) / self._by(self.high))
        return columns

    def slopes(self) -> list[float]:
        """Derivative of each column of `violations` by the value."""
        derivatives = []
        if np.isfinite(self.low):
            derivatives.append(-1.0 / self._by(self.low))
        if np.isfinite(self.high):
            derivatives.append(1.0 / self._by(self.high))
        return derivatives

    def margins(self, value: Array) -> dict[str, Array]:
        """Distance to the nearest bound in the unit of the output, negative where broken."""
        if not self.count:
            return {}
        return {f"margin_{self.name}": np.minimum(value - self.low, self.high - value)}


def limits_of(
    bounds: Mapping[str, Bound], outputs: tuple[Output, ...], variables: tuple[Variable, ...]
) -> tuple[Limit, ...]:
    """The limits on outputs and variables by name."""
    scales = {o.name: (o.scale, o.unit) for o in outputs}
    scales |= {v.name: (v.high - v.low, v.unit) for v in variables}
    return tuple(Limit(name, bound.low, bound.high, *scales[name]) for name, bound in bounds.items())


def narrowed(limits: Iterable[Limit], name: str, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
    """The range from `low` to `high` of an output or variable within the limits on it."""
    ends = [(limit.low, limit.high) for limit in limits if limit.name == name]
    return max([low, *(end[0] for end in ends)]), min([high, *(end[1] for end in ends)])


def impossible(problem: ToleranceProblem) -> list[Fault]:
    """A fault for each limit that no design of the search space can meet, with the nearest miss."""
    faults = []
    for limit in problem.limits:
        low, high = problem.interval(limit.name)
        corner = "loosest" if limit.name == "cost" else "tightest"
        place, unit = f"limits.{limit.name}", f" {limit.unit}".rstrip()
        if limit.high < low:
            faults.append(
                Fault(
                    place,
                    f"at most {limit.high:g}{unit} cannot be met: the best that the {corner} corner allows is "
                    f"{low:.4g}{unit}, {low - limit.high:.3g}{unit} too much; raise the limit or widen the ranges",
                )
            )
        if limit.low > high:
            faults.append(
                Fault(
                    place,
                    f"at least {limit.low:g}{unit} cannot be met: the best that the {corner} corner allows is "
                    f"{high:.4g}{unit}, {limit.low - high:.3g}{unit} too little; lower the limit or widen the ranges",
                )
            )
    return faults
