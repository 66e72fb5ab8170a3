"""Samples of which a piece is integrated: closed forms, and counts where there are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from tolevo.models.expressions import Formula
from tolevo.models.inputs import Normal, Uniform
from tolevo.models.stack.conditioned import Conditioned
from tolevo.models.stack.conditioned import condition_on_piece as conditioned
from tolevo.models.stack.mechanism import Mechanism, Sample, joint_yield_percent

SIGMA = 1.0 / 3.0


def estimate(*mechanisms: Mechanism, units: int = 2048) -> Conditioned:
    made = conditioned(mechanisms, Sample.draw(mechanisms[0], units, np.random.default_rng(0)))
    assert made is not None
    return made


def of_formula(text: str, slopes: list[float], **limits: Any) -> Mechanism:
    names = ("a", "b")
    return Mechanism(
        names,
        (0, 1),
        (Normal(), Uniform()),
        np.array(slopes),
        0.0,
        formula=Formula(text),
        mids=np.array([2.0, 3.0]),
        scale=np.ones(2),
        **limits,
    )


def test_a_square_has_the_probability_of_its_root() -> None:
    within = estimate(of_formula("a**2 + 0*b", [4.0, 0.0], lower=3.0, upper=5.0)).within(np.array([[0.3, 0.1]]))
    low, high = (norm.cdf((np.sqrt(end) - 2.0) / (0.3 * SIGMA)) for end in (3.0, 5.0))
    assert within is not None
    assert within.mean() == pytest.approx(high - low, abs=1e-7)


def test_two_requirements_of_normal_parts_have_the_law_of_both() -> None:
    """P(x + y <= 0.3, x - y <= 0.25) of independent normal deviations."""
    both = [
        Mechanism(("x", "y"), (0, 1), (Normal(), Normal()), np.array([1.0, sign]), 0.0, upper=upper)
        for sign, upper in ((1.0, 0.3), (-1.0, 0.25))
    ]
    t = np.array([[0.4, 0.5]])
    a, b = (t[0] * SIGMA) ** 2
    exact = multivariate_normal.cdf([0.3, 0.25], cov=[[a + b, a - b], [a - b, a + b]])
    within = estimate(*both).within(t)
    assert within is not None
    assert within.mean() == pytest.approx(exact, abs=5e-4)


def test_slopes_against_differences_and_half_widths_against_counts() -> None:
    mechanism = of_formula("a**2/b", [4.0 / 3.0, -4.0 / 9.0], lower=1.1, upper=1.55)
    made, t = estimate(mechanism), np.array([[0.3, 0.4]])
    slopes, widths = made.within_slopes(t), made.half_width_slopes(t, 0.9973)
    assert slopes is not None and widths is not None
    for at in range(2):
        step = np.where(np.arange(2) == at, 1e-4, 0.0)
        ends = [(made.within(t + sign * step), made.half_width(t + sign * step, 0.9973)) for sign in (1.0, -1.0)]
        (up, wide), (down, narrow) = ends
        assert up is not None and down is not None and wide is not None and narrow is not None
        assert slopes[at] == pytest.approx((up.mean() - down.mean()) / 2e-4, rel=1e-3)
        assert widths[at] == pytest.approx((wide - narrow) / 2e-4, rel=1e-3)
    counted, error = joint_yield_percent([mechanism], t, Sample.draw(mechanism, 2**19, np.random.default_rng(5)))
    within = made.within(t)
    assert within is not None
    own = 100.0 * within.std(ddof=1) / np.sqrt(len(within))
    assert abs(100.0 * within.mean() - counted[0]) <= 4.0 * np.hypot(own, error[0])


def test_nothing_is_integrated_over_a_piece_that_turns() -> None:
    turning = of_formula("(a - 2.1)**2 + (b - 3.1)**2", [-0.2, -0.2], upper=0.1)
    sample = Sample.draw(turning, 64, np.random.default_rng(0))
    made, t = conditioned([turning], sample), np.array([[0.4, 0.4]])
    assert made is not None
    assert made.within(t) is None
    assert made.within_slopes(t) is None
    assert made.half_width(t, 0.9973) is None
    correlated = Mechanism(
        ("a", "b"), (0, 1), (Normal(), Normal()), np.ones(2), 0.0, upper=1.0, correlation=np.array([[1, 0.5], [0.5, 1]])
    )
    assert conditioned([correlated], sample) is None


def test_the_order_of_the_pieces_does_not_matter() -> None:
    """Deviations belong to names: the sample of a mechanism in another order is the same."""
    pair = [
        Mechanism(names, (0, 1), (law, other), np.ones(2), 0.0)
        for names, law, other in ((("a", "b"), Normal(), Uniform()), (("b", "a"), Uniform(), Normal()))
    ]
    first, second = (Sample.draw(mechanism, 256, np.random.default_rng(4)).deviations for mechanism in pair)
    np.testing.assert_array_equal(first, second[:, ::-1])
