"""From the settings of the problem to the model of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from ...declarations import Value, number
from ...models.inputs import Distribution
from ...models.rv_reducer import declared as document
from ...models.rv_reducer import involute
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.population.design import ERRORS, UnitDesign
from ...models.rv_reducer.population.elastic_springs import Loading
from ...models.rv_reducer.population.measures import Conditions
from ...models.rv_reducer.population.sample import Hierarchy
from ...models.rv_reducer.population.statistics import Involute
from ...models.rv_reducer.population.turn import Population
from ...models.rv_reducer.tighter_planet import TighterPlanet
from ...units import ARCMIN, MM
from ..settings import VariableSetting

Array = NDArray[np.float64]


def stem(name: str) -> str:
    """Name of the error that a variable is the zone of."""
    return name.removesuffix("_um").removesuffix("_mrad")


@dataclass(frozen=True, slots=True, eq=False)
class UnitModel:
    """What every unit has in common, and how units are drawn."""

    geometry: ContactGeometry
    stage: involute.InvoluteStage
    hierarchy: Hierarchy
    conditions: Conditions
    planet: TighterPlanet
    mid: Mapping[str, float]
    cosine: float
    loading: Loading
    preload: float

    @classmethod
    def of(
        cls,
        parameters: Mapping[str, Value],
        variables: Mapping[str, VariableSetting],
        coverage: float,
    ) -> UnitModel:
        """The model of completed settings."""
        inputs: dict[str, Distribution] = {
            stem(name): one.distribution for name, one in variables.items() if one.distribution
        }
        base = document.backlash_model(parameters, None, {})
        mid = {name: number(parameters.get(f"{name}_mid_um", 0.0)) for name in ERRORS}
        mid |= {stem(n): one.mid for n, one in variables.items() if one.mid is not None}
        mid["pin_position"] = 0.0  # it turns the unit
        cranks = int(number(parameters["cranks"]))
        geometry = ContactGeometry(
            nominal=base.geometry,
            discs=int(number(parameters["discs"])),
            cranks=cranks,
            true_levers=True,
            involute_stage=bool(parameters["involute_stage"]),
        )
        conditions = Conditions(
            coverage,
            number(parameters["backlash_limit_arcmin"]),
            str(parameters["interference"]),
            number(parameters["overlap_arcmin"]),
        )
        alpha = radians(number(parameters["pressure_angle_deg"]))
        scale = 1.0 / cos(alpha) if parameters.get("involute_cosine", True) else 1.0
        rated = number(parameters["rated_torque_Nm"])
        loading = Loading(
            normal_stiffness=number(parameters["normal_stiffness_N_per_mm"]) / MM,
            series_stiffness=number(parameters["series_stiffness_Nm_per_arcmin"]) / ARCMIN,
            rated_torque=rated,
            te_torque=number(parameters["te_torque_Nm"]) or rated,
        )
        return cls(
            geometry,
            base.stage,
            Hierarchy(number(parameters["share_pins"]), number(parameters["share_discs"]), inputs),
            conditions,
            TighterPlanet(cranks, number(parameters.get("planet_share", 0.5))),
            mid,
            scale if parameters["involute_stage"] else 0.0,
            loading,
            0.01 * number(parameters["preload_percent_of_rated"]) * loading.rated_torque,
        )

    def population(self, positions: int, units: int, seed: int, stream: int) -> Population:
        """A population drawn from `seed`; each `stream` is independent of the others."""
        rng = np.random.default_rng([seed, stream])
        return Population.draw(self.geometry, positions, units, rng, self.hierarchy)

    def involute(self, grade: float) -> Involute:
        """phi_1 of units at an ISO grade [arcmin]."""
        middle, half = involute.backlash_zone(
            self.stage, self.geometry.nominal, np.array(float(grade))
        )
        unit = self.cosine / ARCMIN
        return Involute(float(middle) * unit, float(half) * unit, self.planet)

    def design(self, row: Mapping[str, float]) -> UnitDesign:
        """The design of one row of variables by name, in their units."""
        return UnitDesign(
            half_width={
                error: row[name]
                for error in ERRORS
                for name in (f"{error}_um", f"{error}_mrad")
                if name in row
            },
            mid=self.mid,
            involute_grade=row["involute_grade"],
            stagger=row["stagger_arcmin"],
            dr_rp=row["dr_rp_mm"] * MM,
            dr_p=row["dr_p_mm"] * MM,
        )
