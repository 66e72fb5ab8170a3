"""Capability and performance indices of a characteristic, with confidence limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ...arrays import Array

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Index:
    """An index and its two-sided confidence limits."""

    value: float
    low: float
    high: float


def capability(values: Array, lower: float | None, upper: float | None) -> dict[str, Index]:
    """Cp and Cpk (those that the limits allow) of normal values (n,), n >= 2.

    Limits of Cp are exact (chi-square); those of Cpk are approximate.

    Reference: ISO 22514-2:2017, clause 6; Bissell (1990), How reliable is your capability index?,
    Applied Statistics 39(3), 331-340.
    """
    n, mean, std = len(values), float(np.mean(values)), float(np.std(values, ddof=1))
    if std <= 0.0:
        return {}
    indices: dict[str, Index] = {}
    if lower is not None and upper is not None:
        cp = (upper - lower) / (6.0 * std)
        levels = [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]
        ends = np.sqrt(scipy.stats.chi2.ppf(levels, n - 1) / (n - 1))
        indices["Cp"] = Index(cp, cp * float(ends[0]), cp * float(ends[1]))
    distances = ([] if upper is None else [upper - mean]) + ([] if lower is None else [mean - lower])
    if distances:
        cpk = min(distances) / (3.0 * std)
        error = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2)) * np.sqrt(1.0 / (9.0 * n) + cpk**2 / (2.0 * (n - 1)))
        indices["Cpk"] = Index(cpk, cpk - error, cpk + error)
    return indices
