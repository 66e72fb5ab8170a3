"""Derivatives of the backlash of rigid units, by the contacts that touch.

The turns at first contact are the least of functions that are linear in the tolerances, so that
their derivatives are those of the contacts that make them.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

import numpy as np

from ....arrays import Array, Complex, Single
from ....units import ARCMIN, UM
from ..contact.contact import Engine, uses_numba
from ..contact.geometry import ContactGeometry, unit
from .design import ERRORS
from .lattice import Lattice
from .sample import BaseSample
from .scaled import bore_axes, crank_lines, pitch_turn, sides
from .table import Table
from .touch import Touch

NAMES = (*ERRORS, "stagger", "dr_rp", "dr_p")
"""Variables of a gradient: zones [arcmin/um], of crank_phase [arcmin/mrad], stagger, and both
modifications [arcmin/mm]."""


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Standardised errors of a base sample, as `pull_back` takes them; they hold for any design."""

    of_unit: Single
    of_discs: Single
    of_pins: Single

    @classmethod
    def of(cls, geometry: ContactGeometry, sample: BaseSample) -> Slopes:
        """The slopes of a base sample."""
        z = sample.z
        arm = UM / geometry.nominal.centre_distance / ARCMIN
        ahead = 1e-3 * geometry.nominal.eccentricity / UM
        circle = z["circle_offset"] * unit(sample.phase["circle_offset"])
        lines = crank_lines(geometry)
        bearing = 0.5 * arm * 0.5 * (1.0 + z["crank_bearing"]).mean(axis=0)
        pitch = pitch_turn(geometry) * z["pitch"] * unit(sample.phase["pitch"])
        runout = 0.5 * z["runout"] * unit(sample.phase["runout"])
        bore = (z["bore_radial"] + 1j * z["bore_tangential"]) * bore_axes(geometry)
        by_disc: list[Array | Complex] = [
            z["equidistance"],
            z["shift"],
            pitch,
            runout,
            z["eccentricity"].mean(axis=0),
            arm * (z["eccentricity"] * lines).mean(axis=0),
            bearing,
            bore.mean(axis=0),
            arm * z["bore_tangential"].mean(axis=0),
            ahead * z["crank_phase"].mean(axis=0),
            arm * ahead * (1j * z["crank_phase"] * lines).mean(axis=0),
            np.broadcast_to(sides(geometry)[:, None], z["shift"].shape),
        ]
        columns = [part for errors in by_disc for part in _parts(errors)]
        return cls(
            _single(np.stack([z["pin_circle_radius"], circle.real, circle.imag])),
            _single(np.stack(columns, axis=1)),
            _single(np.stack([z["pin_position"], z["pin_hole_radius"], z["pin_radius"]])),
        )


def _parts(value: Array | Complex) -> tuple[Array, ...]:
    whole = np.asarray(value, dtype=np.complex128)
    return (whole.real, whole.imag) if np.iscomplexobj(value) else (whole.real,)


def _single(value: Array) -> Single:
    return np.ascontiguousarray(value, dtype=np.float32)


def pull_back(
    lattice: Lattice, table: Table, touch: Touch, slopes: Slopes, weight: Array, engine: Engine = "auto"
) -> Array:
    """Derivatives (names,) of sum(weight y) by `NAMES`, for weights (positions, units).

    y is the backlash of the cycloid stage at the carrier [arcmin], interference below zero.
    """
    ratio = lattice.geometry.output_ratio
    rows = np.flatnonzero(np.any(weight != 0.0, axis=1))
    total = np.zeros(len(NAMES))
    name = ".compiled" if uses_numba(engine) else ".arrays"
    import_module(name, __package__).pull_back(
        _single(weight[rows] / ratio),
        (touch.ahead[rows], touch.behind[rows]),
        (table.values, lattice.pin, lattice.disc, lattice.directions[rows]),
        (slopes.of_unit, slopes.of_discs, slopes.of_pins),
        total,
    )
    total[NAMES.index("dr_rp")] *= 1e3  # from micrometres to millimetres
    return total
