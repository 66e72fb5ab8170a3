"""Machines as ways of the convex form of a stack.

The variable of an inspected machine is its limit t where worst cases alone are asked for, else the
spread x of its good parts: the variance of the requirement is a sum of squares in it, and the cost
of a good part is convex in it (docs/stack.md, "Machines"). What grows otherwise, the limit itself
in a worst case and the mean of a machine that is not centred, is then replaced in each of `CELLS`
pieces of the range by a line below it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...arrays import Array
from ...models.costs import Reciprocal
from ...models.machines import GoodPartsBySpread, convex_cost
from ..forms import Way
from ..limits import overlap
from .definition import Part, Process
from .parts_as_made import by_spread, spread_and_mean
from .rows import Row

CELLS = 6
"""Pieces of the range of a spread, where something is replaced by lines below it."""
TRIED = 33
"""Points of a piece at which a line is tested to lie below."""
ROUNDING = 1e-9
"""Fraction of its scale by which a line keeps below."""


def machine_ways(
    part: Part, number: int, rows: list[Row], at: int, limits: tuple[float, float]
) -> tuple[list[Way], bool]:
    """Ways of a process by machine within limits on t, and whether they are exact."""
    process = part.processes[number]
    common = overlap((process.low, process.high), limits)
    if common is None:
        return [], True
    low, high = common
    if process.low == process.high:
        return [_fixed(part, number, rows, at)], True
    if limits_alone(rows):
        assert process.curve is not None
        used, exact = convex_cost(process.curve, np.linspace(low, high, TRIED**2))
        slopes = tuple(float(row.linear[at]) for row in rows)
        return [Way(used, low, high, slopes, (0.0,) * len(rows), choice=float(number))], exact
    curve = by_spread(part, process)
    used, exact = convex_cost(curve, curve.tabulated)
    cells = CELLS if _moves(process, rows, at) else 1
    ends = spread_and_mean(part, process, np.linspace(low, high, cells + 1))[0]
    if not any(row.linear[at] for row in rows):
        ends = np.linspace(ends[0], ends[-1], cells + 1)
    ways = []
    for first, last in pairwise(ends.tolist()):
        slopes, offsets = _below(process, rows, at, curve, first, last)
        spread = tuple(row.spread_of(at, number) for row in rows)
        ways.append(Way(used, first, last, slopes, spread, offsets, float(number)))
    return ways, exact and cells == 1


def limits_alone(rows: list[Row]) -> bool:
    """Whether limits t are the variables: where nothing but worst cases is asked for."""
    return not any(np.any(row.spread) for row in rows)


def _fixed(part: Part, number: int, rows: list[Row], at: int) -> Way:
    """A machine without inspection: one point."""
    process = part.processes[number]
    assert process.machine is not None
    t = np.array([process.low])
    spread, mean = (float(values[0]) for values in spread_and_mean(part, process, t))
    x = process.low if limits_alone(rows) else spread
    return Way(
        curve=process.curve or Reciprocal(0.0, 0.0),
        low=x,
        high=x,
        linear=(0.0,) * len(rows),
        spread=tuple(row.spread_of(at, number) for row in rows),
        offset=tuple(float(_moved(row, at, t, np.array([mean]))[0]) for row in rows),
        choice=float(number),
    )


def _moved(row: Row, at: int, t: Array, mean: Array) -> Array:
    """What limits and means of a part add to a row in addition to its spread."""
    return np.asarray(row.linear[at] * t + row.bias_of(at) * mean + row.shift_of(at) * np.abs(mean))


def _moves(process: Process, rows: list[Row], at: int) -> bool:
    """Whether a row contains more of a part than its spread."""
    off_centre = process.machine is not None and process.machine.mean != 0.0
    return any(row.linear[at] != 0.0 or (off_centre and (row.bias_of(at) or row.shift_of(at))) for row in rows)


def _below(
    process: Process, rows: list[Row], at: int, curve: GoodPartsBySpread, low: float, high: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Slopes and offsets of lines below what a part adds to the rows between two spreads."""
    assert process.machine is not None
    x = np.linspace(low, high, TRIED)
    t = curve.limit(x)
    mean = process.machine.good_parts(t).mean
    slopes, offsets = [], []
    for row in rows:
        value = _moved(row, at, t, mean)
        slope = float((value[-1] - value[0]) / (high - low)) if high > low else 0.0
        slopes.append(slope)
        bend = float(np.max(np.abs(np.diff(value, 2)))) if len(value) > 2 else 0.0
        rest = float(np.min(value - slope * x)) - bend
        offsets.append(rest - ROUNDING * abs(rest) if np.any(value) else 0.0)
    return tuple(slopes), tuple(offsets)
