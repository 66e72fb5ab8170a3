"""Limits on outputs: the one rule when they are kept, their normalised violation and their margin."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import Fault
from ..section import Array, Flags, Integers, Output, Variable
from .settings import Bound

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem

LIMIT_ROUNDING = 1e-9
"""Fraction of a limit by which a value may lie beyond it and keep it: what is met exactly is met to
rounding only (0.1 + 0.2 lies beyond 0.3), and a real excess is larger.
"""
DIGITS = 16.0 * float(np.finfo(float).eps)
"""Rounding of a fraction of all units."""


EQUAL = 1e-12
"""Relative difference up to which two values are equal but for rounding."""


SOLVED = 1e-6
"""Relative difference by which values differ at most that are equal but for the tolerance of a solver."""


def descending(values: Array) -> Integers:
    """Rows of values (n,) from the largest to the least; equal ones as they come, on every processor."""
    order = np.argsort(-values, kind="stable")
    rounding = EQUAL * np.max(np.abs(values), where=np.isfinite(values), initial=0.0)
    falls = ~np.isclose(values[order][1:], values[order][:-1], rtol=SOLVED, atol=rounding, equal_nan=True)
    level = np.concatenate([[0], np.cumsum(falls)])[: len(order)]
    return np.asarray(order[np.lexsort([order, level])])


def apart(low: Array, high: Array) -> Array:
    """The upper ends (n,) of ranges that no rounding empties: those of equal ends lie a little above."""
    size = np.maximum(np.abs(low), np.abs(high))
    return np.maximum(high, low + EQUAL * np.where(size > 0.0, size, 1.0))


def loosened(upper: Array | float, part: float = 1.0) -> Array:
    """Upper limits, any shape, wider by a `part` of the room that rounding has."""
    finite = np.isfinite(upper)
    return np.asarray(np.where(finite, upper + part * LIMIT_ROUNDING * np.abs(np.where(finite, upper, 0.0)), upper))


def keeps(value: Array | float, upper: Array | float) -> Flags:
    """Whether values keep upper limits; both broadcast."""
    return np.asarray(value <= loosened(upper))


def overlap(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float] | None:
    """The common part of two ranges, None where there is none; ends that meet to rounding do meet.

    There it is the end of the first.
    """
    low, high = max(first[0], second[0]), min(first[1], second[1])
    if low > high:
        if low - high > LIMIT_ROUNDING * max(abs(low), abs(high)):
            return None
        low = high = first[0] if first[0] == low else first[1]
    return low, high


@dataclass(frozen=True, slots=True)
class Limit:
    """low <= `name` <= high; `scale` normalises where the bound is 0.

    `most` is the largest value that there is: close to it, as in a yield, little is missing of it,
    and the room of rounding is a fraction of that.
    """

    name: str
    low: float
    high: float
    scale: float
    unit: str
    most: float = np.inf

    @property
    def count(self) -> int:
        """Number of inequality constraints."""
        return int(np.isfinite(self.low)) + int(np.isfinite(self.high))

    @property
    def of_percentage(self) -> bool:
        """Whether the output is a percentage."""
        return self.unit in ("percent", "%")

    def _by(self, bound: float) -> float:
        return abs(bound) if bound != 0.0 else self.scale

    def room(self, bound: float) -> float:
        """By how much a value may lie beyond a bound and keep it; inf at no bound."""
        size = self._by(bound)
        if np.isfinite(self.most):
            return max(LIMIT_ROUNDING * min(size, abs(self.most - bound)), DIGITS * abs(self.most))
        return LIMIT_ROUNDING * size

    def _excess(self, value: Array) -> list[tuple[Array, float]]:
        """By how much values lie beyond each finite bound, 0 where rounding explains it; the bound."""
        columns = []
        for sign, bound in ((-1.0, self.low), (1.0, self.high)):
            if np.isfinite(bound):
                beyond = sign * (np.asarray(value, dtype=float) - bound)
                columns.append((np.where(beyond <= self.room(bound), np.minimum(beyond, 0.0), beyond), bound))
        return columns

    def violations(self, value: Array) -> list[Array]:
        """One column (n,) per bound, above 0 where it is broken, normalised by the bound."""
        return [excess / self._by(bound) for excess, bound in self._excess(value)]

    def kept(self, value: Array) -> Flags:
        """Whether values (n,) keep the limit."""
        kept = [excess <= 0.0 for excess, _ in self._excess(value)]
        return np.asarray(np.all(kept, axis=0)) if kept else np.ones(np.shape(value), dtype=bool)

    def slopes(self) -> list[float]:
        """Derivative of each column of `violations` by the value."""
        derivatives = []
        if np.isfinite(self.low):
            derivatives.append(-1.0 / self._by(self.low))
        if np.isfinite(self.high):
            derivatives.append(1.0 / self._by(self.high))
        return derivatives

    def margins(self, value: Array) -> dict[str, Array]:
        """Distance to the nearest bound in the unit of the output, negative where broken, 0 to rounding."""
        columns = [np.where(np.abs(excess) <= self.room(bound), 0.0, -excess) for excess, bound in self._excess(value)]
        return {f"margin_{self.name}": np.min(columns, axis=0) + 0.0} if columns else {}


def limits_of(
    bounds: Mapping[str, Bound], outputs: tuple[Output, ...], variables: tuple[Variable, ...]
) -> tuple[Limit, ...]:
    """The limits on outputs and variables by name."""
    scales = {o.name: (o.scale, o.unit, o.high) for o in outputs}
    scales |= {v.name: (v.high - v.low, v.unit, np.inf) for v in variables}
    return tuple(Limit(name, bound.low, bound.high, *scales[name]) for name, bound in bounds.items())


def narrow_range(limits: Iterable[Limit], name: str, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
    """The range from `low` to `high` of an output or variable within the limits on it."""
    ends = [(limit.low, limit.high) for limit in limits if limit.name == name]
    return max([low, *(end[0] for end in ends)]), min([high, *(end[1] for end in ends)])


def unreachable_limit_faults(problem: ToleranceProblem) -> list[Fault]:
    """A fault for each limit that no design of the search space can meet, with the nearest miss."""
    faults = []
    for limit in problem.limits:
        low, high = problem.interval(limit.name)
        corner = "loosest" if limit.name in problem.cost_names else "tightest"
        place, unit = f"limits.{limit.name}", f" {limit.unit}".rstrip()
        if low - limit.high > limit.room(limit.high):
            faults.append(
                Fault(
                    place,
                    f"at most {limit.high:g}{unit} cannot be met: the best that the {corner} corner allows is "
                    f"{low:.4g}{unit}, {low - limit.high:.3g}{unit} too much; raise the limit or widen the ranges",
                )
            )
        if limit.low - high > limit.room(limit.low):
            faults.append(
                Fault(
                    place,
                    f"at least {limit.low:g}{unit} cannot be met: the best that the {corner} corner allows is "
                    f"{high:.4g}{unit}, {limit.low - high:.3g}{unit} too little; lower the limit or widen the ranges",
                )
            )
    return faults
