"""The whole loop on one record: noise, selected effects, the search for the final answer, its rivals."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.effects import Effect
from ...models.effects.measurements import changes_of, effect_actions
from ...models.effects.memory import Memory
from ...models.effects.unresolved import CURVED, LEVELS, NO_CURVE, Term, Unresolved, acts_over, broken_line
from ...models.measurable import Role
from .blocks import HeldOut, improvement
from .close import corrected
from .data import GapData
from .fit import Fit, Fitter, Member, Space, is_term
from .generic import effect_of, is_plays, member_of, member_with, stack_columns, term_of, whole_term, without_idle_plays
from .linear import basis, project_out, ranked, rms
from .null_model import (
    Identified,
    NullModel,
    alike,
    build_null_model,
    change_noise,
    contributions,
    displaced,
    has_structured_residuals,
    more_numbers,
    noise_of,
    reread_by_instrument,
    setup_as_read,
    significant_forms,
    spread_of,
    withdraw_members,
)
from .population import Misfit, Scatter, misfit, scatter
from .records import Step
from .scan import GenericResidual, Remaining, dictionary, generic_residual
from .selection import (
    MIN_EXTRA_FRACTION,
    SAME_CAUSE,
    Other,
    Search,
    Selection,
    Trial,
    concluding,
    first_of_confounded,
    rivals,
    same_columns,
    select,
    step_records,
    with_identified_by_likelihood,
)
from .setup import Setup, move_setup


def as_curve(fitter: Fitter, fit: Fit, small: Sequence[int], large: Sequence[int], data: GapData) -> Member | None:
    """The sum of small members of a fit that large ones cannot explain, as a term over its variable;
    None where it has several variables, or acts on several outputs.

    The part that the large members can explain, with equal weights, is attributed to those members,
    whose parameters are then those of their formulas alone.
    """
    columns = fitter.columns.of
    added = [columns(m.candidate, m.shape) @ fit.coefficients[k] for k, m in enumerate(fit.members) if k in small]
    contribution, q = np.sum(added, axis=0), basis(fitter.raw_base)
    for x in [np.hstack([columns(fit.members[k].candidate, fit.members[k].shape) for k in large])] if large else []:
        contribution -= x @ np.linalg.lstsq(project_out(x, q), project_out(contribution, q), rcond=1e-9)[0]
    parts = np.split(contribution, len(data.outputs))
    acting = [at for at, part in enumerate(parts) if np.any(part)]
    over = {variables_of(fit.members[k], data) for k in small}
    if len(acting) != 1 or len(over) != 1:
        return None
    (inputs, turns), part = over.pop(), parts[acting[0]]
    if len(inputs) != 1:
        return None
    y = part * np.asarray(data.measurements[Role.DIRECTION], dtype=float) if turns else part
    variable = next(iter(inputs))
    knots, heights, off = broken_line(data.values(variable), y)
    if off > NO_CURVE:
        return None
    effect = Unresolved(
        Term(data.outputs[acting[0]].name, variable, "curve", knots=knots, heights=heights, turns=turns)
    )
    return member_with(effect, data)


def variables_of(member: Member, data: GapData) -> tuple[frozenset[str], bool]:
    """The inputs that a member acts in, and whether it follows the direction as well."""
    return acts_over(member.candidate.effect, data.inputs, data.target)


def with_curves(fitter: Fitter, fit: Fit, data: GapData) -> Fit:
    """The fit in which the terms over a variable that effects act in are one curve, of which those
    effects can explain nothing: their parameters are those of their formulas alone, and the curve is
    by how much these are off. Plays without a weight are left out.
    """
    groups: dict[tuple[str, frozenset[str], bool], list[int]] = {}
    for k, member in enumerate(fit.members):
        effect = member.candidate.effect
        if isinstance(effect, Unresolved) and effect.term.shape in (*CURVED, "constant"):
            groups.setdefault((effect.term.output, *variables_of(member, data)), []).append(k)
    pairs = zip(fit.members, fit.coefficients, strict=True)
    members = {k: without_idle_plays(*pair, data) for k, pair in enumerate(pairs)}
    signed = {c.name for c in data.inputs if c.role is Role.SPEED and np.min(data.values(c.name)) < 0.0}
    for (_, variables, turns), terms in groups.items():  # of a signed speed a curve may be opposite or not
        acting = [(k, *variables_of(fit.members[k], data)) for k in fit.identified]
        either = bool(variables & signed)
        large = [k for k, inputs, opposite in acting if inputs <= variables and (either or opposite == turns)]
        curve = as_curve(fitter, fit, terms, large, data) if large else None
        if curve is not None:
            members = {k: member for k, member in members.items() if k not in terms} | {terms[0]: curve}
    return fitter.fit([members[k] for k in sorted(members)]) if fit.terms else fit


# The final answer: identified effects and generic terms, fitted together and tested together.
#
# After each removal, exchange or addition everything is fitted and tested again. A form that lowers
# the held-out error and fits no effect stays as a generic term, so that its omission does not bias
# the parameters of the effects.

TRIED = 4
"""Number of forms and effects that are tried at each step, the likeliest first."""
SETTLE_ROUNDS = 40
FORMS_MORE = 2
"""Number of forms that may be added although not significant, to predict as well as each step."""
AS_WELL = 0.05
"""Fraction by which the squared held-out error of plays alone may exceed that with effects of a memory."""
MINOR = 0.1
"""Gain of all effects, as a fraction of the gain of the terms given the effects, below which the
effects may only correct the terms: no form of one or two variables is the whole law.
"""
EARLIER = "the fit before, in the noise given it, is better than what is selected anew"
SCORE_MARGIN = 5.0
"""Score by which an answer without the displaced effects must be better than the one with them."""


@dataclass(frozen=True)
class Settling:
    """The search for a final answer. `accepted` are fits with their held-out rows, `trusted`
    effects whose formula may be off by the generic terms in the fit.
    """

    search: Search
    generic: Remaining
    data: GapData
    accepted: Sequence[tuple[Fit, HeldOut]]
    trusted: frozenset[str] = frozenset()

    def settled(self, fit: Fit) -> Fit:
        """The answer that follows from the effects of a selection, effects first."""
        answers = [self.grown(fit, frozenset())]
        if at := displaced(self.search, fit, self.generic):
            names = frozenset(fit.names[k] for k in at)
            answers.append(self.grown(self.search.fitter.refined(fit.without(*at)), names))
            if answers[1].score < answers[0].score - SCORE_MARGIN:
                answers.reverse()
        return self._with_general_memory(self._chosen(answers, frozenset()))

    def _with_general_memory(self, fit: Fit) -> Fit:
        """The answer in which plays replace all effects with a memory, where a fit has several or plays as well,
        none of them alone explains nearly as much as plays do (none is the cause), and plays predict as well.
        One that does is the cause: other laws over its path would only be by how much its form is off.
        """
        plays = [k for k, member in enumerate(fit.members) if is_plays(member)]
        known = {member.name: member.candidate.effect for member in self.search.dictionary.members}
        names = frozenset(name for name, effect in known.items() if Memory.family in (effect.family, effect.yields_to))
        effects = [k for k, name in enumerate(fit.names) if name in names]
        if not effects or len(plays) + len(effects) < 2:
            return fit
        others, fitter = fit.without(*plays, *effects), self.search.fitter
        answer = self.grown(fitter.refined(others), names)
        none = fitter.fit(others).rss
        general = fitter.fit((*others, *filter(is_plays, answer.members))).rss
        alone = {fit.names[k]: fitter.refined((*others, fit.members[k])).rss for k in effects}
        cause = min(alone, key=alone.__getitem__)
        if none - alone[cause] > SAME_CAUSE * (none - general):
            path = self._driving(known[cause])
            names = frozenset(name for name in names - {cause} if path and self._driving(known[name]) is path)
            if not names & {*alone}:
                return fit
            answer = self.grown(fitter.refined([member for member in fit.members if member.name not in names]), names)
        answer = self._chosen([answer], names)
        before, after = (self.search.tested(each).rss for each in (fit, answer))
        return answer if self.holds(answer) and after < (1.0 + AS_WELL) * before else fit

    def _driving(self, effect: Effect) -> Role | None:
        """The role of the column along whose path an effect has its memory, if it has one."""
        return effect.driven_by(self.data.target) if isinstance(effect, Memory) else None

    def again(self, fit: Fit, excluded: frozenset[str], more: Sequence[Member] = ()) -> Fit:
        """The answer without the effects in `excluded`, with more terms to begin with: effects are
        searched first, and then terms.
        """
        kept = [*(member for member in fit.effects if member.name not in excluded), *more]
        return self._chosen([self.grown(self.search.fitter.refined(kept), excluded)], excluded)

    def _chosen(self, answers: Sequence[Fit], excluded: frozenset[str]) -> Fit:
        """The first answer that holds. Where its effects explain almost nothing compared with its
        terms, all effects are excluded: others would imitate the same in their place.
        """
        best = self._first_that_holds(answers, excluded)
        if not self._effects_are_minor(best):
            return best
        excluded |= {*self.search.dictionary.places}
        return self._first_that_holds([self.grown(self.search.fitter.refined(best.terms), excluded)], excluded)

    def _effects_are_minor(self, fit: Fit) -> bool:
        """Whether a fit has effects, and with equal weights they explain almost nothing compared with
        its terms.
        """
        if not (fit.terms and fit.effects):
            return False
        sets = (), fit.effects, fit.terms, fit.members
        null, only, without, whole = (self.search.plain_fit(members).rss for members in sets)
        return max(without - whole, null - only) < MINOR * (only - whole)

    def holds(self, fit: Fit) -> bool:
        """Whether held-out rows are predicted as well as by every accepted step."""
        return self.search.predicts_as_well(self.search.tested(fit), self.accepted)

    def _first_that_holds(self, answers: Sequence[Fit], excluded: frozenset[str]) -> Fit:
        """The first answer that holds, effects first, then terms, perhaps with forms that were not
        significant; else the one that predicts best, among the accepted steps without excluded
        effects too.
        """
        attempts = [attempt for attempt in self.accepted if not excluded & {*attempt[0].names}]
        for answer in answers:
            fit = self.search.fitter.refined(sorted(answer.members, key=is_term))
            for _ in range(FORMS_MORE + 1):
                if self.holds(fit):
                    return fit
                attempts.append((fit, self.search.tested(fit)))
                fit = self._with_best_form(fit, excluded) or fit
        return min(attempts, key=lambda attempt: attempt[1].rss)[0]

    def _with_best_form(self, fit: Fit, excluded: frozenset[str]) -> Fit | None:
        """The fit with the additional form that predicts best; None where none predicts better."""
        remaining = generic_residual(fit, self.search.fitter, self.generic)
        larger_fits = list(self._with_forms(fit, excluded, remaining, remaining.best.tolist()))
        best = min(larger_fits, key=lambda larger: self.search.tested(larger).rss, default=fit)
        return best if self.search.tested(best).rss < self.search.tested(fit).rss else None

    def grown(self, fit: Fit, never: frozenset[str]) -> Fit:
        """The fit with all that is significant in addition: an effect where one fits as well as any
        form. What is no longer significant given the others is removed again.
        """
        excluded = set(never)
        for _ in range(SETTLE_ROUNDS):
            after = self._weaker(fit, excluded) or self._larger(fit, excluded)
            if after is None:
                return fit
            fit = self.search.fitter.refined(after.members)
        return fit

    def _weaker(self, fit: Fit, excluded: set[str]) -> Fit | None:
        """The fit without the effect or term that is least significant given the others; None where
        all are significant. A removed one is excluded from then on.
        """
        fitter, limit = self.search.fitter, self.search.limit(fit)
        worst: tuple[float, int] = (0.0, -1)
        for at, member in enumerate(fit.members):
            if not is_term(member) and self.search.dominates(fit, at):
                continue
            gain = fitter.fit(fit.without(at)).rss - fit.rss
            needed = member.candidate.price(fitter.penalty) if is_term(member) else limit
            needed = max(needed, self.search.least_gain)
            if gain < needed and (worst[1] < 0 or gain - needed < worst[0]):
                worst = (gain - needed, at)
        at = worst[1] if worst[1] >= 0 else self._explained_by_terms(fit)
        if at < 0:
            return None
        excluded.add(fit.names[at])
        plays = (k for k, member in enumerate(fit.members) if is_plays(member))  # orthogonal to an effect, perhaps that
        return fitter.refined(fit.without(at, *plays))

    def _explained_by_terms(self, fit: Fit) -> int:
        """The index of an effect whose contribution a term explains, with much more; else -1."""
        fitter = self.search.fitter
        for at in fit.identified:
            if fit.names[at] in self.trusted or self.search.dominates(fit, at):
                continue
            forms = [k for k, member in enumerate(fit.members) if is_term(member) and self._spans(fit, k, at)]
            if not forms:
                continue
            without, alone = fitter.fit(fit.without(at)), fitter.fit(fit.without(*forms))
            none = fitter.fit(fit.without(at, *forms))
            if alone.rss - fit.rss > MIN_EXTRA_FRACTION * (none.rss - alone.rss) and without.rss > fit.rss:
                return at
        return -1

    def _spans(self, fit: Fit, term: int, effect: int) -> bool:
        """Whether the whole form of a term spans nearly all of an effect's contribution."""
        fitter = self.search.fitter
        q = basis(project_out(fitter.white(whole_term(fit.members[term], self.data)), fitter.q))
        contribution = fitter.contribution(fit, effect)
        return float(np.sum((q.T @ contribution) ** 2)) > 0.9 * float(contribution @ contribution)

    def _larger(self, fit: Fit, excluded: set[str]) -> Fit | None:
        """The fit with one more effect, or else one more form, that fits best and predicts better. A form
        predicts other sessions or test conditions better as well, where the record has any. None where
        there is none.
        """
        search, split = self.search, self.search.split
        for larger in search.ordered(self._with_effects(fit, excluded))[: 2 * TRIED]:
            if improvement(search.tested(fit), search.tested(larger), search.labels).real:
                return larger
        natural = split is not None and split.natural
        for larger in search.ordered(self._forms(fit, excluded)):
            elsewhere = natural and effect_of(larger.members[-1]).term.shape != LEVELS  # which are of one session
            searches = [search, search.elsewhere] if elsewhere else [search]
            tests = (improvement(each.tested(fit), each.tested(larger), each.labels) for each in searches)
            if all(better.gain > better.error for better in tests):
                return larger
        return None

    def _with_effects(self, fit: Fit, excluded: set[str]) -> Iterator[Fit]:
        """Fits with one more effect, or with one in place of a term."""
        search = self.search
        if len(fit.effects) >= search.settings.effects_at_most:
            return
        terms = [k for k, member in enumerate(fit.members) if is_term(member)]
        for start in (fit, *(search.fitter.fit(fit.without(k)) for k in terms)):
            larger_fits = search.additions(start, excluded, fit)
            yield from (larger for larger in larger_fits if start.rss - larger.rss > search.least_gain)

    def _forms(self, fit: Fit, excluded: set[str]) -> Iterator[Fit]:
        """Fits with one more term, from the significant forms, the likeliest first."""
        if len(fit.terms) < self.search.settings.terms_at_most:
            remaining = generic_residual(fit, self.search.fitter, self.generic)
            yield from self._with_forms(fit, excluded, remaining, significant_forms(self.search, remaining))

    def _with_forms(
        self, fit: Fit, excluded: Collection[str], remaining: GenericResidual, at: Sequence[int]
    ) -> Iterator[Fit]:
        """Fits with one of these forms in addition, the likeliest first, at most TRIED of them."""
        penalty, sizes = self.search.fitter.penalty, self.generic.white.sizes
        count, outputs = 0, self.data.outputs
        price = {k: penalty * (sizes[k] + more_numbers(self.generic.forms[k])) for k in at}
        for k in ranked(at, lambda k: float(remaining.gains[k]) - price[k]):
            term = term_of(self.generic.forms[k], self.data, outputs[self.generic.outputs[k]].name)
            if term is None:
                continue
            member = member_of(term, self.data, self.search.fitter, fit.members)
            if member is None or member.name in excluded or member.name in fit.names:
                continue
            larger = self.search.fitter.fit((*fit.members, member))
            if larger.score < fit.score and fit.rss - larger.rss > self.search.least_gain:
                yield larger
                count += 1
            if count >= TRIED or (count < 2 and term.shape == LEVELS):
                return  # any other form would only imitate the offsets of sessions


