"""The standard error of a fraction in a finite sample."""

from __future__ import annotations

from math import sqrt


def share_error(fraction: float, count: int) -> float:
    """Standard error of a fraction of `count` draws, never 0.

    Binomial, but at least that of one success in n + 2 (Agresti and Coull, Am. Stat. 52, 1998: a
    sample without a success, or without a failure, does not prove that there is none).
    """
    variance = fraction * (1.0 - fraction) / count
    floor = 1.0 / (count + 2.0)
    return sqrt(max(variance, floor * (1.0 - floor) / (count + 2.0)))
