"""The whole loop on one record: noise, thresholds, selected effects, rivals and the residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...models.effects.compose import acting, changes_of
from .abstain import Identified, identified, structured
from .ambiguity import Other, first_of_confounded, rivals, same_columns
from .close import corrected
from .curves import as_curve
from .fit import Fit, is_term
from .generic import stacked
from .null_model import NullModel
from .population import Misfit, Scatter, misfit, scatter
from .reading import as_read, read_again
from .scan import dictionary
from .searching import alike, contributions, in_noise, noise_of, searching, spread_of
from .select import Search, Selection, concluding, select, with_identified_by_likelihood
from .settle import Settled, Settling
from .setup import Setup, moved_to
from .space import Space
from .unresolved import label

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

    def without_effects(self) -> Analysis:
        """The analysis of a batch without any identified effect."""
        null = self.initial_null_model
        selection = replace(self.selection, fit=null.null_fit)
        odd = misfit(null.batch, null.null_fit, None)
        return Analysis(null, null, selection, identified(null, null.null_fit), (), self.significant, (), odd)

    @property
    def score(self) -> float:
        """Of a batch: minus twice the log likelihood of its units, plus the effects' price."""
        batch = self.initial_null_model.batch
        if not self.scatter:
            return batch.score_without_effect(self.fit)
        return self.scatter[0].score + batch.price(self.fit)


def analysed(setup: Setup) -> Analysis:
    """Run the loop, the noise estimated again given the selected effects."""
    setup = as_read(setup)
    noises = noise_of(setup, ())
    effects = dictionary(setup.library, setup.columns, spread_of(noises))
    null_model = searching(setup, noises, effects, *stacked(setup.generic, len(setup.data.outputs)), None)
    selection = select(null_model.search)
    if max(noise.rho for noise in noises) > AUTOCORRELATED:
        selection, null_model = _not_noise(selection, null_model)
    for _ in range(ROUNDS if selection.fit.members else 0):
        search = null_model.search
        moved = as_read(_about(setup, search, selection.fit) if setup.free else setup, selection.fit)
        if moved is not setup:
            setup, fit = read_again(moved, Space(null_model.noises, moved.prior), selection.fit)
            effects = dictionary(setup.library, setup.columns, spread_of(null_model.noises))
            selection = replace(selection, fit=fit)
        noises = noise_of(setup, contributions(setup, selection.fit))
        forms = null_model.forms, null_model.generic.outputs
        null_model = searching(setup, noises, effects, *forms, search.thresholds)
        previous_names, kept_fit = selection.fit.names, null_model.search.fitter.refined(selection.fit.members)
        selection = select(null_model.search)
        if kept_fit.score < selection.fit.score - BETTER:  # another path from the null fit
            selection = selection.ending_with(kept_fit, null_model.search.tested(kept_fit))
        if selection.fit.names == previous_names:
            break
    return (_of_batch if setup.data.target.population else _settled)(selection, null_model)


def _of_batch(selection: Selection, null_model: NullModel) -> Analysis:
    """The final result of a batch. Outliers do not count, unless an effect on the scatter explains
    them and all units are then likelier than the others are without it.
    """
    without_outliers = concluded(null_model, selection)
    outlier_count = null_model.noises[0].outliers
    if not outlier_count or not null_model.setup.on_scatter:
        return without_outliers
    all_units = in_noise(null_model, tuple(replace(noise, good=None) for noise in null_model.noises))
    with_outliers = concluded(all_units, select(all_units.search))
    penalty_per_unit = 2.0 * np.log(OUTLIER_SPREAD * null_model.batch.law.std)
    better = without_outliers.score + penalty_per_unit * outlier_count - with_outliers.score
    return with_outliers if with_outliers.scatter and better > 0.0 else without_outliers


def _settled(selection: Selection, null_model: NullModel) -> Analysis:
    """The final result of rows, in the noise that is estimated given its whole fit."""
    setup, settling = null_model.setup, _settling(null_model, selection)
    settled = settling.settled(selection.fit)
    for _ in range(SETTLED - 1):
        if not settled.fit.members:  # the noise of the null fit is known
            break
        noises = noise_of(setup, contributions(setup, settled.fit))
        if alike(null_model.noises, noises):
            break
        null_model = in_noise(null_model, noises)
        search = null_model.search
        accepted = [search.fitter.fit(fit.members) for fit, _ in selection.accepted]
        selection = replace(selection, accepted=tuple((fit, search.tested(fit)) for fit in accepted))
        settling = _settling(null_model, selection)
        settled = settling.settled(search.fitter.refined(settled.fit.members))
    return _answer(null_model, settling, selection, settled)