AUTOCORRELATED = 0.4
"""Autocorrelation from which it is tested whether the noise is a missing effect."""
SETTLED = 3
"""How often the final set is searched, the noise estimated again given the set."""
ROUNDS = 2
"""How often the noise is estimated again given the selected effects."""
BETTER = 1.0
"""By how much a rival must fit better than the selected set to replace it."""
OUTLIER_SPREAD = 4000.0
"""Reciprocal density of an outlier, in standard deviations: 1 unit in 200, anywhere within 10
standard deviations."""


@dataclass(frozen=True)
class Analysis:
    """The result of the loop, before it is put into records.

    `initial_null_model` is that at the start of the loop, `null_model` the one at its end. They
    differ only by an effect on the scatter of a population, which the latter contains.
    """

    initial_null_model: NullModel
    null_model: NullModel
    selection: Selection
    identified: Identified
    rivals: tuple[Other, ...]
    significant: bool
    scatter: tuple[Scatter, ...] = ()
    misfit: Misfit | None = None
    removed: tuple[str, ...] = ()
    excluded: frozenset[str] = frozenset()
    trusted: frozenset[str] = frozenset()

    @property
    def fit(self) -> Fit:
        """The fit with every accepted effect; of a batch with those that were withdrawn as well."""
        return self.selection.fit

    @property
    def setup(self) -> Setup:
        """The setup of the final null model."""
        return self.null_model.setup

    @property
    def search(self) -> Search:
        """The search given the final null model."""
        return self.null_model.search

    @property
    def steps(self) -> tuple[Step, ...]:
        """The path of the selection, and of rows what became of it in the answer."""
        of_units = self.setup.data.target.population
        trials = self.selection.steps if of_units else concluding(self.search, self.selection, self.fit)
        return step_records(self.search, trials)

    def without_effects(self) -> Analysis:
        """The analysis of a batch without any identified effect."""
        null = self.initial_null_model
        selection = replace(self.selection, fit=null.null_fit)
        odd = misfit(null.batch, null.null_fit, None)
        return Analysis(null, null, selection, withdraw_members(null, null.null_fit), (), self.significant, (), odd)

    @property
    def score(self) -> float:
        """Of a batch: minus twice the log likelihood of its units, plus the effects' price."""
        batch = self.initial_null_model.batch
        if not self.scatter:
            return batch.score_without_effect(self.fit)
        return self.scatter[0].score + batch.price(self.fit)


