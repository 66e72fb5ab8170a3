"""Machines at the worst pose and over the ring: independent poses, brute force, plain sampling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erfc, ndtri

from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.maps import first_order, matrix, orientation_combinations
from tolevo.models.manipulator.ring import (
    Field,
    Machines,
    Sample,
    exceedance,
    first_largest,
    grid,
    main_plane,
    quantile,
    worst_deviation,
    worst_exceedance,
    worst_quantile,
)
from tolevo.models.propagation import MonteCarlo

SIGMA = np.array([5.7e-6, 1.2e-5, *[5.7e-5] * 4] * 2 + [1.1e-5, 8e-5, *[8.6e-5] * 4])
"""Standard deviations [m, rad] of the 18 sources, near the optimum of the notes."""


def fields(count: int, machine: Manipulator | None = None) -> dict[str, Field]:
    """Squareness, yaw [mrad] and position [mm] on a grid of the ring."""
    maps = first_order(machine or Manipulator(), *grid(TaskRing(), count))
    columns = matrix(orientation_combinations())
    turn, move = 1e3 * maps.orientation @ columns, 1e3 * maps.position @ columns
    return {"squareness": Field(turn[:, :2]), "yaw": Field(turn[:, 2:]), "position": Field(move)}


def machines_of(field: Field, sigma: np.ndarray, count: int = 4096) -> Machines:
    effects = field.effects * sigma
    sample = Sample.draw(count, len(sigma), np.random.default_rng(0))
    variances = field.variances(sigma[None])[0]
    return Machines.of([effects], variances, sample, main_plane([effects]))


@pytest.mark.parametrize("coverage", [0.5, 0.9973])
@pytest.mark.parametrize("name", ["squareness", "yaw", "position"])
def test_worst_pose_is_that_of_brute_force(name: str, coverage: float) -> None:
    sigma = SIGMA * np.exp(np.random.default_rng(3).normal(0.0, 1.0, (6, 18)))
    variances = fields(21)[name].variances(sigma)
    found, at = worst_quantile(variances, coverage)
    every = quantile(variances, coverage)
    np.testing.assert_allclose(found, every.max(axis=1), rtol=1e-9)
    np.testing.assert_allclose(every[np.arange(6), at], found, rtol=1e-9)
    over, _ = worst_exceedance(variances, 0.2)
    np.testing.assert_allclose(over, exceedance(variances, 0.2).max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(worst_deviation(variances) ** 2, variances.sum(axis=2).max(axis=1))


def test_one_pose_is_known_exactly() -> None:
    field = fields(2)["squareness"].at(slice(3, 4))
    machines = machines_of(field, SIGMA, 64)
    variances = field.variances(SIGMA[None])[0, 0]
    for bound in (0.1, 0.5, 0.9):
        share, error = machines.beyond(bound, 0)
        np.testing.assert_allclose(share, exceedance(variances, bound), rtol=1e-12)
        assert error < 1e-12
    least = float(quantile(variances, 0.9973))
    found, error = machines.quantile(0.9973, 0, least)
    np.testing.assert_allclose(found, least, rtol=1e-8)
    assert error < 1e-12


@pytest.mark.parametrize("bound", [1.0, 2.0, 3.5])
def test_independent_poses_multiply(bound: float) -> None:
    """Four poses, each with a source of its own: the shares that keep the bound multiply."""
    sigma = np.array([1.0, 0.9, 0.6, 0.3])
    effects = np.zeros((4, 1, 4))
    effects[np.arange(4), 0, np.arange(4)] = 1.0
    machines = machines_of(Field(effects), sigma, 16_384)
    share, error = machines.beyond(bound, 0)
    expected = 1.0 - np.prod(1.0 - erfc(bound / np.sqrt(2.0) / sigma))
    assert abs(share - expected) < 5.0 * error + 1e-9
    assert error < 0.02 * expected


@pytest.mark.parametrize("name", ["squareness", "yaw", "position"])
@pytest.mark.parametrize("machine", [Manipulator(), Manipulator(follow_up="rod")])
def test_over_the_ring_against_plain_sampling(name: str, machine: Manipulator) -> None:
    field = fields(7, machine)[name]
    machines, variances = machines_of(field, SIGMA), field.variances(SIGMA[None])
    rng = np.random.default_rng(11)
    length = np.concatenate([
        np.linalg.norm(field.effects @ (SIGMA[:, None] * rng.normal(size=(18, 4000))), axis=1)
        .max(axis=0) for _ in range(50)
    ])  # fmt: skip
    least, worst = worst_quantile(variances, 0.99)
    found, error = machines.quantile(0.99, int(worst[0]), float(least[0]))
    share = float(np.mean(length > found))
    density = np.mean(np.abs(length / found - 1.0) < 0.02) / 0.04
    assert abs(share - 0.01) < 4.0 * np.sqrt(0.01 / len(length)) + 4.0 * error / found * density
    assert found >= least[0]
    bound = float(np.quantile(length, 0.4))
    over, at = worst_exceedance(variances, bound)
    beyond, error = machines.beyond(bound, int(at[0]))
    assert abs(beyond - 0.6) < 4.0 * np.hypot(error, np.sqrt(0.24 / len(length)))
    assert beyond >= over[0]


def test_stated_error_is_the_scatter_over_seeds() -> None:
    """32 seeds: the standard deviation of their shares is within a factor of two of the error."""
    field = fields(5)["squareness"]
    effects, variances = field.effects * SIGMA, field.variances(SIGMA[None])
    plane, (_, at) = main_plane([effects]), worst_exceedance(variances, 0.5)
    found = []
    for seed in range(32):
        sample = Sample.draw(512, 18, np.random.default_rng(seed))
        found.append(Machines.of([effects], variances[0], sample, plane).beyond(0.5, int(at[0])))
    shares, errors = np.array(found).T
    assert 0.5 < shares.std(ddof=1) / np.sqrt(np.mean(errors**2)) < 2.0


def test_stated_error_of_a_quantile_is_its_scatter_over_seeds() -> None:
    """24 seeds: their standard deviation is within a factor of two of the error."""
    field = fields(5)["squareness"]
    effects, variances = field.effects * SIGMA, field.variances(SIGMA[None])
    plane, (least, at) = main_plane([effects]), worst_quantile(variances, 0.9)
    results = []
    for seed in range(24):
        sample = Sample.draw(512, 18, np.random.default_rng(seed))
        machines = Machines.of([effects], variances[0], sample, plane)
        results.append(machines.quantile(0.9, int(at[0]), float(least[0])))
    bounds, errors = np.array(results).T
    assert 0.5 < bounds.std(ddof=1) / np.sqrt(np.mean(errors**2)) < 2.0


def test_every_replicate_has_the_share_of_its_own_machines() -> None:
    """The error is the scatter of whole replicates, each of which covers the space evenly."""
    machines = machines_of(fields(3)["yaw"], SIGMA, 256)
    each = machines.inverse.shape[1] // machines.replicates
    own = [
        replace(
            machines,
            inverse=machines.inverse[:, at : at + each],
            middle=machines.middle[:, at : at + each],
            apart=machines.apart[:, at : at + each],
            replicates=1,
        )
        for at in range(0, each * machines.replicates, each)
    ]
    shares = [float(part._fractions(0.05, 0)[0]) for part in own]
    assert machines.replicates > 2
    share, error = machines.beyond(0.05, 0)
    assert share == pytest.approx(np.mean(shares), rel=1e-12)
    assert error == pytest.approx(np.std(shares, ddof=1) / np.sqrt(len(shares)), rel=1e-9)


def test_points_at_the_ends_of_their_range_are_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Sobol point of exactly 0 or 1 is a normal number of seven, not an infinite one."""

    class Ends:
        points = np.array([[[0.3, 0.6, 0.0, 1.0], [0.2, 0.9, 0.5, 0.5]]])

    monkeypatch.setattr(MonteCarlo, "draw", lambda *_: Ends())
    sample = Sample.draw(2, 2, np.random.default_rng(0))
    np.testing.assert_allclose(sample.g, [[-7.0345, 7.0345], [0.0, 0.0]], atol=1e-3)
    np.testing.assert_allclose(sample.first, ndtri([[0.3, 0.6], [0.2, 0.9]]), rtol=1e-12)


