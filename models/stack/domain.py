"""Distance of the designs of a stack from the edge of the domain of its requirement."""

from __future__ import annotations

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
    used = [i for i, name in enumerate(mechanism.names) if name in formula.names]
    names = [mechanism.names[i] for i in used]
    z, reach = _points(mechanism, used), (limit_of(t)[:, mechanism.owners] * scale)[:, used]
    middle = {name: np.asarray(mids[i]) for name, i in zip(names, used, strict=True)}
    margins, step = np.empty(len(t)), max(1, MEMORY // z.shape[1])
    for start in range(0, len(t), step):
        ends = reach[start : start + step]
        x = {name: middle[name] + ends[:, k, None] * z[k] for k, name in enumerate(names)}
        margin = domain_margin(formula, x, middle)
        margins[start : start + step] = np.broadcast_to(margin, (len(ends), z.shape[1])).min(axis=1)
    return margins


def _points(mechanism: Mechanism, used: list[int]) -> Array:
    """Corners, the corners of the largest and least requirement, and some points between."""
    largest = np.sign(mechanism.sensitivities[used])[:, None]
    return np.hstack([box(len(used), FEW), largest, -largest])
