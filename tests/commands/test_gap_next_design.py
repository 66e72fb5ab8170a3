"""Designs that tell explanations apart: against least squares, simulation and a printed design."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.commands.gap.next_field import Contest, Predictions, exchange_design
from tolevo.commands.gap.separations import Duel
from tolevo.section import Array

X = np.linspace(-1.0, 1.0, 401)


def powers(x: Array, most: int) -> Array:
    return np.vander(x, most + 1, increasing=True)


def left_by(columns: Array, y: Array) -> float:
    """Squared residual of least squares."""
    found, *_ = np.linalg.lstsq(columns, y, rcond=None)
    return float(np.sum((y - columns @ found) ** 2))


def contest(readings: int = 1) -> tuple[Contest, Array, Array]:
    """A cubic against a parabola, a record of 12 readings and 60 candidates of so many."""
    rng = np.random.default_rng(3)
    old, new = rng.uniform(-0.4, 0.4, 12), rng.uniform(-1.0, 1.0, 60 * readings)
    said = [Predictions(2.0 * at**3 - at, powers(at, 3)) for at in (old, new)]
    rival = [Predictions(0.3 * at, powers(at, 2)) for at in (old, new)]
    return Contest.of((said[0], rival[0]), (said[1], rival[1]), readings), old, new


@pytest.mark.parametrize("readings", [1, 4])
def test_discrimination_is_what_least_squares_leaves(readings: int) -> None:
    found, old, new = contest(readings)
    chosen = np.array([3, 3, 17], dtype=np.int64)
    levels = found.with_each(chosen)
    for candidate in (0, 3, 41):
        rows = np.append(chosen, candidate)[:, None] * readings + np.arange(readings)
        at = np.concatenate([old, new[rows.ravel()]])
        expected = left_by(powers(at, 2), 2.0 * at**3 - at)
        np.testing.assert_allclose(levels[candidate], expected, rtol=1e-6)  # the ridge is 1e-10
        np.testing.assert_allclose(found.level(np.append(chosen, candidate))[0], expected,
                                   rtol=1e-6)  # fmt: skip


def test_the_printed_design_of_atkinson_and_fedorov() -> None:
    """Biometrika 62, 1975: 4.5 - 1.5 exp x - 2 exp -x against a parabola on [-1, 1] is told best at
    -1, -0.669, 0.144, 0.957 with weights 0.253, 0.428, 0.247, 0.072; 1.087e-3 per reading.
    """
    mine = Predictions(4.5 - 1.5 * np.exp(X) - 2.0 * np.exp(-X), powers(X, 0))
    rival = Predictions(np.zeros_like(X), powers(X, 2))
    nothing = Predictions(np.zeros(0), np.zeros((0, 1))), Predictions(np.zeros(0), np.zeros((0, 3)))
    count = 100
    found = Contest.of(nothing, (mine, rival), 1)
    chosen = exchange_design([found], count)
    np.testing.assert_allclose(found.level(chosen)[0] / count, 1.087e-3, rtol=0.02)
    printed = np.array([-1.0, -0.669, 0.144, 0.957])
    nearest = np.abs(X[chosen][:, None] - printed).argmin(axis=1)
    assert np.abs(X[chosen] - printed[nearest]).max() < 0.06
    weights = np.bincount(nearest, minlength=4) / count
    np.testing.assert_allclose(weights, [0.253, 0.428, 0.247, 0.072], atol=0.03)


def test_the_worse_pair_has_its_say() -> None:
    """A parabola against a line, and against a parabola without a constant: the best for the one
    says nothing of the other, the design for both something of each.
    """
    mine = Predictions(3.0 + X**2, powers(X, 2))
    pairs = []
    for columns in (powers(X, 1), powers(X, 2)[:, 1:]):
        nothing = Predictions(np.zeros(0), np.zeros((0, 1))), Predictions(np.zeros(0), columns[:0])
        pairs.append(Contest.of(nothing, (mine, Predictions(0.0 * X, columns)), 1))
    own = [exchange_design([one], 12) for one in pairs]
    both = exchange_design(pairs, 12)
    least = [min(one.level(chosen)[0] for one in pairs) for chosen in (*own, both)]
    alone = [one.level(chosen)[0] for one, chosen in zip(pairs, own, strict=True)]
    np.testing.assert_allclose(alone, [3.0, 108.0], rtol=1e-3)  # 12 (1/2)^2 and 12 3^2
    assert least[1] < 0.1
    assert least[2] > 2.0


def test_the_chance_is_what_simulation_counts() -> None:
    """Measurements drawn from either explanation as the record leaves it, both fitted again by least
    squares on all of them: how often the right one fits better.
    """
    rng = np.random.default_rng(8)
    old, new = rng.uniform(0.1, 1.0, 15), np.linspace(0.0, 2.0, 8)
    designs = [(at[:, None], at[:, None] ** 2) for at in (old, new)]
    y = 1.8 * old + rng.normal(size=15)
    fits = [np.linalg.lstsq(x, y, rcond=None)[0] for x in designs[0]]
    ahead = left_by(designs[0][1], y) - left_by(designs[0][0], y)
    record = tuple(Predictions(x @ f, x) for x, f in zip(designs[0], fits, strict=True))
    points = tuple(Predictions(x @ f, x) for x, f in zip(designs[1], fits, strict=True))
    duel = Duel.of((record[0], record[1]), (points[0], points[1]), ahead)
    mine = 1.0 / (1.0 + np.exp(-0.5 * ahead))
    right, draws = 0, 1500
    for _ in range(draws):
        true = 0 if rng.uniform() < mine else 1
        spread = 1.0 / np.linalg.norm(designs[0][true])
        slope = fits[true] + spread * rng.normal(size=1)
        seen = np.concatenate([y, designs[1][true] @ slope + rng.normal(size=8)])
        left = [left_by(np.vstack([designs[0][k], designs[1][k]]), seen) for k in range(2)]
        right += (left[0] < left[1]) == (true == 0)
    share = right / draws
    assert abs(share - duel.chance()) < 4.0 * np.sqrt(share * (1.0 - share) / draws + 1e-4)
    assert 0.55 < duel.chance() < 0.97  # neither trivial nor lost


def test_so_many_times_the_readings_bring_the_chance() -> None:
    x, new = np.linspace(-1.0, 1.0, 20)[:, None], np.array([[-1.0], [1.0]])
    record = Predictions(0.0 * x[:, 0], x), Predictions(0.0 * x[:, 0], x**3)
    points = Predictions(0.9 * new[:, 0], new), Predictions(-0.9 * new[:, 0], new**3)
    duel = Duel.of(record, points, 0.0)
    times = duel.times_until(0.9)
    np.testing.assert_allclose(duel.chance(times), 0.9, atol=0.01)
    assert duel.chance(2.0 * times) > duel.chance(times) > duel.chance(0.5 * times)


def test_twins_stay_at_evens() -> None:
    x = np.linspace(-1.0, 1.0, 20)[:, None]
    same = Predictions(x[:, 0], x), Predictions(x[:, 0], x)
    duel = Duel.of(same, same, 0.0)
    assert duel.times_until(0.95) == np.inf
