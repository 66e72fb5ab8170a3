"""The final answer: identified effects and generic terms, fitted together and tested together.

After each removal, exchange or addition everything is fitted and tested again. A form that lowers
the held-out error and fits no effect stays as a generic term, so that its omission does not bias
the parameters of the effects.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from .abstain import displaced, more_numbers, significant_forms
from .blocks import HeldOut, improvement
from .data import GapData
from .fit import Fit, Member, is_term
from .generic import LEVELS
from .linear import basis, projected_out
from .scan import GenericResidual, Remaining, generic_residual
from .select import Search
from .unresolved import member_of, term_of, whole_of

TERMS = 8
"""Largest number of generic terms."""
TRIED = 4
"""Number of forms and effects that are tried at each step, the likeliest first."""
ROUNDS = 40
FORMS_MORE = 2
"""Number of forms that may be added although not significant, to predict as well as each step."""
ENOUGH = 0.1
"""Gain of a form given an effect, as a fraction of the effect's gain given everything else, above
which the effect is not trusted: the form explains the same and much more.
"""
MINOR = 0.1
"""Gain of all effects, as a fraction of the gain of the terms given the effects, below which the
effects may only correct the terms: no form of one or two variables is the whole law.
"""
MARGIN = 5.0
"""Score by which an answer without the displaced effects must be better than the one with them."""


@dataclass(frozen=True)
class Settled:
    """The final fit, effects first; the effects that were removed, and the forms tested against the
    residual.
    """

    fit: Fit
    removed: tuple[str, ...]
    residual_forms: GenericResidual
    significant: tuple[int, ...]


@dataclass(frozen=True)
class Settling:
    """The search for a final answer. `accepted` are fits with their held-out rows, `trusted`
    effects whose formula may be off by the generic terms in the fit.
    """

    search: Search
    generic: Remaining
    data: GapData
    null_fit: Fit
    accepted: Sequence[tuple[Fit, HeldOut]]
    trusted: frozenset[str] = frozenset()

    def settled(self, fit: Fit) -> Settled:
        """The answer that follows from the effects of a selection."""
        answers = [self.grown(fit, frozenset())]
        if at := displaced(self.search, fit, self.generic):
            names = frozenset(fit.names[k] for k in at)
            answers.append(self.grown(self.search.fitter.refined(fit.without(*at)), names))
            if answers[1].score < answers[0].score - MARGIN:
                answers.reverse()
        best = self._chosen(answers, frozenset())
        return self._record(best, tuple(name for name in fit.names if name not in best.names))

    def again(self, fit: Fit, excluded: frozenset[str], more: Sequence[Member] = ()) -> Settled:
        """The answer without the effects in `excluded`, with more terms to begin with."""
        kept = [*(member for member in fit.members if member.name not in excluded), *more]
        return self._record(self._chosen([self.grown(self.search.fitter.refined(kept), excluded)], excluded), ())

    def _record(self, fit: Fit, removed: tuple[str, ...]) -> Settled:
        remaining = generic_residual(fit, self.search.fitter, self.generic)
        return Settled(fit, removed, remaining, significant_forms(self.search, remaining))

    def _chosen(self, answers: Sequence[Fit], excluded: frozenset[str]) -> Fit:
        """The first answer that holds. Where its effects explain almost nothing compared with its
        terms, all effects are excluded: others would imitate the same in their place.
        """
        best = self._first_that_holds(answers, excluded)
        if not self._effects_are_minor(best):
            return best
        excluded |= {*self.search.dictionary.places}
        alone = self.grown(self.search.fitter.refined(best.terms), excluded)
        return self._first_that_holds([alone], excluded)

    def _effects_are_minor(self, fit: Fit) -> bool:
        """Whether a fit has effects, and they explain almost nothing compared with its terms."""
        if not (fit.terms and fit.effects):
            return False
        without, only = self.search.fitter.fit(fit.terms).rss, self.search.fitter.fit(fit.effects).rss
        explained = max(without - fit.rss, self.null_fit.rss - only)
        return explained < MINOR * (only - fit.rss)

    def holds(self, fit: Fit) -> bool:
        """Whether held-out rows are predicted as well as by every accepted step, up to its standard
        error, and no worse than by the null fit.
        """
        return self._predicts_as_well(self.search.tested(fit))

    def _predicts_as_well(self, tested: HeldOut) -> bool:
        return predicts_as_well(tested, [held_out for _, held_out in self.accepted], self.search.labels)

    def _first_that_holds(self, answers: Sequence[Fit], excluded: frozenset[str]) -> Fit:
        """The first answer that holds, effects first, then terms, perhaps with forms that were not
        significant; else the one that predicts best, among the accepted steps without excluded
        effects too.
        """
        attempts = [attempt for attempt in self.accepted if not excluded & {*attempt[0].names}]
        for answer in answers:
            fit = self.search.fitter.refined(sorted(answer.members, key=is_term))
            for _ in range(FORMS_MORE + 1):
                tested = self.search.tested(fit)
                if self._predicts_as_well(tested):
                    return fit
                attempts.append((fit, tested))
                fit = self._with_best_form(fit, tested, excluded) or fit
        return min(attempts, key=lambda attempt: attempt[1].rss)[0]

    def _with_best_form(self, fit: Fit, tested: HeldOut, excluded: frozenset[str]) -> Fit | None:
        """The fit with the additional form that predicts best; None where none predicts better."""
        remaining = generic_residual(fit, self.search.fitter, self.generic)
        larger_fits = list(self._with_forms(fit, excluded, remaining, remaining.best.tolist()))
        best = min(larger_fits, key=lambda larger: self.search.tested(larger).rss, default=fit)
        return best if self.search.tested(best).rss < tested.rss else None

    def grown(self, fit: Fit, never: frozenset[str]) -> Fit:
        """The fit with all that is significant in addition: an effect where one fits as well as any
        form. What is no longer significant given the others is removed again.
        """
        excluded = set(never)
        for _ in range(ROUNDS):
            after = self._weaker(fit, excluded) or self._larger(fit, excluded)
            if after is None:
                return fit
            fit = after
        return fit

    def _weaker(self, fit: Fit, excluded: set[str]) -> Fit | None:
        """The fit without the effect or term that is least significant given the others; None where
        all are significant. A removed one is excluded from then on.
        """
        fitter, limit = self.search.fitter, self.search.thresholds.library
        worst: tuple[float, int] = (0.0, -1)
        for at, member in enumerate(fit.members):
            gain = fitter.fit(fit.without(at)).rss - fit.rss
            needed = member.candidate.price(fitter.penalty) if is_term(member) else limit
            needed = max(needed, self.search.least_gain)
            if gain < needed and (worst[1] < 0 or gain - needed < worst[0]):
                worst = (gain - needed, at)
        at = worst[1] if worst[1] >= 0 else self._explained_by_terms(fit)
        if at < 0:
            return None
        excluded.add(fit.names[at])
        return fitter.refined(fit.without(at))

    def _explained_by_terms(self, fit: Fit) -> int:
        """The index of an effect whose contribution a term explains, with much more; else -1."""
        fitter = self.search.fitter
        for at in fit.identified:
            if fit.names[at] in self.trusted:
                continue
            forms = [k for k, member in enumerate(fit.members) if is_term(member) and self._spans(fit, k, at)]
            if not forms:
                continue
            without, alone = fitter.fit(fit.without(at)), fitter.fit(fit.without(*forms))
            none = fitter.fit(fit.without(at, *forms))
            if alone.rss - fit.rss > ENOUGH * (none.rss - alone.rss) and without.rss > fit.rss:
                return at
        return -1

    def _spans(self, fit: Fit, term: int, effect: int) -> bool:
        """Whether the whole form of a term spans nearly all of an effect's contribution."""
        fitter = self.search.fitter
        q = basis(projected_out(fitter.white(whole_of(fit.members[term], self.data)), fitter.q))
        contribution = fitter.contribution(fit, effect)
        return float(np.sum((q.T @ contribution) ** 2)) > 0.9 * float(contribution @ contribution)

    def _larger(self, fit: Fit, excluded: set[str]) -> Fit | None:
        """The fit with one more effect or form that fits best and predicts better; an effect
        precedes forms that fit no better. None where there is none.
        """
        tested, labels = self.search.tested, self.search.labels
        fits = sorted([*self._with_effects(fit, excluded), *self._forms(fit, excluded)], key=attrgetter("score"))
        return next((f for f in fits[: 2 * TRIED] if improvement(tested(fit), tested(f), labels).real), None)

    def _with_effects(self, fit: Fit, excluded: set[str]) -> Iterator[Fit]:
        """Fits with one more effect, or with one in place of a term."""
        search, limit = self.search, self.search.thresholds.library
        if len(fit.effects) >= search.settings.effects_at_most:
            return
        terms = [k for k, member in enumerate(fit.members) if is_term(member)]
        for start in (fit, *(search.fitter.fit(fit.without(k)) for k in terms)):
            candidates = [
                candidate
                for candidate in search.open(start.members)
                if candidate.gain > limit and candidate.member.name not in excluded
            ]
            for larger in search.refined(start.members, candidates)[:TRIED]:
                if start.rss - larger.rss > max(limit, search.least_gain) and larger.score < fit.score - 1e-3:
                    yield larger

    def _forms(self, fit: Fit, excluded: set[str]) -> Iterator[Fit]:
        """Fits with one more term, from the significant forms, the likeliest first."""
        if len(fit.terms) < TERMS:
            remaining = generic_residual(fit, self.search.fitter, self.generic)
            yield from self._with_forms(fit, excluded, remaining, significant_forms(self.search, remaining))

    def _with_forms(
        self, fit: Fit, excluded: Collection[str], remaining: GenericResidual, at: Sequence[int]
    ) -> Iterator[Fit]:
        """Fits with one of these forms in addition, the likeliest first, at most TRIED of them."""
        penalty, sizes = self.search.fitter.penalty, self.generic.white.sizes
        count, outputs = 0, self.data.outputs
        price = {k: penalty * (sizes[k] + more_numbers(self.generic.forms[k])) for k in at}
        for k in sorted(at, key=lambda k: price[k] - remaining.gains[k]):
            term = term_of(self.generic.forms[k], self.data, outputs[self.generic.outputs[k]].name)
            if term is None:
                continue
            member = member_of(term, self.data, self.search.fitter, fit.effects)
            if member is None or member.name in excluded or member.name in fit.names:
                continue
            larger = self.search.fitter.fit((*fit.members, member))
            if larger.score < fit.score and fit.rss - larger.rss > self.search.least_gain:
                yield larger
                count += 1
            if count >= TRIED or (count < 2 and term.shape == LEVELS):
                return  # any other form would only imitate the offsets of sessions


def predicts_as_well(tested: HeldOut, steps: Sequence[HeldOut], labels: NDArray[np.int64]) -> bool:
    """Whether an answer is no worse on held-out rows than the null fit, the first of the steps, and
    than every other step up to its standard error.
    """
    first, *others = (improvement(step, tested, labels) for step in steps)
    return first.gain >= 0.0 and all(better.gain >= -better.error for better in others)
