"""The selection of effects: add, refit and test all again; and the rivals of those selected."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from ...models.effects.memory import Memory
from .blocks import HeldOut, Improvement, Split, Training, improvement, predict_held_out
from .fit import Fit, Fitter, Member, is_term
from .generic import label
from .linear import Groups, project_out, ranked
from .plan import GapSettings
from .records import Step
from .scan import Dictionary, ScanResult, Thresholds, scan

JOINT, JOINTLY, JOINT_GAIN = 100, 6, 10.0
"""Points of a grid, at most, that is searched with every other effect, sets that are then
fitted, and by how much one of them must be better than an effect added to the others as they are."""
REFINED = 8
"""Number of candidates whose nonlinear parameters are fitted at each step."""
WITHIN = 40.0
"""Gain behind the best on the grid, beyond which a candidate is not refined."""

BOTH = "significant, and held-out rows are predicted better"
UNITS = "units scatter significantly in this form, held-out units as well"
NO_BETTER = "held-out rows are not predicted better"
BELOW_PRACTICAL_LIMIT = "its contribution is below the practical limit"
NO_FORM = "given the others it is not significant, may be an error of their form, or has no number that is determined"
AS_WELL = "fits at least as well as any generic form, given the others"
TERM = "held-out rows are predicted better, and no effect of the library has this form"
VISITED = 6
"""Number of sets that a selection visits, per effect that it may have; the longest of 240 records
visited 10 sets in all."""
SAME_CAUSE = 0.985
"""Fraction of what a form, or another effect, explains from which an effect that explains as much has
the same cause: the rest is an error of its formula, 12 % of it in rms at most.
"""
MIN_EXTRA_FRACTION = 0.1
"""Gain of forms given an effect, as a fraction of the effect's gain, above which the effect is not
trusted: the forms explain the same and much more.
"""
MASKED = 12
"""Number of candidates that are tried in pairs where none is significant alone."""
PAIRS = 2
"""Number of pairs whose nonlinear parameters are fitted."""
TWO = 1.6
"""Gain that two effects must reach together, in thresholds of a single one."""


@dataclass(frozen=True)
class Search:
    """What a selection works with: fitter, candidates, their thresholds and the blocks of rows; the
    coarsest split of the record, and a fitter in which all measurements have the same weight.
    """

    fitter: Fitter
    dictionary: Dictionary
    white: Groups
    thresholds: Thresholds
    labels: NDArray[np.int64]
    settings: GapSettings
    split: Split | None = None
    plain: Fitter | None = None
    _open: dict[tuple[object, ...], list[ScanResult]] = field(init=False, default_factory=dict)
    _tested: dict[tuple[object, ...], HeldOut] = field(init=False, default_factory=dict)

    def open(self, members: Sequence[Member]) -> list[ScanResult]:
        """The candidates that may be added to `members`, best first."""
        key = tuple(member.key for member in members)
        if key not in self._open:
            candidates = scan(self.fitter, self.white, self.dictionary, members)
            self._open[key] = [candidate for candidate in candidates if not candidate.member.candidate.unread]
        return self._open[key]

    def refined(self, members: Sequence[Member], candidates: Sequence[ScanResult]) -> list[Fit]:
        """Fits with one more candidate each, its nonlinear parameters fitted, best first."""
        reached, count = self._reached(members, candidates[:REFINED]), max(self.fitter.space.count, 1)
        scale = max(1.0, (self.fitter.fit(members).rss - reached) / count) if candidates else 1.0
        least = max(min(reached - WITHIN * scale, SAME_CAUSE * reached), 0.0)
        near = [candidate.member for candidate in candidates[:REFINED] if candidate.gain > least]
        fits = (self._grown(members, member) for member in near)
        return self.ordered(fit for fit in fits if not self.cancelling(fit))

    def additions(self, start: Fit, excluded: Collection[str], than: Fit) -> Iterator[Fit]:
        """Fits with one more effect that is significant, best first, and better than `than`."""
        limit = self.thresholds.library
        # the threshold is that of the grid: the gain of a finer fit is no evidence
        candidates = [
            candidate
            for candidate in self.open(start.members)
            if candidate.gain > limit and candidate.member.name not in excluded
        ]
        for larger in self.refined(start.members, candidates):
            if start.rss - larger.rss > self.limit(larger) and self.worse(than, larger) > 1e-3:
                yield larger

    def jointly(self, fit: Fit, excluded: Collection[str]) -> Fit | None:
        """The best fit with one more effect, a nonlinear parameter of another one searched on its grid beside each
        candidate: alone, that effect may have contained both. None where none is significant.
        """
        sets: list[tuple[float, list[Member]]] = []
        for at, member in enumerate(fit.members):
            start, end = self.dictionary.places.get(member.name, (0, 0))
            if not 1 < end - start <= JOINT or member.candidate.is_nonlinear:
                continue
            best: dict[str, tuple[float, list[Member]]] = {}
            for point in self.dictionary.members[start:end]:
                members = [*fit.members[:at], point, *fit.members[at + 1 :]]
                rss = self.fitter.fit(members).rss
                for result in self.open(members)[:REFINED]:
                    name, left = result.member.name, rss - result.gain
                    if name not in excluded and (name not in best or left < best[name][0]):
                        best[name] = left, [*members, result.member]
            sets += best.values()
        fits = [self.fitter.refined(members) for _, members in ranked(sets, lambda each: -each[0])[:JOINTLY]]
        larger = (each for each in self.ordered(fits) if not self.cancelling(each))
        return next((each for each in larger if fit.rss - each.rss > self.limit(each)), None)

    def ordered(self, fits: Iterable[Fit]) -> list[Fit]:
        """Fits from the best to the worst."""
        every = list(fits)
        nearest = min(every, key=attrgetter("rss"), default=None)
        return every if nearest is None else ranked(every, lambda fit: -self.worse(fit, nearest))

    def cancelling(self, fit: Fit, nonlinear: bool = False) -> tuple[int, ...]:
        """The indices of the effects of a fit that cancel against others, or in themselves, or whose size is not one
        number, or that have no memory left. `nonlinear`: those as well whose size is no coefficient; beside the
        others of a set on the way it is not the best one yet.
        """
        together = {
            k: fit.coefficients[k].reshape(-1, fit.members[k].candidate.effect.together) for k in fit.identified
        }
        opposed = (k for k, sizes in together.items() if (sizes.min(axis=1) * sizes.max(axis=1) < 0.0).any())
        forgetful = (k for k in fit.identified if fit.members[k].forgets)
        others = self.fitter.cancelling(fit, self.thresholds.library, nonlinear), self.fitter.disagreeing(fit)
        return (*others[0], *opposed, *others[1], *forgetful)

    def _reached(self, members: Sequence[Member], candidates: Sequence[ScanResult]) -> float:
        """The largest gain with admissible signs; a scan respects those of single columns only."""
        before, best = 0.0, -np.inf
        for scanned in candidates:
            if scanned.gain <= best:
                break
            gain, candidate = scanned.gain, scanned.member.candidate
            if len(candidate.linear) > 1 and np.isfinite(candidate.bounds[0]).any():
                before = before or self.fitter.fit(members).rss
                gain = before - self.fitter.fit((*members, scanned.member)).rss
            best = max(best, gain)
        return best

    def _grown(self, members: Sequence[Member], new: Member) -> Fit:
        """A fit with a new member, whose nonlinear parameters are fitted."""
        whole = [*members, new]
        if new.shape:
            whole[-1] = self.fitter.shaped(whole, len(whole) - 1)
        return self.fitter.fit(whole)

    def tested(self, fit: Fit) -> HeldOut:
        """Held-out residuals of a fit."""
        key = tuple(member.key for member in fit.members)
        if key not in self._tested:
            self._tested[key] = predict_held_out(self._training, fit.members)
        return self._tested[key]

    @cached_property
    def elsewhere(self) -> Search:
        """The same search, its held-out rows those of the parts of the coarsest split of the record."""
        if self.split is None:
            return self
        return replace(self, labels=np.tile(self.split.labels, len(self.fitter.space.noises)), split=None)

    def dominates(self, fit: Fit, at: int) -> bool:
        """Whether an effect explains, before any generic term and with equal weights, far more than all
        terms do given the effects: they are by how much its form is off, and take no effect's place.
        """
        if not fit.terms:
            return False
        effects = self.plain_fit(fit.effects)
        without = self.plain_fit([member for k, member in enumerate(fit.members) if k != at and not is_term(member)])
        return MIN_EXTRA_FRACTION * (without.rss - effects.rss) > effects.rss - self.plain_fit(fit.members).rss

    def plain_fit(self, members: Sequence[Member]) -> Fit:
        """The fit in which all measurements have the same weight."""
        return (self.plain or self.fitter).fit(members)

    @cached_property
    def _training(self) -> Training:
        return Training(self.fitter, self.labels, self.dictionary, self.white)

    def limit(self, fit: Fit) -> float:
        """The gain that noise alone would rarely reach, given the residual that a fit leaves: a residual
        beyond the noise is as large a chance for every further effect.
        """
        return self.thresholds.library * max(1.0, fit.rss / max(self.fitter.space.count, 1))

    def predicts_as_well(self, tested: HeldOut, accepted: Sequence[tuple[Fit, HeldOut]]) -> bool:
        """Whether an answer is no worse on held-out rows than the null fit, the first of the accepted
        steps, and than every other step up to its standard error.
        """
        first, *others = (improvement(step, tested, self.labels) for _, step in accepted)
        return first.gain >= 0.0 and all(better.gain >= -better.error for better in others)

    def worse(self, fit: Fit, than: Fit) -> float:
        """By how much a fit is worse than another: squared residual in units of the noise, or of what the
        better fit leaves where that is more, and the price of the parameters.
        """
        scale = max(1.0, min(fit.rss, than.rss) / max(self.fitter.space.count, 1))
        return (fit.rss - than.rss) / scale + (fit.score - fit.rss) - (than.score - than.rss)

    def held_out_error(self, tested: HeldOut) -> float:
        """The RMSE of held-out rows, all outputs together, in noise units."""
        return float(np.sqrt(tested.rss / max(self.fitter.space.count, 1)))

    @property
    def least_gain(self) -> float:
        """The gain that the practical limit demands."""
        return self.fitter.space.count * self.settings.practical_limit**2


@dataclass(frozen=True)
class Trial:
    """A step of the loop, accepted or not, and why: `fit` is the model after it, `tested` are the held-out
    residuals of the fit that was `tried`, where that is another one, or else of the model. `scatter` is an
    effect on the scatter, which is in no fit.
    """

    action: str
    name: str
    reason: str
    fit: Fit
    tested: HeldOut
    gain: float = np.nan
    better: Improvement = Improvement(np.nan, np.nan)
    threshold: float = np.nan
    scatter: tuple[str, ...] = ()
    tried: Fit | None = None

    @property
    def accepted(self) -> bool:
        """Whether the model contains it."""
        return self.action != "reject"

    @property
    def names(self) -> tuple[str, ...]:
        """The effects in the model after it."""
        return (*(member.name for member in self.fit.effects), *self.scatter)

    def refitted(self, search: Search) -> Trial:
        """An accepted step fitted again in another noise; any other as it is."""
        if not self.accepted:
            return self
        fit = search.fitter.fit(self.fit.members)
        return replace(self, fit=fit, tested=search.tested(fit))


def step_records(search: Search, trials: Iterable[Trial]) -> tuple[Step, ...]:
    """Steps as they are printed, stored and drawn: all held-out errors refer to the noise of `search`."""
    return tuple(
        Step(
            number=at,
            action=trial.action,
            name=trial.name,
            names=trial.names,
            accepted=trial.accepted,
            reason=trial.reason,
            gain=trial.gain,
            threshold=search.thresholds.library if np.isnan(trial.threshold) else trial.threshold,
            held_out=search.held_out_error(trial.tested if trial.accepted else search.tested(trial.tried or trial.fit)),
            held_out_gain=trial.better.gain,
            held_out_error=trial.better.error,
        )
        for at, trial in enumerate(trials)
    )


@dataclass(frozen=True)
class Selection:
    """The final fit of a selection and its path, which starts at the null fit; `identified` are the
    effects in the final fit.
    """

    fit: Fit
    steps: tuple[Trial, ...]
    identified: tuple[str, ...] = ()

    @property
    def accepted(self) -> tuple[tuple[Fit, HeldOut], ...]:
        """The fits of the accepted steps with their held-out residuals, the null fit first."""
        return tuple((step.fit, step.tested) for step in self.steps if step.accepted)


def select(search: Search, quick: bool = False) -> Selection:
    """Effects that pass the threshold and the held-out test, added to the null fit one by one;
    `quick` does not try effects that are significant only in pairs.

    A turn that reaches no new set rejects one more effect or pair, and the number of sets is limited.
    """
    fit = search.fitter.fit(())
    rejected: set[frozenset[str]] = set()
    before = search.tested(fit)
    steps = [Trial("start", "", "the model as recalibrated", fit, before)]
    visited = {frozenset(fit.names)}
    most = search.settings.effects_at_most
    while len(fit.members) < most and len(visited) <= VISITED * most:
        alone = {name for names in rejected if len(names) == 1 for name in names}
        grown = next(search.additions(fit, alone, fit), None)
        both = None if quick else search.jointly(fit, alone)
        if both is not None and search.worse(grown or fit, both) > JOINT_GAIN:
            grown = both
        if grown is None and not quick:
            grown = masked_pair(search, fit, rejected)
        if grown is None:
            break
        new = grown.names[len(fit.members) :]
        name = " + ".join(new)
        gain = fit.rss - grown.rss
        if not _matters(search, gain, len(new)):
            steps.append(Trial("reject", name, BELOW_PRACTICAL_LIMIT, fit, before, gain))
            break
        after = search.tested(grown)
        better = improvement(before, after, search.labels)
        if not better.real:
            rejected.add(frozenset(new))
            steps.append(Trial("reject", name, NO_BETTER, fit, after, gain, better, tried=grown))
            continue
        steps.append(Trial("add", name, BOTH, grown, after, gain, better))
        fit = _retest_effects(search, grown, steps)
        if frozenset(fit.names) in visited:  # effects selected before: try another path from here
            rejected.add(frozenset(new))
        else:
            rejected.clear()  # effects mask each other: one rejected before may pass now
            visited.add(frozenset(fit.names))
        before = search.tested(fit)
    fit = search.fitter.refined(fit.members)
    return Selection(fit, tuple(steps), fit.names)


def with_identified_by_likelihood(
    search: Search, before: Selection, after: Selection, name: str, gain: float, limit: float, better: Improvement
) -> Selection:
    """The path of a selection, followed by an effect that was selected by likelihood and by the
    changes of the other effects given that one.
    """
    tested, why = search.tested(after.fit), f"fitted again given {name}"
    steps = [*before.steps, Trial("add", name, UNITS, before.fit, tested, gain, better, limit, (name,))]
    changes = zip(("drop", "add"), _changes(before.fit.names, after.fit.names), strict=True)
    steps += [
        Trial(action, ", ".join(names), why, after.fit, tested, scatter=(name,)) for action, names in changes if names
    ]
    return replace(after, steps=tuple(steps))


def _changes(before: Sequence[str], after: Sequence[str]) -> tuple[list[str], list[str]]:
    """The names that were dropped, and those that were added."""
    return [name for name in before if name not in after], [name for name in after if name not in before]


def _matters(search: Search, gain: float, names: int) -> bool:
    """Whether the rms explained per additional effect exceeds the practical limit."""
    rms = np.sqrt(max(gain, 0.0) / names / max(search.fitter.space.count, 1))
    return bool(rms > search.settings.practical_limit)


def masked_pair(search: Search, fit: Fit, rejected: set[frozenset[str]]) -> Fit | None:
    """The best fit with two more effects, each significant only with the other; else None.

    An effect that was rejected alone may be one of them: without the other its fit was biased.
    """
    limit = search.thresholds.library
    pairs: list[Fit] = []
    for first in search.open(fit.members)[:MASKED]:
        members = (*fit.members, first.member)
        seconds = [
            second
            for second in search.open(members)
            if frozenset([first.member.name, second.member.name]) not in rejected
        ]
        if not seconds or first.gain + seconds[0].gain < TWO * limit:
            continue
        pairs.append(search.fitter.fit([*members, seconds[0].member]))
    nearest = ranked(pairs, lambda pair: -pair.score)[:PAIRS]
    fits = [search.fitter.refined(pair.members) for pair in nearest]
    fits = [pair for pair in fits if not search.cancelling(pair)]
    best = ranked(fits, lambda pair: -pair.score)[0] if fits else None
    limit = limit if best is None else search.limit(best)
    if best is None or fit.rss - best.rss < TWO * limit or search.worse(best, fit) > 0.0:
        return None
    alone = [search.fitter.fit(best.without(k)).rss - best.rss for k in range(len(fit.members), len(best.members))]
    return best if min(alone) > limit else None


def _retest_effects(search: Search, fit: Fit, steps: list[Trial]) -> Fit:
    """The fit after each effect was exchanged for every candidate, or dropped, if that is better."""
    for _ in range(4):
        better = _exchange_effect(search, fit) or _drop_effect(search, fit)
        if better is None:
            return fit
        if sorted(better.names) == sorted(fit.names):  # the same names, fitted better
            fit = better
            continue
        action = "drop" if len(better.members) < len(fit.members) else "swap"
        dropped, added = _changes(fit.names, better.names)
        text = f"{', '.join(dropped)} for {', '.join(added)}" if added else ", ".join(dropped)
        why = "fits better given the others" if added else "no longer significant"
        fit = better
        steps.append(Trial(action, text, why, fit, search.tested(fit)))
    return fit


def _exchange_effect(search: Search, fit: Fit) -> Fit | None:
    """A better fit with one effect exchanged; None where there is none."""
    best = fit
    for at in range(len(fit.members)):
        other_members = fit.without(at)
        for swapped in search.refined(other_members, search.open(other_members))[:1]:
            if search.worse(best, swapped) > 1e-3:
                best = swapped
    return None if best is fit else best


def _drop_effect(search: Search, fit: Fit) -> Fit | None:
    """A fit without an effect that is not significant given the others; None where all are."""
    smaller_fits = (search.fitter.fit(fit.without(at)) for at in range(len(fit.members) - 1))
    return next((smaller for smaller in smaller_fits if smaller.rss - fit.rss < search.limit(fit)), None)


def concluding(search: Search, selection: Selection, fit: Fit) -> tuple[Trial, ...]:
    """The path of a selection, and its changes in the final fit: effects dropped or added, and generic terms."""
    tested, terms = search.tested(fit), list(map(label, fit.terms))
    dropped, added = _changes(selection.identified, [member.name for member in fit.effects])
    changes = (("drop", dropped, NO_FORM), ("add", added, AS_WELL), ("add", terms, TERM))
    return (*selection.steps, *(Trial(act, ", ".join(names), why, fit, tested) for act, names, why in changes if names))


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
    excluded = {member.name for member in fit.members}
    for at in identified:
        for other in _rivals_of(search, fit, (at,)):
            if other.names != other.instead_of:
                alternatives[other.names, other.instead_of] = other
    for pair in combinations(identified, 2):  # a single effect instead of two
        for other in _rivals_of(search, fit, pair):
            if other.names[0] not in excluded:
                alternatives[other.names, other.instead_of] = other
    return ranked(list(alternatives.values()), lambda other: -other.distance)


def _rivals_of(search: Search, fit: Fit, replaced: Sequence[int]) -> Iterator[Other]:
    """Fits within the set distance in which one effect replaces some. Generic terms that are errors of
    their form would be errors of the rival's as well: the effects are then compared without them; a
    simpler effect that explains nearly as much is compared with them, too.
    """
    members, names = fit.without(*replaced), tuple(fit.names[k] for k in replaced)
    terms = fit.terms if any(search.dominates(fit, at) for at in replaced) else []
    effects = [member for member in members if member not in terms]
    base, without = (search.fitter.fit(fit.effects), search.fitter.fit(effects)) if terms else (fit, fit)
    most = sum(fit.members[k].candidate.count for k in replaced)
    candidates = scan(search.fitter, search.white, search.dictionary, effects)
    for rival in search.refined(effects, candidates):
        distance, whole = search.worse(rival, base), rival
        if terms:
            whole = search.fitter.fit([*rival.members, *terms])
            simpler = rival.members[-1].candidate.count < most
            if simpler and without.rss - rival.rss > SAME_CAUSE * (without.rss - base.rss):
                distance = min(distance, search.worse(whole, fit))
        if distance <= search.settings.set_distance:
            yield Other(whole, (rival.names[-1],), names, distance)
    for candidate in candidates:  # with the same columns beside the others, of which it contains some
        same = search.fitter.fit([*effects, candidate.member])
        if abs(same.rss - base.rss) < SAME_COLUMNS and search.cancelling(same) and len(replaced) == 1:
            yield Other(same, (candidate.member.name,), names, search.worse(same, base))


def correlation(fitter: Fitter, fit: Fit, other: Other) -> float:
    """Correlation of the contributions of the exchanged effects of a fit and of those that replace
    them, given all other effects.
    """
    replaced = [k for k, name in enumerate(fit.names) if name in other.instead_of]
    substitutes = [k for k, name in enumerate(other.fit.names) if name in other.names]
    q = fitter.spanned([member for member in fit.without(*replaced) if not is_term(member)])
    a, b = (
        project_out(
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

    What may be the instrument is not attributed to physics. An effect yields to a family that it names
    (a delay to a memory) where that fits as well, and a memory beside terms, hence of a form that is off, to an
    effect with fewer numbers. Of an offset that is the same in every
    unit of a batch the process is preferred: an allocation can answer it, a gauge cannot.
    """
    for alternative in alternatives:
        replaced = alternative.instead_of
        current = next(m.candidate for m in fit.members if m.name == replaced[0])
        new = next(m.candidate for m in alternative.fit.members if m.name == alternative.names[-1])
        if len(replaced) == 1 and new.effect.family == current.effect.yields_to:
            return alternative.fit
        if isinstance(current.effect, Memory) and len(replaced) == 1 and fit.terms and new.count < current.count:
            return alternative.fit
        if abs(alternative.distance) >= SAME_COLUMNS or len(replaced) > 1 or new.unread:
            continue
        of_instrument = [c.effect.family == INSTRUMENT for c in (new, current)]
        if of_instrument == ([False, True] if population else [True, False]):
            return alternative.fit
    return None
