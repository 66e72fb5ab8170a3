"""The mechanism of a stack: pieces with deviations, and the requirement that follows from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ...section import Array
from ..expressions import Formula, domain_margin
from ..inputs import Beta, Distribution, Normal, Uniform
from ..propagation.convolution import Even, even_law
from ..propagation.monte_carlo import REPLICATES, power_of, replicates
from ..propagation.symmetric_sum import SymmetricSum
from .matching import Matching

# Scatter and mean of parts where these do not follow from their tolerances alone.


@dataclass(frozen=True, slots=True, eq=False)
class AsMade:
    """Parts of n designs, (n, p) each, in the units of the parts.

    A part deviates by mean + spread z from its mid-limit, z ~ its input, and its drawing allows
    +-limit. For parts whose scatter is proportional to their tolerance, limit = spread = t.
    `chosen` is the index of the process of each part, None where it does not matter.
    """

    limit: Array
    spread: Array
    mean: Array
    chosen: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.limit)

    def __getitem__(self, rows: slice | NDArray[np.int64] | NDArray[np.bool_]) -> AsMade:
        """Some of the designs."""
        chosen = None if self.chosen is None else self.chosen[rows]
        return AsMade(self.limit[rows], self.spread[rows], self.mean[rows], chosen)


Tolerances = Array | AsMade
"""Half-widths t (n, p), where the scatter of all parts is in proportion to them; else `AsMade`."""


def interpolate_designs(low: Tolerances, high: Tolerances, fraction: Array) -> Tolerances:
    """Designs at fractions (n, 1) of the distance from one design (1, p) to another."""
    limit = limit_of(low) + fraction * (limit_of(high) - limit_of(low))
    if not (isinstance(low, AsMade) and isinstance(high, AsMade)):
        return limit
    spread = low.spread + fraction * (high.spread - low.spread)
    return AsMade(limit, spread, low.mean + fraction * (high.mean - low.mean))


def scaled(t: Tolerances, factor: Array) -> Tolerances:
    """The same designs with the scatter of each part times a factor (p,)."""
    return replace(t, spread=t.spread * factor) if isinstance(t, AsMade) else t * factor


def limit_of(t: Tolerances) -> Array:
    """Deviation that the drawing allows (n, p)."""
    return t.limit if isinstance(t, AsMade) else t


def spread_of(t: Tolerances) -> Array:
    """Factor of z (n, p)."""
    return t.spread if isinstance(t, AsMade) else t


def mean_of(t: Tolerances) -> Array:
    """Shift of the mean of each part (n, p)."""
    return t.mean if isinstance(t, AsMade) else np.zeros_like(t)


# Places of features: points in the disc of a diametral zone, by the pieces of a mechanism.


PLANE = ("uniform_disc", "uniform_circle", "normal")
"""Laws of a place in two directions: anywhere in its zone alike, at its edge in any direction alike,
or each component normal with the radius of the zone as 3 Cp standard deviations.
"""


def component(law: str, cp: float = 1.0) -> Distribution:
    """The distribution of one component z of a place in a zone of radius 1, or half-width 1.

    The density of a component is in proportion to sqrt(1 - z^2) where the place is uniform in the disc,
    and to 1/sqrt(1 - z^2) where it is on the circle. `cp` is for "normal" alone.
    """
    match law:
        case "uniform_disc":
            return Beta(1.5, 1.5)
        case "uniform_circle":
            return Beta(0.5, 0.5)
        case "uniform":
            return Uniform()
    return Normal(cp)


@dataclass(frozen=True, slots=True)
class Disc:
    """Two pieces of a mechanism that are the components of one place (z_i, z_j), |z| <= 1.

    The `law`, one of `PLANE`, is alike in all directions, so that S_i z_i + S_j z_j is distributed as
    sqrt(S_i^2 + S_j^2) z_i.
    """

    pieces: tuple[int, int]
    law: str

    @property
    def dependent(self) -> bool:
        """Whether one component restricts the other; normal ones are independent."""
        return self.law != "normal"

    def named(self, names: Sequence[str]) -> list[str]:
        """Its components by name."""
        return [names[piece] for piece in self.pieces]

    def turned(self, slopes: Array) -> Array:
        """Slopes (k,) by the pieces with those of this place replaced by their length, and 0."""
        along, across = self.pieces
        turned = slopes.copy()
        turned[along], turned[across] = np.hypot(slopes[along], slopes[across]), 0.0
        return turned

    def drawn(self, along: Array, around: Array) -> tuple[Array, Array]:
        """Components z from two uniform numbers (m,) each, of a dependent law."""
        radius = np.sqrt(along) if self.law == "uniform_disc" else np.ones_like(along)
        return radius * np.cos(2.0 * np.pi * around), radius * np.sin(2.0 * np.pi * around)

    def rounded(self, points: Array, used: Sequence[int], slopes: Array) -> Array:
        """Points (len(used), m) of the square of both components moved into the disc, along rays.

        Corners go to its edge; (1, 1) to where slopes (k,) say that the requirement is largest.
        """
        if not set(self.pieces) <= set(used):
            return points
        rows = [used.index(piece) for piece in self.pieces]
        x, y = points[rows]
        radius = np.maximum(np.abs(x), np.abs(y))
        angle = np.arctan2(y, x) - 0.25 * np.pi + np.arctan2(*slopes[list(self.pieces[::-1])])
        moved = points.copy()
        moved[rows] = radius * np.cos(angle), radius * np.sin(angle)
        return moved


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A requirement y of p toleranced parts that are built in as k >= p pieces.

    Piece i belongs to part `owner[i]`, whose tolerance t (half-width, in the part's unit) it
    shares; it deviates from its mid-limit by t z, z ~ `inputs[owner[i]]`, independently of all
    others unless `correlation` (k, k) is given. y is in the requirement's unit:

        with a formula   y = gain f(mids + scale t z), in the consistent units of the formula
        without one      y = centre + sum_i sensitivities_i t z_i

    (mean + spread z in the place of t z where parts are `AsMade`).

    `sensitivities` (k,) are dy/dx_i at the mid-limits, requirement unit per unit of the part;
    `centre` is y at the mid-limits. `lower` and `upper` are the limits of y, infinite where there
    are none. Correlated pieces are normal. `undefined` states where the formula has no value
    within the widest tolerances; empty where it has a value everywhere. `rough` are the pieces whose
    effect the sensitivities do not describe: the formula has no slope there, or a kink at the
    mid-limits. Sensitivities that are not finite are 0. `discs` are pairs of pieces that are the
    two components of one place, not independent of each other. `matched` are pairs of pieces that are sorted into
    classes and matched: what is linear here, and corners, leaves that out; a `Sample` does not.
    """

    names: tuple[str, ...]
    owner: tuple[int, ...]
    inputs: tuple[Distribution, ...]
    sensitivities: Array
    centre: float
    lower: float = -np.inf
    upper: float = np.inf
    formula: Formula | None = None
    mids: Array | None = None
    scale: Array | None = None
    gain: float = 1.0
    correlation: Array | None = None
    undefined: str = ""
    rough: tuple[str, ...] = ()
    discs: tuple[Disc, ...] = ()
    matched: tuple[Matching, ...] = ()

    @property
    def stated(self) -> tuple[Formula, Array, Array]:
        """The formula, the mid-limits and the scales (k,) of a mechanism that has one."""
        assert self.formula is not None and self.mids is not None and self.scale is not None
        return self.formula, self.mids, self.scale

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """Part of each piece, shape (k,)."""
        return np.array(self.owner, dtype=np.int64)

    @property
    def acting(self) -> NDArray[np.bool_]:
        """Whether the requirement depends on each piece, shape (k,)."""
        return np.asarray((self.sensitivities != 0.0) | np.isin(self.names, self.rough))

    @cached_property
    def directed(self) -> Array:
        """Sensitivities (k,), those of the two components of a place turned into one."""
        slopes = self.sensitivities
        for disc in self.discs:
            slopes = disc.turned(slopes)
        return slopes

    def rounded(self, points: Array, used: Sequence[int]) -> Array:
        """Points (len(used), m) of [-1, 1]^k with the components of each place moved into its disc."""
        for disc in self.discs:
            points = disc.rounded(points, used, self.sensitivities)
        return points

    def conforms(self, y: Array) -> NDArray[np.bool_]:
        """Whether values of any shape keep the limits, to their rounding; NaN does not."""
        room = [ROUNDING * abs(limit) if np.isfinite(limit) else 0.0 for limit in (self.lower, self.upper)]
        with np.errstate(invalid="ignore"):
            return np.asarray((y >= self.lower - room[0]) & (y <= self.upper + room[1]))

    @property
    def bounded(self) -> bool:
        """Whether the requirement has a limit, so that it has a yield."""
        return bool(np.isfinite(self.lower) or np.isfinite(self.upper))

    @property
    def matches(self) -> bool:
        """Whether the requirement depends on parts that are sorted and matched."""
        return any(bool(np.any(self.acting[list(pair.pieces)])) for pair in self.matched)

    def built(self, t: Tolerances, z: Array) -> Array:
        """`values` of the units that are built of independent parts z (k, m), sorted and matched."""
        rows = []
        for at, wide in enumerate(spread_of(t)):
            units = z.copy()
            for pair in self.matched:
                pieces = list(pair.pieces)
                one, other = (float(wide[self.owner[piece]]) for piece in pieces)
                units[pieces] = pair.matched(z[pieces], (one, other))
            rows.append(self.values(t[at : at + 1], units))
        return np.concatenate(rows) if rows else self.values(t, z)

    def values(self, t: Tolerances, z: Array) -> Array:
        """y (n, m) of n designs t (n, p) at the deviations z (k, m), NaN where there is none."""
        wide = spread_of(t)[:, self.owners]
        mean = mean_of(t)[:, self.owners]
        if self.formula is None:
            shift = (mean @ self.sensitivities)[:, None]
            return np.asarray(self.centre + shift + (wide * self.sensitivities) @ z)
        formula, mids, scale = self.stated
        reach, middle = wide * scale, mids + mean * scale
        names = [(i, name) for i, name in enumerate(self.names) if name in formula.names]
        x = {name: middle[:, i, None] + reach[:, i, None] * z[i] for i, name in names}
        return np.broadcast_to(self.gain * formula.value(x), (len(t), z.shape[1]))


