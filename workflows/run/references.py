"""The documents' allocations and the single-objective optimum, compared with the front."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...algorithms.exact.solver import Exact
from ...algorithms.ga import GA
from ...algorithms.search import Progress, search
from ...algorithms.settings import AlgorithmSettings, Budget, Crossover, Mutation
from ...arrays import Array
from ...problems.designs import designs_of
from ...problems.interfaces import Accuracy, Documented
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from .front import EXACT, reported_front
from .plan import RunPlan
from .proofs import Exact as ExactFront
from .proofs import exact_front

DISTANCE = "distance_to_front"
"""Column: from a reference to the nearest front point, in sides of the box of the hypervolume."""
ALIKE = 1e-6
"""Difference, in sides of the box, below which values count as equal: an optimiser's last digits.
"""
RELAXED_POINTS = 10
"""Points of a front with relaxed limits, where each is solved on a sample of units."""
GA_BUDGET = Budget(generations=120)
"""Budget of the single-objective reference, with the GA's default settings."""


@dataclass(frozen=True, slots=True)
class SideSearch:
    """A search in addition to the main one: the GA reference, or a front with relaxed limits.

    Two kinds are no references: `apart` is the front without the effects, `overlay` is the front of
    another algorithm.
    """

    label: str
    problem: ToleranceProblem
    algorithm: AlgorithmSettings
    budget: Budget
    seed: int
    relaxed: bool
    engine: str = "pymoo"
    apart: bool = False
    overlay: bool = False

    @property
    def key(self) -> str:
        """What its result depends on, in addition to the problem and the algorithm."""
        return f"{self.label}, seed {self.seed}, {self.budget}"

    def front(self, report: Callable[[Progress], None] | None = None) -> pd.DataFrame | None:
        """Its reported front; None where it was interrupted. `report` is called with its states."""
        result = search(self.problem, self.algorithm, self.budget, self.seed, report, self.engine)
        return None if result.interrupted else reported_front(self.problem, result)


def documents(problem: ToleranceProblem) -> pd.DataFrame:
    """The printed allocations, evaluated by the same model: one row each, with `label`."""
    printed = Documented.of(problem).references()
    if not printed:
        return pd.DataFrame()
    frame = Accuracy.of(problem).reported().frame(np.stack(list(printed.values())))
    frame.insert(0, "label", list(printed))
    return frame


def side_searches(plan: RunPlan, printed: pd.DataFrame) -> tuple[SideSearch, ...]:
    """The searches that the references need, each with its own seed."""
    problem, searches = plan.problem, []
    seeds = iter(np.random.SeedSequence(plan.seed).generate_state(1 + len(printed)).tolist())
    optimum = Documented.of(problem).least_cost()
    first = next(seeds)
    if optimum is not None and (len(printed) or plan.reference_search):
        label, cheapest = optimum
        searches.append(SideSearch(label, cheapest, *_ga(problem), first, relaxed=False))
    for row in printed.to_dict("records"):
        seed, bounds = next(seeds), relaxed_bounds(problem, row)
        if bounds:
            wider = problem.relaxed(bounds)
            label = str(row["label"])
            algorithm = _fewer(plan.algorithm) if problem.declaration.sampled else plan.algorithm
            searches.append(SideSearch(label, wider, algorithm, plan.budget, seed, True, plan.engine))
    return tuple(searches)


def _fewer(algorithm: AlgorithmSettings) -> AlgorithmSettings:
    """An exact front with fewer points: each is solved on a sample of units."""
    if isinstance(algorithm, Exact):
        return replace(algorithm, points=min(algorithm.points, RELAXED_POINTS))
    return algorithm


def _ga(problem: ToleranceProblem) -> tuple[GA, Budget]:
    """The single-objective GA and its budget: as the documents state them, where they do."""
    documented = problem.declaration.reference_ga
    if not documented:
        return GA(), GA_BUDGET
    settings = GA(
        population=int(documented["population"]),
        crossover=Crossover(documented["crossover"], documented.get("crossover_eta", Crossover().eta)),
        mutation=Mutation(documented["mutation"], documented.get("mutation_eta", Mutation().eta)),
    )
    return settings, Budget(generations=int(documented["generations"]))


def violated(problem: ToleranceProblem, row: Mapping[Hashable, object]) -> list[str]:
    """Names of the limits that a row breaks."""
    return [limit.name for limit in problem.limits if not limit.kept(np.array([float(str(row[limit.name]))]))[0]]


