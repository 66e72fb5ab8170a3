"""Stage 7: whether a selected effect has the right form, or only a form of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...models.measurable import Role
from .fit import Fit
from .generic import PREDICTED, STEP, SWING, Form
from .linear import basis, projected_out
from .scan import GenericResidual, Remaining, generic_residual
from .select import Search

PRICE = {1: 5.0, 2: -6.0}
"""By how much a generic form must fit better than so many selected effects to displace them: a
single cause is likelier than two."""
PART = 0.999
"""Fraction of a form in the span of some members from which it counts as a part of them."""
FOLLOWS = 3.3
"""Standard errors of the autocorrelation from which successive units are correlated (1 in 1000)."""
SMALL = 0.01
"""Fraction of what the effects of units explain below which a remainder is no fault of their form.
"""


@dataclass(frozen=True)
class Identified:
    """Members that stay identified, members that do not, and the generic forms that remain."""

    confirmed: tuple[int, ...]
    withdrawn: tuple[int, ...]
    residual_forms: GenericResidual
    significant: tuple[int, ...]
    reason: str = ""


def identified(search: Search, fit: Fit, generic: Remaining, empty: Fit) -> Identified:
    """Test the members: those are lost that a freer form in the same variable displaces, or that
    leave a large residual in their variable.
    """
    residual_forms = generic_residual(fit, search.fitter, generic)
    significant = _large(search, fit, residual_forms, empty)
    lost = set(displaced(search, fit, generic))
    for at in significant[:20]:
        lost |= _touched(search, fit, generic, at)
    if lost:
        lost |= _no_longer_significant(search, fit, generic, lost)
    kept = tuple(k for k in range(len(fit.members)) if k not in lost)
    return Identified(kept, tuple(sorted(lost)), residual_forms, significant)


def significant_forms(search: Search, residual_forms: GenericResidual) -> tuple[int, ...]:
    """The generic forms that remain beyond chance and above the practical limit, strongest first.

    The test is against the noise; how much the effects explain does not matter.
    """
    least = search.fitter.space.count * search.settings.practical_limit**2
    limit = search.thresholds.generic
    return tuple(
        int(at)
        for at in residual_forms.best
        if residual_forms.evidence[at] > limit and residual_forms.gains[at] > least
    )


def _large(search: Search, fit: Fit, residual_forms: GenericResidual, empty: Fit) -> tuple[int, ...]:
    """The significant forms that are not small against what the effects of units explain."""
    least = SMALL * max(empty.rss - fit.rss, 0.0)
    return tuple(at for at in significant_forms(search, residual_forms) if residual_forms.gains[at] > least)


def structured(search: Search, fit: Fit, generic: Remaining, empty: Fit) -> bool:
    """Whether the residuals of units of a population have a structure given a fit: they depend on a
    variable or on the preceding unit. An offset common to all units does not count.
    """
    space = search.fitter.space
    if any(abs(noise.rho) * np.sqrt(space.rows_per_output) > FOLLOWS for noise in space.noises):
        return True
    residual_forms = generic_residual(fit, search.fitter, generic)
    large_forms = _large(search, fit, residual_forms, empty)
    return any(generic.forms[at].kind != "distribution" for at in large_forms)


def displaced(search: Search, fit: Fit, generic: Remaining) -> Sequence[int]:
    """The members that a single generic form replaces with a better fit."""
    count = len(fit.members)
    worst: tuple[float, Sequence[int]] = (0.0, ())
    numbers = generic.white.sizes + np.array([more_numbers(form) for form in generic.forms])
    of_prediction = [form.variable.startswith(PREDICTED) for form in generic.forms]
    sets = [*((k,) for k in range(count)), *combinations(range(count), 2)]
    for removed in sets:
        others = tuple(member for k, member in enumerate(fit.members) if k not in removed)
        reduced_fit = search.fitter.fit(others)
        gains = generic.gains(search.fitter, reduced_fit)
        score = reduced_fit.score - gains + search.fitter.penalty * numbers + PRICE[len(removed)]
        score[of_prediction] = np.inf
        margin = fit.score - float(score.min())
        while margin > worst[0] and _is_part(search, fit, generic, int(np.argmin(score)), removed):
            score[int(np.argmin(score))] = np.inf
            margin = fit.score - float(score.min())
        if margin > worst[0]:
            worst = (margin, removed)
    return worst[1]


def _is_part(search: Search, fit: Fit, generic: Remaining, at: int, removed: Sequence[int]) -> bool:
    """Whether a form is a special case of members, some of their parameters being 0."""
    fitter = search.fitter
    form = projected_out(generic.white.of(at), fitter.q)
    removed_columns = np.hstack([fitter.white(fit.members[k]) for k in removed])
    q = basis(projected_out(removed_columns, fitter.q))
    return float(np.sum((q.T @ form) ** 2)) > PART * float(np.sum(form**2))


def _no_longer_significant(search: Search, fit: Fit, generic: Remaining, lost: set[int]) -> set[int]:
    """The other members that are not significant given the form which displaced the lost ones:
    they compensated for the residual of a wrong form.
    """
    fitter, kept = search.fitter, [k for k in range(len(fit.members)) if k not in lost]
    reduced_fit = fitter.fit([fit.members[k] for k in kept])
    form = generic.white.of(int(generic_residual(reduced_fit, fitter, generic).best[0]))
    insignificant = set()
    for k in kept:
        others = [fitter.white(fit.members[j]) for j in kept if j != k]
        q = basis(np.hstack([fitter.base, form, *others]))
        member_basis = basis(projected_out(fitter.white(fit.members[k]), q))
        if float(np.sum((member_basis.T @ projected_out(fitter.y, q)) ** 2)) < search.thresholds.library:
            insignificant.add(k)
    return insignificant


def more_numbers(form: Form) -> int:
    """Parameters of a form in addition to its coefficients: an exponent, an order, a place."""
    free = form.kind in ("power", "order") or (form.kind == "product" and form.powers is not None)
    return 1 if free or form.shape in (STEP, SWING) else 0


def _touched(search: Search, fit: Fit, generic: Remaining, at: int) -> set[int]:
    """The members that act in the variable of a generic form that remains."""
    form = generic.forms[at]
    if form.kind == "order":
        return {k for k in range(len(fit.members)) if _overlap(search, fit, generic, at, k) > 0.1}
    variables = {generic.roles.get(name) for name in (form.variable, *form.further_variables)}
    touched = set()
    for k, member in enumerate(fit.members):
        roles = acts_in(member.candidate.effect.needs)
        if (roles - {Role.DIRECTION}) & variables or (roles == {Role.DIRECTION} and form.direction):
            touched.add(k)
    return touched


def acts_in(needs: Sequence[Role]) -> set[Role]:
    """The variables that an effect acts in; force stands for torque."""
    roles = set(needs)
    if Role.TORQUE in roles:
        roles.add(Role.FORCE)
    return roles


def _overlap(search: Search, fit: Fit, generic: Remaining, at: int, k: int) -> float:
    """Fraction of a member's contribution that lies in the span of a generic form."""
    contribution = projected_out(search.fitter.white(fit.members[k]) @ fit.coefficients[k], search.fitter.q)
    span = basis(projected_out(generic.white.of(at), search.fitter.q))
    total = float(np.sum(contribution**2))
    return float(np.sum((span.T @ contribution) ** 2)) / max(total, 1e-300)
