"""Standard tolerance grades and fits of ISO 286 up to 500 mm."""

from __future__ import annotations

from .fits import LETTERS, Fit, zone
from .grades import GRADES, LARGEST, UNVERIFIED, grade_um

__all__ = ["GRADES", "LARGEST", "LETTERS", "UNVERIFIED", "Fit", "grade_um", "zone"]
