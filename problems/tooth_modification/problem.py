"""Backlash against the largest pin force, by the two modifications of the tooth profile."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import number
from ...errors import Fault, InputError
from ...models.rv_reducer import modification
from ...models.rv_reducer.contact.contact import LoadedContact
from ...models.rv_reducer.contact.errors import PartErrors
from ...models.rv_reducer.contact.performance import backlash, loading
from ...models.rv_reducer.geometry import RvGeometry
from ...units import ARCMIN, MM
from ..declaration import Declaration, Interval
from ..interfaces import Documented
from ..settings import Settings
from ..tolerance_problem import ToleranceProblem
from . import declared

SEARCH_ANGLES, ANGLES = 32, 64
"""Crank angles over a pin pitch: forces of 32 are within 0.1 % of those of 256."""
PRINTED = {"dr_rp_mm": -0.040, "dr_p_mm": -0.070}
"""Document B's optimum."""


class ToothModification(ToleranceProblem, Documented):
    """Backlash against mesh force by equidistance and shift modification (document B, section 3).

    Both objectives are of the loaded contact with perfect parts: designs are its units, the
    modifications their deviations. A search expands the gaps to third order, what is reported has
    the exact profile. Known answer: none (`exact_front` is None). See docs/tooth_modification.md.
    """

    declaration = Declaration(
        declared.VARIABLES,
        declared.OUTPUTS,
        declared.PARAMETERS,
        costs=declared.COSTS,
        limits=declared.DEFAULT_LIMITS,
        objectives=declared.DEFAULT_OBJECTIVES,
        model="rv_transmission",
    )

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        p = {name: number(value) for name, value in self.settings.parameters.items()}
        self.geometry: RvGeometry = declared.geometry_of(p)

    @cached_property
    def contact(self) -> LoadedContact:
        """The contact of one disc. Raises InputError where the profile is undercut."""
        return declared.one_disc(self.settings.parameters)

    # ---------------------------------------------------------------- evaluation

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        count = SEARCH_ANGLES if searching else ANGLES
        angles = 2.0 * np.pi / self.geometry.pins * np.arange(count) / count
        contact = replace(self.contact, exact=not searching)
        parts = self._modified(designs)
        loads = loading(contact, parts, angles, contact.rated_torque)
        discs = number(self.settings.parameters["discs"])
        return {
            "backlash_arcmin": backlash(contact, parts, angles).mean(axis=1) / ARCMIN,
            "peak_mesh_force_N": loads.peak,
            "mean_peak_force_N": loads.mean_peak,
            "pins_loaded": loads.loaded,
            "stiffness_Nm_per_arcmin": discs * loads.stiffness * ARCMIN,
        } | self.profile(designs)

    def _modified(self, designs: Array) -> PartErrors:
        """Designs as units of the contact, by their deviations from its profile."""
        base = self.contact.geometry
        return PartErrors(
            equidistance=(self.column(designs, "dr_rp_mm") * MM - base.dr_rp)[:, None],
            shift=(self.column(designs, "dr_p_mm") * MM - base.dr_p)[:, None],
        )

    def profile(self, designs: Array) -> dict[str, Array]:
        """First-order outputs of the profile, shape (n,), of full designs."""
        pair = (self.column(designs, "dr_rp_mm") * MM, self.column(designs, "dr_p_mm") * MM)
        play = modification.modification_backlash(self.geometry, *pair)
        return {
            "modification_backlash_arcmin": play / ARCMIN,
            "radial_gap_mm": (pair[0] - pair[1]) / MM,
            "clearance_min_mm": modification.least_raw_clearance(self.geometry, *pair) / MM,
            "conjugate_clearance_min_mm": modification.least_clearance(self.geometry, *pair) / MM,
        }

    # ---------------------------------------------------------------- what is known

    def references(self) -> dict[str, Array]:
        """Document B's optimum, and the pair of the same gap without backlash."""
        gap = PRINTED["dr_rp_mm"] - PRINTED["dr_p_mm"]
        pair = modification.zero_backlash_pair(self.geometry, gap * MM)
        printed = np.array([PRINTED[name] for name in self.names])
        return {"document B": printed, "zero backlash, same radial gap": np.array(pair) / MM}

    def interval(self, output: str) -> Interval:
        """Proven bounds: of the formulas over the corners of the ranges, which are linear."""
        if output in ("modification_backlash_arcmin", "radial_gap_mm"):
            ranges = [self.interval(name) for name in ("dr_rp_mm", "dr_p_mm")]
            corners = np.array([[a, b] for a in ranges[0] for b in ranges[1]])
            outputs = self.profile(corners)[output]
            return float(outputs.min()), float(outputs.max())
        if output in ("peak_mesh_force_N", "mean_peak_force_N", "pins_loaded"):
            return 0.0, np.inf
        return super().interval(output)

    def box(self) -> tuple[Array, Array]:
        """From the values of the ends of the limited range, not from the bounds of the forces."""
        values = self.objective_values(self.outputs_of(self._corners(), errors=False))
        ideal = values.min(axis=0)
        return ideal, np.maximum(values.max(axis=0), ideal + 1e-12)

    def _corners(self) -> Array:
        """Ends of the line of least radial gap: no backlash by the formula, and no equidistance.

        Without a gap both are the unmodified profile: then those of the largest shift as well.
        """
        gap = max(0.0, float(self.settings.limits["radial_gap_mm"].low))
        ends = np.array([super(ToothModification, self).interval(name) for name in self.names])
        largest = -ends[1, 0]
        gaps = [gap] if gap > 0.0 else [0.0, largest * (1.0 - self.geometry.flank)]
        pairs = [modification.zero_backlash_pair(self.geometry, least_gap * MM) for least_gap in gaps]
        tight = np.array(pairs) / MM
        rows = np.vstack([tight, [[0.0, -least_gap] for least_gap in gaps]])
        return np.asarray(np.clip(rows, ends[:, 0], ends[:, 1]))

    # ---------------------------------------------------------------- faults

    def faults(self) -> list[Fault]:
        if not 0.0 < self.geometry.k1 < 1.0:
            text = f"e z_p/r_p must lie in (0, 1), got {self.geometry.k1:.4g}"
            return [Fault("parameters.eccentricity_mm", text)]
        try:
            declared.one_disc(self.settings.parameters)
        except InputError as error:
            return list(error.faults)
        return super().faults()
