"""The whole loop on one set of readings: noise, thresholds, names, rivals, what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.effects.compose import Active, acting, changes_of
from .abstain import Judged, judged, structured
from .ambiguity import Other, first_of_twins, rivals
from .close import corrected
from .curves import as_curve
from .fit import Fit
from .generic import stacked
from .linear import Groups
from .noise import Noise
from .population import Batch, Misfit, Scatter, carrying, misfit, scatter
from .reading import as_read, read_again
from .scan import Dictionary, Left, Remaining, dictionary, left_over
from .searching import alike, contributions, noise_of, searching, spread_of
from .select import Search, Selection, beside, concluding, select
from .settle import Settled, Settling, names_of
from .setup import Setup, moved_to
from .space import Space
from .unresolved import is_term, label

WANDERING = 0.4
"""Autocorrelation from which it is asked whether the noise is noise."""
SETTLED = 3
"""How often the final answer is looked for, the noise estimated again beside it."""
ROUNDS = 2
"""How often the noise is estimated again with what was named."""
BETTER = 1.0
"""By how much a rival must fit better than the answer to take its place."""
FAR_OUT = 4000.0
"""Over the density of a unit that is far out, in standard deviations: one in 200, anywhere within
10 of them."""


@dataclass(frozen=True)
class Ground:
    """What is searched, in the space of its noise; `empty` is the fit without a name, `left` what
    generic forms find beside it.
    """

    setup: Setup
    noises: tuple[Noise, ...]
    search: Search
    generic: Remaining

    @cached_property
    def empty(self) -> Fit:
        """The fit of the model alone."""
        return self.search.fitter.fit(())

    @cached_property
    def left(self) -> Left:
        """What generic forms find beside the model alone."""
        return left_over(self.empty, self.search.fitter, self.generic)

    @cached_property
    def batch(self) -> Batch:
        """As a population."""
        return Batch(self.setup, self.search)

    def with_scatter(self, effect: Scatter) -> Ground:
        """The same about a model with an effect on the scatter in it."""
        setup, fitter = carrying(self.setup, effect), self.search.fitter
        moved = fitter.space.whiten(self.setup.residual - setup.residual)
        search = replace(self.search, fitter=fitter.of_record(fitter.y - moved))
        return replace(self, setup=setup, search=search)


@dataclass(frozen=True)
class Analysis:
    """What the loop found, before it is put into records.

    `bare` is the ground that it began on, `ground` the one that it ended on: the same, but for an
    effect on the scatter of a population, which is in the model of the latter.
    """

    bare: Ground
    ground: Ground
    selection: Selection
    judged: Judged
    others: tuple[Other, ...]
    significant: bool
    scatter: tuple[Scatter, ...] = ()
    misfit: Misfit | None = None
    struck: tuple[str, ...] = ()
    barred: frozenset[str] = frozenset()
    believed: frozenset[str] = frozenset()

    @property
    def fit(self) -> Fit:
        """The fit with every name that was accepted; in a batch those that were lost included."""
        return self.selection.fit

    @property
    def setup(self) -> Setup:
        """Of the ground that the loop ended on."""
        return self.ground.setup

    @property
    def search(self) -> Search:
        """Of the ground that the loop ended on."""
        return self.ground.search

    def nameless(self) -> Analysis:
        """The analysis of a batch with nothing named."""
        bare = self.bare
        verdict = judged(bare.search, bare.empty, bare.generic, bare.empty)
        odd = misfit(bare.batch, bare.empty, None)
        selection = replace(self.selection, fit=bare.empty)
        return Analysis(bare, bare, selection, verdict, (), self.significant, (), odd)

    @property
    def score(self) -> float:
        """Of a batch: minus twice the log likelihood of its units, and the price of the names."""
        batch = self.bare.batch
        if not self.scatter:
            return batch.plain(self.fit)
        return self.scatter[0].score + batch.price(self.fit)


def analysed(setup: Setup) -> Analysis:
    """The loop, with the noise estimated again beside what was named."""
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
        if kept_fit.score < selection.fit.score - BETTER:  # from nothing it went another way
            selection = selection.ending_with(kept_fit, search.tested(kept_fit))
        if selection.fit.names == previous_names:
            break
    if not setup.data.target.population:
        return _settled(setup, (selection, noises, search, generic), (effects, forms, outputs))
    return _of_batch(setup, (selection, noises, search, generic), (effects, forms, outputs))


def _of_batch(
    setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> Analysis:
    """The final answer of a batch: units far out do not count, unless an effect on the scatter has
    them, and the batch is likelier with all of them so than without them as it is.
    """
    selection, noises, search, generic = state
    without_outliers = concluded(setup, noises, search, generic, selection)
    outlier_count = noises[0].outliers
    if not outlier_count or not setup.on_scatter:
        return without_outliers
    all_noises = tuple(replace(noise, good=None) for noise in noises)
    search, generic = searching(setup, all_noises, *columns, search.thresholds)
    with_outliers = concluded(setup, all_noises, search, generic, select(search))
    penalty_per_unit = 2.0 * np.log(FAR_OUT * without_outliers.bare.batch.law.std)
    better = without_outliers.score + penalty_per_unit * outlier_count - with_outliers.score
    return with_outliers if with_outliers.scatter and better > 0.0 else without_outliers


def _settled(
    setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> Analysis:
    """The final answer of rows, in the noise beside all that is in it."""
    selection, noises, search, generic = state
    start = selection.fit
    turn = 0
    while True:
        turn += 1
        null_fit = search.fitter.fit(())
        settling = Settling(search, generic, setup.data, null_fit, selection.accepted)
        settled = settling.settled(start)
        if turn == SETTLED or not settled.fit.members:  # beside nothing the noise is known
            break
        new_noises = noise_of(setup, contributions(setup, settled.fit))
        if alike(noises, new_noises):
            break
        noises = new_noises
        search, generic = searching(setup, noises, *columns, search.thresholds)
        accepted = [search.fitter.fit(fit.members) for fit, _ in selection.accepted]
        selection = replace(
            selection, accepted=tuple((fit, search.tested(fit)) for fit in accepted)
        )
        start = search.fitter.refined(settled.fit.members)
    return _answer(Ground(setup, tuple(noises), search, generic), settling, selection, settled)


def without(analysis: Analysis, name: str, believed: str = "") -> Analysis:
    """The analysis of rows without a name, all that is left fitted and tested again; what the name
    did may be the form of another one, which is `believed`: it stays as a curve without a name.
    """
    ground, selection = analysis.ground, analysis.selection
    sure = analysis.believed | ({believed} if believed else set())
    fit, names = analysis.fit, analysis.fit.names
    curve = (
        as_curve(
            ground.search.fitter, fit, names.index(name), names.index(believed), analysis.setup.data
        )
        if believed
        else None
    )
    settling = Settling(
        ground.search, ground.generic, analysis.setup.data, ground.empty, selection.accepted, sure
    )
    barred = frozenset({name, *analysis.barred})
    settled = settling.again(fit, barred, () if curve is None else (curve,))
    settled = replace(settled, struck=(*analysis.struck, *({name} & {*selection.named})))
    answer = _answer(ground, settling, selection, settled, barred)
    return replace(answer, barred=barred, believed=sure)


def _answer(
    ground: Ground,
    settling: Settling,
    selection: Selection,
    settled: Settled,
    barred: frozenset[str] = frozenset(),
) -> Analysis:
    """The analysis that ends with a settled fit; the instrument first among twins."""
    search, fit = ground.search, settled.fit
    named = names_of(fit.members)
    others = rivals(search, fit, named)
    if others and others[0].distance < -BETTER and not barred & {*others[0].names}:
        rival_fit = search.fitter.refined(sorted(others[0].fit.members, key=is_term))
        if settling.holds(rival_fit):
            fit, named = rival_fit, names_of(rival_fit.members)
            others = rivals(search, fit, named)
    if (preferred := first_of_twins(fit, others, False)) is not None:
        fit = search.fitter.fit(sorted(preferred.members, key=is_term))
        others = rivals(search, fit, named)
    labels = {member.name: label(member) for member in fit.members if is_term(member)}
    steps = concluding(search, selection, fit, labels)
    struck = tuple(name for name in selection.named if name in settled.struck)
    verdict = Judged(named, (), settled.left, settled.significant)
    detected = bool(ground.left.evidence.max(initial=0.0) > search.thresholds.generic)
    return Analysis(
        ground,
        ground,
        replace(selection, fit=fit, steps=steps),
        verdict,
        tuple(others),
        bool(fit.members or selection.named) or detected,
        struck=struck,
    )


def _about(setup: Setup, search: Search, fit: Fit) -> Setup:
    """The setup about the joint fit, found in the full model: where columns are taken matters."""
    model = corrected(setup, search.fitter.space, fit)
    active = [Active(m.candidate.effect, model.effect(m.name)) for m in model.members]
    changes = changes_of(acting(active, setup.data.readings, setup.data.target))
    return moved_to(setup, {**setup.at, **model.free()}, changes)


State = tuple[Selection, tuple[Noise, ...], Search, Remaining]


def _not_noise(
    setup: Setup, state: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> State:
    """The state with names found as if the noise were white, where that is likelier by far.

    A strong effect along the path of the measurement looks like noise that wanders.
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
    """Minus twice the log likelihood, and the price of the names."""
    total = fit.score - fit.rss
    n = search.fitter.space.readings
    for at, noise in enumerate(search.fitter.space.noises):
        r = fit.residual[at * n : (at + 1) * n]
        total += n * np.log(float(r @ r) / n) + 2.0 * float(np.sum(np.log(noise.sigma)))
        total += (n - 1) * np.log(1.0 - noise.rho**2)
    return total


