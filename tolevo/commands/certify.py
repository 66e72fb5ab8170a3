"""`tolevo.certify`: how far the points of a result are from the optimum, and what is proven of that.

The result may be of any optimiser. Its designs are evaluated by the problem itself; three things
are said of each: a lower bound where the problem has a form or one is found, the best that
another algorithm knows, and how far the seeds of that algorithm scatter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .. import tables
from ..algorithms.archive import hypervolume, nondominated
from ..algorithms.exact.fitted import HELD_OUT, LOG, PLAIN, designs_to_fit, fitted, least_value
from ..algorithms.hybrid import Hybrid
from ..algorithms.search import search
from ..algorithms.settings import Budget
from ..errors import raise_all, refuse
from ..problems.plain import PlainProblem
from ..problems.tolerance_problem import ToleranceProblem, designs_frame
from ..section import Array
from ..units import plain_number
from .evaluate import designs_in
from .run.proofs import add_bounds

DIFFERS = 1e-6
"""Relative difference from which the objectives of a result are not those that the problem computes."""
NO_FORM = "no form"
AROUND, REACH = 8, (1e-4, 1e-3, 1e-2, 0.1)
"""Designs around each least value at which forms are verified, and how far apart, in parts of the ranges."""


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
    front = getattr(result, "front", None)  # of a run of this suite; that of VAMOS holds objectives
    x: Any = front if isinstance(front, pd.DataFrame) else result
    values: Any = None
    if hasattr(x, "best_trials"):  # a study of Optuna
        x, values = [trial.params for trial in result.best_trials], [trial.values for trial in result.best_trials]
    elif hasattr(x, "get_x") and hasattr(x, "get_f"):  # a population of pygmo
        x, values = np.asarray(result.get_x()), np.asarray(result.get_f())[:, : problem.n_obj]
    elif hasattr(x, "X") and hasattr(x, "F"):  # pymoo, VAMOS
        if result.X is None:
            raise refuse("result", "has no design: its X is None, as where no feasible design was found")
        x, values = result.X, result.F
    elif not isinstance(x, pd.DataFrame):
        x = getattr(x, "result", x)
        x = x() if callable(x) else x
        if isinstance(x, Sequence) and x and hasattr(x[0], "variables"):
            x, values = [list(one.variables) for one in x], [list(one.objectives) for one in x]
    frame = x if isinstance(x, pd.DataFrame) else _frame(x, names)
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
    free = [problem.names.index(variable.name) for variable in problem.free]
    f, g = problem.searched(designs[:, free])
    if not isinstance(problem, PlainProblem):  # what a run reports as kept is kept
        g = problem.tested(designs[:, free])[1]
    feasible = np.all(g <= 0.0, axis=1) & np.isfinite(f).all(axis=1)
    points = designs_frame(problem, designs)[[problem.names[at] for at in free]]
    points = points.assign(**dict(zip(problem.objectives, f.T, strict=True)), feasible=feasible)
    runs = [search(problem, Hybrid(), Budget(evaluations=evaluations), seed + at) for at in range(seeds)]
    first = problem.objectives[0]
    if not isinstance(problem, PlainProblem):
        frame, proof = add_bounds(problem.frame(designs), problem)
        rows = dict.fromkeys(problem.objectives, NO_FORM if proof.missing else "declared")
        bounded = problem.priced if problem.priced in rows else first
        found = _Bounds(frame["bound"].to_numpy(dtype=float), bounded, rows, proof.statement)
    elif forms:
        known = np.concatenate([designs[:, free], *(run.x for run in runs)])
        found = _fitted_bounds(problem, points, known, np.random.default_rng(seed))
    else:
        found = _Bounds(np.full(len(f), np.nan), first, {}, "nothing is proven: no form was looked for")
    points = points.assign(bound=found.bound, gap_percent=_percent(points, found.bounded, found.bound, found.error))
    best = _best_known(f, np.concatenate([run.f for run in runs]))
    points = points.assign(best_known=best, distance_percent=_percent(points, first, best))
    scatter = _scatter(problem, {f"seed {seed + at}": run for at, run in enumerate(runs)}, f[feasible])
    lines = [*_compared(stated, f), *_lines(points, found, scatter, problem)]
    return Certificate(points, found.bounded, found.forms, found.statement, scatter, tuple(lines))


def _percent(points: pd.DataFrame, name: str, least: Array, error: float = 0.0) -> Array:
    """Distance (n,) of an objective from a least value in percent; NaN where that is none, or 0 but for an error."""
    known = points["feasible"] & (np.abs(least) > 100.0 * error) & np.isfinite(least)
    return np.asarray(100.0 * (points[name].to_numpy(dtype=float) - least) / np.where(known, np.abs(least), np.nan))


def _best_known(f: Array, known: Array) -> Array:
    """The least first objective (n,) of `known` points (k, objectives) at equal or better others; NaN without any."""
    best = np.full(len(f), np.nan)
    for at, point in enumerate(f):
        as_good = np.all(known[:, 1:] <= point[1:] + 1e-9 * np.abs(point[1:]), axis=1)
        best[at] = np.min(known[as_good, 0], initial=np.inf)
    return np.where(np.isfinite(best), best, np.nan)


@dataclass(frozen=True, eq=False)
class _Bounds:
    """Bounds (n,) of the objective `bounded`, the forms, what is proven, and the error of the bounded form."""

    bound: Array
    bounded: str
    forms: dict[str, str]
    statement: str
    error: float = 0.0


def _fitted_bounds(problem: PlainProblem, points: pd.DataFrame, known: Array, rng: np.random.Generator) -> _Bounds:
    """Bounds by forms that are fitted, verified at `known` designs (k, free variables) and where the least values lie.

    The first `points` designs are those of the result.
    """
    whole = [variable.integer for variable in problem.free]

    from_below = {limit.name: -limit.low for limit in problem.limits if np.isfinite(limit.low)}

    def values(designs: Array) -> tuple[Array, Mapping[str, Array]]:
        x = np.where(whole, np.rint(designs), designs)
        outputs = problem.outputs_of(problem.complete(x), errors=False)
        return x, {**outputs, **{f"-{name}": -np.asarray(outputs[name]) for name in from_below}}

    x, outputs = values(designs_to_fit(problem.xl, problem.xu, rng))
    first, held_out = x[:-HELD_OUT], x[-HELD_OUT:]
    limits = {limit.name: limit.high for limit in problem.limits if limit.count and limit.name in outputs}
    limits |= {f"-{name}": high for name, high in from_below.items()}
    names = list(dict.fromkeys((*problem.objectives, *limits)))
    rows = {name: fitted(x, np.asarray(outputs[name], dtype=float)) for name in names}
    words = {name: " or ".join(row.kind for row in found) or NO_FORM for name, found in rows.items()}
    # rows in the coordinates in which most are convex, of which the first objective with a form is bounded
    sets = [{n: r for n, found in rows.items() for r in found if r.coordinates == c} for c in (PLAIN, LOG)]
    bounded = next((name for name in problem.objectives if rows[name]), problem.objectives[0])
    chosen = max((known_rows for known_rows in sets if bounded in known_rows), key=len, default={})

    def unproven(why: str) -> _Bounds:
        return _Bounds(np.full(len(points), np.nan), bounded, words, f"nothing is proven: {why}")

    if any(variable.labels for variable in problem.free):
        return unproven("a choice has no order")
    if not chosen:
        return unproven("no objective agrees with a form that is convex and verified")
    if not points["feasible"].any():
        return unproven("no design of the result keeps the limits with finite objectives")
    at_points = [name for name in problem.objectives if name != bounded and name in chosen]
    fixed = [n for n, high in limits.items() if n in chosen and n not in (bounded, *at_points) and np.isfinite(high)]
    used = [bounded, *at_points, *fixed]
    most = points[at_points].assign(**{name: limits[name] for name in fixed}).to_numpy(dtype=float)
    most = np.minimum(most, [limits.get(name, np.inf) for name in (*at_points, *fixed)])
    bound, near = np.full(len(points), np.nan), [known]
    for row in np.flatnonzero(points["feasible"]):
        slack = 1e-9 * np.maximum(np.abs(most[row]), 1e-9)
        ends = (problem.xl, problem.xu)
        bound[row], least = least_value([chosen[name] for name in used], most[row] + slack, ends, known[row])
        reach = rng.choice(REACH, (AROUND, 1)) * (problem.xu - problem.xl)
        near += [least[None], least + reach * rng.normal(size=(AROUND, problem.n_var))]
    x, outputs = values(np.clip(np.concatenate(near), problem.xl, problem.xu))
    for name in used:
        wrong = chosen[name].deviations(x, np.asarray(outputs[name], dtype=float)) > chosen[name].error
        if np.any(wrong):
            at = (
                f"at {np.count_nonzero(wrong)} of {len(x)} designs of the result, of hybrid and around the least values"
            )
            return unproven(f"{name} is not {chosen[name].kind} {at}")
    tried = {*map(tuple, np.concatenate([held_out, x]).tolist())} - {*map(tuple, first.tolist())}
    forms = ", ".join(f"{name} ({chosen[name].kind})" for name in used)
    at = f" at {' and '.join(at_points)} no worse" if at_points else ""
    text = (
        f"no design has a lower {bounded} than the bound{at}, provided that the forms hold: {forms}; they agree at "
        f"{len(tried)} designs that they were not fitted to, those of the result, of hybrid and around the "
        "least values among them, which is verified there and not between them"
    )
    omitted = [name for name in names if name not in used]
    text += f"; left out, which makes the bound lower and not wrong: {', '.join(omitted)}" if omitted else ""
    form = chosen[bounded]
    return _Bounds(bound, bounded, words, text, float(np.sqrt(form.error)) if form.root else form.error)


def _scatter(problem: ToleranceProblem, runs: Mapping[str, Any], own: Array) -> pd.DataFrame:
    """A row for each seed, and for the result itself: evaluations, points, and the hypervolume or least value.

    The hypervolume is that in the box of all fronts together.
    """
    sources = [
        (name, run.evaluations, run.f[nondominated(run.f)] if len(run.f) else run.f) for name, run in runs.items()
    ]
    sources.append(("result", np.nan, own))
    whole = np.concatenate([values for _, _, values in sources])
    whole = whole[nondominated(whole)] if len(whole) else np.zeros((1, problem.n_obj))
    ideal, nadir = whole.min(axis=0), whole.max(axis=0)
    nadir = np.where(nadir > ideal, nadir, ideal + 1.0)
    rows = []
    for name, evaluations, values in sources:
        least = {"least": float(np.min(values, initial=np.inf))}
        measured = least if problem.n_obj == 1 else {"hypervolume": hypervolume(values, ideal, nadir)}
        rows.append({"source": name, "evaluations": evaluations, "points": len(values), **measured})
    return pd.DataFrame(rows)


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
    failed = int((~np.isfinite(points[list(problem.objectives)]).all(axis=1)).sum())
    lines = [f"{failed} of {count} designs have no value: an objective is not finite there"] if failed else []
    lines += [f"{feasible} of {count} designs keep the limits"] if failed < count and feasible < count else []
    gap = points["gap_percent"].dropna()
    if len(gap):
        middle, most = plain_number(float(gap.median())), plain_number(float(gap.max()))
        proven = "if the forms hold" if isinstance(problem, PlainProblem) else "proven"
        lines.append(f"{proven}: {found.bounded} is at most {most} % above its least value, {middle} % in the median")
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
        kept = (
            " within the limits" if any(limit.count for limit in problem.limits) else ", as no evaluation has a value"
        )
        return [*lines, f"scatter: from none of {seeds} hybrid found a design{kept}"]
    low, high, own = reached[measure].min(), reached[measure].max(), scatter.iloc[-1]
    text = f"scatter: {measure} from {plain_number(float(low))} to {plain_number(float(high))} over {seeds}"
    if missed := len(runs) - len(reached):
        text += f", of which {missed} found no design within the limits"
    return [*lines, text + (f", {plain_number(float(own[measure]))} of the result" if own["points"] > 0 else "")]


def _apart(percent: float) -> str:
    """Like "1.2 % above"."""
    return f"{plain_number(abs(percent))} % {'below' if percent < 0.0 else 'above'}"
