"""Separation of two explanations: their duel, designs that separate them best, and advice without points.

Both are linearised about their fits. Each predicts a normal distribution of the new measurements:
the noise, and the uncertainty that the record leaves in its coefficients. The difference of the two
sums of squares is a quadratic form of the measurements; its distribution is sampled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.measurable import Column, Role
from ...section import Array
from .data import GapData
from .fit import Fit, Member
from .library import Columns, predictor
from .linear import basis, project_out
from .next_field import (
    Ahead,
    Chosen,
    Contest,
    Field,
    Predictions,
    distance,
    exchange_design,
    greedy_design,
    place_at_rows,
    predict_record,
    rows_in_range,
    zero_prediction,
)
from .records import Measurement, Separation
from .result import Ending
from .selection import Other, Search
from .setup import Setup

MAX_REPETITIONS = 1e4
"""Largest multiple of the number of measurements for which a result is given."""
DRAWN = 2000
"""Number of samples of the new measurements."""


@dataclass(frozen=True)
class Duel:
    """Two explanations of the same new measurements, in the subspace of their predictions.

    `apart` (r,) is the difference of their predictions, `wide` (r, p) a root of the covariance of
    each that the record leaves open. `ahead` is by how much the first fits better already, the
    price of parameters included.
    """

    apart: Array
    wide: tuple[Array, Array]
    ahead: float

    @classmethod
    def of(cls, record: tuple[Predictions, Predictions], points: tuple[Predictions, Predictions], ahead: float) -> Duel:
        """The duel from both predictions at the record and at the new measurements, whitened."""
        wide = tuple(_undetermined_columns(old.columns, new.columns) for old, new in zip(record, points, strict=True))
        apart = points[0].values - points[1].values
        r = np.asarray(np.linalg.qr(np.column_stack([apart, *wide]), mode="r"))
        first = 1 + wide[0].shape[1]
        return cls(r[:, 0], (r[:, 1:first], r[:, first:]), ahead)

    def chance(self, times: float = 1.0, by: float = 0.0) -> float:
        """The probability that the right one ends up ahead by more than `by`, with `times` the
        measurements; the prior probability of each follows from its fit.
        """
        prior = 1.0 / (1.0 + np.exp(-0.5 * np.clip(self.ahead, -60.0, 60.0)))
        return float(prior * self._ahead(times, by, 0, 1) + (1.0 - prior) * self._ahead(times, by, 1, 0))

    def _ahead(self, times: float, by: float, right: int, wrong: int) -> float:
        """The probability that `right`, if it is true, ends up ahead."""
        covariances = [np.eye(len(self.apart)) + times * self.wide[k] @ self.wide[k].T for k in (right, wrong)]
        right_root, wrong_root = (scipy.linalg.cholesky(covariance, lower=True) for covariance in covariances)
        draws = np.random.default_rng(0).standard_normal((len(self.apart), DRAWN))
        sign = 1.0 if right == 0 else -1.0
        apart = sign * np.sqrt(times) * self.apart[:, None]
        of_wrong = scipy.linalg.solve_triangular(wrong_root, apart + right_root @ draws, lower=True)
        gained = np.sum(of_wrong**2, axis=0) - np.sum(draws**2, axis=0)
        return float(np.mean(gained + sign * self.ahead > by))

    def times_until(self, chance: float) -> float:
        """The multiple of the measurements for that probability; inf where none suffices."""
        if self.chance(MAX_REPETITIONS) < chance:
            return float("inf")
        least = next((k for k in (1.0 / MAX_REPETITIONS, 1.0) if self.chance(k) < chance), None)
        if least is None:
            return 1.0 / MAX_REPETITIONS
        ends = (np.log(least), np.log(MAX_REPETITIONS))
        power = scipy.optimize.brentq(lambda power: self.chance(float(np.exp(power))) - chance, *ends, xtol=1e-3)
        return float(np.exp(power))


def _undetermined_columns(record: Array, new: Array) -> Array:
    """New columns (n, p) times a root of the covariance of their coefficients given the record."""
    size = np.sqrt(np.sum(record**2, axis=0) + np.sum(new**2, axis=0))
    kept = size > 0.0
    if not kept.any():
        return np.zeros((len(new), 0))
    scaled = record[:, kept] / size[kept]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    root = vectors / np.sqrt(np.maximum(values, 1e-10))
    return np.asarray((new[:, kept] / size[kept]) @ root)


SUPPORT = 60
"""Number of measurements that are chosen one by one; further ones repeat them."""
HOPELESS = 1e-4
"""Discrimination per measurement below which no design separates."""
MIN_REACHABLE_GAIN = 2.0
"""Gain that a pair must be able to reach to be considered in a design for several."""
FEWEST = 2
VARIANTS = 6
"""Largest number of values of a rival's nonlinear parameters that the record allows."""
WORSE = 0.9
ROUNDS = 2
CERTAIN = 0.95
TIE = 1e-9
"""Discrimination of a pair with the same columns."""
NO_SEPARATING_DESIGN = "no design in this range separates them"


