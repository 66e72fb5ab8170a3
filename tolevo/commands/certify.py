"""`tolevo.certify`: how far the points of a result are from the optimum, and what is proven of that.

The result may be of any optimiser. Its designs are evaluated by the problem itself; three things
are said of each: a lower bound where the problem has a form or one is found, the best that
another algorithm knows, and how far the seeds of that algorithm scatter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .. import tables
from ..algorithms.archive import nondominated
from ..algorithms.exact.fitted import HELD_OUT, LOG, PLAIN, Row, designs_needed, fitted, least_value
from ..algorithms.hybrid import Hybrid
from ..algorithms.search import search
from ..algorithms.settings import Budget
from ..errors import raise_all, refuse
from ..problems.plain import PlainProblem
from ..problems.tolerance_problem import ToleranceProblem, designs_frame
from ..section import Array, Flags
from ..units import plain_number
from .evaluate import designs_in
from .run.proofs import add_bounds

DIFFERS = 1e-6
"""Relative difference from which the objectives of a result are not those that the problem computes."""
DISPROVED = 1e-7
"""Relative excess of a bound over a feasible value that disproves it."""
NO_FORM = "no form"


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is known of the distance of a result from the optimum.

    `points` has a row for each design: the variables, the objectives, `feasible`, `bound` and
    `gap_percent` of `bounded` (the objective that is bounded at equal or better others; NaN where
    nothing is proven), `best_known` and `distance_percent` of the first objective (the least that the
    other algorithm found at equal or better others). `forms` says for each objective and constraint
    which form it has, or "no form"; `statement` what is proven and what not; `scatter` has a row for each
    seed of the other algorithm. `lines` say all of it in sentences.
    """

    points: pd.DataFrame
    bounded: str
    forms: Mapping[str, str]
    statement: str
    scatter: pd.DataFrame
    lines: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def _repr_html_(self) -> str:
        """The points: what a notebook shows."""
        return str(self.points.to_html())


# Results of other optimisers, by what they have: none of their packages is imported.


def designs_of_result(problem: ToleranceProblem, result: Any) -> tuple[Array, Array | None]:
    """The designs (n, all variables) of a result, and the objectives (n, objectives) that it states, or None.

    A result of pymoo or VAMOS (`X`, `F`), a population of pygmo, a study of Optuna, solutions of
    Platypus or jMetalPy, a frame, or an array. Raises InputError where it holds no designs of the problem.
    """
    names = [variable.name for variable in problem.free]
    values: Any = None
    if isinstance(result, pd.DataFrame):
        frame = result
    elif hasattr(result, "best_trials"):  # a study of Optuna
        trials = result.best_trials
        frame, values = pd.DataFrame([trial.params for trial in trials]), [trial.values for trial in trials]
    elif hasattr(result, "get_x") and hasattr(result, "get_f"):  # a population of pygmo
        frame = _frame(np.asarray(result.get_x()), names)
        values = np.asarray(result.get_f())[:, : problem.n_obj]
    elif hasattr(result, "X") and hasattr(result, "F"):  # pymoo, VAMOS
        if result.X is None:
            raise refuse("result", "has no design: its X is None, as where no feasible design was found")
        frame, values = _frame(result.X, names), result.F
    elif hasattr(result, "front") and isinstance(result.front, pd.DataFrame):  # a run of this suite
        frame = result.front
    else:
        solutions = getattr(result, "result", result)
        solutions = solutions() if callable(solutions) else solutions
        if isinstance(solutions, Sequence) and solutions and hasattr(solutions[0], "variables"):
            frame = _frame([list(solution.variables) for solution in solutions], names)
            values = [list(solution.objectives) for solution in solutions]
        else:
            frame = _frame(solutions, names)
    table, faults = tables.table_of(frame, "result")
    raise_all(faults)
    assert table is not None
    designs = designs_in(problem, table, "result", searched=True)
    stated = None if values is None else np.asarray(values, dtype=float).reshape(len(designs), -1)
    return designs, stated if stated is not None and stated.shape[1] == problem.n_obj else None


