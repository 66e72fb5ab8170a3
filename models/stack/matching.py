"""Selective assembly: two parts are measured, sorted into classes, and matched class by class.

The zone of each part, -t to t about its mid-limit, is divided into k classes of equal width, of which the outermost
take whatever lies beyond. A part is sorted by its measured deviation t z + e, e ~ N(0, u^2). Units are built from parts
of like classes, as many of a class as there are of the rarer part; the rest are left over:

    built_c = min(P(a in c), P(b in c)),    left over = 1 - sum_c built_c.

References: Mansoor (1961), Selective assembly: its analysis and applications, Int. J. Production Research 1(1), 13-24;
Pugh (1986), Partitioning for selective assembly, Computers & Industrial Engineering 11(1-4), 175-179.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from ...section import Array
from ..inputs import Distribution

CELLS = 1024
"""Cells of z between whose edges a law counts as uniform."""
TAIL = 1e-12
"""Probability beyond the outermost edges."""
SHARE_ROUNDING = 1e-13
"""Difference up to which fractions of all parts are equal but for rounding."""


class Sorted(NamedTuple):
    """Parts of one kind by class: P(class) (k,), and P(z <= edge, class) (k, edges) at the edges of cells."""

    share: Array
    edges: Array
    below: Array


@lru_cache(maxsize=256)
def sort_parts(law: Distribution, classes: int, error: float) -> Sorted:
    """Parts of a law, measured with a standard deviation of `error`, in units of their half-width t."""
    inner = np.linspace(-1.0, 1.0, classes + 1)[1:-1]
    low, high = (float(z) for z in law.quantile(np.array([TAIL, 1.0 - TAIL])))
    edges = np.unique(np.concatenate([np.linspace(low, high, CELLS + 1), inner[(inner > low) & (inner < high)]]))
    cdf = np.asarray(law.partial_moments(edges)[0])
    cdf[0], cdf[-1] = 0.0, 1.0
    middle = 0.5 * (edges[1:] + edges[:-1])
    ends = np.concatenate([[-np.inf], inner, [np.inf]])[:, None] - middle
    beyond = ndtr(ends / error) if error > 0.0 else (ends > 0.0).astype(float)
    mass = np.diff(cdf) * np.diff(beyond, axis=0)
    below = np.concatenate([np.zeros((classes, 1)), np.cumsum(mass, axis=1)], axis=1)
    return Sorted(below[:, -1], edges, below)


@dataclass(frozen=True, slots=True)
class Matching:
    """Two pieces that are sorted into `classes` and matched, class by class.

    `pieces` are their places in a mechanism, `laws` those of z, `errors` the standard deviations of the measurement,
    each in the unit of its part.
    """

    pieces: tuple[int, int]
    laws: tuple[Distribution, Distribution]
    classes: int
    errors: tuple[float, float]

    def sorted(self, t: tuple[float, float]) -> tuple[Sorted, Sorted]:
        """Both kinds of parts by class, at half-widths t."""
        one, other = (
            sort_parts(law, self.classes, error / wide if wide > 0.0 else 0.0)
            for law, error, wide in zip(self.laws, self.errors, t, strict=True)
        )
        return one, other

    def left_over(self, t: tuple[float, float]) -> float:
        """Fraction of the parts of either kind for which there is no mate, where as many are made of both."""
        one, other = self.sorted(t)
        apart = np.abs(one.share - other.share)
        return 0.5 * float(np.sum(apart, where=apart > SHARE_ROUNDING))

    def matched(self, z: Array, t: tuple[float, float]) -> Array:
        """Deviations z (2, m) of independent parts, turned into those of the m units that are built.

        The first gives the class of a unit and the first part within it, the second the second part.
        """
        kinds = self.sorted(t)
        built = np.minimum(kinds[0].share, kinds[1].share)
        ends = np.concatenate([[0.0], np.cumsum(built)]) / built.sum()
        u, v = (np.asarray(law.partial_moments(row)[0]) for law, row in zip(self.laws, z, strict=True))
        at = np.clip(np.searchsorted(ends, u, side="right") - 1, 0, self.classes - 1)
        inside = (u - ends[at]) / np.maximum(ends[at + 1] - ends[at], 1e-300)
        units = np.empty_like(z)
        for number in np.unique(at):
            rows = at == number
            for piece, kind, place in zip(units, kinds, (inside, v), strict=True):
                piece[rows] = np.interp(place[rows] * kind.share[number], kind.below[number], kind.edges)
        return units
