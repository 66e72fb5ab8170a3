"""The toleranced inputs of a unit of a population, as far as a model has them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .inputs.distribution import Distribution
from .propagation import ClippedSum, Term


@dataclass(frozen=True, slots=True)
class Source:
    """A toleranced input of a unit.

    `part` describes the quantity that is measured on parts. `tolerance` is the half-width of its
    zone, `law` the distribution in it, and `per_unit` the change of the sum per `unit` of it.
    `clipped` is whether it acts in the clipped part, `at` its place in that part. A zone
    `from_zero` grows from its lower end at zero.
    """

    name: str
    unit: str
    part: str
    tolerance: float
    per_unit: float
    clipped: bool
    at: int
    law: Distribution
    from_zero: bool = False
    widest: float = float("inf")
    """The largest factor on its half-width about its middle that is physical."""
    moves: bool = True
    """Whether an error common to all units moves them."""


@dataclass(frozen=True, slots=True)
class Sources:
    """The inputs of the single output of a population: it is `total`/`unit`, for one design.

    Where inputs of the clipped part do not add up, that part is a single term of all of them;
    `widened` returns it with the zone of an input widened by a factor, and `basis` states how
    inputs are then compared.
    """

    total: ClippedSum
    unit: float
    inputs: tuple[Source, ...]
    widened: Callable[[Source, float], Term] | None = None
    basis: str = ""

    def term(self, source: Source) -> Term:
        """The contribution of an input."""
        return (self.total.clipped if source.clipped else self.total.free)[source.at]
