"""Sobol: Saltelli's pairs of samples, from which shares of variance are estimated."""

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

LEAST = 128
"""Base samples from which on the intervals of the indices are reliable."""

PARTS = 8


@dataclass(frozen=True, slots=True)
class Sobol(Design):
    """`samples` blocks of A, A with one key from B for every key, and B (Saltelli et al. 2010).

    They are `PARTS` Sobol sequences of equal length, each scrambled by itself: the scatter of the
    estimates between them shows the precision of the whole.
    """

    kind: ClassVar[str] = "sobol"
    analysis: ClassVar[str] = "sobol"
    samples: int = field(default=128, metadata={"low": 1, "need": SETTINGS})

    def faults(self, factors: tuple[Factor, ...], seeds: int) -> list[Fault]:
        issues = small("samples", self.samples, LEAST, "intervals of Sobol indices need")
        if self.samples & (self.samples - 1):
            lower = 1 << (self.samples.bit_length() - 1)
            text = f"is {self.samples}: a Sobol sequence is balanced at powers of 2; use"
            issues.append(Fault("samples", f"{text} {max(lower, LEAST)} or {max(2 * lower, LEAST)}"))
        return issues + replicate_faults(seeds, "Sobol indices")

    def size(self, factors: tuple[Factor, ...]) -> int:
        return self.samples * (len(factors) + 2)

    def points(self, factors: tuple[Factor, ...], base: Mapping[str, Level], rng: np.random.Generator) -> pd.DataFrame:
        """Row `block * (keys + 2) + at`: at 0 is A, 1 to keys is A with that key from B, then B."""
        from SALib.sample.sobol import sample

        cube = unit_cube(factors)
        # A generator: SALib takes the seed 0 for none.
        parts = [sample(cube, self.samples // PARTS, calc_second_order=False, seed=rng) for _ in range(PARTS)]
        return frame_of(factors, np.concatenate(parts))
