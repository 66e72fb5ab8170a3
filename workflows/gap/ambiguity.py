"""Stage 5: names that the data cannot tell from those that were accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .fit import Fit, Fitter, Member
from .linear import beside
from .scan import scan
from .select import Search

TWIN = 1e-3
"""Distance below which two names have the same columns."""
INSTRUMENT = "instrument"


@dataclass(frozen=True)
class Other:
    """Another fit that the data do not exclude: what stands in it instead of what."""

    fit: Fit
    names: tuple[str, ...]
    instead_of: tuple[str, ...]
    distance: float


def rivals(search: Search, fit: Fit, kept: Sequence[int]) -> list[Other]:
    """Fits within the distance of a set, with one name exchanged, or one for two."""
    found: dict[tuple[tuple[str, ...], tuple[str, ...]], Other] = {}
    reach = search.settings.set_distance
    barred = {one.name for one in fit.members}
    for at in kept:
        others = fit.without(at)
        for one in _near(search, others, fit):
            if one.names[-1] != fit.names[at] and one.score - fit.score <= reach:
                key = ((one.names[-1],), (fit.names[at],))
                found[key] = Other(one, *key, one.score - fit.score)
    for pair in combinations(kept, 2):  # one name instead of two
        names = tuple(fit.names[k] for k in pair)
        rest = tuple(one for k, one in enumerate(fit.members) if k not in pair)
        for one in _near(search, rest, fit):
            new = one.names[-1]
            if new not in barred and one.score - fit.score <= reach:
                found[(new,), names] = Other(one, (new,), names, one.score - fit.score)
    return sorted(found.values(), key=lambda one: one.distance)


def _near(search: Search, others: Sequence[Member], fit: Fit) -> list[Fit]:
    """Fits with one more beside `others`, about as good as `fit`."""
    return search.refined(others, scan(search.fitter, search.white, search.book, others))


def correlation(fitter: Fitter, fit: Fit, other: Other) -> float:
    """Of what the names of a fit and those instead of them do, beside all else that is fitted."""
    mine = [k for k, one in enumerate(fit.names) if one in other.instead_of]
    theirs = [k for k, one in enumerate(other.fit.names) if one in other.names]
    rest = [one for k, one in enumerate(fit.members) if k not in mine]
    q = fitter.spanned(rest)
    a, b = (
        beside(
            sum(
                (fitter.white(of.members[k]) @ of.coefficients[k] for k in which),
                np.zeros(len(fitter.y)),
            ),
            q,
        )
        for of, which in ((fit, mine), (other.fit, theirs))
    )
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else float("nan")


def first_of_twins(fit: Fit, found: Sequence[Other], population: bool) -> Fit | None:
    """The fit with the name that goes first where another one has the same columns.

    What may be the instrument is not called physics. Of a batch that is off by the same in every
    unit the process goes first: an allocation can answer it, a gauge it cannot.
    """
    for one in found:
        new, old = one.fit.members[-1].candidate, one.instead_of
        mine = next(m.candidate for m in fit.members if m.name == old[0])
        if abs(one.distance) >= TWIN or len(old) > 1 or new.unread:
            continue
        of_instrument = [c.effect.family == INSTRUMENT for c in (new, mine)]
        if of_instrument == ([False, True] if population else [True, False]):
            return one.fit
    return None
