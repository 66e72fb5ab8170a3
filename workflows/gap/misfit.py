"""The bias of an effect's parameter due to the form of the generic terms that are fitted with it.

A generic term is one of many forms that the record allows. Where a form contains the column of an
effect, their common part is attributed to the effect; the form's squared size is spread evenly over
its dimensions, and the common dimension is assumed to have had as much. With g the column of a
parameter given all others, E the squared norm of the term r in noise units and m its dimensions,
the variance is then sigma^2 / |g|^2 (1 + E/m). A term that is fitted jointly may have absorbed g' r
/ |g|^2 of the parameter, between none and all of it: the standard deviation is taken as 0.6 of it.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...models.effects import EffectParameter
from .analysis import Analysis
from .close import Corrected
from .fit import Fit, Fitter, Member, is_term
from .linear import basis, projected_out
from .unresolved import whole_of

LITTLE = 0.01
"""Fraction of a parameter's column within a form below which they have nothing in common."""
STEP = 1e-4
"""Relative step of a derivative."""
EITHER = 0.36
"""Variance of a value between two ends, over the square of their distance, such that an interval of
90 % about one end contains the other."""
SURE = 2.0
"""Standard errors from which two fits differ by more than noise."""
LEAST_CHANCE = 0.05
"""Least variance of their difference, as a fraction of that of the wider fit."""


def misfit_of(analysis: Analysis, fit: Fit) -> dict[tuple[str, str], float]:
    """Added variance of the effects' parameters, by owner and name, due to the generic terms."""
    fitter = analysis.search.fitter
    terms = [k for k, member in enumerate(fit.members) if is_term(member)]
    named = fit.identified if terms else ()
    columns = {at: _columns(fitter, fit, at) for at in named}
    variances: dict[tuple[str, str], float] = {}
    for at in named:
        member = fit.members[at]
        numbers = [parameter.name for parameter in (*member.candidate.linear, *_fitted(member))]
        others = [columns[k] for k in named if k != at]
        for k, number in enumerate(numbers):
            given_columns = [fitter.base, np.delete(columns[at], k, axis=1), *others]
            g = projected_out(columns[at][:, k], basis(np.hstack(given_columns)))
            size = float(g @ g)
            variance = sum(_part(analysis, fit, term, g) for term in terms) if size > 0.0 else 0.0
            if variance > 0.0:
                variances[member.name, number] = variance / size
    return variances


def of_weights(model: Corrected, plain: Corrected) -> dict[tuple[str, str], float]:
    """Added variance of numbers that differ between the weighted fit and one with equal weights: if
    the form is right they differ by noise alone.

    Reference: DuMouchel and Duncan, J. Am. Stat. Assoc. 78, 1983.
    """
    away = plain.values - model.values
    variance, plain_variance = (np.diag(fitted_model.covariance) for fitted_model in (model, plain))
    chance = np.maximum(plain_variance - variance, LEAST_CHANCE * plain_variance)
    sure = away**2 > SURE**2 * chance
    return {
        (number.owner, number.name): EITHER * float(square)
        for number, square, significant in zip(model.numbers, away**2, sure, strict=True)
        if significant and np.isfinite(square)
    }


def _fitted(member: Member) -> list[EffectParameter]:
    """The nonlinear parameters that are fitted."""
    return [parameter for parameter in member.candidate.shape if not parameter.choices and member.candidate.linear]


def _columns(fitter: Fitter, fit: Fit, at: int) -> Array:
    """Whitened derivatives (N, k) of the outputs with respect to each parameter of a member."""
    member, columns = fit.members[at], [fitter.white(fit.members[at])]
    for parameter in _fitted(member):
        here = member.shape[parameter.name]
        step = STEP * (abs(here) or 1.0) * (-1.0 if here >= parameter.high else 1.0)
        moved = {**member.shape, parameter.name: here + step}
        raw = fitter.columns.of(member.candidate, moved)
        change = (fitter.space.whiten(raw) - columns[0]) @ fit.coefficients[at]
        columns.append(change[:, None] / step)
    return np.hstack(columns)


def _part(analysis: Analysis, fit: Fit, term: int, g: Array) -> float:
    """E/m of a term, times the fraction of g that lies in its whole form."""
    member, fitter = fit.members[term], analysis.search.fitter
    added = fitter.contribution(fit, term)
    bias = float(g @ added) ** 2 / float(g @ g)
    q = basis(projected_out(fitter.white(whole_of(member, analysis.setup.data)), fitter.q))
    fraction = float(np.sum((q.T @ g) ** 2)) / float(g @ g)
    if fraction < LITTLE:
        return 0.0
    if q.shape[1] == fitter.white(member).shape[1]:
        return EITHER * bias
    return max(EITHER * bias, float(added @ added) / len(fit.coefficients[term]) * fraction)
