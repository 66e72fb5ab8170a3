"""Another algorithm's front on the same problem, for comparison with the front of the run.

Where a model proves no bound, the distance of a run's points from the optimum is estimated by the
best known front: the joint front of both.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...algorithms.exact.solver import Exact
from ...algorithms.indicators import nondominated
from ...algorithms.nsga2 import NSGA2
from ...algorithms.settings import AlgorithmSettings, Budget, Crossover, Mutation
from ...arrays import Array
from ...problems.interfaces import Accuracy
from ...problems.tolerance_problem import ToleranceProblem
from .plan import RunPlan
from .proofs import distance_words
from .references import SideSearch

ABOVE = "above_best_known_percent"
"""Column: how much more a point costs than the best known front at its other objective."""
ROUNDING = 1e-9
"""Distance [percent] below which a point counts as being on the best known front."""
POINTS = 30
EVOLUTION = NSGA2(population=100, crossover=Crossover(eta=5.0), mutation=Mutation(eta=10.0))
BUDGET = Budget(generations=60)


def side_search(plan: RunPlan) -> tuple[SideSearch, ...]:
    """The other search: NSGA-II where the run is exact, exact where it is not.

    None for problems whose bounds are proven, and for other numbers of objectives than two.
    """
    problem = plan.problem
    if not problem.declaration.sampled or problem.n_obj != 2:
        return ()
    if isinstance(plan.algorithm, Exact):
        return (_side("NSGA-II", Accuracy.of(problem).coarser(), EVOLUTION, BUDGET),)
    return (_side("exact", problem, Exact(points=POINTS), Budget()),)


def _side(label: str, problem: ToleranceProblem, algorithm: AlgorithmSettings, budget: Budget) -> SideSearch:
    return SideSearch(label, problem, algorithm, budget, 1, relaxed=False, overlay=True)


def with_distance(front: pd.DataFrame, other: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """The front with the distance of its points from the best known front, in percent of cost.

    It is empty at levels that the other front does not reach, where nothing is compared, unless a
    point of it is better outright.
    """
    if "cost" not in names or front.empty:
        return front
    second = next(name for name in names if name != "cost")
    values = np.vstack([frame[["cost", second]].to_numpy(dtype=float) for frame in (front, other) if len(frame)])
    best = values[nondominated(values)]
    points, levels = front[["cost", second]].to_numpy(dtype=float), other.get(second, pd.Series(dtype=float))
    distance = np.array([above(row, best) for row in points])
    compared = front[second].between(levels.min(), levels.max()).to_numpy()
    return front.assign(**{ABOVE: np.where(compared | (distance > 0.0), distance, np.nan)})


def above(row: Array, best: Array) -> float:
    """How much more `row` (cost, other) costs than a front (n, 2) at its other value [percent].

    Between two points the front is taken to fall geometrically, as fronts of costs do.
    """
    best = best[np.argsort(best[:, 1], kind="stable")]
    least = float(np.exp(np.interp(row[1], best[:, 1], np.log(best[:, 0]))))
    excess = 100.0 * (float(row[0]) / least - 1.0)
    return excess if excess > ROUNDING else 0.0


def notes(front: pd.DataFrame, label: str, other: pd.DataFrame, names: list[str]) -> list[str]:
    """What the comparison comes to, in words."""
    if "cost" not in names or front.empty:
        return []
    second = next(name for name in names if name != "cost")
    if other.empty:
        return [f"{label} found no feasible point in the same problem"]
    distance = front[ABOVE].to_numpy(dtype=float)
    lowest, other_lowest = front[second].min(), other[second].min()
    compared = distance[~np.isnan(distance)]
    sentences = ["nothing is proven for this problem"]
    if len(compared):
        middle, most = distance_words(np.median(compared)), distance_words(np.max(compared))
        points = (
            "the points cost"
            if len(compared) == len(distance)
            else (f"{len(compared)} of {len(distance)} points, those at levels that it reaches, cost")
        )
        sentences = [
            f"nothing is proven for this problem; compared with the best known front, its own joined with that of "
            f"{label}, {points} {middle} more in the median and {most} at most at equal {second}"
        ]
    best = front[["cost", second]].to_numpy(dtype=float)
    behind = [
        above(row, best)
        for row in other[["cost", second]].to_numpy(dtype=float)
        if best[:, 1].min() <= row[1] <= best[:, 1].max()
    ]
    if behind:
        sentences.append(
            f"{label}: {len(other)} points, which cost {distance_words(np.median(behind))} "
            "more than this front in the median"
        )
    if other_lowest > lowest * 1.001:
        sentences.append(f"{label} finds nothing below {second} {other_lowest:.4g}; this front begins at {lowest:.4g}")
    elif lowest > other_lowest * 1.001:
        sentences.append(f"this front ends at {second} {lowest:.4g}; {label} reaches {other_lowest:.4g}")
    return sentences
