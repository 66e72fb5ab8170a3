"""Rivals: effects that the data cannot distinguish from those that were accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from operator import attrgetter

import numpy as np

from .fit import Fit, Fitter, Member
from .linear import projected_out
from .scan import scan
from .select import Search

SAME_COLUMNS = 1e-3
"""Difference in score below which two effects have the same columns."""
INSTRUMENT = "instrument"


@dataclass(frozen=True)
class Other:
    """Another fit that the data do not exclude: its effects `names` replace those `instead_of`."""

    fit: Fit
    names: tuple[str, ...]
    instead_of: tuple[str, ...]
    distance: float


def rivals(search: Search, fit: Fit, identified: Sequence[int]) -> list[Other]:
    """Fits within the set distance, in which an effect replaces one or two of the identified."""
    alternatives: dict[tuple[tuple[str, ...], tuple[str, ...]], Other] = {}
    reach = search.settings.set_distance
    excluded = {member.name for member in fit.members}
    for at in identified:
        for rival in _near(search, fit.without(at)):
            if rival.names[-1] != fit.names[at] and rival.score - fit.score <= reach:
                key = ((rival.names[-1],), (fit.names[at],))
                alternatives[key] = Other(rival, *key, rival.score - fit.score)
    for pair in combinations(identified, 2):  # a single effect instead of two
        names = tuple(fit.names[k] for k in pair)
        for rival in _near(search, fit.without(*pair)):
            new_name = rival.names[-1]
            if new_name not in excluded and rival.score - fit.score <= reach:
                alternatives[(new_name,), names] = Other(rival, (new_name,), names, rival.score - fit.score)
    return sorted(alternatives.values(), key=attrgetter("distance"))


def _near(search: Search, others: Sequence[Member]) -> list[Fit]:
    """The best fits with one more effect in addition to `others`."""
    return search.refined(others, scan(search.fitter, search.white, search.dictionary, others))


def correlation(fitter: Fitter, fit: Fit, other: Other) -> float:
    """Correlation of the contributions of the exchanged effects of a fit and of those that replace
    them, given all else that is fitted.
    """
    replaced = [k for k, name in enumerate(fit.names) if name in other.instead_of]
    substitutes = [k for k, name in enumerate(other.fit.names) if name in other.names]
    q = fitter.spanned(fit.without(*replaced))
    a, b = (
        projected_out(
            sum((fitter.white(source.members[k]) @ source.coefficients[k] for k in indices), np.zeros(len(fitter.y))), q
        )
        for source, indices in ((fit, replaced), (other.fit, substitutes))
    )
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else float("nan")


def same_columns(name: str, alternatives: Sequence[Other]) -> frozenset[str]:
    """The effects that may replace `name` alone because they have the same columns."""
    alike = (other for other in alternatives if other.instead_of == (name,) and abs(other.distance) < SAME_COLUMNS)
    return frozenset(other.names[-1] for other in alike)


def first_of_confounded(fit: Fit, alternatives: Sequence[Other], population: bool) -> Fit | None:
    """The fit with the preferred effect where another effect has the same columns, else None.

    What may be the instrument is not attributed to physics. Of an offset that is the same in every
    unit of a batch the process is preferred: an allocation can answer it, a gauge cannot.
    """
    for alternative in alternatives:
        new, replaced = alternative.fit.members[-1].candidate, alternative.instead_of
        current = next(m.candidate for m in fit.members if m.name == replaced[0])
        if abs(alternative.distance) >= SAME_COLUMNS or len(replaced) > 1 or new.unread:
            continue
        of_instrument = [c.effect.family == INSTRUMENT for c in (new, current)]
        if of_instrument == ([False, True] if population else [True, False]):
            return alternative.fit
    return None
