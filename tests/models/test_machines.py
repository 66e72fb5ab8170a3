"""Machines and inspection: figures computed apart, scipy's truncated normal, and sampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm, truncnorm

from tolevo.models.machines import GoodPartsBySpread, Inspection, Machine, Rework, convex_cost

OFFSETS = (0.0, 0.2, 0.5, 1.0)


def machine(mean: float = 0.0, **inspection: object) -> Machine:
    """A machine of sigma 1 that makes parts for 1 and inspects them for 0.1."""
    return Machine("m", 1.0, 1.0, mean, Inspection(0.1, **inspection))  # type: ignore[arg-type]


def test_sorting_of_a_wide_machine_costs_what_it_throws_away() -> None:
    """Sigma 4 um inspected at 6 um: 2.97 um, 86.6 % good, 12.70 instead of 11 for a good part."""
    found = Machine("m", 4.0, 11.0, 0.0, Inspection(0.0)).good_parts(np.array([6.0]))
    np.testing.assert_allclose(found.std, 2.97, atol=0.005)
    np.testing.assert_allclose(100.0 * found.passed, 86.6, atol=0.05)
    np.testing.assert_allclose(found.cost, 12.70, atol=0.005)


def test_scatter_of_a_centred_machine_in_closed_form() -> None:
    tau = np.linspace(0.3, 5.0, 50)
    closed = np.sqrt(1.0 - 2.0 * tau * norm.pdf(tau) / (2.0 * norm.cdf(tau) - 1.0))
    np.testing.assert_allclose(machine().good_parts(tau).std, closed, rtol=1e-12)


@pytest.mark.parametrize("mean", OFFSETS)
def test_moments_and_yield_are_those_of_the_truncated_normal(mean: float) -> None:
    t = np.linspace(0.5, 4.0, 30)
    law, found = truncnorm(-t - mean, t - mean, loc=mean), machine(mean).good_parts(t)
    np.testing.assert_allclose(found.mean, law.mean(), atol=1e-14)
    np.testing.assert_allclose(found.std, law.std(), rtol=1e-12)
    np.testing.assert_allclose(found.passed, norm.cdf(t - mean) - norm.cdf(-t - mean), rtol=1e-12)
    np.testing.assert_allclose(found.cost, 1.1 / found.passed, rtol=1e-14)


@pytest.mark.parametrize(
    ("u", "wrong", "refused", "bare"),
    [(0.3, 41e-6, 13_702e-6, (651e-6, 2_013e-6)), (0.6, 64e-6, 81_689e-6, (908e-6, 8_307e-6))],
)
def test_guard_bands_at_a_limit_of_three_sigma(
    u: float, wrong: float, refused: float, bare: tuple[float, float]
) -> None:
    """Bad parts accepted and good ones refused: what remains is the share that passes."""
    inside = norm.cdf(3.0) - norm.cdf(-3.0)
    for guard, bad, good in ((1.645, wrong, refused), (0.0, *bare)):
        passed = machine(u=u, guard=guard).good_parts(np.array([3.0])).passed[0]
        np.testing.assert_allclose(passed, inside - good + bad, atol=2.5e-6)


def test_measured_and_reworked_parts_against_integrals_over_the_parts() -> None:
    given = Rework(0.4, 0.9, "upper")
    one, t = machine(0.4, u=0.25, rework=given), 1.8
    width = t - 1.645 * 0.25

    def passes(x: float) -> float:
        return float(norm.cdf((width - x) / 0.25) - norm.cdf((-width - x) / 0.25))

    moments = [quad(lambda x, k=k: x**k * passes(x) * norm.pdf(x - 0.4), -9, 9, epsabs=1e-12)[0]
               for k in range(3)]  # fmt: skip
    found = one.good_parts(np.array([t]))
    mean = moments[1] / moments[0]
    np.testing.assert_allclose(found.passed[0], moments[0], rtol=1e-9)
    np.testing.assert_allclose(found.mean[0], mean, rtol=1e-8)
    np.testing.assert_allclose(found.std[0] ** 2, moments[2] / moments[0] - mean**2, rtol=1e-8)
    above = quad(lambda x: norm.sf((width - x) / 0.25) * norm.pdf(x - 0.4), -9, 9)[0]
    cost = (1.0 + 0.1 + above * (0.4 + 0.1)) / (moments[0] + above * 0.9)
    np.testing.assert_allclose(found.cost[0], cost, rtol=1e-8)


def test_sides_of_rework_and_parts_that_are_not_lost() -> None:
    t, again = np.array([1.5]), Rework(0.3, 1.0, "both")
    both = machine(rework=again).good_parts(t).cost[0]
    np.testing.assert_allclose(both, 1.1 + (2.0 * norm.sf(1.5)) * 0.4, rtol=1e-12)
    upper, lower = (machine(0.3, rework=replace(again, side=side)) for side in ("upper", "lower"))
    turned = machine(-0.3, rework=replace(again, side="upper"))
    np.testing.assert_allclose(lower.good_parts(t).cost, turned.good_parts(t).cost, rtol=1e-12)
    assert upper.good_parts(t).cost[0] < lower.good_parts(t).cost[0]
    kept = machine(scrap=False).good_parts(t)
    np.testing.assert_allclose(kept.cost, 1.0 + 0.1 / kept.passed, rtol=1e-12)


@pytest.mark.parametrize("mean", OFFSETS)
@pytest.mark.parametrize("rework", [None, Rework(0.5, 0.9)])
def test_derivatives_are_those_of_differences(mean: float, rework: Rework | None) -> None:
    one, t, step = machine(mean, u=0.1, rework=rework), np.linspace(0.8, 4.0, 40), 1e-5
    found, up, down = one.good_parts(t), one.good_parts(t + step), one.good_parts(t - step)
    for name in ("mean", "std", "cost"):
        slope = (getattr(up, name) - getattr(down, name)) / (2.0 * step)
        np.testing.assert_allclose(getattr(found, f"{name}_slope"), slope, atol=2e-8)


@pytest.mark.parametrize("mean", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("rework", [None, Rework(0.5, 0.9)])
def test_cost_is_convex_in_scatter_and_variance(mean: float, rework: Rework | None) -> None:
    """20 001 limits up to 4 sigma, as the note on capability has it."""
    found = machine(mean, rework=rework).good_parts(np.linspace(0.3, 4.0, 20_001))
    for by in (found.std, found.std**2):
        slopes = np.diff(found.cost) / np.diff(by)
        assert np.all(np.diff(slopes) > -1e-7 * np.ptp(slopes))


def test_cost_by_scatter_is_the_same_cost_and_its_optimum_is_the_least() -> None:
    one, t = machine(0.3, u=0.1), np.linspace(0.7, 4.0, 4001)
    curve, found = GoodPartsBySpread(one, 0.7, 4.0, 3.0), one.good_parts(t)
    x = 3.0 * found.std
    np.testing.assert_allclose(curve.limit(x), t, rtol=1e-9)
    np.testing.assert_allclose(curve.cost(x), found.cost, rtol=1e-12)
    price = np.geomspace(1e-4, 1e2, 40)
    for linear in (0.0 * price, 0.4 * price, -0.05 * price):
        best = curve.best(linear, price, *curve.ends)
        own = curve.cost(best) + linear * best + price * best**2
        every = found.cost + linear[:, None] * x + price[:, None] * x**2
        assert np.all(own <= every.min(axis=1) + 1e-12)


def test_what_is_not_convex_is_replaced_by_something_convex_below() -> None:
    one = machine(1.0, rework=Rework(0.5, 0.9))
    curve = GoodPartsBySpread(one, 0.5, 4.0, 3.0)
    used, exact = convex_cost(curve, curve.tabulated)
    found = one.good_parts(np.linspace(0.5, 4.0, 9973))
    below = found.cost - used.cost(3.0 * found.std)
    assert not exact and used.bends == ()
    assert np.all(below >= -1e-12) and np.max(below) < 0.01


def test_three_sigma_of_sums_of_sorted_parts_is_conservative() -> None:
    """Five parts at tau = 1.5: 0.147 % lie outside of three standard deviations, not 0.27 %."""
    rng = np.random.default_rng(0)
    s = machine().good_parts(np.array([1.5])).std[0]
    parts = truncnorm(-1.5, 1.5).rvs((5, 400_000), random_state=rng)
    outside = np.mean(np.abs(parts.sum(axis=0)) > 3.0 * s * np.sqrt(5.0))
    np.testing.assert_allclose(100.0 * outside, 0.147, atol=4.0 * 0.006)
