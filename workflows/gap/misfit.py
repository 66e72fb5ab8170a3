"""How far a named number may be off for the form of what has no name beside it.

A term without a name is one of many forms that the record allows. Where a form holds what a named
effect does, all that they share is given to the name; of the form's squared size each of its
dimensions has its part, and the shared one is taken to have had as much. With g the column of a
number beside all others, E the squared norm of the term r in noise units and m its dimensions, the
variance is then sigma^2 / |g|^2 (1 + E/m). A term that is fitted jointly may have taken g' r /
|g|^2 from the number, at worst all of it or none: half of that is taken for the standard deviation.
"""

from __future__ import annotations

import numpy as np

from ...models.inputs.distribution import Array
from .analysis import Analysis
from .fit import Fit, Fitter
from .linear import basis, beside
from .settle import names_of
from .unresolved import is_term, whole_of

LITTLE = 0.01
"""Share of a number's column within a form below which they have nothing in common."""
HALF = 0.25
"""Variance of what lies anywhere between two ends, over the square of their distance, about."""


def misfit_of(analysis: Analysis, fit: Fit) -> dict[tuple[str, str], float]:
    """More variance of named numbers, by owner and name, for the terms beside them."""
    fitter = analysis.search.fitter
    terms = [k for k, one in enumerate(fit.members) if is_term(one)]
    found: dict[tuple[str, str], float] = {}
    for at in names_of(fit.members) if terms else ():
        member = fit.members[at]
        for k, number in enumerate(member.candidate.linear):
            g = _alone(fitter, fit, at, k)
            size = float(g @ g)
            share = sum(_part(analysis, fit, term, g) for term in terms)
            if size > 0.0 and share > 0.0:
                found[member.name, number.name] = share / size
    return found


def _alone(fitter: Fitter, fit: Fit, at: int, number: int) -> Array:
    """The column of a number beside what is free and all other named numbers."""
    mine = fitter.white(fit.members[at])
    others = [np.delete(mine, number, axis=1)]
    others += [
        fitter.white(one) for k, one in enumerate(fit.members) if k != at and not is_term(one)
    ]
    return beside(mine[:, number], basis(np.hstack([fitter.base, *others])))


def _part(analysis: Analysis, fit: Fit, term: int, g: Array) -> float:
    """E/m of a term, times how much of g lies in its whole form."""
    member, fitter = fit.members[term], analysis.search.fitter
    added = beside(fitter.white(member) @ fit.coefficients[term], fitter.q)
    bias = float(g @ added) ** 2 / float(g @ g)
    q = basis(beside(fitter.white(whole_of(member, analysis.setup.data)), fitter.q))
    share = float(np.sum((q.T @ g) ** 2)) / float(g @ g)
    if share < LITTLE:
        return 0.0
    if q.shape[1] == fitter.white(member).shape[1]:
        return HALF * bias
    return max(HALF * bias, float(added @ added) / len(fit.coefficients[term]) * share)
