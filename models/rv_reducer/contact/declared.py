"""Parameters of models on the loaded contact, by the names of configurations."""

from __future__ import annotations

from ....section import Parameter

_CATALOGUE = "catalogue of the RV-40E-121"
_B = "document B"


def _assumed_parameter(name: str, default: float, unit: str, meaning: str, source: str) -> Parameter:
    return Parameter(name, default, unit, meaning, source, assumed=True, low=0.0, high=1e9, open_low=True)


def _torque(name: str, default: float, meaning: str) -> Parameter:
    return Parameter(name, default, "Nm", meaning, _CATALOGUE, low=0.0, high=1e7, open_low=True)


PARAMETERS: tuple[Parameter, ...] = (
    _assumed_parameter(
        "normal_stiffness_N_per_mm",
        2e5,
        "N/mm",
        "normal stiffness of one pin contact",
        "linear; loads 5.4 pins of a disc of the RV-40E-121 at 412 N m",
    ),
    _assumed_parameter(
        "series_stiffness_Nm_per_arcmin",
        58.5,
        "Nm/arcmin",
        "stiffness between one disc and the carrier: crank bearings, cranks, carrier",
        "gives the RV-40E-121 its catalogue's 108 N m/arcmin",
    ),
    Parameter("discs", 2, "", "cycloid discs", "as in document A", assumed=True, low=1, high=4),
    Parameter("cranks", 2, "", "crankshafts", "as in document A", assumed=True, low=2, high=12),
    Parameter("dr_rp_mm", -0.040, "mm", "equidistance modification", _B, low=-1.0, high=1.0),
    Parameter("dr_p_mm", -0.070, "mm", "shift modification", _B, low=-1.0, high=1.0),
    _torque("rated_torque_Nm", 412.0, "rated torque"),
    _torque("momentary_torque_Nm", 2058.0, "momentary maximum torque; a larger torque gives a warning"),
)
