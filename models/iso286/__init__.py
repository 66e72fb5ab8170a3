"""Standards of drawings: limits and fits (ISO 286), general tolerances (2768), symbols (1101)."""

from .fits import GRADES, MAX_SIZE_MM, UNVERIFIED, Fit, grade_um, pair_of_text, zone
from .general import SYMBOLS, angle_rad, characteristic_of, geometrical_mm, linear_mm

__all__ = [
    "GRADES",
    "MAX_SIZE_MM",
    "SYMBOLS",
    "UNVERIFIED",
    "Fit",
    "angle_rad",
    "characteristic_of",
    "geometrical_mm",
    "grade_um",
    "linear_mm",
    "pair_of_text",
    "zone",
]
