"""Assemblies put together step by step, a batch at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtri

from ...section import Array
from .process import Estimator, Process


@dataclass(frozen=True, slots=True, eq=False)
class Departures:
    """Departures of a real assembly from the ideal; numbers, or arrays (n,) over assemblies."""

    gain_error: float | Array = 0.0
    """The achieved adjustment is (1 + gain_error) times the commanded one."""
    dead_band: float | Array = 0.0
    """[rad] A commanded adjustment within +-dead_band moves nothing; a larger one is reduced
    by it."""
    coupling: float | Array = 0.0
    """Fraction of the movement by which a part of a later chain is installed that its counterparts
    in earlier chains follow (crankshaft 2 moves crankshaft 1, gear 2 moves gear 1)."""
    springback: float | Array = 0.0
    """Fraction of the sum of all achieved adjustments that returns after the last step."""

    def achieved(self, commanded: Array) -> Array:
        """Achieved adjustment (n, m) of the commanded one."""
        band = _column(self.dead_band)
        beyond = np.sign(commanded) * np.maximum(np.abs(commanded) - band, 0.0)
        return np.asarray((1.0 + _column(self.gain_error)) * beyond)


IDEAL = Departures()


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """The results of a batch of assemblies."""

    state: Array
    """Final state (..., n) [rad]."""
    adjustments: Array
    """Commanded adjustments (..., N, m) [rad]."""

    def effort(self, process: Process) -> Array:
        """Sum of u'Ru over the steps, shape (...) [rad^2]."""
        u = self.adjustments
        return np.asarray(np.einsum("...ki,kij,...kj->...", u, process.weight, u))


def assemble(
    process: Process,
    gains: Array,
    errors: Array,
    insertion: str = "before",
    departures: Departures = IDEAL,
    estimator: Estimator | None = None,
    noise: Array | None = None,
) -> Assembled:
    """Final states and adjustments of assemblies with part errors `errors` (..., p) [rad].

    `gains` (N, m, n), or a set for every assembly (..., N, m, n). At step k only the errors of
    the parts installed there are added: with `insertion` "before" the adjustment precedes them, as
    printed; with "after" it follows them. With an `estimator` the adjustment is computed from the
    estimated state; `noise` (..., N, q) [rad] is that of the measurements.
    """
    shape = np.broadcast_shapes(errors.shape[:-1], gains.shape[:-3])
    x = np.zeros((*shape, process.transition.shape[-1]))
    estimate, total, commands = x, x, []
    for step in range(process.steps):
        b = process.control[step]
        installed = _installation_change(process, step, errors, departures)
        if insertion == "after":
            x = x + installed
        if estimator is not None:
            estimate = _correct_estimate(estimator, step, x, estimate, noise)
        commanded = -(gains[..., step, :, :] @ (x if estimator is None else estimate)[..., None])[..., 0]
        achieved = departures.achieved(commanded) @ b.T
        x = x @ process.transition[step].T + achieved
        estimate = estimate @ process.transition[step].T + commanded @ b.T
        total = total + achieved
        if insertion == "before":
            x = x + installed
        commands.append(commanded)
    state = x - _column(departures.springback) * total
    return Assembled(state, np.stack(commands, axis=-2))


def _column(value: float | Array) -> Array:
    """A number, or an array (n,) over assemblies as a column (n, 1)."""
    return np.asarray(value, dtype=float)[..., None]


def _installation_change(process: Process, step: int, errors: Array, departures: Departures) -> Array:
    """Change (..., n) of the state by installing the parts of a step."""
    direct = np.where(process.arriving[step], errors, 0.0) @ process.error[step].T
    return np.asarray(direct + _column(departures.coupling) * (direct @ process.coupling.T))


def _correct_estimate(estimator: Estimator, step: int, x: Array, estimate: Array, noise: Array | None) -> Array:
    """The estimate (..., n) after the measurement of a step."""
    innovation = (x - estimate) @ estimator.measured[step].T
    if noise is not None:
        innovation = innovation + noise[..., step, :]
    return np.asarray(estimate + innovation @ estimator.gain[step].T)


# The linear response of adjusted assemblies: from the scatter of parts to that of the result.


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Final state and adjustments per unit of each part error and measurement noise."""

    state: Array
    """Shape (..., n, p + noise)."""
    adjustments: Array
    """Shape (..., N, m, p + noise)."""

    def std(self, sources: Array) -> Array:
        """Standard deviation (..., n) of the final state.

        `sources` (..., p + noise): standard deviations of independent part errors and noises.
        """
        return np.asarray(np.sqrt(np.einsum("...ij,...j->...i", self.state**2, sources**2)))

    def effort(self, process: Process, sources: Array) -> Array:
        """Expected adjustment effort, sum of u'Ru, shape (...)."""
        per_unit = np.einsum("...kis,kij,...kjs->...s", self.adjustments, process.weight, self.adjustments)
        return np.asarray(np.sum(per_unit * sources**2, axis=-1))


