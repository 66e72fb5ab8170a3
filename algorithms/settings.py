"""Settings that algorithms share, and the interface of an algorithm plugin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..counts import INDIVIDUALS
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
    generation depends on, in addition to the population, the data of every individual, and the
    generator: a resumed run is equal to the bit where these are all."""
    extras: ClassVar[tuple[str, ...]] = ()
    """Extras of the distribution that must be installed for it."""

    def faults(self, objectives: int) -> list[Fault]:
        """The faults of the settings as a whole; the place of a fault is the key."""
        return []

    @abstractmethod
    def build(self, problem: ToleranceProblem) -> Any:
        """A pymoo `Algorithm` with its own operators, not yet set up."""

    def engine(self, space: Space, rng: np.random.Generator) -> ArrayEngine:
        """The algorithm on plain arrays, where `array_engine` states that it exists."""
        raise TypeError(f"{type(self).__name__} has no array engine")


@dataclass(frozen=True, slots=True)
class Genetic(AlgorithmSettings):
    """A genetic algorithm for two or more objectives; `polish` improves its result by gradients."""

    many_objectives: ClassVar[bool] = True
    population: int = field(default=100, metadata={"low": 2, "need": INDIVIDUALS})
    crossover: Crossover = Crossover()
    mutation: Mutation = Mutation()
    polish: bool = False


class Solver(AlgorithmSettings):
    """An algorithm that is not a population search: it evaluates designs itself."""

    @abstractmethod
    def solve(self, run: Run) -> None:
        """Evaluate designs by `run.evaluate` until the front is complete; they are the result.

        It must depend on `run` alone: an interrupted run is resumed from its beginning.
        """

    def build(self, problem: ToleranceProblem) -> Any:
        raise TypeError(f"{type(self).__name__} is not a pymoo algorithm: it evaluates designs itself")
