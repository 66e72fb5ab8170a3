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

    def with_scatter(self, one: Scatter) -> Ground:
        """The same about a model with an effect on the scatter in it."""
        setup, fitter = carrying(self.setup, one), self.search.fitter
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
    book = dictionary(setup.library, setup.columns, spread_of(noises))
    raw, which = stacked(setup.generic, len(setup.data.outputs))
    search, generic = searching(setup, noises, book, raw, which, None)
    found = select(search)
    if max(one.rho for one in noises) > WANDERING:
        found, noises, search, generic = _not_noise(
            setup, (found, noises, search, generic), (book, raw, which)
        )
    for _ in range(ROUNDS if found.fit.members else 0):
        moved = _about(setup, search, found.fit) if setup.free else setup
        moved = as_read(moved, found.fit)
        if moved is not setup:
            setup, fit = read_again(moved, Space(tuple(noises), moved.prior), found.fit)
            book = dictionary(setup.library, setup.columns, spread_of(noises))
            found = replace(found, fit=fit)
        noises = noise_of(setup, contributions(setup, found.fit))
        search, generic = searching(setup, noises, book, raw, which, search.thresholds)
        before, kept = found.fit.names, search.fitter.refined(found.fit.members)
        found = select(search)
        if kept.score < found.fit.score - BETTER:  # from nothing it went another way
            found = found.ending_with(kept, search.tested(kept))
        if found.fit.names == before:
            break
    if not setup.data.target.population:
        return _settled(setup, (found, noises, search, generic), (book, raw, which))
    return _of_batch(setup, (found, noises, search, generic), (book, raw, which))


