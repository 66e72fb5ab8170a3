"""`tests.csv`: every test of one response."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..records import StudySettings
from .anova import level_test, surface_tests
from .contrasts import Contrast
from .pairs import COLUMNS, corrected, friedman_tests, wilcoxon_tests
from .runs import Runs, complete


def tests(
    runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> pd.DataFrame:
    """Wilcoxon for pairs, Friedman for more, analysis of variance; Holm within each kind."""
    parts = [
        wilcoxon_tests(runs, contrasts, rng),
        friedman_tests(runs, contrasts),
        _variances(runs, design, settings, contrasts),
    ]
    parts = [part for part in parts if len(part)]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(COLUMNS))


def _variances(runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast]) -> pd.DataFrame:
    """Tests of the analysis of variance; none where values are missing for it."""
    if not runs.reached:
        return pd.DataFrame()
    rows: list[dict[str, Any]] = []
    if settings.design.analysis == "latin_hypercube" and complete(runs.array).shape[1]:
        rows = surface_tests(runs.array, design, settings.factors)
    elif settings.design.analysis != "latin_hypercube":
        rows = [level_test(runs.array, contrast) for contrast in contrasts]
    unknown = "nothing is left to compare with"
    return corrected(runs.response, "anova", rows, lambda row, _: unknown if np.isnan(row["p"]) else "")
