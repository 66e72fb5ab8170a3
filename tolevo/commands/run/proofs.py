"""What is proven about a front: bounds, the exact front, limits out of reach, prices of requirements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...algorithms.archive import hypervolume
from ...algorithms.exact.bounds import Proof, convex_pieces, least_bounds, proof, reason, restrict_form, row_limits
from ...algorithms.exact.choices import least_cost, search_vector
from ...algorithms.exact.combination import Ascent, Combination, Optimum, within
from ...algorithms.exact.conditional import Asked, convexity, estimated_optimum
from ...algorithms.exact.epsilon import integer_faults, scale_of
from ...algorithms.exact.local import GAINED, Branch
from ...algorithms.exact.programme import Programme
from ...algorithms.exact.solver import Exact, closed_form, exact_vectors
from ...algorithms.run import Run, Shared, recalled_results
from ...algorithms.search import SearchResult
from ...algorithms.settings import AlgorithmSettings, Budget
from ...errors import Fault, ModelError, raise_all
from ...execution import pinned
from ...problems.forms import Form, largest_parts, least_value, spread_of
from ...problems.limits import Limit, descending, loosened
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...records import RunResult
from ...section import Array
from .changes import words
from .plan import RunPlan, chosen_point
from .prices import points_at_limit

if TYPE_CHECKING:
    import pandas as pd

POINTS = 4000
"""Points of the exact front that a hypervolume is measured by."""
SOLVED = 256
"""Points that are solved where each needs its own programme; the others lie between them."""
DRAWN = 400
"""Points of the exact front that are drawn."""
CHECKED = 50
"""Points of the exact front whose bounds are checked."""
EXACT = 1e-3
"""Gap [percent] below which a point counts as optimal."""
INFORMATIVE = 25.0
"""Median gap [percent] beyond which a bound that leaves limits out is not informative."""
REACHED = 1.0
"""Gap [percent] up to which a point reaches a bound that leaves all limits out."""
DEFECT = 2.0
"""How far a function may lie below its tangent plane, in units of what it exceeds the middle of a chord by."""
ESTIMATED = (0.25, 0.75)
"""Places along a front, besides the chosen point, at which the least cost is estimated."""
CLOSED = 1e-7
"""Relative gap up to which a front counts as exact."""


@dataclass(frozen=True, slots=True)
class ProvenFront:
    """The exact front of a problem: designs (k, all variables) and its hypervolume."""

    designs: np.ndarray
    hypervolume: float


def are_informative_bounds(problem: ToleranceProblem, proven: Proof, gap_percent: NDArray[np.float64]) -> bool:
    """Whether bounds say something of points (n,) that lie so far above them: where limits are
    left out, the points may be held back by those alone. Where that are all limits of a least cost,
    the bound is the cost of the loosest tolerances, and says nothing but of points that reach it.
    """
    limits = {limit.name for limit in problem.limits if limit.count}
    if problem.n_obj == 1 and limits and limits <= set(proven.omitted_limits):
        return bool(np.nanmax(gap_percent) <= REACHED)
    return not proven.omitted_limits or bool(np.nanmedian(gap_percent) <= INFORMATIVE)


def add_bounds(
    frame: pd.DataFrame, problem: ToleranceProblem, within: NDArray[np.bool_] | None = None
) -> tuple[pd.DataFrame, Proof]:
    """The frame with `bound` and `gap_percent`, and the proof of its feasible points.

    Both are NaN in rows that are marked as not feasible, or that are not `within` the search space
    (n,). Where a point disproves its bound all are NaN and the statement says so.
    """
    frame = frame.copy().assign(bound=np.nan, gap_percent=np.nan)  # in one piece: it may have hundreds of columns
    frame = frame[[name for name in frame if name != "knee"] + ["knee"] * ("knee" in frame)]
    eligible = frame[frame["feasible"].astype(bool)] if "feasible" in frame else frame
    eligible = eligible if within is None else eligible[within[frame.index.isin(eligible.index)]]
    form = problem.priced_form()
    rows = () if form is None else tuple(name for name in form.stands if name in eligible)
    names = dict.fromkeys((*problem.objectives, *rows))
    values = {name: eligible[name].to_numpy(dtype=float) for name in names}
    try:
        bounds = proof(problem, values, len(eligible))
    except ModelError as error:
        return frame, Proof.without(len(frame), f"{error}; please report it")
    if len(eligible) and problem.priced in values:
        frame.loc[eligible.index, "bound"] = bounds.bound
        frame.loc[eligible.index, "gap_percent"] = bounds.gap_percent(values[problem.priced])
    return frame, bounds


def solved_front(plan: RunPlan, result: SearchResult) -> np.ndarray | None:
    """Search vectors (k, variables) of the exact front, where the run itself has solved it whole.

    None where it has fewer points than are solved for otherwise.
    """
    solved = isinstance(plan.algorithm, Exact) and plan.problem.n_obj == 2
    x = result.chosen if len(result.chosen) else result.x
    return x if solved and len(x) >= SOLVED else None


def exact_front(problem: ToleranceProblem, known: np.ndarray | None = None) -> ProvenFront | None:
    """The exact front of one or two objectives, through its `known` points where there are some.

    None where there is no closed form or its proof has a gap. No number of points shows the
    hypervolume of more objectives well enough to measure by.
    """
    form = closed_form(problem)
    if form is None or not form.exact or problem.n_obj > 2:
        return None
    alone = len(form.outputs) == 1 and form.correlation is None and known is None
    x = exact_vectors(problem, form, POINTS if alone else SOLVED) if known is None else known
    if not len(x):
        return None
    selected = np.unique(np.linspace(0, len(x) - 1, CHECKED).astype(int))
    if form.tested and np.any(problem.tested(x)[1] > 0.0):
        return None
    values = _objectives(problem, x[selected])
    columns = dict(zip(problem.objectives, values.T, strict=True))
    bounds = proof(problem, columns, len(selected))
    if not np.all(columns[problem.priced] - bounds.bound <= CLOSED * np.abs(columns[problem.priced])):
        return None
    if not alone:
        x = _points_between(problem, x)
    return ProvenFront(problem.complete(x), hypervolume(_objectives(problem, x), *problem.box()))


def exact_table(problem: ToleranceProblem, exact: ProvenFront | None) -> pd.DataFrame | None:
    """Objectives of at most `DRAWN` points of the exact front; None where it is not known."""
    import pandas as pd

    if exact is None or problem.n_obj < 2:
        return None
    selected = np.unique(np.linspace(0, len(exact.designs) - 1, DRAWN).astype(int))
    values = problem.objective_values(problem.outputs_of(exact.designs[selected], searching=True))
    table = pd.DataFrame(values, columns=list(problem.objectives))
    return table.sort_values(list(problem.objectives), kind="stable", ignore_index=True)


def _objectives(problem: ToleranceProblem, x: np.ndarray) -> np.ndarray:
    """Objectives (k, objectives) of search vectors (k, variables)."""
    return problem.objective_values(problem.outputs_of(problem.complete(x), searching=True))


def _points_between(problem: ToleranceProblem, x: np.ndarray) -> np.ndarray:
    """Search vectors of a front and points between those that differ in no integer.

    Cost and requirements are convex there, so that the points lie on or below the chords.
    """
    if len(x) < 2:
        return x
    x = x[np.argsort(_objectives(problem, x)[:, 0], kind="stable")]
    integer = np.array([v.integer for v in problem.free])
    same = np.all(x[1:, integer] == x[:-1, integer], axis=1)
    intervals = max(1, POINTS // max(len(x), SOLVED))
    fraction = np.arange(1, intervals)[:, None, None] / intervals
    inner = x[:-1][same] + fraction * np.diff(x, axis=0)[same]
    return np.asarray(np.vstack([x, inner.reshape(-1, x.shape[1])]))


def measures(result: SearchResult, front: pd.DataFrame, proven: Proof, exact: ProvenFront | None) -> dict[str, object]:
    """Quality for the summary: hypervolume, its ratio to the exact one, gaps, the form."""
    last = result.history[-1].hypervolume if result.history else None
    gap = front["gap_percent"].to_numpy(dtype=float)
    known = bool(len(gap)) and not np.all(np.isnan(gap))
    return {
        "hypervolume": last,
        "hypervolume_ratio": last / exact.hypervolume if exact and last is not None else None,
        "bound_form": proven.statement,
        "gap_percent_median": float(np.nanmedian(gap)) if known else None,
        "gap_percent_max": float(np.nanmax(gap)) if known else None,
    }


def end_notes(problem: ToleranceProblem, front: pd.DataFrame) -> list[str]:
    """How much of each end of a front of cost and one requirement is missing, if it is proven."""
    form = closed_form(problem)
    names = [name for name in problem.objectives if name != problem.priced]
    if form is None or not len(front) or len(names) != 1 or problem.n_obj != 2:
        return []
    if names[0] not in form.outputs:  # a requirement stands for it, whose end says nothing of it
        return []
    row, limits = form.outputs.index(names[0]), row_limits(problem, form)
    cheapest = float(least_bounds(form, limits[None, :])[0])
    limits[row] = np.inf
    least = least_value(form, row, limits)
    ends = [
        (names[0], float(front[names[0]].min()), None if least is None else least.value),
        (problem.priced, float(front[problem.priced].min()), cheapest),
    ]
    units = {output.name: f" {output.unit}".rstrip() for output in problem.outputs}
    return [
        f"end of the front: the least {name} is {reached:.4g}{units[name]}; none below {proven:.4g}{units[name]} is "
        f"possible ({_relative_shortfall(reached, proven)} missing at most)"
        for name, reached, proven in ends
        if proven is not None and np.isfinite(proven)
    ]


def costs_less(problem: ToleranceProblem) -> str:
    """The words for less of the column that bounds are proven of."""
    return "costs less" if problem.priced == "cost" else f"has less {problem.priced}"


def _relative_shortfall(reached: float, proven: float) -> str:
    """Distance of an end of a front from the proven end, relative to it where that is above 0."""
    if proven <= 0.0:
        return f"{reached - proven:.2g}"
    return percent(100.0 * (reached - proven) / proven)


def proof_notes(problem: ToleranceProblem, front: pd.DataFrame, proven: Proof) -> list[str]:
    """What the page and the terminal say of the proof."""
    gap = front["gap_percent"].to_numpy(dtype=float)
    if not len(gap) or np.all(np.isnan(gap)):
        return [proven.statement] if len(gap) else []
    if not are_informative_bounds(problem, proven, gap):
        return [
            f"the bound is not informative: the points lie {np.nanmedian(gap):.3g} % above it "
            f"in the median, because it leaves out limits that hold them back ({proven.statement})"
        ]
    return [
        f"proven: no allocation of equal or better other objectives {costs_less(problem)} than the bound "
        f"({proven.statement}); the points lie {distance_words(np.nanmedian(gap))} above it in the "
        f"median, {distance_words(np.nanmax(gap))} at most"
    ]


def add_conditional_bounds(result: RunResult, plan: RunPlan, shared: Shared) -> RunResult:
    """The result with `bound_conditional` [cost] of points that `exact` found on a sample, and what it rests on.

    It holds if the least value of the other objective is convex in the tolerances, which is tried and not proven.
    `shared` computes in other processes.
    """
    import pandas as pd

    problem, front, costs = plan.problem, result.front, plan.problem.settings.costs
    others = [name for name in problem.objectives if name != "cost"]
    convex = not problem.settings.machines and not any(curve.bends for curve in costs.values())
    alone = problem.priced == "cost" and not problem.held_costs
    sampled = isinstance(plan.algorithm, Exact) and problem.declaration.sampled and convex and alone
    if not sampled or len(others) != 1 or problem.n_obj != 2 or result.prices is None or result.prices.empty:
        return result
    rows = result.prices[(result.prices["output"] == others[0]) & result.prices["price"].notna()]
    free, objective = [problem.names.index(v.name) for v in problem.free], problem.objectives.index(others[0])
    x = designs_of(problem, front)[:, free]
    generator = np.random.default_rng(plan.seed)
    tried = convexity(problem, x, objective, scale_of(problem), generator, shared) if len(rows) else None
    if tried is None:
        return result
    price = pd.Series(rows["price"].to_numpy(dtype=float), index=rows["point"]).reindex(range(len(front))).to_numpy()
    cost, level = front["cost"].to_numpy(dtype=float), front[others[0]].abs().to_numpy(dtype=float)
    conditional = cost - price * (DEFECT * tried.excess + GAINED * level)
    bound = np.where(np.isnan(price), np.nan, np.fmax(conditional, front["bound"].to_numpy(dtype=float)))
    below = 100.0 * (1.0 - bound / cost)
    ends = [percent(float(value)) for value in (np.nanmedian(below), np.nanmax(below))]
    whole = [problem.names[at] for at, v in zip(free, problem.free, strict=True) if v.integer]
    kept = f" of the same {' and '.join(map(words, whole))}" if whole else ""
    unit = {output.name: output.unit for output in problem.outputs}[others[0]]
    statement = (
        f"not proven, on a condition: if the least {words(others[0])} is convex in the tolerances"
        + (f" to within {DEFECT * tried.excess:.2g} {unit}" if tried.above else "")
        + f", no allocation{kept} costs less than a point by more than {ends[0]} in "
        f"the median, {ends[1]} at most; at the middle of {tried.chords - tried.above} of {tried.chords} chords "
        "between random tolerances it lies below the chord"
        + (f", elsewhere {tried.excess:.2g} {unit} above it at most" if tried.above else "")
    )
    return _with_unproven(result, "bound_conditional", bound, statement)


def _with_unproven(result: RunResult, name: str, bound: Array, statement: str) -> RunResult:
    """The result with a bound (points,) that is not proven, and what it rests on."""
    marked = result.front.copy()
    marked.insert(list(marked).index("gap_percent") + 1, name, bound)
    summary = {**result.summary, name: statement, "notes": [*result.summary["notes"], statement]}
    return replace(result, front=marked, summary=summary, notes=(*result.notes, statement))


def add_estimated_bounds(result: RunResult, plan: RunPlan, shared: Shared) -> RunResult:
    """The result with `bound_estimate` [cost] of a few points that `exact` found on a sample, where a sample shows what
    an allocation needs (`CostBound.estimate`). `shared` computes in other processes.
    """
    problem, front = plan.problem, result.front
    known = problem.cost_bound() if problem.priced == "cost" and not problem.held_costs else None
    estimated = getattr(known, "estimate", None)  # bounds of a problem of one's own may have none
    if known is None or estimated is None or not isinstance(plan.algorithm, Exact) or front.empty or known.missing:
        return result
    places = [round(part * (len(front) - 1)) for part in ESTIMATED]
    points = [int(at) for at in np.unique([chosen_point(result), *places])]
    designs = designs_of(problem, front)
    asked = [Asked({name: float(front[name].iloc[at]) for name in problem.objectives}, designs[at]) for at in points]
    needs = [estimated(one.values) for one in asked]
    if not all(needs):
        return result
    inputs = (designs[points], np.array([list(one.values.values()) for one in asked]))
    solved = recalled_results(shared, estimated_optimum, asked, inputs)
    estimate = np.full(len(front), np.nan)
    estimate[points] = solved[:, 0]
    estimate[estimate > front["cost"]] = np.nan  # a point that costs less refutes it
    if not np.any(np.isfinite(estimate)):
        return result
    below, need = 100.0 * (1.0 - estimate / front["cost"].to_numpy(dtype=float)), needs[0]
    off = float(np.nanmax(np.abs(solved[:, 1] - [one.needed for one in needs])))
    least, most = (f"{float(end):.2g}" for end in (np.nanmin(below), np.nanmax(below)))
    statement = (
        f"estimated, not proven: with the ripple of the backlash over the turn as {need.units} units show it, the "
        f"least cost at which enough units can be good lies {least if least == most else f'{least} to {most}'} % "
        f"below the points ({np.count_nonzero(np.isfinite(below))} of {len(front)} tried, column bound_estimate); on "
        f"fresh units the share that is needed, {100.0 * need.needed:.2f} %, is met to within {percent(100.0 * off)}"
    )
    return _with_unproven(result, "bound_estimate", estimate, statement)


def percent(value: float) -> str:
    """An upper limit of a gap in words: a rounding error is not printed as 1e-09 %."""
    return "0.001 %" if value < EXACT else f"{value:.2g} %"


def distance_words(value: float | np.floating[Any]) -> str:
    """A distance [percent] in words: a rounding error is not printed as a number."""
    return "less than 0.001 %" if value < EXACT else f"{value:.3g} %"


# Limits that no known design of a sampled problem keeps, reported before a run begins.


ATTEMPTS = 3
"""Searches for the least value, each from the result of the last."""


def searchable(problem: ToleranceProblem, algorithm: AlgorithmSettings | None = None) -> None:
    """Raises InputError with every reason why a problem cannot be searched as it is set."""
    many = _too_many_choices(problem) if isinstance(algorithm, Exact) else []
    with pinned():  # the search takes over what is computed here
        raise_all([*many, *(problem.search_faults() or unreachable_limits(problem))])


def _too_many_choices(problem: ToleranceProblem) -> list[Fault]:
    """More sets of choices than `exact` solves one by one where there is no closed form."""
    faults = integer_faults(problem)
    return faults if faults and closed_form(problem) is None else []


def unreachable_limits(problem: ToleranceProblem) -> list[Fault]:
    """A fault for each upper limit that is below the least value found, with the design.

    Proven limits are `problem.faults()`; here the least value is that of a search by gradients at
    the finest grades, which proves nothing but is rarely wrong by more than its sample. There is no
    search where one of the problem's own starts keeps all limits.
    """
    declaration = problem.declaration
    upper = [limit for limit in problem.limits if limit.name in declaration.performance and np.isfinite(limit.high)]
    sought = declaration.sampled and bool(problem.free) and bool(upper)
    starts = problem.starts() if sought else np.empty((0, 0))
    if not len(starts) or _any_feasible(problem, starts):
        return []
    return [fault for limit in upper if (fault := _fault(problem, limit)) is not None]


def _any_feasible(problem: ToleranceProblem, starts: Array) -> bool:
    outputs = problem.outputs_of(starts, searching=True)
    return bool(np.any(np.all(problem.violations(starts, outputs) <= 0.0, axis=1)))


def _fault(problem: ToleranceProblem, limit: Limit) -> Fault | None:
    """The fault of one limit, None where it can be kept."""
    least, design = _least(problem, limit.name)
    if not least > limit.high:
        return None
    values = ", ".join(f"{v.name} {design[problem.names.index(v.name)]:.4g}" for v in problem.free)
    unit = f" {limit.unit}".rstrip()
    return Fault(
        f"limits.{limit.name}",
        f"at most {limit.high:g}{unit} was not reached by any design: the least value found is "
        f"{least:.4g}{unit}, at {values}; raise the limit or widen the ranges",
    )


def _least(problem: ToleranceProblem, name: str) -> tuple[float, Array]:
    """The least value of an output with interference and geometry held, and its full design."""
    held = {n: b for n, b in problem.settings.limits.items() if n not in problem.declaration.performance}
    alone = type(problem)(replace(problem.given, objectives=(name,), limits=held))
    run = Run(alone, Budget(), seed=0)
    branch = Branch(run, alone.xl.copy(), scale_of(alone))
    none = np.full(1, np.inf)
    columns = [alone.names.index(v.name) for v in alone.free]
    start = branch.smooth.scaled(alone.starts()[:1, columns])[0]
    for _ in range(ATTEMPTS):
        branch.minimise(0, start, none)
        if branch.f:
            start = branch.y[int(np.argmin([f[0] for f in branch.f]))]
    if not branch.f:
        return -np.inf, alone.starts()[0]
    best = alone.complete(branch.smooth.vectors(start[None, :]))
    return float(min(f[0] for f in branch.f)), best[0]


# Which requirement drives which part, and what relaxing each would save.


LOOSER = 0.1
"""Fraction of its limit by which each requirement is relaxed."""
LEAST_NAMED = 0.005
"""Least part of what a requirement drives that is named: it is written in whole percent."""
DRIVEN = 3
"""Parts named per requirement."""


def add_requirements(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with its tables of requirements, where the problem has several."""
    tables = requirements_of(problem, result.front, chosen_point(result))
    return result if tables is None else replace(result, requirements=tables[0], drivers=tables[1])