# What the corners of the tolerances reach: the worst case, and the edge of the formula's domain.


CORNERS = 12
"""Pieces of a formula up to which all corners of the tolerance range are tested; with more pieces,
a sample of the corners."""
INNER = 4096
"""Points within the tolerance range that are tested on loading."""
INTERIOR_POINTS = 256
"""Points within the tolerances of each design that are tested in addition to its corners."""
MEMORY = 2**18
"""Values held for a block of designs."""


def box(pieces: int, inner: int = INNER) -> Array:
    """Corners of [-1, 1]^k and points between them, shape (k, m); the first is the middle."""
    sobol = 2.0 * scipy.stats.qmc.Sobol(pieces, scramble=False).random(INNER).T - 1.0
    if pieces <= CORNERS:
        corners = np.array(list(product((-1.0, 1.0), repeat=pieces))).T
    else:
        corners = np.where(sobol[:, 1:] > 0.0, 1.0, -1.0)
    return np.hstack([np.zeros((pieces, 1)), corners, sobol[:, :inner]])


def least_margin(mechanism: Mechanism, t: Tolerances) -> Array:
    """Least domain margin (n,) over the corners of the tolerances t (n, p), and points between.

    1 at tolerances of 0, 0 where a unit within the tolerances just reaches the edge, below 0 where
    such a unit has no value. See `models/expressions.py`.
    """
    if mechanism.formula is None:
        return np.full(len(t), np.inf)
    formula, mids, _ = mechanism.stated
    middle = {name: np.asarray(mids[i]) for i, name in enumerate(mechanism.names) if name in formula.names}
    margins = [np.empty(0)]
    for x in _corners(mechanism, t):
        shape = next(iter(x.values())).shape
        margins.append(np.broadcast_to(domain_margin(formula, x, middle), shape).min(axis=1))
    return np.concatenate(margins)


