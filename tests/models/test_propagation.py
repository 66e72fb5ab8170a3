"""Propagation against closed forms and quadrature; the three methods against each other."""

import tracemalloc
from math import comb, erf, factorial, pi, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import norm

from tolevo.models.inputs import Distribution, Normal, TruncatedNormal, Uniform
from tolevo.models.propagation import (
    ClippedSum,
    Convolution,
    Estimate,
    Moments,
    MonteCarlo,
    Propagated,
    Propagation,
    Term,
)
from tolevo.models.stack.mechanism import Mechanism, Sample

ESTIMATES = ("mean", "std", "quantile", "conforming", "negative")
UNIT = Normal(cp=1.0 / 3.0)  # standard normal


def term(law: Distribution, constant: float, linear: float, quadratic: float | None = None) -> Term:
    bent = None if quadratic is None else np.array([quadratic])
    return Term(law, np.array([constant]), np.array([linear]), bent)


NOTHING = term(Uniform(), 0.0, 0.0)


def designs(n: int, seed: int) -> ClippedSum:
    """Random sums of nine clipped and two free terms, one of them bent, of unlike scales."""
    rng = np.random.default_rng(seed)
    laws = [Uniform(), Normal(1.0, 0.1), TruncatedNormal(0.6, -0.3)]
    clipped = [Term(laws[i % 3], rng.uniform(-0.3, 0.3, n), rng.uniform(-1.0, 1.0, n)) for i in range(8)]
    bent = Term(Uniform(), np.zeros(n), rng.uniform(-0.3, 0.3, n), rng.uniform(-1.0, 1.0, n))
    free = [Term(Uniform(), rng.uniform(0.0, 2.0, n), rng.uniform(0.1, 1.0, n)) for _ in range(2)]
    return ClippedSum(tuple(free), (*clipped, bent))


def monte_carlo(samples: int, seed: int = 0) -> MonteCarlo:
    return MonteCarlo.draw(samples, 11, np.random.default_rng(seed))


def propagated(clipped: list[Term], free: list[Term], coverage: float, limit: float, points: int = 4096) -> Propagated:
    """A single design by convolution."""
    total = ClippedSum(tuple(free), tuple(clipped))
    return Convolution(points).propagate(total, coverage, limit)


def one(clipped: list[Term], free: list[Term], coverage: float, limit: float, points: int = 4096) -> dict[str, float]:
    """The statistics of a single design by convolution."""
    found = propagated(clipped, free, coverage, limit, points)
    return {name: float(getattr(found, name).value[0]) for name in ESTIMATES}


def assert_within_stated_error(found: Propagated, name: str, exact: float) -> None:
    """The exact value lies within the error stated, and that error is small."""
    estimate = getattr(found, name)
    assert abs(estimate.value[0] - exact) <= estimate.error[0] + 1e-9, name
    assert estimate.error[0] < 1e-4, name


def assert_within_stated(
    clipped: list[Term], free: list[Term], coverage: float, limit: float, wanted: dict[str, float]
) -> None:
    """Every wanted statistic lies within the error that the convolution states."""
    total = ClippedSum(tuple(free), tuple(clipped))
    found = Convolution().propagate(total, coverage, limit)
    for name, exact in wanted.items():
        estimate: Estimate = getattr(found, name)
        stated = float(estimate.error[0]) + 1e-9  # 1e-9: of the closed form or quadrature
        assert stated < 2e-4, name
        np.testing.assert_allclose(estimate.value, exact, rtol=0.0, atol=stated, err_msg=name)


def density(law: Distribution, z: float) -> float:
    """Density of z, by scipy."""
    if isinstance(law, Uniform):
        return 0.5
    assert isinstance(law, Normal | TruncatedNormal)
    found = float(norm.pdf(z, law.shift, law.sigma))
    if isinstance(law, TruncatedNormal):
        found /= float(np.diff(norm.cdf([-1.0, 1.0], law.shift, law.sigma))[0])
    return found


