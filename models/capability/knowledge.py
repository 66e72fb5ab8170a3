"""What is known of processes from their samples: scatter, mean, and their uncertainty; the norm of
tolerances in an assured allocation; choices among sampled processes; the confidence that sums conform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ...section import Array
from ..propagation.moments import cornish_fisher
from .subpopulations import Scatter

MIN_SAMPLE_PARTS = 5
"""Parts from which a sample is used; the posterior mean of a variance needs 4 of them."""
CONFIDENCE = 0.95
"""Confidence of the upper limit on a variance in an assured allocation."""
CONTRADICTED = 1e-6
"""Probability below which a sample contradicts a prior."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """A gauge: its standard deviation, and the degrees of freedom of that estimate."""

    sigma: float
    df: float = np.inf


@dataclass(frozen=True, slots=True)
class Prior:
    """A prior of a standard deviation, with the weight of `parts` measured parts."""

    sigma: float
    parts: float


@dataclass(frozen=True, slots=True)
class Difference:
    """The variances of measurements and gauge; that of the parts is their difference.

    Each is an estimate with its degrees of freedom.
    """

    measured: float
    measured_df: float
    gauge: float
    gauge_df: float

    @property
    def part_variance(self) -> float:
        """The variance of the parts alone."""
        return self.measured - self.gauge

    def upper_limit(self, confidence: float = CONFIDENCE) -> float:
        """Upper confidence limit of the difference of the two variances.

        Reference: Ting, Burdick, Graybill, Jeyaratnam, Lu (1990), Confidence intervals on linear
        combinations of variance components that are unrestricted in sign, J. Statistical Computation
        and Simulation 35(1-2), 135-143.
        """
        first, second = self.measured, self.gauge
        chi_square = float(scipy.stats.chi2.ppf(1.0 - confidence, self.measured_df))
        above = self.measured_df / chi_square - 1.0
        below, f = 0.0, chi_square / self.measured_df
        if np.isfinite(self.gauge_df):
            below = 1.0 - self.gauge_df / float(scipy.stats.chi2.ppf(confidence, self.gauge_df))
            f = float(scipy.stats.f.ppf(1.0 - confidence, self.measured_df, self.gauge_df))
        mixed = ((1.0 - f) ** 2 - (above * f) ** 2 - below**2) / f
        variance = (above * first) ** 2 + (below * second) ** 2 + mixed * first * second
        return first - second + float(np.sqrt(max(variance, 0.0)))


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Posterior of a normal process: variance scaled-inverse-chi-square (df, std^2), mean given the
    variance normal about the sample's with variance sigma^2/n.

    A known process has infinite `n` and `df`. `prior_parts` is the weight of a stated
    prior, in parts; `difference` holds the variances where a gauge adds uncertainty.

    Reference: Gelman et al. (2013), Bayesian Data Analysis, 3rd ed., section 3.3, with the prior
    density 1/sigma^2 or a scaled-inverse-chi-square one.
    """

    mean: float
    std: float
    n: float = np.inf
    df: float = np.inf
    prior_parts: float = 0.0
    difference: Difference | None = None

    @property
    def inflation(self) -> float:
        """E, the posterior mean of the variance over std^2."""
        return 1.0 if np.isinf(self.df) else self.df / (self.df - 2.0)

    def surplus_at(self, confidence: float = CONFIDENCE) -> float:
        """G, the upper limit of the variance at a confidence over std^2, less E; at least 0."""
        if np.isinf(self.df):
            return 0.0
        surplus = _factor(self.df, confidence) - self.inflation
        if (difference := self.difference) is not None:
            limit = difference.upper_limit(confidence) / difference.part_variance
            surplus += max(limit - _factor(difference.measured_df, confidence), 0.0)
        return max(surplus, 0.0)

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Variances over std^2 and errors of the mean over std, (count,) each, of the posterior.

        With a gauge, the generalised pivotal quantity of the difference is drawn: a drawn variance
        of the gauge is subtracted from that of the measurements; the difference is at least a
        thousandth.
        Reference: Weerahandi (1993), Generalized confidence intervals, J. American Statistical
        Association 88(423), 899-905.
        """
        if np.isinf(self.df):
            return np.ones(count), np.zeros(count)
        variance = self.df / rng.chisquare(self.df, count)
        observed = variance
        if (difference := self.difference) is not None:
            fraction = difference.measured_df / self.df
            gauge = np.full(count, difference.gauge)
            if np.isfinite(difference.gauge_df):
                gauge = difference.gauge * difference.gauge_df / rng.chisquare(difference.gauge_df, count)
            measured = variance * (self.std**2 + fraction * difference.gauge)
            variance = np.maximum(measured - fraction * gauge, 1e-3 * self.std**2) / self.std**2
            observed = variance + gauge / self.std**2
        return variance, np.sqrt(observed / self.n) * rng.standard_normal(count)


def _factor(df: float, confidence: float) -> float:
    """The upper confidence limit of a variance over its estimate."""
    return df / float(scipy.stats.chi2.ppf(1.0 - confidence, df))


def knowledge_of(
    values: Array, prior: Prior | None = None, gauge: Gauge | None = None, scatter: Scatter | None = None
) -> Knowledge:
    """The posterior of a process from measured `values` (n,) of a characteristic.

    The variance of a gauge is subtracted, and the upper limit is that of the difference. `scatter`
    is that of parts of several groups, in place of the sample's variance. Raises
    ValueError for fewer than `MIN_SAMPLE_PARTS` values, values that are all equal, a gauge that scatters
    at least as much as the measurements, and a prior that they contradict.
    """
    n = len(values)
    if n < MIN_SAMPLE_PARTS:
        raise ValueError(f"has {n} values; at least {MIN_SAMPLE_PARTS} are needed")
    observed, mean = float(np.var(values, ddof=1)), float(np.mean(values))
    df, n_mean = n - 1.0, float(n)
    if scatter is not None:
        observed, df, n_mean = scatter.variance, scatter.df, scatter.n
    if observed <= 0.0:
        raise ValueError(f"has {n} equal values: the resolution of the gauge is too coarse to show a scatter")
    variance = observed if gauge is None else observed - gauge.sigma**2
    if gauge is not None and variance <= 0.0:
        raise ValueError(
            f"has a standard deviation of {np.sqrt(observed):.4g}, its gauge alone one of {gauge.sigma:.4g}: "
            "the gauge is unfit for these parts"
        )
    parts = 0.0
    difference = None if gauge is None else Difference(observed, df, gauge.sigma**2, gauge.df)
    if prior is not None:
        below = float(scipy.stats.f.cdf(variance / prior.sigma**2, df, prior.parts))
        if (chance := 2.0 * min(below, 1.0 - below)) < CONTRADICTED:
            raise ValueError(
                f"has a standard deviation of {np.sqrt(variance):.4g}, the prior one of {prior.sigma:.4g} with the "
                f"weight of {prior.parts:g} parts: they differ as much by chance once in "
                f"{1.0 / max(chance, 1e-12):.2g} samples; reduce prior.parts, or remove the prior"
            )
        variance = (prior.parts * prior.sigma**2 + df * variance) / (prior.parts + df)
        df, parts = df + prior.parts, prior.parts
    return Knowledge(mean, float(np.sqrt(variance)), n_mean, df, parts, difference)


# The standard deviation in an assured allocation: a norm of the tolerances.
#
# Of squares v_j = (a_j t_j)^2 of independent parts, E_j the posterior mean of a variance over its
# estimate, G_j its upper confidence limit less that,
#
#     h^2 = sum E_j v_j + sqrt( sum (G_j v_j)^2 + (sum M_j v_j)^2 )
#
# (modified large-sample limit of a sum of variances, by posterior moments). Each sum over v is a norm
# of v >= 0 that rises with every v_j, and so is sqrt(sum of squares) of such norms; the root of one,
# as a function of t, is its 2-convexification and a norm again: h is convex and homogeneous.
#
# At one limit with the mean's error c = z sqrt(sum v_j/n_j)/K and a^2 = sum E_j v_j,
#
#     h = a + sqrt( (sqrt(a^2 + N) - a)^2 + c^2 ),    N = sqrt( sum (G_j v_j)^2 )
#
# It is the largest of a (1 - cos f) + sqrt(a^2 + N) cos f + c sin f for f from 0 to 90 degrees, each
# a sum of norms: a norm again.
#
# Reference: Graybill & Wang (1980), Confidence intervals on nonnegative linear combinations of
# variances, J. American Statistical Association 75(372), 869-873; Lindenstrauss & Tzafriri (1979),
# Classical Banach Spaces II, section 1.d.


@dataclass(frozen=True, slots=True, eq=False)
class Surplus:
    """What uncertainty adds to a sum a^2 of squares v (..., f) under a root.

    N = sqrt( sum_j (own_j v_j)^2 + fixed_own^2 + (sum_j shared_j v_j + fixed_shared)^2 ) between
    two limits. At one limit, where the mean's error counts in full, `error` is given and it is
    (a + H)^2 - a^2, H = sqrt(b^2 + c^2), b = sqrt(a^2 + N) - a, c^2 = sum_j error_j v_j +
    fixed_error, a^2 = sum_j v_j + fixed_even. `own`, `shared` and `error` (f,) belong to the
    squares that vary.
    """

    own: Array
    shared: Array
    fixed_own: float = 0.0
    fixed_shared: float = 0.0
    error: Array | None = None
    fixed_error: float = 0.0
    fixed_even: Array | float = 0.0

    @property
    def convex(self) -> bool:
        """Whether it is convex in the squares; the root is convex in the tolerances in any case."""
        return self.error is None

    def value(self, square: Array) -> tuple[Array, Array]:
        """The surplus (...,) at squares (..., f), and its derivatives by them (..., f)."""
        own_terms = self.own * square
        shared = np.sum(square * self.shared, axis=-1) + self.fixed_shared
        value = np.sqrt(np.sum(own_terms**2, axis=-1) + self.fixed_own**2 + shared**2)
        safe = np.where(value > 0.0, value, 1.0)[..., None]
        rise = (own_terms * self.own + shared[..., None] * self.shared) / safe
        return (value, rise) if self.error is None else self._at_one_limit(square, value, rise)

    def _at_one_limit(self, square: Array, value: Array, rise: Array) -> tuple[Array, Array]:
        """The same with the error of the mean, from N (...,) and its derivatives."""
        assert self.error is not None
        a = np.sqrt(np.sum(square, axis=-1) + self.fixed_even)
        root = np.sqrt(a**2 + value)
        b, c = root - a, np.sqrt(np.sum(square * self.error, axis=-1) + self.fixed_error)
        both = np.hypot(b, c)
        by_a, by_root, by_c = (divide_or_default(np.full_like(size, 0.5), size)[..., None] for size in (a, root, c))
        by_b = (1.0 + rise) * by_root - by_a
        far, size = (a + both)[..., None], both[..., None]
        slope = divide_or_default(b[..., None] * by_b + c[..., None] * self.error * by_c, size)
        return both * (2.0 * a + both), 2.0 * (by_a * size + far * slope)


@dataclass(frozen=True, slots=True, eq=False)
class Norm:
    """h by parts: `even` (p,) are E_j, `own` G_j and `shared` M_j, each times (a_j/t_j)^2.

    For parts made by several processes all may be (n, p), a row for each design. At one limit
    `error` is the weight of the square of the mean's error in h.
    """

    even: Array
    own: Array
    shared: Array
    error: Array | None = None

    def value(self, t: Array, rest: Array | float = 0.0) -> Array:
        """h (n,) of tolerances (n, p), in addition to a known variance `rest` (n,)."""
        square = t**2 * self.even
        more = self.surplus(rest).value(square)[0]
        return np.asarray(np.sqrt(np.sum(square, axis=1) + rest + more))

    def slopes(self, t: Array) -> Array:
        """dh/dt, (n, p); 0 where nothing scatters."""
        square, value = t**2 * self.even, self.value(t)[:, None]
        return divide_or_default(t * self.even * (1.0 + self.surplus().value(square)[1]), value)

    def surplus(self, rest: Array | float = 0.0) -> Surplus:
        """What uncertainty adds, as a function of the squares E v."""
        error = None if self.error is None else divide_or_default(self.error, self.even)
        return Surplus(
            divide_or_default(self.own, self.even),
            divide_or_default(self.shared, self.even),
            error=error,
            fixed_even=rest,
        )


def divide_or_default(value: Array, by: Array, otherwise: float = 0.0) -> Array:
    """value/by, and `otherwise` where `by` is 0."""
    return np.divide(value, by, out=np.full_like(value, otherwise), where=by > 0.0)


def factor_of(df: Array, level: float) -> Array:
    """G of the limit without posterior moments: an upper limit over its estimate, less 1."""
    finite = np.isfinite(df)
    safe = np.where(finite, df, 1.0)
    limit = safe / scipy.stats.chi2.ppf(1.0 - level, safe) - 1.0
    return np.asarray(np.where(finite, np.maximum(limit, 0.0), 0.0))


def norm_of(
    known: Sequence[Knowledge | None],
    square: Array,
    moved: Array,
    confidence: float,
    level: float | None = None,
    quantile: float | None = None,
) -> Norm:
    """The norm of parts with the processes `known`, None for one without uncertainty.

    `square` (p,) is the variance that each adds to the requirement at t = 1, `moved` (p,) by how
    much that rises with the square of its mean's error: (sum of slopes)^2, in units of variances.
    M differs from 0 only for parts with a stated prior: without one the uncertainty of the variance
    outweighs that of the mean. With a `level` the limit is that of the estimates (E = 1): among
    alternatives it matters how often the choice is kept, not the moments of a single process.

    Between two limits the error of the mean counts by the variance that it adds (Howe 1969). At one
    limit alone, `quantile` standard deviations from it, it counts in full in addition to the
    uncertainty of the variance: as the root of the sum of both squares.
    """
    inflation = np.array([1.0 if knowledge is None or level else knowledge.inflation for knowledge in known])
    surplus = np.array([_surplus(knowledge, confidence, level) for knowledge in known])
    error = moved * np.array([0.0 if knowledge is None else 1.0 / knowledge.n for knowledge in known])
    if quantile is not None:
        counted = (float(ndtri(confidence)) / quantile) ** 2
        return Norm(inflation * square, surplus * square, np.zeros_like(square), counted * inflation * error)
    prior = np.array([knowledge is not None and knowledge.prior_parts > 0.0 for knowledge in known], dtype=float)
    far = float(ndtri(0.5 * (1.0 + confidence))) ** 2 - 1.0
    return Norm(inflation * (square + error), surplus * (square + error), prior * far * inflation * error)


def _surplus(knowledge: Knowledge | None, confidence: float, level: float | None) -> float:
    """The upper limit of a variance less its posterior mean, or less its estimate."""
    if knowledge is None:
        return 0.0
    if level is None:
        return knowledge.surplus_at(confidence)
    return knowledge.surplus_at(level) + knowledge.inflation - 1.0


# Processes chosen by sampled scatter: the level at which such a choice conforms as promised.
#
# An optimiser prefers processes whose scatter the samples underestimate, the more so the more
# alternatives there are: a confidence that holds for a fixed allocation fails for the chosen
# allocation. Self-calibration repeats the procedure with processes drawn from their posteriors: they
# are sampled, a choice is made, and the choice is tested by the processes drawn. The least level of
# the norm whose choices conform to their limits as often as promised is used.
#
# Reference: Loh (1987), Calibrating confidence coefficients, J. American Statistical Association
# 82(397), 155-162; Beran (1987), Prepivoting to reduce level error of confidence sets, Biometrika
# 74(3), 457-468.


RISKS = (0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Levels of the norm that are tried, as fractions of the allowed risk: 0.98 first for 0.95.

A sample that makes a choice look safe makes its repeats look safe as well. With all levels down to
the confidence itself, 93 and 89 % of the choices among 9 x 3 machines with 10 and 20 parts of each
conformed (200 repeats): self-calibration may raise the level of two fifths, and not lower it.
"""
REPEATS = 200
"""Repeats of sampling, choosing and testing: the standard error of a fraction is 1.5 %."""
STATES = 65_536
"""Allocations that are compared; of more, only the best at `PRICES` of their variance."""
PRICES = np.geomspace(1e-3, 1e3, 25)
CHOICES_PER_BATCH = 1024
"""Allocations that are tested together, the cheapest first."""
RARE = 0.05
"""Fraction of samples with an assured choice below which a level counts as without choice."""


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The alternatives (w,) for making a part: `cost` (w,) and `process` (w,), the index in
    `Processes`.

    `std` and `mean` (r, w) are the estimated contributions to each of r requirements; `pieces` (r,)
    is the square of an error of the mean over that of a single piece.
    """

    cost: Array
    process: NDArray[np.int64]
    std: Array
    mean: Array
    pieces: Array


@dataclass(frozen=True, slots=True, eq=False)
class Processes:
    """Samples of processes: degrees of freedom and number of parts (q,), inf if known."""

    df: Array
    n: Array


@dataclass(frozen=True, slots=True)
class Aim:
    """The promise: with a `confidence`, the deviations of a fraction `share` of the units lie
    between the `ends` (r, 2) of each requirement; `quantile` standard deviations (r,) must fit to
    each end.
    """

    share: float
    confidence: float
    ends: Array
    quantile: Array


@dataclass(frozen=True, slots=True)
class Level:
    """A level of the norm, the fraction of choices that conform, and of samples without a choice.

    `confidence` is that of the highest level tried where none is sufficient (`sure` is False).
    """

    confidence: float
    kept_fraction: float
    without: float
    sure: bool


def calibrated(
    parts: Sequence[Ways], processes: Processes, aim: Aim, rng: np.random.Generator, repeats: int = REPEATS
) -> Level:
    """The least level from which on choices conform with the confidence of the aim.

    Where no level with a choice reaches it, the last level is returned and is not `sure`.
    """
    levels = tuple(1.0 - risk * (1.0 - aim.confidence) for risk in RISKS)
    choices, conforming_choices = np.zeros((2, len(levels)))
    table = _Table.of(parts, processes)
    factors = [factor_of(table.kinds, level) for level in levels]
    for _ in range(repeats):
        truth = _variance_ratios(processes.df, rng)
        error = _mean_errors(processes, truth, rng)
        sample = _Sampled(table, truth / _variance_ratios(processes.df, rng), aim)
        previous, conforming = -1, False
        for at, factor in enumerate(factors):
            chosen = sample.cheapest(factor, max(previous, 0))
            if chosen is None:
                break
            if chosen != previous:
                previous, conforming = chosen, table.conforms(chosen, truth, error, aim)
            choices[at] += 1.0
            conforming_choices[at] += conforming
    kept_fraction = conforming_choices / np.maximum(choices, 1.0)
    enough = choices >= RARE * repeats
    missed = np.flatnonzero(enough & (kept_fraction < aim.confidence))
    at = min(int(missed[-1]) + 1 if len(missed) else 0, len(levels) - 1)
    sure = bool(enough[at] and kept_fraction[at] >= aim.confidence)
    return Level(levels[at], float(kept_fraction[at]), float(1.0 - choices[at] / repeats), sure)


def _mean_errors(processes: Processes, truth: Array, rng: np.random.Generator) -> Array:
    """Errors of means (q,) over estimated standard deviations, given the drawn variances."""
    scale = np.where(np.isfinite(processes.n), np.sqrt(truth / processes.n), 0.0)
    return np.asarray(scale * rng.standard_normal(len(truth)))


def _variance_ratios(df: Array, rng: np.random.Generator) -> Array:
    """Variances over their estimates (q,), drawn from the posterior; 1 where they are known."""
    finite = np.isfinite(df)
    chi_square = rng.chisquare(np.where(finite, df, 1.0))
    return np.asarray(np.where(finite, df / chi_square, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Allocations in the order of their cost: `choices` (m, parts) as places among the alternatives
    (w,) of all parts, `uses` (m, w) the same as ones and zeros, and the mean (r, m) of each.

    `process` (w,), `std` and `pieces` (w, r) are of all alternatives; `kinds` (u,) are the
    different degrees of freedom, `kind` (q,) is the index of a process among them.
    """

    choices: NDArray[np.int64]
    uses: Array
    mean: Array
    process: NDArray[np.int64]
    std: Array
    means: Array
    pieces: Array
    n: Array
    kinds: Array
    kind: NDArray[np.int64]

    @classmethod
    def of(cls, parts: Sequence[Ways], processes: Processes) -> _Table:
        """All allocations; where there are too many, the best by the estimates."""
        kinds, kind = np.unique(processes.df, return_inverse=True)
        rows, place = len(parts[0].std), 0
        cost, choices = np.zeros(1), np.zeros((1, 0), dtype=np.int64)
        square, mean = np.zeros((2, rows, 1))
        for part in parts:
            count, before = len(part.cost), len(choices)
            cost = np.add.outer(cost, part.cost).ravel()
            square = (square[:, :, None] + part.std[:, None, :] ** 2).reshape(rows, -1)
            mean = (mean[:, :, None] + part.mean[:, None, :]).reshape(rows, -1)
            choices = np.column_stack([np.repeat(choices, count, axis=0), np.tile(place + np.arange(count), before)])
            place += count
            if len(cost) > STATES:
                best = _best_allocations(cost, square)
                cost, choices = cost[best], choices[best]
                square, mean = square[:, best], mean[:, best]
        order = np.argsort(cost, kind="stable")
        choices, uses = choices[order], np.zeros((len(order), place))
        uses[np.arange(len(choices))[:, None], choices] = 1.0
        return cls(
            choices,
            uses,
            mean[:, order],
            process=np.concatenate([part.process for part in parts]),
            std=np.concatenate([part.std.T for part in parts]),
            means=np.concatenate([part.mean.T for part in parts]),
            pieces=np.concatenate([np.tile(part.pieces, (len(part.cost), 1)) for part in parts]),
            n=processes.n,
            kinds=kinds,
            kind=kind.ravel(),
        )

    def conforms(self, chosen: int, truth: Array, error: Array, aim: Aim) -> bool:
        """Whether the units of an allocation conform, by true variances and mean errors (q,)."""
        choices = self.choices[chosen]
        process, std = self.process[choices], self.std[choices]
        spread = np.sqrt(np.maximum(np.sum(std**2 * truth[process][:, None], axis=0), 1e-300))
        off = self.means[choices] + np.sqrt(self.pieces[choices]) * std * error[process][:, None]
        ends = (aim.ends - off.sum(axis=0)[:, None]) / spread[:, None]
        return bool(np.all(ndtr(ends[:, 1]) - ndtr(ends[:, 0]) >= aim.share))


