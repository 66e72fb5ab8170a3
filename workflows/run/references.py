"""The documents' allocations and the single-objective optimum, beside the front."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.exact.solver import Exact
from ...algorithms.ga import GA
from ...algorithms.search import search
from ...algorithms.settings import AlgorithmSettings, Budget, Crossover, Mutation
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem
from .front import EXACT, reported_front
from .plan import RunPlan
from .proofs import Exact as ExactFront
from .proofs import exact_front

Array = NDArray[np.float64]
DISTANCE = "distance_to_front"
"""Column: from a reference to the nearest front point, in sides of the box of the hypervolume."""
ALIKE = 1e-6
"""Difference of two values, in sides of the box, that is none: an optimiser's last digits."""
RELAXED_POINTS = 10
"""Points of a front with relaxed limits, where each is solved on a sample of units."""
GA_BUDGET = Budget(generations=120)
"""Budget of the single-objective reference, with the GA's default settings."""


@dataclass(frozen=True, slots=True)
class SideSearch:
    """A search beside the main one: the GA reference, or a front with relaxed limits.

    One that stands `apart` is no reference: the front without the effects; nor is an `overlay`: the
    front of another algorithm.
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
        """What its result depends on, beside the problem and the algorithm."""
        return f"{self.label}, seed {self.seed}, {self.budget}"

    def front(self) -> pd.DataFrame | None:
        """Its reported front; None where it was interrupted."""
        found = search(self.problem, self.algorithm, self.budget, self.seed, engine=self.engine)
        return None if found.interrupted else reported_front(self.problem, found)


def documents(problem: ToleranceProblem) -> pd.DataFrame:
    """The printed allocations, evaluated by the same model: one row each, with `label`."""
    printed = problem.references()
    if not printed:
        return pd.DataFrame()
    frame = problem.reported().frame(np.stack(list(printed.values())))
    frame.insert(0, "label", list(printed))
    return frame


def side_searches(plan: RunPlan, printed: pd.DataFrame) -> tuple[SideSearch, ...]:
    """The searches that the references need, each with a seed of its own."""
    problem, found = plan.problem, []
    seeds = iter(np.random.SeedSequence(plan.seed).generate_state(1 + len(printed)).tolist())
    optimum = problem.least_cost()
    first = next(seeds)
    if optimum is not None:
        label, cheapest = optimum
        found.append(SideSearch(label, cheapest, *_ga(problem), first, relaxed=False))
    for row in printed.to_dict("records"):
        seed, bounds = next(seeds), relaxed_bounds(problem, row)
        if bounds:
            wider = problem.relaxed(bounds)
            label = str(row["label"])
            algorithm = _fewer(plan.algorithm) if problem.sampled else plan.algorithm
            found.append(SideSearch(label, wider, algorithm, plan.budget, seed, True, plan.engine))
    return tuple(found)


def _fewer(algorithm: AlgorithmSettings) -> AlgorithmSettings:
    """An exact front with fewer points: each is solved on a sample of units."""
    if isinstance(algorithm, Exact):
        return replace(algorithm, points=min(algorithm.points, RELAXED_POINTS))
    return algorithm


def _ga(problem: ToleranceProblem) -> tuple[GA, Budget]:
    """The single-objective GA and its budget: as the documents have it, where they say."""
    own = problem.reference_ga
    if not own:
        return GA(), GA_BUDGET
    settings = GA(
        population=int(own["population"]),
        crossover=Crossover(own["crossover"], own.get("crossover_eta", Crossover().eta)),
        mutation=Mutation(own["mutation"], own.get("mutation_eta", Mutation().eta)),
    )
    return settings, Budget(generations=int(own["generations"]))


def violated(problem: ToleranceProblem, row: Mapping[Hashable, object]) -> list[str]:
    """Names of the limits that a row breaks."""
    return [
        limit.name
        for limit in problem.limits
        if any(v[0] > 0.0 for v in limit.violations(np.array([float(str(row[limit.name]))])))
    ]


def relaxed_bounds(problem: ToleranceProblem, row: Mapping[Hashable, object]) -> dict[str, Bound]:
    """The broken limits of a row, moved to the row's own values."""
    limits = {limit.name: limit for limit in problem.limits}
    found = {}
    for name in violated(problem, row):
        own, limit = float(str(row[name])), limits[name]
        found[name] = Bound(min(limit.low, own), max(limit.high, own))
    return found


