"""The units of a population for the loaded contact: a base sample and an allocation as part errors in SI."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from tolevo.models.rv_reducer.population.errors import bearing_clearance, sides
from tolevo.models.rv_reducer.population.units import BaseSample, UnitDesign
from tolevo.units import ARCMIN, MRAD, UM

Array = NDArray[np.float64]


def modified_geometry(geometry: ContactGeometry, design: UnitDesign) -> ContactGeometry:
    """The geometry with the modifications of a design."""
    return replace(geometry, dr_rp=design.dr_rp, dr_p=design.dr_p)


def part_errors(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> PartErrors:
    """Part errors [m, rad] of the units of a design, for the contact of `modified_geometry` geometry.

    Pins have full length: their errors are the same at all discs. A deviation z of half the zone
    changes both models by the same amount; `PartErrors` also has terms beyond the first order. Raises ValueError
    where teeth have errors of their own: it knows one wave.
    """
    if sample.teeth is not None:
        raise ValueError("PartErrors holds pitch errors of one wave per turn, not of every tooth")

    def zone(error: str, source: str | None = None) -> Array:
        """Deviations [um or mrad] of an error, units first."""
        moved = design.middle(error) + design.width(error) * sample.z[source or error]
        return np.moveaxis(moved, -1, 0)

    def phase(error: str) -> Array:
        return np.moveaxis(sample.phase[error], -1, 0)

    return PartErrors(
        pin_radius=UM * zone("pin_radius")[:, None],
        hole_radius=UM * zone("pin_hole_radius")[:, None],
        tangential_position=UM * zone("pin_position")[:, None],
        equidistance=UM * zone("equidistance"),
        shift=UM * zone("shift"),
        pitch=UM * zone("pitch"),
        pitch_phase=phase("pitch"),
        disc_offset=0.5 * UM * zone("runout"),
        disc_offset_phase=phase("runout"),
        angle=np.full((1, 1), design.stagger * ARCMIN) * sides(geometry),
        crank_phase=MRAD * zone("crank_phase"),
        eccentricity=UM * zone("eccentricity"),
        bearing_clearance=UM * np.moveaxis(bearing_clearance(sample, design), -1, 0),
        bore_radial=UM * zone("bore", "bore_radial"),
        bore_tangential=UM * zone("bore", "bore_tangential"),
        circle_radius=UM * zone("pin_circle_radius"),
        circle_offset=UM * zone("circle_offset"),
        circle_phase=phase("circle_offset"),
    )
