"""Batches: whether units scatter as the model's population does, or as a wider or a mixed one.

The population itself is the noise. Effects that move single units are selected by their columns,
those that change the scatter are selected here by likelihood. A mixture moves the mean too: the
likelihood of both together decides whether the mean needs another effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ...arrays import Array
from ...models.effects import Target
from ...models.effects.compose import Active
from ...models.effects.population.law import Law
from ...models.effects.population.units import OfUnits
from ...models.measurable import Role
from .ambiguity import INSTRUMENT
from .blocks import Improvement
from .distance import distance, floor, matched
from .fit import Fit, Member
from .law import law_with
from .library import Candidate, carried
from .likelihood import BatchLikelihood, threshold
from .select import Search
from .setup import Setup, residual_of

CERTAIN = 1e-9
"""Probabilities this close to 0 or 1 are clipped."""
LEVEL = 1e-9
"""Relative range of a column below which it is the same for every unit."""


@dataclass(frozen=True)
class Scatter:
    """An effect on the scatter: its parameters, intervals, and twice its log likelihood ratio.

    `distance` is how much worse its score is than the best one. `mean_effect` is the effect that
    the mean of the units needs in addition, empty where it needs none.
    """

    candidate: Candidate
    target: Target
    numbers: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    gain: float
    threshold: float
    held_out: Improvement
    score: float
    distance: float = 0.0
    mean_effect: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The effect, preceded by the one that moves the mean in addition."""
        return (self.mean_effect, self.candidate.name) if self.mean_effect else (self.candidate.name,)

    @property
    def apart_from_inputs(self) -> str:
        """The part of the effect that no input of a unit explains; empty where there is none."""
        effect = self.candidate.effect
        return effect.apart_from_inputs if isinstance(effect, OfUnits) else ""

    @property
    def active(self) -> Active:
        """The effect in a model."""
        return Active(self.candidate.effect, self.numbers)

    @property
    def moves(self) -> float:
        """The shift of the mean of the units."""
        return carried([self.active], self.target)

    def changed(self, law: Law) -> Law:
        """The law with the effect in it."""
        return law_with(law, self.candidate.effect, self.numbers, self.target)

    def likelihood(self, law: Law) -> tuple[BatchLikelihood, Array]:
        """The likelihood that it was fitted by (about the units' mean if another effect moves it),
        and its maximum (k,).
        """
        likelihood = BatchLikelihood(self.candidate, law, self.target, bool(self.mean_effect))
        values = np.array([self.numbers[parameter.name] for parameter in self.candidate.parameters])
        return likelihood, values / likelihood.scale


