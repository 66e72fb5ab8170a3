"""Tests for departures from a single stable normal process: drift, lots, outliers, shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...arrays import Array

LEVEL = 0.01
"""Probability of a false finding in a sample of a stable normal process, all tests together."""
FEW = 8
"""Number of values from which the shape of a distribution can be tested."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A departure: its kind (`drift`, `lots`, `scatter`, `outlier`, `shape`), a description, and
    the probability of a departure as large by chance.
    """

    kind: str
    text: str
    probability: float


def findings(values: Array, lots: Sequence[str] = ()) -> list[Finding]:
    """Departures of `values` (n,), in the order of production, beyond chance (Holm's procedure).

    `lots` (n,) name the lot of each value, empty where none is known: then lots are detected by
    consecutive values that are more alike than by chance (von Neumann's ratio).

    Reference: Holm (1979), Scandinavian J. Statistics 6(2), 65-70; Grubbs (1969), Technometrics
    11(1), 1-21; Shapiro and Wilk (1965), Biometrika 52(3-4), 591-611; Brown and Forsythe (1974),
    J. American Statistical Association 69(346), 364-367; von Neumann (1941), Annals of Mathematical
    Statistics 12(4), 367-395.
    """
    tests = [_drift(values), _outlier(values), *_lots(values, lots)]
    if len(values) >= FEW:
        tests.append(_shape(values))
    significant: list[Finding] = []
    for at, finding in enumerate(sorted(tests, key=lambda finding: finding.probability)):
        if finding.probability > LEVEL / (len(tests) - at):
            break
        significant.append(finding)
    if any(test.kind == "outlier" for test in significant):  # the shape is tested without it
        remaining = np.delete(values, np.argmax(np.abs(values - values.mean())))
        if len(remaining) >= FEW and _shape(remaining).probability > LEVEL:
            significant = [test for test in significant if test.kind != "shape"]
    return significant


def distribution_type(departures: Sequence[Finding]) -> str:
    """The distribution model of ISO 22514-2: A1, A2 (stable), B (scatter moves), C1, C3 (the mean
    moves, by lots or along a trend) or D (both), as far as the tests show.

    Reference: ISO 22514-2:2017, clause 5, table 1.
    """
    kinds = {finding.kind for finding in departures}
    if "scatter" in kinds:
        return "D" if kinds & {"drift", "lots"} else "B"
    if "drift" in kinds:
        return "C3"
    if "lots" in kinds:
        return "C1"
    return "A2" if "shape" in kinds else "A1"


def _drift(values: Array) -> Finding:
    trend = scipy.stats.linregress(np.arange(len(values), dtype=float), values)
    total = float(trend.slope) * (len(values) - 1)
    return Finding("drift", f"drifts by {total:.3g} from the first part to the last", float(trend.pvalue))


def _lots(values: Array, lots: Sequence[str]) -> list[Finding]:
    groups = [values[[at for at, lot in enumerate(lots) if lot == name]] for name in dict.fromkeys(lots)]
    groups = [group for group in groups if len(group) > 1]
    if len(groups) < 2:
        return [_succession(values)] if len(values) >= FEW else []
    spread = float(np.ptp([group.mean() for group in groups]))
    of_means = float(scipy.stats.f_oneway(*groups).pvalue)
    of_scatter = float(scipy.stats.levene(*groups, center="median").pvalue)
    return [
        Finding("lots", f"has lots whose means differ by up to {spread:.3g}", of_means),
        Finding("scatter", "has lots that scatter differently", of_scatter),
    ]


def _succession(values: Array) -> Finding:
    """Mean square of the steps from part to part over the variance, about a straight line: 2 where
    parts do not depend on those before (a little more, for the line is fitted).
    """
    n, at = len(values), np.arange(len(values), dtype=float)
    residual = values - np.polyval(np.polyfit(at, values, 1), at)
    total = float(np.sum(residual**2))
    ratio = float(np.sum(np.diff(residual) ** 2)) / total if total > 0.0 else 2.0
    z = (0.5 * ratio - 1.0) * np.sqrt((n**2 - 1.0) / (n - 2.0))
    text = (
        f"has parts that depend on the parts before them (steps of {ratio:.2g} variances in the mean "
        "square, 2 by chance): lots or settings that are not named"
    )
    return Finding("lots", text, float(scipy.special.ndtr(z)))


def _outlier(values: Array) -> Finding:
    """Grubbs' test of the value furthest from the mean."""
    n, far = len(values), int(np.argmax(np.abs(values - values.mean())))
    g = float(abs(values[far] - values.mean()) / values.std(ddof=1))
    denominator = (n - 1) ** 2 - n * g**2
    t = np.inf if denominator <= 0.0 else np.sqrt(n * (n - 2) * g**2 / denominator)
    p = min(1.0, 2.0 * n * float(scipy.stats.t.sf(t, n - 2)))
    text = f"has an outlier: {values[far]:.6g} (part {far + 1}), {g:.1f} standard deviations off"
    return Finding("outlier", text, p)


def _shape(values: Array) -> Finding:
    skew, excess = float(scipy.stats.skew(values)), float(scipy.stats.kurtosis(values))
    words = "heavy tails, " if excess > abs(skew) else "skew, " if abs(skew) > 0.5 else ""
    text = f"is not normal ({words}skewness {skew:.2f}, excess kurtosis {excess:.2f})"
    return Finding("shape", text, float(scipy.stats.shapiro(values).pvalue))
