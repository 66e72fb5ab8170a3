"""The joint yield of normal requirements against one integral of the conditional law, and against counts."""

import numpy as np
import pytest
from scipy.special import ndtr

from tolevo.models.stack.joint_normal import within_polytopes


def _rectangle(rows: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[float, float, np.ndarray, np.ndarray]:
    """P(lower <= rows z <= upper), its error, and the derivatives by the upper limits (r,) and the rows (r, k)."""
    sides = np.concatenate([upper, -lower])
    kept = np.isfinite(sides)
    found = within_polytopes(np.vstack([rows, -rows])[kept][None], sides[kept][None])
    by_room, by_rows = np.zeros(len(sides)), np.zeros((len(sides), rows.shape[1]))
    by_room[kept], by_rows[kept] = found.by_room[0], found.by_rows[0]
    r = len(rows)
    return found.value[0], found.error[0], by_room[:r], by_rows[:r] - by_rows[r:]


def _conditional(correlation: float, lower: np.ndarray, upper: np.ndarray) -> float:
    """The same of two standard normals: the second given the first, by Gauss's rule between its bends."""
    width = np.sqrt(1.0 - correlation**2)
    low, high = max(lower[0], -9.0), min(upper[0], 9.0)
    if width < 1e-13:
        ends = np.sort(np.sign(correlation) * np.array([lower[1], upper[1]]))
        return max(float(ndtr(min(high, ends[1])) - ndtr(max(low, ends[0]))), 0.0)
    bends = [(end + far * width) / correlation for end in (lower[1], upper[1]) for far in (-8.0, -3.0, 0.0, 3.0, 8.0)]
    edges = np.unique(np.clip([*np.linspace(low, high, 9), *bends], low, high))
    x, weight = np.polynomial.legendre.leggauss(40)
    z = 0.5 * np.diff(edges)[:, None] * x + 0.5 * (edges[1:] + edges[:-1])[:, None]
    inner = ndtr((upper[1] - correlation * z) / width) - ndtr((lower[1] - correlation * z) / width)
    return float(np.sum(0.5 * np.diff(edges)[:, None] * weight * np.exp(-0.5 * z**2) * inner) / np.sqrt(2.0 * np.pi))


def test_two_requirements_of_any_correlation() -> None:
    rng = np.random.default_rng(1)
    ends = [0.0, 1e-3, 0.5, 0.9, 0.99, 1.0 - 1e-6, 1.0 - 1e-10, 1.0]
    for correlation in [sign * end for end in ends[1:] for sign in (1.0, -1.0)] * 5:
        rows = np.array([[1.0, 0.0], [correlation, np.sqrt(1.0 - correlation**2)]])
        lower = -rng.uniform(-0.5, 4.0, 2)
        upper = lower + rng.uniform(0.1, 7.0, 2)
        if rng.random() < 0.3:
            lower[rng.integers(2)] = -np.inf
        expected = _conditional(correlation, lower, upper)
        assert _rectangle(rows, lower, upper)[0] == pytest.approx(expected, abs=1e-12), correlation


def test_equal_and_opposite_requirements_are_one() -> None:
    rows = np.array([[0.3, -0.4, 1.2]])
    alone = float(2.0 * ndtr(2.0) - 1.0)
    limit = np.full(3, 2.0 * np.linalg.norm(rows))
    every = np.vstack([rows, -rows, rows])
    assert _rectangle(every, -limit, limit)[0] == pytest.approx(alone, abs=1e-14)
    assert _rectangle(rows[:, :1], np.array([-0.6]), np.array([0.6]))[0] == pytest.approx(alone, abs=1e-14)


@pytest.mark.parametrize(("dimensions", "requirements"), [(2, 4), (3, 3), (3, 5), (4, 4), (5, 5)])
def test_more_requirements_against_counts(dimensions: int, requirements: int) -> None:
    """Within 4 standard errors of 2 million units, or within the stated error."""
    rng = np.random.default_rng(10 * dimensions + requirements)
    rows = rng.normal(size=(requirements, dimensions)) @ np.linalg.qr(rng.normal(size=(7, dimensions)))[0].T
    upper, lower = (np.linalg.norm(rows, axis=1) * rng.uniform(1.8, 3.5, requirements) for _ in range(2))
    value, error, _, _ = _rectangle(rows, -lower, upper)
    units = rng.normal(size=(2_000_000, 7)) @ rows.T
    count = float(np.mean(np.all((units <= upper) & (units >= -lower), axis=1)))
    assert abs(value - count) <= 4.0 * np.hypot(np.sqrt(count * (1.0 - count) / 2e6), error)
    assert error < 5e-4


@pytest.mark.parametrize("requirements", [2, 3, 4])
def test_derivatives_are_those_of_differences(requirements: int) -> None:
    rng = np.random.default_rng(requirements)
    rows = rng.normal(size=(requirements, 6))
    upper = np.linalg.norm(rows, axis=1) * rng.uniform(1.0, 2.0, requirements)
    lower = -np.linalg.norm(rows, axis=1) * rng.uniform(1.0, 2.0, requirements)
    _, _, by_room, by_rows = _rectangle(rows, lower, upper)
    step = 1e-3
    for at in range(requirements):
        ends = [_rectangle(rows, lower, upper + side * step * np.eye(requirements)[at])[0] for side in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / (2.0 * step) == pytest.approx(by_room[at], rel=1e-3, abs=1e-5)
        for piece in range(2):
            moved = np.zeros_like(rows)
            moved[at, piece] = step
            ends = [_rectangle(rows + side * moved, lower, upper)[0] for side in (1.0, -1.0)]
            assert (ends[0] - ends[1]) / (2.0 * step) == pytest.approx(by_rows[at, piece], rel=2e-3, abs=2e-4)


def test_a_mean_outside_of_its_limits() -> None:
    """The far side of a limit, and limits that exclude each other."""
    one = np.array([[1.0, 0.0]])
    assert _rectangle(one, np.array([-np.inf]), np.array([-2.0]))[0] == pytest.approx(ndtr(-2.0), rel=1e-12)
    assert _rectangle(one, np.array([-np.inf]), np.array([0.0]))[0] == pytest.approx(0.5, rel=1e-12)
    both = np.vstack([one, one])
    assert _rectangle(both, np.array([1.0, -np.inf]), np.array([np.inf, -1.0]))[0] == 0.0


def test_limits_through_the_mean_leave_the_angle_between_them() -> None:
    """P(a z <= 0, b z <= 0) = 1/4 + arcsin(rho)/(2 pi) (Sheppard 1899)."""
    for rho in (-1.0, -0.9, -0.3, 0.0, 0.5, 0.99, 1.0):
        rows = np.array([[1.0, 0.0], [rho, np.sqrt(1.0 - rho**2)]])
        kept = within_polytopes(rows[None], np.zeros((1, 2)))
        assert kept.value[0] == pytest.approx(0.25 + np.arcsin(rho) / (2.0 * np.pi), abs=1e-12)
    orthants = within_polytopes(np.eye(3)[None], np.zeros((1, 3)))
    assert orthants.value[0] == pytest.approx(0.125, abs=float(orthants.error[0]))


@pytest.mark.parametrize("dimensions", [3, 4, 5])
@pytest.mark.parametrize("reach", [1.0, 3.0, 4.0])
def test_a_box_is_the_same_on_every_basis_and_within_its_error(dimensions: int, reach: float) -> None:
    """Rows that are orthogonal have equal singular values, of which any basis consists."""
    rows = np.vstack([np.eye(dimensions), -np.eye(dimensions)])
    exact = (2.0 * ndtr(reach) - 1.0) ** dimensions
    found = []
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0.0, 1e-15, rows.shape)
        kept = within_polytopes((rows + noise)[None], np.full((1, 2 * dimensions), reach))
        assert abs(kept.value[0] - exact) <= (4.0 if dimensions == 5 else 1.0) * kept.error[0]  # 5: a standard error
        found.append(kept.value[0])
    np.testing.assert_allclose(found, found[0], rtol=1e-10)