def exchanged_names(best: Scatter, rival: Scatter) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The effects of a rival that the best one does not need, and those that it needs instead."""
    names, best_names = set(rival.names), set(best.names)
    return tuple(n for n in rival.names if n not in best_names), tuple(n for n in best.names if n not in names)


@dataclass(frozen=True)
class Units:
    """Deviations (n,) of the units given the effects on single units, their blocks, and their law.

    `x` is the deviation from the model's mean; effects on all units alike are not subtracted.
    """

    law: Law
    x: Array
    labels: NDArray[np.int64]

    @property
    def centred(self) -> Array:
        """The deviations (n,) from their own mean."""
        return np.asarray(self.x - self.x.mean())


@dataclass(frozen=True)
class Batch:
    """A batch before any effect is selected: the setup and the search."""

    setup: Setup
    search: Search

    @property
    def law(self) -> Law:
        """The law of the model's units."""
        return self.setup.laws[self.setup.data.outputs[0].name]

    @cached_property
    def limit(self) -> float:
        """The threshold of twice a log likelihood ratio under the null model."""
        setup = self.setup
        return threshold(self.law, setup.on_scatter, setup.data.target, len(setup.data), setup.plan)

    @cached_property
    def levels(self) -> tuple[str, ...]:
        """The effects that move every unit alike, those of the instrument last."""
        dictionary = self.search.dictionary
        effects = [
            member.candidate.effect
            for at, member in enumerate(dictionary.members)
            if not member.candidate.unread and _shifts_all_alike(dictionary.raw.of(at))
        ]
        return tuple(effect.name for effect in sorted(effects, key=lambda e: e.family == INSTRUMENT))

    def moving(self, fit: Fit) -> list[Member]:
        """The members that move each unit by its own amount."""
        return [member for member in fit.members if member.name not in self.levels]

    def price(self, fit: Fit) -> float:
        """The price of the parameters of the effects on single units."""
        return sum(member.candidate.price(self.search.fitter.penalty) for member in self.moving(fit))

    def score_without_effect(self, fit: Fit) -> float:
        """The score of a fit without an effect on the scatter."""
        units = self.units(fit)
        moved = any(name in self.levels for name in fit.names)
        x = units.centred if moved else units.x
        level = float(np.log(len(x))) if moved else 0.0
        return self.price(fit) + level - 2.0 * float(units.law(x).sum())

    def with_level(self, fit: Fit, scatter_effect: Scatter) -> tuple[Member, ...]:
        """The members of a fit, with an effect on all units only if `scatter_effect` needs it."""
        if any(name in self.levels for name in fit.names) == bool(scatter_effect.mean_effect):
            return fit.members
        level = [member for member in self.search.dictionary.members if member.name == scatter_effect.mean_effect]
        return (*self.moving(fit), *level)

    def unmoved(self, fit: Fit) -> Fit:
        """The fit without effects that move all units alike."""
        return self.search.fitter.fit(self.moving(fit))

    def units(self, fit: Fit, but: Sequence[str] = ()) -> Units:
        """The units that count, given the effects on single units except those in `but`."""
        kept = self.search.fitter.space.noises[0].counted
        residual = residual_of(self.setup, fit, (*self.levels, *but))
        return Units(self.law, residual[kept], self.search.labels[kept])


@dataclass(frozen=True)
class Misfit:
    """Units that scatter about their mean unlike the population: their distance from it and the
    limit that chance reaches, the population `stretched` to their width or not. `ratio` is that of
    the standard deviations, measured over simulated.

    `bent` says that no effect that moves or widens all units alike explains them.
    """

    distance: float
    limit: float
    ratio: float
    stretched: bool
    bent: bool


def misfit(batch: Batch, fit: Fit, wider: Scatter | None) -> Misfit | None:
    """The misfit of units that, given `fit`, scatter unlike the model's with `wider`, or None."""
    if not batch.setup.data.target.population:
        return None
    units, plan = batch.units(fit), batch.setup.plan
    law = units.law if wider is None else wider.changed(units.law)

    def compared(scaled: bool) -> tuple[float, float]:
        rng = np.random.default_rng([plan.seed, 9])
        limit = floor(law, len(units.x), rng, 1.0 - 0.5 * plan.settings.false_rate, True, scaled)
        return distance(law, matched(law, units.x, scaled)), limit

    plainly, stretched = compared(scaled=False), compared(scaled=True)
    exceeded = [far > limit for far, limit in (plainly, stretched)]
    if not any(exceeded):
        return None
    ratio = float(units.x.std() / law.histogram.std())
    bent = wider is not None or exceeded[1]
    return Misfit(*(plainly if exceeded[0] else stretched), ratio, not exceeded[0], bent)