class _Sampled:
    """Allocations by a sample of the processes: sampled variances (q,) over the estimates."""

    def __init__(self, table: _Table, variance_ratio: Array, aim: Aim) -> None:
        self.table, self.aim, process = table, aim, table.process
        square = table.std**2 * variance_ratio[process][:, None] * (1.0 + table.pieces / table.n[process][:, None])
        doubt = np.zeros((len(square), len(table.kinds), square.shape[1]))
        doubt[np.arange(len(square)), table.kind[process]] = square**2
        self.terms = np.hstack([square, doubt.reshape(len(square), -1)])
        self.cached: dict[int, Array] = {}

    def cheapest(self, factor: Array, first: int) -> int | None:
        """The first allocation from a place on that conforms by the norm of factors (u,)."""
        rows, (low, high) = len(self.aim.ends), self.aim.ends.T
        for start in range(first - first % CHOICES_PER_BATCH, len(self.table.choices), CHOICES_PER_BATCH):
            sums, mean = self._sums(start), self.table.mean[:, start : start + CHOICES_PER_BATCH].T
            doubt = sums[:, rows:].reshape(len(sums), len(factor), rows)
            surplus = np.sqrt(np.sum(factor[:, None] ** 2 * doubt, axis=1))
            reach = self.aim.quantile * np.sqrt(sums[:, :rows] + surplus)
            fits = np.all((mean + reach <= high) & (mean - reach >= low), axis=1)
            if (at := int(np.argmax(fits))) or fits[0]:
                return start + at
        return None

    def _sums(self, start: int) -> Array:
        """Sums of variances and, by degrees of freedom, of their squares (k, r + u r)."""
        if start not in self.cached:
            self.cached[start] = self.table.uses[start : start + CHOICES_PER_BATCH] @ self.terms
        return self.cached[start]


