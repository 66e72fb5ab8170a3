"""The loop's statistics against simulated noise, and its linear algebra against least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tolevo.commands.gap.linear import basis, join_groups, products, project_out
from tolevo.commands.gap.noise import Noise, autocorrelation, outliers, size_follows, whiteness
from tolevo.commands.gap.scan import evidence, thresholds

Array = np.ndarray


def wandering(rng: np.random.Generator, n: int, rho: float, sigma: float) -> Array:
    """AR(1), stationary, by its recursion."""
    found = np.empty(n)
    found[0] = rng.normal()
    for k in range(1, n):
        found[k] = rho * found[k - 1] + np.sqrt(1.0 - rho**2) * rng.normal()
    return sigma * found


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.7, 0.9])
def test_autocorrelation_of_simulated_noise(rho: float) -> None:
    """Over 20 records beside 8 fitted columns: within 3 standard errors of the truth."""
    n = 400
    rng = np.random.default_rng(int(10 * rho))
    columns = np.column_stack([np.linspace(-1, 1, n) ** k for k in range(8)])
    found = []
    for _ in range(20):
        y = wandering(rng, n, rho, 2.0)
        y = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
        found.append(autocorrelation(y, columns, Noise(np.full(n, 2.0), "estimated")))
    one = np.sqrt((1.0 - rho**2) / n)  # of the likelihood's maximum, one record
    bias = 2.0 / n + (0.5 * one if rho == 0.0 else 0.0)  # at rho 0 the grid ends
    assert np.mean(found) == pytest.approx(rho, abs=3.0 * one / np.sqrt(20) + bias)


def test_whitened_noise_is_white_with_variance_one() -> None:
    n, rho = 20000, 0.7
    y = wandering(np.random.default_rng(1), n, rho, 3.0)
    white = Noise(np.full(n, 3.0), "estimated", rho).whiten(y)
    assert white.var() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / n))
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 4.0 / np.sqrt(n)


def test_coloured_is_the_transpose_of_the_noise() -> None:
    """x' C x with C the covariance of the process, sigma_i sigma_k rho^|i - k|."""
    rng = np.random.default_rng(2)
    sigma, rho = rng.uniform(0.5, 2.0, 30), 0.6
    x = rng.normal(size=(30, 3))
    lag = np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    covariance = np.outer(sigma, sigma) * rho**lag
    found = Noise(sigma, "estimated", rho).coloured(x)
    np.testing.assert_allclose(found.T @ found, x.T @ covariance @ x, rtol=1e-9)


def test_size_of_the_noise_follows_an_input() -> None:
    rng = np.random.default_rng(3)
    n = 400
    inputs = {"torque": rng.uniform(-1.0, 1.0, n), "speed": rng.uniform(0.0, 1.0, n)}
    size = 0.5 + inputs["speed"]
    found = size_follows(size * rng.normal(size=n), inputs, np.ones(n, dtype=bool))
    assert found is not None
    assert found[0] == "speed"
    assert np.corrcoef(found[1], size)[0, 1] > 0.9


def test_even_noise_seldom_seems_uneven() -> None:
    rng = np.random.default_rng(4)
    n, good = 150, np.ones(150, dtype=bool)
    seen = sum(
        size_follows(rng.standard_t(4.0, n), {"x": rng.uniform(size=n), "y": rng.uniform(size=n)},
                     good) is not None
        for _ in range(300)
    )  # fmt: skip
    assert seen <= stats.binom.ppf(0.999, 300, 1e-3)


def test_whiteness_is_a_chance() -> None:
    """Uniform under noise; almost 0 where the noise wanders."""
    rng = np.random.default_rng(9)
    chances = [whiteness(rng.normal(size=200)) for _ in range(200)]
    assert stats.kstest(chances, "uniform").pvalue > 1e-3
    assert whiteness(wandering(rng, 200, 0.6, 1.0)) < 1e-6


def test_outliers_are_those_far_out() -> None:
    y = np.random.default_rng(5).normal(size=500)
    y[[7, 90]] = [8.0, -9.0]
    assert list(np.flatnonzero(~outliers(y, np.ones(500)))) == [7, 90]


