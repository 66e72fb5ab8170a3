"""Distributions of toleranced inputs against scipy, and zones given by their limits."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.integrate import quad

from tolevo.models.inputs import DISTRIBUTIONS, Distribution, Normal, TruncatedNormal, Uniform, Zone

CASES = [
    Uniform(),
    Normal(),
    Normal(cp=1.33, shift=0.2),
    TruncatedNormal(),
    TruncatedNormal(cp=0.4, shift=-0.5),
    TruncatedNormal(cp=2.0, shift=0.3),
]


def reference(distribution: Distribution) -> Any:
    """The same distribution by scipy."""
    if isinstance(distribution, Normal):
        return stats.norm(distribution.shift, 1.0 / (3.0 * distribution.cp))
    if isinstance(distribution, TruncatedNormal):
        mode, sigma = distribution.shift, 1.0 / (3.0 * distribution.cp)
        return stats.truncnorm((-1.0 - mode) / sigma, (1.0 - mode) / sigma, mode, sigma)
    return stats.uniform(-1.0, 2.0)


def integral(distribution: Distribution, order: int, upper: float) -> float:
    """E[u^order; u <= upper] by adaptive quadrature of the density of scipy."""
    law = reference(distribution)
    low, high = distribution.support
    middle = float(law.mean())
    ends = sorted({low, *(p for p in (middle,) if low < p < min(upper, high)), min(upper, high)})
    pieces = [
        quad(lambda u: u**order * law.pdf(u), a, b, epsabs=1e-13)[0] for a, b in pairwise(ends)
    ]
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
    np.testing.assert_allclose(
        inspected.partial_moments(z), free.partial_moments(z), rtol=1e-10, atol=1e-12
    )


def test_incapable_process_after_inspection_is_uniform() -> None:
    found = TruncatedNormal(cp=0.02).raw_moments(4)  # scale 17 half-widths: flat to 2e-3
    np.testing.assert_allclose(found, Uniform().raw_moments(4), atol=1e-3)


any_input = st.one_of(
    st.just(Uniform()),
    st.builds(Normal, st.floats(0.2, 5.0), st.floats(-1.0, 1.0)),
    st.builds(TruncatedNormal, st.floats(0.2, 5.0), st.floats(-1.0, 1.0)),
)


@given(any_input, st.lists(st.floats(1e-6, 1.0 - 1e-6), min_size=2, max_size=8))
def test_quantile_inverts_the_mass_and_rises(case: Distribution, chosen: list[float]) -> None:
    p = np.sort(np.array(chosen))
    z = case.quantile(p)
    assert np.all(np.diff(z) >= 0.0)
    np.testing.assert_allclose(case.partial_moments(z)[0], p, rtol=1e-7, atol=1e-9)


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
    assert set(DISTRIBUTIONS.values()) == {Uniform, Normal, TruncatedNormal}


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
