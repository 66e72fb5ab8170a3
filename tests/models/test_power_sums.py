"""Sample statistics and their standard errors, against numpy, scipy.stats and the bootstrap."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from tolevo.models.propagation.moments import PowerSums, share

Array = NDArray[np.float64]
LOWER, UPPER = 0.0, 2.0


def sums_of(values: Array, about: float = 0.9) -> PowerSums:
    return PowerSums(0, about).with_values(values[:100]).with_values(values[100:])


def capabilities(values: Array) -> dict[str, Array]:
    """Of samples (samples, n), by numpy."""
    mean, s = values.mean(axis=1), values.std(axis=1, ddof=1)
    upper, lower = (UPPER - mean) / (3.0 * s), (mean - LOWER) / (3.0 * s)
    return {"mean": mean, "std": s, "cp": (UPPER - LOWER) / (6.0 * s), "cpk": np.minimum(upper, lower), "upper": upper}


def stated(sums: PowerSums) -> dict[str, tuple[float, float]]:
    found = {
        "mean": sums.mean,
        "std": sums.std,
        "cp": sums.cp(LOWER, UPPER),
        "cpk": sums.cpk(LOWER, UPPER),
        "upper": sums.to_limit(UPPER, 1),
    }
    return {name: (one.value, one.error) for name, one in found.items()}


@pytest.fixture
def skewed() -> Array:
    return np.random.default_rng(3).gamma(3.0, 0.3, size=500)


def test_values_are_those_of_numpy_and_scipy(skewed: Array) -> None:
    mean, variance, third, fourth = sums_of(skewed).moments()
    assert mean == pytest.approx(skewed.mean(), rel=1e-12)
    assert variance == pytest.approx(skewed.var(ddof=1), rel=1e-12)
    assert [third, fourth] == pytest.approx(stats.moment(skewed, order=[3, 4]).tolist(), rel=1e-10)
    wanted = capabilities(skewed[None])
    for name, (value, _) in stated(sums_of(skewed)).items():
        assert value == pytest.approx(float(wanted[name][0]), rel=1e-12), name


def test_what_the_sums_are_about_does_not_matter(skewed: Array) -> None:
    near, far = (stated(sums_of(skewed, about)) for about in (0.9, -3.0))
    for name, pair in near.items():
        assert pair == pytest.approx(far[name], rel=1e-9)


def test_errors_are_those_of_the_bootstrap(skewed: Array) -> None:
    """Both estimate the same scatter; 4000 resamples leave 1.1 %, the delta method O(1/n)."""
    rng = np.random.default_rng(8)
    resampled = skewed[rng.integers(0, len(skewed), size=(4000, len(skewed)))]
    scatter = {name: float(one.std()) for name, one in capabilities(resampled).items()}
    for name, (_, error) in stated(sums_of(skewed)).items():
        assert error == pytest.approx(scatter[name], rel=0.05), name


def test_errors_of_a_normal_sample_are_the_textbook_ones() -> None:
    """sigma/sqrt(n), sigma/sqrt(2 n), and Bissell's sqrt(1/(9 n) + Cpk^2/(2 n))."""
    n = 20_000
    values = stats.norm.ppf((np.arange(n) + 0.5) / n, loc=1.2, scale=0.25)
    found = stated(sums_of(values))
    cp, cpk = 2.0 / 1.5, 0.8 / 0.75
    wanted = {
        "mean": 0.25 / np.sqrt(n),
        "std": 0.25 / np.sqrt(2 * n),
        "cp": cp / np.sqrt(2 * n),
        "cpk": np.sqrt(1 / (9 * n) + cpk**2 / (2 * n)),
    }
    for name, error in wanted.items():
        assert found[name][1] == pytest.approx(error, rel=5e-3), name


@pytest.mark.parametrize(("hits", "count"), [(115, 1000), (9993, 10_000)])
def test_share_is_binomial(hits: int, count: int) -> None:
    found = share(hits, count)
    assert found.value == hits / count
    assert found.error == pytest.approx(stats.binom(count, hits / count).std() / count, rel=1e-12)


@pytest.mark.parametrize("hits", [0, 50])
def test_share_without_a_hit_or_a_miss_is_uncertain(hits: int) -> None:
    assert share(hits, 50).error == pytest.approx(1.0 / 50.0)


def test_nothing_varies() -> None:
    sums = PowerSums(0, 1.0).with_values(np.ones(5))
    assert (sums.mean.value, sums.mean.error, sums.std.value, sums.std.error) == (1.0, 0, 0, 0)
