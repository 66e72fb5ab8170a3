"""The front of a reducer: least cost against the mean square of its backlash, grade by grade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Integers
from .block import Block
from .curve import PricedCurve
from .least import Least, least, lower_bound

PRICES = np.geomspace(1e-2, 3e3, 2000)
"""Prices of an arcmin^2, in units of the cost of one."""
STEPS = 5
"""Secant steps to a mean square: the curve knows the price to four digits already."""
FEW = 12
"""Passes from one price to the next of these steps: an error falls to 1e-6."""
APART = 1e-12
"""Relative distance of neighbouring root mean squares above which two allocations differ."""


@dataclass(frozen=True, eq=False)
class ReducerFront:
    """A proven front: a curve of cost per grade, and the allocations behind it."""

    block: Block
    curves: tuple[PricedCurve, ...]

    @classmethod
    def of(cls, block: Block) -> ReducerFront:
        """The front of a block, solved and proven at `PRICES`."""
        return cls(block, tuple(_curve(block, at) for at in range(len(block.grades))))

    @property
    def evaluations(self) -> int:
        """Prices that were solved."""
        return len(PRICES) * len(self.curves)

    def allocation(self, rms: Array, grade: Integers) -> Least:
        """The allocations (n,) of least cost at root mean squares [arcmin] in a grade each.

        By secants on the price.
        """
        wanted = np.asarray(rms, dtype=float) ** 2
        known = [float(self.curves[g].price_at(np.array([t]))[0]) for t, g in zip(rms, grade, strict=True)]
        x = np.log(np.clip(known, PRICES[0], PRICES[-1]))
        before = x - 1e-3
        made = least(self.block, np.exp(before), grade)
        missed = np.log(made.square / wanted)
        for _ in range(STEPS):
            made = least(self.block, np.exp(x), grade, made, FEW)
            now = np.log(made.square / wanted)
            rise = np.where(x != before, (now - missed) / np.where(x != before, x - before, 1.0), 0)
            step = np.where(rise < 0.0, -now / np.where(rise < 0.0, rise, -1.0), 0.0)
            before, missed, x = x, now, x + np.clip(step, -0.05, 0.05)
        return least(self.block, np.exp(x), grade, made, 2 * FEW)


def ends_of(block: Block) -> tuple[float, float]:
    """Least and largest rms [arcmin] of the front of a block, over all grades."""
    count = len(block.grades)
    prices, grade = np.repeat(PRICES[[0, -1]], count), np.tile(np.arange(count), 2)
    square = least(block, prices, grade).square
    return float(np.sqrt(square.min())), float(np.sqrt(square.max()))


def _curve(block: Block, at: int) -> PricedCurve:
    grade = np.full(len(PRICES), at)
    allocations = least(block, PRICES, grade)
    proven = lower_bound(block, PRICES, grade, allocations)
    order = np.argsort(PRICES)[::-1]  # the highest price has the least rms
    t = np.sqrt(allocations.square)[order]
    apart = np.append(True, np.diff(t) > APART * t[1:])
    kept = order[apart]
    return PricedCurve.of(
        np.sqrt(allocations.square)[kept],
        allocations.cost[kept],
        PRICES[kept],
        proven[kept],
        label=f"grade {block.grades[at]:g}",
    )