def irwin_hall(n: int, x: float) -> float:
    """P(sum of n uniforms on [0, 1] <= x)."""
    below = range(int(x) + 1)
    return float(sum((-1) ** k * comb(n, k) * (x - k) ** n for k in below) / factorial(n))


@pytest.mark.parametrize("x", [0.5, 1.3, 2.0, 2.9, 3.7])
def test_sum_of_four_uniforms_is_irwin_hall(x: float) -> None:
    clipped, free = [term(Uniform(), 0.5, 0.5)] * 2, [term(Uniform(), 0.5, -0.5)] * 2
    exact = irwin_hall(4, x)
    found = one(clipped, free, exact, x)
    np.testing.assert_allclose(found["conforming"], exact, atol=1e-6)
    np.testing.assert_allclose(found["quantile"], x, atol=1e-5)
    np.testing.assert_allclose([found["mean"], found["std"]], [2.0, sqrt(1.0 / 3.0)], rtol=1e-6)
    np.testing.assert_allclose(found["negative"], 0.0, atol=1e-6)


@pytest.mark.parametrize("mean", [-1.5, 0.0, 0.4, 3.0])
def test_clipped_normal_in_closed_form(mean: float) -> None:
    sigma, level, limit = 0.7, 0.9987, 1.5
    a = mean / sigma
    peak, mass = float(norm.pdf(a)), float(norm.cdf(a))
    first = mean * mass + sigma * peak
    second = (mean**2 + sigma**2) * mass + mean * sigma * peak
    wanted = {
        "mean": first,
        "std": sqrt(second - first**2),
        "quantile": mean + sigma * float(norm.ppf(level)),
        "conforming": float(norm.cdf((limit - mean) / sigma)),
        "negative": float(norm.cdf(-a)),
    }
    assert_within_stated([term(UNIT, mean, sigma)], [NOTHING], level, limit, wanted)


def test_interference_of_a_normal_sum() -> None:
    found = one([term(UNIT, 0.2, 0.3), term(UNIT, -0.5, -0.4)], [NOTHING], 0.99, 1.0)
    np.testing.assert_allclose(found["negative"], 0.5 * (1.0 + erf(0.6 / sqrt(2.0))), atol=1e-6)


@pytest.mark.parametrize(
    ("linear", "quadratic"), [(0.3, -1.2), (0.3, 1.2), (-0.055, -1.26), (1.0, 0.1), (0.0, 0.8), (0.0, -0.8), (0.7, 0.0)]
)
@pytest.mark.parametrize("law", [Uniform(), Normal(1.0, 0.2), TruncatedNormal(0.5, -0.4)], ids=repr)
def test_bent_contribution_is_that_of_quadrature(law: Distribution, linear: float, quadratic: float) -> None:
    """X = max(0, a + b z + c z^2 + w) for a uniform w: moments over z by quadrature."""
    width, constant, limit = 0.25, 0.1, 0.4

    def clipped(y: float, power: int) -> float:
        """E[max(0, y + w)^power]."""
        high, low = max(y + width, 0.0), max(y - width, 0.0)
        return (high ** (power + 1) - low ** (power + 1)) / (2.0 * width * (power + 1))

    def below(y: float, at: float) -> float:
        return min(max((at - y + width) / (2.0 * width), 0.0), 1.0)

    def over_units(function: Any) -> float:
        """E[function(y)] over the density of z."""
        low, high = law.support

        def at(z: float) -> float:
            return float(function(constant + linear * z + quadratic * z * z)) * density(law, z)

        cuts = list(np.linspace(low, high, 40)[1:-1])
        return float(quad(at, low, high, points=cuts, limit=2000, epsabs=1e-10)[0])

    mean, square = over_units(lambda y: clipped(y, 1)), over_units(lambda y: clipped(y, 2))
    wanted = {
        "mean": mean,
        "std": sqrt(square - mean**2),
        "conforming": over_units(lambda y: below(y, limit)),
        "negative": over_units(lambda y: below(y, 0.0)),
    }
    parts = [term(law, constant, linear, quadratic), term(Uniform(), 0.0, width)]
    found = one(parts, [NOTHING], 0.99, limit)
    for name, exact in wanted.items():
        # points^-2 with up to 10 units of range: 2e-5 is 8 (range/points)^2 / (2 width)
        np.testing.assert_allclose(found[name], exact, rtol=0.0, atol=2e-5, err_msg=name)


