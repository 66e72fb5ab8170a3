"""Distributions of toleranced inputs against scipy, and zones given by their limits."""

from collections.abc import Sequence
from itertools import pairwise
from math import gamma, pi, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.integrate import quad

from tolevo.models.inputs import (
    DISTRIBUTIONS,
    Beta,
    Distribution,
    Empirical,
    Exponential,
    LogNormal,
    Mixture,
    Normal,
    Rayleigh,
    SkewNormal,
    Trapezoid,
    Triangular,
    TruncatedNormal,
    Uniform,
    Zone,
)

CASES = [
    Uniform(),
    Normal(),
    Normal(cp=1.33, shift=0.2),
    TruncatedNormal(),
    TruncatedNormal(cp=0.4, shift=-0.5),
    TruncatedNormal(cp=2.0, shift=0.3),
    Triangular(),
    Triangular(0.4),
    Triangular(-1.0),
    Triangular(1.0),
    Trapezoid(),
    Trapezoid(0.0),
    Trapezoid(0.999),
    Beta(2.0, 3.0),
    Beta(0.5, 0.5),
    Beta(0.5, 4.0),
    Beta(200.0, 3.0),
    SkewNormal(2.0),
    SkewNormal(-4.0, cp=1.33, shift=-0.2),
    SkewNormal(30.0, cp=0.8, shift=0.1),
    SkewNormal(-1000.0),
    Rayleigh(),
    Rayleigh(0.3),
    Rayleigh(2.0),
    Exponential(),
    Exponential(0.4),
    LogNormal(0.1),
    LogNormal(0.5, 1.33),
    LogNormal(1.0, 0.5),
    Empirical((0.3, -0.8, 0.1, 0.15, -0.2, 1.2)),
    Empirical((-1.0, 1.0)),
    Mixture((-0.5, 0.4, 0.8), (0.1, 0.2, 0.05), (1.0, 2.0, 1.0)),
    Mixture((0.3,), (0.2,)),
]


def reference(distribution: Distribution) -> Any:
    """The same distribution by scipy."""
    match distribution:
        case Normal(cp, shift):
            return stats.norm(shift, 1.0 / (3.0 * cp))
        case TruncatedNormal(cp, shift):
            sigma = 1.0 / (3.0 * cp)
            return stats.truncnorm((-1.0 - shift) / sigma, (1.0 - shift) / sigma, shift, sigma)
        case Triangular(mode):
            return stats.triang(0.5 * (1.0 + mode), -1.0, 2.0)
        case Trapezoid(top):
            return stats.trapezoid(0.5 * (1.0 - top), 0.5 * (1.0 + top), -1.0, 2.0)
        case Beta(alpha, beta):
            return stats.beta(alpha, beta, -1.0, 2.0)
        case SkewNormal(skew, cp, shift):
            plain = stats.skewnorm(skew)
            scale = 1.0 / (3.0 * cp * plain.std())
            return stats.skewnorm(skew, shift - scale * plain.mean(), scale)
        case Rayleigh(cp):
            return stats.rayleigh(scale=1.0 / sqrt(-2.0 * stats.norm.logsf(3.0 * cp)))
        case Exponential(cp):
            return stats.expon(scale=-1.0 / stats.norm.logsf(3.0 * cp))
        case LogNormal(shape, cp):
            return stats.lognorm(shape, scale=np.exp(-3.0 * cp * shape))
        case Empirical(values):
            edges = np.sort(values)
            heights = 1.0 / (len(edges) - 1) / np.diff(edges)
            return stats.rv_histogram((heights, edges), density=True)
        case Mixture(centres, spreads, shares):
            weights = np.array(shares or [1.0] * len(centres))
            return NormalMixture(weights / weights.sum(), stats.norm(np.array(centres), np.array(spreads)))
        case _:
            return stats.uniform(-1.0, 2.0)


