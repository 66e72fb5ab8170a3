"""Length of a Gaussian vector: closed forms of special cases, the Hoyt law elsewhere, sampling."""

import numpy as np
import pytest
from scipy.stats import chi

from tolevo.models.assembly.assemble import radius_quantile
from tolevo.models.manipulator.ring import exceedance, principal, quantile

COVERAGES = [0.5, 0.9, 0.9973, 1.0 - 1e-6]


@pytest.mark.parametrize("components", [1, 2, 3])
@pytest.mark.parametrize("coverage", COVERAGES)
def test_equal_components_are_half_normal_rayleigh_and_maxwell(components: int, coverage: float) -> None:
    variances = np.where(np.arange(3) < components, 0.09, 0.0)
    expected = 0.3 * chi.ppf(coverage, components)
    # the angles resolve the length of two equal components worst: 1e-7 of the share at the median
    np.testing.assert_allclose(quantile(variances, coverage), expected, rtol=1e-6)
    np.testing.assert_allclose(exceedance(variances, expected), 1.0 - coverage, rtol=1e-6)


@pytest.mark.parametrize("coverage", [0.9, 0.9973])
def test_two_unequal_components_are_the_hoyt_law_of_the_assembly_model(coverage: float) -> None:
    """Two models of one thing: here one angle and Dawson's function, there exponentials."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(200, 2, 2))
    covariance = root @ np.swapaxes(root, 1, 2)
    found = quantile(principal(covariance), coverage)
    np.testing.assert_allclose(found, radius_quantile(covariance, coverage), rtol=1e-6)


def test_nearly_one_component() -> None:
    variances = np.array([[1.0, 1e-12, 0.0], [1.0, 1e-12, 1e-12], [1.0, 0.0, 0.0]])
    for length in (0.3, 3.0):
        half_normal = 2.0 * chi.sf(length, 1) / 2.0
        np.testing.assert_allclose(exceedance(variances, length), half_normal, rtol=1e-9)


def test_three_unequal_components_against_a_million_vectors() -> None:
    rng = np.random.default_rng(7)
    variances = np.array([1.0, 0.4, 0.15])
    length = np.linalg.norm(rng.normal(size=(1_000_000, 3)) * np.sqrt(variances), axis=1)
    for bound in (0.3, 1.0, 2.0, 3.0):
        share = float(np.mean(length > bound))
        found = float(exceedance(variances, bound))
        assert abs(found - share) < 4.0 * np.sqrt(found * (1.0 - found) / 1e6)


def test_shares_rise_with_every_variance_and_fall_with_the_length() -> None:
    rng = np.random.default_rng(1)
    narrow = -np.sort(-rng.random((500, 3)), axis=1)
    wide = narrow + rng.random((500, 3)) * [[0.3, 0.2, 0.1]]
    wide = -np.sort(-wide, axis=1)
    length = rng.uniform(0.5, 4.0, 500)
    assert np.all(exceedance(wide, length) >= exceedance(narrow, length))
    assert np.all(exceedance(narrow, 1.01 * length) <= exceedance(narrow, length))


def test_principal_variances_are_the_eigenvalues() -> None:
    root = np.random.default_rng(2).normal(size=(50, 3, 5))
    whole = root @ np.swapaxes(root, 1, 2)
    for size in (1, 2, 3):
        part = whole[:, :size, :size]
        found = principal(part)
        np.testing.assert_allclose(found[:, :size], np.linalg.eigvalsh(part)[:, ::-1], rtol=1e-10)
        assert not np.any(found[:, size:])


def test_nothing_varies() -> None:
    still = np.zeros((2, 3))
    np.testing.assert_array_equal(exceedance(still, 0.1), 0.0)
    np.testing.assert_array_equal(quantile(still, 0.9973), 0.0)
