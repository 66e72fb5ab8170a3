"""Linear stacks of any distributions without a sample: closed forms, quadrature, other series."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from tolevo.models.inputs import (
    Beta,
    Distribution,
    Empirical,
    Exponential,
    LogNormal,
    Normal,
    Rayleigh,
    SkewNormal,
    Triangular,
    Uniform,
)
from tolevo.models.stack.linear_sum import LinearSum, linear_sum_of
from tolevo.models.stack.mechanism import Mechanism, law_of
from tolevo.models.stack.mechanism import linear_model as linearised
from tolevo.section import Array


def mechanism(laws: list[Distribution], slopes: list[float], lower: float, upper: float, pieces: int = 1) -> Mechanism:
    owner = tuple(at for at in range(len(laws)) for _ in range(pieces))
    names = tuple(f"p{i}" for i in range(len(owner)))
    return Mechanism(names, owner, tuple(laws), np.repeat(slopes, pieces), 0.0, lower, upper)


def sum_of(*args: object, **named: object) -> LinearSum:
    made = linear_sum_of(mechanism(*args, **named))  # type: ignore[arg-type]
    assert made is not None
    return made


def test_three_uniform_deviations_have_the_law_of_irwin_and_hall() -> None:
    at = 2.2
    percent, error = sum_of([Uniform()], [1.0], -np.inf, at, pieces=3).yield_percent(np.array([[1.0]]))
    x = 0.5 * (at + 3.0)
    exact = (x**3 - 3.0 * (x - 1.0) ** 3 + 3.0 * (x - 2.0) ** 3) / 6.0
    assert percent[0] == pytest.approx(100.0 * exact, abs=1e-6)
    assert error[0] <= 1e-5


def convolved(t: Array, lower: float, upper: float) -> float:
    """P(lower <= 0.5 t0 z0 - t1 z1 <= upper), z0 beta(2, 5), z1 triangular, by quadrature."""
    z, w = np.polynomial.legendre.leggauss(400)
    z0 = scipy.stats.beta(2.0, 5.0, -1.0, 2.0)
    z1 = scipy.stats.triang(0.85, -1.0, 2.0)
    ends = [z1.cdf((0.5 * t[0] * z - end) / t[1]) for end in (upper, lower)]
    return float(100.0 * w @ (z0.pdf(z) * (ends[1] - ends[0])))


def test_skewed_deviations_against_quadrature() -> None:
    t, ends = np.array([0.3, 0.1]), (-0.17, 0.05)
    made = sum_of([Beta(2.0, 5.0), Triangular(0.7)], [0.5, -1.0], *ends)
    assert made.yield_percent(t[None, :])[0][0] == pytest.approx(convolved(t, *ends), abs=2e-4)
    for at in range(2):
        step = np.where(np.arange(2) == at, 1e-4 * t, 0.0)
        slope = (convolved(t + step, *ends) - convolved(t - step, *ends)) / (2.0 * step[at])
        assert made.yield_slopes(t[None, :])[0, at] == pytest.approx(slope, rel=2e-3)


LAWS: list[list[Distribution]] = [
    [SkewNormal(5.0, 1.1, 0.1), Rayleigh(1.0), Beta(0.6, 3.0)],
    [Exponential(), LogNormal(0.6), Normal()],
]


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("pieces", [1, 2])
def test_slopes_against_differences(pieces: int, laws: list[Distribution]) -> None:
    made = sum_of(laws, [1.0, -0.4, 0.7], -0.3, 0.5, pieces=pieces)
    t = np.array([[0.2, 0.3, 0.25], [0.4, 0.1, 0.2]])
    for at in range(3):
        step = np.where(np.arange(3) == at, 1e-5, 0.0)
        yields = made.yield_percent(t + step)[0] - made.yield_percent(t - step)[0]
        np.testing.assert_allclose(made.yield_slopes(t)[:, at], yields / 2e-5, rtol=1e-4)
        widths = made.half_width(t + step, 0.9973) - made.half_width(t - step, 0.9973)
        np.testing.assert_allclose(made.half_width_slopes(t, 0.9973)[:, at], widths / 2e-5, rtol=1e-4)


def test_it_agrees_with_the_series_of_even_laws() -> None:
    even = mechanism([Normal(), Uniform(), Beta(2.0, 2.0)], [1.0, -1.0, 0.5], -0.2, 0.25)
    law, made = law_of(even, linearised(even).covariance), linear_sum_of(even)
    assert not isinstance(law, str) and made is not None
    t = np.random.default_rng(1).uniform(0.02, 0.3, (20, 3))
    np.testing.assert_allclose(made.yield_percent(t)[0], law.yield_percent(t)[0], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(made.half_width(t, 0.9973), law.half_width(t, 0.9973), rtol=1e-8)


def test_no_unit_is_outside_of_limits_beyond_the_worst_case() -> None:
    made = sum_of([Beta(2.0, 3.0), Uniform()], [1.0, -1.0], -0.31, 0.31)
    assert made.yield_percent(np.array([[0.1, 0.2]]))[0][0] == 100.0


def test_laws_with_atoms_alone_stay_with_the_sample() -> None:
    atoms = Empirical((0.0,) * 5 + (0.5,) * 5)
    assert linear_sum_of(mechanism([atoms], [1.0], -1.0, 1.0)) is None
    assert linear_sum_of(mechanism([atoms, Uniform()], [1.0, 1.0], -1.0, 1.0)) is not None
