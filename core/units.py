"""Units at the edge: configuration strings in, SI inside.

A quantity is either a bare number, whose unit its key names (`crank_bearing_um = 2`), or a string
with a unit (`"0.002 mm"`) that is converted to the unit of the key. An angle is a quantity of its
own: 1/s is a frequency, rad/s is none. A rotational speed alone may be stated in 1/min, 1/s or Hz,
which then count its turns.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import lru_cache
from typing import Any

from .unit_definitions import ANGLE, TIME, Unit, names_in, unit_of
from .unit_grammar import UnitError

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
    {"um", "mm", "m", "arcmin", "arcsec", "deg", "rad", "mrad", "percent"}
    | {"K", "C", "s", "rpm", "Hz", "kg", "N", "Nm", "N_per_mm", "Nm_per_arcmin"}
)
"""The unit suffixes that names of parameters, variables and outputs end with."""

LONGEST = 300
"""Largest number of characters of a quantity."""
SHOWN = 60
"""Characters of a text that a message repeats."""
_QUANTITY = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*)")


def to_unit(text: str, unit: str, scale_only: bool = False) -> float:
    """The number in `unit` that `text` ("2 um") states.

    With `scale_only` it is a difference or a rate: degC does not state a difference of temperature
    in K, nor 1/s a drift in deg/s. Raises ValueError with the remedy where the text is not a number
    with a unit that fits.
    """
    wanted = f"a string with a unit of {unit}" if unit else "a plain number"
    message = f'must be a number or {wanted}, got "{shortened(text)}"'
    match = _QUANTITY.fullmatch(text.strip()) if len(text) <= LONGEST else None
    if match is None or bool(match[2]) != bool(unit):
        raise ValueError(message)
    try:
        scale, zero = _scale(match[2], unit, scale_only)
    except UnitError as error:
        raise ValueError(f"{message}: {error}" if str(error) else message) from error
    number = float(match[1])
    if not math.isfinite(number):
        return number
    try:
        return float(Fraction(number) * scale + zero)
    except OverflowError:
        return math.copysign(math.inf, number)


def shortened(text: str) -> str:
    """A text as messages repeat it."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def split_unit(name: str) -> tuple[str, str]:
    """`crank_bearing_um` as ("crank_bearing", "um"); the unit is empty where the name has none."""
    parts = name.split("_")
    for at in range(1, len(parts)):  # the longest unit first: N_per_mm is not mm
        stem, unit = "_".join(parts[:at]), "_".join(parts[at:])
        if stem and unit in SUFFIXES:
            return stem, unit
    return name, ""


def dimension(unit: str) -> str:
    """What `unit` measures, as powers of SI units and of the radian; empty for a plain number.

    Raises ValueError where the unit is not known.
    """
    try:
        parsed = unit_of(unit)
    except UnitError as error:
        text = f'"{shortened(unit)}" is not a unit; write "mm", "N m", "rad", "rpm", ...'
        raise ValueError(f"{text} ({error})") from error
    return _in_si(parsed) if parsed.dimensions else ""


def fits(unit: str, to: str) -> bool:
    """Whether a quantity in `unit` can be stated in `to`.

    Raises ValueError where one of them is not known.
    """
    for text in (unit, to):
        dimension(text)
    try:
        _scale(unit, to)
    except UnitError:
        return False
    return True


@lru_cache(maxsize=256)
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


def family(unit: str) -> tuple[str, float]:
    """What `unit` measures ("meter", "radian", empty for a plain number; see `dimension`), and how
    many of the SI unit it is.

    Raises ValueError where the unit is not known, or its zero is not that of the SI unit.
    """
    name = dimension(unit)
    parsed = unit_of(unit)
    if parsed.zero:
        raise ValueError(f'"{unit}" has a zero of its own; take an absolute unit')
    return name, float(parsed.factor)


@lru_cache(maxsize=256)
def _affine(unit: str, to: str) -> tuple[float, float]:
    """The factor from `unit` to `to`, and where the zero of `unit` lies."""
    try:
        scale, zero = _scale(unit, to)
    except UnitError as error:
        message = f'"{shortened(unit)}" is not a unit that can be stated in {shortened(to)}'
        raise ValueError(f"{message}: {error}" if str(error) else message) from error
    return float(scale), float(zero)


def _scale(unit: str, to: str, scale_only: bool = False) -> tuple[Fraction, Fraction]:
    """The same, exactly. Raises UnitError where it cannot be."""
    source, target = unit_of(unit), unit_of(to)
    factor = source.factor
    if source.dimensions != target.dimensions:
        if scale_only or source.dimensions != _PER_TIME or not _is_speed(to):
            raise UnitError(_misfit(unit, source, to, target))
        factor *= unit_of("turn").factor
    if scale_only and source.zero != target.zero:
        raise UnitError(f'it is a difference, "{unit}" a temperature: write K')
    return factor / target.factor, (source.zero - target.zero) / target.factor


_PER_TIME = ((TIME, -1),)
_ANGULAR_SPEED = ((ANGLE, 1), (TIME, -1))


def _is_speed(unit: str) -> bool:
    """Whether it is that of a rotational speed: rpm, or turns, radians or degrees per time."""
    parts = [unit_of(name) for name in names_in(unit)]
    turning = {unit_of(name).factor for name in ("rpm", "rps", "turn", "rad", "deg")}
    return unit_of(unit).dimensions == _ANGULAR_SPEED and all(
        part.factor in turning for part in parts if part.power(ANGLE)
    )


def _misfit(unit: str, source: Unit, to: str, target: Unit) -> str:
    """Why a quantity in `unit` cannot be stated in `to`, where that is not plain."""
    if source.without(ANGLE) == target.without(ANGLE) and source.power(ANGLE) != target.power(ANGLE):
        if target.dimensions == _PER_TIME:
            return f'"{unit}" is an angular speed, and {to} a frequency: write Hz or 1/s'
        if not source.power(ANGLE):
            return f'"{unit}" does not say of what angle: write it with one, as {to} has'
    if not set("'\"′″").isdisjoint(unit):
        return "' and \" are arc minutes and seconds: write ft and in for feet and inches"
    return ""


def _in_si(unit: Unit) -> str:
    powers = (base if power == 1 else f"{base}^{power}" for base, power in unit.dimensions)
    return " ".join(powers) or "a plain number"


DRAWN_DIGITS = 10
"""Digits of a number on a drawing at most: the last ones of a sum are left out."""


def drawing_number(value: float) -> str:
    """A number as a drawing has it, on pages, in tables and on the terminal: 36.05 and 112.0435,
    not 36.050000000000004 and 112.
    """
    return f"{float(f'{value:.{DRAWN_DIGITS}g}'):.{DRAWN_DIGITS}g}"


def plain_number(value: float, digits: int = 4) -> str:
    """A number in a sentence: 0.427, 12.35 and 12346, never 1.235e+04."""
    return f"{value:.0f}" if abs(value) >= 10.0**digits else f"{value:.{digits}g}"
