"""What tolerances do to requirements at points of a front: derivatives, contributions and prices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Kind, Variable
from .choice import COST

if TYPE_CHECKING:
    import pandas as pd

# Derivatives of outputs by tolerances, from the model or by differences.


STEP = 1e-3
"""Relative step of a tolerance where an output has no derivative."""
MAX_PRICED_DESIGNS = 1000
"""Points with derivatives at most, evenly spaced along the front."""
SETTING = 0.1
"""Fraction of its range by which a searched variable that is no tolerance is weighted."""
PER_GRADE = 0.5 * np.log(2.0)
"""Relative width of a tolerance per grade: sqrt 2."""


def tolerances_of(problem: ToleranceProblem) -> list[Variable]:
    """Every tolerance, the fixed ones included."""
    return [variable for variable in problem.variables if variable.tolerance]


def settings_of(problem: ToleranceProblem) -> list[Variable]:
    """Searched variables that are no tolerances, as a modification or a preload: an optimum sets them as well."""
    return [v for v in problem.free if not (v.tolerance or v.integer or v.labels)]


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Derivatives at some points of a front.

    `rows` (n,) are the points, `designs` (n, all variables) theirs. `along` has t dy/dt (n,
    tolerances + settings) by requirement y, `source` the output whose derivative it is, and `saved`
    -t dC/dt (n, tolerances + settings) of the cost C; t are the `widths`.
    """

    rows: NDArray[np.int64]
    designs: Array
    along: Mapping[str, Array]
    source: Mapping[str, str]
    saved: Array


def slopes_of(problem: ToleranceProblem, designs: Array) -> Slopes:
    """The derivatives of the objectives but the one that is priced, and of the limited outputs, by tolerance.

    At most `MAX_PRICED_DESIGNS` designs, evenly spaced. Where an objective has no derivative, that of the output
    that explains it is taken; what has none is differenced, but no limited output of a sample.
    """
    rows = np.unique(np.linspace(0, len(designs) - 1, MAX_PRICED_DESIGNS).astype(np.int64))
    selected, moved = designs[rows], [*tolerances_of(problem), *settings_of(problem)]
    known = problem.slopes(selected)
    names = [name for name in problem.objectives if name != problem.priced]
    limited = [limit.name for limit in problem.limits if limit.count and limit.name != problem.priced]
    differenced = set() if problem.declaration.sampled else {output.name for output in problem.outputs}
    names += [name for name in limited if name in differenced.union(known) and name not in names]
    at = [problem.names.index(v.name) for v in moved]
    wide = np.stack([widths(problem, selected, v) for v in moved], axis=1) if moved else selected[:, :0]
    explained = {name: problem.declaration.explained.get(name, name) for name in problem.objectives}
    source = {name: name if name in known else explained.get(name, name) for name in names}
    if unknown := [name for name in source.values() if name not in known]:
        known = known | _differences(problem, selected, unknown, moved)
    along = {name: wide * known[source[name]][:, at] for name in names}
    cost = known[problem.priced] if problem.priced in known else problem.cost_slopes(selected)
    with np.errstate(invalid="ignore"):
        saved = -wide * cost[:, at]
    return Slopes(rows, selected, along, source, saved)


def widths(problem: ToleranceProblem, designs: Array, variable: Variable) -> Array:
    """t of t dy/dt (n,); for a grade, the factor of dy/dgrade; for a setting, a part of its range."""
    if not variable.tolerance:
        low, high = problem.interval(variable.name)
        return np.full(len(designs), SETTING * (high - low))
    if variable.kind is Kind.GRADE:
        return np.full(len(designs), 1.0 / PER_GRADE)
    return problem.column(designs, variable.name)


def _differences(
    problem: ToleranceProblem, designs: Array, outputs: list[str], variables: list[Variable]
) -> dict[str, Array]:
    """Derivatives (n, all variables) by one-sided differences of outputs in a search."""
    base = problem.outputs_of(designs, searching=True)
    derivatives = {output: np.zeros_like(designs) for output in outputs}
    for variable in variables:
        at, moved = problem.names.index(variable.name), designs.copy()
        step = STEP * widths(problem, designs, variable)
        if not np.any(step):
            continue
        moved[:, at] += step
        values = problem.outputs_of(moved, searching=True)
        for output in outputs:
            change = values[output] - base[output]
            derivatives[output][:, at] = np.divide(change, step, out=np.zeros_like(step), where=step != 0.0)
    return derivatives


# Which tolerance matters how much at a point: shares of a requirement in percent.


CANCELLED = 1e-3
"""Fraction of the magnitudes below which a sum of contributions counts as zero."""


