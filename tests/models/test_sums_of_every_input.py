"""Sums of every kind of input: closed forms, quadrature over scipy's laws, the three methods."""

from collections.abc import Callable
from math import erf, exp, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from tests.models.test_propagation import irwin_hall, term
from tolevo.models.inputs import (
    Beta,
    Distribution,
    Empirical,
    Exponential,
    LogNormal,
    Normal,
    Rayleigh,
    SkewNormal,
    Trapezoid,
    Triangular,
    Uniform,
)
from tolevo.models.propagation import ClippedSum, Convolution, Moments, MonteCarlo, Propagated, Term

Array = NDArray[np.float64]
ESTIMATES = ("mean", "std", "quantile", "conforming", "negative")
SAMPLE = (-0.7, -0.1, 0.05, 0.2, 0.9)
HISTOGRAM = stats.rv_histogram((0.25 / np.diff(SAMPLE), np.array(SAMPLE)), density=True)
LAWS: list[tuple[Distribution, Any]] = [
    (Triangular(-0.4), stats.triang(0.3, -1.0, 2.0)),
    (Triangular(1.0), stats.triang(1.0, -1.0, 2.0)),
    (Trapezoid(0.6), stats.trapezoid(0.2, 0.8, -1.0, 2.0)),
    (Beta(2.0, 5.0), stats.beta(2.0, 5.0, -1.0, 2.0)),
    (Beta(0.5, 0.5), stats.beta(0.5, 0.5, -1.0, 2.0)),
    (Beta(200.0, 3.0), stats.beta(200.0, 3.0, -1.0, 2.0)),
    (Beta(0.02, 10.0), stats.beta(0.02, 10.0, -1.0, 2.0)),
    (SkewNormal(4.0, 0.8, 0.2), None),
    (SkewNormal(-30.0), None),
    (Rayleigh(), stats.rayleigh(scale=1.0 / sqrt(-2.0 * stats.norm.logsf(3.0)))),
    (Exponential(), stats.expon(scale=-1.0 / stats.norm.logsf(3.0))),
    (LogNormal(0.4), stats.lognorm(0.4, scale=np.exp(-1.2))),
    (Empirical(SAMPLE), HISTOGRAM),
]
IDS = [repr(case) for case, _ in LAWS]


def law_of(case: Distribution, law: Any) -> Any:
    """The law of scipy; a skew normal is scaled to its mean and spread by scipy's own."""
    if not isinstance(case, SkewNormal):
        return law
    plain = stats.skewnorm(case.skew)
    scale = 1.0 / (3.0 * case.cp * plain.std())
    return stats.skewnorm(case.skew, case.shift - scale * plain.mean(), scale)


def propagated(clipped: list[Term], free: list[Term], coverage: float, limit: float) -> Propagated:
    """A single design by convolution."""
    return Convolution().propagate(ClippedSum(tuple(free), tuple(clipped)), coverage, limit)


NOTHING = term(Uniform(), 0.0, 0.0)


def assert_covered(found: Propagated, wanted: dict[str, float], most: float = 5e-4) -> None:
    """Every wanted statistic lies within the error that is stated, and that error is small."""
    for name, exact in wanted.items():
        estimate = getattr(found, name)
        stated = float(estimate.error[0]) + 1e-7  # 1e-7: of the quadrature
        assert stated < most, name
        np.testing.assert_allclose(estimate.value, exact, rtol=0.0, atol=stated, err_msg=name)


def over_units(law: Any, function: Callable[[Array], Array]) -> float:
    """E[function(z)] by Gauss-Legendre over the probability, closer panels towards its ends."""
    tail = 10.0 ** np.arange(-12, -1)
    edges = np.concatenate([[0.0], tail, np.linspace(0.02, 0.98, 97), 1.0 - tail[::-1], [1.0]])
    node, weight = np.polynomial.legendre.leggauss(40)
    half = 0.5 * np.diff(edges)[:, None]
    p = edges[:-1, None] + half * (1.0 + node)
    return float(np.sum(half * weight * function(law.ppf(p))))


