"""Units drawn at random, stage by stage: a Monte Carlo of the whole reducer in parts.

The draws and their sum are those of the model `rv_batch`; here the three stages stay separate, and
only the statistics of a part are kept, so that memory does not grow with the units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ..propagation import ClippedSum
from ..propagation.power_sums import PowerSums
from .batch import PART, summed


@dataclass(frozen=True, slots=True, eq=False)
class Units:
    """phi_1, phi_2 (below 0: interference) and phi_3 of units [rad], each (n,)."""

    phi_1: Array
    phi_2: Array
    phi_3: Array

    @property
    def effective(self) -> Array:
        """phi_1 + max(0, phi_2) + phi_3 [rad], (n,)."""
        backlash = np.maximum(self.phi_2, 0.0)
        backlash += self.phi_1
        backlash += self.phi_3
        return backlash


def units(total: ClippedSum, count: int, rng: np.random.Generator) -> Iterator[Units]:
    """`count` units of one design, in parts; `total` is that of `BacklashModel.total`."""
    split = len(total.clipped)
    z = np.empty((split + 2, min(PART, count)))
    for start in range(0, count, PART):
        z = z if count - start >= PART else np.empty((split + 2, count - start))
        rng.random(out=z)
        first, third = (summed((term,), z[split + i :][:1]) for i, term in enumerate(total.free))
        yield Units(first, summed(total.clipped, z[:split]), third)


@dataclass(frozen=True, slots=True)
class Batch:
    """Statistics of the units of a batch: sums of powers [rad^k], counts, and a histogram.

    `sums` are of phi_1, phi_2, phi_3 and backlash (effective); `conforming` units keep the limit,
    `interfering` units have phi_2 < 0; `counts` are the units between consecutive edges [rad], the
    outermost with those beyond the edges.
    """

    sums: Mapping[str, PowerSums]
    conforming: int
    interfering: int
    least: float
    most: float
    edges: Array
    counts: NDArray[np.int64]

    @property
    def units(self) -> int:
        """Number of units."""
        return self.sums["backlash"].count


def batch(total: ClippedSum, count: int, limit: float, edges: Array, rng: np.random.Generator) -> Batch:
    """Statistics of `count` >= 1 units against a backlash limit [rad]; the edges evenly spaced."""
    about = {"phi_1": total.free[0], "phi_3": total.free[1]}
    centres = {name: float(term.cumulants()[0][0]) for name, term in about.items()}
    centres["phi_2"] = float(sum(term.cumulants()[0][0] for term in total.clipped))
    centres["backlash"] = centres["phi_1"] + max(centres["phi_2"], 0.0) + centres["phi_3"]
    sums = {name: PowerSums(0, centre) for name, centre in centres.items()}
    counts = np.zeros(len(edges) - 1, dtype=np.int64)
    conforming = interfering = 0
    least, most = np.inf, -np.inf
    for part in units(total, count, rng):
        backlash = part.effective
        columns = {"phi_1": part.phi_1, "phi_2": part.phi_2, "phi_3": part.phi_3}
        for name, values in (columns | {"backlash": backlash}).items():
            sums[name] = sums[name].with_values(values)
        conforming += int(np.count_nonzero(backlash <= limit))
        interfering += int(np.count_nonzero(part.phi_2 < 0.0))
        least, most = min(least, float(backlash.min())), max(most, float(backlash.max()))
        counts += _counted(backlash, edges)
    return Batch(sums, conforming, interfering, least, most, edges, counts)


def _counted(values: Array, edges: Array) -> NDArray[np.int64]:
    """Numbers of values between evenly spaced edges, the outermost with those beyond the edges."""
    bins = len(edges) - 1
    at = (values - edges[0]) * (bins / (edges[-1] - edges[0]))
    np.clip(at, 0.0, bins - 1, out=at)
    return np.bincount(at.astype(np.int64), minlength=bins)
