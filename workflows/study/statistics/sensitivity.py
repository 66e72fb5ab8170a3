"""`sensitivity.csv`: the effect of each key on a response, and that of the noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ....arrays import Array
from ..designs.morris import SHARE
from ..records import StudySettings
from . import morris, sobol
from .contrasts import Contrast
from .noise import noise_share
from .resampling import Estimates
from .runs import Runs, complete
from .shares import factorial_shares, key_shares, surface_shares

COLUMNS = ("response", "key", "statistic", "value", "low", "high", "level", "n", "distinct")
Rows = list[dict[str, Any]]


def sensitivity(
    runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> pd.DataFrame:
    """Rows of one response, noise last; `distinct` where the interval lies above 0.

    Empty where a run did not reach the response: an infinite value has no variance.
    """
    if not runs.reached or runs.replicates < 2 or np.isnan(runs.array).all():
        return pd.DataFrame(columns=list(COLUMNS))
    values, kind = runs.array, settings.design.analysis
    keys = [factor.key for factor in settings.factors]
    rows: Rows = []
    if kind == "sobol":
        names = [(key, statistic) for statistic in ("S1", "ST") for key in keys]
        rows += _rows(names, sobol.indices(values, len(keys), rng), len(values))
    elif kind == "morris":
        shares = design[[SHARE + key for key in keys]].to_numpy()
        names = [(key, statistic) for statistic in ("mu_star", "sigma") for key in keys]
        rows += _rows(names, morris.effects(values, shares, rng), len(values))
    elif complete(values).shape[1] >= 2:
        rows += _variances(values, design, settings, contrasts, rng)
    group = {"sobol": len(keys) + 2, "morris": len(keys) + 1, "latin_hypercube": 1}.get(kind, 0)
    noise = noise_share(_ends(values, group), 2, rng) if kind == "sobol" else noise_share(values, group, rng)
    rows += _rows([("", "noise_share")], noise, len(values))
    frame = pd.DataFrame(rows).assign(response=runs.response)
    frame["distinct"] = frame["low"] > 0.0
    return frame.reindex(columns=list(COLUMNS))


def _variances(
    values: Array, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> Rows:
    """Shares of variance; seeds that failed at any setting are left out."""
    kind = settings.design.analysis
    if kind == "factorial":
        names, shares = factorial_shares(values, contrasts, rng)
    elif kind == "latin_hypercube":
        names = [factor.key for factor in settings.factors]
        shares = surface_shares(values, design, settings.factors, rng)
    else:
        names = [contrast.key for contrast in contrasts]
        parts = [key_shares(values, contrast, rng) for contrast in contrasts]
        value, low, high = (
            np.concatenate([getattr(part, side) for part in parts]) for side in ("value", "low", "high")
        )
        shares = Estimates(value, low, high)
    return _rows([(name, "anova_share") for name in names], shares, complete(values).shape[1])


def _ends(values: Array, group: int) -> Array:
    """A and B of a Sobol design, whose settings are a plain sample."""
    blocks = values.reshape(-1, group, values.shape[1])
    return blocks[:, [0, -1]].reshape(-1, values.shape[1])


def _rows(names: list[tuple[str, str]], estimates: Estimates, n: int) -> Rows:
    sides = zip(names, estimates.value, estimates.low, estimates.high, strict=True)
    return [
        {"key": key, "statistic": name, "value": value, "low": low, "high": high, "n": n, "level": estimates.level}
        for (key, name), value, low, high in sides
    ]
