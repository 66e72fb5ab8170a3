"""Stage 7: whether what is named is the right form, or only something of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...models.measurable import Role
from .fit import Fit
from .generic import PREDICTED, STEP, SWING, Form
from .linear import basis, beside
from .scan import Left, Remaining, left_over
from .select import Search

PRICE = {1: 5.0, 2: -6.0}
"""What a form without a name must fit better by than so many named effects, to displace them: one
cause is likelier than two."""
PART = 0.999
"""Share of a form within what members can do, from which it is a part of them."""
FOLLOWS = 3.3
"""Standard errors of the autocorrelation from which one unit follows the other (1 in 1000)."""
SMALL = 0.01
"""Share of what the effects of units explain below which a remainder is no fault of their form."""


@dataclass(frozen=True)
class Judged:
    """Members that keep their name, those that do not, and the forms that are left."""

    kept: tuple[int, ...]
    lost: tuple[int, ...]
    left: Left
    significant: tuple[int, ...]
    reason: str = ""


def judged(search: Search, fit: Fit, generic: Remaining, empty: Fit) -> Judged:
    """Names that a freer form in the same variable displaces, or leaves much beside, are lost."""
    residual_forms = left_over(fit, search.fitter, generic)
    significant = _large(search, fit, residual_forms, empty)
    lost = set(displaced(search, fit, generic))
    for at in significant[:20]:
        lost |= _touched(search, fit, generic, at)
    if lost:
        lost |= _no_longer_significant(search, fit, generic, lost)
    kept = tuple(k for k in range(len(fit.members)) if k not in lost)
    return Judged(kept, tuple(sorted(lost)), residual_forms, significant)


def significant_forms(search: Search, residual_forms: Left) -> tuple[int, ...]:
    """The forms that are left beyond chance and above the practical limit, the strongest first.

    What the effects explain does not matter: a remainder is tested against the noise.
    """
    least = search.fitter.space.count * search.settings.practical_limit**2
    limit = search.thresholds.generic
    return tuple(
        int(at)
        for at in residual_forms.best
        if residual_forms.evidence[at] > limit and residual_forms.gains[at] > least
    )


def _large(search: Search, fit: Fit, residual_forms: Left, empty: Fit) -> tuple[int, ...]:
    """Those of them that are no small change of what the effects of units explain."""
    least = SMALL * max(empty.rss - fit.rss, 0.0)
    return tuple(
        at for at in significant_forms(search, residual_forms) if residual_forms.gains[at] > least
    )


def structured(search: Search, fit: Fit, generic: Remaining, empty: Fit) -> bool:
    """Whether units of a population follow something beside a fit, be it each other: not only all
    of them alike.
    """
    space = search.fitter.space
    if any(abs(noise.rho) * np.sqrt(space.readings) > FOLLOWS for noise in space.noises):
        return True
    residual_forms = left_over(fit, search.fitter, generic)
    large_forms = _large(search, fit, residual_forms, empty)
    return any(generic.forms[at].kind != "distribution" for at in large_forms)


def displaced(search: Search, fit: Fit, generic: Remaining) -> Sequence[int]:
    """The members that one generic form fits better in place of."""
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
    """Whether a form is what members do with some of their numbers at 0: no other than theirs."""
    fitter = search.fitter
    form = beside(generic.white.of(at), fitter.q)
    removed_columns = np.hstack([fitter.white(fit.members[k]) for k in removed])
    q = basis(beside(removed_columns, fitter.q))
    return float(np.sum((q.T @ form) ** 2)) > PART * float(np.sum(form**2))


def _no_longer_significant(
    search: Search, fit: Fit, generic: Remaining, lost: set[int]
) -> set[int]:
    """The other members that are not significant beside the form which displaced those: they made
    up for what a wrong form left.
    """
    fitter, kept = search.fitter, [k for k in range(len(fit.members)) if k not in lost]
    reduced_fit = fitter.fit([fit.members[k] for k in kept])
    form = generic.white.of(int(left_over(reduced_fit, fitter, generic).best[0]))
    insignificant = set()
    for k in kept:
        others = [fitter.white(fit.members[j]) for j in kept if j != k]
        q = basis(np.hstack([fitter.base, form, *others]))
        member_basis = basis(beside(fitter.white(fit.members[k]), q))
        if float(np.sum((member_basis.T @ beside(fitter.y, q)) ** 2)) < search.thresholds.library:
            insignificant.add(k)
    return insignificant


def more_numbers(form: Form) -> int:
    """Numbers in a form beside its coefficients: an exponent, an order, a place."""
    free = form.kind in ("power", "order") or (form.kind == "product" and form.powers is not None)
    return 1 if free or form.shape in (STEP, SWING) else 0


def _touched(search: Search, fit: Fit, generic: Remaining, at: int) -> set[int]:
    """The members that act in the variable of a generic form that is left."""
    form = generic.forms[at]
    if form.kind == "order":
        return {k for k in range(len(fit.members)) if _overlap(search, fit, generic, at, k) > 0.1}
    variables = {generic.roles.get(name) for name in (form.variable, *form.more)}
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
    """Share of a member's contribution that lies in the span of a generic form."""
    contribution = beside(
        search.fitter.white(fit.members[k]) @ fit.coefficients[k], search.fitter.q
    )
    span = basis(beside(generic.white.of(at), search.fitter.q))
    total = float(np.sum(contribution**2))
    return float(np.sum((span.T @ contribution) ** 2)) / max(total, 1e-300)
