"""Tooth modification of the cycloid discs: backlash against load on the pins."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cached_property
from itertools import product

import numpy as np

from ..errors import Fault, InputError
from ..models.costs import CostCurve
from ..models.rv_reducer import declared, geometry
from ..models.rv_reducer.contact import declared as contact
from ..models.rv_reducer.contact.contact import LoadedContact, backlash, loading
from ..models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from ..models.rv_reducer.geometry import RvGeometry
from ..section import Array, Kind, Output, Parameter, Section, Value, Variable, number
from ..units import ARCMIN, MM, UM
from .declaration import ConfiguredProblem, Declaration, Interval
from .limits import apart
from .rv_backlash.problem import DEFAULT_LIMITS
from .settings import Settings
from .tolerance_problem import ToleranceProblem

__all__ = ["ToothModification"]

# What `tooth_modification` declares: variables, parameters, outputs and limits.


_SIZES = ("pin_circle_radius_mm", "pin_radius_mm", "eccentricity_mm", "cycloid_teeth", "pins", "reduction_ratio")
_LOADED = ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin", "discs")
PARAMETERS: tuple[Parameter, ...] = (
    *(parameter for parameter in declared.PARAMETERS if parameter.name in _SIZES),
    *(parameter for parameter in contact.PARAMETERS if parameter.name in _LOADED),
    Parameter(
        "torque_Nm",
        412.0,
        "Nm",
        "torque on the output",
        "rated torque, catalogue of the RV-40E-121",
        low=0.0,
        high=1e5,
        open_low=True,
    ),
)

VARIABLES: tuple[Variable, ...] = (
    Variable(
        "dr_rp_mm", "mm", Kind.NOMINAL, -0.08, 0.0, "equidistance modification", -0.040, valid_low=-0.2, valid_high=0.0
    ),
    Variable("dr_p_mm", "mm", Kind.NOMINAL, -0.12, 0.0, "shift modification", -0.070, valid_low=-0.2, valid_high=0.0),
)

ROTATION = Variable(
    "rotation_arcmin",
    "arcmin",
    Kind.NOMINAL,
    -1.0,
    0.0,
    "rotation-angle modification d_delta of a second pass with the disc turned: it removes, and opens both flanks",
    0.0,
    valid_low=-60.0,
    valid_high=0.0,
)
"""The third amount of document B, declared where a configuration states it."""


def with_rotation(plain: Declaration, stated: Collection[str]) -> Declaration:
    """The declaration with the rotation-angle modification, where it is `stated`."""
    return replace(plain, variables=(*plain.variables, ROTATION)) if ROTATION.name in stated else plain


OUTPUTS: tuple[Output, ...] = (
    Output(
        "backlash_arcmin",
        "arcmin",
        "backlash of rigid parts at the output, mean over a pin pitch, by exact contact",
        0.1,
    ),
    Output("peak_mesh_force_N", "N", "largest force on a pin over a pin pitch, under the torque", low=0.0),
    Output("mean_peak_force_N", "N", "mean over the pitch of the largest force on a pin", low=0.0),
    Output("pins_loaded", "", "pins of a disc that bear, mean over the pitch", low=0.0),
    Output(
        "stiffness_Nm_per_arcmin",
        "Nm/arcmin",
        "tangent stiffness of the unit under the torque, mean over the pitch",
        larger_is_better=True,
        low=0.0,
    ),
    Output(
        "modification_backlash_arcmin",
        "arcmin",
        "backlash by the formula 2 (dr_rp - dr_p sqrt(1-k1^2))/(e z_c) - 2 d_delta (g4)",
        0.1,
    ),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p (g3)", 0.03, larger_is_better=True),
    Output("clearance_min_mm", "mm", "least raw flank clearance", 0.03, larger_is_better=True),
    Output("conjugate_clearance_min_mm", "mm", "least clearance after first contact (g5)", 0.03, larger_is_better=True),
)

COSTS: Mapping[str, CostCurve] = {}
"""Nothing costs: both modifications are ground in one pass."""
DEFAULT_OBJECTIVES = ("backlash_arcmin", "peak_mesh_force_N")

SHIFT = -60 * UM
"""Shift modification [m] about which the contact is expanded: the middle of the search range."""
OPEN = 5 * UM
"""Remaining flank clearance [m] there, so that no profile interferes."""


def one_disc(parameters: Mapping[str, Value]) -> LoadedContact:
    """The contact (SI) of one disc, modified in the middle of the range.

    Perfect discs share the torque alike and see the same phases, so that one stands for all. Every
    design is an error of this one, and has its lever arms: those of the unmodified profile, which
    belong to no design more than to another.
    Raises InputError where the profile is undercut.
    """
    given = {parameter.name: parameter.default for parameter in PARAMETERS} | dict(parameters)
    p = {name: number(value) for name, value in given.items()}
    nominal = geometry_of(p)
    return LoadedContact(
        geometry=ContactGeometry(nominal, nominal.flank * SHIFT + OPEN, SHIFT, discs=1, true_levers=False),
        normal_stiffness=p["normal_stiffness_N_per_mm"] / MM,
        series_stiffness=p["series_stiffness_Nm_per_arcmin"] / ARCMIN,
        rated_torque=p["torque_Nm"] / p["discs"],
        momentary_torque=float("inf"),
    )


def geometry_of(parameters: Mapping[str, float]) -> RvGeometry:
    """The nominal geometry (SI) of all parameters by declared name."""
    return RvGeometry(
        pin_circle_radius=parameters["pin_circle_radius_mm"] * MM,
        pin_radius=parameters["pin_radius_mm"] * MM,
        eccentricity=parameters["eccentricity_mm"] * MM,
        cycloid_teeth=int(parameters["cycloid_teeth"]),
        pins=int(parameters["pins"]),
        reduction_ratio=parameters["reduction_ratio"],
    )


# Backlash against the largest pin force, by the two modifications of the tooth profile.


SEARCH_ANGLES, ANGLES = 32, 64
"""Crank angles over a pin pitch: forces of 32 are within 0.1 % of those of 256."""
PRINTED = {"dr_rp_mm": -0.040, "dr_p_mm": -0.070}
"""Document B's optimum."""


