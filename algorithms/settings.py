"""Settings that algorithms share, and the interface of an algorithm plugin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pymoo.core.crossover import Crossover as PymooCrossover
from pymoo.core.mutation import Mutation as PymooMutation
from pymoo.core.repair import Repair
from pymoo.operators.crossover.pntx import SinglePointCrossover, TwoPointCrossover
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.crossover.ux import UniformCrossover
from pymoo.operators.mutation.gauss import GaussianMutation
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.rnd import FloatRandomSampling

from ..errors import Fault
from ..section import INDIVIDUALS, Array, Flags

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem
    from .engine import ArrayEngine, Space
    from .run import Run

ENGINES = ("gde3", "nsga2")
"""Names of the registered algorithms that have an array engine."""


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

    restarts: ClassVar[bool] = True
    """Whether the starts of the problem are tried where it keeps the limits nowhere."""
    descends: ClassVar[bool] = False
    """Whether descents on fresh units are tried there as well, for one objective."""

    @abstractmethod
    def solve(self, run: Run) -> None:
        """Evaluate designs by `run.evaluate` until the front is complete; they are the result.

        It must depend on `run` alone: an interrupted run is resumed from its beginning.
        """

    def build(self, problem: ToleranceProblem) -> Any:
        raise TypeError(f"{type(self).__name__} is not a pymoo algorithm: it evaluates designs itself")


# pymoo operators, built anew for every run, because its defaults are shared between algorithms.


class RoundIntegers(Repair):
    """Rounds the integer variables, leaves the others."""

    def __init__(self, integer: Flags) -> None:
        super().__init__()
        self.integer = integer

    def _do(self, problem: Any, X: Array, **kwargs: Any) -> Array:
        return np.where(self.integer, np.rint(X), X)


def repair(problem: ToleranceProblem) -> Repair:
    """A repair that rounds the integer variables of `problem`."""
    return RoundIntegers(np.array([v.integer for v in problem.free]))


def operators(problem: ToleranceProblem, crossover: Crossover, mutation: Mutation) -> dict[str, Any]:
    """Keyword arguments of a pymoo genetic algorithm.

    The duplicate check is off: it takes a fifth of a run and has no use for continuous tolerances.
    """
    return {
        "sampling": FloatRandomSampling(),
        "crossover": _crossover(crossover),
        "mutation": _mutation(mutation),
        "repair": repair(problem),
        "eliminate_duplicates": False,
    }


def _crossover(settings: Crossover) -> PymooCrossover:
    if settings.operator == "sbx":
        return SBX(prob=settings.probability, eta=settings.eta)
    kinds = {"uniform": UniformCrossover, "one_point": SinglePointCrossover, "two_point": TwoPointCrossover}
    return kinds[settings.operator](prob=settings.probability)


def _mutation(settings: Mutation) -> PymooMutation:
    if settings.operator == "gaussian":
        return GaussianMutation(prob=1.0, prob_var=settings.probability)
    return PM(prob=1.0, prob_var=settings.probability, eta=settings.eta)


# Algorithms of pymoo that are not offered, and what to use instead.


UNSEEDED = "its survival draws from a generator without a seed, so that no run can be repeated"
SHARED = (
    "its runs share one normalisation, so that a second run in a process differs from the first under the same seed"
)

REFUSED = MappingProxyType(
    {"cmopso": (UNSEEDED, "gde3"), "isres": (UNSEEDED, "ga"), "spea2": (SHARED, "nsga2"), "sres": (UNSEEDED, "ga")}
)
"""Reason, measured on pymoo 0.6.2, and replacement, by name."""
