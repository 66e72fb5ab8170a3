"""What a front is compared with: documents, single optima, other algorithms, a model without effects."""

from __future__ import annotations

import io
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from ...algorithms.archive import nondominated
from ...algorithms.exact.multistart import Case, Continued, MultiStart
from ...algorithms.exact.solver import Exact
from ...algorithms.ga import GA
from ...algorithms.run import Progress
from ...algorithms.search import Keeper, search
from ...algorithms.settings import AlgorithmSettings, Budget, Crossover, Mutation
from ...files import write_bytes
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...section import Array
from ...units import plain_number
from .front import EXACT, ROBUST, exact_label, reported_front
from .plan import RunPlan
from .promise import cheapest_at, cheapest_design
from .proofs import ProvenFront, distance_words, exact_front

DISTANCE = "distance_to_front"
"""Column: from a reference to the nearest front point, in sides of the box of the hypervolume."""
OBJECTIVE_TOLERANCE = 1e-6
"""Difference, in sides of the box, below which values count as equal: an optimiser's last digits.
"""
COMPARED = 6
"""Points of a front that are compared with another solver."""
MULTI_START = "multi-start"
"""Label of that solver: SLSQP from random designs, at the backlash of the point."""
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
    level: tuple[str, float] | tuple[()] = ()
    """Output and value at which the least cost is solved in addition to the front."""

    @property
    def key(self) -> str:
        """What its result depends on, in addition to the problem and the algorithm."""
        return f"{self.label}, seed {self.seed}, {self.budget}"

    def front(
        self, report: Callable[[Progress], None] | None = None, keeper: Keeper | None = None
    ) -> pd.DataFrame | None:
        """Its reported front, None where it was interrupted; `report` is called with states that `keeper` saves."""
        result = search(self.problem, self.algorithm, self.budget, self.seed, report, self.engine, keeper)
        front = None if result.interrupted else reported_front(self.problem, result)
        if front is not None and self.level:
            front = with_least_cost(front, self.problem, *self.level)
        self.problem.release()
        return front


def with_least_cost(front: pd.DataFrame, problem: ToleranceProblem, name: str, level: float) -> pd.DataFrame:
    """A front and the least cost at one value of the other objective, which lies between points of the front."""
    cheapest = cheapest_design(cheapest_at(problem, {name: level}))
    if not np.isfinite(cheapest.cost):
        return front
    joint = pd.concat([front, problem.reported().frame(cheapest.design[None, :])], ignore_index=True)
    joint = joint[joint["feasible"].astype(bool)] if "feasible" in joint else joint
    best = nondominated(joint[list(problem.objectives)].to_numpy(dtype=float))
    return joint[best][list(front.columns)].reset_index(drop=True)


def documents(problem: ToleranceProblem, _: object = None) -> pd.DataFrame:
    """The printed allocations, evaluated by the same model: one row each, with `label`."""
    printed = problem.references()
    if not printed:
        return pd.DataFrame()
    frame = problem.reported().frame(np.stack(list(printed.values())))
    frame.insert(0, "label", list(printed))
    return frame


def side_searches(plan: RunPlan, printed: pd.DataFrame) -> tuple[SideSearch, ...]:
    """The searches that the references need, each with its own seed."""
    problem, searches = plan.problem, []
    seeds = iter(np.random.SeedSequence(plan.seed).generate_state(1 + len(printed)).tolist())
    optimum = problem.least_cost()
    first = next(seeds)
    sampled = problem.declaration.sampled
    if optimum is not None and ((len(printed) and not sampled) or plan.reference_search):
        label, cheapest = optimum
        searches.append(SideSearch(label, cheapest, *_ga(problem), first, relaxed=False))
    for row in printed.to_dict("records"):
        seed, bounds = next(seeds), relaxed_bounds(problem, row)
        if bounds and not continues_front(plan):
            wider = problem.relaxed(bounds)
            label = str(row["label"])
            other = next((name for name in problem.objectives if name != "cost"), "")
            solved = isinstance(plan.algorithm, Exact) and problem.n_obj == 2 and "cost" in problem.objectives
            level = (other, float(row[other])) if solved else ()
            side = SideSearch(label, wider, plan.algorithm, plan.budget, seed, True, plan.engine, level=level)
            searches.append(side)
    return tuple(searches)


def continues_front(plan: RunPlan) -> bool:
    """Whether searches with other limits, or beside the front, begin where its points are."""
    problem = plan.problem
    of_cost = problem.n_obj == 2 and "cost" in problem.objectives
    return problem.declaration.sampled and of_cost and isinstance(plan.algorithm, Exact)