def _frame(x: Any, names: list[str]) -> pd.DataFrame:
    """A frame of plain designs (n, free variables), or of a dictionary each."""
    if isinstance(x, Mapping):
        return pd.DataFrame([x])
    rows = list(x) if np.ndim(x) else [x]
    if rows and isinstance(rows[0], Mapping):
        return pd.DataFrame(rows)
    try:
        array = np.atleast_2d(np.asarray(x, dtype=float))
    except (TypeError, ValueError):
        raise refuse("result", f"is a {type(x).__name__}, which holds no designs: give an array or a frame") from None
    if array.ndim != 2 or array.shape[1] != len(names) or not len(array):
        raise refuse("result", f"must have the shape (points, {len(names)}) for {', '.join(names)}, got {array.shape}")
    return pd.DataFrame(array, columns=names)


# The certificate.


def certify(
    problem: ToleranceProblem, result: Any, seeds: int, evaluations: int, seed: int, forms: bool = True
) -> Certificate:
    """The certificate of a result; `forms` states whether forms are looked for where none is declared.

    The other algorithm is run from `seeds` seeds with so many `evaluations` each.
    """
    designs, stated = designs_of_result(problem, result)
    f, g = problem.searched(_vectors(problem, designs))
    if not isinstance(problem, PlainProblem):  # what a run reports as kept is kept
        g = problem.tested(_vectors(problem, designs))[1]
    feasible = np.all(g <= 0.0, axis=1) & np.isfinite(f).all(axis=1)
    points = designs_frame(problem, designs)[[variable.name for variable in problem.free]]
    points = points.assign(**dict(zip(problem.objectives, f.T, strict=True)), feasible=feasible)
    runs = [search(problem, Hybrid(), Budget(evaluations=evaluations), seed + at) for at in range(seeds)]
    known = [run.f[nondominated(run.f)] if len(run.f) else run.f for run in runs]
    everything = np.concatenate([f[feasible], *known])
    found = _bounds(problem, designs, points, everything, seed, forms)
    points = points.assign(bound=found.bound, gap_percent=_percent(points, found.bounded, found.bound, feasible))
    best = _best_known(f, np.concatenate(known))
    points = points.assign(best_known=best, distance_percent=_percent(points, problem.objectives[0], best, feasible))
    scatter = _scatter(problem, known, runs, f[feasible], seed)
    lines = [*_compared(stated, f), *_lines(points, found, scatter, problem)]
    return Certificate(points, found.bounded, found.forms, found.statement, scatter, tuple(lines))


def _vectors(problem: ToleranceProblem, designs: Array) -> Array:
    return designs[:, [problem.names.index(variable.name) for variable in problem.free]]


def _percent(points: pd.DataFrame, name: str, least: Array, feasible: Flags) -> Array:
    """Distance (n,) of an objective from a least value in percent; NaN where there is none, or that is 0."""
    whole = np.where((least == 0.0) | ~np.isfinite(least) | ~feasible, np.nan, np.abs(least))
    return np.asarray(100.0 * (points[name].to_numpy(dtype=float) - least) / whole)


def _best_known(f: Array, known: Array) -> Array:
    """The least first objective (n,) of `known` points (k, objectives) at equal or better others; NaN without any."""
    best = np.full(len(f), np.nan)
    for at, point in enumerate(f):
        as_good = np.all(known[:, 1:] <= point[1:] + 1e-9 * np.abs(point[1:]), axis=1)
        best[at] = np.min(known[as_good, 0], initial=np.inf)
    return np.where(np.isfinite(best), best, np.nan)


@dataclass(frozen=True, eq=False)
class _Bounds:
    """Bounds (n,) of the objective `bounded`, the forms, and what is proven."""

    bound: Array
    bounded: str
    forms: dict[str, str]
    statement: str


def _bounds(
    problem: ToleranceProblem, designs: Array, points: pd.DataFrame, everything: Array, seed: int, forms: bool
) -> _Bounds:
    """The declared bounds of a problem, else those of forms that are found."""
    first = problem.objectives[0]
    if not isinstance(problem, PlainProblem):
        frame, proof = add_bounds(problem.frame(designs), problem)
        rows = dict.fromkeys(problem.objectives, "declared" if not proof.missing else NO_FORM)
        return _Bounds(frame["bound"].to_numpy(dtype=float), "cost" if "cost" in rows else first, rows, proof.statement)
    if not forms:
        return _Bounds(np.full(len(points), np.nan), first, {}, "nothing is proven: no form was looked for")
    return _fitted_bounds(problem, designs, points, everything, seed)


