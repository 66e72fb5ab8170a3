"""Even, log-concave laws that lie below skewed ones at every level.

Where c + D <= Z level by level, D even and log-concave, a sum with Z exceeds a limit in no fewer units than one with
c + D in its place (stochastic order; Shaked & Shanthikumar 2007, Stochastic Orders, theorem 1.A.3), whatever the rest.
The quantile of that sum is convex in the tolerances (`symmetric_sum`). Most of what exceeds a limit comes of the upper
half of Z: c is its median where the other half reaches less far down than the upper one does up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import exprel

from ...section import Array
from ..inputs import Distribution
from .convolution import MAX_SERIES_ARGUMENT, Even, power_envelope

NODES = 12
"""Nodes of Gauss and Legendre for the moments of a piece of a density."""


@dataclass(frozen=True)
class EvenPieces(Even):
    """A density that is even, and above 0 exponential between `knots` (k,), the first of which is 0.

    `heights` (k,) are its values there; they fall, and their logarithm is concave. It is 0 beyond the last knot.
    """

    knots: tuple[float, ...]
    heights: tuple[float, ...]

    @classmethod
    def over(cls, x: Array, height: Array) -> EvenPieces:
        """The law of a density proportional to heights (k,) > 0 at x (k,), which begin at 0; raised as little as
        needed to fall, and to fall ever faster.
        """
        raised, kept = np.log(np.maximum.accumulate(height[::-1])[::-1]), [0]
        while (at := kept[-1]) < len(x) - 1:  # the upper hull: the least steep chord from each vertex
            kept.append(at + 1 + int(np.argmax((raised[at + 1 :] - raised[at]) / (x[at + 1 :] - x[at]))))
        law = cls(tuple(x[kept].tolist()), tuple(np.exp(raised[kept] - raised[0]).tolist()))
        return cls(law.knots, tuple((np.array(law.heights) / (2.0 * law._masses.sum())).tolist()))

    def scaled(self, by: float) -> EvenPieces:
        """The law of z times a factor."""
        return EvenPieces(tuple(by * knot for knot in self.knots), tuple(height / by for height in self.heights))

    @property
    def reach(self) -> float:  # type: ignore[override]
        return self.knots[-1]

    @cached_property
    def _falls(self) -> Array:
        """Slope (k - 1,) of the logarithm of the density in each piece."""
        return np.asarray(np.diff(np.log(self.heights)) / np.diff(self.knots))

    @cached_property
    def _masses(self) -> Array:
        """Mass (k - 1,) of each piece."""
        width = np.diff(self.knots)
        return np.asarray(np.array(self.heights[:-1]) * width * exprel(self._falls * width))

    @cached_property
    def _moments(self) -> tuple[float, float]:
        """E z^2 and E z^4."""
        node, weight = np.polynomial.legendre.leggauss(NODES)
        width = np.diff(self.knots)[:, None]
        along = 0.5 * (1.0 + node) * width
        mass = width * weight * np.array(self.heights[:-1])[:, None] * np.exp(self._falls[:, None] * along)
        square = (np.array(self.knots[:-1])[:, None] + along) ** 2
        return float(np.sum(mass * square)), float(np.sum(mass * square**2))

    @property
    def std(self) -> float:
        return float(np.sqrt(self._moments[0]))

    def quantiles(self, probability: Array) -> Array:
        """z (n,) at levels (n,)."""
        above, ends = np.abs(probability - 0.5), np.concatenate([[0.0], np.cumsum(self._masses)])
        piece = np.clip(np.searchsorted(ends, above, side="right") - 1, 0, len(self._masses) - 1)
        flat_way = np.maximum(above - ends[piece], 0.0) / np.array(self.heights)[piece]
        exponent = np.maximum(self._falls[piece] * flat_way, -1.0 + 1e-15)
        safe = np.where(np.abs(exponent) < 1e-12, 1.0, exponent)
        way = np.where(safe == exponent, flat_way * np.log1p(safe) / safe, flat_way)
        return np.asarray(np.sign(probability - 0.5) * np.minimum(np.array(self.knots)[piece] + way, self.reach))

    def quantile(self, probability: float) -> float:
        return float(self.quantiles(np.array([probability]))[0])

    def characteristic(self, w: Array) -> tuple[Array, Array]:
        second, fourth = self._moments
        turn = 1j * np.maximum(np.abs(w), MAX_SERIES_ARGUMENT)
        rate = 1.0 / (self._falls[0] + turn)
        total = -self.heights[0] * rate
        slope = -total * rate
        for at in range(1, len(self.knots)):  # a knot ends a piece and begins the next
            wave = self.heights[at] * np.exp(self.knots[at] * turn)
            following = 1.0 / (self._falls[at] + turn) if at < len(self._falls) else np.zeros_like(rate)
            step = rate - following
            total += wave * step
            slope += wave * step * (self.knots[at] - rate - following)
            rate = following
        near, square = np.abs(w) < MAX_SERIES_ARGUMENT, w * w
        value = np.where(near, 1.0 - square * (0.5 * second - square * fourth / 24.0), 2.0 * total.real)
        small = w * (square * fourth / 6.0 - second)
        return value, np.where(near, small, -2.0 * np.sign(w) * slope.imag)

    def envelope(self, w: Array) -> tuple[Array, Array]:
        return power_envelope(2.0 * self.heights[0], 1.0, w)

    def slope_envelope(self, w: Array) -> tuple[Array, Array]:
        most = float(np.max(np.multiply(self.knots[1:], self.heights[:-1])))  # of z times the density
        bound, order = power_envelope(4.0 * most / self.reach, 1.0, w)
        return self.reach * bound, order


CENTRES = (0.5, *(0.5 - np.geomspace(0.001, 0.48, 24)), 0.0)
"""Levels of a law that are tried as the centre of the even one."""
PLACES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 0.975, 0.992, 0.999)
"""Fractions of the units above the centre up to which a density is taken over."""
LOST, COMPARED = 1e-7, 6000
"""Fraction of the units at either end of a law that are not compared, and the number of levels at which others are."""
NARROW = 1e-3
"""Half-width of a law below all units, as a fraction of their range."""
ROUNDING = 1e-9
"""Error of quantiles, as a fraction of their range."""
COUNTS = 0.5
"""What a standard deviation of a part counts against its mean: of ten alike, at 99 to 99.9 % of the units."""


@lru_cache(maxsize=256)
def even_law_below(law: Distribution, side: float = 1.0) -> tuple[float, EvenPieces]:
    """Centre c and law D of c + D below z (`side` = 1) or -z (-1), at all levels but the last `LOST` at either end.

    The quantile of c + D at each level is not above that of z at the level before: so it is not between them.
    """
    edge = np.geomspace(LOST, 0.01, COMPARED // 6)
    levels = np.concatenate([edge[:-1], np.linspace(0.01, 0.99, 1 + COMPARED // 3 * 2), 1.0 - edge[-2::-1]])
    known = law.quantile(levels) if side > 0.0 else -law.quantile(1.0 - levels)
    size = float(np.ptp(known))
    known = known - ROUNDING * size
    density = np.gradient(levels) / np.maximum(np.gradient(known), ROUNDING * size)
    tried = [_law_about(float(known[at]), levels, known, density) for at in _places_of_centres(levels)]
    # where many units are alike, no law about a level is below all others: one below the least of them is
    narrow = NARROW * max(size, 1e-9)
    tried.append((float(known[0]) - narrow, EvenPieces.over(np.array([0.0, narrow]), np.ones(2))))
    return max((pair for pair in tried if pair is not None), key=lambda pair: pair[0] + COUNTS * pair[1].std)


def _places_of_centres(levels: Array) -> list[int]:
    """Places of the levels of `CENTRES` among sorted ones, below the middle."""
    return sorted({min(int(at), len(levels) // 2 - 1) for at in np.searchsorted(levels, CENTRES)})


def _law_about(centre: float, levels: Array, known: Array, density: Array) -> tuple[float, EvenPieces] | None:
    """The centre, and the widest law about it whose upper half is shaped like that of a law with quantiles `known` (n,)
    and a `density` (n,) at levels (n,). None where no scale of it lies below.
    """
    at = float(np.interp(centre, known, levels))
    places = at + (levels[-1] - at) * np.array(PLACES)
    x, first = np.unique(np.interp(places, levels, known) - centre, return_index=True)
    if len(x) < 2 or x[0] < 0.0:
        return None
    law = EvenPieces.over(x - x[0], np.interp(places[first], levels, density))
    own, room = law.quantiles(levels[1:]), known[:-1] - centre
    above, below = own > 0.0, own < 0.0
    most = min(float(np.min(room[above] / own[above])), (known[-1] - centre) / law.reach)
    least = max(0.0, float(np.max(room[below] / own[below])))
    return (centre, law.scaled(most)) if most > 0.0 and least <= most else None