def analysed(setup: Setup) -> Analysis:
    """Run the loop, the noise estimated again given the selected effects."""
    setup = setup_as_read(setup)
    noises = noise_of(setup, ())
    effects = dictionary(setup.library, setup.columns, spread_of(noises), setup.residual)
    null_model = build_null_model(setup, noises, effects, *stack_columns(setup.generic, len(setup.data.outputs)), None)
    if _within_floor(null_model):
        return _nothing(null_model)
    selection = select(null_model.search)
    if max(noise.rho for noise in noises) > AUTOCORRELATED:
        selection, null_model = _select_without_autocorrelation(selection, null_model)
    for _ in range(ROUNDS if selection.fit.members else 0):
        search = null_model.search
        moved = setup_as_read(_linearise_setup(setup, search, selection.fit) if setup.free else setup, selection.fit)
        if moved is not setup:
            setup, fit = reread_by_instrument(moved, Space(null_model.noises, moved.prior), selection.fit)
            effects = dictionary(setup.library, setup.columns, spread_of(null_model.noises), setup.residual)
            selection = replace(selection, fit=fit)
        noises = noise_of(setup, contributions(setup, selection.fit))
        forms = null_model.forms, null_model.generic.outputs
        null_model = build_null_model(setup, noises, effects, *forms, search.thresholds)
        previous_names, kept_fit = selection.fit.names, null_model.search.fitter.refined(selection.fit.members)
        selection = select(null_model.search)
        if kept_fit.score < selection.fit.score - BETTER:  # another path from the null fit
            end = Trial("keep", ", ".join(kept_fit.names), EARLIER, kept_fit, null_model.search.tested(kept_fit))
            selection = replace(selection, fit=kept_fit, steps=(*selection.steps, end), identified=kept_fit.names)
        if selection.fit.names == previous_names:
            break
    return (_analyse_batch if setup.data.target.population else _settle_rows)(selection, null_model)