def test_gains_of_groups_are_those_of_least_squares() -> None:
    rng = np.random.default_rng(6)
    n = 80
    base, y = rng.normal(size=(n, 3)), rng.normal(size=n)
    parts = [rng.normal(size=(n, m)) for m in (1, 2, 3, 1, 3)]
    parts[2][:, 2] = parts[2][:, 0] - 2.0 * parts[2][:, 1]  # what is there twice counts once
    groups = join_groups(parts, [False] * 5)
    q = basis(base)
    found = groups.orthonormal(q).gains(project_out(y, q))

    def rss(columns: Array) -> float:
        fit = np.linalg.lstsq(columns, y, rcond=None)[0]
        return float(np.sum((y - columns @ fit) ** 2))

    expected = [rss(base) - rss(np.hstack([base, part])) for part in parts]
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    gains = groups.conditional_gains(*products(groups, q, project_out(y, q)))
    np.testing.assert_allclose(gains, expected, rtol=1e-8)


def test_gains_without_some_rows_are_those_of_the_others() -> None:
    """The products of the columns less those of the rows that are held out."""
    rng = np.random.default_rng(7)
    parts = [rng.normal(size=(60, m)) for m in (1, 2, 4)]
    groups, out = join_groups(parts, [False] * 3), np.arange(20, 30)
    rest = np.delete(np.arange(60), out)
    base, y = rng.normal(size=(60, 2)), rng.normal(size=60)
    base[out], y[out] = 0.0, 0.0
    q = basis(base)
    left = [whole - part for whole, part in zip(groups.grams(), groups.grams(out), strict=True)]
    found = groups.conditional_gains(*products(groups, q, project_out(y, q)), left)
    alone = join_groups([one[rest] for one in parts], [False] * 3)
    expected = alone.orthonormal(basis(base[rest])).gains(project_out(y, q)[rest])
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_a_one_sided_group_gains_nothing_on_the_other_side() -> None:
    x = np.linspace(-1.0, 1.0, 50)[:, None]
    groups = join_groups([x, x], [True, False]).orthonormal(np.zeros((50, 0)))
    np.testing.assert_allclose(groups.gains(-x[:, 0]), [0.0, float(np.sum(x**2))])


def test_evidence_is_the_tail_of_chi_square() -> None:
    groups = join_groups([np.eye(8)[:, :1], np.eye(8)[:, 1:4]], [False, False])
    gains = np.array([[3.0, 40.0], [12.0, 5.0]])
    expected = -np.log(stats.chi2.sf(gains, np.array([[1], [3]])))
    np.testing.assert_allclose(evidence(groups, gains), expected, rtol=1e-9)
    far = evidence(groups, np.array([900.0, 900.0]))
    np.testing.assert_allclose(far, -stats.chi2.logsf(900.0, [1, 3]), rtol=1e-3)


def test_threshold_is_passed_as_often_as_it_says() -> None:
    """Fresh noise, scale unknown: the share of records beyond a 5 % threshold."""
    rng = np.random.default_rng(7)
    n, records = 60, 1000
    x = np.linspace(0.0, 1.0, n)
    waves = [np.column_stack([np.cos(k * x), np.sin(k * x)]) for k in range(1, 30)]
    library = join_groups([wave[:, :1] for wave in waves], [False] * len(waves))
    generic = join_groups(waves, [False] * len(waves))
    q = basis(np.ones((n, 1)))
    limit = thresholds(library, generic, q, 4000, 0.05, np.random.default_rng(8))
    noise = project_out(rng.normal(size=(n, records)), q)
    scale = np.sum(noise**2, axis=0) / (n - 1)
    named = library.orthonormal(q).gains(noise) / scale
    forms = generic.orthonormal(q)
    level = evidence(forms, forms.gains(noise) / scale)
    passed = int(np.sum(named.max(axis=0) > limit.library))
    low, high = (float(stats.binom.ppf(p, records, 0.05)) for p in (0.0005, 0.9995))
    assert low <= passed <= high + 10  # the threshold itself is a quantile of 4000
    also = int(np.sum(level.max(axis=0) > limit.generic))
    low, high = (float(stats.binom.ppf(p, records, 0.025)) for p in (0.0005, 0.9995))
    assert low - 5 <= also <= high + 5
