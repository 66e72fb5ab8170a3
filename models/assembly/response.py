"""The linear response of adjusted assemblies: from the scatter of parts to that of the result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .assemble import IDEAL, Departures, assemble
from .estimator import Estimator
from .process import Process


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
