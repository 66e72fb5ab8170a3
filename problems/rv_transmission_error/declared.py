"""What `rv_transmission_error` declares: variables, parameters, outputs, costs."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

from ...models.assembly import model
from ...models.assembly.assemble import Departures
from ...models.assembly.transmission import ECCENTRICS, AngleMapping, Transmission
from ...models.costs import CostCurve, Reciprocal
from ...models.rv_reducer.contact.contact import LoadedContact
from ...models.rv_reducer.dynamics import Train
from ...section import Kind, Output, Parameter, Value, Variable
from ...units import ARCMIN, ARCSEC, MM, UM

PARTS = ("crankshaft_1", "gear_1", "crankshaft_2", "gear_2")
AXES = ("x", "y", "z")
DOCUMENT_MRAD: Mapping[str, float] = {
    "crankshaft_1_x_mrad": 1.71,
    "crankshaft_1_y_mrad": 1.66,
    "crankshaft_1_z_mrad": 1.69,
    "gear_1_x_mrad": 2.63,
    "gear_1_y_mrad": 2.62,
    "gear_1_z_mrad": 2.62,
    "crankshaft_2_x_mrad": 1.54,
    "crankshaft_2_y_mrad": 1.52,
    "crankshaft_2_z_mrad": 1.52,
    "gear_2_x_mrad": 1.26,
    "gear_2_y_mrad": 1.26,
    "gear_2_z_mrad": 1.26,
}
"""Document A's allocation: half-widths."""
PRECISION_WEIGHTS = (0.0, 5.0, 10.0)
"""Document A's precision weights."""
PRECISION = "precision_weight"
RPM = pi / 30.0
"""Radians per second in a revolution per minute."""
SIZE = len(DOCUMENT_MRAD)
"""Number of angles."""

VARIABLES: tuple[Variable, ...] = (
    *(
        Variable(
            name,
            "mrad",
            Kind.HALF_WIDTH,
            0.2,
            6.0,
            f"angle of the {name[:-7].replace('_', ' ')} about {name[-6]}",
            printed,
            valid_low=1e-6,
            random=True,
        )
        for name, printed in DOCUMENT_MRAD.items()
    ),
    Variable(
        PRECISION,
        "",
        Kind.NOMINAL,
        0.0,
        30.0,
        "weight Q of the final error against the adjustment; 0: no adjustment",
        0.0,
        valid_low=0.0,
    ),
)


def _assumed_parameter(name: str, default: float, meaning: str, high: float) -> Parameter:
    return Parameter(name, default, "", meaning, "assumed", assumed=True, low=0.0, high=high, open_low=True)


_OURS = "assumed: the document does not print how angles act on the mesh"
PARAMETERS: tuple[Parameter, ...] = (
    *model.PARAMETERS,
    model.PART_STD,
    Parameter(
        "eccentrics",
        ECCENTRICS[0],
        "",
        "eccentrics that crankshafts 1 and 2 represent: those of a single crank, or of a crank each",
        _OURS,
        assumed=True,
        choices=ECCENTRICS,
    ),
    Parameter(
        "absorption",
        1.0,
        "",
        "fraction of an angle that reaches the contact",
        _OURS,
        assumed=True,
        low=0.0,
        high=10.0,
        open_low=True,
    ),
    Parameter(
        "te_floor_arcsec",
        0.0,
        "arcsec",
        "amplitude of the transmission error from elsewhere",
        _OURS,
        assumed=True,
        low=0.0,
        high=1e4,
    ),
    Parameter(
        "disc_distance_mm", 13.0, "mm", "distance of the disc mid-planes", "assumed", assumed=True, low=0.0, high=1e3
    ),
    Parameter("face_width_mm", 12.0, "mm", "face width of the discs", "assumed", assumed=True, low=0.0, high=1e3),
    Parameter(
        "torque_Nm",
        412.0,
        "Nm",
        "torque on the output",
        "rated torque; assumed: the document names none",
        assumed=True,
        low=0.0,
        high=1e5,
        open_low=True,
    ),
    Parameter(
        "output_speed_rpm",
        15.0,
        "rpm",
        "speed of the output; 0: quasi-static",
        "rated speed; assumed: the document names none",
        assumed=True,
        low=0.0,
        high=1e4,
    ),
    _assumed_parameter("normal_stiffness_N_per_um", 200.0, "stiffness [N/um] of a pin contact", 1e6),
    _assumed_parameter(
        "series_stiffness_Nm_per_arcmin", 58.5, "stiffness [N m/arcmin] between a disc and the carrier", 1e6
    ),
    _assumed_parameter("input_inertia_kgm2", 8e-4, "inertia at the input shaft [kg m^2]", 1e6),
    _assumed_parameter("load_inertia_kgm2", 4.216, "inertia at the output [kg m^2]", 1e6),
    _assumed_parameter("damping_ratio", 0.04, "damping ratio of the first mode", 0.999),
    Parameter("adjustment_gain_error", 0.0, "", "achieved over commanded adjustment, minus 1", low=-1.0, high=1.0),
    Parameter(
        "chain_coupling",
        0.0,
        "",
        "fraction of the movement of chain 2 at its installation by which chain 1 moves",
        low=-1.0,
        high=1.0,
    ),
    Parameter("springback", 0.0, "", "fraction of the total adjustment that returns at the end", low=0.0, high=1.0),
)

