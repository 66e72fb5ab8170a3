"""A large Monte Carlo in blocks, against the normal distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from tolevo.commands.study.trial import monte_carlo
from tolevo.execution import Executor, InProcess, Processes
from tolevo.models.inputs import Normal, Uniform
from tolevo.models.propagation import ClippedSum, Propagated, Term

UNIT = Normal(cp=1.0 / 3.0)
"""The standard normal distribution."""
BLOCK = 4096


def total() -> ClippedSum:
    """Two designs: a clipped part that is always far above zero, so that nothing is clipped."""
    high = Term(Uniform(), np.array([100.0, 100.0]), np.zeros(2))
    parts = [Term(UNIT, np.zeros(2), np.array([scale, 2.0 * scale])) for scale in (1.0, 2.0, 2.0)]
    return ClippedSum((parts[0],), (high, *parts[1:]))


def found(executor: Executor, samples: int = 16 * BLOCK) -> Propagated:
    return monte_carlo(total(), 0.9973, 103.0, samples, 5, executor, BLOCK)


def test_statistics_of_a_sum_of_normals() -> None:
    """Standard deviations 3 and 6; values within four stated standard errors, and these small."""
    result = found(InProcess())
    sigma = np.array([3.0, 6.0])
    for estimate, exact, most in (
        (result.mean, [100.0, 100.0], 0.01),
        (result.std, sigma, 0.03),
        (result.quantile, 100.0 + sigma * norm.ppf(0.9973), 0.7),
        (result.conforming, norm.cdf(3.0 / sigma), 0.002),
    ):
        assert (np.abs(estimate.value - exact) < 4.0 * estimate.error).all()
        assert (estimate.error < most).all()


def test_the_executor_does_not_change_a_bit() -> None:
    one, two = found(InProcess(), 4 * BLOCK), found(Processes(2), 4 * BLOCK)
    for name in ("mean", "std", "quantile", "conforming", "negative"):
        np.testing.assert_array_equal(getattr(one, name).value, getattr(two, name).value)
        np.testing.assert_array_equal(getattr(one, name).error, getattr(two, name).error)


def test_more_blocks_are_more_accurate() -> None:
    few, many = found(InProcess(), 4 * BLOCK), found(InProcess(), 64 * BLOCK)
    assert (many.mean.error < few.mean.error).all()
    with pytest.raises(ValueError, match="more than one block"):
        found(InProcess(), BLOCK)
