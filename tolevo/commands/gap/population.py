"""Batches: whether units scatter as the model's population does, or as a wider or a mixed one.

The population itself is the noise. Effects that move single units are selected by their columns,
those that change the scatter are selected here by likelihood. A mixture moves the mean too: the
likelihood of both together decides whether the mean needs another effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from operator import attrgetter

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import chdtri

from ...models.effects import Target
from ...models.effects.effect import EffectParameter
from ...models.effects.measurements import Active
from ...models.effects.population import Law, OfUnits
from ...models.measurable import Role
from ...section import Array
from .blocks import Improvement
from .fit import Fit, Member
from .library import Candidate, carried, law_with
from .plan import GapPlan
from .selection import INSTRUMENT, Search
from .setup import Setup, residual_of

# The distance of a batch from the population that a model predicts.
#
# The gap of a batch is a distance between distributions: the root mean square of the differences of
# the sorted units from the quantiles of the population at their ranks. This is the 2-Wasserstein
# distance between the batch and the population, in the output's unit.

BATCHES = 400
"""Simulated batches from which the floor is computed."""
FLOOR = 0.95
"""Fraction of the batches of a population whose distance from it is at most the floor."""


def distance(law: Law, units: Array) -> float:
    """The distance between deviations (n,) of units from the model's mean and their law."""
    return float(_distances(law, np.asarray(units)[None])[0])


def floor(
    law: Law, count: int, rng: np.random.Generator, fraction: float = FLOOR, centred: bool = False, scaled: bool = False
) -> float:
    """The quantile `fraction` of the distances of batches of `count` units, drawn from the law;
    `centred`: about the mean of each batch; `scaled`: with the width of the law as well.
    """
    drawn = law.histogram.rvs(size=(BATCHES, count), random_state=rng)
    drawn = match_to_law(law, drawn, scaled) if centred else drawn
    return float(np.quantile(_distances(law, drawn), fraction))


def match_to_law(law: Law, units: Array, scaled: bool = False) -> Array:
    """Units (..., n) moved to the mean of the law, and stretched to its width if `scaled`."""
    about = units - units.mean(axis=-1, keepdims=True)
    if scaled:
        about *= law.histogram.std() / units.std(axis=-1, keepdims=True)
    return np.asarray(about + law.histogram.mean())


def likelier(x: Array, low: float, step: float, ratios: Array) -> Array:
    """Twice the largest log likelihood ratio (b,), at least 0, of batches x (b, n), from the ratios
    (m, k) at a lattice `low` + k `step`. Units are counted in its cells, so that a likelihood is a
    matrix product.
    """
    size = ratios.shape[1]
    cell = np.clip(np.rint((x - low) / step), 0, size - 1).astype(np.int64)
    cell += size * np.arange(len(x))[:, None]
    counts = np.bincount(cell.ravel(), minlength=size * len(x)).reshape(len(x), size)
    return np.asarray(2.0 * (counts.astype(float) @ ratios.T).max(axis=1).clip(0.0))


def _distances(law: Law, units: Array) -> Array:
    """The distances (m,) of batches (m, n) from a law."""
    ranks = (np.arange(units.shape[1]) + 0.5) / units.shape[1]
    apart = np.sort(units, axis=1) - law.histogram.ppf(ranks)
    return np.asarray(np.sqrt(np.mean(apart**2, axis=1)))


GROWTHS = np.geomspace(1.03, 4.0, 24) - 1.0
STEPS = np.linspace(0.75, 5.0, 12)
SHARES = np.array([0.06, 0.12, 0.25, 0.5, 0.75, 0.88])
FARTHEST = 20.0
MAX_GRID_OR_UNITS = 400
"""Units of a simulated batch; a likelihood ratio does not depend on their number. Also the most
starting points of a fit."""


@dataclass(frozen=True)
class Kind:
    """The search of a parameter: values to start from, coarse values for the threshold, bounds, and
    the step of its second derivative.
    """

    starts: Array
    coarse: Array
    bounds: tuple[float, float]
    step: float