def _fitted_bounds(
    problem: PlainProblem, designs: Array, points: pd.DataFrame, everything: Array, seed: int
) -> _Bounds:
    rng = np.random.default_rng(seed)
    count, none = designs_needed(problem.n_var), np.full(len(points), np.nan)
    x = problem.xl + (problem.xu - problem.xl) * rng.random((count, problem.n_var))
    x = np.where([variable.integer for variable in problem.free], np.rint(x), x)
    outputs = problem.outputs_of(problem.complete(x), errors=False)
    limited = [limit for limit in problem.limits if limit.count]
    names = dict.fromkeys((*problem.objectives, *(limit.name for limit in limited)))
    rows = {
        name: fitted(x, y) if np.all(np.isfinite(y := np.asarray(outputs[name], dtype=float))) else []
        for name in names
        if name in outputs
    }
    labelled = any(variable.labels for variable in problem.free)
    words = {name: " or ".join(row.kind for row in found) or NO_FORM for name, found in rows.items()}
    bounded, chosen = _bounded(problem, {} if labelled else rows)
    if bounded is None:
        why = "a choice has no order" if labelled else "no objective agrees with a form that is convex and verified"
        return _Bounds(none, problem.objectives[0], words, f"nothing is proven: {why}")
    limits = {limit.name: limit.high for limit in limited if np.isfinite(limit.high)}
    at_points = [name for name in problem.objectives if name != bounded and name in chosen]
    fixed = [name for name in limits if name in chosen and name not in at_points and name != bounded]
    ordered = [chosen[name] for name in (bounded, *at_points, *fixed)]
    vectors = _vectors(problem, designs)
    values = points[at_points].to_numpy(dtype=float)
    values = np.minimum(values, [limits.get(name, np.inf) for name in at_points])
    most = np.hstack([values, np.tile([limits[name] for name in fixed], (len(points), 1))])
    bound = none.copy()
    for row in np.flatnonzero(points["feasible"]):
        slack = 1e-9 * np.maximum(np.abs(most[row]), 1e-9)
        bound[row] = least_value(ordered, most[row] + slack, (problem.xl, problem.xu), vectors[row])
    if _is_disproved(problem, bounded, points, bound, everything):
        return _Bounds(none, bounded, words, "nothing is proven: a feasible design lies below the bound of its form")
    left = [name for name in names if name not in (bounded, *at_points, *fixed)]
    return _Bounds(
        bound, bounded, words, _statement(ordered, (bounded, *at_points, *fixed), len(at_points), left, count)
    )


def _bounded(problem: ToleranceProblem, rows: Mapping[str, list[Row]]) -> tuple[str | None, dict[str, Row]]:
    """The first objective with a form, and the rows in coordinates in which most of them are convex."""
    for name in problem.objectives:
        sets = [
            {n: row for n, found in rows.items() for row in found if row.coordinates == coordinates}
            for coordinates in (PLAIN, LOG)
            if any(row.coordinates == coordinates for row in rows.get(name, ()))
        ]
        if sets:
            return name, max(sets, key=len)
    return None, {}


def _is_disproved(
    problem: ToleranceProblem, bounded: str, points: pd.DataFrame, bound: Array, everything: Array
) -> bool:
    """Whether a feasible design is as good as a point in the other objectives and lies below its bound."""
    at = problem.objectives.index(bounded)
    others = [column for column in range(problem.n_obj) if column != at]
    f = points[list(problem.objectives)].to_numpy(dtype=float)
    for point, least in zip(f, bound, strict=True):
        as_good = np.all(everything[:, others] <= point[others], axis=1)
        if (
            np.isfinite(point).all()
            and not np.isnan(least)
            and np.any(everything[as_good, at] < least - DISPROVED * max(1.0, abs(least)))
        ):
            return True
    return False


def _statement(rows: Sequence[Row], names: Sequence[str], others: int, left: Sequence[str], count: int) -> str:
    """What is proven of the first of the names at the next `others`, on which condition, and what is left out."""
    forms = ", ".join(f"{name} ({row.kind})" for name, row in zip(names, rows, strict=True))
    at = f" at {' and '.join(names[1 : 1 + others])} no worse" if others else ""
    text = (
        f"no design has a lower {names[0]} than the bound{at}, provided that the forms hold: {forms}; they were fitted "
        f"to {count - HELD_OUT} designs and agree at {HELD_OUT} others, which is verified there and not between them"
    )
    omitted = f"left out, which makes the bound lower and not wrong: {', '.join(left)}"
    return f"{text}; {omitted}" if left else text


