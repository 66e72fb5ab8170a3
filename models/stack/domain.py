"""What the corners of the tolerances reach: the worst case, and the edge of the formula's domain."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
import scipy

from ...arrays import Array
from ..expressions import domain_margin
from .made import Tolerances, limit_of
from .mechanism import Mechanism

CORNERS = 12
"""Pieces of a formula up to which all corners of the tolerance range are tested; with more pieces,
a sample of the corners."""
INNER = 4096
"""Points within the tolerance range that are tested on loading."""
FEW = 256
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
    such a unit has no value. See `models/expressions/domain.py`.
    """
    formula, mids, scale = mechanism.formula, mechanism.mids, mechanism.scale
    if formula is None or mids is None or scale is None:
        return np.full(len(t), np.inf)
    middle = {name: np.asarray(mids[i]) for i, name in enumerate(mechanism.names) if name in formula.names}
    margins = [np.empty(0)]
    for x in _corners(mechanism, t):
        shape = next(iter(x.values())).shape
        margins.append(np.broadcast_to(domain_margin(formula, x, middle), shape).min(axis=1))
    return np.concatenate(margins)


def worst_by_corners(mechanism: Mechanism, t: Tolerances) -> Array:
    """Largest deviation (n,) of y from its value at the mid-limits, over the corners of the
    tolerances t (n, p) and points between; of units for which y has a value.

    Exact where y is monotone in each piece while the others are held.
    """
    assert mechanism.formula is not None
    worst = [np.empty(0)]
    for x in _corners(mechanism, t):
        deviations = np.abs(mechanism.gain * mechanism.formula.value(x) - mechanism.centre)
        worst.append(np.where(np.isfinite(deviations), deviations, 0.0).max(axis=1))
    return np.concatenate(worst)


def _corners(mechanism: Mechanism, t: Tolerances) -> Iterator[dict[str, Array]]:
    """Quantities (n, m) of the formula at `_points` of the tolerances t (n, p), in blocks of designs."""
    formula, mids, scale = mechanism.formula, mechanism.mids, mechanism.scale
    assert formula is not None and mids is not None and scale is not None
    used = [i for i, name in enumerate(mechanism.names) if name in formula.names]
    z, reach = _points(mechanism, used), (limit_of(t)[:, mechanism.owners] * scale)[:, used]
    step = max(1, MEMORY // z.shape[1])
    for start in range(0, len(t), step):
        ends = reach[start : start + step]
        yield {mechanism.names[i]: mids[i] + ends[:, k, None] * z[k] for k, i in enumerate(used)}


def _points(mechanism: Mechanism, used: list[int]) -> Array:
    """Corners, the corners of the largest and least requirement, and some points between."""
    largest = np.sign(mechanism.sensitivities[used])[:, None]
    return np.hstack([box(len(used), FEW), largest, -largest])
