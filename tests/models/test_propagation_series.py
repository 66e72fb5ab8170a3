"""What propagation states at the ends of its reach: orders of its series, no spread, far tails."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tolevo.models.inputs import Beta, Normal, Uniform
from tolevo.models.propagation import ClippedSum, Convolution, Moments, Term
from tolevo.models.propagation.convolution import Even, EvenBeta, EvenNormal, EvenPlateau, EvenTruncatedNormal
from tolevo.models.propagation.sums import cumulants_of
from tolevo.models.propagation.symmetric_sum import SymmetricSum

UNIT = Normal(cp=1.0 / 3.0)  # standard normal


def constants(*values: float) -> Term:
    return Term(Uniform(), np.array(values), np.zeros(len(values)))


def test_cumulants_of_an_exponential_and_a_poisson_law() -> None:
    """E x^k = k! has the cumulants (k - 1)!; all cumulants of a Poisson law are its mean."""
    exponential = np.array([float(factorial(k)) for k in range(1, 5)])
    assert_allclose(cumulants_of(exponential), [1.0, 1.0, 2.0, 6.0], rtol=1e-14)
    poisson = np.array([float(stats.poisson(0.7).moment(k)) for k in range(1, 5)])
    assert_allclose(cumulants_of(poisson), np.full(4, 0.7), rtol=1e-9)


@pytest.mark.parametrize("coverage", [0.1, 0.9, 0.99])
def test_series_of_four_cumulants_miss_only_the_next_order(coverage: float) -> None:
    """Chi-square of n degrees: with a skewness of (8/n)^(1/2) the next order is n^(-3/2).

    A wrong coefficient leaves n^(-1/2) or n^(-1): four times as many terms then cut the error
    by two or four in place of eight.
    """
    missed = []
    for n in (100, 400):
        square = Term(UNIT, np.zeros(1), np.zeros(1), np.ones(1))
        law = stats.chi2(n)
        exact = float(law.ppf(coverage))
        found = Moments().propagate(ClippedSum((square,) * n, (constants(0.0),)), coverage, exact)
        quantile = (float(found.quantile.value[0]) - exact) / np.sqrt(2.0 * n)
        missed.append((quantile, float(found.conforming.value[0]) - coverage))
    for few, many in zip(*missed, strict=True):
        assert abs(few) < 0.5 * 100.0**-1.5
        assert few / many == pytest.approx(8.0, rel=0.1)


def test_clipped_part_without_spread_has_moments_and_errors() -> None:
    """Constants beside a uniform of spread 1/2 on [0, 1]: they are added, or cut at zero.

    The quantile of the uniform at 0.9 is 0.9, within the error that is stated.
    """
    free = Term(Uniform(), np.full(3, 0.5), np.full(3, 0.5))
    found = Moments().propagate(ClippedSum((free,), (constants(0.3, -0.3, 0.0),)), 0.9, 0.75)
    added = np.array([0.3, 0.0, 0.0])
    assert_allclose(found.mean.value, 0.5 + added, rtol=1e-12)
    assert_allclose(found.std.value, np.sqrt(1.0 / 12.0), rtol=1e-9)
    assert np.all(np.abs(found.quantile.value - 0.9 - added) <= found.quantile.error)
    assert np.all(np.abs(found.conforming.value - 0.75 + added) <= found.conforming.error)
    assert found.negative.value[:2].tolist() == [0.0, 1.0]
    assert np.all(np.isfinite(found.std.error)) and np.all(np.isfinite(found.negative.error))


def test_spread_of_a_clipped_part_of_extreme_shape_is_a_number() -> None:
    """The series gives some of these clipped parts a variance below zero."""
    means = np.linspace(-2.0, 2.0, 401)
    rare = Term(Beta(0.02, 10.0), means, np.ones(401))
    found = Moments().propagate(ClippedSum((constants(*np.zeros(401)),), (rare,)), 0.99, 0.5)
    low, high = rare.bounds()
    for estimate in (found.std, found.quantile, found.mean):
        assert np.all(np.isfinite(estimate.value))
    assert np.all((found.std.value >= 0.0) & (found.std.value <= high - low))


def test_doubt_of_a_far_quantile_is_no_wider_than_the_sum() -> None:
    """At 1 - 1e-9 the density of the tail is 1e-8: the doubt must not be divided by it alone."""
    part = Term(Uniform(), np.zeros(1), np.ones(1))
    found = Moments().propagate(ClippedSum((part,) * 3, (constants(0.0),)), 1.0 - 1e-9, 1.0)
    assert 0.0 < found.quantile.error[0] < 6.0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_stated_errors_of_the_convolution_have_the_unit_of_the_sum(scale: float) -> None:
    """Two parts of 1e-9 of their size: the sum and its rounding grow with the unit."""
    narrow = Term(Uniform(), np.array([scale]), np.array([5e-10 * scale]))
    total = ClippedSum((narrow,), (constants(0.5 * scale),))
    found = Convolution().propagate(total, 0.75, 2.0 * scale)
    error = float(found.quantile.error[0])
    assert abs(float(found.quantile.value[0]) - (1.5 + 2.5e-10) * scale) <= error
    assert np.spacing(1.5 * scale) <= error <= 1e-9 * scale


def test_quantile_above_all_computed_mass_is_the_upper_end() -> None:
    """1 - 1e-16 is above what the masses on a lattice add up to by rounding."""
    part = Term(Uniform(), np.zeros(4), np.array([0.3, 0.5, 0.7, 1.0]))
    total = ClippedSum((constants(0.0, 0.0, 0.0, 0.0),), (part, part))
    found = Convolution().propagate(total, 1.0 - 1.1e-16, 1.0)
    # P(X > y) = (2 - y)^2/8 for two of half width 1: at 1e-13 it is 1e-6 below the end
    assert_allclose(found.quantile.value, 2.0 * part.linear, rtol=3e-3)


def test_an_unbounded_input_of_no_scale_adds_nothing() -> None:
    """Beside a normal that has no part two uniforms make a triangle: P(X > y) = (2 - y)^2/8."""
    total = SymmetricSum([EvenNormal(0.5), EvenPlateau(), EvenPlateau()])
    s = np.array([[0.0, 1.0, 1.0]])
    exact = 2.0 - np.sqrt(8.0 * 0.05)
    found = total.quantile(s, 0.95)
    assert_allclose(found.value, exact, rtol=1e-11)
    assert_allclose(total.below(s, np.array([exact]))[0], 0.95, rtol=1e-12)
    assert_allclose(total.values(s, 0.95), exact, rtol=1e-11)


@pytest.mark.parametrize("sure", [False, True])
def test_errors_of_gradients_hold_where_the_series_of_a_slope_does_not_end(sure: bool) -> None:
    """X = z + h y, z uniform, y normal: up to exp(-1/h) the quantile is 2 p - 1, flat in h.

    The terms of the slope in h fall more slowly than 1/k, so that no bound comes from their sum;
    around h = 3.5e-4 those of the density do not.
    """
    total = SymmetricSum([EvenBeta(1.0), EvenNormal(1.0)])
    h = np.array([1e-7, *np.linspace(3e-4, 4e-4, 11)])
    found = total.quantile(np.stack([np.ones(12), h], axis=1), 0.9, sure)
    assert np.all(found.gradient_error >= 0.0) and np.all(found.value_error >= 0.0)
    assert np.all(np.abs(found.value - 0.8) <= found.value_error)
    assert np.all(np.abs(found.gradient - [0.8, 0.0]) <= found.gradient_error)


@pytest.mark.parametrize("law", [EvenPlateau(), EvenPlateau(0.5), EvenNormal(0.3),
                                 EvenTruncatedNormal(0.5), EvenBeta(2.5)], ids=repr)  # fmt: skip
def test_envelopes_of_small_arguments_are_those_of_any_law(law: Even) -> None:
    """No characteristic function is above one, so that a scale of nearly 0 costs no accuracy."""
    w = np.geomspace(1e-9, 1.0, 40)
    bound, _ = law.envelope(w)
    assert np.all(bound <= 1.0) and np.all(bound >= np.abs(law.characteristic(w)[0]) - 1e-15)


@pytest.mark.parametrize("sigma", [0.5, 1.0, 2.0])
def test_envelope_of_a_cut_normal_falls_to_the_jump_at_its_ends(sigma: float) -> None:
    """phi(w) tends to 2 f(1) sin(w)/w: f(1), the density where it is cut, by scipy."""
    edge = float(stats.truncnorm(-1.0 / sigma, 1.0 / sigma, scale=sigma).pdf(1.0))
    w = 1e5
    assert float(EvenTruncatedNormal(sigma).envelope(np.array(w))[0]) * w / 2.0 == pytest.approx(edge, rel=1e-3)
