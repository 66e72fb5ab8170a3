"""Standards of drawings: limits and fits (ISO 286), general tolerances (2768), symbols (1101)."""

from .deviations import HOLES, LETTERS, SHAFTS, deviations_um
from .fits import Fit, pair_of_text, zone
from .general import angle_rad, geometrical_mm, linear_mm
from .grades import GRADES, UNVERIFIED, grade_um
from .symbols import SYMBOLS
from .tables import LARGEST

__all__ = [
    "GRADES",
    "HOLES",
    "LARGEST",
    "LETTERS",
    "SHAFTS",
    "SYMBOLS",
    "UNVERIFIED",
    "Fit",
    "angle_rad",
    "deviations_um",
    "geometrical_mm",
    "grade_um",
    "linear_mm",
    "pair_of_text",
    "zone",
]
