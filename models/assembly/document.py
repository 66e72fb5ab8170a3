"""Document A's case: its parts, its table of precision weights, recomputed by the full model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...units import ARCSEC, MRAD
from .assemble import assemble
from .process import Process, plane_process
from .regulator import gains, terminal_weight
from .transmission import AngleMapping, Transmission, about_z

PART_ERRORS_MRAD = (-1.6, 5.3, 5.8, 3.2)
"""Printed angular errors of the four parts."""
PRECISION_WEIGHTS = (0.0, 5.0, 10.0, np.inf)
"""Printed rows; the last is the document's "ideal, error-free"."""
MAPPINGS = (AngleMapping(), AngleMapping("own_cranks", absorption=1.2, floor=2.0 * ARCSEC))
"""Mappings chosen to reproduce the printed figures (docs/rv_transmission_error.md)."""
_LARGE = 1e9
"""Stands for the infinite weight."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the document's table. Falls are relative to the first row, Q = 0."""

    precision_weight: float
    state_mrad: tuple[float, ...]
    norm_mrad: float
    """Norm of the final state."""
    combined_mrad: float
    """Norm of y = C x."""
    effort_mrad2: float
    """Sum of u'Ru."""
    te_amplitude_arcsec: float
    peak_mesh_force_N: float
    norm_fall_percent: float
    combined_fall_percent: float
    te_fall_percent: float
    force_fall_percent: float


def rows(
    transmission: Transmission | None = None,
    reading: str = "printed",
    insertion: str = "before",
    process: Process | None = None,
) -> tuple[Row, ...]:
    """The document's table by the full model, with the same physical parameters in every row."""
    process, full = process or plane_process(), transmission or Transmission()
    weights = np.minimum(PRECISION_WEIGHTS, _LARGE)
    outcome = assemble(
        process,
        gains(process, terminal_weight(process, weights, reading)),
        np.array(PART_ERRORS_MRAD) * MRAD,
        insertion,
    )
    turned = full.turn(about_z(outcome.state))
    sizes = np.stack(
        [
            np.linalg.norm(outcome.state, axis=1) / MRAD,
            np.linalg.norm(outcome.state @ process.observation.T, axis=1) / MRAD,
            full.amplitude(turned) / ARCSEC,
            full.peak(turned),
        ]
    )
    falls = 100.0 * (1.0 - sizes / sizes[:, :1])
    effort = outcome.effort(process) / MRAD**2
    columns = (outcome.state / MRAD, effort, sizes.T, falls.T)
    return tuple(
        Row(weight, tuple(state), norm, combined, adjusting, te, force, *fallen)
        for weight, state, adjusting, (norm, combined, te, force), fallen in zip(
            PRECISION_WEIGHTS, *(column.tolist() for column in columns), strict=True
        )
    )