@dataclass(frozen=True)
class Pair:
    """The best explanation against one rival: its prediction at the record, and that of the rival
    at each value of its nonlinear parameters under consideration, the fitted one first.
    """

    rival: Other
    best: Predictions
    fits: tuple[Fit, ...]
    records: tuple[Predictions, ...]
    contests: tuple[Contest, ...] = ()

    def least(self, chosen: Chosen) -> float:
        """Discrimination with these candidates, at the rival's value that imitates best."""
        return min(contest.level(chosen)[0] for contest in self.contests)


def pair_of_rival(end: Ending, rival: Other, field: Field | None = None) -> Pair:
    """A pair, the rival at its fit; with a field, its contest there."""
    fitter = end.analysis.search.fitter
    best, record = predict_record(fitter, end.fit), predict_record(fitter, rival.fit)
    contests = (_contest(end, field, best, record, rival.fit),) if field else ()
    return Pair(rival, best, (rival.fit,), (record,), contests)


def _contest(end: Ending, field: Field, best: Predictions, record: Predictions, rival: Fit) -> Contest:
    points = field.predicted(end.fit), field.predicted(rival)
    return Contest.of((best, record), points, field.values_per_candidate)


def most(pair: Pair, count: int) -> float:
    """The discrimination that a design for this pair alone would add."""
    few = greedy_design(pair.contests, min(count, SUPPORT))
    return pair.least(np.resize(few, count)) - pair.least(few[:0])


def design(end: Ending, field: Field, pairs: Sequence[Pair], count: int) -> tuple[Chosen, list[Pair]]:
    """The candidates that separate the worst of these pairs best, and the pairs with the values of
    nonlinear parameters that imitate best.
    """
    current = list(pairs)
    for _ in range(ROUNDS):
        chosen = _exchange_pairs(current, count)
        wider = [_add_worst_rival(end, field, pair, chosen) for pair in current]
        if all(new is old for new, old in zip(wider, current, strict=True)):
            return np.resize(chosen, count), current
        current = wider
    return np.resize(_exchange_pairs(current, count), count), current


def _exchange_pairs(pairs: Sequence[Pair], count: int) -> Chosen:
    return exchange_design([contest for pair in pairs for contest in pair.contests], min(count, SUPPORT))


def _add_worst_rival(end: Ending, field: Field, pair: Pair, chosen: Chosen) -> Pair:
    """The pair with the rival's values that imitate best at this design, where they are new."""
    fitter, best = end.analysis.search.fitter, pair
    for fit in variants(end.analysis.search, pair.rival.fit):
        record = predict_record(fitter, fit)
        tried = _contest(end, field, pair.best, record, fit)
        if tried.level(chosen)[0] < WORSE * best.least(chosen):
            fits, records, contests = (*pair.fits, fit), (*pair.records, record), (*pair.contests, tried)
            best = replace(pair, fits=fits, records=records, contests=contests)
    return best