def contributions(problem: ToleranceProblem, slopes: Slopes) -> pd.DataFrame:
    """Share [%] of every tolerance in every requirement at the points of `slopes`.

    The share is t dy/dt over its sum over all tolerances, fixed ones included, so that the shares
    of a point add up to 100 %: of a root sum of squares it is the share of the variance, of a worst
    case that of the sum. It is negative where wider is better. One row per point and output:
    `point`, `output`, `explained` (the output whose derivative is taken, where the objective has
    none), `along` (the sum of t dy/dt, in the unit of the output; NaN shares where it cancels) and
    a column per tolerance.
    """
    import pandas as pd

    names = [v.name for v in tolerances_of(problem)]
    if not names or not slopes.along:
        return pd.DataFrame()
    frames = []
    for output, slopes_along in slopes.along.items():
        slopes_along = slopes_along[:, : len(names)]
        frame = pd.DataFrame(_shares(slopes_along), columns=names)
        frame.insert(0, "point", slopes.rows)
        frame.insert(1, "output", output)
        frame.insert(2, "explained", slopes.source[output])
        frame.insert(3, "along", slopes_along.sum(axis=1))
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def _shares(along: Array) -> Array:
    """Contributions `along` (n, tolerances) over their sum, in percent."""
    whole, size = along.sum(axis=1, keepdims=True), np.abs(along).sum(axis=1, keepdims=True)
    known = np.abs(whole) > CANCELLED * size
    return np.asarray(100.0 * np.divide(along, whole, out=np.full_like(along, np.nan), where=known))


# What a requirement costs at each point: the slope of the least cost.


PROVEN = 0.01
"""Gap [percent] up to which a point counts as optimal, so that multipliers hold there."""
FITS = 1.0
"""Residual of the conditions [percent] up to which they hold there."""
ROUGH = 30.0
"""The same beyond which they give no price."""
EDGE = 1e-6
"""Fraction of its range by which a tolerance is inside of its bounds."""
BINDING = 1e-3
"""Fraction of a limit within which it binds."""
NEAR_ALL = 10.0
"""The same as a multiple of it, of what a limit in percent leaves to 100 %."""
PERCENT = ("percent", "%")
"""Units of outputs that end at 100."""
ERRORS = 2.0
"""Standard errors of a sampled value within which it is at its limit."""
VANISHED = 1e-9
"""Fraction of a requirement below which its change with the tolerances counts as none."""
NEIGHBOURS = 2
"""Points on either side by which the slope of a front is taken."""


def prices(problem: ToleranceProblem, front: pd.DataFrame, slopes: Slopes) -> pd.DataFrame:
    """What one unit less of each requirement costs at points of a front; of a lower limit (a
    yield), one unit more.

    At the least cost -dC/dt_j = sum_i price_i s_i dy_i/dt_j for every tolerance and setting inside of its
    bounds (Karush, Kuhn and Tucker), s_i -1 at a lower limit and else 1; the prices, none below 0,
    fit that best, each tolerance weighted by its width. Limits that an optimum does not use up have
    the price 0; at a point that is none (not proven, and a residual above `FITS`) it is not known, nor is
    any price where the residual is above `ROUGH`, or where no tolerance changes a requirement, as a
    yield of 100 %. Columns: `point`, `output`, `unit`, `tighter` (`less` of the output, or `more` of one with
    a lower limit), `price` (cost per unit of the output), `source`: `multiplier` where the point is
    proven optimal (gap at most `PROVEN` %) and the conditions hold, `front` where there are none
    and it is the slope of the front of two objectives, else `estimate`, with `spread_percent`, the
    residual of the conditions. Where another column of costs is minimised, prices are in its unit and `price_of`
    names it.
    """
    import pandas as pd

    names, rows = list(slopes.along), slopes.rows
    if front.empty or not names or not slopes.saved.size or problem.priced not in front:
        return pd.DataFrame()
    binding, sides, sizes = _limits_at(problem, front.iloc[rows], names)
    fitted, residual = _fit_prices(problem, slopes, binding, sides, sizes)
    units = {output.name: output.unit for output in problem.outputs}
    proven, fits = _is_proven(front)[rows], residual <= FITS
    sure, rough = proven & fits, binding & (residual > ROUGH)[:, None]
    fitted[~binding & ~(proven | fits)[:, None]] = np.nan
    sources = np.where(sure, "multiplier", "estimate").astype(object)
    frames = []
    for at, name in enumerate(names):
        price, source = fitted[:, at], sources.copy()
        slope = front_slopes(front, name, problem.priced) if name in problem.objectives else None
        if slope is not None:
            known = np.isfinite(slope[rows]) & (source == "estimate") & np.isnan(residual)
            price, source = np.where(known, slope[rows], price), np.where(known, "front", source)
        price = np.where(rough[:, at], np.nan, price)
        columns = {"point": rows, "output": name, "unit": units.get(name, "")}
        columns |= {"tighter": np.where(sides[:, at] < 0.0, "more", "less"), "price": price, "source": source}
        columns |= {"spread_percent": residual}
        frames.append(pd.DataFrame(columns | ({"price_of": problem.priced} if problem.priced != COST else {})))
    return pd.concat(frames, ignore_index=True)