def _within_floor(null_model: NullModel) -> bool:
    """Whether the model as recalibrated predicts held-out rows within a noise floor that is known: as
    stated, or from repeats. What structure there may be is then no gap.
    """
    search, data = null_model.search, null_model.setup.data
    off = np.split(null_model.setup.residual - search.tested(null_model.null_fit).fitted, len(data.outputs))
    pairs = zip(off, null_model.noises, strict=True)
    known = (noise.source != "estimated" and rms(part[noise.counted]) <= noise.level for part, noise in pairs)
    return not data.target.population and all(known)


def _nothing(null_model: NullModel) -> Analysis:
    """The analysis that ends without a gap."""
    search = null_model.search
    selection = select(replace(search, settings=replace(search.settings, effects_at_most=0)))
    identified = Identified((), (), null_model.residual_forms, ())
    return Analysis(null_model, null_model, selection, identified, (), False)


def _analyse_batch(selection: Selection, null_model: NullModel) -> Analysis:
    """The final result of a batch. Outliers do not count, unless an effect on the scatter explains
    them and all units are then likelier than the others are without it.
    """
    without_outliers = conclude_analysis(null_model, selection)
    outlier_count = null_model.noises[0].outliers
    if not outlier_count or not null_model.setup.on_scatter:
        return without_outliers
    all_units = change_noise(null_model, tuple(replace(noise, good=None) for noise in null_model.noises))
    with_outliers = conclude_analysis(all_units, select(all_units.search))
    penalty_per_unit = 2.0 * np.log(OUTLIER_SPREAD * null_model.batch.law.std)
    better = without_outliers.score + penalty_per_unit * outlier_count - with_outliers.score
    return with_outliers if with_outliers.scatter and better > 0.0 else without_outliers