def worst_by_corners(mechanism: Mechanism, t: Tolerances) -> Array:
    """Largest deviation (n,) of y from its value at the mid-limits, over the corners of the
    tolerances t (n, p) and points between; of units for which y has a value.

    As `ends_by_corners`.
    """
    least, greatest = ends_by_corners(mechanism, t)
    return np.maximum(np.maximum(mechanism.centre - least, greatest - mechanism.centre), 0.0)


def ends_by_corners(mechanism: Mechanism, t: Tolerances) -> tuple[Array, Array]:
    """Least and greatest y (n,) over the corners of the tolerances t (n, p) and points between; of units
    for which y has a value. Exact where y is monotone in each piece while the others are held. Of more
    than `CORNERS` pieces those of `models/stack/extremes.py`.
    """
    formula, _, _ = mechanism.stated
    if sum(name in formula.names for name in mechanism.names) > CORNERS:
        from .extremes import extremes  # few formulas have as many parts

        ends = [extremes(mechanism, row)[:2] for row in limit_of(t)]
        by_side = np.array(ends).reshape(-1, 2)
        return by_side[:, 0], by_side[:, 1]
    least, greatest = [np.empty(0)], [np.empty(0)]
    for x in _corners(mechanism, t):
        y = mechanism.gain * formula.value(x)
        least.append(np.where(np.isfinite(y), y, np.inf).min(axis=1))
        greatest.append(np.where(np.isfinite(y), y, -np.inf).max(axis=1))
    return np.concatenate(least), np.concatenate(greatest)


