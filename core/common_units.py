"""Common units of mechanical engineering, as pint defines them: these names need no registry.

The registry of pint takes half a second to import and build. Any other name is looked up there; a
test compares every number here with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

PI = Fraction("3.1415926535897932384626433832795028841971693993751")
"""Pi to the 50 digits that pint has."""
_INCH, _POUND, _GRAVITY = Fraction("0.0254"), Fraction("0.45359237"), Fraction("9.80665")
Powers = tuple[tuple[str, int], ...]

_LENGTH: Powers = (("meter", 1),)
_ANGLE: Powers = (("radian", 1),)
_TIME: Powers = (("second", 1),)
_MASS: Powers = (("kilogram", 1),)
_TEMPERATURE: Powers = (("kelvin", 1),)
_FREQUENCY: Powers = (("second", -1),)
_SPEED: Powers = (("radian", 1), ("second", -1))
_FORCE: Powers = (("kilogram", 1), ("meter", 1), ("second", -2))
_PRESSURE: Powers = (("kilogram", 1), ("meter", -1), ("second", -2))
_ENERGY: Powers = (("kilogram", 1), ("meter", 2), ("second", -2))
_POWER: Powers = (("kilogram", 1), ("meter", 2), ("second", -3))

_SIZES: Mapping[Powers, Mapping[str, Fraction | int | str]] = {
    (): {"%": "0.01", "percent": "0.01", "ppm": "1e-6"},
    _LENGTH: {
        "nm": "1e-9",
        "um": "1e-6",
        "µm": "1e-6",
        "mm": "1e-3",
        "cm": "0.01",
        "dm": "0.1",
        "m": 1,
        "km": 1000,
        "in": _INCH,
        "inch": _INCH,
        "ft": 12 * _INCH,
    },
    _ANGLE: {
        "rad": 1,
        "mrad": "1e-3",
        "urad": "1e-6",
        "µrad": "1e-6",
        "deg": PI / 180,
        "degree": PI / 180,
        "arcmin": PI / 10800,
        "arcsec": PI / 648000,
        "turn": 2 * PI,
    },
    _TIME: {"ms": "1e-3", "s": 1, "min": 60, "h": 3600},
    _MASS: {"g": "1e-3", "kg": 1, "lb": _POUND},
    _TEMPERATURE: {"K": 1, "mK": "1e-3", "degC": 1},
    _FREQUENCY: {"Hz": 1, "kHz": 1000},
    _SPEED: {"rpm": PI / 30, "rps": 2 * PI},
    _FORCE: {"mN": "1e-3", "N": 1, "kN": 1000, "kgf": _GRAVITY, "lbf": _POUND * _GRAVITY},
    _PRESSURE: {"Pa": 1, "kPa": 1000, "MPa": 1_000_000, "GPa": 1_000_000_000, "bar": 100_000},
    _ENERGY: {"J": 1},
    _POWER: {"W": 1, "kW": 1000},
}

COMMON: Mapping[str, tuple[Fraction, Powers]] = {
    name: (Fraction(size), powers) for powers, sizes in _SIZES.items() for name, size in sizes.items()
}
"""SI units in a unit, and the powers of what it is made of, by name."""
ZEROS: Mapping[str, Fraction] = {"degC": Fraction("273.15")}
"""Where the zero of a unit lies in its SI unit, 0 for all others."""
RATES = frozenset(
    {"beats_per_minute", "counts_per_second", "revolutions_per_minute", "revolutions_per_second"}
    | {"foot_per_second", "kilometer_per_hour", "kilometer_per_second", "meter_per_second", "mile_per_hour"}
    | {"meter_per_second_squared", "standard_liter_per_minute", "kip_per_square_inch", "pound_force_per_square_inch"}
    | {"bits_per_pixel", "dots_per_inch", "pixels_per_centimeter", "pixels_per_inch"}
)
"""Names of units of pint that contain "_per_" (beats_per_minute since pint 0.26)."""
