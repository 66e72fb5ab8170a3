"""Morris: trajectories through a grid that change one key at each step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pandas as pd

from ....counts import SETTINGS
from ....errors import Fault
from ..records import Design, Factor, Level
from .needs import frame_of, replicate_faults, small, unit_cube

LEAST = 10
"""Trajectories from which on the intervals of the statistics are reliable."""
SHARE = "_share_"
"""Prefix of the columns that hold the place in the grid, in [0, 1]."""


@dataclass(frozen=True, slots=True)
class Morris(Design):
    """Elementary effects (Morris 1991) along `trajectories` of one setting more than keys."""

    kind: ClassVar[str] = "morris"
    analysis: ClassVar[str] = "morris"
    trajectories: int = field(default=20, metadata={"low": 1, "need": SETTINGS})
    levels: int = field(default=4, metadata={"low": 2})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small("trajectories", self.trajectories, LEAST, "intervals of elementary effects need")
        if self.levels % 2:
            issues.append(Fault("levels", f"is {self.levels}: steps of half the grid need an even number of levels"))
        return issues + replicate_faults(seeds, "elementary effects")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.trajectories * (len(factors) + 1)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        """Columns `_share_<key>` hold the place of each key in the grid."""
        from SALib.sample.morris import sample

        # A generator: SALib takes the seed 0 for none.
        shares = sample(unit_cube(factors), self.trajectories, num_levels=self.levels, seed=rng)
        named = pd.DataFrame(shares, columns=[SHARE + factor.key for factor in factors])
        return frame_of(factors, self._places(factors, shares)).join(named)

    def _places(self, factors: tuple[Factor, ...], shares: np.ndarray) -> np.ndarray:
        """Ranges keep both ends; a list is entered in the middle of each step, so none is rare."""
        middles = (np.rint(shares * (self.levels - 1)) + 0.5) / self.levels
        return np.where([factor.ranged for factor in factors], shares, middles)
