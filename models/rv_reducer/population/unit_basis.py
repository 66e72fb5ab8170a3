"""The properties that all units of an RV reducer have in common, and their construction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.special import ndtr

from ....arrays import Array
from ....declarations import Value, number
from ....units import ARCMIN, MM
from ...inputs import Distribution
from .. import declared, involute
from ..contact.geometry import ContactGeometry
from ..tighter_of import tighter_of
from ..tighter_planet import TighterPlanet
from .design import ERRORS, UnitDesign
from .sample import Hierarchy
from .statistics import Involute


def stem(name: str) -> str:
    """Name of the error that a variable is the zone of."""
    return name.removesuffix("_um").removesuffix("_mrad")


@dataclass(frozen=True, slots=True, eq=False)
class UnitBasis:
    """Geometry, involute stage, hierarchy of errors and mid-limits [um] of all units.

    `planet` is the law of the standardised clearance of the tighter planet, whose planets have
    `planet_share` of their variance in common. Where there is no involute stage (`geared` false)
    phi_1 is 0.
    """

    geometry: ContactGeometry
    stage: involute.InvoluteStage
    hierarchy: Hierarchy
    planet: Distribution
    planet_share: float
    mid: Mapping[str, float]
    geared: bool

    @classmethod
    def from_parameters(
        cls, parameters: Mapping[str, Value], inputs: Mapping[str, Distribution], mids: Mapping[str, float]
    ) -> UnitBasis:
        """The basis of complete parameters; `inputs` and `mids` [um] by name of the error.

        `mids` take the place of those in `parameters`.
        """
        base = declared.backlash_model(parameters, None, {})
        mid = {name: number(parameters.get(f"{name}_mid_um", 0.0)) for name in ERRORS}
        mid |= dict(mids)
        mid["pin_position"] = 0.0  # it turns the unit
        cranks = int(number(parameters["cranks"]))
        geometry = ContactGeometry(
            nominal=base.geometry,
            discs=int(number(parameters["discs"])),
            cranks=cranks,
            true_levers=True,
            involute_stage=bool(parameters["involute_stage"]),
        )
        shares = number(parameters["share_pins"]), number(parameters["share_discs"])
        hierarchy, planet_share = Hierarchy(*shares, inputs), number(parameters.get("planet_share", 0.5))
        return cls(
            geometry,
            base.stage,
            hierarchy,
            tighter_of(hierarchy.of("involute_grade"), TighterPlanet(cranks, planet_share)),
            planet_share,
            mid,
            bool(parameters["involute_stage"]),
        )

    def involute(self, grade: float) -> Involute:
        """phi_1 of units at an ISO grade [arcmin]."""
        middle, half = involute.backlash_zone(self.stage, self.geometry.nominal, np.array(float(grade)))
        unit = 1.0 / ARCMIN if self.geared else 0.0
        return Involute(float(middle) * unit, float(half) * unit, self.planet)

    def tightest(self, planets: Array) -> Array:
        """Standardised clearance (n,) of the tighter planet, of normal numbers (planets + 1, n)."""
        share = self.planet_share
        scores = np.sqrt(share) * planets[0] + np.sqrt(1.0 - share) * planets[1:]
        return self.hierarchy.of("involute_grade").quantile(ndtr(scores.min(axis=0)))

    def design(self, row: Mapping[str, float], means: Mapping[str, float] = MappingProxyType({})) -> UnitDesign:
        """The design of one row of variables by name, in their units.

        `means` [um] are the deviations of the means of errors from their mid-limits; that of the
        position of the pins turns the unit.
        """
        mids = {name: self.mid.get(name, 0.0) + mean for name, mean in means.items() if name != "pin_position"}
        return UnitDesign(
            half_width={
                error: row[name] for error in ERRORS for name in (f"{error}_um", f"{error}_mrad") if name in row
            },
            mid={**self.mid, **mids},
            involute_grade=row["involute_grade"],
            stagger=row["stagger_arcmin"],
            dr_rp=row["dr_rp_mm"] * MM,
            dr_p=row["dr_p_mm"] * MM,
        )