def test_many_unbounded_free_inputs_do_not_wrap_round() -> None:
    """The bounds of 20 normals are far wider than the nine standard deviations of their sum."""
    found = one([term(Uniform(), 1.0, 0.5)], [term(Normal(), 0.0, 1.0)] * 20, 0.99, 1.0)
    np.testing.assert_allclose(found["mean"], 1.0, atol=1e-6)
    # each term adds up to step^2/4 of variance: 20 of them on 28/4096 make 8e-5 of it
    np.testing.assert_allclose(found["std"], sqrt(20.0 / 9.0 + 0.25 / 3.0), atol=8e-5)
    np.testing.assert_allclose(found["conforming"], 0.5, atol=1e-6)


def test_constants_alone_and_zero_width_inputs() -> None:
    free = [term(Uniform(), 1.0, 0.0), term(Uniform(), 2.0, 1.0)]
    found = one([term(Uniform(), 0.25, 0.0), term(UNIT, 0.25, 0.0)], free, 0.9, 3.0)
    np.testing.assert_allclose(found["mean"], 3.5, rtol=1e-6)
    np.testing.assert_allclose(found["std"], 1.0 / sqrt(3.0), rtol=1e-5)
    np.testing.assert_allclose(found["quantile"], 4.3, rtol=1e-5)
    np.testing.assert_allclose(found["conforming"], 0.25, atol=1e-6)
    assert found["negative"] == pytest.approx(0.0, abs=1e-9)


def test_one_dominating_input() -> None:
    found = one([term(Uniform(), 5.0, 1e-7)], [term(Uniform(), 0.0, 1.0)], 0.975, 5.5)
    np.testing.assert_allclose(found["quantile"], 5.95, atol=1e-5)
    np.testing.assert_allclose(found["conforming"], 0.75, atol=1e-5)


@pytest.mark.parametrize("shift", [-1e4, -100.0, 100.0, 1e4])
def test_clipped_part_far_from_zero(shift: float) -> None:
    found = one([term(Uniform(), shift, 1.0)], [term(Uniform(), 1.0, 1.0)], 0.9, 1.0)
    if shift < 0.0:
        mean, std, quantile, conforming = 1.0, 1.0 / sqrt(3.0), 1.8, 0.5
    else:
        mean, std, quantile, conforming = shift + 1.0, sqrt(2.0 / 3.0), shift + 1.0, 0.0
        quantile += 2.0 - sqrt(0.8)  # triangular on [-2, 2]: P(above) = (2 - x)^2 / 8
    np.testing.assert_allclose(found["mean"], mean, atol=1e-6)
    np.testing.assert_allclose(found["std"], std, atol=1e-5)
    np.testing.assert_allclose(found["quantile"], quantile, atol=1e-5)
    np.testing.assert_allclose(found["conforming"], conforming, atol=1e-6)
    np.testing.assert_allclose(found["negative"], float(shift < 0.0), atol=1e-9)


def test_lattice_error_falls_with_the_square_of_the_points() -> None:
    variance = 0.5 * (1.0 - 1.0 / pi) * 0.25  # of max(0, x), x ~ N(0, 0.5)
    errors = [
        abs(one([term(UNIT, 0.0, 0.5)], [NOTHING], 0.9, 1.0, n)["std"] - sqrt(variance)) for n in (256, 512, 1024, 2048)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.2)


