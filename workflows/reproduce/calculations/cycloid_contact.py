"""Sensitivities of backlash to the errors of document B, by exact contact of every pin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ....arrays import Array
from ....declarations import Output, Value, number
from ....models.rv_reducer.contact.contact import LoadedContact
from ....models.rv_reducer.contact.errors import PartErrors
from ....models.rv_reducer.contact.geometry import ContactGeometry
from ....models.rv_reducer.contact.performance import backlash
from ....records import Axis
from ....units import MM, UM
from ..calculation import Calculation, Computed, ComputedTable
from .results import assumed, parameter, quantities

PHASES = 72
"""Phases of an error that turns with its disc, among which the worst is sought."""

MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "pin_circle_radius": "radius of the pin circle",
        "pin_position_adverse": "position of pins along the circle, opposite on the two flanks",
        "pin_hole_radius": "radius of the pin holes",
        "pin_radius": "radius of the pins",
        "pitch_worst_phase": "cumulative pitch error of the disc, at its worst phase",
        "runout_worst_phase": "radial runout of the disc, at its worst phase",
        "equidistance": "equidistance modification",
        "shift": "shift modification",
        "eccentricity": "eccentricity",
        "crank_bearing": "clearance of the crank-arm bearings",
    }
)
"""Change of backlash times e z_c per unit of each of these, for small errors."""


@dataclass(frozen=True, slots=True)
class Finite:
    """Central differences of the mean backlash of one disc over a pin pitch, times e z_c."""

    contact: LoadedContact
    angles: Array
    step: float

    def backlash(self, errors: PartErrors) -> Array:
        """Backlash against the mesh, as a gap e z_c phi [m], (units, angles)."""
        geometry = self.contact.geometry
        scale = geometry.output_ratio * geometry.nominal.lever
        return backlash(self.contact, errors, self.angles) * scale

    def mean(self, name: str, shape: tuple[int, ...]) -> float:
        """The difference by an error that all pins or teeth have in common."""
        ends = [self.backlash(PartErrors(**{name: np.full(shape, sign * self.step)})).mean() for sign in (1.0, -1.0)]
        return float(ends[0] - ends[1]) / (2.0 * self.step)

    def adverse_position(self) -> float:
        """That by pins displaced along the circle, on both flanks so that the gap opens."""
        phase = self.contact.geometry.phase(self.angles)[:, 0, :]
        side = np.sign(np.sin(phase))[:, None, :] * self.step  # a unit for every angle
        ends = [np.diagonal(self.backlash(PartErrors(tangential_position=sign * side))).mean() for sign in (-1.0, 1.0)]
        return abs(float(ends[0] - ends[1])) / (2.0 * self.step)

    def worst_phase(self, name: str, size: float) -> float:
        """That by an error that turns with the disc, at its worst phase and angle."""
        phase = 2.0 * np.pi * np.arange(PHASES)[:, None] / PHASES
        moved = PartErrors(**{name: np.full((1, 1), size * self.step), f"{name}_phase": phase})
        return float(np.max(self.backlash(moved) - self.backlash(PartErrors()))) / self.step


class CycloidContact(Calculation):
    """Sensitivity of backlash to each error of the cycloid stage, by exact geometry of 40 pins."""

    name = "cycloid_contact"
    about = "Sensitivity of backlash to each error of the cycloid stage, by exact 40-pin geometry."
    reference = "document B, table of relative sensitivities"
    sampled = False
    outputs = tuple(Output(name, "1", meaning) for name, meaning in MEANINGS.items())
    parameters = (
        parameter("dr_rp_mm", -0.040, "equidistance modification", "document B"),
        parameter("dr_p_mm", -0.070, "shift modification", "document B"),
        assumed(
            "step_um",
            0.1,
            "size of the error in the central differences",
            "assumed: far below the modification",
            0.0,
            10.0,
            open_low=True,
        ),
        assumed("angles", 40, "crank angles over a pin pitch", low=1, high=1000),
        parameter(
            "true_levers", True, "lever arms of the modified profile; otherwise those of the unmodified one", "geometry"
        ),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        sensitivities = _sensitivities(_finite(self.completed(values)))
        table = ComputedTable(
            "sensitivities",
            "Change of backlash times e z_c per unit of each error, by exact contact of 40 pins; "
            "document B prints half of most",
            (Axis("error", ""), Axis("exact", "1", "by exact contact")),
            (np.array(list(sensitivities)), np.array(list(sensitivities.values()))),
        )
        return Computed(quantities(sensitivities), (table,))


def _finite(values: Mapping[str, Value]) -> Finite:
    geometry = ContactGeometry(
        dr_rp=number(values["dr_rp_mm"]) * MM,
        dr_p=number(values["dr_p_mm"]) * MM,
        discs=1,
        cranks=1,
        true_levers=bool(values["true_levers"]),
    )
    count = int(number(values["angles"]))
    angles = 2.0 * np.pi / geometry.pins * np.arange(count) / count
    return Finite(LoadedContact(geometry), angles, number(values["step_um"]) * UM)


def _sensitivities(by: Finite) -> dict[str, float]:
    pin, disc = (1, 1, 1), (1, 1)
    clearance = by.backlash(PartErrors(bearing_clearance=np.full(pin, by.step)))
    return {
        "pin_circle_radius": by.mean("circle_radius", (1,)),
        "pin_position_adverse": by.adverse_position(),
        "pin_hole_radius": by.mean("hole_radius", pin),
        "pin_radius": by.mean("pin_radius", pin),
        "pitch_worst_phase": by.worst_phase("pitch", 1.0),
        "runout_worst_phase": by.worst_phase("disc_offset", 0.5),
        "equidistance": by.mean("equidistance", disc),
        "shift": by.mean("shift", disc),
        "eccentricity": by.mean("eccentricity", pin),
        "crank_bearing": float(np.mean(clearance - by.backlash(PartErrors()))) / by.step,
    }
