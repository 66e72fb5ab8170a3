"""How far a named number may be off for the form of what has no name beside it.

A term without a name is one of many forms that the record allows. Where a form holds what a named
effect does, all that they share is given to the name; of the form's squared size each of its
dimensions has its part, and the shared one is taken to have had as much. With g the column of a
number beside all others, E the squared norm of the term r in noise units and m its dimensions, the
variance is then sigma^2 / |g|^2 (1 + E/m). A term that is fitted jointly may have taken g' r /
|g|^2 from the number, at worst all of it or none: 0.6 of that is taken for the standard deviation.
"""

from __future__ import annotations

import numpy as np

from ...models.effects import EffectParameter
from ...models.inputs.distribution import Array
from .analysis import Analysis
from .close import Corrected
from .fit import Fit, Fitter, Member
from .linear import basis, beside
from .settle import names_of
from .unresolved import is_term, whole_of

LITTLE = 0.01
"""Share of a number's column within a form below which they have nothing in common."""
STEP = 1e-4
"""Relative step of a derivative."""
EITHER = 0.36
"""Variance of what lies anywhere between two ends, over the square of their distance, such that an
interval of 90 % about one end holds the other."""
SURE = 2.0
"""Standard errors from which two fits differ by more than noise."""
LEAST_CHANCE = 0.05
"""Variance of their difference at least, as a share of that of the wider one."""


def misfit_of(analysis: Analysis, fit: Fit) -> dict[tuple[str, str], float]:
    """More variance of named numbers, by owner and name, for the terms beside them."""
    fitter = analysis.search.fitter
    terms = [k for k, one in enumerate(fit.members) if is_term(one)]
    named = names_of(fit.members) if terms else ()
    columns = {at: _columns(fitter, fit, at) for at in named}
    found: dict[tuple[str, str], float] = {}
    for at in named:
        member = fit.members[at]
        numbers = [one.name for one in (*member.candidate.linear, *_fitted(member))]
        others = [columns[k] for k in named if k != at]
        for k, number in enumerate(numbers):
            beside_it = [fitter.base, np.delete(columns[at], k, axis=1), *others]
            g = beside(columns[at][:, k], basis(np.hstack(beside_it)))
            size = float(g @ g)
            share = sum(_part(analysis, fit, term, g) for term in terms) if size > 0.0 else 0.0
            if share > 0.0:
                found[member.name, number] = share / size
    return found


def of_weights(model: Corrected, plain: Corrected) -> dict[tuple[str, str], float]:
    """More variance of numbers that differ between the fit in the noise as it is and one in which
    every reading counts the same: of the right form they differ by noise alone.

    Reference: DuMouchel and Duncan, J. Am. Stat. Assoc. 78, 1983.
    """
    away = plain.values - model.values
    own, other = (np.diag(one.covariance) for one in (model, plain))
    chance = np.maximum(other - own, LEAST_CHANCE * other)
    sure = away**2 > SURE**2 * chance
    return {
        (one.owner, one.name): EITHER * float(square)
        for one, square, odd in zip(model.numbers, away**2, sure, strict=True)
        if odd and np.isfinite(square)
    }


def _fitted(member: Member) -> list[EffectParameter]:
    """The nonlinear parameters that are fitted."""
    return [one for one in member.candidate.shape if not one.choices and member.candidate.linear]


def _columns(fitter: Fitter, fit: Fit, at: int) -> Array:
    """What a unit of each number of a member does (N, k), whitened."""
    member, found = fit.members[at], [fitter.white(fit.members[at])]
    for one in _fitted(member):
        here = member.shape[one.name]
        step = STEP * (abs(here) or 1.0) * (-1.0 if here >= one.high else 1.0)
        moved = {**member.shape, one.name: here + step}
        raw = fitter.columns.of(member.candidate, moved)
        away = (fitter.space.whiten(raw) - found[0]) @ fit.coefficients[at]
        found.append(away[:, None] / step)
    return np.hstack(found)


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
        return EITHER * bias
    return max(EITHER * bias, float(added @ added) / len(fit.coefficients[term]) * share)