def _scatter(
    problem: ToleranceProblem, known: Sequence[Array], runs: Sequence[Any], own: Array, seed: int
) -> pd.DataFrame:
    """A row for each seed, and for the result itself: evaluations, points, and the hypervolume or least value."""
    measure = _measure(problem, [*known, own])
    rows = [
        {"source": f"seed {seed + at}", "evaluations": run.evaluations, "points": len(values), **measure(values)}
        for at, (run, values) in enumerate(zip(runs, known, strict=True))
    ]
    return pd.DataFrame([*rows, {"source": "result", "evaluations": np.nan, "points": len(own), **measure(own)}])


def _measure(problem: ToleranceProblem, fronts: Sequence[Array]) -> Callable[[Array], dict[str, float]]:
    """The least value of one objective; of several the hypervolume in the box of all `fronts` together."""
    if problem.n_obj == 1:
        return lambda values: {"least": float(np.min(values, initial=np.inf))}
    import moocore

    whole = np.concatenate(fronts)
    whole = whole[nondominated(whole)] if len(whole) else np.zeros((1, problem.n_obj))
    ideal, nadir = whole.min(axis=0), whole.max(axis=0)
    unit = np.where(nadir > ideal, nadir - ideal, 1.0)

    def measured(values: Array) -> dict[str, float]:
        scaled = (values - ideal) / unit
        return {"hypervolume": float(moocore.hypervolume(scaled, ref=[1.1] * problem.n_obj)) if len(values) else 0.0}

    return measured


def _compared(stated: Array | None, f: Array) -> list[str]:
    """A warning where a result states other objectives than the problem computes."""
    if stated is None:
        return []
    unit = np.maximum(np.max(np.abs(f), axis=0, initial=0.0), 1e-300)
    wrong = int(np.count_nonzero(np.any(~(np.abs(stated - f) <= DIFFERS * unit), axis=1)))
    if not wrong:
        return []
    text = f"at {wrong} of {len(f)} designs the result states other objectives than the problem computes"
    return [f"{text}: is it a result of this problem, and are all objectives minimised?"]


def _lines(points: pd.DataFrame, found: _Bounds, scatter: pd.DataFrame, problem: ToleranceProblem) -> list[str]:
    """All of it in sentences."""
    count, feasible = len(points), int(points["feasible"].sum())
    lines = [f"{feasible} of {count} designs keep the limits"] if feasible < count else []
    gap = points["gap_percent"].dropna()
    if len(gap):
        middle, most = plain_number(float(gap.median())), plain_number(float(gap.max()))
        lines.append(f"proven: {found.bounded} is at most {most} % above its least value, {middle} % in the median")
    lines.append(f"proof: {found.statement}")
    distance = points["distance_percent"].dropna()
    runs = scatter[scatter["source"] != "result"]
    seeds = f"{len(runs)} seed{'s' * (len(runs) > 1)}"
    if len(distance):
        middle, most = _apart(float(distance.median())), _apart(float(distance.max()))
        at = " at no worse values of the others" if problem.n_obj > 1 else ""
        text = f"best known: in the median {problem.objectives[0]} is {middle} what hybrid found from {seeds}{at}"
        lines.append(f"{text}, at the worst point {most}; that is no bound")
    measure = "least" if problem.n_obj == 1 else "hypervolume"
    reached = runs[runs["points"] > 0]
    if reached.empty:
        return [*lines, f"scatter: from none of {seeds} hybrid found a design within the limits"]
    low, high, own = reached[measure].min(), reached[measure].max(), scatter.iloc[-1]
    text = f"scatter: {measure} from {plain_number(float(low))} to {plain_number(float(high))} over {seeds}"
    if missed := len(runs) - len(reached):
        text += f", of which {missed} found no design within the limits"
    return [*lines, text + (f", {plain_number(float(own[measure]))} of the result" if own["points"] > 0 else "")]


def _apart(percent: float) -> str:
    """Like "1.2 % above"."""
    return f"{plain_number(abs(percent))} % {'below' if percent < 0.0 else 'above'}"
