"""The final answer: names and terms without a name, fitted together and tested together.

Whatever is struck, exchanged or added, everything is fitted and tested again; what lowers the
held-out error and has no name that fits stays as a term, so that no number beside it is biased by
leaving it out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .abstain import displaced, more_numbers, significant_forms
from .blocks import HeldOut, improvement
from .data import GapData
from .fit import Fit, Member
from .generic import LEVELS
from .linear import basis, beside
from .scan import Left, Remaining, left_over
from .select import Search
from .unresolved import is_term, member_of, term_of

TERMS = 8
"""Terms without a name, at most."""
TRIED = 4
"""Forms and names that are tried at each step, the likeliest first."""
ROUNDS = 40
FORMS_MORE = 2
"""Forms that an answer may have beyond those that are significant, to predict as well as a step."""
DISBELIEVED = 0.1
"""What a form explains beside a name, as a share of what the name explains beside everything else,
from which that name is not the form's: it does without the form what the form does without it."""
BENEATH = 0.1
"""What all names explain, as a share of what terms explain beside them, below which the names may
be what the forms of the terms miss: no form of one or two variables is a whole law of theirs."""
FREER = 5.0
"""What a set of fewer names must fit better by than one with more, which says more."""


@dataclass(frozen=True)
class Settled:
    """The final fit, names first; the names that were struck, and what is left beside it."""

    fit: Fit
    struck: tuple[str, ...]
    left: Left
    significant: tuple[int, ...]