def requirements_of(
    problem: ToleranceProblem, front: pd.DataFrame, at: int
) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """What each requirement costs at a point of a front.

    None where a problem has one requirement, no convex form, one of which several rows only bound one output
    (a joint yield), or a limit that its form leaves out and the point uses up: that takes savings away. The
    multiplier is that of the least cost at the values of the point; the saving is proven to lie between
    that of an allocation that is known to keep every limit and that of the bound at the relaxed limit.
    """
    form = problem.form()
    if front.empty or form is None or len(set(form.outputs)) < 2 or reason(problem, form):
        return None
    if problem.held_costs or problem.priced != "cost":
        return None
    if not form.exact and len(set(form.outputs)) < len(form.outputs):
        return None
    names = {*form.relaxed, *form.stands.values()}
    omitted = [limit for limit in problem.limits if limit.count and limit.name in names]
    if any(points_at_limit(limit, front.iloc[[at]])[0] for limit in omitted):
        return None
    limits = _limits(problem, form, front.iloc[at])
    used = np.isfinite(limits)
    if not np.any(used):
        return None
    form, limits = convex_pieces(restrict_form(form, used)), limits[used]
    optimum = within(form, least_cost(form, loosened(limits)[None, :]), limits)
    if not np.isfinite(optimum.cost[0]):
        return None
    combination = Combination(form, tuple(optimum.chosen[0].tolist()))
    optimum = replace(optimum, cost=combination.cost(optimum.t))
    return _table(problem, limits, optimum, combination, omitted), _drivers(form, optimum, combination)


