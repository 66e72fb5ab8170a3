"""Full factorial: every level of every key with every level of the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import ClassVar

import numpy as np
import pandas as pd

from ....counts import is_forced
from ....errors import Fault
from ..records import Design, Factor, Level
from .needs import column, level_faults, replicate_faults

MOST = 100_000
"""Settings at most; more are probably a mistake."""


@dataclass(frozen=True, slots=True)
class Factorial(Design):
    """All combinations, the last key fastest."""

    kind: ClassVar[str] = "factorial"
    analysis: ClassVar[str] = "factorial"

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = level_faults(factors, self.kind)
        count = self.size(factors)
        if count > MOST and not is_forced():
            text = f"has {count} settings, {MOST} at most: give fewer levels, use sobol, or add --force"
            issues.append(Fault("kind", text))
        return issues + replicate_faults(seeds, "shares of variance")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return prod(len(factor.grid()) or 1 for factor in factors)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        rows = list(product(*(factor.grid() for factor in factors)))
        columns = zip(factors, zip(*rows, strict=True), strict=True)
        return pd.DataFrame({factor.key: column(values) for factor, values in columns})