OUTPUTS: tuple[Output, ...] = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    Output("adjustment_effort", "", "mean over units of the sum of u'Ru, u in mrad", 10.0, low=0.0),
    Output(
        "te_amplitude_arcsec",
        "arcsec",
        "half peak to peak of the transmission error over an output turn, its one-sided quantile at the coverage",
        low=0.0,
    ),
    Output(
        "peak_mesh_force_N",
        "N",
        "largest force on a pin over an output turn, its one-sided quantile at the coverage",
        low=0.0,
    ),
    *(
        Output(
            f"kc_{at}_{axis}_std_mrad",
            "mrad",
            f"standard deviation of the final angle of the {part.replace('_', ' ')} about {axis}",
            low=0.0,
        )
        for at, part in enumerate(PARTS, 1)
        for axis in AXES
    ),
    Output(
        "kc_sum_std_mrad",
        "mrad",
        "composite error: standard deviation of the sum of the four final angles, root sum of squares about x, y and z",
        low=0.0,
    ),
    Output(
        "kc_rss_std_mrad",
        "mrad",
        "composite error: root sum of squares of the standard deviations of all final angles",
        low=0.0,
    ),
    Output(
        "te_error_percent",
        "%",
        "by how much the influence coefficients overstate the amplitude (full model at units at the quantile)",
        error_of="te_amplitude_arcsec",
    ),
    Output("force_error_percent", "%", "the same for the peak force", error_of="peak_mesh_force_N"),
)

REFERENCE_MRAD = 2.0
"""Half-width of relative cost 1: about the mean of document A's twelve."""
COSTS: Mapping[str, CostCurve] = {name: Reciprocal(0.0, REFERENCE_MRAD) for name in DOCUMENT_MRAD}
"""Equal reciprocal costs; the document prints no coefficients."""


def transmission(parameters: Mapping[str, Value]) -> Transmission:
    """The full model (SI) of parameters by declared name; left-out ones keep their defaults."""
    p: dict[str, Any] = {parameter.name: parameter.default for parameter in PARAMETERS} | dict(parameters)
    contact = LoadedContact(
        normal_stiffness=p["normal_stiffness_N_per_um"] / UM,
        series_stiffness=p["series_stiffness_Nm_per_arcmin"] / ARCMIN,
    )
    mapping = AngleMapping(
        eccentrics=p["eccentrics"],
        absorption=p["absorption"],
        floor=p["te_floor_arcsec"] * ARCSEC,
        disc_distance=p["disc_distance_mm"] * MM,
        face_width=p["face_width_mm"] * MM,
    )
    train = Train(p["input_inertia_kgm2"], p["load_inertia_kgm2"], p["damping_ratio"])
    speed = p["output_speed_rpm"] * RPM
    return Transmission(contact, mapping, p["torque_Nm"], speed, train)


def departures(parameters: Mapping[str, Value]) -> Departures:
    """The linear departures of the assembly from the ideal one."""
    p: dict[str, Any] = dict(parameters)
    return Departures(gain_error=p["adjustment_gain_error"], coupling=p["chain_coupling"], springback=p["springback"])