def _limits(problem: ToleranceProblem, form: Form, point: pd.Series) -> Array:
    """Limits (r,) of the form's requirements: the point's own objectives, and those of the run."""
    values = [float(point[name]) if name in problem.objectives else np.inf for name in form.outputs]
    return np.asarray(np.minimum(values, row_limits(problem, form)))


def _table(
    problem: ToleranceProblem, limits: Array, optimum: Optimum, combination: Combination, omitted: list[Limit]
) -> pd.DataFrame:
    """A row for each requirement: its limit, value, multiplier, and the saving at 10 % more."""
    import pandas as pd

    form = combination.form
    values, multiplier = combination.values(optimum.t)[0], optimum.multiplier[0]
    units = {o.name: o.unit for o in problem.outputs}
    least, most = _savings(problem, limits, optimum, combination, omitted)
    fractions = _fractions(optimum, combination)
    rows = []
    for at, name in enumerate(form.outputs):
        part, unit = form.labels[at] if form.labels else ("", "")
        unit = unit or ("" if np.isfinite(form.own_limits[at]) else units.get(name, ""))
        top = [int(j) for j in descending(fractions[at])[:DRIVEN] if fractions[at, j] >= LEAST_NAMED]
        names = [f"{form.features[j].variable} {100.0 * fractions[at, j]:.0f} %" for j in top]
        rows.append(
            {
                "requirement": name,
                "row": part or name,
                "unit": unit,
                "limit": limits[at],
                "value": values[at],
                "multiplier_cost_per_unit": multiplier[at],
                "relaxed_by_percent": 100.0 * LOOSER,
                "saves_at_least": least[at],
                "saves_at_most": most[at],
                "drives": ", ".join(names),
            }
        )
    return pd.DataFrame(rows)


