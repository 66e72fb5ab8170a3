"""The design that separates the best explanation from its rivals, and its discrimination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....gap_next_records import Separation
from ..ambiguity import Other
from ..fit import Fit, Member
from ..linear import projected_out
from ..result import Ending
from ..select import Search
from .chance import Duel
from .contest import Chosen, Contest
from .exchange import added, exchanged
from .field import Ahead, Field
from .rows import Predictions, distance, of_record

SUPPORT = 60
"""Number of measurements that are chosen one by one; further ones repeat them."""
HOPELESS = 1e-4
"""Discrimination per measurement below which no design separates."""
LITTLE = 2.0
"""Gain that a pair must be able to reach to be considered in a design for several."""
FEWEST = 2
VARIANTS = 6
"""Largest number of values of a rival's nonlinear parameters that the record allows."""
WORSE = 0.9
ROUNDS = 2
CERTAIN = 0.95
TIE = 1e-9
"""Discrimination of a pair with the same columns."""
NONE = "no design in this range separates them"


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

    def with_fit(self, fit: Fit, record: Predictions, contest: Contest) -> Pair:
        """The pair with one more value under consideration."""
        return replace(
            self, fits=(*self.fits, fit), records=(*self.records, record), contests=(*self.contests, contest)
        )

    def least(self, chosen: Chosen) -> float:
        """Discrimination with these candidates, at the rival's value that imitates best."""
        return min(contest.level(chosen)[0] for contest in self.contests)


def paired(end: Ending, rival: Other, field: Field | None = None) -> Pair:
    """A pair, the rival at its fit; with a field, its contest there."""
    fitter = end.analysis.search.fitter
    best, record = of_record(fitter, end.fit), of_record(fitter, rival.fit)
    contests = (_contest(end, field, best, record, rival.fit),) if field else ()
    return Pair(rival, best, (rival.fit,), (record,), contests)


def _contest(end: Ending, field: Field, best: Predictions, record: Predictions, rival: Fit) -> Contest:
    points = field.predicted(end.fit), field.predicted(rival)
    return Contest.of((best, record), points, field.values_per_candidate)


def most(pair: Pair, count: int) -> float:
    """The discrimination that a design for this pair alone would add."""
    few = added(pair.contests, min(count, SUPPORT))
    return pair.least(np.resize(few, count)) - pair.least(few[:0])


def design(end: Ending, field: Field, pairs: Sequence[Pair], count: int) -> tuple[Chosen, list[Pair]]:
    """The candidates that separate the worst of these pairs best, and the pairs with the values of
    nonlinear parameters that imitate best.
    """
    current = list(pairs)
    for _ in range(ROUNDS):
        chosen = _exchanged(current, count)
        wider = [_with_worst(end, field, pair, chosen) for pair in current]
        if all(new is old for new, old in zip(wider, current, strict=True)):
            return np.resize(chosen, count), current
        current = wider
    return np.resize(_exchanged(current, count), count), current


def _exchanged(pairs: Sequence[Pair], count: int) -> Chosen:
    return exchanged([contest for pair in pairs for contest in pair.contests], min(count, SUPPORT))


def _with_worst(end: Ending, field: Field, pair: Pair, chosen: Chosen) -> Pair:
    """The pair with the rival's values that imitate best at this design, where they are new."""
    fitter, best = end.analysis.search.fitter, pair
    for fit in variants(end.analysis.search, pair.rival.fit):
        record = of_record(fitter, fit)
        tried = _contest(end, field, pair.best, record, fit)
        if tried.level(chosen)[0] < WORSE * best.least(chosen):
            best = pair.with_fit(fit, record, tried)
    return best


def variants(search: Search, fit: Fit) -> list[Fit]:
    """A rival at values of its last effect's nonlinear parameters that the record allows."""
    last, other_members = fit.members[-1], fit.members[:-1]
    if not last.shape or last.candidate.is_nonlinear:
        return []
    at = np.array([k for k, member in enumerate(search.dictionary.members) if member.name == last.name])
    q = search.fitter.spanned(other_members)
    gains = search.white.some(at).orthonormal(q).gains(projected_out(search.fitter.y, q))
    allowed = at[gains >= gains.max() - search.settings.set_distance]
    kept = allowed[np.unique(np.linspace(0, len(allowed) - 1, VARIANTS).round().astype(int))]
    shapes = [search.dictionary.members[k].shape for k in kept]
    return [search.fitter.fit((*other_members, Member(last.candidate, shape))) for shape in shapes]


def separation(end: Ending, pair: Pair, new: Ahead, alike: Ahead) -> Separation:
    """The separation of a pair by the planned measurements, and by as many like the present ones."""
    planned_best = new.predicted(end.fit)
    levels = [
        joined(pair.best, record, planned_best, new.predicted(rival_fit))
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
        return Separation(pair.names, pair.instead_of, *levels, nan, nan, nan, 0, NONE, possible=False)
    needed = count * planned.times_until(CERTAIN)
    number = max(FEWEST, int(np.ceil(needed))) if np.isfinite(needed) else 0
    chance, like = planned.chance(), alike.chance()
    text = (
        f"{count} measurements at the planned points: probability {chance:.2f} that the right one fits "
        f"better ({like:.2f} with as many measurements like the present ones); "
    )
    text += f"{number} such measurements for {CERTAIN}" if number else f"no number reaches {CERTAIN}"
    return Separation(pair.names, pair.instead_of, *levels, chance, like, planned.chance(by=apart), number, text)


def joined(best: Predictions, rival: Predictions, new_best: Predictions, new_rival: Predictions) -> float:
    """The discrimination by the record and new measurements together."""
    values = np.concatenate([best.values, new_best.values])
    rival_values = np.concatenate([rival.values, new_rival.values])
    columns = np.vstack([rival.columns, new_rival.columns])
    return distance(Predictions(values, columns), Predictions(rival_values, columns))
