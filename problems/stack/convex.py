"""The convex form of a stack, with which bounds of its cost are proven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...models import machine_offers
from ...models.capability import PartSample
from ...models.costs import Reciprocal
from ...models.machines import GoodPartsBySpread, convex_cost
from ...section import Array, Flags, Integers
from ..forms import Feature, Form, Way
from ..limits import Limit, keeps, narrow_range, overlap
from ..settings import YIELD
from .definition import Part, Process, limits_of, process_by_spread, spread_and_mean
from .promises import LEAST
from .rows import BOTH, Row, quantile_of, rows_of, surplus_of

if TYPE_CHECKING:
    from .problem import Stack

# Machines as ways of the convex form of a stack.
#
# The variable of an inspected machine is its limit t where worst cases alone are asked for, else the
# spread x of its good parts: the variance of the requirement is a sum of squares in it, and the cost
# of a good part is convex in it (docs/stack.md, "Machines"). What grows otherwise, the limit itself
# in a worst case and the mean of a machine that is not centred, is then replaced in each of `CELLS`
# pieces of the range by a line below it.


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
        return [_fixed_way(part, number, rows, at)], True
    if has_only_limit_rows(rows):
        assert process.curve is not None
        used, exact = convex_cost(process.curve, np.linspace(low, high, TRIED**2))
        slopes = tuple(float(row.linear[at]) for row in rows)
        return [Way(used, low, high, slopes, (0.0,) * len(rows), choice=float(number))], exact
    curve = process_by_spread(part, process)
    used, exact = convex_cost(curve, curve.tabulated)
    cells = CELLS if _has_other_terms(process, rows, at) else 1
    ends = spread_and_mean(part, process, np.linspace(low, high, cells + 1))[0]
    if not any(row.linear[at] for row in rows):
        ends = np.linspace(ends[0], ends[-1], cells + 1)
    ways = []
    for first, last in pairwise(ends.tolist()):
        slopes, offsets = _lines_below(process, rows, at, curve, first, last)
        spread = tuple(row.spread_of(at, number) for row in rows)
        ways.append(Way(used, first, last, slopes, spread, offsets, float(number)))
    return ways, exact and cells == 1


def has_only_limit_rows(rows: list[Row]) -> bool:
    """Whether limits t are the variables: where nothing but worst cases is asked for."""
    return not any(np.any(row.spread) for row in rows)


def _fixed_way(part: Part, number: int, rows: list[Row], at: int) -> Way:
    """A machine without inspection: one point."""
    process = part.processes[number]
    assert process.machine is not None
    t = np.array([process.low])
    spread, mean = (float(values[0]) for values in spread_and_mean(part, process, t))
    x = process.low if has_only_limit_rows(rows) else spread
    return Way(
        curve=process.curve or Reciprocal(0.0, 0.0),
        low=x,
        high=x,
        linear=(0.0,) * len(rows),
        spread=tuple(row.spread_of(at, number) for row in rows),
        offset=tuple(float(_limit_and_mean_terms(row, at, t, np.array([mean]))[0]) for row in rows),
        choice=float(number),
    )


def _limit_and_mean_terms(row: Row, at: int, t: Array, mean: Array) -> Array:
    """What limits and means of a part add to a row in addition to its spread."""
    return np.asarray(row.linear[at] * t + row.bias_of(at) * mean + row.shift_of(at) * np.abs(mean))


def _has_other_terms(process: Process, rows: list[Row], at: int) -> bool:
    """Whether a row contains more of a part than its spread."""
    off_centre = process.machine is not None and process.machine.mean != 0.0
    return any(row.linear[at] != 0.0 or (off_centre and (row.bias_of(at) or row.shift_of(at))) for row in rows)


def _lines_below(
    process: Process, rows: list[Row], at: int, curve: GoodPartsBySpread, low: float, high: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Slopes and offsets of lines below what a part adds to the rows between two spreads."""
    assert process.machine is not None
    x = np.linspace(low, high, TRIED)
    t = curve.limit(x)
    mean = process.machine.good_parts(t).mean
    slopes, offsets = [], []
    for row in rows:
        value = _limit_and_mean_terms(row, at, t, mean)
        slope = float((value[-1] - value[0]) / (high - low)) if high > low else 0.0
        slopes.append(slope)
        bend = float(np.max(np.abs(np.diff(value, 2)))) if len(value) > 2 else 0.0
        rest = float(np.min(value - slope * x)) - bend
        offsets.append(rest - ROUNDING * abs(rest) if np.any(value) else 0.0)
    return tuple(slopes), tuple(offsets)


FREE = Reciprocal(a=0.0, b=0.0)
"""Cost of a part that has none."""


