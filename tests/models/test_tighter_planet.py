"""The tighter planet: closed forms, limits and samples of phi_1 = min_k j_n,k/(i r_1)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ndtr, ndtri, owens_t

from tolevo.models.inputs import Uniform
from tolevo.models.rv_reducer.tighter_planet import TighterPlanet

Z = np.concatenate([np.linspace(-1.0, 1.0, 2001)[1:-1], [-1.0 + 1e-6, 1.0 - 1e-6]])
TABLE = 1e-10
"""What the table promises for up to six planets."""


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_two_planets_agree_with_owens_t(share: float) -> None:
    """P(both above) is a bivariate normal integral: F = (1 + z)/2 + 2 T(x, a)."""
    law, x, a = TighterPlanet(2, share), ndtri(0.5 * (1.0 + Z)), np.sqrt((1 - share) / (1 + share))
    assert_allclose(law.cdf(Z), 0.5 * (1.0 + Z) + 2.0 * owens_t(x, a), atol=TABLE, rtol=0.0)
    assert_allclose(law.density(Z), ndtr(-a * x), atol=TABLE, rtol=0.0)


@pytest.mark.parametrize("planets", [2, 3, 6])
def test_planets_without_a_common_cause(planets: int) -> None:
    """Share 0: F = 1 - ((1 - z)/2)^K, E[z] = 2/(K + 1) - 1."""
    law, v = TighterPlanet(planets, 0.0), 0.5 * (1.0 - Z)
    assert_allclose(law.cdf(Z), 1.0 - v**planets, atol=TABLE, rtol=0.0)
    assert_allclose(law.density(Z), 0.5 * planets * v ** (planets - 1), atol=TABLE, rtol=0.0)
    first = 2.0 / (planets + 1) - 1.0
    second = 1.0 - 4.0 * planets / (planets + 1) + 4.0 * planets / (planets + 2)
    assert_allclose(law.raw_moments(2), [1.0, first, second], atol=1e-13)


@pytest.mark.parametrize(("planets", "share"), [(1, 0.5), (2, 1.0), (5, 1.0)])
def test_one_planet_or_one_cause_is_uniform(planets: int, share: float) -> None:
    law, uniform, p = TighterPlanet(planets, share), Uniform(), np.linspace(0.0, 1.0, 11)
    z = np.concatenate([Z, [-1.5, 1.5]])
    assert np.array_equal(law.partial_moments(z), uniform.partial_moments(z))
    assert np.array_equal(law.cdf(z), uniform.partial_moments(z)[0])
    assert np.array_equal(law.quantile(p), uniform.quantile(p))
    assert np.array_equal(law.raw_moments(6), uniform.raw_moments(6))
    assert_allclose(law.density(z[-3:]), [0.5, 0.0, 0.0])


@pytest.mark.parametrize(("planets", "share"), [(2, 0.5), (3, 0.3)])
def test_sample_of_units(planets: int, share: float) -> None:
    """Mean, standard deviation and distribution of 400,000 units, within four standard errors."""
    rng, units = np.random.default_rng(3), 400_000
    g = rng.standard_normal((planets + 1, units))
    z = (2.0 * ndtr(np.sqrt(share) * g[0] + np.sqrt(1.0 - share) * g[1:]) - 1.0).min(axis=0)
    law = TighterPlanet(planets, share)
    moments = law.raw_moments(4)
    error = np.sqrt((moments[2] - moments[1] ** 2) / units)
    assert abs(z.mean() - moments[1]) < 4.0 * error
    assert abs((z**2).mean() - moments[2]) < 4.0 * np.sqrt((moments[4] - moments[2] ** 2) / units)
    at = np.linspace(-0.9, 0.9, 19)
    assert np.max(np.abs((z[:, None] <= at).mean(axis=0) - law.cdf(at))) < 4.0 * 0.5 / np.sqrt(units)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_table_agrees_with_itself(share: float) -> None:
    """Density by differences, quantile as inverse, partial moments that end in the raw ones."""
    law, step, z = TighterPlanet(4, share), 1e-4, np.linspace(-0.95, 0.95, 381)
    slope = (law.cdf(z + step) - law.cdf(z - step)) / (2.0 * step)
    assert_allclose(slope, law.density(z), atol=3e-6)  # the step's own error: f'' step^2/6
    p = np.linspace(0.0, 1.0, 1001)
    assert_allclose(law.cdf(law.quantile(p)), p, atol=1e-12)
    assert_allclose(law.quantile(np.array([0.0, 1.0])), [-1.0, 1.0])
    assert_allclose([m[()] for m in law.partial_moments(np.array(2.0))], law.raw_moments(2), atol=1e-13)
    assert_allclose(law.partial_moments(np.array([-2.0])), 0.0, atol=1e-15)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9999])
def test_mean_of_two_planets_is_an_orthant_probability(share: float) -> None:
    """E[z] = 2 P(S_3 < S_1, S_3 < S_2) - 1, S_3 a third score: correlation (1 + r)/2."""
    expected = np.arcsin(0.5 * (1.0 + share)) / np.pi - 0.5
    assert_allclose(TighterPlanet(2, share).raw_moments(1)[1], expected, atol=1e-13)


def test_bad_parameters_are_named() -> None:
    assert {name for name, _ in TighterPlanet(0, 1.5).faults()} == {"planets", "share"}