def concluded(
    setup: Setup, noises: Sequence[Noise], search: Search, generic: Remaining, selection: Selection
) -> Analysis:
    """What changes the scatter, rivals, forms that displace names, and what is left."""
    bare = Ground(setup, tuple(noises), search, generic)
    ground, selection, scatter_effects = _given_scatter(bare, selection)
    search = ground.search
    verdict = judged(search, selection.fit, generic, ground.empty)
    others = rivals(search, selection.fit, verdict.kept)
    preferred = first_of_twins(selection.fit, others, setup.data.target.population)
    if preferred is not None:
        selection = replace(selection, fit=preferred)
        verdict = judged(search, preferred, generic, ground.empty)
        others = rivals(search, preferred, verdict.kept)
    detected = bool(bare.left.evidence.max(initial=0.0) > search.thresholds.generic)
    batch_misfit = misfit(bare.batch, selection.fit, next(iter(scatter_effects), None))
    if batch_misfit is not None and batch_misfit.bent:
        ground, scatter_effects = bare, ()
        selection = replace(selection, fit=bare.batch.unmoved(selection.fit))
        search = bare.search
        verdict = judged(search, selection.fit, generic, bare.empty)
        others = rivals(search, selection.fit, verdict.kept)
    return Analysis(
        bare,
        ground,
        selection,
        verdict,
        tuple(others),
        bool(selection.fit.members or scatter_effects or batch_misfit) or detected,
        scatter_effects,
        batch_misfit,
    )


