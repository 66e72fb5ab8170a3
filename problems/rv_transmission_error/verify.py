"""The influence coefficients against the full model, at the units that set the quantile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...arrays import Array
from ...models.assembly.influence import Influence
from ...models.assembly.transmission import Transmission, Turned

SAMPLE = 2048
"""Units among which those nearest to the quantile are sought."""
UNITS = 4
"""Units at which the full model is asked, per design and output."""
ANGLES = 80
"""Crank angles of the period there: more than two for each of its 39 pin pitches."""
TOGETHER = 64
"""Designs whose units are drawn at once."""


def errors_percent(
    full: Transmission,
    coefficients: Influence,
    spread: Array,
    te: Array,
    force: Array,
    sources: Callable[[int, int], Array],
) -> tuple[Array, Array]:
    """By how much (n,) the quantiles `te` [rad] and `force` [N] of designs are overstated, in %.

    `spread` (n, 12, s) takes standardised sources, a sample of which `sources` draws by its size, to
    final angles [rad]. The full model less the
    coefficients is averaged over the `UNITS` units whose own value lies nearest to the quantile: to
    first order this is what the quantile of the full model differs by.
    """
    exact, sample = replace(full, angles=ANGLES), sources(SAMPLE, spread.shape[-1])
    return (
        _error(exact, exact.amplitude, coefficients.amplitude, spread, te, sample),
        _error(exact, exact.peak, coefficients.peak_force, spread, force, sample),
    )


def _error(
    full: Transmission,
    value: Callable[[Turned], Array],
    estimate: Callable[[Array], Array],
    spread: Array,
    quantile: Array,
    sample: Array,
) -> Array:
    parts = [slice(at, at + TOGETHER) for at in range(0, len(spread), TOGETHER)]
    units = np.concatenate([_nearest(estimate, sample @ np.swapaxes(spread[p], 1, 2), quantile[p]) for p in parts])
    exact = value(full.turn(units.reshape(-1, 4, 3))).reshape(len(spread), UNITS)
    more = np.mean(exact - estimate(units), axis=1)
    return np.asarray(-100.0 * more / (quantile + more))


def _nearest(estimate: Callable[[Array], Array], states: Array, quantile: Array) -> Array:
    """The `UNITS` of the states (n, units, 12) whose estimate lies nearest to the quantile."""
    distance = np.abs(estimate(states) - quantile[:, None])
    chosen = np.argpartition(distance, UNITS, axis=1)[:, :UNITS]
    return np.take_along_axis(states, chosen[..., None], axis=1)
