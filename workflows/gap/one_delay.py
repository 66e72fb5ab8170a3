"""Test of a delay: a true one shifts rising and falling, high and low rows by the same time.

An effect that opens or rounds a loop differently for growing and falling load looks like a delay
that differs there. The delay is estimated in each of the four kinds of rows, all else fitted with
it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import special

from ...arrays import Array
from ...models.effects.instrument.delay import Delay
from .close import widened
from .data import GapData
from .fit import Fit, Fitter, Member
from .linear import projected_out

STEP = 1e-2
"""Relative step of a derivative."""
CHANCE = 0.01
"""Probability that a single delay is taken for several."""
LITTLE = 1e-6
"""Fraction of the squares of all rows below which a kind of rows carries no information."""
APART = 0.15
"""Rms difference of the delays from their mean, as a fraction of it, from which a note is given."""
STRETCHES = 40
"""Stretches of the record, the clusters of the residual."""


def uneven_delays(fitter: Fitter, fit: Fit, data: GapData) -> list[str]:
    """Sentences about delays that are not the same throughout the record."""
    sentences = []
    for at, member in enumerate(fit.members):
        if not isinstance(member.candidate.effect, Delay):
            continue
        q = fitter.spanned(fit.without(at))
        for name, late in member.shape.items():
            if late != 0.0 and (delays := _uneven(fitter, fit, q, member, name, data)) is not None:
                sentences.append(_sentence(name, delays))
    return sentences


def _sentence(name: str, delays: Array) -> str:
    kinds = ("rise above the median", "fall above it", "rise below it", "fall below it")
    pairs = zip(delays.tolist(), kinds, strict=True)
    parts = ", ".join(f"{delay:.3g} s where measurements {kind}" for delay, kind in pairs)
    return (
        f"{name} differs between kinds of rows: {parts}. A late channel is equally late everywhere; "
        "this may be an unidentified part of the loop"
    )


def _uneven(fitter: Fitter, fit: Fit, q: Array, member: Member, name: str, data: GapData) -> Array | None:
    """The delays (4,) of each kind of rows; None where they may be the same.

    Wald's test of equal delays. Their covariance is the larger of two: white noise at the level of
    the residual, and the residual itself by stretches (Liang and Zeger 1986).
    """
    late = member.shape[name]
    ends = [{**member.shape, name: late * (1.0 + sign * STEP)} for sign in (1.0, -1.0)]
    longer, shorter = (fitter.columns.of(member.candidate, shape)[:, 0] for shape in ends)
    slope = (longer - shorter) / (2.0 * STEP * late)
    parts = [fitter.space.whiten(np.where(kind, slope, 0.0)) for kind in _kinds(slope, data).T]
    g = projected_out(np.column_stack(parts), q)
    if (np.sum(g**2, axis=0) < LITTLE * np.sum(g**2)).any():
        return None
    corrections, covariance = _estimated(g, fit.residual)
    contrast = np.eye(len(corrections))[1:] - np.eye(len(corrections))[0]
    differences = contrast @ corrections
    spread = contrast @ covariance @ contrast.T
    statistic = float(differences @ np.linalg.solve(spread, differences)) / len(differences)
    weights = np.sum(g**2, axis=0) / np.sum(g**2)
    scatter = np.sqrt(float(weights @ (corrections - weights @ corrections) ** 2))
    limit = float(special.fdtri(len(differences), STRETCHES - 1, 1.0 - CHANCE))
    return late + corrections if statistic > limit and scatter > APART * abs(late) else None


def _kinds(slope: Array, data: GapData) -> Array:
    """Rows (N, 4) that are high or low and rise or fall: what rises, falls with its delay."""
    measured = data.stacked(data.measured)
    kinds = np.zeros((len(slope), 4), dtype=bool)
    for at in range(len(data.outputs)):
        rows = data.rows_of(at)
        high = measured[rows] > np.median(measured[rows])
        up, down = slope[rows] < 0.0, slope[rows] > 0.0
        kinds[rows] = np.column_stack([high & up, high & down, ~high & up, ~high & down])
    return kinds


def _estimated(g: Array, residual: Array) -> tuple[Array, Array]:
    """Least squares of columns (N, 4) on a residual (N,): coefficients and their covariance."""
    inverse = np.linalg.pinv(g.T @ g, rcond=1e-12)
    coefficients = inverse @ (g.T @ residual)
    rest = residual - g @ coefficients
    edges = np.linspace(0, len(residual), STRETCHES + 1).astype(int)
    sums = np.array([g[a:b].T @ rest[a:b] for a, b in pairwise(edges)])
    white_noise = inverse * float(rest @ rest) / len(rest)
    return coefficients, widened(white_noise, inverse @ (sums.T @ sums) @ inverse)