def _given_scatter(
    bare: Ground, selection: Selection
) -> tuple[Ground, Selection, tuple[Scatter, ...]]:
    """The names once more beside what changes the scatter: a mixture moves the mean itself."""
    ground, original = bare, selection
    if not bare.setup.laws or structured(bare.search, selection.fit, bare.generic, bare.empty):
        return bare, selection, ()  # units that follow something do not scatter
    fit, scatter_effects = _likeliest_scatter(bare, bare, selection.fit)
    for _ in range(ROUNDS if scatter_effects else 0):
        ground = bare.with_scatter(scatter_effects[0])
        names, selection = selection.fit.names, select(ground.search)
        fit, scatter_effects = _likeliest_scatter(bare, ground, selection.fit)
        selection = replace(selection, fit=fit)
        if not scatter_effects:  # what widened the units was a name that is no longer there
            return bare, original, ()
        if fit.names == names:
            break
    if scatter_effects:
        ground, best = bare.with_scatter(scatter_effects[0]), scatter_effects[0]
        selection = replace(selection, fit=ground.search.fitter.refined(selection.fit.members))
        selection = beside(
            ground.search,
            original,
            selection,
            best.candidate.name,
            best.gain,
            best.threshold,
            best.held_out,
        )
    return ground, selection, scatter_effects


def _likeliest_scatter(bare: Ground, ground: Ground, fit: Fit) -> tuple[Fit, tuple[Scatter, ...]]:
    """What changes the scatter beside all names, all but one, or none: where that is likeliest.

    A name that took the mean of a mixture for its own hides the mixture.
    """
    reduced_sets = [fit.without(at) for at in range(len(fit.members))]
    candidate_fits = [fit, *(ground.search.fitter.fit(reduced) for reduced in reduced_sets)]
    candidate_fits += [ground.empty] if len(reduced_sets) > 1 else []
    best: tuple[float, Fit, tuple[Scatter, ...]] = (bare.batch.plain(fit), fit, ())
    for candidate_fit in candidate_fits:
        effects = scatter(bare.batch, candidate_fit)
        score = effects[0].score + bare.batch.price(candidate_fit) if effects else np.inf
        if score < best[0]:
            best = (score, candidate_fit, effects)
    _, fit, effects = best
    if effects and (members := bare.batch.with_level(fit, effects[0])) != fit.members:
        fit = ground.search.fitter.fit(members)
    return fit, effects
