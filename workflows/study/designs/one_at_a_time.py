"""One at a time: every key through its levels, the others as in the run configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

from ....errors import Fault
from ..records import Design, Factor, Level
from .needs import column, level_faults


@dataclass(frozen=True, slots=True)
class OneAtATime(Design):
    """The documents' design. It shows no interaction, and the first point is the run as it is."""

    kind: ClassVar[str] = "one_at_a_time"
    analysis: ClassVar[str] = "one_at_a_time"

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        return level_faults(factors, self.kind)

    def size(self, factors: tuple[Factor, ...]) -> int:
        return 1 + sum(len(factor.grid()) for factor in factors)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        base_levels = {factor.key: base[factor.key] for factor in factors}
        varied = [
            base_levels | {factor.key: level}
            for factor in factors
            for level in factor.grid()
            if level != base[factor.key]
        ]
        return pd.DataFrame({key: column(row[key] for row in [base_levels, *varied]) for key in base_levels})