def variants(search: Search, fit: Fit) -> list[Fit]:
    """A rival at values of its last effect's nonlinear parameters that the record allows."""
    last, other_members = fit.members[-1], fit.members[:-1]
    if not last.shape or last.candidate.is_nonlinear:
        return []
    at = np.array([k for k, member in enumerate(search.dictionary.members) if member.name == last.name])
    q = search.fitter.spanned(other_members)
    gains = search.white.some(at).orthonormal(q).gains(project_out(search.fitter.y, q))
    allowed = at[gains >= gains.max() - search.settings.set_distance]
    kept = allowed[np.unique(np.linspace(0, len(allowed) - 1, VARIANTS).round().astype(int))]
    shapes = [search.dictionary.members[k].shape for k in kept]
    return [search.fitter.fit((*other_members, Member(last.candidate, shape))) for shape in shapes]


def separation(end: Ending, pair: Pair, new: Ahead, alike: Ahead) -> Separation:
    """The separation of a pair by the planned measurements, and by as many like the present ones."""
    planned_best = new.predicted(end.fit)
    levels = [
        joint_discrimination(pair.best, record, planned_best, new.predicted(rival_fit))
        for rival_fit, record in zip(pair.fits, pair.records, strict=True)
    ]
    planned, like = (
        Duel.of((pair.best, pair.records[0]), (at.predicted(end.fit), at.predicted(pair.fits[0])), pair.rival.distance)
        for at in (new, alike)
    )
    now = min(distance(pair.best, record) for record in pair.records)
    apart = end.analysis.search.settings.set_distance
    return record_of(pair.rival, (now, min(levels)), (planned, like), len(new), apart)


def record_of(
    pair: Other, levels: tuple[float, float], duels: tuple[Duel, Duel], count: int, apart: float
) -> Separation:
    """The record of a pair, and its sentence; `levels` are the discrimination now and then."""
    planned, alike = duels
    if levels[1] <= TIE:
        nan = float("nan")
        return Separation(pair.names, pair.instead_of, *levels, nan, nan, nan, 0, NO_SEPARATING_DESIGN, possible=False)
    needed = count * planned.times_until(CERTAIN)
    number = max(FEWEST, int(np.ceil(needed))) if np.isfinite(needed) else 0
    chance, like = planned.chance(), alike.chance()
    text = (
        f"{count} measurements at the planned points: probability {chance:.2f} that the right one fits "
        f"better ({like:.2f} with as many measurements like the present ones); "
    )
    text += f"{number} such measurements for {CERTAIN}" if number else f"no number reaches {CERTAIN}"
    return Separation(pair.names, pair.instead_of, *levels, chance, like, planned.chance(by=apart), number, text)


def joint_discrimination(best: Predictions, rival: Predictions, new_best: Predictions, new_rival: Predictions) -> float:
    """The discrimination by the record and new measurements together."""
    values = np.concatenate([best.values, new_best.values])
    rival_values = np.concatenate([rival.values, new_rival.values])
    columns = np.vstack([rival.columns, new_rival.columns])
    return distance(Predictions(values, columns), Predictions(rival_values, columns))


ROWS = 240
"""Number of measurements of a design that is tried."""
WIDER = 1.6
"""Factor by which the range of an input is extended."""
SEPARATE_CERTAIN = 12.0
"""Squared distance in noise units from which explanations are separated."""


@dataclass(frozen=True)
class Design:
    """Operating points of a possible measurement, and the description of what is new in them."""

    text: str
    table: Mapping[str, NDArray[Any]]
    inputs: Mapping[str, tuple[float, float]]


def other_quantity(fit: Fit, rival: Fit) -> str:
    """What to measure instead, where the one effect in which two fits differ is separated by no
    operating point from the one that replaces it; else empty.
    """
    effects = {member.name: member.candidate.effect for member in (*fit.members, *rival.members)}
    names = {*fit.names} ^ {*rival.names}
    texts = (effects[name].separated_by.get(other, "") for name, other in permutations(sorted(names), 2))
    return next(filter(None, texts), "") if len(names) == 2 else ""