class NormalMixture(stats.rv_continuous):
    """Normal laws with weights, as a law of scipy, whose quantiles come from its own root finder."""

    def __init__(self, weights: Any, laws: Any) -> None:
        super().__init__(name="mixture")
        self.weights, self.laws = weights, laws

    def _pdf(self, x: Any, *_: Any) -> Any:
        return self.laws.pdf(np.asarray(x)[..., None]) @ self.weights

    def _cdf(self, x: Any, *_: Any) -> Any:
        return self.laws.cdf(np.asarray(x)[..., None]) @ self.weights

    def _stats(self, *_: Any, **__: Any) -> Any:
        mean = self.laws.mean() @ self.weights
        return mean, (self.laws.var() + self.laws.mean() ** 2) @ self.weights - mean**2, None, None


def integral(distribution: Distribution, order: int, upper: float) -> float:
    """E[u^order; u <= upper] by adaptive quadrature of the density of scipy, piece by piece.

    Where the density has a pole it runs over the probability instead, by the quantiles of scipy.
    """
    law = reference(distribution)
    low, high = distribution.support
    shares = [1e-9, 1e-3, 0.1, 0.5, 0.9, 0.999, 1.0 - 1e-9]
    if isinstance(distribution, Beta) and min(distribution.alpha, distribution.beta) < 1.0:
        return over(lambda p: law.ppf(p) ** order, 0.0, float(law.cdf(upper)), shares)
    corners = [law.mean(), *law.ppf(shares)]
    match distribution:
        case Triangular() | Trapezoid():
            corners += distribution.level
        case SkewNormal():
            skew, origin, scale = law.args
            corners += [origin + scale * k / skew for k in (-9, -3, 0, 3, 9)]
        case Exponential():
            high *= 2.0
        case LogNormal(shape, cp):
            corners += list(np.exp(shape * (np.arange(-8, 19, 2) - 3.0 * cp)))
            high = corners[-1]
        case Empirical(values):
            corners += values
        case Mixture(centres, spreads):
            corners += [c + k * s for c, s in zip(centres, spreads, strict=True) for k in (-8, -5, -2, 0, 2, 5, 8)]
    corners += [low, high]
    beyond = 0.3 * (high - low)  # what the support leaves out counts in the eighth moment
    return over(lambda u: u**order * law.pdf(u), low - beyond, min(upper, high + beyond), corners)


def over(function: Any, low: float, high: float, cuts: Sequence[float]) -> float:
    """Integral of a function over an interval, piece by piece."""
    ends = sorted({low, high, *(cut for cut in cuts if low < cut < high)})
    pieces = [quad(function, a, b, epsabs=1e-13, limit=200)[0] for a, b in pairwise(ends)]
    return float(sum(pieces))