@pytest.mark.parametrize(("case", "given"), LAWS, ids=IDS)
@pytest.mark.parametrize(("linear", "quadratic"), [(0.8, None), (-0.8, None), (0.3, -0.7)])
def test_clipped_sum_is_that_of_quadrature(
    case: Distribution, given: Any, linear: float, quadratic: float | None
) -> None:
    """X = max(0, a + b z + c z^2 + w) for a uniform w: moments over z by quadrature."""
    law, width, limit = law_of(case, given), 0.25, 0.4
    bend = quadratic or 0.0
    constant = 0.1 - linear * law.mean() - bend * (law.var() + law.mean() ** 2)  # mean 0.1

    def line(z: Array) -> Array:
        return np.asarray(constant + linear * z + bend * z * z)

    def clipped(z: Array, power: int) -> Array:
        """E[max(0, y + w)^power]."""
        high, low = (np.maximum(line(z) + end, 0.0) for end in (width, -width))
        return np.asarray((high ** (power + 1) - low ** (power + 1)) / (2.0 * width * (power + 1)))

    def below(z: Array, at: float) -> Array:
        return np.asarray(np.clip((at - line(z) + width) / (2.0 * width), 0.0, 1.0))

    mean = over_units(law, lambda z: clipped(z, 1))
    square = over_units(law, lambda z: clipped(z, 2))
    conforming = over_units(law, lambda z: below(z, limit))
    parts = [term(case, constant, linear, quadratic), term(Uniform(), 0.0, width)]
    found = propagated(parts, [NOTHING], 0.99, limit)
    assert_covered(found, {
        "mean": mean,
        "std": sqrt(square - mean**2),
        "conforming": conforming,
        "negative": over_units(law, lambda z: below(z, 0.0)),
    })  # fmt: skip
    level = float(propagated(parts, [NOTHING], conforming, limit).quantile.value[0])
    if conforming < 1.0 - 1e-6:
        reached = over_units(law, lambda z: below(z, level))
        np.testing.assert_allclose(reached, conforming, atol=5e-5)


@pytest.mark.parametrize(("case", "given"), LAWS, ids=IDS)
def test_two_of_a_kind(case: Distribution, given: Any) -> None:
    """P(z_1 - z_2/2 <= x) = E[1 - F(2 (z_1 - x))]: poles meet poles, no uniform smooths them."""
    law, limit = law_of(case, given), 0.13
    free = [term(case, 0.0, 1.0), term(case, 0.0, -0.5)]
    conforming = over_units(law, lambda z: law.sf(2.0 * (z - limit)))
    found = propagated([term(Uniform(), 0.0, 0.0)], free, 0.9, limit)
    wanted = {"mean": 0.5 * law.mean(), "std": sqrt(1.25 * law.var())}
    assert_covered(found, wanted)
    # a probability next to a pole changes with the root of the step
    slack = 2e-3 if isinstance(case, Beta) and case.alpha < 1.0 else 2e-5
    np.testing.assert_allclose(found.conforming.value, conforming, atol=slack)


@pytest.mark.parametrize(("case", "given"), LAWS, ids=IDS)
@pytest.mark.parametrize("method", [Moments(), Convolution()], ids=["moments", "convolution"])
def test_mean_and_spread_of_a_sum_that_never_clips(
    case: Distribution, given: Any, method: Moments | Convolution
) -> None:
    law = law_of(case, given)
    total = ClippedSum((term(case, 1.0, 0.4),), (term(case, 40.0, -0.7), term(Uniform(), 0, 0.5)))
    found = method.propagate(total, 0.9, 41.0)
    mean, std = 41.0 - 0.3 * law.mean(), sqrt(0.65 * law.var() + 0.25 / 3.0)
    np.testing.assert_allclose(found.geometric_mean, mean, rtol=1e-12)
    np.testing.assert_allclose(found.geometric_std, std, rtol=1e-10)
    tolerance = 1e-9 if isinstance(method, Moments) else 1e-4
    # 1e-8: masses that rounding makes negative are put to 0, and 41 is far from the origin
    np.testing.assert_allclose(found.mean.value, mean, rtol=1e-8)
    np.testing.assert_allclose(found.std.value, std, rtol=tolerance)


@pytest.mark.parametrize(("case", "given"), LAWS, ids=IDS)
def test_monte_carlo_agrees(case: Distribution, given: Any) -> None:
    """The mean against scipy, the rest against the convolution."""
    law = law_of(case, given)
    total = ClippedSum((term(case, 1.0, 0.4),), (term(case, 0.2, -0.7), term(Uniform(), 0, 0.5)))
    method = MonteCarlo.draw(1 << 15, 3, np.random.default_rng(5))
    found, exact = (m.propagate(total, 0.95, 1.5) for m in (method, Convolution()))
    np.testing.assert_allclose(found.geometric_mean, 1.2 - 0.3 * law.mean(), rtol=1e-10)
    for name in ESTIMATES:
        sampled, other = getattr(found, name), getattr(exact, name)
        away = abs(float(sampled.value[0] - other.value[0]))
        assert away <= 4.0 * sampled.error[0] + other.error[0] + 1e-5, name


