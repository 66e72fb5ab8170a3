"""The namers that must fail, by the name that the tables give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from benchmarks.gap.generator.records import Record
from benchmarks.gap.namers.always_compliance import always_compliance
from benchmarks.gap.namers.best_correlation import best_correlation
from benchmarks.gap.namers.lasso import lasso
from benchmarks.gap.namers.plain_bic import plain_bic
from benchmarks.gap.namers.thresholded_least_squares import thresholded_least_squares

Namer = Callable[[Record], Mapping[str, Any]]
"""Who is given a record alone, and says of it what `gap.json` holds."""

BASELINES: Mapping[str, Namer] = {
    "always compliance": always_compliance,
    "best correlation": best_correlation,
    "plain BIC": plain_bic,
    "LassoCV": lasso,
    "thresholded least squares": thresholded_least_squares,
}
