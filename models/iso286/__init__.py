"""Standards of drawings: limits and fits (ISO 286), general tolerances (2768), symbols (1101)."""

from .fits import Fit, pair_of_text, zone
from .general import angle_rad, geometrical_mm, linear_mm
from .grades import GRADES, UNVERIFIED, grade_um
from .symbols import SYMBOLS
from .tables import LARGEST

__all__ = [
    "GRADES",
    "LARGEST",
    "SYMBOLS",
    "UNVERIFIED",
    "Fit",
    "angle_rad",
    "geometrical_mm",
    "grade_um",
    "linear_mm",
    "pair_of_text",
    "zone",
]