def searches_from_front(plan: RunPlan, printed: pd.DataFrame, x: Array) -> tuple[SideSearch, ...]:
    """The searches that begin from the points (n, variables) of an exact front on a sample.

    With the limits that a document breaks: least cost at its value of the other objective, and the least of
    that at its cost. The second is the other solver, at the values of some of the points.
    """
    if not continues_front(plan) or not len(x):
        return ()
    problem, searches = plan.problem, []
    f, g = problem.tested(x)
    x, f = x[np.all(g <= 0.0, axis=1)], f[np.all(g <= 0.0, axis=1)]
    second = next(name for name in problem.objectives if name != "cost")
    order = np.argsort(f[:, problem.objectives.index(second)], kind="stable")
    x, f = x[order], f[order]
    for row in printed.to_dict("records"):
        if bounds := relaxed_bounds(problem, row):
            cases = Continued(tuple(_cases(problem, row, x, f)))
            searches.append(SideSearch(str(row["label"]), problem.relaxed(bounds), cases, Budget(), 1, relaxed=True))
    levels = f[:, problem.objectives.index(second)]
    for seed, at in enumerate(_spread(len(x), COMPARED), 1):
        bound = Bound(problem.settings.limits.get(second, Bound()).low, float(levels[at]))
        limits = dict(problem.given.limits) | {second: bound}
        alone = type(problem)(replace(problem.given, objectives=("cost",), limits=limits)).coarser()
        searches.append(SideSearch(MULTI_START, alone, MultiStart(), Budget(), seed, relaxed=False, overlay=True))
    return tuple(searches)


def _spread(count: int, most: int) -> list[int]:
    """At most so many of `count` places, both ends among them."""
    return np.unique(np.linspace(0, count - 1, most).astype(int)).tolist() if count else []


def _cases(problem: ToleranceProblem, row: Mapping[Hashable, object], x: Array, f: Array) -> Iterator[Case]:
    """What is solved with the limits that a row breaks, from points (n, variables) with objectives (n, 2)."""
    for objective in range(2):
        level = float(str(row[problem.objectives[1 - objective]]))
        nearest = int(np.argmin(np.abs(f[:, 1 - objective] - level)))
        yield objective, tuple(x[nearest].tolist()), level


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


def exact_optimum(problem: ToleranceProblem, exact: ProvenFront | None) -> pd.DataFrame:
    """The proven least cost within the limits (one row with `label`), none where nothing proves it.

    For a problem with more objectives it is that of the documents' single-objective allocation.
    """
    if problem.n_obj == 1:
        proven = exact
    else:
        optimum = problem.least_cost()
        proven = exact_front(optimum[1]) if optimum else None
    if proven is None:
        return pd.DataFrame()
    frame = problem.reported().frame(proven.designs[:1])
    frame.insert(0, "label", exact_label(problem))
    return frame


REGRET = "worst_regret"
"""Column of the most that an allocation may cost more than the best one, whatever the true curves."""


@dataclass(frozen=True, slots=True)
class Regrets:
    """The allocation of least worst regret, one row with `label`; the summary, and all in sentences."""

    row: pd.DataFrame
    summary: Mapping[str, object]
    notes: tuple[str, ...]

    def added(self, references: pd.DataFrame) -> pd.DataFrame:
        """The references with `worst_regret` of this allocation and of the least cost."""
        known = {ROBUST: self.summary.get(REGRET), EXACT: self.summary.get("least_cost_worst_regret")}
        if not self.summary or references.empty:
            return references
        return references.assign(**{REGRET: references["label"].map(known).astype(float)})


def regrets(problem: ToleranceProblem) -> Regrets:
    """What uncertain cost curves may cost; nothing where `[robust]` does not say how uncertain they are."""
    from ...algorithms.exact.robust import robust_allocation

    robust = problem.settings.robust
    if robust is None:
        return Regrets(pd.DataFrame(), {}, ())
    found = robust_allocation(problem)
    if isinstance(found, str):
        return Regrets(pd.DataFrame(), {}, (f"no allocation is robust of the uncertain cost curves: {found}",))
    row = problem.reported().frame(problem.complete(found.x))
    row.insert(0, "label", ROBUST)
    unit = problem.settings.money.currency
    cost, least_cost = (float(problem.cost_of(problem.complete(x))[0]) for x in (found.x, found.nominal_x))
    summary = {
        REGRET: found.regret,
        "worst_regret_bound": found.least,
        "least_cost_worst_regret": found.nominal,
        "cost": cost,
        "least_cost": least_cost,
        "unit": unit,
        "design": dict(zip(problem.names, problem.complete(found.x)[0].tolist(), strict=True)),
    }
    most, nominal, least = (f"{plain_number(v)} {unit}".rstrip() for v in (found.regret, found.nominal, found.least))
    notes = (
        "if each cost curve is the stated one times a factor of its own, within what [robust] states, the least cost "
        f"by the stated curves ({plain_number(least_cost)} {unit}".rstrip()
        + f") costs at most {nominal} more than the best allocation for the true curves",
        f"{ROBUST}: the allocation of that name in references.csv (cost {plain_number(cost)} {unit}".rstrip()
        + f" by the stated curves) costs at most {most} more than the best one, whatever the true curves; proven: no "
        f"allocation within the limits can promise less than {least}",
    )
    return Regrets(row, summary, notes)


