"""Parameters and variables of the model `rv_batch` in addition to those of `rv_backlash`."""

from __future__ import annotations

from ...declarations import Kind, Parameter, Variable
from . import declared
from .contact import declared as contact

MODEL = "model"
CONTACT, DOCUMENT = "contact", "document"
LARGEST, MEAN = "max", "mean"
_NOT_PRINTED = "no document prints it"


def _fraction(name: str, meaning: str) -> Parameter:
    return Parameter(
        name,
        0.0,
        "",
        f"fraction of the variance of {meaning} that is common to a unit; no value is the worst case",
        _NOT_PRINTED,
        assumed=True,
        low=0.0,
        high=1.0,
    )


_OF_BATCHES: tuple[Parameter, ...] = (
    Parameter(
        MODEL,
        CONTACT,
        "",
        "model of a unit: the exact contact of its pins and discs over a turn (contact), or "
        "document B's closed form phi_1 + max(0, phi_2) + phi_3, one number per unit (document)",
        "",
        choices=(CONTACT, DOCUMENT),
    ),
    Parameter(
        "positions",
        61,
        "",
        "positions of a turn of the output at which a unit is measured; used by the contact only",
        "",
        low=1,
        high=100_003,
    ),
    Parameter(
        "measured",
        LARGEST,
        "",
        "which backlash of a unit over these positions is reported: the largest, or the mean; used by the contact only",
        "",
        choices=(LARGEST, MEAN),
    ),
    Parameter(
        "involute_stage",
        True,
        "",
        "whether there is an involute stage before the cycloid stage; used by the contact only",
        "",
    ),
    _fraction("share_pins", "the errors of pins and their holes"),
    _fraction("share_discs", "equidistance and shift of the discs"),
    *(parameter for parameter in contact.PARAMETERS if parameter.name in ("discs", "cranks")),
)
_NAMES = {parameter.name for parameter in declared.PARAMETERS}
PARAMETERS = (*declared.PARAMETERS, *(parameter for parameter in _OF_BATCHES if parameter.name not in _NAMES))


def _between_discs(name: str, value: float, unit: str, meaning: str) -> Variable:
    return Variable(
        name,
        unit,
        Kind.HALF_WIDTH,
        0.0,
        10.0,
        f"{meaning}; used by the contact only",
        value,
        valid_low=0.0,
        valid_high=1000.0,
        random=True,
        assumed="no document lists this error",
    )


GEOMETRY = (
    MODEL,
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "discs",
    "cranks",
)
"""Parameters by which reducers are distinguished."""
OF_THE_BENCH = (MODEL, "positions", "measured")
"""Parameters of the measurement, independent of the design of the unit."""

VARIABLES: tuple[Variable, ...] = (
    *declared.VARIABLES,
    _between_discs("circle_offset_um", 3.0, "um", "offset of the pin circle from the axis of the carrier"),
    _between_discs("bore_um", 2.0, "um", "position of the crank bores in a disc, either direction"),
    _between_discs("crank_phase_mrad", 2.0 / 1.3, "mrad", "phase of each journal of a crankshaft"),
)
"""The variables of document B, and errors between discs at the values of `rv_reducer`."""