def form_of(stack: Stack, gaussian: bool = False) -> Form | None:
    """The convex form of what is asked for; None where limits leave no process.

    Fixed parts go into the offset and the constant, but for those that are correlated with others.
    None as well where the half-width of a sample has no law, unless the root sum square may stand
    for it (`gaussian`).
    """
    rows = rows_of(stack, gaussian)
    if not rows or not has_process_within_limits(stack) or _has_varying_correlation(stack):
        return None
    linear = np.array([row.linear for row in rows])
    parts, t = stack.definition.parts, np.array([part.low for part in stack.definition.parts])
    settled, correlation = _settled_parts(stack), _correlation(stack)
    kept = [at for at in range(len(parts)) if not settled[at]]
    within = correlation[np.ix_(kept, kept)]
    left_out = _omitted_limits(stack, rows)
    independent = np.array_equal(within, np.eye(len(kept)))
    quantiles = tuple(quantile_of(row, kept, settled, t) for row in rows)
    rooted = [0.0 if row.probability else _square(row.spread, t, correlation, settled) for row in rows]
    surpluses = tuple(surplus_of(row, kept, settled, t) for row in rows)
    names = [row.output for row in rows if row.most < np.inf and not row.promised]
    limited = any(row.most < np.inf for row in rows)
    features = [_feature(parts[at], rows, at, range_of(stack, parts[at])) for at in kept]
    return Form(
        outputs=tuple(row.output for row in rows),
        features=tuple(feature for feature, _ in features),
        offset=linear[:, settled] @ t[settled] + [row.constant for row in rows],
        constant=np.array(rooted),
        statement=_statement(stack, rows, left_out),
        base=float(sum(_fixed_cost(p) for p, out in zip(parts, settled, strict=True) if out)),
        correlation=None if independent else within,
        exact=(
            len(names) == len(set(names))
            and all(exact for _, exact in features)
            and all(row.even_doubt for row in rows)
        ),
        relaxed=left_out,
        tested=tuple(limit.name for limit in stack.limits if limit.name in _domains(stack)),
        quantiles=quantiles if any(quantile is not None for quantile in quantiles) else (),
        most=tuple(row.most for row in rows) if limited else (),
        surpluses=surpluses if any(surplus is not None for surplus in surpluses) else (),
        labels=tuple((row.label, row.measured.requirement.unit if row.most < np.inf else "") for row in rows),
    )