def _settle_rows(selection: Selection, null_model: NullModel) -> Analysis:
    """The final result of rows, in the noise that is estimated given its whole fit."""
    setup, settling = null_model.setup, _initial_settling(null_model, selection)
    fit = settling.settled(selection.fit)
    for _ in range(SETTLED - 1):
        if not fit.members:  # the noise of the null fit is known
            break
        noises = noise_of(setup, contributions(setup, fit))
        if alike(null_model.noises, noises):
            break
        null_model = change_noise(null_model, noises)
        search = null_model.search
        selection = replace(selection, steps=tuple(step.refitted(search) for step in selection.steps))
        settling = _initial_settling(null_model, selection)
        fit = settling.settled(search.fitter.refined(fit.members))
    return _answer(null_model, settling, selection, fit)


def _initial_settling(null_model: NullModel, selection: Selection, trusted: frozenset[str] = frozenset()) -> Settling:
    return Settling(null_model.search, null_model.generic, null_model.setup.data, selection.accepted, trusted)


def analysis_without_effect(analysis: Analysis, name: str, trusted: str = "", kept: bool = False) -> Analysis:
    """The analysis of rows without the effect `name` and those with the same columns, the remaining
    ones fitted and tested again. What is excluded stays excluded. The contribution of `name` may
    belong to the form of the effect `trusted`, or is to be `kept`; it stays as a generic curve.
    """
    fit, excluded = analysis.fit, analysis.excluded | {name, *same_columns(name, analysis.rivals)}
    analysis = replace(analysis, trusted=analysis.trusted | {trusted} if trusted else analysis.trusted)
    large, curve = [fit.names.index(trusted)] if trusted else [], None
    if trusted or kept:
        curve = as_curve(analysis.search.fitter, fit, [fit.names.index(name)], large, analysis.setup.data)
    if kept and curve is not None:  # effects over its variables would only divide it anew
        over = variables_of(curve, analysis.setup.data)
        alike = {m.name for m in analysis.search.dictionary.members if variables_of(m, analysis.setup.data) == over}
        excluded |= alike - {*fit.names}
    settling = _initial_settling(analysis.null_model, analysis.selection, analysis.trusted)
    return analysis_of_fit(analysis, settling.again(fit, excluded, () if curve is None else (curve,)), excluded)