def _best_allocations(cost: Array, square: Array) -> NDArray[np.int64]:
    """Indices of allocations that are best at some price of their variances (r, m)."""
    size = (square / np.maximum(square.max(axis=1, keepdims=True), 1e-300)).sum(axis=0)
    span = max(float(np.ptp(cost)), 1e-300)
    per_price = max(1, STATES // (16 * len(PRICES)))
    cheapest = [np.argpartition(cost / span + price * size, per_price)[:per_price] for price in PRICES]
    return np.unique(np.concatenate(cheapest))


# Confidence that sums of parts, normal or not, conform to their limits: Bayesian bootstrap.
#
# Every draw weights the measured values of each part (Dirichlet), takes the moments of the weighted
# sample, adds the cumulants up and compares the quantiles of the sum (Cornish & Fisher) with the
# limits.
#
# Reference: Rubin (1981), The Bayesian bootstrap, Annals of Statistics 9(1), 130-134; Cornish &
# Fisher (1938), Revue de l'Institut International de Statistique 5(4), 307-320.


def draw_cumulants(values: Array, draws: int, rng: np.random.Generator) -> Array:
    """Mean and second to fourth cumulants (draws, 4) of values (n,) about their mean, weighted.

    The variance is (n + 1)/(n - 1) times that of the weighted sample, so that its mean is the
    sample's variance.
    """
    n, centred = len(values), values - values.mean()
    weights = rng.dirichlet(np.ones(n), draws)
    mean = weights @ centred
    about = centred[None, :] - mean[:, None]
    second, third, fourth = (np.sum(weights * about**k, axis=1) for k in (2, 3, 4))
    wider = (n + 1.0) / (n - 1.0)
    return np.stack([mean, second * wider, third * wider**1.5, (fourth - 3.0 * second**2) * wider**2], axis=1)


def fraction_within_limits(cumulants: Sequence[Array], ends: tuple[float, float], fraction: float) -> float:
    """Fraction of the draws in which the sum of parts conforms to its limits.

    `cumulants` (draws, 4) are those of each part, `ends` the limits of the sum from its estimated
    mean. A draw conforms where the limits contain the `fraction` of the units, with equal fractions
    beyond each finite limit.
    """
    mean, variance, third, fourth = np.sum(cumulants, axis=0).T
    std = np.sqrt(np.maximum(variance, 1e-300))
    skew, excess = third / std**3, fourth / std**4
    finite = np.isfinite(ends)
    z = float(ndtri(0.5 * (1.0 + fraction) if np.all(finite) else fraction))
    within = np.ones(len(mean), dtype=bool)
    for side, end, limited in zip((-1.0, 1.0), ends, finite, strict=True):
        if limited:
            within &= side * (end - mean) >= side * std * cornish_fisher(side * z, skew, excess)
    return float(within.mean())