def limits_by_spread(stack: Stack, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns (n,) of a form with limits of inspection in place of the spread of good parts."""
    with_limits = dict(columns)
    if has_only_limit_rows(rows_of(stack, gaussian=True)):
        return with_limits
    for part in stack.definition.parts:
        if part.by_machine and (name := f"{part.name}_t") in with_limits:
            chosen = np.zeros(len(with_limits[name]), dtype=np.int64)
            if (choice := f"{part.name}_process") in with_limits:
                chosen = np.rint(with_limits[choice]).astype(np.int64)
            with_limits[name] = limits_of(part, with_limits[name], chosen)
    return with_limits


def _has_varying_correlation(stack: Stack) -> bool:
    """Whether the correlation of two parts differs between requirements.

    It does where a correlated piece shares its tolerance with others.
    """
    definition = stack.definition
    if not definition.requirement.key:
        return False
    named = {piece for correlation in definition.correlations for piece in correlation.pieces}
    return any(part.count > 1 and named & set(part.pieces) for part in definition.parts)


def has_process_within_limits(stack: Stack) -> bool:
    """Whether every part has a process within the limits."""
    ends = [(part, *range_of(stack, part)) for part in stack.definition.parts]
    return all(
        any(overlap((process.low, process.high), (low, high)) for process in part.processes) for part, low, high in ends
    )


def _correlation(stack: Stack) -> Array:
    """Correlation (parts, parts) of the contributions of the parts."""
    covariance, mechanism = stack.linear.covariance, stack.definition.mechanism
    if stack.definition.requirement.key:
        coefficients = np.eye(len(covariance))
        if mechanism.correlation is not None:
            owners = mechanism.owners
            for i, j in zip(*np.nonzero(np.triu(mechanism.correlation, 1)), strict=True):
                pair = owners[i], owners[j]
                coefficients[pair] = coefficients[pair[::-1]] = mechanism.correlation[i, j]
        return coefficients
    diagonal = np.sqrt(np.diag(covariance))
    safe = np.where(diagonal > 0.0, diagonal, 1.0)  # 0: pieces that compensate each other wholly
    correlation = covariance / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation)


def _settled_parts(stack: Stack) -> Flags:
    """Whether a part is fixed and varies independently of all others, or not at all (parts,)."""
    alone = np.count_nonzero(_correlation(stack), axis=1) <= 1
    fixed = np.array([part.fixed for part in stack.definition.parts])
    none = np.array([part.high <= 0.0 for part in stack.definition.parts])
    return np.asarray(fixed & (alone | none))


def _square(spread: Array, t: Array, correlation: Array, settled: Flags) -> float:
    along = (spread * t)[settled]
    return float(along @ correlation[np.ix_(settled, settled)] @ along)


def range_of(stack: Stack, part: Part) -> tuple[float, float]:
    """The range of a part's tolerance within the limits on it."""
    return narrow_range(stack.limits, f"{part.name}_t")


def _feature(part: Part, rows: list[Row], at: int, ends: tuple[float, float]) -> tuple[Feature, bool]:
    """The processes of a part as ways, and whether these are exact."""
    ways: list[Way] = []
    whole = True
    for number, process in enumerate(part.processes):
        if process.machine is not None:
            ways_by_machine, exact = machine_ways(part, number, rows, at, ends)
            ways, whole = ways + ways_by_machine, whole and exact
            continue
        common = overlap((process.low, process.high), ends)
        if common is not None:
            low, high = common
            choice = float(number) if part.alternatives else 0.0
            linear = tuple(float(row.linear[at]) for row in rows)
            spread = tuple(row.spread_of(at, number) for row in rows)
            ways.append(Way(process.curve or FREE, low, high, linear, spread, choice=choice))
    choice_name = f"{part.name}_process" if part.alternatives else ""
    return Feature(f"{part.name}_t", tuple(ways), choice_name, part.count), whole


def _fixed_cost(part: Part) -> float:
    curve = part.processes[0].curve
    return 0.0 if curve is None else part.count * float(curve.cost(np.array([part.low]))[0])


def _statement(stack: Stack, rows: list[Row], left_out: tuple[str, ...]) -> str:
    """The proven statement: which model, and which variations."""
    words = {
        "worst_case": "its worst case",
        "rss": "its root sum square",
        "shifted_rss": "mean shifts plus root sum square",
        "monte_carlo": "half the width that holds the coverage",
    }
    more = f"; limits left out: {', '.join(left_out)}" if left_out else ""
    outputs = [row.output for row in rows if row.most < np.inf and not row.promised]
    for name in dict.fromkeys(name for name in outputs if outputs.count(name) > 1):
        even = any(row.output == name and row.limit == BOTH for row in rows)
        more += f"; each limit of {name} kept at the whole yield{', and two as if even about the mean' if even else ''}"
        more += ", which bounds all together"
    for measured in stack.measured:
        asked = {measured.name(YIELD), YIELD} if measured.mechanism.bounded else {measured.name(YIELD)}
        if not asked.isdisjoint(left_out) and isinstance(measured.law, str):
            more += f" ({measured.law})"
    if stack.promises is not None and any(row.promised for row in rows):
        more += f"; promised: {stack.promises.promise.words()}, by normal processes as measured"
    if any(part.by_machine for part in stack.definition.parts):
        more += "; good parts of an inspected machine are normal with the mean and scatter of that machine"
    if not stack.definition.requirement.key:
        return f"least cost of the linearised stack, variation = {words[rows[0].method]}{more}"
    methods = ", ".join(dict.fromkeys(f"{row.output} by {row.method}" for row in rows))
    return f"least cost of the linearised stack ({methods}){more}"


def _omitted_limits(stack: Stack, rows: list[Row]) -> tuple[str, ...]:
    """Limits that the form cannot keep: on other quantities, from below, or where some requirement has no row."""
    with_row = {row.measured for row in rows if row.output == YIELD}
    partial = {YIELD} if any(m.mechanism.bounded and m not in with_row for m in stack.measured) else set()
    tolerances = {f"{part.name}_t" for part in stack.definition.parts if not part.fixed}
    tested = _domains(stack)
    known = {*(row.output for row in rows), *stack.cost_names} - partial
    return tuple(
        limit.name
        for limit in stack.limits
        if limit.name not in tolerances | tested and (limit.name not in known or _drops_a_side(limit))
    )


def _drops_a_side(limit: Limit) -> bool:
    """Whether the form leaves out one side of a limit on an output that it has."""
    return bool(np.isfinite(limit.high if limit.name.endswith((YIELD, LEAST)) else limit.low))


def _domains(stack: Stack) -> set[str]:
    """Names of the domain margins."""
    return {measured.name("domain_margin") for measured in stack.measured if measured.partial}


# The processes that make a part: the tolerances that they hold, and their samples.


def out_of_process(part: Part, t: Array, chosen: Integers) -> dict[int, str]:
    """Messages by row where tolerances (n,) of a part do not suit the processes (n,) chosen."""
    processes = [part.processes[number] for number in chosen] if part.alternatives else []
    return {
        row: f"process {process.name} holds {process.low:g} to {process.high:g} {part.unit}, got {t[row]:g}"
        for row, process in enumerate(processes)
        if not (keeps(t[row], process.high) and keeps(-t[row], -process.low))
    }


def corner_of(parts: Sequence[Part], names: Sequence[str], tight: bool) -> Array:
    """The design (all variables,) with every tolerance at an end, and a process for it."""
    design = np.zeros(len(names))
    for part in parts:
        ends = [p.low if tight else -p.high for p in part.processes]
        at = int(np.argmin(ends))
        design[names.index(f"{part.name}_t")] = abs(ends[at])
        if part.alternatives:
            design[names.index(f"{part.name}_process")] = at
    return design


def samples_of(parts: Sequence[Part]) -> tuple[tuple[str, str, PartSample], ...]:
    """Name, unit and measured parts of every part and machine that has some."""
    samples: list[tuple[str, str, PartSample]] = []
    for part in parts:
        samples += [] if part.sample is None else [(part.name, part.unit, part.sample)]
        samples += [
            (f"{part.name}, machine {machine}", part.unit, sample)
            for machine, sample in machine_offers.samples_of(part.machines)
        ]
    return tuple(samples)