def scatter(batch: Batch, fit: Fit) -> tuple[Scatter, ...]:
    """Effects on the scatter that are significant given `fit`, the best first; mostly none."""
    setup = batch.setup
    if not setup.on_scatter or not setup.data.target.population:
        return ()
    units = batch.units(fit)
    level = next((name for name in (*fit.names, *batch.levels) if name in batch.levels), "")
    tried = [_fitted_scatter(batch, units, candidate, level) for candidate in setup.on_scatter]
    least = chdtri(1, setup.plan.settings.false_rate)  # of one parameter, not of the best
    tried = [effect for effect in tried if effect.gain > 0.5 * least]
    if max((effect.gain for effect in tried), default=0.0) < least:
        return ()
    limit = batch.limit
    significant = [effect for effect in tried if effect.gain > limit and effect.held_out.real]
    if not significant:
        return ()
    best = min(effect.score for effect in significant)
    equivalent = [
        replace(effect, threshold=limit, distance=max(effect.score - best, 0.0))
        for effect in tried
        if effect.score - best <= setup.plan.settings.set_distance and effect.gain > 0.5 * limit
    ]
    return tuple(sorted(equivalent, key=attrgetter("distance")))


def carrying(setup: Setup, scatter_effect: Scatter) -> Setup:
    """The setup of the model with an effect on the scatter in it, which may move the mean."""
    plan = replace(setup.plan, active=(*setup.plan.active, scatter_effect.active))
    by = scatter_effect.moves
    moved = {name: values + by for name, values in setup.predicted.items()}
    return replace(setup, plan=plan, predicted=moved, residual=setup.residual - by)


def _shifts_all_alike(columns: Array) -> bool:
    """Whether a column (N, 1) moves every unit by the same amount."""
    size = float(np.abs(columns).max(initial=0.0))
    return columns.shape[1] == 1 and size > 0.0 and bool(np.ptp(columns) <= LEVEL * size)


def _fitted_scatter(batch: Batch, units: Units, candidate: Candidate, level: str) -> Scatter:
    """An effect, fitted with the mean that it implies, or with a free one if far likelier."""
    data = batch.setup.data
    kind = BatchLikelihood(candidate, units.law, data.target)
    centred = replace(kind, about_mean=True)
    free, fixed = centred.best(units.centred), kind.best(units.x)
    without = float(units.law(units.centred).sum())
    gain = 2.0 * (centred(units.centred, free) - without)
    better = 2.0 * (centred(units.centred, free) - kind(units.x, fixed))
    apart = bool(level) and better > batch.search.thresholds.library
    at, used, x = (free, centred, units.centred) if apart else (fixed, kind, units.x)
    price = float(np.log(len(x))) * (candidate.count + apart)
    half = used.half_widths(x, at, batch.setup.plan.settings.interval)
    values, low, high = (kind.values(p) for p in (at, at - half, at + half))
    ends = {name: (low[name], high[name]) for name in values}
    if Role.LOT in data.measurements and isinstance(candidate.effect, OfUnits):
        values |= candidate.effect.with_lots
    return Scatter(
        candidate,
        data.target,
        values,
        ends,
        gain,
        np.nan,
        _held_out(units, centred, free),
        price - 2.0 * used(x, at),
        mean_effect=level if apart else "",
    )


def _held_out(units: Units, centred: BatchLikelihood, start: Array) -> Improvement:
    """Twice the increase of the log likelihood of held-out units."""
    x, gains = units.centred, []
    for block in np.unique(units.labels):
        out = units.labels == block
        p = centred.best(x[~out], start)
        gains.append(2.0 * (centred(x[out], p) - float(units.law(x[out]).sum())))
    return Improvement.of(np.array(gains))


def held_out_units(units: Units, scatter_effect: Scatter, x: Array) -> Array:
    """Deviations x (n,) of held-out units, mapped to the population of the final fit by their rank
    in the population of a fit without their block.
    """
    used, start = scatter_effect.likelihood(units.law)
    deviations, whole = np.empty_like(x), scatter_effect.changed(units.law).histogram
    for block in np.unique(units.labels):
        out = units.labels == block
        training = x[~out] - x[~out].mean() if scatter_effect.mean_effect else x[~out]
        law = used.changed(used.best(training, start)).histogram
        deviations[out] = whole.ppf(np.clip(law.cdf(x[out]), CERTAIN, 1.0 - CERTAIN))
    return deviations
