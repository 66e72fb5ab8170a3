"""The unit that a number was probably meant in, where it is out of range in its stated unit."""

from __future__ import annotations

import math
from functools import lru_cache

from .units import converted, fits

COMMON = (
    *("um", "mm", "in", "m"),
    *("arcsec", "arcmin", "mrad", "deg", "rad"),
    *("N mm", "N m", "N", "kN"),
    *("N mm/arcmin", "N m/arcmin", "N m/rad", "N/um", "N/mm", "N/m"),
    *("rpm", "deg/s", "rad/s"),
)
"""Units that drawings, catalogues and measuring machines state, the small ones first."""


def likely_unit(value: float, unit: str, low: float, high: float) -> str:
    """The common unit in which `value` would lie from `low` to `high`, both in `unit`.

    Empty where there is none, where `value` lies there already, and where an end is infinite. Of
    several units that fit, the unit that comes nearest to the middle of the range of ratios.
    """
    if not unit or value != value or low <= value <= high or not (math.isfinite(low) and math.isfinite(high)):
        return ""
    middle = math.sqrt(low * high) if low > 0.0 else 0.1 * high
    near = [
        (abs(math.log(value * scale / middle)), name)
        for name, scale in _scales(unit).items()
        if scale != 1.0 and low <= value * scale <= high and value * scale > 0.0
    ]
    return min(near)[1] if near else ""


@lru_cache(maxsize=64)
def _scales(unit: str) -> dict[str, float]:
    """How many of `unit` the common units are that can be stated in it."""
    try:
        return {name: float(converted(1.0, name, unit)) for name in COMMON if fits(name, unit)}
    except ValueError:
        return {}


def unit_hint(value: float, unit: str, low: float, high: float) -> str:
    """` (was m meant? "0.064 m" is 64 mm)`, empty where no common unit fits."""
    likely = likely_unit(value, unit, low, high)
    if not likely:
        return ""
    value_in_unit = converted(value, likely, unit)
    return f' (was {likely} meant? "{value:g} {likely}" is {value_in_unit:.6g} {unit})'
