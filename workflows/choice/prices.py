"""What a requirement costs at each point: the slope of the least cost."""

from __future__ import annotations

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.interfaces import Drawing
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from .rule import COST
from .slopes import Slopes, tolerances_of

PROVEN = 0.01
"""Gap [percent] up to which a point counts as optimal, so that multipliers hold there."""
FITS = 1.0
"""Residual of the conditions [percent] up to which they hold there."""
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

    At the least cost -dC/dt_j = sum_i price_i s_i dy_i/dt_j for every tolerance inside of its
    bounds (Karush, Kuhn and Tucker), s_i -1 at a lower limit and else 1; the prices, none below 0,
    fit that best, each tolerance weighted by its width. Limits that a point does not use up have
    the price 0; where no tolerance changes a requirement, as a yield of 100 %, its price is not
    known. Columns: `point`, `output`, `unit`, `tighter` (`less` of the output, or `more` of one with
    a lower limit), `price` (cost per unit of the output), `source`: `multiplier` where the point is
    proven optimal (gap at most `PROVEN` %) and the conditions hold, `front` where it is the slope of
    the front of two objectives, else `estimate`, with `spread_percent`, the residual of the
    conditions.
    """
    names, rows = list(slopes.along), slopes.rows
    if front.empty or not names or not slopes.saved.size or COST not in front:
        return pd.DataFrame()
    binding, sides, sizes = _limits_at(problem, front.iloc[rows], names)
    fitted, residual = _fitted(problem, slopes, binding, sides, sizes)
    units = {output.name: output.unit for output in problem.outputs}
    sure = _proven(front)[rows] & (residual <= FITS)
    sources = np.where(sure, "multiplier", "estimate").astype(object)
    frames = []
    for at, name in enumerate(names):
        price, source = fitted[:, at], sources.copy()
        slope = front_slopes(front, name) if name in problem.objectives else None
        if slope is not None:
            known = np.isfinite(slope[rows]) & (source == "estimate")
            price, source = np.where(known, slope[rows], price), np.where(known, "front", source)
        columns = {"point": rows, "output": name, "unit": units.get(name, "")}
        columns |= {"tighter": np.where(sides[:, at] < 0.0, "more", "less"), "price": price, "source": source}
        frames.append(pd.DataFrame(columns | {"spread_percent": residual}))
    return pd.concat(frames, ignore_index=True)


def used_up(limit: Limit, front: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether points (n,) of a front use a limit up, by their margin and the error of their value."""
    margin, error = (
        front[name].fillna(0.0).to_numpy(dtype=float) if name in front else np.zeros(len(front))
        for name in (f"margin_{limit.name}", f"{limit.name}_error")
    )
    ends = [abs(end) for end in (limit.low, limit.high) if np.isfinite(end) and end != 0.0]
    if limit.unit in PERCENT:
        ends += [NEAR_ALL * (100.0 - end) for end in (limit.low, limit.high) if 0.0 < end < 100.0]
    return np.asarray(margin <= np.maximum(BINDING * min(ends, default=limit.scale), ERRORS * error))


def _fitted(
    problem: ToleranceProblem, slopes: Slopes, binding: NDArray[np.bool_], sides: Array, sizes: Array
) -> tuple[Array, Array]:
    """Prices (n, requirements) by the conditions of an optimum, and their residual [%] (n,).

    NaN where tolerances do not change a requirement of such a size (n, requirements).
    """
    free = {v.name: at for at, v in enumerate(problem.free)}
    tolerances = tolerances_of(problem)
    designs, save = slopes.designs, slopes.saved
    along = np.stack(list(slopes.along.values()), axis=2)
    inside = np.zeros_like(save, dtype=bool)
    for at, v in enumerate(tolerances):
        if v.name in free and not v.integer:
            ends = np.array([Drawing.of(problem).room(v.name, design) for design in designs])
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
        solution, residual = _above_zero(scaled, right)
        prices[row, used] = np.divide(solution, size, out=np.zeros_like(size), where=size > 0.0)
        residuals[row] = 100.0 * residual / np.linalg.norm(right)
    return prices, residuals


def _above_zero(matrix: Array, right: Array) -> tuple[Array, float]:
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
            binding[:, at] = used_up(limit, front)
            sides[value - limit.low < limit.high - value, at] = -1.0
            if limit.unit in PERCENT and limit.low >= 100.0:  # no more of it can be had, and no less be told
                sizes[:, at] = np.inf
    return binding, sides, sizes


def _proven(front: pd.DataFrame) -> NDArray[np.bool_]:
    if "gap_percent" not in front:
        return np.zeros(len(front), dtype=bool)
    return np.asarray(front["gap_percent"].to_numpy(dtype=float) <= PROVEN)


def front_slopes(front: pd.DataFrame, name: str) -> Array | None:
    """-d cost/d`name` (n,) of a front of two objectives by its points on either side; else None.

    NaN where the points are too few.
    """
    values, cost = front[name].to_numpy(dtype=float), front[COST].to_numpy(dtype=float)
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