def _savings(
    problem: ToleranceProblem, limits: Array, optimum: Optimum, combination: Combination, omitted: list[Limit]
) -> tuple[Array, Array]:
    """What relaxing each limit alone saves at least and at most (r,): 0 where it does not bind.

    At least the saving with the same processes, solved again, and nothing where that breaks a limit that the form
    leaves out; at most that of the bound by the best
    multipliers, which holds for any choice of processes (`Ascent`).
    """
    form = combination.form
    most_parts = largest_parts(form) if form.quantiles else None
    least, most = np.zeros(len(limits)), np.zeros(len(limits))
    for at in np.flatnonzero(optimum.multiplier[0] > 0.0):
        relaxed = limits.copy()
        relaxed[at] += LOOSER * abs(limits[at])
        same = Programme(combination).least_cost(relaxed[None, :])
        dual = Ascent(form, relaxed, spread_of(form, combination.parts(same.t), most_parts))
        bound = dual.value(dual.multipliers(same.multiplier[0]))[0]
        design = problem.complete(search_vector(problem, form, combination.chosen, same.t[0])) if omitted else None
        if design is None or _keeps(problem, design, omitted):
            least[at] = max(float(optimum.bound[0] - same.cost[0]), 0.0)
        most[at] = max(float(optimum.cost[0]) - bound, least[at])
    return least, most