def _settling(null_model: NullModel, selection: Selection, trusted: frozenset[str] = frozenset()) -> Settling:
    data, null_fit = null_model.setup.data, null_model.null_fit
    return Settling(null_model.search, null_model.generic, data, null_fit, selection.accepted, trusted)


def without(analysis: Analysis, name: str, trusted: str = "") -> Analysis:
    """The analysis of rows without the effect `name` and those with the same columns, the remaining
    ones fitted and tested again. What is excluded stays excluded. The contribution of `name` may
    belong to the form of the effect `trusted`; it stays as a generic curve.
    """
    null_model, selection, fit = analysis.null_model, analysis.selection, analysis.fit
    curve, sure = None, analysis.trusted
    if trusted:
        sure |= {trusted}
        members = fit.names.index(name), fit.names.index(trusted)
        curve = as_curve(null_model.search.fitter, fit, *members, analysis.setup.data)
    settling = _settling(null_model, selection, sure)
    names = {name, *same_columns(name, analysis.rivals)}
    excluded = analysis.excluded | names
    settled = settling.again(fit, excluded, () if curve is None else (curve,))
    settled = replace(settled, removed=(*analysis.removed, *(names & {*selection.identified})))
    answer = _answer(null_model, settling, selection, settled, excluded)
    return replace(answer, excluded=excluded, trusted=sure)


def _answer(
    null_model: NullModel,
    settling: Settling,
    selection: Selection,
    settled: Settled,
    excluded: frozenset[str] = frozenset(),
) -> Analysis:
    """The analysis that ends with a settled fit; the instrument is preferred at equal columns, but
    no effect that is excluded.
    """
    search, fit = null_model.search, settled.fit
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
    steps = concluding(search, selection, fit, {member.name: label(member) for member in fit.terms})
    return Analysis(
        null_model,
        null_model,
        replace(selection, fit=fit, steps=steps),
        Identified(named, (), settled.residual_forms, settled.significant),
        tuple(others),
        bool(fit.members or selection.identified) or null_model.detected,
        removed=tuple(name for name in selection.identified if name in settled.removed),
    )


def _about(setup: Setup, search: Search, fit: Fit) -> Setup:
    """The setup linearised about the joint fit in the full model: the columns depend on it."""
    model = corrected(setup, search.fitter.space, fit)
    changes = changes_of(acting(model.active, setup.data.measurements, setup.data.target))
    return moved_to(setup, {**setup.at, **model.free()}, changes)


def _not_noise(selection: Selection, null_model: NullModel) -> tuple[Selection, NullModel]:
    """The state with effects selected as if the noise were white, where that is much likelier.

    A strong effect along the path of the measurement looks like autocorrelated noise.
    """
    white = in_noise(null_model, tuple(replace(noise, rho=0.0) for noise in null_model.noises))
    white_fit = select(white.search, quick=True).fit
    if not white_fit.members:
        return selection, null_model
    setup = null_model.setup
    new = in_noise(null_model, noise_of(setup, contributions(setup, white_fit)))
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


def concluded(initial: NullModel, selection: Selection) -> Analysis:
    """The analysis that ends with a selection: effects on the scatter, rivals, generic forms that
    displace effects, and the forms that remain.
    """
    null_model, selection, scatter_effects = _given_scatter(initial, selection)
    verdict, others = _tested(null_model, selection.fit)
    preferred = first_of_confounded(selection.fit, others, initial.setup.data.target.population)
    if preferred is not None:
        selection = replace(selection, fit=preferred)
        verdict, others = _tested(null_model, preferred)
    batch_misfit = misfit(initial.batch, selection.fit, next(iter(scatter_effects), None))
    if batch_misfit is not None and batch_misfit.bent:
        null_model, scatter_effects = initial, ()
        selection = replace(selection, fit=initial.batch.unmoved(selection.fit))
        verdict, others = _tested(initial, selection.fit)
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


def _tested(null_model: NullModel, fit: Fit) -> tuple[Identified, list[Other]]:
    verdict = identified(null_model, fit)
    return verdict, rivals(null_model.search, fit, verdict.confirmed)


def _given_scatter(initial: NullModel, selection: Selection) -> tuple[NullModel, Selection, tuple[Scatter, ...]]:
    """Select again given the effects on the scatter: a mixture moves the mean itself."""
    null_model, original = initial, selection
    if not initial.setup.laws or structured(initial, selection.fit):
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