def settled_again(analysis: Analysis, fit: Fit) -> Fit:
    """The answer with the effects of a fit and with its terms, and what is significant in addition."""
    settling = _initial_settling(analysis.null_model, analysis.selection, analysis.trusted)
    return settling.again(fit, analysis.excluded, fit.terms)


def analysis_of_fit(analysis: Analysis, fit: Fit, excluded: frozenset[str]) -> Analysis:
    """The analysis of rows that ends with another fit, its rivals and remainder those of this one."""
    settling = _initial_settling(analysis.null_model, analysis.selection, analysis.trusted)
    answer = _answer(analysis.null_model, settling, analysis.selection, fit, excluded)
    return replace(answer, excluded=excluded, trusted=analysis.trusted)


def _answer(
    null_model: NullModel, settling: Settling, selection: Selection, fit: Fit, excluded: frozenset[str] = frozenset()
) -> Analysis:
    """The analysis that ends with a settled fit; the instrument is preferred at equal columns, but
    no effect that is excluded.
    """
    search, removed = null_model.search, tuple(name for name in selection.identified if name not in fit.names)
    others = rivals(search, fit, fit.identified)
    if others and others[0].distance < -BETTER and not excluded & {*others[0].names}:
        rival_fit = search.fitter.refined(sorted(others[0].fit.members, key=is_term))
        if settling.holds(rival_fit):
            fit, others = rival_fit, rivals(search, rival_fit, rival_fit.identified)
    named = fit.identified
    allowed = [other for other in others if not excluded & {*other.names}]
    if (preferred := first_of_confounded(fit, allowed, False)) is not None:
        fit = search.fitter.fit(sorted(preferred.members, key=is_term))
        others = rivals(search, fit, named)
    remaining = generic_residual(fit, search.fitter, null_model.generic)
    identified = Identified(named, (), remaining, significant_forms(search, remaining))
    detected = bool(fit.members or selection.identified) or null_model.detected
    selection = replace(selection, fit=fit)
    return Analysis(null_model, null_model, selection, identified, tuple(others), detected, removed=removed)


