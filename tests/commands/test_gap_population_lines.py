"""Simulated and measured units compared line by line: statistics, chance, intervals, verdicts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tolevo.commands.gap.populations import (
    Compared,
    Look,
    along,
    batches,
    between_lots,
    looks_of,
    rare_value,
    shape_distance,
    two_supplier_ratio,
)
from tolevo.commands.gap.records import PopulationLine
from tolevo.models.effects.population import Law

Array = np.ndarray
LATTICE = np.linspace(-6.0, 6.0, 601)
NORMAL = Law(-6.0, 0.02, stats.norm.logpdf(LATTICE), 1.0)


def looks(n: int, lots: Array | None = None) -> tuple[Look, ...]:
    """Statistics of units that should be standard normal ones."""
    quantiles = stats.norm.ppf((np.arange(n) + 0.5) / n)
    of_lots = None if lots is None else between_lots(lots)
    order = np.arange(n, dtype=float)
    return looks_of("um", order, two_supplier_ratio(), shape_distance(quantiles), of_lots)


def lines(x: Array, seed: int = 0, lots: Array | None = None, drawn: int | None = None) -> dict[str, PopulationLine]:
    """Such units beside batches that are, as many as usual."""
    n, rng = len(x), np.random.default_rng([seed, len(x)])
    simulated = rng.standard_normal((drawn or batches(n), n))
    found = Compared(looks(n, lots), x, simulated, 0.01, 20).lines("before", "y", {}, rng)
    return {one.statistic: one for one in found}


def normal(n: int, seed: int) -> Array:
    return np.random.default_rng([seed, n, 5]).standard_normal(n)


def differing(x: Array, lots: Array | None = None) -> set[str]:
    return {name for name, one in lines(x, 1, lots).items() if one.differs}


def test_statistics_are_those_of_scipy() -> None:
    x = np.random.default_rng(1).gamma(2.0, size=(3, 40))
    order = np.arange(40, dtype=float)
    of = {one.name: one.of(x) for one in looks_of("", np.arange(x.shape[1], dtype=float))}
    np.testing.assert_allclose(of["standard deviation"], np.std(x, axis=1, ddof=1))
    np.testing.assert_allclose(of["skewness"], stats.skew(x, axis=1))
    np.testing.assert_allclose(of["kurtosis"], stats.kurtosis(x, axis=1))
    slopes = [39.0 * stats.linregress(order, row).slope for row in x]
    np.testing.assert_allclose(along(order)(x), slopes, rtol=1e-9)
    of_lot = np.resize([0, 1, 2], 40)
    ratio = between_lots(of_lot)
    assert ratio is not None
    expected = [stats.f_oneway(*(row[of_lot == k] for k in range(3))).statistic for row in x]
    np.testing.assert_allclose(ratio(x), expected, rtol=1e-9)


def test_lots_of_single_units_are_not_compared() -> None:
    assert between_lots(np.array([0] * 38 + [1, 2])) is None
    some = between_lots(np.array([0] * 19 + [1] * 19 + [2, 3]))
    x = np.random.default_rng(2).normal(size=(1, 40))
    assert some is not None
    far = np.where(np.arange(40) >= 38, 1e6, x)
    np.testing.assert_allclose(some(x), some(far))


def test_mixture_is_the_likelihood_ratio_of_two_normals() -> None:
    """Of the best of the tried ones, against scipy's densities."""
    rng = np.random.default_rng(3)
    x = np.where(rng.random(200) < 0.5, 3.5, 0.0) + rng.normal(size=200)
    z = (x - x.mean()) / x.std()
    scale = np.sqrt(1.0 + 0.25 * 3.5**2)
    two = sum(0.5 * stats.norm.pdf(z, sign * 0.5 * 3.5 / scale, 1.0 / scale) for sign in (-1, 1))
    expected = 2.0 * float(np.sum(np.log(two) - stats.norm.logpdf(z)))
    assert two_supplier_ratio()(x[None])[0] == pytest.approx(expected, rel=0.02)