def _keeps(problem: ToleranceProblem, design: Array, limits: list[Limit]) -> bool:
    """Whether a full design (1, all variables) keeps some limits."""
    outputs = problem.reported().needed_outputs(design)
    return all(limit.kept(problem.values(design, outputs, limit.name))[0] for limit in limits)


def _fractions(optimum: Optimum, combination: Combination) -> Array:
    """Fraction (r, features) of each part in the value of a requirement: t dV/dt over their sum."""
    along = np.abs(combination.gradients(optimum.t)[0] * optimum.t[0])
    whole = along.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(along, whole, out=np.zeros_like(along), where=whole > 0.0))


def _drivers(form: Form, optimum: Optimum, combination: Combination) -> pd.DataFrame:
    """By part, the fraction [%] of each requirement in what limits its tolerance.

    At the least cost -dC/dt is the sum of multiplier times dV/dt over the requirements.
    """
    import pandas as pd

    push = optimum.multiplier[0][:, None] * combination.gradients(optimum.t)[0]
    whole = np.abs(push).sum(axis=0)
    percent = 100.0 * np.divide(push, whole, out=np.zeros_like(push), where=whole > 0.0)
    rows = []
    for j, feature in enumerate(form.features):
        first = int(descending(np.abs(push[:, j]))[0])
        row = {
            "part": feature.variable,
            "t": optimum.t[0, j],
            "driven_by": form.outputs[first] if whole[j] > 0.0 else "",
        }
        rows.append(row | _fractions_by_output(form, percent[:, j]))
    return pd.DataFrame(rows)


def _fractions_by_output(form: Form, percent: Array) -> dict[str, float]:
    """Fractions [%] by output; rows of one output add up."""
    percentages: dict[str, float] = {}
    for name, value in zip(form.outputs, percent.tolist(), strict=True):
        percentages[f"{name}_percent"] = percentages.get(f"{name}_percent", 0.0) + value
    return percentages