def _corners(mechanism: Mechanism, t: Tolerances) -> Iterator[dict[str, Array]]:
    """Quantities (n, m) of the formula at `_points` of the tolerances t (n, p), in blocks of designs."""
    formula, mids, scale = mechanism.stated
    used = [i for i, name in enumerate(mechanism.names) if name in formula.names]
    z, reach = _points(mechanism, used), (limit_of(t)[:, mechanism.owners] * scale)[:, used]
    step = max(1, MEMORY // z.shape[1])
    for start in range(0, len(t), step):
        ends = reach[start : start + step]
        yield {mechanism.names[i]: mids[i] + ends[:, k, None] * z[k] for k, i in enumerate(used)}


def _points(mechanism: Mechanism, used: list[int]) -> Array:
    """Corners, the corners of the largest and least requirement, and some points between."""
    largest = np.sign(mechanism.sensitivities[used])[:, None]
    for disc in (disc for disc in mechanism.discs if set(disc.pieces) <= set(used)):
        largest[[used.index(piece) for piece in disc.pieces]] = 1.0
    return mechanism.rounded(np.hstack([box(len(used), INTERIOR_POINTS), largest, -largest]), used)


# The linearised stack: worst case, root sum square, mean shifts and contributions.


SIGMAS = 3.0
"""Standard deviations in a root-sum-square variation: t of a normal part with Cp = 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """y = centre + sum_i S_i t z_i by parts, per unit of tolerance.

    `worst` (p,) is sum |S_i| over the pieces of a part, `mean` (p,) the sum of S_i E[z_i], `shift`
    (p,) the sum of |S_i E[z_i]|, `covariance` (p, p) that of y's contributions at t = 1, `slope`
    (p,) the sum of S_i, by which y follows the mean of a part that is `AsMade`. All results are in
    the unit of the requirement; designs t have shape (n, p), and so have derivatives, which are by
    the spread of parts that are `AsMade`.
    """

    worst: Array
    mean: Array
    shift: Array
    covariance: Array
    slope: Array

    def worst_case(self, t: Tolerances) -> Array:
        """sum_i |S_i| t: no unit of parts within their zones deviates more."""
        return np.asarray(limit_of(t) @ self.worst)

    def variance(self, t: Tolerances) -> Array:
        """Variance of y (n,)."""
        s = spread_of(t)
        return np.asarray(np.sum((s @ self.covariance) * s, axis=1))

    def rss(self, t: Tolerances) -> Array:
        """Three standard deviations of y; for normal parts with Cp = 1 sqrt(sum (S_i t)^2)."""
        return SIGMAS * np.sqrt(np.maximum(self.variance(t), 0.0))

    def shifted_rss(self, t: Tolerances) -> Array:
        """Mean shifts in the worst direction plus the root sum square.

        sum |S_i| |E[x_i]| + rss, E[x_i] = t E[z_i]. Reference: Chase & Greenwood (1988), Design
        issues in mechanical tolerance analysis, Manufacturing Review 1(1), 50-59 (estimated mean
        shift), with Cp.
        """
        return spread_of(t) @ self.shift + np.abs(mean_of(t)) @ self.worst + self.rss(t)

    def mean_shift(self, t: Tolerances) -> Array:
        """Mean of y minus its value at the mid-limits (n,)."""
        return np.asarray(spread_of(t) @ self.mean + mean_of(t) @ self.slope)

    def rss_slopes(self, t: Tolerances) -> Array:
        """d rss / d t, shape (n, p); 0 where there is no spread at all."""
        rss = self.rss(t)[:, None]
        along = SIGMAS**2 * (spread_of(t) @ self.covariance)
        return np.divide(along, rss, out=np.zeros_like(along), where=rss > 0.0)

    def within(self, t: Tolerances, lower: float, upper: float) -> Array:
        """Fraction of units (n,) between limits of y minus its value at the mid-limits, as if y were normal."""
        std, shift = self.rss(t) / SIGMAS, self.mean_shift(t)
        safe = np.where(std > 0.0, std, 1e-300)
        return np.asarray(ndtr((upper - shift) / safe) - ndtr((lower - shift) / safe))

    def yield_slopes(self, t: Tolerances, lower: float, upper: float) -> Array:
        """d within/dt, shape (n, p)."""
        std = self.rss(t)[:, None] / SIGMAS
        safe, shift = np.where(std > 0.0, std, 1.0), self.mean_shift(t)[:, None]
        slopes = np.zeros_like(spread_of(t))
        for sign, limit in ((1.0, upper), (-1.0, lower)):
            if not np.isfinite(limit):
                continue
            z = (limit - shift) / safe
            density = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
            slopes -= sign * density * (self.mean + z * self.rss_slopes(t) / SIGMAS) / safe
        return np.where(std > 0.0, slopes, 0.0)

    def variance_shares(self, t: Tolerances) -> Array:
        """Fraction of each part in the variance (n, p); a negative fraction compensates others."""
        return fractions(spread_of(t) * (spread_of(t) @ self.covariance))

    def worst_shares(self, t: Tolerances) -> Array:
        """Fraction of each part in the worst case (n, p)."""
        return fractions(limit_of(t) * self.worst)


def fractions(contributions: Array) -> Array:
    """Fractions (n, p) that add up to 1, or are 0 where the total is 0."""
    total: Array = contributions.sum(axis=1)[:, None]
    return np.divide(contributions, total, out=np.zeros_like(contributions), where=total > 0.0)


def linear_model(mechanism: Mechanism) -> Linear:
    """The linear model about the mid-limits."""
    parts = np.arange(len(mechanism.inputs))
    moments = np.array([distribution.raw_moments(2) for distribution in mechanism.inputs])
    mean, std = moments[:, 1], np.sqrt(np.maximum(moments[:, 2] - moments[:, 1] ** 2, 0.0))
    owners, slope = mechanism.owners, mechanism.directed
    of_part = (owners == parts[:, None]).astype(float)
    pieces = len(owners)
    correlation = np.eye(pieces) if mechanism.correlation is None else mechanism.correlation
    scaled = of_part * (slope * std[owners])
    return Linear(
        worst=of_part @ np.abs(slope),
        mean=of_part @ (slope * mean[owners]),
        shift=of_part @ np.abs(slope * mean[owners]),
        covariance=scaled @ correlation @ scaled.T,
        slope=of_part @ slope,
    )


# The law of a linear stack of even deviations: yield and half-width without a sample.


ROUNDING = 1e-12
"""Least stated error of a yield [percent]."""


@dataclass(frozen=True, eq=False)
class Law:
    """y = centre + sum_i S_i t (mean_i + d_i) of k pieces, d_i independent, even and log-concave.

    `slopes` (k,) are |S_i|, `mean` (p,) the shift of the mean of y per unit of each tolerance.
    Where all parts are normal (`covariance`, p x p, at t = 1) pieces may be correlated.
    Tolerances t have shape (n, p); derivatives are by the spread of parts that are `AsMade`.
    """

    mechanism: Mechanism
    slopes: Array
    mean: Array
    deviations: SymmetricSum
    laws: tuple[Even, ...]
    covariance: Array | None = None

    def yield_percent(self, t: Tolerances) -> tuple[Array, Array]:
        """Fraction of units within the limits (n,), in percent, and a bound of its error (n,)."""
        ends = self._ends(t)
        if self.covariance is None:
            (_, high), (_, low) = ends
            yields, error = self.deviations.within(self._scales(t), low, high)
        else:
            yields, error = np.zeros(len(t)), np.zeros(len(t))
            for sign, end in ends:
                below, _, doubt = self._below(t, end)
                yields, error = yields + sign * below, error + doubt
        return 100.0 * np.clip(yields, 0.0, 1.0), 100.0 * error + ROUNDING

    def half_width(self, t: Tolerances, coverage: float) -> Array:
        """Half the width (n,) of the interval that holds `coverage` of the units, centred."""
        p = 0.5 * (1.0 + coverage)
        if self.covariance is not None:
            return np.asarray(float(ndtri(p)) * self._std(t))
        return self.deviations.values(self._scales(t), p)

    def half_width_slopes(self, t: Tolerances, coverage: float) -> Array:
        """d half_width/dt, (n, p)."""
        p = 0.5 * (1.0 + coverage)
        if self.covariance is not None:
            std = self._std(t)[:, None]
            return float(ndtri(p)) * (spread_of(t) @ self.covariance) / np.where(std > 0.0, std, 1.0)
        return self._to_parts(self.deviations.quantile(self._scales(t), p).gradient)

    def yield_slopes(self, t: Tolerances) -> Array:
        """d yield_percent/dt, (n, p)."""
        by_part = np.zeros_like(spread_of(t))
        for sign, end in self._ends(t):
            slopes = self._below(t, end)[1] - self.density(t, end)[:, None] * self.mean
            by_part += 100.0 * sign * np.where(np.isfinite(end)[:, None], slopes, 0.0)
        return by_part

    def density(self, t: Tolerances, at: Array) -> Array:
        """Density (n,) of y minus its mean."""
        if self.covariance is None:
            safe = np.where(np.isfinite(at), at, 0.0)
            return np.where(np.isfinite(at), self.deviations.density(self._scales(t), safe), 0.0)
        std = self._std(t)
        safe = np.where(std > 0.0, std, 1.0)
        bell = np.exp(-0.5 * (at / safe) ** 2) / (safe * np.sqrt(2.0 * np.pi))
        return np.where(std > 0.0, bell, 0.0)

    def edge_density(self, t: Tolerances) -> Array:
        """Density (n,) of y at its limits, both together."""
        return np.asarray(sum(self.density(t, end) for _, end in self._ends(t)))

    def _ends(self, t: Tolerances) -> list[tuple[float, Array]]:
        """Sign and distance (n,) of each limit from the mean of y."""
        slope = np.bincount(self.mechanism.owners, self.mechanism.sensitivities, len(self.mean))
        mean = self.mechanism.centre + spread_of(t) @ self.mean + mean_of(t) @ slope
        return [(1.0, self.mechanism.upper - mean), (-1.0, self.mechanism.lower - mean)]

    def _below(self, t: Tolerances, at: Array) -> tuple[Array, Array, Array]:
        """P(y - mean <= at), its derivatives in t by the spread alone, and its error."""
        if self.covariance is None:
            far = np.where(np.isfinite(at), at, 0.0)
            probability, slopes, error = self.deviations.below(self._scales(t), far)
            below = np.where(np.isfinite(at), probability, (at > 0.0).astype(float))
            return below, self._to_parts(slopes), np.where(np.isfinite(at), error, 0.0)
        std = self._std(t)
        safe = np.where(std > 0.0, std, 1.0)
        x = np.where(std > 0.0, at / safe, np.where(at >= 0.0, np.inf, -np.inf))
        level = np.where(np.isfinite(x), x, 0.0)
        bell = -level * np.exp(-0.5 * level**2) / np.sqrt(2.0 * np.pi)
        rise = (spread_of(t) @ self.covariance) / safe[:, None] ** 2
        return np.asarray(ndtr(x)), bell[:, None] * rise, np.zeros(len(t))

    def _std(self, t: Tolerances) -> Array:
        assert self.covariance is not None
        s = spread_of(t)
        return np.asarray(np.sqrt(np.maximum(np.sum((s @ self.covariance) * s, axis=1), 0.0)))

    def _scales(self, t: Tolerances) -> Array:
        return np.asarray(spread_of(t)[:, self.mechanism.owners] * self.slopes)

    def _to_parts(self, by_piece: Array) -> Array:
        """Derivatives in t (n, p) from those in the scales of the pieces (n, k)."""
        parts = np.arange(len(self.mechanism.inputs))
        owner = (self.mechanism.owners[:, None] == parts) * self.slopes[:, None]
        return np.asarray(by_piece @ owner)


def law_of(mechanism: Mechanism, covariance: Array) -> Law | str:
    """The law, or why there is none in closed form; `covariance` (p, p) is that of y at t = 1."""
    if mechanism.formula is not None and not mechanism.formula.linear:
        return "the formula is not linear"
    if mechanism.matches:
        return "parts are sorted and matched"
    mechanism = _relevant_pieces(mechanism)
    used = dict.fromkeys(mechanism.owner)
    even_laws = {}
    for at in used:
        law = even_law(mechanism.inputs[at])
        if law is None:
            return f"the deviations of {mechanism.names[mechanism.owner.index(at)]} are skewed or have poles"
        even_laws[at] = law
    normal = all(isinstance(mechanism.inputs[at], Normal) for at in used)
    if mechanism.correlation is not None and not normal:
        return "correlated deviations have no even law"
    owners = mechanism.owners
    parts = (owners == np.arange(len(mechanism.inputs))[:, None]).astype(float)
    mean = parts @ (mechanism.sensitivities * np.array([even_laws[at][0] for at in owners]))
    laws = tuple(even_laws[at][1] for at in owners)
    slopes = np.abs(mechanism.sensitivities)
    return Law(mechanism, slopes, mean, SymmetricSum(laws), laws, covariance if normal else None)


def _relevant_pieces(mechanism: Mechanism) -> Mechanism:
    """The mechanism with only the pieces that the requirement depends on."""
    used = np.flatnonzero(mechanism.directed)
    if len(used) == len(mechanism.owner):
        return mechanism
    correlation = mechanism.correlation
    return replace(
        mechanism,
        names=tuple(mechanism.names[i] for i in used),
        owner=tuple(mechanism.owner[i] for i in used),
        sensitivities=mechanism.directed[used],
        discs=(),
        mids=None if mechanism.mids is None else mechanism.mids[used],
        scale=None if mechanism.scale is None else mechanism.scale[used],
        correlation=None if correlation is None else correlation[np.ix_(used, used)],
    )


# The exact stack: yield and half-width by scrambled Sobol sampling of the requirement itself.


SAMPLING_MEMORY = 2**22
"""Bytes that the pieces of a block of designs may take."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Deviations z (replicates, k, m) that every design of every batch is built with."""

    deviations: Array

    @classmethod
    def draw(cls, mechanism: Mechanism, samples: int, rng: np.random.Generator) -> Sample:
        """A scrambled Sobol sample, in independent replicates (Owen 1997, Ann. Stat. 25(4)).

        Correlated pieces are normal: z = mean + std L g with L L' the correlation matrix. Dimensions
        belong to the names of the pieces, so that the order of the parts does not matter.
        """
        order = sorted(range(len(mechanism.owner)), key=lambda at: mechanism.names[at])
        kinds = [mechanism.inputs[mechanism.owner[at]] for at in order]
        correlation = mechanism.correlation
        root = None if correlation is None else root_of(correlation[np.ix_(order, order)])
        deviations = np.empty((REPLICATES, len(kinds), 2 ** power_of(samples)))
        # One replicate after the other: the points of all of them would double the memory.
        for replicate, uniform in zip(deviations, replicates(samples, len(kinds), rng), strict=True):
            points = uniform
            if root is not None:
                points = ndtr(np.clip(ndtri(uniform), -8.0, 8.0) @ root.T)
            for i, (at, kind) in enumerate(zip(order, kinds, strict=True)):
                replicate[at] = kind.quantile(points[:, i])
            for disc in (disc for disc in mechanism.discs if disc.dependent):
                pair = list(disc.pieces)
                replicate[pair] = disc.drawn(*(points[:, order.index(at)] for at in pair))
        return cls(deviations)

    @property
    def size(self) -> int:
        """Units in all."""
        return int(self.deviations[:, 0].size)

    def blocks(self, mechanism: Mechanism, t: Tolerances) -> Iterator[tuple[slice, Array]]:
        """Rows of a block of designs, and y (block, replicates, m) of all units of each."""
        _, pieces, units = self.deviations.shape
        wide = max(1, SAMPLING_MEMORY // (8 * max(self.size, (pieces + 6) * units)))
        for start in range(0, len(t), wide):
            chosen = slice(start, start + wide)
            if mechanism.matches:  # parts are sorted once for all units of a design
                z = np.moveaxis(self.deviations, 0, 1).reshape(pieces, -1)
                yield chosen, mechanism.built(t[chosen], z).reshape(-1, len(self.deviations), units)
                continue
            block = [mechanism.values(t[chosen], z) for z in self.deviations]
            yield chosen, np.stack(block, axis=1)


def root_of(correlation: Array) -> Array:
    """L with L L' = correlation, also where it is singular."""
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def yield_percent(mechanism: Mechanism, t: Tolerances, sample: Sample) -> tuple[Array, Array]:
    """Fraction of units within the limits (n,), in percent, and its standard error (n,).

    A unit for which the requirement has no value does not conform. The error follows from the
    scatter over the replicates, and is at least one unit of the sample.
    """
    return joint_yield_percent((mechanism,), t, sample)


def joint_yield_percent(mechanisms: Sequence[Mechanism], t: Tolerances, sample: Sample) -> tuple[Array, Array]:
    """`yield_percent` of the units that conform to all of several mechanisms."""
    yields, error = np.empty(len(t)), np.empty(len(t))
    for blocks in zip(*(sample.blocks(mechanism, t) for mechanism in mechanisms), strict=True):
        rows = blocks[0][0]
        within = [mechanism.conforms(y) for mechanism, (_, y) in zip(mechanisms, blocks, strict=True)]
        yields[rows], error[rows] = percent_of(np.logical_and.reduce(within))
    return yields, error


def percent_of(conforming: NDArray[np.bool_]) -> tuple[Array, Array]:
    """`yield_percent` of units (n, replicates, m) that conform or do not, and its standard error (n,)."""
    share, (replicates, units) = np.mean(conforming, axis=2), conforming.shape[1:]
    error = np.maximum(share.std(axis=1, ddof=1) / np.sqrt(replicates), 1.0 / (replicates * units))
    return 100.0 * share.mean(axis=1), 100.0 * error


def mean_and_deviation(mechanism: Mechanism, t: Tolerances, sample: Sample) -> tuple[Array, Array]:
    """Mean and standard deviation of y (n,), of the units for which it has a value; NaN where none has."""
    moments = np.empty((2, len(t)))
    for rows, y in sample.blocks(mechanism, t):
        moments[:, rows] = moments_of(y.reshape(len(y), -1))
    return moments[0], moments[1]


def moments_of(y: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (n,) of units y (n, m) that have a value; NaN where none has."""
    units = np.ma.masked_invalid(y)
    return units.mean(axis=1).filled(np.nan), units.std(axis=1).filled(np.nan)


def half_width(mechanism: Mechanism, t: Tolerances, sample: Sample, coverage: float) -> Array:
    """Half the width (n,) of the interval that holds `coverage` of the units, with equal tails.

    (q(1 - a/2) - q(a/2))/2 with a = 1 - coverage: for normal parts of a linear stack and a coverage
    of 0.9973 the root sum square. Units without a value are omitted: see `least_margin`. NaN where
    no unit has a value.
    """
    widths = np.empty(len(t))
    tail = 0.5 * (1.0 - coverage)
    for rows, y in sample.blocks(mechanism, t):
        units = y.reshape(len(y), -1)
        kind = np.quantile if np.all(np.isfinite(units)) else np.nanquantile
        ends = kind(units, [tail, 1.0 - tail], axis=1, method="median_unbiased")
        widths[rows] = 0.5 * (ends[1] - ends[0])
    return widths