def points_at_limit(limit: Limit, front: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether points (n,) of a front use a limit up, by their margin and the error of their value."""
    margin, error = (
        front[name].fillna(0.0).to_numpy(dtype=float) if name in front else np.zeros(len(front))
        for name in (f"margin_{limit.name}", f"{limit.name}_error")
    )
    ends = [abs(end) for end in (limit.low, limit.high) if np.isfinite(end) and end != 0.0]
    if limit.unit in PERCENT:
        ends += [NEAR_ALL * (100.0 - end) for end in (limit.low, limit.high) if 0.0 < end < 100.0]
    return np.asarray(margin <= np.maximum(BINDING * min(ends, default=limit.scale), ERRORS * error))


def _fit_prices(
    problem: ToleranceProblem, slopes: Slopes, binding: NDArray[np.bool_], sides: Array, sizes: Array
) -> tuple[Array, Array]:
    """Prices (n, requirements) by the conditions of an optimum, and their residual [%] (n,).

    NaN where tolerances do not change a requirement of such a size (n, requirements).
    """
    free = {v.name: at for at, v in enumerate(problem.free)}
    moved = [*tolerances_of(problem), *settings_of(problem)]
    designs, save = slopes.designs, slopes.saved
    along = np.stack(list(slopes.along.values()), axis=2)
    inside = np.zeros_like(save, dtype=bool)
    for at, v in enumerate(moved):
        if v.name in free and not v.integer:
            ends = np.array([problem.room(v.name, design) for design in designs])
            edge = EDGE * (ends[:, 1] - ends[:, 0])
            widths = problem.column(designs, v.name)
            inside[:, at] = (widths > ends[:, 0] + edge) & (widths < ends[:, 1] - edge)
    inside &= np.isfinite(save)
    prices = np.where(binding, np.nan, 0.0)
    residuals = np.full(len(designs), np.nan)
    for row in range(len(designs)):
        inner, used = inside[row], np.flatnonzero(binding[row])
        right = save[row, inner]
        if not len(used) or not np.any(inner) or not np.any(right):
            continue
        matrix = along[row][inner][:, used] * sides[row, used]
        size = np.linalg.norm(matrix, axis=0)
        known = size > VANISHED * sizes[row, used]
        if not np.any(known):
            continue
        used, matrix, size = used[known], matrix[:, known], size[known]
        scaled = matrix / np.where(size > 0.0, size, 1.0)
        solution, residual = _nonnegative_least_squares(scaled, right)
        prices[row, used] = np.divide(solution, size, out=np.zeros_like(size), where=size > 0.0)
        residuals[row] = 100.0 * residual / np.linalg.norm(right)
    return prices, residuals


def _nonnegative_least_squares(matrix: Array, right: Array) -> tuple[Array, float]:
    """The x >= 0 with the least residual of matrix x = right, and that residual; unit columns."""
    if matrix.shape[1] > 1:
        solution, residual = scipy.optimize.nnls(matrix, right)
        return np.asarray(solution), float(residual)
    x = np.maximum(matrix.T @ right, 0.0)
    return x, float(np.linalg.norm(matrix @ x - right))


def _limits_at(
    problem: ToleranceProblem, front: pd.DataFrame, names: list[str]
) -> tuple[NDArray[np.bool_], Array, Array]:
    """Which requirements (n, requirements) are used up (objectives always are), their sides: -1
    where the nearer limit is a lower one, else 1; and their sizes: infinite where 100 % is asked for.
    """
    binding, sides = np.ones((len(front), len(names)), dtype=bool), np.ones((len(front), len(names)))
    sizes = np.abs(front[names].to_numpy(dtype=float)) if set(names) <= set(front) else np.ones(sides.shape)
    limits = {limit.name: limit for limit in problem.limits}
    for at, name in enumerate(names):
        if name not in problem.objectives:
            limit, value = limits[name], front[name].to_numpy(dtype=float)
            binding[:, at] = points_at_limit(limit, front)
            sides[value - limit.low < limit.high - value, at] = -1.0
            if limit.unit in PERCENT and limit.low >= 100.0:  # no more of it can be had, and no less be told
                sizes[:, at] = np.inf
    return binding, sides, sizes


def _is_proven(front: pd.DataFrame) -> NDArray[np.bool_]:
    if "gap_percent" not in front:
        return np.zeros(len(front), dtype=bool)
    return np.asarray(front["gap_percent"].to_numpy(dtype=float) <= PROVEN)


def front_slopes(front: pd.DataFrame, name: str, priced: str = COST) -> Array | None:
    """-d cost/d`name` (n,) of a front of two objectives by its points on either side; else None.

    NaN where the points are too few.
    """
    values, cost = front[name].to_numpy(dtype=float), front[priced].to_numpy(dtype=float)
    order = np.argsort(values, kind="stable")
    if len(order) < 3 or np.any(np.diff(cost[order]) > 0.0):
        return None
    places = np.arange(len(order))
    low = order[np.maximum(places - NEIGHBOURS, 0)]
    high = order[np.minimum(places + NEIGHBOURS, len(order) - 1)]
    run = values[high] - values[low]
    slopes = np.full(len(order), np.nan)
    slopes[order] = np.divide(cost[low] - cost[high], run, out=np.full_like(run, np.nan), where=run > 0.0)
    return slopes