def relaxed_bounds(problem: ToleranceProblem, row: Mapping[Hashable, object]) -> dict[str, Bound]:
    """The broken limits of a row, moved to the row's own values."""
    limits = {limit.name: limit for limit in problem.limits}
    bounds = {}
    for name in violated(problem, row):
        value, limit = float(str(row[name])), limits[name]
        bounds[name] = Bound(min(limit.low, value), max(limit.high, value))
    return bounds


def exact_optimum(problem: ToleranceProblem, exact: ExactFront | None) -> pd.DataFrame:
    """The proven least cost within the limits (one row with `label`), none where nothing proves it.

    For a problem with more objectives it is that of the documents' single-objective allocation.
    """
    if problem.n_obj == 1:
        proven = exact
    else:
        optimum = Documented.of(problem).least_cost()
        proven = exact_front(optimum[1]) if optimum else None
    if proven is None:
        return pd.DataFrame()
    frame = Accuracy.of(problem).reported().frame(proven.designs[:1])
    frame.insert(0, "label", EXACT)
    return frame


def table(
    plan: RunPlan, printed: pd.DataFrame, fronts: Mapping[SideSearch, pd.DataFrame | None], exact: ExactFront | None
) -> pd.DataFrame:
    """All references, one row each, before comparison with the front; `exact` is its exact one."""
    optimum = exact_optimum(plan.problem, exact) if plan.references else pd.DataFrame()
    frames = [frame for frame in (printed, optimum) if len(frame)]
    for side, front in fronts.items():
        if not (side.relaxed or side.apart or side.overlay) and front is not None and len(front):
            row = Accuracy.of(plan.problem).reported().frame(designs_of(plan.problem, front.iloc[:1]))
            row.insert(0, "label", side.label)
            frames.append(row)
    if not frames:
        return pd.DataFrame({"label": [], "feasible": [], "violated_limits": []})
    references = pd.concat(frames, ignore_index=True)
    broken = [" ".join(violated(plan.problem, row)) for row in references.to_dict("records")]
    references.insert(1, "feasible", references.pop("feasible"))
    references.insert(2, "violated_limits", broken)
    return references


def compare(
    references: pd.DataFrame, front: pd.DataFrame, relaxed: Mapping[str, pd.DataFrame | None], problem: ToleranceProblem
) -> pd.DataFrame:
    """By how much the front beats each reference, and how far the reference lies from the front.

    Gains are in percent of the reference's own value, per objective: the best front point that is
    at least as good in all others, empty where there is none. `relaxed_...`: the same against the
    front whose broken limits are moved to the reference's own values.
    """
    comparison = references.copy()
    names = list(problem.objectives)
    ideal, nadir = problem.box()
    for prefix in ("", "relaxed_"):
        rows, distances = [], []
        for row in references.to_dict("records"):
            against = relaxed.get(str(row["label"])) if prefix else front
            reference = np.array([float(row[name]) for name in names])
            values = np.empty((0, len(names))) if against is None else against[names].to_numpy()
            rows.append(gains(reference, values, ALIKE * (nadir - ideal)))
            distances.append(distance(reference, values, nadir - ideal))
        comparison[prefix + DISTANCE] = distances
        for at, name in enumerate(names):
            comparison[prefix + gain_column(name)] = [row[at] for row in rows]
    return comparison


def distance(reference: Array, front: Array, sides: Array) -> float:
    """Distance from a reference (objectives,) to the nearest point of a front (n, objectives).

    Euclidean, each objective in `sides` (nadir less ideal of the problem). NaN for an empty front.
    """
    if not len(front):
        return np.nan
    return float(np.min(np.linalg.norm((front - reference) / sides, axis=1)))


def gain_column(objective: str) -> str:
    """Name of the column that says by how much an objective is beaten."""
    return "cost_saving_percent" if objective == "cost" else f"{objective}_gain_percent"


def gains(reference: Array, front: Array, alike: Array) -> list[float]:
    """Gain in percent per objective at equal or better other objectives.

    Values that differ by no more than `alike` (objectives,) are equal. NaN where no point of the
    front is as good, and where the value of the reference is 0.
    """
    percentages = []
    for at in range(len(reference)):
        as_good = np.delete(front, at, axis=1) <= np.delete(reference + alike, at)
        best = front[np.all(as_good, axis=1), at]
        known = len(best) > 0 and reference[at] != 0.0
        percentages.append(100.0 * (reference[at] - best.min()) / abs(reference[at]) if known else np.nan)
    return percentages