def test_neither_wider_nor_shifted_units_are_two_suppliers() -> None:
    x = normal(300, 4)
    one = two_supplier_ratio()
    np.testing.assert_allclose(one(x[None]), one(5.0 + 3.0 * x[None]), rtol=0.05, atol=0.2)


N = 300
LOTS = np.resize([0, 1, 2], N)


@pytest.mark.parametrize(
    ("what", "x"),
    [
        ("mean", normal(N, 5) + 0.5),
        ("standard deviation", 1.5 * normal(N, 6)),
        ("skewness", np.random.default_rng(7).gamma(2.0, size=N) / np.sqrt(2.0) - np.sqrt(2.0)),
        ("distance of shapes", np.random.default_rng(8).uniform(-1.7, 1.7, N)),
        ("two suppliers", np.where(np.arange(N) % 2, 1.0, -1.0) + 0.3 * normal(N, 9)),
        ("first to last unit", normal(N, 10) + np.linspace(-0.8, 0.8, N)),
        ("scatter of lots", normal(N, 11) + 0.8 * (LOTS == 1)),
    ],
)
def test_each_difference_has_its_line(what: str, x: Array) -> None:
    assert what in differing(x, LOTS)


@pytest.mark.parametrize("n", [30, 300])
def test_normal_units_hardly_ever_differ(n: int) -> None:
    """At most one batch in a hundred has any line that does."""
    found, many = lines(normal(n, 0), 1, LOTS[:n]), looks(n, LOTS[:n])
    x = np.random.default_rng(99).standard_normal((1000, n))
    beyond = np.zeros(1000, dtype=bool)
    for one in many:
        far = one.of(x) - found[one.name].simulated
        beyond |= (np.abs(far) if one.signed else far) > found[one.name].chance
    assert stats.binomtest(int(beyond.sum()), 1000, 0.01, "greater").pvalue > 0.005


def test_intervals_hold_nine_times_out_of_ten() -> None:
    held = {"mean": 0, "standard deviation": 0, "first to last unit": 0}
    for seed in range(50):
        found = lines(0.3 + 1.2 * normal(100, 100 + seed), drawn=60)
        for name, truth in (("mean", 0.3), ("standard deviation", 0.2), ("first to last unit", 0)):
            held[name] += found[name].low <= truth <= found[name].high
    low, high = (float(stats.binom.ppf(p, 50, 0.9)) for p in (0.002, 0.998))
    assert all(low - 2 <= count <= high for count in held.values()), held


def test_what_would_have_been_seen_is_seen() -> None:
    """A mean off by so much is seen nine times out of ten."""
    found = lines(normal(60, 12))["mean"]
    x = found.would_show + np.random.default_rng(98).standard_normal((1000, 60))
    seen = np.abs(x.mean(axis=1) - found.simulated) > found.chance
    assert seen.mean() == pytest.approx(0.9, abs=4.0 * np.sqrt(0.09 / 1000))


def test_few_units_cannot_tell() -> None:
    found = lines(normal(12, 13))
    assert {one.verdict for one in found.values()} == {"cannot tell with n = 12"}
    assert lines(normal(12, 14) + 3.0)["mean"].differs
    assert "no difference detected; one of" in lines(normal(30, 15))["mean"].verdict


def test_tail_of_an_exponential_and_of_a_normal() -> None:
    """The former is met, the latter not passed."""
    rng = np.random.default_rng(17)
    assert rare_value(rng.exponential(size=4000), 0.001) == pytest.approx(np.log(1e3), rel=0.1)
    of_normal = float(stats.norm.isf(0.0005))
    assert of_normal < rare_value(np.abs(rng.standard_normal(4000)), 0.001) < 1.15 * of_normal


def test_large_batches_are_simulated_in_fewer_with_the_same_limit() -> None:
    """Of 2000 units, 300 batches: the limit of the mean is that of the normal law, Sidak's."""
    found = lines(normal(2000, 16))
    rate = 1.0 - 0.99 ** (1.0 / len(found))
    expected = stats.norm.isf(0.5 * rate) / np.sqrt(2000)
    assert found["mean"].chance == pytest.approx(expected, rel=0.3)
