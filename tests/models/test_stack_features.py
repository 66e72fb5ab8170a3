"""Places in a disc: their laws against closed forms and independent counts of 10^6 units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo.models.expressions import Formula
from tolevo.models.inputs import Normal
from tolevo.models.stack.extremes import extremes
from tolevo.models.stack.linear_sum import LinearSum, linear_sum_of
from tolevo.models.stack.mechanism import (
    Disc,
    Law,
    Mechanism,
    Sample,
    component,
    law_of,
    linear_model,
    worst_by_corners,
    yield_percent,
)

UNITS = 1_000_000
T = np.array([[0.2, 0.1]])
"""Radius of the zone of a hole (pieces x, y), and the tolerance of a plate."""


def mechanism(law: str, slopes: tuple[float, float, float], formula: str = "", **more: Any) -> Mechanism:
    """y = slopes (x, y, plate), or a formula of them about 0."""
    written: dict[str, Any] = {"formula": Formula(formula), "mids": np.zeros(3), "scale": np.ones(3)} if formula else {}
    inputs = component(law), Normal()
    return Mechanism(
        ("x", "y", "plate"), (0, 0, 1), inputs, np.array(slopes), 0.0, discs=(Disc((0, 1), law),), **written, **more
    )


def counted(law: str) -> np.ndarray:
    """Components (2, units) of places in the unit disc, by rejection and by angles: not by the code."""
    rng = np.random.default_rng(7)
    if law == "normal":
        return rng.normal(0.0, 1.0 / 3.0, (2, UNITS))
    if law == "uniform_circle":
        points = rng.normal(size=(2, UNITS))
        return np.asarray(points / np.hypot(*points))
    square = rng.uniform(-1.0, 1.0, (2, 2 * UNITS))
    return np.asarray(square[:, np.hypot(*square) <= 1.0][:, :UNITS])


@pytest.mark.parametrize("law", ["uniform_disc", "uniform_circle", "normal"])
def test_a_component_has_the_moments_of_a_count(law: str) -> None:
    exact = component(law).raw_moments(4)
    z = counted(law)[0]
    for k in range(5):
        error = np.std(z**k) / np.sqrt(len(z))
        assert abs(np.mean(z**k) - exact[k]) <= 4.0 * error + 1e-12


@pytest.mark.parametrize("law", ["uniform_disc", "uniform_circle", "normal"])
def test_a_drawn_place_has_the_law_of_a_count(law: str) -> None:
    """Not the components alone: their distance, and the sum of their sizes."""
    sample = Sample.draw(mechanism(law, (1.0, 1.0, 0.0)), 2**16, np.random.default_rng(1)).deviations
    drawn, points = sample[:, :2].transpose(1, 0, 2).reshape(2, -1), counted(law)
    for of in (np.hypot, lambda x, y: np.abs(x) + np.abs(y), lambda x, y: x * y):
        a, b = of(*drawn), of(*points)
        error = np.std(b) / np.sqrt(min(len(a), len(b)))
        assert abs(np.mean(a) - np.mean(b)) <= 4.0 * error + 1e-12
        assert np.var(a) == pytest.approx(np.var(b), abs=5e-4)


@pytest.mark.parametrize("law", ["uniform_disc", "uniform_circle", "normal"])
def test_the_yield_of_a_sum_in_two_directions_is_that_of_a_count(law: str) -> None:
    """y = 0.6 x - 1.1 y + plate; exact by its law, and by the sample."""
    slopes = 0.6, -1.1, 1.0
    stack = mechanism(law, slopes, lower=-0.2, upper=0.17)
    x, y = counted(law)
    plate = np.random.default_rng(8).normal(0.0, 0.1 / 3.0, UNITS)
    total = 0.2 * (slopes[0] * x[:UNITS] + slopes[1] * y[:UNITS]) + plate[: len(x)]
    fraction = float(np.mean((total >= -0.2) & (total <= 0.17)))
    error = 100.0 * np.sqrt(fraction * (1.0 - fraction) / UNITS)
    linear = linear_model(stack)
    law_or_sum = law_of(stack, linear.covariance)
    distribution = law_or_sum if isinstance(law_or_sum, Law) else linear_sum_of(stack)
    assert isinstance(distribution, Law | LinearSum)
    assert float(distribution.yield_percent(T)[0][0]) == pytest.approx(100.0 * fraction, abs=4.0 * error)
    drawn, doubt = yield_percent(stack, T, Sample.draw(stack, 2**16, np.random.default_rng(2)))
    assert float(drawn[0]) == pytest.approx(100.0 * fraction, abs=4.0 * (error + float(doubt[0])))
    assert linear.rss(T)[0] == pytest.approx(3.0 * np.std(total), rel=3e-3)


def test_the_worst_case_is_the_radius_times_the_length_of_the_slope() -> None:
    """Not the sum of both components: no place of the zone is off by its radius in both directions."""
    stack = mechanism("uniform_disc", (3.0, -4.0, 2.0))
    assert linear_model(stack).worst_case(T)[0] == pytest.approx(0.2 * 5.0 + 0.1 * 2.0)
    assert linear_model(mechanism("normal", (3.0, -4.0, 2.0))).worst_case(T)[0] == pytest.approx(1.2)


def test_corners_of_a_formula_are_on_the_circle() -> None:
    stack = mechanism("uniform_disc", (3.0, -4.0, 2.0), "3*x - 4*y + 2*plate")
    assert worst_by_corners(stack, T)[0] == pytest.approx(1.2, rel=1e-12)
    distance = mechanism("uniform_disc", (0.0, 0.0, 1.0), "sqrt(x**2 + y**2) + plate", rough=("x", "y"))
    assert worst_by_corners(distance, T)[0] == pytest.approx(0.3, rel=1e-12)


def test_worst_case_ends_are_those_of_the_circle() -> None:
    """3 x - 4 y reaches 5 times the radius; a distance is between 0 and the radius; of a product of both
    components, 1/2 at 45 degrees, the points tried are said to be a sample.
    """
    exact = extremes(mechanism("uniform_disc", (3.0, -4.0, 2.0), "3*x - 4*y + 2*plate"), T[0])
    assert exact[:2] == pytest.approx((-1.2, 1.2), rel=1e-12)
    assert exact.kind == "corners"
    far = extremes(mechanism("normal", (0.0, 0.0, 1.0), "sqrt(x**2 + y**2) + plate", rough=("x", "y")), T[0])
    assert far[:2] == pytest.approx((-0.1, 0.3), abs=1e-12)
    product = extremes(mechanism("uniform_disc", (0.0, 0.0, 1.0), "x*y + plate", rough=("x", "y")), T[0])
    assert product.kind == "sample"
    assert product.greatest == pytest.approx(0.1 + 0.5 * 0.2**2, rel=0.01)
    assert product.greatest <= 0.1 + 0.5 * 0.2**2


def test_one_component_alone_reaches_the_edge_of_the_zone() -> None:
    stack = mechanism("uniform_disc", (-1.0, 0.0, 1.0), "plate - x")
    assert worst_by_corners(stack, T)[0] == pytest.approx(0.3, rel=1e-12)


def test_a_place_in_one_direction_has_the_law_of_the_semicircle() -> None:
    """P(|z| <= c) = (2/pi)(c sqrt(1 - c^2) + asin c), Wigner's semicircle."""
    stack = mechanism("uniform_disc", (0.6, 0.8, 0.0), lower=-0.1, upper=0.1)
    law = law_of(stack, linear_model(stack).covariance)
    assert isinstance(law, Law)
    c = 0.5
    exact = 2.0 / np.pi * (c * np.sqrt(1.0 - c * c) + np.arcsin(c))
    percent, error = (float(values[0]) for values in law.yield_percent(T))
    assert error < 1e-3
    assert percent == pytest.approx(100.0 * exact, abs=error)
