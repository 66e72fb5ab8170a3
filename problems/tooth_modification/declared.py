"""What `tooth_modification` declares: variables, parameters, outputs and limits."""

from __future__ import annotations

from collections.abc import Mapping

from ...declarations import Kind, Output, Parameter, Value, Variable, number
from ...models.costs import CostCurve
from ...models.rv_reducer import declared as reducer
from ...models.rv_reducer.contact import declared as contact
from ...models.rv_reducer.contact.contact import LoadedContact
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.geometry import RvGeometry
from ...units import ARCMIN, MM, UM
from ..settings import Bound

_SIZES = ("pin_circle_radius_mm", "pin_radius_mm", "eccentricity_mm", "cycloid_teeth", "pins", "reduction_ratio")
_LOADED = ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin", "discs")
PARAMETERS: tuple[Parameter, ...] = (
    *(parameter for parameter in reducer.PARAMETERS if parameter.name in _SIZES),
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
        "Nm_per_arcmin",
        "tangent stiffness of the unit under the torque, mean over the pitch",
        larger_is_better=True,
        low=0.0,
    ),
    Output(
        "modification_backlash_arcmin",
        "arcmin",
        "backlash by the formula 2 (dr_rp - dr_p sqrt(1-k1^2))/(e z_c) (g4)",
        0.1,
    ),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p (g3)", 0.03, larger_is_better=True),
    Output("clearance_min_mm", "mm", "least raw flank clearance", 0.03, larger_is_better=True),
    Output("conjugate_clearance_min_mm", "mm", "least clearance after first contact (g5)", 0.03, larger_is_better=True),
)

COSTS: Mapping[str, CostCurve] = {}
"""Nothing costs: both modifications are ground in one pass."""
DEFAULT_LIMITS = {
    "dr_rp_mm": Bound(high=0.0),
    "dr_p_mm": Bound(high=0.0),
    "radial_gap_mm": Bound(low=0.03),
    "modification_backlash_arcmin": Bound(low=0.0),
    "conjugate_clearance_min_mm": Bound(low=0.0),
}
"""Radial gap at least 0.03 mm, and g1 to g5 of document B (g3 is implied by the gap)."""
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
