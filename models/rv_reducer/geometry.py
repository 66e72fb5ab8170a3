"""Nominal geometry of an RV reducer."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True, slots=True)
class RvGeometry:
    """Nominal geometry; the defaults are the RV-40E-121 of document B.

    Lengths in metres. The document prints no sun pitch radius and no centre distance: 9 mm and
    36 mm are assumptions (z1 = 12, z2 = 36, m = 1.5 mm; z2/z1 = 3 is exact), as is the thermal
    expansion [1/K] of disc and housing: 11.5e-6, of bearing steel.
    """

    pin_circle_radius: float = 0.064
    pin_radius: float = 0.003
    eccentricity: float = 0.0013
    cycloid_teeth: int = 39
    pins: int = 40
    reduction_ratio: float = 121.0
    sun_pitch_radius: float = 0.009
    centre_distance: float = 0.036
    expansion: float = 11.5e-6

    @property
    def k1(self) -> float:
        """Shortening coefficient e z_p / r_p, in (0, 1)."""
        return self.eccentricity * self.pins / self.pin_circle_radius

    @property
    def flank(self) -> float:
        """sqrt(1 - k1^2): part of a radial displacement that closes the flank at first contact."""
        return sqrt(1.0 - self.k1**2)

    @property
    def lever(self) -> float:
        """e z_c, the largest lever arm of the cycloid mesh [m]."""
        return self.eccentricity * self.cycloid_teeth

    @property
    def output_ratio(self) -> float:
        """Turn of a disc against its mesh per turn of the carrier, with the sun held.

        The cranks turn by 1 + z1/z2 with the carrier: 1 + (1 + z1/z2)/z_c, 121/117 by default.
        """
        gears = (self.reduction_ratio - 1.0) / self.pins  # z2/z1
        return 1.0 + (1.0 + 1.0 / gears) / self.cycloid_teeth