def test_main_plane_follows_the_design() -> None:
    """The frame turns by little where the deviations change by little, whatever its signs."""
    effects = fields(5)["squareness"].effects
    near = main_plane([effects * SIGMA])
    moved = main_plane([effects * SIGMA * 1.001 ** np.arange(18)])
    np.testing.assert_allclose(moved.T @ moved, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(moved, near, atol=2e-2)


def test_machines_depend_on_the_plane_and_not_on_its_frame() -> None:
    """A processor's rounding decides the signs of eigenvectors, and turns those of equal eigenvalues."""
    field = fields(5)["squareness"]
    effects, variances = field.effects * SIGMA, field.variances(SIGMA[None])[0]
    sample, plane = Sample.draw(64, 18, np.random.default_rng(0)), main_plane([effects])
    turned = plane @ np.array([[0.6, 0.8], [0.8, -0.6]])
    one, other = (Machines.of([effects], variances, sample, frame).beyond(0.5, 0) for frame in (plane, turned))
    assert one == pytest.approx(other, rel=1e-9)


def test_a_sample_about_a_plane_has_its_first_dimensions_there() -> None:
    sample, plane = Sample.draw(64, 18, np.random.default_rng(0)), main_plane([fields(5)["yaw"].effects * SIGMA])
    about = sample.about(plane)
    np.testing.assert_allclose(about.g @ plane, sample.first, atol=1e-12)
    beside = np.eye(18) - plane @ plane.T
    np.testing.assert_allclose(about.g @ beside, sample.g @ beside, atol=1e-12)


def test_of_poses_that_are_equal_but_for_rounding_the_first_is_the_worst() -> None:
    """Poses at one radius have the same yaw: which of them a rounding makes the largest must not matter."""
    over = np.array([[0.1, 0.3, 0.3 + 1e-15, 0.2], [0.0, 0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(first_largest(over), [1, 0])
