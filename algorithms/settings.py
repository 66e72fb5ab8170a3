"""Settings that algorithms share, and the interface of an algorithm plugin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import Fault

if TYPE_CHECKING:
    import numpy as np

    from ..problems.tolerance_problem import ToleranceProblem
    from .engine import ArrayEngine, Space
    from .run import Run


@dataclass(frozen=True, slots=True)
class Budget:
    """When a search ends: whichever comes first. An evaluation budget is honoured exactly."""

    generations: int | None = None
    evaluations: int | None = None
    time_limit_s: float | None = None


CROSSOVERS = ("sbx", "uniform", "one_point", "two_point")
MUTATIONS = ("polynomial", "gaussian")


@dataclass(frozen=True, slots=True)
class Crossover:
    """Crossover: probability per mating, and for simulated binary crossover the index eta.

    The other operators exchange whole variables of the parents.
    """

    probability: float = field(default=0.9, metadata={"low": 0.0, "high": 1.0})
    eta: float = field(default=15.0, metadata={"low": 0.0})
    operator: str = field(default=CROSSOVERS[0], metadata={"choices": CROSSOVERS})


@dataclass(frozen=True, slots=True)
class Mutation:
    """Mutation: probability per variable, and for polynomial mutation the index eta.

    Gaussian mutation has a standard deviation of a tenth of the variable's range.
    """

    probability: float = field(default=0.1, metadata={"low": 0.0, "high": 1.0})
    eta: float = field(default=20.0, metadata={"low": 0.0})
    operator: str = field(default=MUTATIONS[0], metadata={"choices": MUTATIONS})


class AlgorithmSettings(ABC):
    """An algorithm plugin: a frozen dataclass of settings that builds a fresh pymoo algorithm."""

    many_objectives: ClassVar[bool]
    """Whether it returns a front; else it takes exactly one objective."""
    one_objective: ClassVar[bool] = False
    """Whether one that returns fronts takes a single objective as well."""
    array_engine: ClassVar[bool] = False
    """Whether `engine` builds an array engine of it."""
    state: ClassVar[tuple[str, ...]] = ()
    """Attributes of the pymoo algorithm (dotted names; arrays, numbers or None) that its next
    generation depends on, besides the population, what is stored with each individual, and the
    generator: a resumed run is bit-equal where these are all."""
    extras: ClassVar[tuple[str, ...]] = ()
    """Extras of the distribution that must be installed for it."""

    def faults(self, objectives: int) -> list[Fault]:
        """What is wrong with the settings as a whole; the place of a fault is the key."""
        return []

    @abstractmethod
    def build(self, problem: ToleranceProblem) -> Any:
        """A pymoo `Algorithm` with operators of its own, not yet set up."""

    def engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        """The algorithm on plain arrays, where `array_engine` says that there is one."""
        raise TypeError(f"{type(self).__name__} has no array engine")


class Solver(AlgorithmSettings):
    """An algorithm that is no population search: it drives the evaluations itself."""

    @abstractmethod
    def solve(self, run: Run) -> None:
        """Evaluate designs by `run.evaluate` until the front is found; these are the result.

        It must depend on `run` alone: a broken run is resumed from its beginning.
        """

    def build(self, problem: ToleranceProblem) -> Any:
        raise TypeError(f"{type(self).__name__} is no pymoo algorithm: it drives the evaluations")
