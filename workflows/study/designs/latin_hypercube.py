"""Latin hypercube: every key in as many strata as there are settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.stats import qmc

from ....counts import SETTINGS
from ....errors import Fault
from ..records import Design, Factor, Level
from .needs import frame_of, replicate_faults, small


def terms(factors: tuple[Factor, ...]) -> int:
    """Terms of the analysis: a line and a curve for a range, one less than its levels for a list.

    Its last degree of freedom is the constant.
    """
    return 1 + sum(2 if factor.ranged else len(factor.levels) - 1 for factor in factors)


@dataclass(frozen=True, slots=True)
class LatinHypercube(Design):
    """`samples` settings that fill the space of the keys."""

    kind: ClassVar[str] = "latin_hypercube"
    samples: int = field(default=64, metadata={"low": 2, "need": SETTINGS})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small("samples", self.samples, 2 * terms(factors), "an analysis of variance needs twice its terms,")
        return issues + replicate_faults(seeds, "shares of variance")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.samples

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        return frame_of(factors, qmc.LatinHypercube(len(factors), rng=rng).random(self.samples))
