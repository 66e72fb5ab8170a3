"""Statistics that distinguish batches of units: location, spread, shape, mixture, trend, lots.

Every statistic maps batches (b, n), units in the order of production, to (b,).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ....arrays import Array
from ....models.effects.population.law import Law
from ..distance import likelier

Statistic = Callable[[Array], Array]
LEAST_UNITS = 3
"""Number of units of a lot from which its mean is compared with others."""
STEPS = (-3.5, -2.5, -1.8, 1.8, 2.5, 3.5)
SHARES = (0.1, 0.25, 0.5)
"""Offsets, in standard deviations of one supplier, and fractions of second suppliers that are
tried.
"""
LATTICE = np.linspace(-8.0, 8.0, 1025)
NORMAL = Law(-8.0, 1.0 / 64.0, -0.5 * LATTICE**2, 1.0)
"""Up to a constant, which cancels in ratios."""


@dataclass(frozen=True)
class Look:
    """A statistic: its aspect, its name, its unit, and whether it has a sign.

    A `signed` statistic has an interval; others are never negative, and positive by chance alone.
    """

    aspect: str
    name: str
    unit: str
    of: Statistic
    signed: bool = True


def along(order: Array) -> Statistic:
    """Change from the first unit to the last one, by least squares on their `order` (n,)."""
    centred = order - order.mean()
    size = float(centred @ centred)
    weight = centred * (np.ptp(order) / size) if size > 0.0 else centred
    return lambda x: np.asarray(x @ weight)


def unlike(quantiles: Array) -> Statistic:
    """Distance from a population with these `quantiles` (n,) once mean and scatter are the same.

    In standard deviations: the 2-Wasserstein distance after standardisation.
    """
    wanted = (quantiles - quantiles.mean()) / quantiles.std()

    def distance(x: Array) -> Array:
        scaled = (x - x.mean(axis=1, keepdims=True)) / x.std(axis=1, keepdims=True)
        return np.asarray(np.sqrt(np.mean((np.sort(scaled, axis=1) - wanted) ** 2, axis=1)))

    return distance


def between_lots(of_lot: NDArray[np.int64]) -> Statistic | None:
    """The F ratio of the means of lots, by the number (n,) of each unit's lot; None without two lots
    of enough units.
    """
    counts = np.bincount(of_lot)
    large_lots = np.flatnonzero(counts >= LEAST_UNITS)
    if len(large_lots) < 2:
        return None
    kept = np.isin(of_lot, large_lots)
    indicator = (of_lot[kept][:, None] == large_lots).astype(float)
    sizes = indicator.sum(axis=0)

    def ratio(x: Array) -> Array:
        part = x[:, kept]
        means = part @ indicator / sizes
        between = (sizes * (means - part.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
        within = ((part - means @ indicator.T) ** 2).sum(axis=1)
        return np.asarray(between / (len(large_lots) - 1) / (within / (sizes.sum() - len(large_lots))))

    return ratio


def two_of(law: Law = NORMAL) -> Statistic:
    """Twice the log likelihood ratio of two suppliers to one, for equal mean and scatter.

    `law` is that of one supplier about its mean. The best of a few fixed mixtures counts: its
    distribution by chance is simulated.
    """
    single, steps = law.standardised(LATTICE), law.std * np.array(STEPS)
    ratios = np.array([law.mixed(by, p).standardised(LATTICE, p * by) - single for by in steps for p in SHARES])

    def gain(x: Array) -> Array:
        about = (x - x.mean(axis=1, keepdims=True)) / x.std(axis=1, keepdims=True)
        return likelier(about, NORMAL.low, NORMAL.step, ratios)

    return gain


def looks_of(
    unit: str,
    order: Array,
    mixture: Statistic | None = None,
    shape: Statistic | None = None,
    lots: Statistic | None = None,
) -> tuple[Look, ...]:
    """All statistics of one output, without those that are None."""
    looks = (
        Look("location", "mean", unit, lambda x: np.asarray(x.mean(axis=1))),
        Look("location", "median", unit, lambda x: np.asarray(np.median(x, axis=1))),
        Look("spread", "standard deviation", unit, lambda x: np.asarray(x.std(axis=1, ddof=1))),
        Look("shape", "skewness", "", lambda x: np.asarray(scipy.stats.skew(x, axis=1))),
        Look("shape", "kurtosis", "", lambda x: np.asarray(scipy.stats.kurtosis(x, axis=1))),
        shape and Look("shape", "distance of shapes", "", shape, signed=False),
        mixture and Look("mixture", "two suppliers", "", mixture, signed=False),
        Look("trend", "first to last unit", unit, along(order)),
        lots and Look("lots", "scatter of lots", "", lots, signed=False),
    )
    return tuple(look for look in looks if look is not None)


def values_of(looks: tuple[Look, ...], x: Array) -> dict[str, Array]:
    """Every statistic of batches (b, n), by name."""
    return {look.name: look.of(x) for look in looks}