@dataclass(frozen=True)
class BatchLikelihood:
    """The likelihood of deviations (n,) from the model's mean, given an effect on their scatter.

    Its parameters are `p` (k,); those in the output's unit count in standard deviations of the law.
    """

    candidate: Candidate
    law: Law
    target: Target
    about_mean: bool = False
    """Whether the deviations are from the mean of the units instead of the model's."""

    @property
    def numbers(self) -> tuple[EffectParameter, ...]:
        """The fitted parameters."""
        return self.candidate.parameters

    @cached_property
    def scale(self) -> Array:
        """The scale (k,) of each parameter, in its unit."""
        unit = self.target.outputs[0].unit
        return np.array([self.law.std if unit and parameter.unit == unit else 1.0 for parameter in self.numbers])

    def _kinds(self) -> list[Kind]:
        return list(map(self._kind, self.numbers, self.scale.tolist()))

    def _kind(self, parameter: EffectParameter, scale: float) -> Kind:
        low, high = max(parameter.low / scale, -FARTHEST), min(parameter.high / scale, FARTHEST)
        if parameter.unit == self.target.outputs[0].unit:
            both = np.concatenate([-STEPS, STEPS]) if low < 0.0 else STEPS
            return Kind(both, both[::3], (low, high), 0.1)
        if np.isfinite([parameter.low, parameter.high]).all():
            inside = SHARES if low >= 0.0 and high <= 1.0 else low + (high - low) * SHARES
            return Kind(inside, inside[:4:2], (low, high), 0.005 * (high - low))
        both = np.concatenate([-GROWTHS, GROWTHS]) if low < 0.0 else GROWTHS
        return Kind(both, both[::2], (low, high), 0.05)

    def _grid(self, coarse: bool) -> Array:
        """Starting points (m, k)."""
        axes = [kind.coarse if coarse else kind.starts for kind in self._kinds()]
        while np.prod([len(axis) for axis in axes]) > MAX_GRID_OR_UNITS:
            axes = [axis[::2] for axis in axes]
        return np.array(list(product(*axes)), dtype=np.float64)

    def values(self, p: Array) -> dict[str, float]:
        """Parameters by name, in their units."""
        named = zip(self.numbers, np.asarray(p) * self.scale, strict=True)
        return {parameter.name: float(value) for parameter, value in named}

    def changed(self, p: Array) -> Law:
        """The law with the effect at parameters p (k,)."""
        return law_with(self.law, self.candidate.effect, self.values(p), self.target)

    def __call__(self, x: Array, p: Array) -> float:
        """The log likelihood of deviations (n,)."""
        moved = self.mean(p) if self.about_mean else 0.0
        return float(self.changed(p)(x + moved).sum())

    def mean(self, p: Array) -> float:
        """The shift of the mean by the effect."""
        return carried([Active(self.candidate.effect, self.values(p))], self.target)

    def best(self, x: Array, start: Array | None = None) -> Array:
        """The likeliest parameters (k,)."""
        starts = self._grid(False) if start is None else start[None]

        def worse(p: Array) -> float:
            return -self(x, p)

        optimum = scipy.optimize.minimize(
            worse,
            min(starts, key=worse),
            method="Nelder-Mead",
            bounds=[kind.bounds for kind in self._kinds()],
            options={"xatol": 1e-4, "fatol": 1e-3},
        )
        return np.asarray(optimum.x)

    def log_densities_on_grid(self, at: Array) -> list[Array]:
        """Log densities (k,) about their mean, at the coarse grid of the parameters."""
        return [self.changed(p)(at + self.mean(p)) for p in self._grid(True)]

    def half_widths(self, x: Array, at: Array, level: float) -> Array:
        """Half-widths (k,) of intervals from the curvature in all parameters jointly."""
        from statsmodels.tools.numdiff import approx_hess  # imports all distributions of scipy

        steps = np.array([kind.step for kind in self._kinds()])
        bend = np.atleast_2d(approx_hess(at, lambda p: -self(x, p), epsilon=steps))
        variance = np.diag(np.linalg.pinv(bend))
        return np.asarray(scipy.special.ndtri(0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 1e-12)))


def threshold(law: Law, candidates: Sequence[Candidate], target: Target, count: int, plan: GapPlan) -> float:
    """The threshold: a quantile of the best of all effects on batches drawn from the null model."""
    rng = np.random.default_rng([plan.seed, 6])
    shape = (plan.settings.simulations, min(count, MAX_GRID_OR_UNITS))
    x = law.histogram.rvs(size=shape, random_state=rng)
    x -= x.mean(axis=1, keepdims=True)
    at = np.asarray(x.min() + law.step * (np.arange(1 + int(np.ptp(x) / law.step)) + 0.5))
    tried = [
        log for candidate in candidates for log in BatchLikelihood(candidate, law, target).log_densities_on_grid(at)
    ]
    best = likelier(x, float(at[0]), law.step, np.array(tried) - law(at))
    return float(np.quantile(best, 1.0 - plan.settings.false_rate))


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
        return distance(law, match_to_law(law, units.x, scaled)), limit

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


def setup_with_scatter(setup: Setup, scatter_effect: Scatter) -> Setup:
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
        _held_out_likelihood(units, centred, free),
        price - 2.0 * used(x, at),
        mean_effect=level if apart else "",
    )


def _held_out_likelihood(units: Units, centred: BatchLikelihood, start: Array) -> Improvement:
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
