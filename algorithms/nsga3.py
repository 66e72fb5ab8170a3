"""NSGA-III: survival by reference directions, repeatable under a seed."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from math import comb
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import Fault, raise_all
from ..section import PAIRED, Array
from .settings import AlgorithmSettings, Crossover, Mutation

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem


@dataclass(frozen=True, slots=True)
class NSGA3(AlgorithmSettings):
    """NSGA-III for three or more objectives (Deb & Jain 2014); two are possible too.

    The directions are those of Das & Dennis (1998): `partitions` of every axis, or, at 0, as many
    as the population holds (population 100: 99 for two objectives, 12 for three, 6 for four).
    Where there are fewer partitions than objectives, every direction has a zero.
    """

    many_objectives: ClassVar[bool] = True
    state: ClassVar[tuple[str, ...]] = (
        "survival.norm.ideal_point",
        "survival.norm.worst_point",
        "survival.norm.extreme_points",
    )
    population: int = field(default=100, metadata={"low": 2, "need": PAIRED})
    partitions: int = field(default=0, metadata={"low": 0, "high": 1000})
    crossover: Crossover = Crossover(probability=1.0, eta=30.0)
    mutation: Mutation = Mutation()
    polish: bool = False

    def faults(self, objectives: int) -> list[Fault]:
        count = comb(self.partitions + objectives - 1, self.partitions)
        if count <= self.population:
            return []
        text = (
            f"{self.partitions} partitions of {objectives} axes give {count} reference directions, more "
            f"than the population of {self.population}: raise population to {count}, or give "
            "fewer partitions (0: as many as the population holds)"
        )
        return [Fault("partitions", text)]

    def build(self, problem: ToleranceProblem) -> Any:
        from pymoo.algorithms.moo.nsga3 import NSGA3 as PymooNSGA3
        from pymoo.operators.selection.tournament import TournamentSelection

        from .settings import operators

        raise_all(self.faults(problem.n_obj))
        directions = self._directions(problem.n_obj)
        return PymooNSGA3(
            ref_dirs=directions,
            pop_size=self.population,
            selection=TournamentSelection(func_comp=less_violation),
            survival=_survival(directions),
            **operators(problem, self.crossover, self.mutation),
        )

    def _directions(self, objectives: int) -> Array:
        """Reference directions (k, objectives).

        Directions by energy would differ from process to process (anyoptimization/pymoo#638).
        """
        from pymoo.util.reference_direction import das_dennis, get_partition_closest_to_points

        held = get_partition_closest_to_points(self.population, objectives)
        return np.asarray(das_dennis(self.partitions or held, objectives))


def less_violation(pop: Any, pairs: NDArray[np.int_], random_state: np.random.Generator, **_: Any) -> NDArray[np.int_]:
    """Winner (n, 1) of each pair (n, 2): the lesser constraint violation, by chance where equal.

    The comparison of pymoo does not use the generator where violations are equal, so that equal
    seeds give different runs (anyoptimization/pymoo#794).
    """
    violation = pop.get("CV")[:, 0][pairs]
    chance = random_state.random(len(pairs)) < 0.5
    second = np.where(violation[:, 0] == violation[:, 1], chance, violation[:, 1] < violation[:, 0])
    return np.where(second, pairs[:, 1], pairs[:, 0])[:, None]


def _survival(directions: Array) -> Any:
    """The survival of pymoo, which alone would turn off every warning of the process."""
    from pymoo.algorithms.moo.nsga3 import ReferenceDirectionSurvival

    class QuietSurvival(ReferenceDirectionSurvival):
        def _do(self, *args: Any, **kwargs: Any) -> Any:
            with warnings.catch_warnings():
                return super()._do(*args, **kwargs)

    return QuietSurvival(directions)