METHODS: list[Propagation] = [Convolution(1024), Moments(), monte_carlo(2048)]


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_batch_equals_row_by_row(method: Propagation) -> None:
    total = designs(9, 1)
    batch = method.propagate(total, 0.9973, 2.0)
    rows = [method.propagate(total.rows(slice(i, i + 1)), 0.9973, 2.0) for i in range(9)]
    for name in ESTIMATES:
        single = np.concatenate([getattr(row, name).value for row in rows])
        np.testing.assert_allclose(getattr(batch, name).value, single, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_geometric_mean_and_spread_are_exact(method: Propagation) -> None:
    total = designs(5, 2)
    found = method.propagate(total, 0.99, 2.0)
    mean, variance = np.zeros(5), np.zeros(5)
    for part in (*total.clipped, *total.free):
        m = part.distribution.raw_moments(4)
        bent = np.zeros(5) if part.quadratic is None else part.quadratic
        first = part.linear * m[1] + bent * m[2]
        square = part.linear**2 * m[2] + 2.0 * part.linear * bent * m[3] + bent**2 * m[4]
        mean, variance = mean + part.constant + first, variance + square - first**2
    np.testing.assert_allclose(found.geometric_mean, mean, rtol=1e-12)
    np.testing.assert_allclose(found.geometric_std, np.sqrt(variance), rtol=1e-12)


def distance(found: Propagated, other: Propagated, name: str) -> tuple[NDArray[np.float64], Estimate, Estimate]:
    a, b = getattr(found, name), getattr(other, name)
    return np.abs(a.value - b.value), a, b


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", ["mean", "std", "conforming", "negative"])
def test_monte_carlo_agrees_with_convolution(name: str, seed: int) -> None:
    total = designs(20, seed)
    exact = Convolution().propagate(total, 0.99, 3.0)
    away, sampled, stated = distance(monte_carlo(1 << 16, seed).propagate(total, 0.99, 3.0), exact, name)
    assert np.all(away <= 4.0 * sampled.error + stated.error + 1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_monte_carlo_quantile_agrees_with_convolution(seed: int) -> None:
    total = designs(20, seed)
    exact = Convolution().propagate(total, 0.95, 3.0)
    found = monte_carlo(1 << 16, seed).propagate(total, 0.95, 3.0)
    away, sampled, stated = distance(found, exact, "quantile")
    assert np.all(away <= 4.0 * sampled.error + stated.error + 1e-5)


@pytest.mark.parametrize("name", ESTIMATES)
def test_stated_error_of_the_convolution_covers_a_finer_lattice(name: str) -> None:
    total = designs(20, 3)
    coarse, fine = (Convolution(n).propagate(total, 0.9973, 2.0) for n in (2048, 16384))
    away, stated, _ = distance(coarse, fine, name)
    scale = 1.0 if name in ("conforming", "negative") else coarse.geometric_std
    # where fine - coarse changes sign the difference vanishes by chance: second-order floor
    assert np.all(away <= stated.error + 1e-6 * scale)


def all_normal(n: int, seed: int) -> ClippedSum:
    rng = np.random.default_rng(seed)
    clipped = [Term(Normal(), rng.uniform(-0.3, 0.3, n), rng.uniform(-1.0, 1.0, n)) for _ in range(8)]
    free = [Term(Normal(), rng.uniform(0.0, 2.0, n), rng.uniform(0.1, 1.0, n)) for _ in range(2)]
    return ClippedSum(tuple(free), tuple(clipped))


@pytest.mark.parametrize("make", [designs, all_normal])
@pytest.mark.parametrize("name", ESTIMATES)
def test_moments_agree_with_convolution_within_their_stated_error(name: str, make: Any) -> None:
    total = make(400, 4)
    exact, found = (m.propagate(total, 0.9973, 3.0) for m in (Convolution(), Moments()))
    away, stated, numerical = distance(found, exact, name)
    assert np.all(away <= stated.error + numerical.error)
    # and the stated error is not a way out: what the fitted shapes can really miss
    worst = {"mean": 0.02, "std": 0.02, "quantile": 1.0, "conforming": 0.1, "negative": 0.05}
    unit = 1.0 if name in ("conforming", "negative") else exact.geometric_std
    assert np.all(away <= worst[name] * unit)


def test_search_without_errors_states_that_they_are_unknown() -> None:
    total = designs(3, 5)
    with_errors, without = (Convolution(1024, e).propagate(total, 0.9, 2.0) for e in (True, False))
    for name in ESTIMATES:
        np.testing.assert_array_equal(getattr(with_errors, name).value, getattr(without, name).value)
        assert np.all(np.isnan(getattr(without, name).error))


@pytest.mark.parametrize("seed", [0, 7])
def test_same_seed_same_sample(seed: int) -> None:
    one, same, other = monte_carlo(512, seed), monte_carlo(512, seed), monte_carlo(512, seed + 1)
    np.testing.assert_array_equal(one.points, same.points)
    assert not np.array_equal(one.points, other.points)
    assert one.points.shape == (16, 32, 11)
    assert one.points.min() > 0.0
    assert one.points.max() < 1.0


def test_probability_without_a_hit_claims_no_more_than_its_sample() -> None:
    total = ClippedSum((NOTHING,), (term(Uniform(), 5.0, 1.0),))
    method = MonteCarlo.draw(1024, 2, np.random.default_rng(0))
    found = method.propagate(total, 0.9, 100.0)
    assert found.negative.value[0] == 0.0
    assert found.negative.error[0] >= 1.0 / 1024


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.5, 0.999), st.floats(-5.0, 10.0))
def test_statistics_stay_in_their_ranges(seed: int, coverage: float, limit: float) -> None:
    total = designs(3, seed)
    for method in METHODS:
        found = method.propagate(total, coverage, limit)
        assert np.all(found.mean.value >= found.geometric_mean - 1e-4)  # clipping only adds
        assert np.all((found.conforming.value >= 0.0) & (found.conforming.value <= 1.0))
        assert np.all((found.negative.value >= 0.0) & (found.negative.value <= 1.0))
        assert np.all(found.std.value >= 0.0)