def separating(setup: Setup, levels: Array, fit: Fit, rival: Fit) -> Measurement:
    """The best of a few designs, each input varied alone or further, at noise of `levels` (q,)."""
    if text := other_quantity(fit, rival):
        return Measurement(text)
    best: tuple[float, Design] | None = None
    for design in _designs(setup.data, np.random.default_rng([setup.plan.seed, 3])):
        if not rows_in_range(setup.plan.model, design.table).all():
            continue
        size = _difference(setup, levels, design, fit, rival)
        if np.isfinite(size) and (best is None or size > 1.05 * best[0]):
            best = (size, design)
    if best is None or best[0] < 1e-3:
        return Measurement("no design of these inputs separates them: another quantity has to be measured")
    size, design = best
    count = int(min(np.ceil(SEPARATE_CERTAIN / size**2), 10**6))
    subject = f"{count} measurements separate" if count > 1 else "1 measurement separates"
    text = f"{design.text}: {subject} them ({size:.2g} of the noise per measurement)"
    return Measurement(text, design.inputs, size, count)


def _designs(data: GapData, rng: np.random.Generator) -> Iterator[Design]:
    """More of the same; each input varied alone, in its range and further; all inputs at once."""
    rows = rng.choice(len(data), size=min(ROWS, len(data)), replace=False)
    now = {name: values[np.sort(rows)] for name, values in data.measurements.table.items()}
    yield Design("more measurements like these", now, {})
    moving = [c for c in data.inputs if c.role not in (Role.TIME, Role.REPEAT)]
    for column in moving:
        spread = _apart(now, column, rng, 1.0)
        yield Design(f"vary {column.name} independently of the other inputs", *spread)
        if column.role not in (Role.DIRECTION, Role.ANGLE):
            far = _apart(now, column, rng, WIDER)
            low, high = far[1][column.name]
            text = f"vary {column.name} independently, out to {low:.4g} .. {high:.4g}"
            yield Design(f"{text} {column.unit}".rstrip(), *far)
    table: Mapping[str, NDArray[Any]] = now
    ends: dict[str, tuple[float, float]] = {}
    for column in moving:
        table, more = _apart(table, column, rng, 1.0)
        ends |= more
    yield Design("vary all inputs independently of each other", table, ends)


def _apart(
    table: Mapping[str, NDArray[Any]], column: Column, rng: np.random.Generator, wider: float
) -> tuple[Mapping[str, NDArray[Any]], dict[str, tuple[float, float]]]:
    values = np.asarray(table[column.name], dtype=float)
    low, high = float(values.min()), float(values.max())
    if column.role is Role.DIRECTION:
        new = rng.choice([-1.0, 1.0], len(values))
    else:
        if low < 0.0 < high:
            low, high = wider * low, wider * high
        else:
            high = low + wider * (high - low)
        new = rng.uniform(low, high, len(values))
    return {**table, column.name: new}, {column.name: (low, high)}


def _difference(setup: Setup, levels: Array, design: Design, fit: Fit, rival: Fit) -> float:
    """Rms per measurement [noise] of the prediction of `fit` that the rival cannot explain."""
    data = place_at_rows(setup.data, design.table)
    columns = Columns(data, predictor(setup.plan, data) if setup.plan.model else zero_prediction(data))
    level = np.repeat(levels, len(data))
    explained = sum(
        (columns.of(m.candidate, m.shape) @ c for m, c in zip(fit.members, fit.coefficients, strict=True)),
        np.zeros(len(level)),
    )
    free = [columns.of(m.candidate, m.shape) for m in rival.members]
    ones = np.kron(np.eye(len(data.outputs)), np.ones((len(data), 1)))
    q = basis(np.hstack([ones, *free]) / level[:, None])
    residual = project_out(np.asarray(explained) / level, q)
    return float(np.sqrt(np.mean(residual**2)))
