"""Gauge studies: the repeatability and reproducibility of a gauge, from repeated measurements.

Of type 1 one part is measured again and again, against its reference; of type 2 several parts by several
operators; of type 3 several parts without an operator. By two-way analysis of variance of p parts,
o operators and r repeats,

    repeatability^2 = MSE,   interaction^2 = (MSPO - MSE)/r,   operators^2 = (MSO - MSPO)/(p r)

where an interaction that is no more than chance is pooled with the error.

Reference: AIAG (2010), Measurement Systems Analysis, 4th ed., chapter III B and appendix A; VDA 5
(2010); ISO 22514-7:2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...section import Array

POOLED = 0.05
"""Probability by chance from which an interaction of parts and operators is pooled with the error."""
EQUAL = "has repeated measurements that are all equal: the resolution of the gauge is too coarse"
REPEATS = 10
"""Repeated measurements of one part at least."""


@dataclass(frozen=True, slots=True)
class GaugeStudy:
    """Standard deviations of a gauge; `sigma` is repeatability and reproducibility together, with
    its degrees of freedom. `bias` is the mean error against a reference, with its probability by
    chance, NaN where there is no reference.
    """

    kind: int
    sigma: float
    df: float
    repeatability: float
    reproducibility: float
    part: float
    bias: float = np.nan
    bias_probability: float = np.nan

    def statement(self, unit: str) -> str:
        """The study in one line."""
        words = [f"gauge study of type {self.kind}: s = {self.sigma:.3g} {unit} ({self.df:.3g} degrees of freedom)"]
        words += [f"repeatability {self.repeatability:.3g}, reproducibility {self.reproducibility:.3g}"]
        words += [] if np.isnan(self.bias) else [f"bias {self.bias:+.3g} (by chance: {self.bias_probability:.2g})"]
        return ", ".join(words)


def gauge_study(
    values: Array, parts: Sequence[str] = (), operators: Sequence[str] = (), reference: float | None = None
) -> GaugeStudy:
    """The study of a gauge from measurements (n,) of named parts by named operators.

    Raises ValueError where no part is measured twice, where the cells of parts and operators hold
    different numbers of measurements, and where all measurements of each part are equal.
    """
    part_names, part = np.unique(np.asarray(parts or ["1"] * len(values), dtype=str), return_inverse=True)
    names, operator = np.unique(np.asarray(operators or ["1"] * len(values), dtype=str), return_inverse=True)
    p, o = len(part_names), len(names)
    if p == 1:
        return _of_one_part(values, reference, o)
    cells = np.bincount(part * o + operator, minlength=p * o)
    r = int(cells.min())
    if r != cells.max():
        raise ValueError(
            f"has between {r} and {cells.max()} measurements of a part by an operator: measure each part equally often"
        )
    if r < 2:
        raise ValueError("has one measurement of each part by each operator: repeated ones are needed")
    order = np.lexsort((operator, part))
    table = values[order].reshape(p, o, r)
    mean, of_parts, of_operators = table.mean(), table.mean(axis=(1, 2)), table.mean(axis=(0, 2))
    cell = table.mean(axis=2)
    error = float(np.sum((table - cell[:, :, None]) ** 2)), p * o * (r - 1)
    crossed = float(r * np.sum((cell - of_parts[:, None] - of_operators + mean) ** 2)), (p - 1) * (o - 1)
    if error[0] <= 0.0:
        raise ValueError(EQUAL)
    square = error[0] / error[1]
    chance = float(scipy.stats.f.sf(crossed[0] / crossed[1] / square, crossed[1], error[1])) if crossed[1] else 1.0
    interacts = chance < POOLED
    if not interacts:
        square = (error[0] + crossed[0]) / (error[1] + crossed[1])
    df = float(error[1] if interacts else error[1] + crossed[1])
    between = crossed[0] / crossed[1] if interacts else square
    of_operator = float(p * r * np.sum((of_operators - mean) ** 2)) / (o - 1) if o > 1 else 0.0
    # Mean squares with their weights in the variance of the gauge, of those that are not negative.
    terms = [(square, df, 1.0)]
    terms += [(between, float(crossed[1]), 1.0 / r), (square, df, -1.0 / r)] if interacts and between > square else []
    if o > 1 and of_operator > between:
        low = float(crossed[1]) if interacts else df
        terms += [(of_operator, o - 1.0, 1.0 / (p * r)), (between, low, -1.0 / (p * r))]
    variance = sum(weight * mean_square for mean_square, _, weight in terms)
    weights: dict[tuple[float, float], float] = {}
    for mean_square, degrees, weight in terms:
        weights[mean_square, degrees] = weights.get((mean_square, degrees), 0.0) + weight
    satterthwaite = variance**2 / sum((w * m) ** 2 / d for (m, d), w in weights.items())
    of_part = float(o * r * np.sum((of_parts - mean) ** 2)) / (p - 1)
    return GaugeStudy(
        kind=2 if o > 1 else 3,
        sigma=float(np.sqrt(variance)),
        df=satterthwaite,
        repeatability=float(np.sqrt(square)),
        reproducibility=float(np.sqrt(max(variance - square, 0.0))),
        part=float(np.sqrt(max(of_part - between, 0.0) / (o * r))),
    )


def _of_one_part(values: Array, reference: float | None, operators: int) -> GaugeStudy:
    """The study of one part, which is measured again and again."""
    if operators > 1:
        raise ValueError("has one part only, measured by several operators: several parts are needed")
    n, sigma = len(values), float(np.std(values, ddof=min(1, len(values) - 1)))
    if n < REPEATS:
        raise ValueError(f"has {n} measurements of one part; at least {REPEATS} are needed")
    if sigma <= 0.0:
        raise ValueError(EQUAL)
    if reference is None:
        return GaugeStudy(1, sigma, n - 1.0, sigma, 0.0, 0.0)
    bias = float(np.mean(values) - reference)
    chance = 2.0 * float(scipy.stats.t.sf(abs(bias) / (sigma / np.sqrt(n)), n - 1))
    return GaugeStudy(1, sigma, n - 1.0, sigma, 0.0, 0.0, bias, chance)