def exact_optimum(problem: ToleranceProblem, exact: ExactFront | None) -> pd.DataFrame:
    """The proven least cost within the limits (one row with `label`), none where nothing proves it.

    Of a problem with more objectives, it is that of the documents' single-objective allocation.
    """
    if problem.n_obj == 1:
        found = exact
    else:
        optimum = problem.least_cost()
        found = exact_front(optimum[1]) if optimum else None
    if found is None:
        return pd.DataFrame()
    frame = problem.reported().frame(found.designs[:1])
    frame.insert(0, "label", EXACT)
    return frame


def table(
    plan: RunPlan,
    printed: pd.DataFrame,
    fronts: Mapping[SideSearch, pd.DataFrame | None],
    exact: ExactFront | None,
) -> pd.DataFrame:
    """All references, one row each, before comparison with the front; `exact` is its exact one."""
    optimum = exact_optimum(plan.problem, exact) if plan.references else pd.DataFrame()
    frames = [frame for frame in (printed, optimum) if len(frame)]
    for side, front in fronts.items():
        if not (side.relaxed or side.apart or side.overlay) and front is not None and len(front):
            row = plan.problem.reported().frame(plan.problem.designs_of(front.iloc[:1]))
            row.insert(0, "label", side.label)
            frames.append(row)
    if not frames:
        return pd.DataFrame({"label": [], "feasible": [], "violated_limits": []})
    found = pd.concat(frames, ignore_index=True)
    broken = [" ".join(violated(plan.problem, row)) for row in found.to_dict("records")]
    found.insert(1, "feasible", found.pop("feasible"))
    found.insert(2, "violated_limits", broken)
    return found


def compare(
    references: pd.DataFrame,
    front: pd.DataFrame,
    relaxed: Mapping[str, pd.DataFrame | None],
    problem: ToleranceProblem,
) -> pd.DataFrame:
    """By how much the front beats each reference, and how far the reference lies from the front.

    Gains are in percent of the reference's own value, per objective: the best front point that is
    at least as good in all others, empty where there is none. `relaxed_...`: the same against the
    front whose broken limits are moved to the reference's own values.
    """
    found = references.copy()
    names = list(problem.objectives)
    ideal, nadir = problem.box()
    for prefix in ("", "relaxed_"):
        rows, apart = [], []
        for row in references.to_dict("records"):
            other = relaxed.get(str(row["label"])) if prefix else front
            own = np.array([float(row[name]) for name in names])
            values = np.empty((0, len(names))) if other is None else other[names].to_numpy()
            rows.append(gains(own, values, ALIKE * (nadir - ideal)))
            apart.append(distance(own, values, nadir - ideal))
        found[prefix + DISTANCE] = apart
        for at, name in enumerate(names):
            found[prefix + gain_column(name)] = [row[at] for row in rows]
    return found


def distance(own: Array, front: Array, sides: Array) -> float:
    """Distance from a reference (objectives,) to the nearest point of a front (n, objectives).

    Euclidean, each objective in `sides` (nadir less ideal of the problem). NaN of an empty front.
    """
    if not len(front):
        return np.nan
    return float(np.min(np.linalg.norm((front - own) / sides, axis=1)))


def gain_column(objective: str) -> str:
    """Name of the column that says by how much an objective is beaten."""
    return "cost_saving_percent" if objective == "cost" else f"{objective}_gain_percent"


def gains(own: Array, front: Array, alike: Array) -> list[float]:
    """Gain in percent per objective at equal or better other objectives.

    Values that differ by no more than `alike` (objectives,) are equal. NaN where none is, and where
    the own value is 0.
    """
    found = []
    for at in range(len(own)):
        others = np.delete(front, at, axis=1) <= np.delete(own + alike, at)
        best = front[np.all(others, axis=1), at]
        known = len(best) > 0 and own[at] != 0.0
        found.append(100.0 * (own[at] - best.min()) / abs(own[at]) if known else np.nan)
    return found