def response(
    process: Process,
    gains: Array,
    insertion: str = "before",
    estimator: Estimator | None = None,
    departures: Departures = IDEAL,
) -> Response:
    """The response of `gains` (..., N, m, n): unit errors and noises, assembled as a batch.

    `departures` must act linearly: no dead band.
    """
    parts = process.error.shape[-1]
    errors, noise = np.eye(parts), None
    if estimator is not None:
        measurements = estimator.gain.shape[0], estimator.gain.shape[-1]
        count = measurements[0] * measurements[1]
        errors = np.vstack([errors, np.zeros((count, parts))])
        units = np.vstack([np.zeros((parts, count)), np.eye(count)])
        noise = units.reshape(parts + count, *measurements)
    gain = gains[..., None, :, :, :]
    outcome = assemble(process, gain, errors, insertion, departures, estimator, noise)
    return Response(np.moveaxis(outcome.state, -2, -1), np.moveaxis(outcome.adjustments, -3, -1))


# Quantiles, over units, of quantities that depend on angles, Gaussian or as a sample has them.


DIRECTIONS = 64
NEWTON_STEPS = 30
CHUNK = 2**21
"""Numbers of a sample held at once."""


def radius_quantile(covariance: Array, coverage: float) -> Array:
    """Radius (...) that a centred Gaussian vector in the plane keeps with probability `coverage`.

    `covariance` (..., 2, 2) with eigenvalues l_1, l_2: P(R > r) is the mean over phi of
    exp(-r^2 / (2 s)), s = l_1 cos^2 phi + l_2 sin^2 phi (Hoyt distribution). ln P is convex in
    r^2, so that Newton's method approaches the radius from below, from the quantile of the widest
    direction.
    """
    values = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    scale = values[..., 1]
    ratio = np.where(scale > 0.0, values[..., 0] / np.where(scale > 0.0, scale, 1.0), 0.0)
    angle = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    rate = 0.5 / (np.cos(angle) ** 2 + ratio[..., None] * np.sin(angle) ** 2)
    square = np.full(ratio.shape, ndtri(0.5 * (1.0 + coverage)) ** 2)
    for _ in range(NEWTON_STEPS):
        exceedances = np.exp(-rate * square[..., None])
        total = exceedances.sum(axis=-1)
        level = np.log(total / DIRECTIONS) - np.log1p(-coverage)
        square = square + level * total / np.sum(rate * exceedances, axis=-1)
    return np.asarray(np.sqrt(square * scale))


def normals(count: int, dimensions: int, seed: int = 0) -> Array:
    """A scrambled Sobol sample of independent standard normals (count, dimensions)."""
    bits = int(np.ceil(np.log2(max(count, 2))))
    points = scipy.stats.qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(bits)
    return np.asarray(ndtri(np.clip(points[:count], 1e-12, 1.0 - 1e-12)))


def root(covariance: Array) -> Array:
    """A with A A' = covariance, shape (..., k, k), also where it is singular: standard deviations
    times the symmetric root of the correlations, to the same precision in every row and on every
    processor, whatever the units of the rows and however often an eigenvalue occurs.
    """
    scale = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))[..., None]
    over = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / over / np.swapaxes(over, -1, -2))
    part = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    return np.asarray(scale * (part @ np.swapaxes(vectors, -1, -2)))


def sample_quantile(covariance: Array, sample: Array, of: Callable[[Array], Array], coverage: float) -> Array:
    """Quantile (n,) over `sample` (s, k) standard normals of `of` (..., k) -> (...).

    `covariance` (n, k, k) is that of the argument of `of`.
    """
    return quantile_over(root(covariance), sample, of, coverage)


def quantile_over(factors: Array, sample: Array, of: Callable[[Array], Array], coverage: float) -> Array:
    """Quantile (n,) over `sample` (s, m) of standardised sources of `of` (..., k) -> (...).

    `factors` (n, k, m) take the sources to the argument of `of`. Designs are taken in chunks, so
    that memory does not grow with n.
    """
    step = max(1, CHUNK // sample.size)
    quantiles = [
        np.quantile(of(sample @ np.swapaxes(part, -1, -2)), coverage, axis=-1)
        for part in np.split(factors, range(step, len(factors), step))
    ]
    return np.concatenate(quantiles)