@pytest.mark.parametrize("mean", [-3.0, -1.5, -1.0])
def test_moments_stay_in_the_support_where_nearly_all_is_clipped(mean: float) -> None:
    """0.2 +- 0.1 beside a clipped part that is hardly ever above zero."""
    free = (term(Uniform(), 0.2, 0.1),)
    clipped = (term(Uniform(), mean, 1.0), term(Uniform(), 0.0, 0.3))
    total = ClippedSum(free, clipped)
    found = Moments().propagate(total, 0.9973, 1.0)
    exact = Convolution().propagate(total, 0.9973, 1.0)
    for one_of in (found.quantile, found.mean):
        assert 0.1 - 1e-12 <= one_of.value[0] <= 0.3 + max(0.0, mean + 1.3) + 1e-12
    assert abs(found.quantile.value[0] - exact.quantile.value[0]) <= found.quantile.error[0]


def test_a_stack_is_sampled_in_the_room_of_one_sample() -> None:
    """200 parts: points, pieces and their stack at once took three times as much."""
    parts = 40
    mechanism = Mechanism(
        names=tuple(f"p{i}" for i in range(parts)), owner=tuple(range(parts)),
        inputs=tuple(Normal() for _ in range(parts)), sensitivities=np.ones(parts), centre=0.0,
    )  # fmt: skip
    Sample.draw(mechanism, 64, np.random.default_rng(0))  # what is imported and cached
    tracemalloc.start()
    sample = Sample.draw(mechanism, 4096, np.random.default_rng(0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * sample.deviations.nbytes