def _linearise_setup(setup: Setup, search: Search, fit: Fit) -> Setup:
    """The setup linearised about the joint fit in the full model: the columns depend on it."""
    model = corrected(setup, search.fitter.space, fit)
    changes = changes_of(effect_actions(model.active, setup.data.measurements, setup.data.target))
    return move_setup(setup, {**setup.at, **model.free()}, changes)


def _select_without_autocorrelation(selection: Selection, null_model: NullModel) -> tuple[Selection, NullModel]:
    """The state with effects selected as if the noise were white, where that is much likelier.

    A strong effect along the path of the measurement looks like autocorrelated noise.
    """
    white = change_noise(null_model, tuple(replace(noise, rho=0.0) for noise in null_model.noises))
    white_fit = select(white.search, quick=True).fit
    if not white_fit.members:
        return selection, null_model
    setup = null_model.setup
    new = change_noise(null_model, noise_of(setup, contributions(setup, white_fit)))
    fit = new.search.fitter.refined(white_fit.members)
    gain = _minus_log(selection.fit, null_model.search) - _minus_log(fit, new.search)
    if gain < new.search.thresholds.library:
        return selection, null_model
    return select(new.search), new


def _minus_log(fit: Fit, search: Search) -> float:
    """Minus twice the log likelihood, plus the price of the effects."""
    total = fit.score - fit.rss
    n = search.fitter.space.rows_per_output
    for at, noise in enumerate(search.fitter.space.noises):
        r = fit.residual[at * n : (at + 1) * n]
        total += n * np.log(float(r @ r) / n) + 2.0 * float(np.sum(np.log(noise.sigma)))
        total += (n - 1) * np.log(1.0 - noise.rho**2)
    return total