@pytest.mark.parametrize("case", CASES, ids=repr)
def test_raw_moments_are_those_of_quadrature(case: Distribution) -> None:
    wanted = [integral(case, k, np.inf) for k in range(9)]
    np.testing.assert_allclose(case.raw_moments(8), wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("case", CASES, ids=repr)
@pytest.mark.parametrize("z", [-0.9, -0.2, 0.0, 0.35, 0.99])
def test_partial_moments_are_those_of_quadrature(case: Distribution, z: float) -> None:
    found = [float(part[0]) for part in case.partial_moments(np.array([z]))]
    wanted = [integral(case, k, z) for k in range(3)]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("case", CASES, ids=repr)
def test_quantile_is_that_of_scipy(case: Distribution) -> None:
    p = np.array([1e-9, 1e-4, 0.1, 0.5, 0.9973, 1.0 - 1e-9])
    np.testing.assert_allclose(case.quantile(p), reference(case).ppf(p), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("skew", [-1000.0, -3.0, 0.0, 0.5, 30.0, 1000.0])
def test_quantile_of_the_skew_normal_has_the_mass_asked_for(skew: float) -> None:
    """To rounding, in the middle and in both tails: a mass is the difference of two numbers."""
    tail = np.geomspace(1.01e-9, 0.5, 200)
    p, case = np.concatenate([tail, 1.0 - tail]), SkewNormal(skew)
    np.testing.assert_allclose(case.partial_moments(case.quantile(p))[0], p, rtol=0.0, atol=2e-15)


@pytest.mark.parametrize("kind", [Normal, TruncatedNormal])
def test_capable_process_shrinks_to_its_shift(kind: type[Normal] | type[TruncatedNormal]) -> None:
    case = kind(cp=1e6, shift=0.25)
    moments = case.raw_moments(4)
    np.testing.assert_allclose(moments, 0.25 ** np.arange(5), rtol=1e-9)
    np.testing.assert_allclose(case.quantile(np.array([0.01, 0.99])), 0.25, rtol=1e-5)


def test_inspection_does_nothing_to_a_capable_process() -> None:
    z = np.linspace(-0.6, 0.6, 7)
    inspected, free = TruncatedNormal(cp=3.0, shift=0.1), Normal(cp=3.0, shift=0.1)
    np.testing.assert_allclose(inspected.raw_moments(8), free.raw_moments(8), rtol=1e-10)
    np.testing.assert_allclose(inspected.partial_moments(z), free.partial_moments(z), rtol=1e-10, atol=1e-12)


def test_incapable_process_after_inspection_is_uniform() -> None:
    found = TruncatedNormal(cp=0.02).raw_moments(4)  # scale 17 half-widths: flat to 2e-3
    np.testing.assert_allclose(found, Uniform().raw_moments(4), atol=1e-3)


shift = st.floats(-1.0, 1.0)
any_input = st.one_of(
    st.just(Uniform()),
    st.builds(Normal, st.floats(0.2, 5.0), shift),
    st.builds(TruncatedNormal, st.floats(0.2, 5.0), shift),
    st.builds(Triangular, shift),
    st.builds(Trapezoid, st.floats(0.0, 1.0)),
    st.builds(Beta, st.floats(0.5, 500.0), st.floats(0.5, 500.0)),
    st.builds(SkewNormal, st.floats(-1000.0, 1000.0), st.floats(0.2, 5.0), shift),
    st.builds(Rayleigh, st.floats(0.2, 5.0)),
    st.builds(Exponential, st.floats(0.2, 5.0)),
    st.builds(LogNormal, st.floats(0.01, 1.0), st.floats(0.2, 5.0)),
    st.builds(Empirical, st.lists(st.integers(-9, 9), min_size=2, max_size=30, unique=True)),
)


@given(any_input, st.lists(st.floats(1e-6, 1.0 - 1e-6), min_size=2, max_size=8))
def test_quantile_inverts_the_mass_and_rises(case: Distribution, chosen: list[float]) -> None:
    p = np.sort(np.array(chosen))
    z = case.quantile(p)
    assert np.all(np.diff(z) >= 0.0)
    # 1e-7: where a density has a pole at -1 or 1, the step of z next to it is worth that much
    np.testing.assert_allclose(case.partial_moments(z)[0], p, rtol=1e-7, atol=1e-7)


@given(any_input)
def test_partial_moments_end_at_the_raw_moments(case: Distribution) -> None:
    low, high = case.support
    ends = np.array([low - 1.0, high + 1.0])
    parts = np.array(case.partial_moments(ends))
    np.testing.assert_allclose(parts[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(parts[:, 1], case.raw_moments(2), atol=1e-12)


@given(any_input)
def test_moments_are_those_of_a_distribution(case: Distribution) -> None:
    m = case.raw_moments(4)
    np.testing.assert_allclose(m[0], 1.0, rtol=1e-12)
    assert m[2] - m[1] ** 2 >= 0.0
    assert m[4] - m[2] ** 2 >= -1e-12


def test_registry_names_every_distribution() -> None:
    assert set(DISTRIBUTIONS.values()) == {type(case) for case in CASES}


@pytest.mark.parametrize("top", [0.0, 0.3, 1.0])
def test_trapezoid_is_the_sum_of_two_uniform_errors(top: float) -> None:
    a, b = 0.5 * (1.0 + top), 0.5 * (1.0 - top)
    second, fourth = (a**2 + b**2) / 3.0, (a**4 + b**4) / 5.0 + 6.0 * a**2 * b**2 / 9.0
    found = Trapezoid(top).raw_moments(5)
    np.testing.assert_allclose(found, [1.0, 0.0, second, 0.0, fourth, 0.0], rtol=1e-14, atol=0.0)


def test_special_cases_of_the_shapes() -> None:
    z = np.linspace(-0.99, 0.99, 9)
    pairs: list[tuple[Distribution, Distribution]] = [
        (Beta(1.0, 1.0), Uniform()),
        (Beta(2.0, 1.0), Triangular(1.0)),
        (Trapezoid(0.0), Triangular()),
        (Trapezoid(1.0), Uniform()),
        (SkewNormal(0.0, 1.33, 0.2), Normal(1.33, 0.2)),
        (Empirical((1.0, -1.0)), Uniform()),
    ]
    for one, other in pairs:
        np.testing.assert_allclose(one.raw_moments(8), other.raw_moments(8), rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(one.partial_moments(z), other.partial_moments(z), atol=1e-14)


@pytest.mark.parametrize("order", range(1, 9))
def test_arcsine_moments(order: int) -> None:
    """E[cos(angle)^k] of a uniform angle: (k - 1)!!/k!! for even k."""
    wanted = 0.0 if order % 2 else gamma((order + 1) / 2) / (sqrt(pi) * gamma(order / 2 + 1))
    found = Beta(0.5, 0.5).raw_moments(8)[order]
    np.testing.assert_allclose(found, wanted, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("skew", [-1000.0, -30.0, -1.0, 0.5, 3.0, 200.0])
def test_skew_normal_keeps_mean_and_spread(skew: float) -> None:
    """Skewness by the closed form of Azzalini (1985)."""
    m = SkewNormal(skew, 1.25, -0.3).raw_moments(3)
    std = 1.0 / 3.75
    np.testing.assert_allclose([m[1], sqrt(m[2] - m[1] ** 2)], [-0.3, std], rtol=1e-13)
    third = (m[3] - 3.0 * m[1] * m[2] + 2.0 * m[1] ** 3) / std**3
    mean = skew / sqrt(1.0 + skew**2) * sqrt(2.0 / pi)
    wanted = 0.5 * (4.0 - pi) * (mean / sqrt(1.0 - mean**2)) ** 3
    np.testing.assert_allclose(third, wanted, rtol=1e-11)


@pytest.mark.parametrize("cp", [0.3, 1.0, 1.67])
def test_eccentricity_exceeds_its_limit_as_often_as_a_normal_input_one_of_its(cp: float) -> None:
    one = np.array([1.0])
    for law in (Rayleigh(cp), Exponential(cp), LogNormal(0.4, cp)):
        beyond = 1.0 - law.partial_moments(one)[0]
        np.testing.assert_allclose(beyond, 1.0 - Normal(cp).partial_moments(one)[0], rtol=1e-8)
        assert law.one_sided


def test_components_of_an_eccentricity_are_normal() -> None:
    """The mean square of the radius is that of two components of one standard deviation."""
    case = Rayleigh(1.2)
    np.testing.assert_allclose(case.raw_moments(2)[2], 2.0 * case.sigma**2, rtol=1e-14)
    assert case.quantile(np.array([0.0, 1.0])).tolist() == list(case.support)


def test_equal_measurements_are_an_atom() -> None:
    case = Empirical([0.5, -0.5, 0.5, 0.5])  # type: ignore[arg-type]
    assert case.values == (0.5, -0.5, 0.5, 0.5)
    third = 1.0 / 3.0  # uniform on [-0.5, 0.5]; the rest is at 0.5
    np.testing.assert_allclose(case.raw_moments(2), [1.0, third, third / 12.0 + third / 2.0])
    mass, first, second = case.partial_moments(np.array([-0.6, 0.0, 0.499999999999, 0.5]))
    np.testing.assert_allclose(mass, [0.0, third / 2.0, third, 1.0], atol=1e-11)
    np.testing.assert_allclose(first, [0.0, -third / 8.0, 0.0, third], atol=1e-11)
    np.testing.assert_allclose(second[[1, 3]], [third / 24.0, 7.0 / 36.0], atol=1e-14)
    np.testing.assert_allclose(case.quantile(np.array([0.0, 1 / 6, 0.4, 1.0])), [-0.5, 0, 0.5, 0.5])


def test_empirical_quantiles_are_those_of_numpy() -> None:
    sample = np.random.default_rng(3).normal(0.1, 0.3, 101)
    p = np.linspace(0.0, 1.0, 37)
    found = Empirical(tuple(sample)).quantile(p)
    np.testing.assert_allclose(found, np.quantile(sample, p), rtol=1e-12)


BAD: list[tuple[Distribution, str, str]] = [
    (Normal(0.0), "cp", "must be above 0, got 0"),
    (TruncatedNormal(1.0, -1.5), "shift", "must lie in [-1, 1], got -1.5"),
    (Triangular(1.1), "mode", "must lie in [-1, 1], got 1.1"),
    (Trapezoid(-0.1), "top", "must lie in [0, 1], got -0.1"),
    (Beta(0.0, 1.0), "alpha", "must be above 0, got 0"),
    (Beta(1.0, -2.0), "beta", "must be above 0, got -2"),
    (SkewNormal(2000.0), "skew", "must lie in [-1000, 1000], got 2000"),
    (Rayleigh(-1.0), "cp", "must be above 0, got -1"),
    (Exponential(0.0), "cp", "must be above 0, got 0"),
    (LogNormal(1.5), "shape", "must lie in (0, 1], got 1.5"),
    (Empirical((0.0, 2e6)), "values", "must lie in [-1000000, 1000000], got 2000000"),
    (Empirical((0.5, 0.5)), "values", "need at least two distinct deviations, in half-widths"),
    (Empirical(()), "values", "need at least two distinct deviations, in half-widths"),
]


@pytest.mark.parametrize(("case", "parameter", "message"), BAD, ids=lambda one: repr(one)[:40])
def test_a_parameter_outside_of_its_range_is_a_fault(case: Distribution, parameter: str, message: str) -> None:
    assert case.faults() == [(parameter, message)]


@pytest.mark.parametrize("case", CASES, ids=repr)
def test_sound_parameters_have_no_fault(case: Distribution) -> None:
    assert case.faults() == []


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_zone_of_limits_has_these_limits(lower: float, width: float) -> None:
    zone = Zone.of_limits(lower, lower + width)
    assert zone.half_width > 0.0
    np.testing.assert_allclose([zone.lower, zone.upper], [lower, lower + width], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "mid", "half"),
    [("+0.02/-0.01", 0.005, 0.015), ("-0.01 / +0.02", 0.005, 0.015), ("0/-2e-3", -0.001, 0.001)],
)
def test_zone_of_text(text: str, mid: float, half: float) -> None:
    zone = Zone.of_text(text)
    np.testing.assert_allclose([zone.mid, zone.half_width], [mid, half], rtol=1e-12)


@pytest.mark.parametrize("text", ["", "0.02", "+-0.02", "a/b", "0.1/0.2/0.3", "1.2.3/0", "./0"])
def test_zone_refuses_text_that_is_no_pair_of_limits(text: str) -> None:
    with pytest.raises(ValueError, match=r"write limits|could not convert"):
        Zone.of_text(text)


@pytest.mark.parametrize(("lower", "upper"), [(0.2, 0.1), (0.1, 0.1), (float("nan"), 1.0)])
def test_zone_refuses_reversed_limits(lower: float, upper: float) -> None:
    with pytest.raises(ValueError, match="lower limit must be below"):
        Zone.of_limits(lower, upper)