def _of_batch(
    setup: Setup, now: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> Analysis:
    """The final answer of a batch: units far out do not count, unless an effect on the scatter has
    them, and the batch is likelier with all of them so than without them as it is.
    """
    found, noises, search, generic = now
    first = concluded(setup, noises, search, generic, found)
    out = noises[0].outliers
    if not out or not setup.on_scatter:
        return first
    every = tuple(replace(one, good=None) for one in noises)
    search, generic = searching(setup, every, *columns, search.thresholds)
    again = concluded(setup, every, search, generic, select(search))
    alone = 2.0 * np.log(FAR_OUT * first.bare.batch.law.std)
    better = first.score + alone * out - again.score
    return again if again.scatter and better > 0.0 else first


def _settled(
    setup: Setup, now: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> Analysis:
    """The final answer of rows, in the noise beside all that is in it."""
    found, noises, search, generic = now
    start = found.fit
    turn = 0
    while True:
        turn += 1
        empty = search.fitter.fit(())
        settling = Settling(search, generic, setup.data, empty, found.accepted)
        done = settling.settled(start)
        if turn == SETTLED or not done.fit.members:  # beside nothing the noise is known
            break
        anew = noise_of(setup, contributions(setup, done.fit))
        if alike(noises, anew):
            break
        noises = anew
        search, generic = searching(setup, noises, *columns, search.thresholds)
        accepted = [search.fitter.fit(one.members) for one, _ in found.accepted]
        found = replace(found, accepted=tuple((one, search.tested(one)) for one in accepted))
        start = search.fitter.refined(done.fit.members)
    return _answer(Ground(setup, tuple(noises), search, generic), settling, found, done)


def without(analysis: Analysis, name: str, believed: str = "") -> Analysis:
    """The analysis of rows without a name, all that is left fitted and tested again; what the name
    did may be the form of another one, which is `believed`: it stays as a curve without a name.
    """
    ground, found = analysis.ground, analysis.selection
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
        ground.search, ground.generic, analysis.setup.data, ground.empty, found.accepted, sure
    )
    barred = frozenset({name, *analysis.barred})
    done = settling.again(fit, barred, () if curve is None else (curve,))
    done = replace(done, struck=(*analysis.struck, *({name} & {*found.named})))
    answer = _answer(ground, settling, found, done, barred)
    return replace(answer, barred=barred, believed=sure)


def _answer(
    ground: Ground,
    settling: Settling,
    found: Selection,
    done: Settled,
    barred: frozenset[str] = frozenset(),
) -> Analysis:
    """The analysis that ends with a settled fit; the instrument first among twins."""
    search, fit = ground.search, done.fit
    named = names_of(fit.members)
    others = rivals(search, fit, named)
    if others and others[0].distance < -BETTER and not barred & {*others[0].names}:
        other = search.fitter.refined(sorted(others[0].fit.members, key=is_term))
        if settling.holds(other):
            fit, named = other, names_of(other.members)
            others = rivals(search, fit, named)
    if (first := first_of_twins(fit, others, False)) is not None:
        fit = search.fitter.fit(sorted(first.members, key=is_term))
        others = rivals(search, fit, named)
    labels = {one.name: label(one) for one in fit.members if is_term(one)}
    steps = concluding(search, found, fit, labels)
    struck = tuple(one for one in found.named if one in done.struck)
    verdict = Judged(named, (), done.left, done.significant)
    seen = bool(ground.left.evidence.max(initial=0.0) > search.thresholds.generic)
    return Analysis(
        ground,
        ground,
        replace(found, fit=fit, steps=steps),
        verdict,
        tuple(others),
        bool(fit.members or found.named) or seen,
        struck=struck,
    )


def _about(setup: Setup, search: Search, fit: Fit) -> Setup:
    """The setup about the joint fit, found in the full model: where columns are taken matters."""
    model = corrected(setup, search.fitter.space, fit)
    active = [Active(one.candidate.effect, model.effect(one.name)) for one in model.members]
    changes = changes_of(acting(active, setup.data.readings, setup.data.target))
    return moved_to(setup, {**setup.at, **model.free()}, changes)


State = tuple[Selection, tuple[Noise, ...], Search, Remaining]


def _not_noise(
    setup: Setup, now: State, columns: tuple[Dictionary, Groups, NDArray[np.int64]]
) -> State:
    """The state with names found as if the noise were white, where that is likelier by far.

    A strong effect along the path of the measurement looks like noise that wanders.
    """
    found, noises, search, _ = now
    white = tuple(replace(one, rho=0.0) for one in noises)
    other, _ = searching(setup, white, *columns, search.thresholds)
    tried = select(other, quick=True)
    if not tried.fit.members:
        return now
    anew = noise_of(setup, contributions(setup, tried.fit))
    again, generic = searching(setup, anew, *columns, search.thresholds)
    fit = again.fitter.refined(tried.fit.members)
    better = _minus_log(found.fit, search) - _minus_log(fit, again)
    if better < search.thresholds.library:
        return now
    return select(again), anew, again, generic


def _minus_log(fit: Fit, search: Search) -> float:
    """Minus twice the log likelihood, and the price of the names."""
    total = fit.score - fit.rss
    n = search.fitter.space.readings
    for at, noise in enumerate(search.fitter.space.noises):
        left = fit.residual[at * n : (at + 1) * n]
        total += n * np.log(float(left @ left) / n) + 2.0 * float(np.sum(np.log(noise.sigma)))
        total += (n - 1) * np.log(1.0 - noise.rho**2)
    return total


def concluded(
    setup: Setup, noises: Sequence[Noise], search: Search, generic: Remaining, found: Selection
) -> Analysis:
    """What changes the scatter, rivals, forms that displace names, and what is left."""
    bare = Ground(setup, tuple(noises), search, generic)
    ground, found, wider = _beside_scatter(bare, found)
    search = ground.search
    verdict = judged(search, found.fit, generic, ground.empty)
    others = rivals(search, found.fit, verdict.kept)
    first = first_of_twins(found.fit, others, setup.data.target.population)
    if first is not None:
        found = replace(found, fit=first)
        verdict = judged(search, first, generic, ground.empty)
        others = rivals(search, first, verdict.kept)
    seen = bool(bare.left.evidence.max(initial=0.0) > search.thresholds.generic)
    odd = misfit(bare.batch, found.fit, next(iter(wider), None))
    if odd is not None and odd.bent:
        ground, wider = bare, ()
        found = replace(found, fit=bare.batch.unmoved(found.fit))
        search = bare.search
        verdict = judged(search, found.fit, generic, bare.empty)
        others = rivals(search, found.fit, verdict.kept)
    return Analysis(
        bare,
        ground,
        found,
        verdict,
        tuple(others),
        bool(found.fit.members or wider or odd) or seen,
        wider,
        odd,
    )


def _beside_scatter(
    bare: Ground, found: Selection
) -> tuple[Ground, Selection, tuple[Scatter, ...]]:
    """The names once more beside what changes the scatter: a mixture moves the mean itself."""
    ground, before = bare, found
    if not bare.setup.laws or structured(bare.search, found.fit, bare.generic, bare.empty):
        return bare, found, ()  # units that follow something do not scatter
    fit, wider = _beside_any(bare, bare, found.fit)
    for _ in range(ROUNDS if wider else 0):
        ground = bare.with_scatter(wider[0])
        names, found = found.fit.names, select(ground.search)
        fit, wider = _beside_any(bare, ground, found.fit)
        found = replace(found, fit=fit)
        if not wider:  # what widened the units was a name that is no longer there
            return bare, before, ()
        if fit.names == names:
            break
    if wider:
        ground, best = bare.with_scatter(wider[0]), wider[0]
        found = replace(found, fit=ground.search.fitter.refined(found.fit.members))
        found = beside(
            ground.search,
            before,
            found,
            best.candidate.name,
            best.gain,
            best.threshold,
            best.held_out,
        )
    return ground, found, wider


def _beside_any(bare: Ground, ground: Ground, fit: Fit) -> tuple[Fit, tuple[Scatter, ...]]:
    """What changes the scatter beside all names, all but one, or none: where that is likeliest.

    A name that took the mean of a mixture for its own hides the mixture.
    """
    fewer = [fit.without(at) for at in range(len(fit.members))]
    tried = [fit, *(ground.search.fitter.fit(one) for one in fewer)]
    tried += [ground.empty] if len(fewer) > 1 else []
    best: tuple[float, Fit, tuple[Scatter, ...]] = (bare.batch.plain(fit), fit, ())
    for one in tried:
        found = scatter(bare.batch, one)
        score = found[0].score + bare.batch.price(one) if found else np.inf
        if score < best[0]:
            best = (score, one, found)
    _, fit, found = best
    if found and (members := bare.batch.with_level(fit, found[0])) != fit.members:
        fit = ground.search.fitter.fit(members)
    return fit, found