@dataclass(frozen=True)
class Settling:
    """What a final answer is looked for with; `tried` are accepted fits with their held-out rows,
    `believed` names whose formula may be off by what stands without a name beside them.
    """

    search: Search
    generic: Remaining
    data: GapData
    empty: Fit
    tried: Sequence[tuple[Fit, HeldOut]]
    believed: frozenset[str] = frozenset()

    def settled(self, fit: Fit) -> Settled:
        """The answer that follows from the names of a selection."""
        answers = [self.grown(fit, frozenset())]
        if lost := displaced(self.search, fit, self.generic):
            names = frozenset(fit.names[at] for at in lost)
            kept = [member for member in fit.members if member.name not in names]
            answers.append(self.grown(self.search.fitter.refined(kept), names))
        if len(answers) > 1 and answers[1].score < answers[0].score - FREER:
            answers.reverse()
        best = self._chosen(answers, frozenset())
        remaining = left_over(best, self.search.fitter, self.generic)
        struck = tuple(name for name in fit.names if name not in best.names)
        return Settled(best, struck, remaining, significant_forms(self.search, remaining))

    def again(self, fit: Fit, barred: frozenset[str], more: Sequence[Member] = ()) -> Settled:
        """The answer without some names, with more terms to begin with."""
        kept = [*(member for member in fit.members if member.name not in barred), *more]
        grown = self.grown(self.search.fitter.refined(kept), barred)
        best = self._chosen([grown], barred)
        remaining = left_over(best, self.search.fitter, self.generic)
        return Settled(best, (), remaining, significant_forms(self.search, remaining))

    def _chosen(self, answers: Sequence[Fit], barred: frozenset[str]) -> Fit:
        """The first answer that holds; without any name where its names are beneath its terms: in
        their place others would imitate the same.
        """
        best = self._first_that_holds(answers, barred)
        if not self._beneath(best):
            return best
        terms = [member for member in best.members if is_term(member)]
        barred |= {*self.search.book.places}
        alone = self.grown(self.search.fitter.refined(terms), barred)
        return self._first_that_holds([alone], barred)

    def _beneath(self, fit: Fit) -> bool:
        """Whether a fit has names, and they explain next to nothing of what its terms do."""
        terms = [member for member in fit.members if is_term(member)]
        names = [member for member in fit.members if not is_term(member)]
        if not (terms and names):
            return False
        without, only = self.search.fitter.fit(terms).rss, self.search.fitter.fit(names).rss
        explained = max(without - fit.rss, self.empty.rss - only)
        return explained < BENEATH * (only - fit.rss)

    def holds(self, fit: Fit) -> bool:
        """Whether rows that the fit never saw are predicted as well as by every accepted step, but
        for its standard error, and no worse than by the model alone.
        """
        return self._held(self.search.tested(fit))

    def _held(self, tested: HeldOut) -> bool:
        return predicts_as_well(
            tested, [held_out for _, held_out in self.tried], self.search.labels
        )

    def _first_that_holds(self, answers: Sequence[Fit], barred: frozenset[str]) -> Fit:
        """The first answer that holds, names first, terms behind them, perhaps with forms that were
        not significant; else what predicts best, of the accepted steps without barred names as
        well.
        """
        attempts = [attempt for attempt in self.tried if not barred & {*attempt[0].names}]
        for answer in answers:
            fit = self.search.fitter.refined(sorted(answer.members, key=is_term))
            for _ in range(FORMS_MORE + 1):
                tested = self.search.tested(fit)
                if self._held(tested):
                    return fit
                attempts.append((fit, tested))
                fit = self._with_best_form(fit, tested, barred) or fit
        return min(attempts, key=lambda attempt: float(np.sum(attempt[1].white ** 2)))[0]

    def _with_best_form(self, fit: Fit, tested: HeldOut, barred: frozenset[str]) -> Fit | None:
        """The fit with the form more that predicts best, None where none predicts better."""
        remaining = left_over(fit, self.search.fitter, self.generic)
        best, least = None, float(np.sum(tested.white**2))
        for larger in self._with_forms(fit, barred, remaining, [int(at) for at in remaining.best]):
            error = float(np.sum(self.search.tested(larger).white ** 2))
            if error < least:
                best, least = larger, error
        return best

    def grown(self, fit: Fit, never: frozenset[str]) -> Fit:
        """The fit with what is significant beside it, a name where one fits as well as any form;
        what no longer is beside the others is left out again.
        """
        barred = set(never)
        for _ in range(ROUNDS):
            after = self._weaker(fit, barred) or self._larger(fit, barred)
            if after is None:
                return fit
            fit = after
        return fit

    def _weaker(self, fit: Fit, barred: set[str]) -> Fit | None:
        """The fit without the name or term that is not significant beside the others, None where
        all are. What was left out does not come back.
        """
        fitter, limit = self.search.fitter, self.search.thresholds.library
        worst: tuple[float, int] = (0.0, -1)
        for at, member in enumerate(fit.members):
            gain = fitter.fit(fit.without(at)).rss - fit.rss
            needed = member.candidate.price(fitter.penalty) if is_term(member) else limit
            needed = max(needed, self.least)
            if gain < needed and (worst[1] < 0 or gain - needed < worst[0]):
                worst = (gain - needed, at)
        at = worst[1] if worst[1] >= 0 else self._disbelieved(fit)
        if at < 0:
            return None
        barred.add(fit.names[at])
        return fitter.refined(fit.without(at))

    @property
    def least(self) -> float:
        """The gain that the practical limit asks of anything."""
        return self.search.fitter.space.count * self.search.settings.practical_limit**2

    def _disbelieved(self, fit: Fit) -> int:
        """The name whose variable has a form that does what it does, and much that it does not; -1
        where there is none.
        """
        fitter = self.search.fitter
        terms = [k for k, member in enumerate(fit.members) if is_term(member)]
        for at, member in enumerate(fit.members):
            if is_term(member) or member.name in self.believed:
                continue
            without = fitter.fit([m for k, m in enumerate(fit.members) if k != at])
            forms = [k for k in terms if self._holds_name(fit, at, k)]
            if not forms:
                continue
            alone = fitter.fit([m for k, m in enumerate(fit.members) if k not in forms])
            none = fitter.fit([m for k, m in enumerate(fit.members) if k != at and k not in forms])
            if alone.rss - fit.rss > DISBELIEVED * (none.rss - alone.rss) and without.rss > fit.rss:
                return at
        return -1

    def _holds_name(self, fit: Fit, at: int, term: int) -> bool:
        """Whether the whole form of a term does nearly what a name does."""
        fitter, effect = self.search.fitter, fit.members[term].candidate.effect
        raw = effect.term.columns(self.data.readings)  # type: ignore[attr-defined]
        outputs = [o.name for o in self.data.outputs]
        whole = np.zeros((len(raw) * len(outputs), raw.shape[1]))
        place = outputs.index(effect.term.output)  # type: ignore[attr-defined]
        whole[place * len(raw) : (place + 1) * len(raw)] = raw
        q = basis(beside(fitter.space.whiten(whole), fitter.q))
        mine = beside(fitter.white(fit.members[at]) @ fit.coefficients[at], fitter.q)
        return float(np.sum((q.T @ mine) ** 2)) > 0.9 * float(mine @ mine)

    def _larger(self, fit: Fit, barred: set[str]) -> Fit | None:
        """The fit with the name or the form more that fits best and predicts better; a name goes
        before forms that fit no better. None where there is none.
        """
        before = self.search.tested(fit)
        larger_fits = [*self._names(fit, barred), *self._forms(fit, barred)]
        for larger in sorted(larger_fits, key=lambda larger: larger.score)[: 2 * TRIED]:
            tested = self.search.tested(larger)
            if improvement(before, tested, self.search.labels).real:
                return larger
        return None

    def _names(self, fit: Fit, barred: set[str]) -> Iterator[Fit]:
        """Fits with one name more, or with one in place of a term."""
        search, limit = self.search, self.search.thresholds.library
        named = [member for member in fit.members if not is_term(member)]
        if len(named) >= search.settings.effects_at_most:
            return
        starts = [(fit, limit)]
        starts += [
            (search.fitter.fit(fit.without(k)), limit)
            for k, member in enumerate(fit.members)
            if is_term(member)
        ]
        for start, needed in starts:
            candidates = [
                candidate
                for candidate in search.open(start.members)
                if candidate.gain > needed and candidate.member.name not in barred
            ]
            for larger in search.refined(start.members, candidates)[:TRIED]:
                if (
                    start.rss - larger.rss > max(needed, self.least)
                    and larger.score < fit.score - 1e-3
                ):
                    yield larger

    def _forms(self, fit: Fit, barred: set[str]) -> Iterator[Fit]:
        """Fits with one term more, of the forms that are significant, the likeliest first."""
        remaining = left_over(fit, self.search.fitter, self.generic)
        at = significant_forms(self.search, remaining)
        if sum(is_term(member) for member in fit.members) < TERMS:
            yield from self._with_forms(fit, barred, remaining, at)

    def _with_forms(
        self, fit: Fit, barred: Collection[str], remaining: Left, at: Sequence[int]
    ) -> Iterator[Fit]:
        """Fits with one of these forms more, the likeliest first, some of them."""
        penalty, sizes = self.search.fitter.penalty, self.generic.white.sizes
        count, outputs = 0, self.data.outputs
        price = {k: penalty * (sizes[k] + more_numbers(self.generic.forms[k])) for k in at}
        named = [member for member in fit.members if not is_term(member)]
        for k in sorted(at, key=lambda k: price[k] - remaining.gains[k]):
            term = term_of(self.generic.forms[k], self.data, outputs[self.generic.outputs[k]].name)
            if term is None:
                continue
            member = member_of(term, self.data, self.search.fitter, named)
            if member is None or member.name in barred or member.name in fit.names:
                continue
            larger = self.search.fitter.fit((*fit.members, member))
            if larger.score < fit.score and fit.rss - larger.rss > self.least:
                yield larger
                count += 1
            if count >= TRIED or (count < 2 and term.shape == LEVELS):
                return  # anything else would only imitate what is off with each session


def predicts_as_well(tested: HeldOut, steps: Sequence[HeldOut], labels: NDArray[np.int64]) -> bool:
    """Whether an answer is no worse on held-out rows than the model alone, the first of the steps,
    and than every other step but for its standard error.
    """
    for at, step in enumerate(steps):
        better = improvement(step, tested, labels)
        if better.gain < (0.0 if at == 0 else -better.error):
            return False
    return True


def names_of(members: Sequence[Member]) -> tuple[int, ...]:
    """The places of the members that have a name."""
    return tuple(k for k, member in enumerate(members) if not is_term(member))
