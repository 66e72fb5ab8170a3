"""The toleranced inputs of a unit of a population, as far as a model can name them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .inputs.distribution import Distribution
from .propagation import ClippedSum, Term


@dataclass(frozen=True, slots=True)
class Source:
    """One toleranced input of a unit.

    `part` says what is measured on parts. `tolerance` is the half-width of its zone, `law` the
    distribution in it, and `per_unit` what one `unit` of it adds to the sum. `clipped` is whether
    it acts in the clipped part, `at` its place in that part. A zone `from_zero` grows from its
    lower end at zero.
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
    """Whether units are moved by an error that all of them have alike."""


@dataclass(frozen=True, slots=True)
class Sources:
    """The inputs of the one output of a population: that output is `total`/`unit`, one design.

    Where inputs of the clipped part do not add up, that part is one term of them all, `widened`
    gives it with the zone of one of them by a factor as wide, and `basis` says how inputs are then
    compared.
    """

    total: ClippedSum
    unit: float
    inputs: tuple[Source, ...]
    widened: Callable[[Source, float], Term] | None = None
    basis: str = ""

    def term(self, source: Source) -> Term:
        """What an input contributes."""
        return (self.total.clipped if source.clipped else self.total.free)[source.at]
