"""The allocation that a population of units is built to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

ERRORS = (
    "pin_circle_radius",
    "pin_position",
    "pin_hole_radius",
    "pin_radius",
    "pitch",
    "runout",
    "eccentricity",
    "equidistance",
    "shift",
    "crank_bearing",
    "circle_offset",
    "bore",
    "crank_phase",
)
"""The errors of a unit, in the order of `gradient.Gradient.tolerances`."""


@dataclass(frozen=True, slots=True)
class UnitDesign:
    """Zones and nominal values that units are built to.

    `half_width` by name of the error [um], of `crank_phase` [mrad]; `crank_bearing` is the full
    clearance c of the zone [0, c] [um]. `mid` are mid-limits [um]; those of pin position move all
    pins alike and turn the unit without backlash. `stagger` [arcmin] is the angle by which discs
    are turned, alternately ahead and back; `dr_rp`, `dr_p` [m] are the modifications. An omitted
    name is 0.
    """

    half_width: Mapping[str, float]
    mid: Mapping[str, float] = field(default_factory=dict)
    involute_grade: float = 7.0
    stagger: float = 0.0
    dr_rp: float = -40e-6
    dr_p: float = -70e-6

    def width(self, error: str) -> float:
        """Half-width (full clearance of `crank_bearing`) of an error."""
        return float(self.half_width.get(error, 0.0))

    def middle(self, error: str) -> float:
        """Mid-limit of an error."""
        return float(self.mid.get(error, 0.0))
