"""Quantiles of sums of even deviations, against closed forms and finite differences."""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tolevo.models.inputs import Beta, SkewNormal, Trapezoid, Triangular, TruncatedNormal, Uniform
from tolevo.models.propagation.convolution import EvenBeta, EvenNormal, EvenPlateau, EvenTruncatedNormal, even_law
from tolevo.models.propagation.symmetric_sum import SymmetricSum

LAWS = [
    EvenPlateau(), EvenPlateau(0.5), EvenPlateau(0.0), EvenNormal(1.0 / 3.0),
    EvenTruncatedNormal(1.0 / 3.0), EvenTruncatedNormal(1.5), EvenBeta(1.0), EvenBeta(2.5),
]  # fmt: skip


def below_of_uniforms(s: np.ndarray, y: float) -> float:
    """P(sum s_j z_j <= y), z uniform on [-1, 1]: inclusion and exclusion over the corners."""
    m = len(s)
    each = [np.prod(e) * max(0.0, y + np.dot(e, s)) ** m for e in product([1, -1], repeat=m)]
    return float(sum(each)) / (factorial(m) * float(np.prod(2.0 * s)))


@pytest.mark.parametrize("p", [0.6, 0.95, 0.9973])
@pytest.mark.parametrize("m", [2, 3, 6])
def test_uniform_deviations_by_inclusion_and_exclusion(p: float, m: int) -> None:
    """The stated error covers what is left out (2e-12: rounding of the closed form)."""
    s = np.linspace(1.0, 0.3, m)
    found = SymmetricSum([EvenPlateau()] * m).quantile(s[None, :], p)
    y, error = float(found.value[0]), float(found.value_error[0])
    assert below_of_uniforms(s, y - error) - 2e-12 <= p <= below_of_uniforms(s, y + error) + 2e-12


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_characteristic_function_by_quadrature(law: EvenPlateau) -> None:
    """E cos(w z) over 20,000 quantiles at midpoints; its slope by differences; its envelopes."""
    u = (np.arange(20_000) + 0.5) / 20_000
    z = np.array([law.quantile(float(one)) for one in u[::10]])
    w = np.array([1e-5, 0.4, 3.0, 20.0])
    phi, slope = law.characteristic(w)
    assert_allclose(phi, np.cos(np.outer(w, z)).mean(axis=1), atol=2e-3)
    step = 1e-5
    ahead, back = law.characteristic(w + step)[0], law.characteristic(w - step)[0]
    assert_allclose(slope, (ahead - back) / (2.0 * step), atol=1e-9)
    assert law.std**2 == pytest.approx(float(2.0 * (1.0 - law.characteristic(np.array(1e-3))[0]))
                                       * 1e6, rel=1e-5)  # fmt: skip
    far = np.geomspace(0.1, 1e4, 400)
    phi, slope = law.characteristic(far)
    assert np.all(np.abs(phi) <= law.envelope(far)[0] + 1e-15)
    assert np.all(np.abs(slope) <= law.slope_envelope(far)[0] + 1e-12)


@pytest.mark.parametrize("p", [0.5, 0.7, 0.99, 0.9999])
def test_cuts_lie_below_the_quantile(p: float) -> None:
    """Convex and homogeneous: q(t) >= grad q(s) . t for 200 pairs, with equality at t = s."""
    rng = np.random.default_rng(0)
    total = SymmetricSum(LAWS)
    s, t = rng.uniform(0.01, 1.0, (2, 200, len(LAWS)))
    at, other = total.quantile(s, p), total.quantile(t, p)
    assert_allclose(np.sum(at.gradient * s, axis=1), at.value, rtol=1e-10, atol=1e-12)
    assert np.all(np.sum(at.gradient * t, axis=1) <= other.value * (1.0 + 1e-10) + 1e-12)
    assert at.value_error.max() < 1e-9 and at.gradient_error.max() < 1e-8


def test_gradient_by_differences() -> None:
    total, step = SymmetricSum(LAWS), 1e-5
    s = np.linspace(0.2, 1.0, len(LAWS))
    ends = total.quantile(s + step * np.vstack([np.eye(len(s)), -np.eye(len(s))]), 0.97).value
    slope = (ends[: len(s)] - ends[len(s) :]) / (2.0 * step)
    assert_allclose(total.quantile(s[None, :], 0.97).gradient[0], slope, atol=1e-8)


