"""Least and greatest value of a requirement within its tolerances, by corners or by intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from ...section import Array
from ..expressions import Formula
from .mechanism import CORNERS, Mechanism, box

ENUMERATED = 16
"""Pieces whose corners are all tried, of those on which the requirement is not proven monotone."""
MOVES, FINEST = 200, 1e-10
"""Of a compass search: trials at most, and the step, as a fraction of a tolerance, below which it ends."""
TRIED, ALIKE = 16, 1e-9
"""Random units at which slopes by places are compared, and how far they may differ."""


Ends = tuple[float, float]
_ALL: Ends = (-np.inf, np.inf)


class Extremes(NamedTuple):
    """Least and greatest value of a requirement for one design, in its unit, and what they are.

    `kind` is "corners" where units reach both and no corner of the tolerances lies beyond; "bound"
    where no unit lies beyond either, but none may reach them; "sample" where others than the units
    that were tried may lie beyond.
    """

    least: float
    greatest: float
    kind: str


def extremes(mechanism: Mechanism, t: Array) -> Extremes:
    """The worst case within tolerances t (p,) about the mid-limits, of the units for which the requirement has a value.

    A piece on which the formula rises or falls everywhere, by the interval of its slope, stands at
    one end. Of up to `ENUMERATED` other pieces all corners are tried, and points between, and the best of
    them is moved while that gains; of more, the interval of the formula is the bound. Formulas with loops,
    whose slopes have no intervals here, have all corners of up to `ENUMERATED` pieces tried, and a sample of
    more. Places in two directions that count by the length of one sum of them, as those of fasteners do,
    stand on one line; others on the circle of their zones, at right angles from where the slopes say, which
    is exact where the formula is linear in them, else "sample".

    Reference: Moore, Kearfott & Cloud (2009), Introduction to Interval Analysis, SIAM (test of
    monotonicity, mean value form).
    """
    formula, mids, scale = mechanism.stated
    half = t[mechanism.owners] * np.abs(scale)
    used = [(at, name) for at, name in enumerate(mechanism.names) if name in formula.names]
    ends = {name: (mids[at] - half[at], mids[at] + half[at]) for at, name in used}
    pairs = (disc.named(mechanism.names) for disc in mechanism.discs)
    places = [name for pair in pairs if ends.keys() >= {*pair} for name in pair]
    line: dict[str, Array] = {}
    if places and _on_a_line(formula, ends, places):
        line = {name: np.asarray(0.5 * sum(ends.pop(name))) for name in places[1::2]}
        places = []
    slopes = {} if formula.assembles else _slopes(formula, line, ends)
    least, greatest = (_extreme(mechanism, line, ends, places, slopes, side) for side in (-1.0, 1.0))
    kind = next(kind for kind in ("sample", "bound", "corners") if kind in (least[1], greatest[1]))
    low, high = sorted((float(mechanism.gain * least[0]), float(mechanism.gain * greatest[0])))
    return Extremes(low, high, kind)


def _slopes(formula: Formula, at: Mapping[str, Array], rest: Mapping[str, Ends]) -> dict[str, Interval]:
    """The intervals of the slopes by the pieces that stand anywhere within their ends, the others where they are."""
    x: dict[str, Any] = {**at, **{name: Interval(*pair) for name, pair in rest.items()}}
    return {name: Interval.of(slope) for name, slope in formula.dual(x, rest)[1].items()} if rest else {}


def _extreme(
    mechanism: Mechanism,
    line: Mapping[str, Array],
    ends: Mapping[str, Ends],
    places: Sequence[str],
    slopes: Mapping[str, Interval],
    side: float,
) -> tuple[float, str]:
    """The greatest (side 1) or least (-1) value of a formula over a box, and its kind; `slopes` as `_slopes`."""
    formula, names, at, rest = mechanism.stated[0], mechanism.names, dict(line), dict(ends)
    while rest and not formula.assembles:
        free = [name for name in rest if name not in places]
        rising = {name: slopes[name].low >= 0.0 for name in free if slopes[name].low >= 0.0 or slopes[name].high <= 0.0}
        if not rising:
            break
        at |= {name: np.asarray(rest.pop(name)[int(up == (side > 0.0))]) for name, up in rising.items()}
        slopes = _slopes(formula, at, rest)
    if len(rest) > ENUMERATED and not formula.assembles:
        return _bound(formula, at, rest, slopes, side), "bound"
    straight = all(slopes[name].low == slopes[name].high for name in places) if slopes else not places

    def values(z: Array) -> Array:
        """The formula (m,), greater is better, at points (k, m) of the square; -inf where it has no value."""
        z = mechanism.rounded(z, [names.index(name) for name in rest])
        inside = zip(rest.items(), z, strict=True)
        y = formula.value(at | {name: 0.5 * (a + b) + 0.5 * (b - a) * row for (name, (a, b)), row in inside})
        y = side * np.broadcast_to(y, z.shape[1])
        return np.where(np.isfinite(y), y, -np.inf)

    best = _climbed(values, _points(len(rest)))
    kind = "corners" if len(rest) <= ENUMERATED and straight else "sample"
    return (side * best if np.isfinite(best) else np.nan), kind


def _climbed(values: Callable[[Array], Array], z: Array) -> float:
    """The greatest value of points (k, m) of [-1, 1]^k, and of a compass search from the best of them."""
    y = values(z)
    best, point, step = float(np.max(y)), z[:, int(np.argmax(y))], 1.0
    directions = np.hstack([np.eye(len(point)), -np.eye(len(point))])
    for _ in range(MOVES if len(point) else 0):
        moves = np.clip(point[:, None] + step * directions, -1.0, 1.0)
        y = values(moves)
        if (step := step if (higher := float(np.max(y))) > best else 0.5 * step) < FINEST:
            break
        if higher > best:
            best, point = higher, moves[:, int(np.argmax(y))]
    return best


def _on_a_line(formula: Formula, ends: Mapping[str, Ends], places: Sequence[str]) -> bool:
    """Whether places (x, y, x, y, ...) count by the length of one sum of them alone, |sum_i c_i p_i|.

    Then the slopes by all places are parallel, in ratios that the places do not change, and have no moment
    about the middle: it is tested at random units of one set of sizes.
    """
    if formula.assembles:
        return False
    rng = np.random.default_rng(0)
    x = {
        name: low + (high - low) * rng.uniform(size=TRIED if name in places else 1)
        for name, (low, high) in ends.items()
    }
    with np.errstate(all="ignore"):
        slopes = formula.dual(x, places)[1]
    if not all(name in slopes for name in places):
        return False
    g = np.stack([np.broadcast_to(slopes[name], TRIED) for name in places]).reshape(-1, 2, TRIED)
    p = np.stack([x[name] - 0.5 * sum(ends[name]) for name in places]).reshape(-1, 2, TRIED)
    longest = np.argmax(np.sum(g[..., 0] ** 2, axis=1))
    first, size = g[longest], np.sum(g[longest] ** 2, axis=0)
    ratios = np.sum(g * first, axis=1) / size
    across = (g[:, 0] * first[1] - g[:, 1] * first[0]) / size
    moment = np.sum(p[:, 0] * g[:, 1] - p[:, 1] * g[:, 0], axis=0) / np.sum(np.hypot(*p.swapaxes(0, 1)) * np.sqrt(size))
    return bool(
        np.all(np.abs(across) < ALIKE) and np.all(np.ptp(ratios, axis=1) < ALIKE) and np.all(abs(moment) < ALIKE)
    )


def _points(pieces: int) -> Array:
    """All corners of [-1, 1]^k and points between, shape (k, m); of many pieces a sample of the corners."""
    if pieces == 0:
        return np.zeros((0, 1))
    if pieces <= CORNERS or pieces > ENUMERATED:  # the points between come with all corners, or with some
        return box(pieces)
    corners = (np.arange(2**pieces) >> np.arange(pieces)[:, None]) & 1
    return np.hstack([box(pieces), 2.0 * corners - 1.0])


def _bound(
    formula: Formula, at: dict[str, Array], rest: dict[str, Ends], slopes: Mapping[str, Interval], side: float
) -> float:
    """The end of the interval of a formula: the nearer of that of its operations and the mean value form."""
    whole: dict[str, Any] = at | {name: Interval(*pair) for name, pair in rest.items()}
    middle = at | {name: np.asarray(0.5 * (a + b)) for name, (a, b) in rest.items()}
    form = Interval.of(formula.value(middle))
    with np.errstate(all="ignore"):
        for name in rest:
            form = form + slopes[name] * (whole[name] - middle[name])
    forms = Interval.of(formula.value(whole)), form
    return float(min(own.high for own in forms) if side > 0.0 else max(own.low for own in forms))


class Interval(NDArrayOperatorsMixin):
    """All numbers from `low` to `high`: what numpy's functions make of them holds every value.

    Ends are rounded outwards; a single number stays one, as it is rounded. Where a function has a
    pole, or a value that is none, the interval is that of all numbers; arguments beyond the edge of a
    domain are left out, as units without a value are.
    """

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = np.float64(low), np.float64(high)

    @classmethod
    def of(cls, value: Any) -> Interval:
        """A number as an interval."""
        return value if isinstance(value, Interval) else cls(float(value), float(value))

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **keywords: Any) -> Any:
        rule = _RULES.get(ufunc)
        if rule is None or method != "__call__":
            return NotImplemented
        own = [Interval.of(value) for value in inputs]
        low, high = rule(*own)
        if np.isnan(low) or np.isnan(high):
            return Interval(-np.inf, np.inf)
        if all(value.low == value.high for value in own):
            return Interval(low, high)
        return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def _hull(function: Callable[..., Any]) -> Callable[..., Ends]:
    """The rule of a function whose extremes are at ends of its arguments; 0 times infinity is 0."""

    def rule(*x: Interval) -> Ends:
        values = [function(*ends) for ends in product(*((value.low, value.high) for value in x))]
        values = [0.0 if np.isnan(value) else value for value in values] if function is np.multiply else values
        return min(values), max(values)

    return rule


def _within(function: Any, least: float, most: float) -> Callable[[Interval], Ends]:
    """The rule of a monotone function that is defined from `least` to `most`."""

    def rule(x: Interval) -> Ends:
        if x.high < least or x.low > most:
            return _ALL
        return _hull(function)(Interval(max(x.low, least), min(x.high, most)))

    return rule


def _wave(function: Any, peak: float) -> Callable[[Interval], Ends]:
    """The rule of a function of period 2 pi with values 1 at a peak and -1 half a period on."""

    def rule(x: Interval) -> Ends:
        if not np.isfinite(x.high - x.low):
            return -1.0, 1.0
        low, high = _hull(function)(x)
        top, bottom = (
            np.floor((x.high - at) / (2.0 * np.pi)) >= np.ceil((x.low - at) / (2.0 * np.pi))
            for at in (peak, peak + np.pi)
        )
        return (-1.0 if bottom else low), (1.0 if top else high)

    return rule


def _divide(a: Interval, b: Interval) -> Ends:
    if b.low <= 0.0 <= b.high:
        return _ALL
    return _hull(np.divide)(a, b)


def _power(a: Interval, b: Interval) -> Ends:
    exponent = b.low
    if exponent == b.high == np.rint(exponent):
        if exponent < 0.0:
            return _divide(Interval(1.0, 1.0), Interval(*_power(a, Interval(-exponent, -exponent))))
        ends = [a.low**exponent, a.high**exponent]
        inside = exponent % 2.0 == 0.0 and exponent > 0.0 and a.low < 0.0 < a.high
        return min([*ends, 0.0] if inside else ends), max(ends)
    return _hull(np.power)(Interval(max(a.low, 0.0), max(a.high, 0.0)), b)


def _tangent(x: Interval) -> Ends:
    low, high = np.floor(x.low / np.pi + 0.5), np.floor(x.high / np.pi + 0.5)
    return _hull(np.tan)(x) if low == high else _ALL


def _angle(y: Interval, x: Interval) -> Ends:
    if x.low <= 0.0 and y.low <= 0.0 <= y.high:
        return -np.pi, np.pi
    return _hull(np.arctan2)(y, x)


def _absolute(x: Interval) -> Ends:
    low, high = sorted((abs(x.low), abs(x.high)))
    return (0.0 if x.low <= 0.0 <= x.high else low), high


_RULES: Mapping[Any, Callable[..., Ends]] = {
    np.add: lambda a, b: (a.low + b.low, a.high + b.high),
    np.subtract: lambda a, b: (a.low - b.high, a.high - b.low),
    np.negative: lambda a: (-a.high, -a.low),
    np.multiply: _hull(np.multiply),
    np.divide: _divide,
    np.power: _power,
    np.sin: _wave(np.sin, 0.5 * np.pi),
    np.cos: _wave(np.cos, 0.0),
    np.tan: _tangent,
    np.arcsin: _within(np.arcsin, -1.0, 1.0),
    np.arccos: _within(np.arccos, -1.0, 1.0),
    np.arctan: _hull(np.arctan),
    np.arctan2: _angle,
    np.sqrt: _within(np.sqrt, 0.0, np.inf),
    np.exp: _hull(np.exp),
    np.log: _within(np.log, 0.0, np.inf),
    np.absolute: _absolute,
    np.sign: _hull(np.sign),
    np.minimum: lambda a, b: (min(a.low, b.low), min(a.high, b.high)),
    np.maximum: lambda a, b: (max(a.low, b.low), max(a.high, b.high)),
    np.less: lambda a, b: (float(a.high < b.low), float(a.low < b.high)),
    np.less_equal: lambda a, b: (float(a.high <= b.low), float(a.low <= b.high)),
    np.greater: lambda a, b: (float(a.low > b.high), float(a.high > b.low)),
    np.greater_equal: lambda a, b: (float(a.low >= b.high), float(a.high >= b.low)),
}
