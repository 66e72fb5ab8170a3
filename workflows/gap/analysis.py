"""The whole loop on one record: noise, thresholds, selected effects, rivals and the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects.compose import Active, acting, changes_of
from .abstain import Identified, identified, structured
from .ambiguity import Other, first_of_confounded, rivals
from .close import corrected
from .curves import as_curve
from .fit import Fit
from .generic import stacked
from .linear import Groups
from .noise import Noise
from .null_model import NullModel
from .population import Misfit, Scatter, misfit, scatter
from .reading import as_read, read_again
from .scan import Dictionary, Remaining, dictionary
from .searching import alike, contributions, noise_of, searching, spread_of
from .select import Search, Selection, concluding, select, with_identified_by_likelihood
from .settle import Settled, Settling, names_of
from .setup import Setup, moved_to
from .space import Space
from .unresolved import is_term, label

WANDERING = 0.4
"""Autocorrelation from which it is tested whether the noise is a missing effect."""
SETTLED = 3
"""How often the final set is searched, the noise estimated again given the set."""
ROUNDS = 2
"""How often the noise is estimated again given the selected effects."""
BETTER = 1.0
"""By how much a rival must fit better than the selected set to replace it."""
FAR_OUT = 4000.0
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
    struck: tuple[str, ...] = ()
    barred: frozenset[str] = frozenset()
    believed: frozenset[str] = frozenset()

    @property
    def fit(self) -> Fit:
        """The fit with every effect that was accepted; in a batch those that were lost included."""
        return self.selection.fit

    @property
    def setup(self) -> Setup:
        """The setup of the final null model."""
        return self.null_model.setup

    @property
    def search(self) -> Search:
        """The search given the final null model."""
        return self.null_model.search

    def nameless(self) -> Analysis:
        """The analysis of a batch without any identified effect."""
        null = self.initial_null_model
        verdict = identified(null.search, null.empty, null.generic, null.empty)
        odd = misfit(null.batch, null.empty, None)
        selection = replace(self.selection, fit=null.empty)
        return Analysis(null, null, selection, verdict, (), self.significant, (), odd)

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
    forms, outputs = stacked(setup.generic, len(setup.data.outputs))
    search, generic = searching(setup, noises, effects, forms, outputs, None)
    selection = select(search)
    if max(noise.rho for noise in noises) > WANDERING:
        selection, noises, search, generic = _not_noise(
            setup, (selection, noises, search, generic), (effects, forms, outputs)
        )
    for _ in range(ROUNDS if selection.fit.members else 0):
        moved = _about(setup, search, selection.fit) if setup.free else setup
        moved = as_read(moved, selection.fit)
        if moved is not setup:
            setup, fit = read_again(moved, Space(tuple(noises), moved.prior), selection.fit)
            effects = dictionary(setup.library, setup.columns, spread_of(noises))
            selection = replace(selection, fit=fit)
        noises = noise_of(setup, contributions(setup, selection.fit))
        search, generic = searching(setup, noises, effects, forms, outputs, search.thresholds)
        previous_names, kept_fit = selection.fit.names, search.fitter.refined(selection.fit.members)
        selection = select(search)
        if kept_fit.score < selection.fit.score - BETTER:  # another path from the null fit
            selection = selection.ending_with(kept_fit, search.tested(kept_fit))
        if selection.fit.names == previous_names:
            break
    if not setup.data.target.population:
        return _settled(setup, (selection, noises, search, generic), (effects, forms, outputs))
    return _of_batch(setup, (selection, noises, search, generic), (effects, forms, outputs))


def _of_batch(setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]) -> Analysis:
    """The final result of a batch. Outliers do not count, unless an effect on the scatter explains
    them and all units are then likelier than the others are without it.
    """
    selection, noises, search, generic = state
    without_outliers = concluded(setup, noises, search, generic, selection)
    outlier_count = noises[0].outliers
    if not outlier_count or not setup.on_scatter:
        return without_outliers
    all_noises = tuple(replace(noise, good=None) for noise in noises)
    search, generic = searching(setup, all_noises, *columns, search.thresholds)
    with_outliers = concluded(setup, all_noises, search, generic, select(search))
    penalty_per_unit = 2.0 * np.log(FAR_OUT * without_outliers.initial_null_model.batch.law.std)
    better = without_outliers.score + penalty_per_unit * outlier_count - with_outliers.score
    return with_outliers if with_outliers.scatter and better > 0.0 else without_outliers


def _settled(setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]) -> Analysis:
    """The final result of rows, in the noise that is estimated given its whole fit."""
    selection, noises, search, generic = state
    start = selection.fit
    turn = 0
    while True:
        turn += 1
        null_fit = search.fitter.fit(())
        settling = Settling(search, generic, setup.data, null_fit, selection.accepted)
        settled = settling.settled(start)
        if turn == SETTLED or not settled.fit.members:  # the noise of the null fit is known
            break
        new_noises = noise_of(setup, contributions(setup, settled.fit))
        if alike(noises, new_noises):
            break
        noises = new_noises
        search, generic = searching(setup, noises, *columns, search.thresholds)
        accepted = [search.fitter.fit(fit.members) for fit, _ in selection.accepted]
        selection = replace(selection, accepted=tuple((fit, search.tested(fit)) for fit in accepted))
        start = search.fitter.refined(settled.fit.members)
    return _answer(NullModel(setup, tuple(noises), search, generic), settling, selection, settled)


def without(analysis: Analysis, name: str, believed: str = "") -> Analysis:
    """The analysis of rows without the effect `name`, the remaining ones fitted and tested again.
    Its contribution may belong to the form of the effect `believed`; it stays as a generic curve.
    """
    null_model, selection = analysis.null_model, analysis.selection
    sure = analysis.believed | ({believed} if believed else set())
    fit, names = analysis.fit, analysis.fit.names
    curve = (
        as_curve(null_model.search.fitter, fit, names.index(name), names.index(believed), analysis.setup.data)
        if believed
        else None
    )
    settling = Settling(
        null_model.search, null_model.generic, analysis.setup.data, null_model.empty, selection.accepted, sure
    )
    barred = frozenset({name, *analysis.barred})
    settled = settling.again(fit, barred, () if curve is None else (curve,))
    settled = replace(settled, struck=(*analysis.struck, *({name} & {*selection.identified})))
    answer = _answer(null_model, settling, selection, settled, barred)
    return replace(answer, barred=barred, believed=sure)


def _answer(
    null_model: NullModel,
    settling: Settling,
    selection: Selection,
    settled: Settled,
    barred: frozenset[str] = frozenset(),
) -> Analysis:
    """The analysis that ends with a settled fit; the instrument is preferred at equal columns."""
    search, fit = null_model.search, settled.fit
    named = names_of(fit.members)
    others = rivals(search, fit, named)
    if others and others[0].distance < -BETTER and not barred & {*others[0].names}:
        rival_fit = search.fitter.refined(sorted(others[0].fit.members, key=is_term))
        if settling.holds(rival_fit):
            fit, named = rival_fit, names_of(rival_fit.members)
            others = rivals(search, fit, named)
    if (preferred := first_of_confounded(fit, others, False)) is not None:
        fit = search.fitter.fit(sorted(preferred.members, key=is_term))
        others = rivals(search, fit, named)
    labels = {member.name: label(member) for member in fit.members if is_term(member)}
    steps = concluding(search, selection, fit, labels)
    struck = tuple(name for name in selection.identified if name in settled.struck)
    verdict = Identified(named, (), settled.residual_forms, settled.significant)
    detected = bool(null_model.residual_forms.evidence.max(initial=0.0) > search.thresholds.generic)
    return Analysis(
        null_model,
        null_model,
        replace(selection, fit=fit, steps=steps),
        verdict,
        tuple(others),
        bool(fit.members or selection.identified) or detected,
        struck=struck,
    )


def _about(setup: Setup, search: Search, fit: Fit) -> Setup:
    """The setup linearised about the joint fit in the full model: the columns depend on it."""
    model = corrected(setup, search.fitter.space, fit)
    active = [Active(m.candidate.effect, model.effect(m.name)) for m in model.members]
    changes = changes_of(acting(active, setup.data.readings, setup.data.target))
    return moved_to(setup, {**setup.at, **model.free()}, changes)


State = tuple[Selection, tuple[Noise, ...], Search, Remaining]


def _not_noise(setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]) -> State:
    """The state with effects selected as if the noise were white, where that is much likelier.

    A strong effect along the path of the measurement looks like autocorrelated noise.
    """
    selection, noises, search, _ = state
    white = tuple(replace(noise, rho=0.0) for noise in noises)
    white_search, _ = searching(setup, white, *columns, search.thresholds)
    white_selection = select(white_search, quick=True)
    if not white_selection.fit.members:
        return state
    new_noises = noise_of(setup, contributions(setup, white_selection.fit))
    new_search, generic = searching(setup, new_noises, *columns, search.thresholds)
    fit = new_search.fitter.refined(white_selection.fit.members)
    gain = _minus_log(selection.fit, search) - _minus_log(fit, new_search)
    if gain < search.thresholds.library:
        return state
    return select(new_search), new_noises, new_search, generic


def _minus_log(fit: Fit, search: Search) -> float:
    """Minus twice the log likelihood, plus the price of the effects."""
    total = fit.score - fit.rss
    n = search.fitter.space.rows_per_output
    for at, noise in enumerate(search.fitter.space.noises):
        r = fit.residual[at * n : (at + 1) * n]
        total += n * np.log(float(r @ r) / n) + 2.0 * float(np.sum(np.log(noise.sigma)))
        total += (n - 1) * np.log(1.0 - noise.rho**2)
    return total


def concluded(
    setup: Setup, noises: Sequence[Noise], search: Search, generic: Remaining, selection: Selection
) -> Analysis:
    """The analysis that ends with a selection: effects on the scatter, rivals, generic forms that
    displace effects, and the forms that remain.
    """
    initial = NullModel(setup, tuple(noises), search, generic)
    null_model, selection, scatter_effects = _given_scatter(initial, selection)
    search = null_model.search
    verdict = identified(search, selection.fit, generic, null_model.empty)
    others = rivals(search, selection.fit, verdict.confirmed)
    preferred = first_of_confounded(selection.fit, others, setup.data.target.population)
    if preferred is not None:
        selection = replace(selection, fit=preferred)
        verdict = identified(search, preferred, generic, null_model.empty)
        others = rivals(search, preferred, verdict.confirmed)
    detected = bool(initial.residual_forms.evidence.max(initial=0.0) > search.thresholds.generic)
    batch_misfit = misfit(initial.batch, selection.fit, next(iter(scatter_effects), None))
    if batch_misfit is not None and batch_misfit.bent:
        null_model, scatter_effects = initial, ()
        selection = replace(selection, fit=initial.batch.unmoved(selection.fit))
        search = initial.search
        verdict = identified(search, selection.fit, generic, initial.empty)
        others = rivals(search, selection.fit, verdict.confirmed)
    return Analysis(
        initial,
        null_model,
        selection,
        verdict,
        tuple(others),
        bool(selection.fit.members or scatter_effects or batch_misfit) or detected,
        scatter_effects,
        batch_misfit,
    )


def _given_scatter(initial: NullModel, selection: Selection) -> tuple[NullModel, Selection, tuple[Scatter, ...]]:
    """Select again given the effects on the scatter: a mixture moves the mean itself."""
    null_model, original = initial, selection
    if not initial.setup.laws or structured(initial.search, selection.fit, initial.generic, initial.empty):
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
    candidate_fits += [null_model.empty] if len(reduced_sets) > 1 else []
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