def conclude_analysis(initial: NullModel, selection: Selection) -> Analysis:
    """The analysis that ends with a selection: effects on the scatter, rivals, generic forms that
    displace effects, and the forms that remain.
    """
    null_model, selection, scatter_effects = _select_given_scatter(initial, selection)
    verdict, others = _test_fit(null_model, selection.fit)
    preferred = first_of_confounded(selection.fit, others, initial.setup.data.target.population)
    if preferred is not None:
        selection = replace(selection, fit=preferred)
        verdict, others = _test_fit(null_model, preferred)
    batch_misfit = misfit(initial.batch, selection.fit, next(iter(scatter_effects), None))
    if batch_misfit is not None and batch_misfit.bent:
        null_model, scatter_effects = initial, ()
        selection = replace(selection, fit=initial.batch.unmoved(selection.fit))
        verdict, others = _test_fit(initial, selection.fit)
    return Analysis(
        initial,
        null_model,
        selection,
        verdict,
        tuple(others),
        bool(selection.fit.members or scatter_effects or batch_misfit) or initial.detected,
        scatter_effects,
        batch_misfit,
    )


def _test_fit(null_model: NullModel, fit: Fit) -> tuple[Identified, list[Other]]:
    verdict = withdraw_members(null_model, fit)
    return verdict, rivals(null_model.search, fit, verdict.confirmed)


def _select_given_scatter(initial: NullModel, selection: Selection) -> tuple[NullModel, Selection, tuple[Scatter, ...]]:
    """Select again given the effects on the scatter: a mixture moves the mean itself."""
    null_model, original = initial, selection
    if not initial.setup.laws or has_structured_residuals(initial, selection.fit):
        return initial, selection, ()  # units with a structure do not scatter
    fit, scatter_effects = _likeliest_scatter(initial, initial, selection.fit)
    for _ in range(ROUNDS if scatter_effects else 0):
        null_model = initial.with_scatter(scatter_effects[0])
        names, selection = selection.fit.names, select(null_model.search)
        fit, scatter_effects = _likeliest_scatter(initial, null_model, selection.fit)
        selection = replace(selection, fit=fit)
        if not scatter_effects:  # an effect that is no longer selected had widened them
            return initial, original, ()
        if fit.names == names:
            break
    if scatter_effects:
        null_model, best = initial.with_scatter(scatter_effects[0]), scatter_effects[0]
        selection = replace(selection, fit=null_model.search.fitter.refined(selection.fit.members))
        selection = with_identified_by_likelihood(
            null_model.search, original, selection, best.candidate.name, best.gain, best.threshold, best.held_out
        )
    return null_model, selection, scatter_effects


def _likeliest_scatter(initial: NullModel, null_model: NullModel, fit: Fit) -> tuple[Fit, tuple[Scatter, ...]]:
    """The likeliest effects on the scatter given all selected effects, all but one, or none.

    An effect that has absorbed the mean of a mixture hides the mixture.
    """
    reduced_sets = [fit.without(at) for at in range(len(fit.members))]
    candidate_fits = [fit, *(null_model.search.fitter.fit(reduced) for reduced in reduced_sets)]
    candidate_fits += [null_model.null_fit] if len(reduced_sets) > 1 else []
    score = initial.batch.score_without_effect(fit)
    best: tuple[float, Fit, tuple[Scatter, ...]] = (score, fit, ())
    for candidate_fit in candidate_fits:
        effects = scatter(initial.batch, candidate_fit)
        score = effects[0].score + initial.batch.price(candidate_fit) if effects else np.inf
        if score < best[0]:
            best = (score, candidate_fit, effects)
    _, fit, effects = best
    if effects and (members := initial.batch.with_level(fit, effects[0])) != fit.members:
        fit = null_model.search.fitter.fit(members)
    return fit, effects
