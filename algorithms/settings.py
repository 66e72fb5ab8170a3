"""Settings that algorithms share, and the interface of an algorithm plugin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import Fault

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class Budget:
    """When a search ends: whichever comes first. An evaluation budget is honoured exactly."""

    generations: int | None = None
    evaluations: int | None = None
    time_limit_s: float | None = None


@dataclass(frozen=True, slots=True)
class Crossover:
    """Simulated binary crossover: probability per mating, distribution index eta."""

    probability: float = field(default=0.9, metadata={"low": 0.0, "high": 1.0})
    eta: float = field(default=15.0, metadata={"low": 0.0})


@dataclass(frozen=True, slots=True)
class Mutation:
    """Polynomial mutation: probability per variable, distribution index eta."""

    probability: float = field(default=0.1, metadata={"low": 0.0, "high": 1.0})
    eta: float = field(default=20.0, metadata={"low": 0.0})


class AlgorithmSettings(ABC):
    """An algorithm plugin: a frozen dataclass of settings that builds a fresh pymoo algorithm."""

    many_objectives: ClassVar[bool]
    """Whether it returns a front; else it takes exactly one objective."""
    state: ClassVar[tuple[str, ...]] = ()
    """Attributes of the pymoo algorithm, dotted, that a generation leaves to the next.

    Beside the population (X, F, G, rank, crowding) and the generator: with these it goes on
    bit-equal. A value may be None.
    """
    extras: ClassVar[tuple[str, ...]] = ()
    """Extras of the distribution that must be installed for it."""

    def faults(self, objectives: int) -> list[Fault]:
        """What is wrong with the settings as a whole; the place of a fault is the key."""
        return []

    @abstractmethod
    def build(self, problem: ToleranceProblem) -> Any:
        """A pymoo `Algorithm` with operators of its own, not yet set up."""