def test_normal_sum_and_single_terms() -> None:
    normals = SymmetricSum([EvenNormal(0.5), EvenNormal(1.0)])
    found = normals.quantile(np.array([[2.0, 1.0], [0.0, 3.0], [0.0, 0.0]]), 0.9)
    assert_allclose(found.value, 1.2815515655446004 * np.array([np.sqrt(2.0), 3.0, 0.0]), rtol=1e-12)


def test_probability_and_density_fit_the_quantile() -> None:
    total, step = SymmetricSum(LAWS), 1e-5
    s = np.linspace(0.2, 1.0, len(LAWS))[None, :]
    y = total.quantile(s, 0.93).value
    below, slopes, error = total.below(s, y)
    assert below[0] == pytest.approx(0.93, abs=1e-13) and error[0] < 1e-13
    rise = (total.below(s, y + step)[0] - total.below(s, y - step)[0]) / (2.0 * step)
    assert total.density(s, y)[0] == pytest.approx(float(rise[0]), rel=1e-8)
    at = total.quantile(s, 0.93)
    assert_allclose(-slopes / total.density(s, y)[:, None], at.gradient, rtol=1e-10)
    assert total.below(s, -y)[0][0] == pytest.approx(0.07, abs=1e-13)


def test_laws_that_are_not_even_and_log_concave_are_refused() -> None:
    """Beta below 1 breaks convexity by -4.5 at p = 0.75, by -0.94 at 0.95 (note on quantiles)."""
    assert even_law(Beta(0.5, 0.5)) is None
    assert even_law(Beta(2.0, 3.0)) is None
    assert even_law(Triangular(0.2)) is None
    assert even_law(TruncatedNormal(1.0, 0.1)) is None
    assert even_law(SkewNormal(2.0)) is None
    for law in (Uniform(), Trapezoid(0.3), Triangular(), TruncatedNormal(), Beta(2.0, 2.0)):
        mean, even = even_law(law) or (1.0, EvenPlateau())
        assert mean == 0.0
        assert even.std**2 == pytest.approx(float(law.raw_moments(2)[2]), rel=1e-9)


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_the_share_between_two_ends_is_that_of_each(law: EvenPlateau) -> None:
    """Ends inside and outside of the reach, none at all, and a sum of nothing; 1e-13: rounding."""
    total = SymmetricSum([law, EvenPlateau(), EvenNormal(0.4)])
    s = np.array([[1.0, 0.4, 0.2]] * 5 + [[0.0, 0.0, 0.0]])
    low = np.array([-0.9, -0.5, 0.1, -np.inf, -90.0, -0.1])
    high = np.array([0.7, np.inf, 0.6, 0.2, 90.0, 0.1])
    found, error = total.within(s, low, high)
    one, _, first = total.below(s, np.where(np.isfinite(low), low, -1e9))
    other, _, second = total.below(s, np.where(np.isfinite(high), high, 1e9))
    assert_allclose(found, other - one, atol=1e-13)
    assert np.all(error <= first + second + 1e-13)
    assert found[-2:].tolist() == [1.0, 1.0]


def test_sums_with_scales_in_common_are_as_accurate_as_alone() -> None:
    """Neighbours of one design share all scales but one; 1e-13: rounding of both series."""
    total = SymmetricSum([EvenPlateau(), EvenPlateau(0.5), EvenNormal(0.4)] * 4)
    base = np.linspace(1.0, 0.3, 12)
    s = np.where(np.eye(12, dtype=bool), 1.1 * base, base)
    low, high = np.full(12, -2.0), np.linspace(1.0, 2.5, 12)
    found, _ = total.within(s, low, high)
    alone = [total.within(s[i : i + 1], low[:1], high[i : i + 1])[0][0] for i in range(12)]
    assert_allclose(found, alone, atol=1e-13)
    # the slope of a probability at its 99 % quantile is above 0.01 here
    assert_allclose(total.values(s, 0.99), total.quantile(s, 0.99).value, rtol=1e-11)


def test_no_sums_have_no_values() -> None:
    """What a problem asks of no designs, to learn which outputs have derivatives, is empty."""
    total, none = SymmetricSum([EvenPlateau(), EvenPlateau(), EvenNormal(1.0 / 3.0)]), np.empty((0, 3))
    probability, error = total.within(none, np.empty(0), np.empty(0))
    assert probability.shape == error.shape == (0,)
    assert total.values(none, 0.99).shape == (0,)