@pytest.mark.parametrize("x", [0.5, 1.3, 2.0, 3.7])
def test_two_triangles_are_four_uniforms(x: float) -> None:
    free = [term(Triangular(), 1.0, 1.0), term(Trapezoid(0.0), 1.0, 1.0)]
    exact = irwin_hall(4, x)
    found = propagated([NOTHING], free, exact, x)
    wanted = {"mean": 2.0, "std": sqrt(1.0 / 3.0), "conforming": exact, "quantile": x}
    assert_covered(found, wanted)


@pytest.mark.parametrize("skew", [-30.0, 2.0])
def test_skew_normal_and_normal_make_a_skew_normal(skew: float) -> None:
    """Y + s U has the shape skew/sqrt(1 + s^2 (1 + skew^2)) and the scale sqrt(1 + s^2)."""
    spread, limit = 0.5, 0.3
    plain = stats.skewnorm(skew)
    parts = [term(SkewNormal(skew, 1.0 / 3.0), plain.mean(), plain.std())]
    parts.append(term(Normal(1.0 / 3.0), 0.0, spread))
    exact = stats.skewnorm(skew / sqrt(1.0 + spread**2 * (1.0 + skew**2)), 0.0, sqrt(1.25))
    found = propagated(parts, [NOTHING], 0.97, limit)
    assert_covered(found, {
        "quantile": max(float(exact.ppf(0.97)), 0.0),
        "conforming": float(exact.cdf(limit)),
        "negative": float(exact.cdf(0.0)),
    })  # fmt: skip


def test_square_of_an_eccentricity_is_exponential() -> None:
    """The density of sum z^2 is that of an exponential: one-sided, with its peak at the end."""
    case = Rayleigh(0.8)
    scale = 2.0 * case.sigma**2
    found = propagated([term(case, 0.0, 0.0, 1.0)], [NOTHING], 0.99, 0.2)
    assert_covered(found, {"mean": scale, "std": scale, "conforming": 1.0 - exp(-0.2 / scale)})
    np.testing.assert_allclose(found.quantile.value, -scale * np.log(0.01), rtol=1e-5)


def test_two_eccentricities_in_closed_form() -> None:
    """P(r_1 + r_2 <= x) of two Rayleigh radii with sigma 1."""
    case, x = Rayleigh(), 2.5
    free = [term(case, 0.0, 1.0 / case.sigma)] * 2
    exact = 1.0 - exp(-(x**2) / 2.0) - sqrt(np.pi) / 2.0 * x * exp(-(x**2) / 4.0) * erf(x / 2.0)
    found = propagated([NOTHING], free, exact, x)
    assert_covered(found, {"conforming": exact, "quantile": x, "mean": sqrt(2.0 * np.pi)})


def test_a_rare_outlier_is_not_folded_onto_other_values() -> None:
    """2000 deviations near 0 and one at 50, which lies 45 standard deviations out."""
    case = Empirical((*np.linspace(-0.5, 0.5, 2000), 50.0))
    found = propagated([NOTHING], [term(case, 0.0, 1.0), term(Uniform(), 0.0, 0.5)], 0.9, 2.0)
    beyond = 48.0 / 49.5 / 2000.0  # of the last interval, uniform from 0.5 to 50
    np.testing.assert_allclose(found.conforming.value, 1.0 - beyond, atol=1e-6)
    mean = case.raw_moments(1)[1]
    np.testing.assert_allclose(found.mean.value, mean, rtol=1e-9)
    np.testing.assert_allclose(mean, 25.25 / 2000.0, rtol=1e-9)


def test_atoms_of_equal_measurements() -> None:
    """Half of the units at 0, the other half uniform on [0, 1]; nothing else in the sum."""
    case = Empirical((0.0, 0.0, 1.0))
    found = propagated([NOTHING], [term(case, 0.0, 1.0)], 0.75, 0.25)
    assert_covered(found, {"conforming": 0.625, "quantile": 0.5, "mean": 0.25})