def table(
    plan: RunPlan,
    printed: pd.DataFrame,
    fronts: Mapping[SideSearch, pd.DataFrame | None],
    exact: ProvenFront | None,
    robust: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """All references, one row each, before comparison with the front; `exact` is its exact one, `robust` the
    allocation of least worst regret.
    """
    optimum = exact_optimum(plan.problem, exact) if plan.references else pd.DataFrame()
    frames = [frame for frame in (printed, optimum, robust) if frame is not None and len(frame)]
    for side, front in fronts.items():
        if not (side.relaxed or side.apart or side.overlay) and front is not None and len(front):
            row = plan.problem.reported().frame(designs_of(plan.problem, front.iloc[:1]))
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
            rows.append(gains(reference, values, OBJECTIVE_TOLERANCE * (nadir - ideal)))
            distances.append(distance(reference, values, nadir - ideal))
        comparison[prefix + DISTANCE] = distances
        for at, name in enumerate(names):
            comparison[prefix + gain_column(name)] = [row[at] for row in rows]
    return comparison


def distance(reference: Array, front: Array, sides: Array) -> float:
    """Distance from a reference (objectives,) to the nearest point of a front (n, objectives).

    Euclidean, each objective in `sides` (nadir less ideal of the problem). NaN for an empty front, 0 up to the
    `OBJECTIVE_TOLERANCE`.
    """
    if not len(front):
        return np.nan
    apart = float(np.min(np.linalg.norm((front - reference) / sides, axis=1)))
    return apart if apart > OBJECTIVE_TOLERANCE else 0.0


def gain_column(objective: str) -> str:
    """Name of the column that says by how much an objective is beaten."""
    return "cost_saving_percent" if objective == "cost" else f"{objective}_gain_percent"


def gains(reference: Array, front: Array, alike: Array) -> list[float]:
    """Gain in percent per objective at equal or better other objectives.

    Values that differ by no more than `alike` (objectives,) are equal: their gain is 0. NaN where no point of the
    front is as good, and where the value of the reference is 0.
    """
    percentages = []
    for at in range(len(reference)):
        as_good = np.delete(front, at, axis=1) <= np.delete(reference + alike, at)
        best = front[np.all(as_good, axis=1), at]
        known = len(best) > 0 and reference[at] != 0.0
        gain = reference[at] - best.min() if known else np.nan
        percentages.append(0.0 if abs(gain) <= alike[at] else 100.0 * gain / abs(reference[at]))
    return percentages


# Another algorithm's front on the same problem, for comparison with the front of the run.
#
# Where a model proves no optimum, the distance of a run's points from it is estimated by the best known
# front: the joint front of both.


ABOVE = "above_best_known_percent"
"""Column: how much more a point costs than the best known front at its other objective."""
EQUAL, USED_UP = 2e-3, 0.01
"""Relative differences by which a point that was solved at a level may lie above it, as a limit that is used up does on
fresh units, and below it, where the level costs next to nothing."""
ROUNDING = 1e-9
"""Distance [percent] below which a point counts as being on the best known front."""
POINTS = 30


def side_search(plan: RunPlan) -> tuple[SideSearch, ...]:
    """The exact search beside another one; beside an exact one `searches_from_front` compare.

    None for problems whose bounds are proven, and for other numbers of objectives than two.
    """
    problem = plan.problem
    if not problem.declaration.sampled or problem.n_obj != 2 or isinstance(plan.algorithm, Exact):
        return ()
    return (SideSearch("exact", problem, Exact(points=POINTS), Budget(), 1, relaxed=False, overlay=True),)


def overlays_of(fronts: Mapping[SideSearch, pd.DataFrame | None], front: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The points of other algorithms by label, in the columns of the front."""
    parts: dict[str, list[pd.DataFrame]] = {}
    for side, other in fronts.items():
        if side.overlay and other is not None:
            parts.setdefault(side.label, []).append(other[[name for name in other if name in front]])
    return {label: pd.concat(frames, ignore_index=True) for label, frames in parts.items()}


def add_distance(front: pd.DataFrame, other: pd.DataFrame, names: list[str], between: bool = True) -> pd.DataFrame:
    """The front with the distance of its points from the best known front, in percent of cost.

    It is empty at levels that the other front does not reach, where nothing is compared, unless a
    point of it is better outright; without `between` wherever the other has no point from `USED_UP` below
    the level to `EQUAL` above it.
    """
    if "cost" not in names or front.empty:
        return front
    second = next(name for name in names if name != "cost")
    values = np.vstack([frame[["cost", second]].to_numpy(dtype=float) for frame in (front, other) if len(frame)])
    best = values[nondominated(values)]
    points, levels = front[["cost", second]].to_numpy(dtype=float), other.get(second, pd.Series(dtype=float))
    distance = np.array([above(row, best) for row in points])
    compared = front[second].between(levels.min(), levels.max()).to_numpy()
    if not between:
        apart = levels.to_numpy(dtype=float)[None, :] / points[:, 1:] - 1.0
        compared = np.any((apart <= EQUAL) & (apart >= -USED_UP), axis=1)
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
    sentences = ["no optimum is proven for this problem"]
    if len(compared):
        middle, most = distance_words(np.median(compared)), distance_words(np.max(compared))
        points = (
            "the points cost"
            if len(compared) == len(distance)
            else (f"{len(compared)} of {len(distance)} points, those at levels that it reaches, cost")
        )
        sentences = [
            f"no optimum is proven for this problem; compared with the best known front, its own joined with that of "
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


# The fronts of reducers, which do not depend on the search, stored in the directory of the run.


REDUCERS = "reducers.npz"


def store_reducer_fronts(problem: ToleranceProblem, folder: Path) -> None:
    """Read the fronts of reducers from the directory where they belong to this configuration, else
    compute and write them.
    """
    path = folder / REDUCERS
    if path.is_file():
        try:
            with np.load(path, allow_pickle=False) as stored:
                if problem.adopt({name: stored[name] for name in stored.files}):
                    return
        except (OSError, ValueError, KeyError):
            pass  # a file that cannot be read is written anew
    arrays = problem.kept()
    if arrays:
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, **arrays)
        write_bytes(path, content.getvalue())


# The front before and after: what the effects in the model do to the allocation.


LABEL = "without effects"
LEVELS = (0.25, 0.5, 0.75)
"""Fractions of the range of the second objective that both fronts reach."""


def search_without_effects(plan: RunPlan) -> tuple[SideSearch, ...]:
    """The same search in the model without its effects, where at least one changes the model."""
    if not any(plan.problem.counterparts()):
        return ()
    before = plan.problem.without_effects()
    return (SideSearch(LABEL, before, plan.algorithm, plan.budget, plan.seed, False, plan.engine, apart=True),)


def allocation_moves(problem: ToleranceProblem, before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """How the allocation moves: pairs of points of both fronts, cheapest at the same level.

    One pair per level of the second objective (one pair where there is a single objective): the
    point `before`, the same design with the effects in the model (`kept`), and the point `after`.
    Empty where a front is empty, where there are more objectives, or where the fronts have no level
    in common.
    """
    names = list(problem.objectives)
    if before.empty or after.empty or len(names) > 2:
        return pd.DataFrame()
    rows = []
    for level in _levels(before, after, names):
        old, new = (_cheapest_at_level(front, names, level) for front in (before, after))
        unchanged = problem.reported().frame(designs_of(problem, old)).reindex(columns=before.columns)
        for label, row in (("before", old), ("kept", unchanged), ("after", new)):
            rows.append(row.assign(level=level, allocation=label))
    if not rows:
        return pd.DataFrame()
    free = [variable.name for variable in problem.free]
    return pd.concat(rows, ignore_index=True)[["level", "allocation", *names, *free]]


def _levels(before: pd.DataFrame, after: pd.DataFrame, names: list[str]) -> list[float]:
    if len(names) == 1:
        return [float("nan")]
    ranges = [(front[names[1]].min(), front[names[1]].max()) for front in (before, after)]
    low, high = max(bounds[0] for bounds in ranges), min(bounds[1] for bounds in ranges)
    return [low + fraction * (high - low) for fraction in LEVELS] if low < high else []


def _cheapest_at_level(front: pd.DataFrame, names: list[str], level: float) -> pd.DataFrame:
    """The point (one row) with the least first objective that keeps the level of the second."""
    within = front if np.isnan(level) else front[front[names[1]] <= level]
    return within.sort_values(names, kind="stable").head(1)


def summary(problem: ToleranceProblem) -> dict[str, object]:
    """The active effects as they stand in `summary.json`; empty where there are none."""
    pairs = zip(problem.settings.effects, problem.counterparts(), strict=True)
    rows = [
        {
            "name": active.effect.name,
            "family": active.effect.family,
            "parameters": dict(active.values),
            "counterpart": counterpart or None,
        }
        for active, counterpart in pairs
    ]
    return {"effects": rows} if rows else {}
