"""The null model with all that is searched given it, and the test whether an effect has the right form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from ...models.measurable import Role
from .fit import Fit
from .generic import PREDICTED, STEP, SWING, Form
from .linear import Groups, basis, project_out
from .noise import Noise
from .population import Batch, Scatter, setup_with_scatter
from .scan import GenericResidual, Remaining, generic_residual
from .selection import Search
from .setup import Setup


@dataclass(frozen=True)
class NullModel:
    """The null model with all that is searched, in the space of its noise, and the generic columns
    (N, C) of `forms` in the outputs' units.
    """

    setup: Setup
    noises: tuple[Noise, ...]
    search: Search
    generic: Remaining
    forms: Groups

    @cached_property
    def null_fit(self) -> Fit:
        """The null fit: the model without any effect."""
        return self.search.fitter.fit(())

    @cached_property
    def residual_forms(self) -> GenericResidual:
        """The generic forms tested against the residual of the null fit."""
        return generic_residual(self.null_fit, self.search.fitter, self.generic)

    @property
    def detected(self) -> bool:
        """Whether a generic form is significant in the residual of the null fit."""
        return bool(self.residual_forms.evidence.max(initial=0.0) > self.search.thresholds.generic)

    @cached_property
    def batch(self) -> Batch:
        """The units as a batch of a population."""
        return Batch(self.setup, self.search)

    def with_scatter(self, effect: Scatter) -> NullModel:
        """The same for a model that contains an effect on the scatter."""
        setup, fitter = setup_with_scatter(self.setup, effect), self.search.fitter
        moved = fitter.space.whiten(self.setup.residual - setup.residual)
        search = replace(self.search, fitter=fitter.of_record(fitter.y - moved))
        return replace(self, setup=setup, search=search)


PRICE = {1: 5.0, 2: -6.0}
"""By how much a generic form must fit better than so many selected effects to displace them: a
single cause is likelier than two."""
PART = 0.999
"""Fraction of a form in the span of some members from which it counts as a part of them."""
FOLLOWS = 3.3
"""Standard errors of the autocorrelation from which successive units are correlated (1 in 1000)."""
MIN_EXPLAINED_FRACTION = 0.01
"""Fraction of what the effects of units explain below which a remainder is no fault of their form.
"""


@dataclass(frozen=True)
class Identified:
    """Members that stay identified, withdrawn members, and the generic forms that remain."""

    confirmed: tuple[int, ...]
    withdrawn: tuple[int, ...]
    residual_forms: GenericResidual
    significant: tuple[int, ...]


def withdraw_members(null_model: NullModel, fit: Fit) -> Identified:
    """Test the members: those are withdrawn that a freer form in the same variable displaces, or
    that leave a large residual in their variable.
    """
    search, generic = null_model.search, null_model.generic
    residual_forms = generic_residual(fit, search.fitter, generic)
    significant = _large_forms(null_model, fit, residual_forms)
    withdrawn = set(displaced(search, fit, generic))
    for at in significant[:20]:
        withdrawn |= _members_in_variable(search, fit, generic, at)
    if withdrawn:
        withdrawn |= _no_longer_significant(search, fit, generic, withdrawn)
    kept = tuple(k for k in range(len(fit.members)) if k not in withdrawn)
    return Identified(kept, tuple(sorted(withdrawn)), residual_forms, significant)


def significant_forms(search: Search, residual_forms: GenericResidual) -> tuple[int, ...]:
    """The generic forms that remain beyond chance and above the practical limit, strongest first.

    The test is against the noise; how much the effects explain does not matter.
    """
    limit = search.thresholds.generic
    return tuple(
        int(at)
        for at in residual_forms.best
        if residual_forms.evidence[at] > limit and residual_forms.gains[at] > search.least_gain
    )


def _large_forms(null_model: NullModel, fit: Fit, residual_forms: GenericResidual) -> tuple[int, ...]:
    """The significant forms that are not small against what the effects of units explain."""
    least = MIN_EXPLAINED_FRACTION * max(null_model.null_fit.rss - fit.rss, 0.0)
    significant = significant_forms(null_model.search, residual_forms)
    return tuple(at for at in significant if residual_forms.gains[at] > least)


def has_structured_residuals(null_model: NullModel, fit: Fit) -> bool:
    """Whether the residuals of units of a population have a structure given a fit: they depend on a
    variable or on the preceding unit. An offset common to all units does not count.
    """
    fitter, generic = null_model.search.fitter, null_model.generic
    space = fitter.space
    if any(abs(noise.rho) * np.sqrt(space.rows_per_output) > FOLLOWS for noise in space.noises):
        return True
    large_forms = _large_forms(null_model, fit, generic_residual(fit, fitter, generic))
    return any(generic.forms[at].kind != "distribution" for at in large_forms)


def displaced(search: Search, fit: Fit, generic: Remaining) -> Sequence[int]:
    """The members that a single generic form replaces with a better fit."""
    count = len(fit.members)
    worst: tuple[float, Sequence[int]] = (0.0, ())
    numbers = generic.white.sizes + np.array([more_numbers(form) for form in generic.forms])
    of_prediction = [form.variable.startswith(PREDICTED) for form in generic.forms]
    sets = [*((k,) for k in range(count)), *combinations(range(count), 2)]
    for removed in sets:
        reduced_fit = search.fitter.fit(fit.without(*removed))
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
    form = project_out(generic.white.of(at), fitter.q)
    removed_columns = np.hstack([fitter.white(fit.members[k]) for k in removed])
    q = basis(project_out(removed_columns, fitter.q))
    return float(np.sum((q.T @ form) ** 2)) > PART * float(np.sum(form**2))


def _no_longer_significant(search: Search, fit: Fit, generic: Remaining, withdrawn: set[int]) -> set[int]:
    """The other members that are not significant given the form that displaced the withdrawn ones:
    they compensated for the residual of a wrong form.
    """
    fitter, kept = search.fitter, [k for k in range(len(fit.members)) if k not in withdrawn]
    reduced_fit = fitter.fit(fit.without(*withdrawn))
    form = generic.white.of(int(generic_residual(reduced_fit, fitter, generic).best[0]))
    insignificant = set()
    for k in kept:
        others = [fitter.white(fit.members[j]) for j in kept if j != k]
        q = basis(np.hstack([fitter.base, form, *others]))
        member_basis = basis(project_out(fitter.white(fit.members[k]), q))
        if float(np.sum((member_basis.T @ project_out(fitter.y, q)) ** 2)) < search.thresholds.library:
            insignificant.add(k)
    return insignificant


def more_numbers(form: Form) -> int:
    """Parameters of a form in addition to its coefficients: an exponent, an order, a place."""
    free = form.kind in ("power", "order") or (form.kind == "product" and form.powers is not None)
    return 1 if free or form.shape in (STEP, SWING) else 0


def _members_in_variable(search: Search, fit: Fit, generic: Remaining, at: int) -> set[int]:
    """The members that act in the variable of a generic form that remains."""
    form = generic.forms[at]
    if form.kind == "order":
        return {k for k in range(len(fit.members)) if _overlap(search, fit, generic, at, k) > 0.1}
    variables = {generic.roles.get(name) for name in (form.variable, *form.further_variables)}
    roles_by_member = enumerate(acts_in(member.candidate.effect.needs) for member in fit.members)
    return {
        k
        for k, roles in roles_by_member
        if (roles - {Role.DIRECTION}) & variables or (roles == {Role.DIRECTION} and form.direction)
    }


def acts_in(needs: Sequence[Role]) -> set[Role]:
    """The variables that an effect acts in; force stands for torque."""
    return {*needs, Role.FORCE} if Role.TORQUE in needs else set(needs)


def _overlap(search: Search, fit: Fit, generic: Remaining, at: int, k: int) -> float:
    """Fraction of a member's contribution that lies in the span of a generic form."""
    contribution = search.fitter.contribution(fit, k)
    span = basis(project_out(generic.white.of(at), search.fitter.q))
    total = float(np.sum(contribution**2))
    return float(np.sum((span.T @ contribution) ** 2)) / max(total, 1e-300)