class ToothModification(ToleranceProblem):
    """Backlash against mesh force by equidistance, shift and rotation-angle modification (document B, section 3).

    Both objectives are of the loaded contact with perfect parts: designs are its units, the
    modifications their deviations. A search expands the gaps to third order, what is reported has
    the exact profile. Known answer: none (`exact_front` is None). See docs/tooth_modification.md.
    """

    declaration = Declaration(
        VARIABLES,
        OUTPUTS,
        PARAMETERS,
        costs=COSTS,
        limits=DEFAULT_LIMITS,
        objectives=DEFAULT_OBJECTIVES,
        model="rv_transmission",
    )

    def __init__(self, settings: Settings | None = None) -> None:
        self.declaration = with_rotation(type(self).declaration, settings.variables if settings else ())
        super().__init__(settings)
        p = {name: number(value) for name, value in self.settings.parameters.items()}
        self.geometry: RvGeometry = geometry_of(p)

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        """With the rotation-angle modification where `[variables]` states it."""
        variables = top.section("variables")
        stated = [name for name in (ROTATION.name,) if name in variables]
        return ConfiguredProblem(with_rotation(cls.declaration, stated), cls)

    @cached_property
    def contact(self) -> LoadedContact:
        """The contact of one disc. Raises InputError where the profile is undercut."""
        return one_disc(self.settings.parameters)

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
        play = -2.0 * base.nominal.centre_distance * self._rotation(designs)  # turns a disc as the flanks are turned
        return PartErrors(
            bearing_clearance=play[:, None, None],
            equidistance=(self.column(designs, "dr_rp_mm") * MM - base.dr_rp)[:, None],
            shift=(self.column(designs, "dr_p_mm") * MM - base.dr_p)[:, None],
        )

    def _rotation(self, designs: Array) -> Array:
        """Rotation-angle modification (n,) [rad], 0 where none is declared."""
        declared = ROTATION.name in self.names
        return self.column(designs, ROTATION.name) * ARCMIN if declared else np.zeros(len(designs))

    def profile(self, designs: Array) -> dict[str, Array]:
        """First-order outputs of the profile, shape (n,), of full designs."""
        pair = (self.column(designs, "dr_rp_mm") * MM, self.column(designs, "dr_p_mm") * MM)
        rotation = self._rotation(designs)
        play = geometry.modification_backlash(self.geometry, *pair, rotation)
        return {
            "modification_backlash_arcmin": play / ARCMIN,
            "radial_gap_mm": (pair[0] - pair[1]) / MM,
            "clearance_min_mm": geometry.least_raw_clearance(self.geometry, *pair, rotation) / MM,
            "conjugate_clearance_min_mm": geometry.least_clearance(self.geometry, *pair) / MM,
        }

    # ---------------------------------------------------------------- what is known

    def references(self) -> dict[str, Array]:
        """Document B's optimum, and the pair of the same gap without backlash."""
        gap = PRINTED["dr_rp_mm"] - PRINTED["dr_p_mm"]
        pair = geometry.zero_backlash_pair(self.geometry, gap * MM)
        without = np.zeros(len(self.names) - len(pair))
        printed = np.array([PRINTED.get(name, 0.0) for name in self.names])
        return {"document B": printed, "zero backlash, same radial gap": np.append(np.array(pair) / MM, without)}

    def interval(self, output: str) -> Interval:
        """Proven bounds: of the formulas over the corners of the ranges, which are linear."""
        if output in ("modification_backlash_arcmin", "radial_gap_mm"):
            corners = np.array(list(product(*(self.interval(name) for name in self.names))))
            outputs = self.profile(corners)[output]
            return float(outputs.min()), float(outputs.max())
        if output in ("peak_mesh_force_N", "mean_peak_force_N", "pins_loaded"):
            return 0.0, np.inf
        return super().interval(output)

    def box(self) -> tuple[Array, Array]:
        """From the values of the ends of the limited range, not from the bounds of the forces."""
        values = self.objective_values(self.outputs_of(self._corners(), errors=False))
        ideal = values.min(axis=0)
        return ideal, apart(ideal, values.max(axis=0))

    def _corners(self) -> Array:
        """Ends of the line of least radial gap: no backlash by the formula, and no equidistance, flanks not turned.

        Without a gap both are the unmodified profile: then those of the largest shift as well.
        """
        gap = max(0.0, float(self.settings.limits["radial_gap_mm"].low))
        ends = np.array([super(ToothModification, self).interval(name) for name in self.names])
        largest = -ends[1, 0]
        gaps = [gap] if gap > 0.0 else [0.0, largest * (1.0 - self.geometry.flank)]
        pairs = [geometry.zero_backlash_pair(self.geometry, least_gap * MM) for least_gap in gaps]
        tight = np.array(pairs) / MM
        rows = np.vstack([tight, [[0.0, -least_gap] for least_gap in gaps]])
        rows = np.hstack([rows, np.zeros((len(rows), len(ends) - 2))])
        return np.asarray(np.clip(rows, ends[:, 0], ends[:, 1]))

    # ---------------------------------------------------------------- faults

    def faults(self) -> list[Fault]:
        if not 0.0 < self.geometry.k1 < 1.0:
            text = f"e z_p/r_p must lie in (0, 1), got {self.geometry.k1:.4g}"
            return [Fault("parameters.eccentricity_mm", text)]
        try:
            one_disc(self.settings.parameters)
        except InputError as error:
            return list(error.faults)
        return super().faults()
