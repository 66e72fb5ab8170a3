"""Units at the edge: configuration strings in, SI inside (over pint).

A quantity is either a bare number, whose unit its key names (`crank_bearing_um = 2`), or a string
with a unit (`"0.002 mm"`) that is converted to the unit of the key.
"""

from __future__ import annotations

import math
import re
import tokenize
from functools import lru_cache
from typing import Any

ARCMIN = math.radians(1.0 / 60.0)
"""Radians in an arc minute."""
ARCSEC = ARCMIN / 60.0
"""Radians in an arc second."""
MRAD = 1e-3
"""Radians in a milliradian."""
UM = 1e-6
"""Metres in a micrometre."""
MM = 1e-3
"""Metres in a millimetre."""

SUFFIXES = frozenset(
    [
        "um",
        "mm",
        "m",
        "arcmin",
        "arcsec",
        "deg",
        "rad",
        "mrad",
        "percent",
        "K",
        "C",
        "s",
        "rpm",
        "Nm",
        "kg",
        "N",
        "N_per_mm",
        "Nm_per_arcmin",
    ]
)
"""The unit suffixes that names of parameters, variables and outputs end with."""

_PINT_NAMES = {
    "Nm": "newton * meter",
    "C": "degC",
    "": "dimensionless",
    "N_per_mm": "newton / millimeter",
    "Nm_per_arcmin": "newton * meter / arcminute",
}
_QUANTITY = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")


@lru_cache(maxsize=1)
def _registry() -> Any:
    from pint import UnitRegistry

    return UnitRegistry(autoconvert_offset_to_baseunit=True)


def to_unit(text: str, unit: str) -> float:
    """The number in `unit` that `text` ("2 um") states.

    Raises ValueError with the remedy where the text is not a number with a unit that fits.
    """
    from pint.errors import PintError

    wanted = f"a string with a unit of {unit}" if unit else "a plain number"
    match = _QUANTITY.match(text)
    if match is None or bool(match[2]) != bool(unit):
        raise ValueError(f'must be a number or {wanted}, got "{text}"')
    try:
        quantity = _registry().Quantity(float(match[1]), pint_unit(match[2]))
        return float(quantity.to(pint_unit(unit)).magnitude)
    except (PintError, tokenize.TokenError, ValueError, AttributeError, TypeError) as error:
        raise ValueError(f'must be a number or {wanted}, got "{text}"') from error


def split_unit(name: str) -> tuple[str, str]:
    """`crank_bearing_um` as ("crank_bearing", "um"); the unit is empty where the name has none."""
    parts = name.split("_")
    for at in range(1, len(parts)):  # the longest unit first: N_per_mm is not mm
        stem, unit = "_".join(parts[:at]), "_".join(parts[at:])
        if stem and unit in SUFFIXES:
            return stem, unit
    return name, ""


def dimension(unit: str) -> str:
    """The base unit of the physical dimension that `unit` measures, empty for a plain number.

    Raises ValueError where the unit is not known.
    """
    from pint.errors import PintError

    try:
        name = pint_unit("" if unit == "1" else unit)
        text = str(_registry().Quantity(1.0, name).to_base_units().units)
    except (PintError, tokenize.TokenError, ValueError, AttributeError, TypeError) as error:
        raise ValueError(f'"{unit}" is not a unit; write "mm", "N m", "rad", "rpm", ...') from error
    return "" if text == "dimensionless" else text


def unit_key(unit: str) -> str:
    """A unit as names of parameters end with it: `arcsec_per_Nm` of "arcsec/Nm"."""
    words = re.sub(r"\s+", "_", unit.strip())
    words = re.sub(r"^1/", "per_", words).replace("/", "_per_")
    return re.sub(r"\W+", "", words)


def converted(values: Any, unit: str, to: str) -> Any:
    """Numbers or an array of them in `unit`, in the unit `to`.

    Raises ValueError where the units are not of one kind.
    """
    if unit == to:
        return values
    scale, zero = _affine(unit, to)
    return values * scale + zero if zero else values * scale


@lru_cache(maxsize=256)
def _affine(unit: str, to: str) -> tuple[float, float]:
    """How many of `to` one `unit` is, and where its zero lies."""
    from pint.errors import PintError

    try:
        zero, one = (
            float(_registry().Quantity(at, pint_unit(unit)).to(pint_unit(to)).magnitude)
            for at in (0.0, 1.0)
        )
    except (PintError, tokenize.TokenError, ValueError, AttributeError, TypeError) as error:
        raise ValueError(f'"{unit}" is not a unit that can be stated in {to}') from error
    return one - zero, zero


def pint_unit(unit: str) -> str:
    """A unit as pint reads it: there "Nm" is a nanometre and "C" a coulomb."""
    if unit in _PINT_NAMES:
        return _PINT_NAMES[unit]
    return re.sub(r"\bNm\b", "(newton * meter)", unit)


def family(unit: str) -> tuple[str, float]:
    """The base unit that `unit` measures ("meter", "radian", empty for a plain number), and how
    many of it one is.

    Raises ValueError where the unit is not known, or its zero is not that of the base unit.
    """
    from pint.errors import PintError

    if unit in ("", "1"):
        return "", 1.0
    try:
        quantity = _registry().Quantity(1.0, _PINT_NAMES.get(unit, unit))
        zero = _registry().Quantity(0.0, _PINT_NAMES.get(unit, unit)).to_base_units().magnitude
    except (PintError, tokenize.TokenError, ValueError, AttributeError, TypeError) as error:
        raise ValueError(f'"{unit}" is not a unit; write "mm", "um", "rad", "deg", ...') from error
    if zero != 0.0:
        raise ValueError(f'"{unit}" has a zero of its own; take an absolute unit')
    base = quantity.to_base_units()
    name = str(base.units)
    return "" if name == "dimensionless" else name, float(base.magnitude)
