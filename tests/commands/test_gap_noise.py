"""What is known of the noise, against statsmodels and scipy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from statsmodels.regression.linear_model import OLS
from statsmodels.stats.diagnostic import acorr_ljungbox

from tolevo.commands.gap.locate import amplitudes
from tolevo.commands.gap.noise import Noise, robust_scale, size_follows, whiteness

ROUNDING = 1e-9
"""Relative: the same sums in another order."""


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("count", [7, 40, 600])
def test_whiteness_is_ljung_and_boxs(count: int, rng: np.random.Generator) -> None:
    white = rng.normal(size=count)
    expected = acorr_ljungbox(white, lags=[min(10, count // 5)])["lb_pvalue"].iloc[0]
    assert whiteness(white) == pytest.approx(expected, rel=ROUNDING)


def test_robust_scale_is_that_of_the_median_deviation(rng: np.random.Generator) -> None:
    found = rng.standard_t(2, size=501)
    expected = scipy.stats.median_abs_deviation(found, scale="normal")
    assert robust_scale(found) == pytest.approx(expected, rel=ROUNDING)


def test_columns_that_the_noise_colours_have_its_covariance(rng: np.random.Generator) -> None:
    """x' L L' x, with L L' written out: sigma_i sigma_j rho^|i - j|."""
    noise = Noise(rng.uniform(0.5, 2.0, 50), "given", rho=0.7)
    x = rng.normal(size=(50, 3))
    at = np.arange(50)
    covariance = np.outer(noise.sigma, noise.sigma) * 0.7 ** np.abs(at[:, None] - at)
    found = noise.coloured(x)
    np.testing.assert_allclose(found.T @ found, x.T @ covariance @ x, rtol=ROUNDING)


def test_the_size_of_the_noise_follows_an_input_by_the_f_test(rng: np.random.Generator) -> None:
    load, idle = rng.uniform(0.1, 3.0, 400), rng.uniform(size=400)
    residual, good = load * rng.normal(size=400), rng.random(400) > 0.02
    found = size_follows(residual, {"idle": idle, "load": load}, good)
    assert found is not None and found[0] == "load"
    x = np.column_stack([np.ones(400), load, load**2])
    target = np.log(np.maximum(residual**2, 1e-8 * np.mean(residual[good] ** 2)))
    fitted = OLS(target[good], x[good]).fit().predict(x)
    size = np.exp(0.5 * np.clip(fitted - np.median(fitted), -4.0, 4.0))
    np.testing.assert_allclose(found[1], size / np.sqrt(np.mean(size**2)), rtol=ROUNDING)
    assert size_follows(rng.normal(size=400), {"idle": idle}, good) is None
    assert size_follows(residual, {"still": np.ones(400)}, good) is None


def test_the_size_of_the_noise_is_significant_where_statsmodels_says_so(rng: np.random.Generator) -> None:
    """Around the least chance, 1e-3 of one input, on either side of it."""
    load = rng.uniform(0.1, 3.0, 200)
    said = []
    for strength in np.linspace(0.0, 0.8, 25):
        residual = np.exp(strength * load) * rng.normal(size=200)
        target = np.log(np.maximum(residual**2, 1e-8 * np.mean(residual**2)))
        chance = OLS(target, np.column_stack([np.ones(200), load, load**2])).fit().f_pvalue
        said.append(chance <= 1e-3)
        found = size_follows(residual, {"load": load}, np.ones(200, dtype=bool))
        assert (found is not None) == said[-1]
    assert 5 < sum(said) < 20


def test_amplitudes_are_those_of_lomb_and_scargle(rng: np.random.Generator) -> None:
    angle, orders = rng.uniform(0.0, 9.0, 300), np.arange(0.25, 90.1, 0.25)
    residual = rng.normal(size=300) + np.cos(39.0 * angle)
    left = residual - residual.mean()
    expected = np.abs(scipy.signal.lombscargle(angle, left, orders, normalize="amplitude"))
    np.testing.assert_allclose(amplitudes(angle, orders, residual), expected, rtol=1e-6)


def test_a_wave_whose_sine_is_never_seen_has_the_amplitude_of_its_cosine() -> None:
    """Angles on the nodes of the sine: by scipy's quotient of roundings it has any amplitude."""
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    found = amplitudes(angle, np.array([39.0, 360.0]), 0.5 * np.cos(360.0 * angle))
    np.testing.assert_allclose(found, [0.0, 0.5], atol=1e-9)
