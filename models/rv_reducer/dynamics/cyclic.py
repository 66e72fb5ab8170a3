"""Linear equations of a periodic oscillator: a u'' + d u' + k u = r over one turn, in batches.

u'' and u' by five-point differences of fourth order on n equal steps. The samples are folded (0,
n-1, 1, n-2, ...), which makes the cyclic matrix a banded one, and the points of a batch follow
each other in one banded matrix. Cutting the cycle instead (and correcting it by a low-rank
update) fails: an oscillator over a cut turn grows by exp(zeta omega_n t).
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ....arrays import Array

SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
BAND = 4
"""Half-width of the folded band."""


def second_symbol(angle: Array) -> Array:
    """-u''/u of the differences for waves of `angle` [rad] per step; exact: angle^2."""
    return np.asarray((30.0 - 32.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle)) / 12.0)


def solve(inertia: Array, damping: Array, stiffness: Array, right: Array) -> Array:
    """u (b, n) for a (b,), d (b,), k (b, n) and r (b, n); n even."""
    count, n = right.shape
    step = 2.0 * np.pi / n
    stencil = SECOND * inertia[:, None] / step**2 + FIRST * damping[:, None] / step
    folded, place = _folding(n)
    band = np.zeros((2 * BAND + 1, count, n))
    for offset in range(-2, 3):
        column = place[(np.arange(n) + offset) % n]
        band[BAND + place - column, :, column] = stencil[:, offset + 2]
    band[BAND] += stiffness[:, folded]
    flat = scipy.linalg.solve_banded(
        (BAND, BAND),
        band.reshape(2 * BAND + 1, count * n),
        right[:, folded].reshape(count * n),
        overwrite_ab=True,
        overwrite_b=True,
        check_finite=False,
    )
    return np.asarray(flat.reshape(count, n)[:, place])


def _folding(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The samples in folded order, and the place of every sample in it."""
    folded = np.empty(n, dtype=np.int64)
    folded[0::2] = np.arange(n // 2)
    folded[1::2] = np.arange(n - 1, n // 2 - 1, -1)
    place = np.empty(n, dtype=np.int64)
    place[folded] = np.arange(n)
    return folded, place
