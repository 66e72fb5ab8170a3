"""Units at the edge: configuration strings in, SI inside.

A quantity is either a bare number, whose unit its key names (`crank_bearing_um = 2`), or a string
with a unit (`"0.002 mm"`) that is converted to the unit of the key. An angle is a quantity of its
own: 1/s is a frequency, rad/s is none. A rotational speed alone may be stated in 1/min, 1/s or Hz,
which then count its turns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

# Common units of mechanical engineering, as pint defines them: these names need no registry.
#
# The registry of pint takes half a second to import and build. Any other name is looked up there; a
# test compares every number here with it.


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


# The grammar of units: names, products, quotients and small powers; nothing is evaluated.
#
#     unit    = product { "/" divisor }
#     product = "1" | power { ("*" | "·" | a space) power }
#     divisor = power
#     power   = (name | "(" unit ")") [ ["^" | "**"] exponent ]
#
# An exponent is a whole number of one digit, with or without a sign, or a superscript. What is
# divided by several units needs brackets, as "J/kg K" is ambiguous.


LONGEST_UNIT = 200
"""Largest number of characters of a unit, which also bounds the nesting."""
EXPONENT = 9
"""Largest exponent."""
_LETTER = "A-Za-zµμ"
_TOKEN = re.compile(
    rf"""(?P<space>\s*)(?:
    (?P<name>°[CF]|[{_LETTER}][{_LETTER}_]*|[%‰°'"′″])
    |(?P<power>\*\*|\^)
    |(?P<times>[*·⋅])
    |(?P<over>/)
    |(?P<open>\()
    |(?P<close>\))
    |(?P<number>[+-]?[0-9]+)
    |(?P<raised>⁻?[¹²³⁴⁵⁶⁷⁸⁹])
    )""",
    re.VERBOSE,
)
_SUPERSCRIPTS = str.maketrans("⁻¹²³⁴⁵⁶⁷⁸⁹", "-123456789")

Factors = tuple[tuple[str, int], ...]
"""Names with their exponents, in the order in which they are written."""


class UnitError(ValueError):
    """A text that is not a unit; the message states why."""


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    apart: bool
    """Whether a space stands before it."""


_END = _Token("end", "", False)


def factors(text: str) -> Factors:
    """The names in a unit with their exponents: (("arcsec", 1), ("rpm", -2)) of "arcsec/rpm^2".

    Raises UnitError where the text does not follow the grammar.
    """
    if len(text) > LONGEST_UNIT:
        raise UnitError(f"no unit has more than {LONGEST_UNIT} characters")
    reader = _Reader(_tokens(text.strip()))
    parsed = reader.unit()
    if reader.next is not _END:
        raise UnitError(f'"{reader.next.text}" is not expected there')
    return parsed


def _tokens(text: str) -> list[_Token]:
    tokens, at = [], 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            sign = text[at:].lstrip()[:1]
            comma = ": decimals follow a point" if sign == "," else ""
            raise UnitError(f'"{sign}" has no place in a unit{comma}')
        kind = str(match.lastgroup)
        tokens.append(_Token(kind, match[kind], bool(match["space"])))
        at = match.end()
    return tokens


class _Reader:
    """Reads tokens from left to right, one rule of the grammar per method."""

    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._at = 0

    @property
    def next(self) -> _Token:
        return self._tokens[self._at] if self._at < len(self._tokens) else _END

    def _take(self) -> _Token:
        token = self.next
        self._at += 1
        return token

    def unit(self) -> Factors:
        parsed = self._product()
        while self.next.kind == "over":
            self._take()
            parsed += tuple((name, -exponent) for name, exponent in self._power())
            if self.next.kind in ("times", "name", "open"):
                raise UnitError('what follows a divisor is ambiguous: write "a/(b c)"')
        return parsed

    def _product(self) -> Factors:
        if self.next.kind == "number" and self.next.text == "1":
            self._take()
            if self.next.kind not in ("over", "close", "end"):
                raise UnitError('"1" stands only before "/"')
            return ()
        parsed = self._power()
        while self.next.kind in ("times", "name", "open"):
            if self.next.kind == "times":
                self._take()
            elif not self.next.apart:
                raise UnitError(f'a space, "*" or "/" is missing before "{self.next.text}"')
            parsed += self._power()
        return parsed

    def _power(self) -> Factors:
        base = self._base()
        if self.next.kind == "power":
            self._take()
            return _raise_to_power(base, self._exponent())
        if self.next.kind in ("number", "raised") and not self.next.apart:
            return _raise_to_power(base, self._exponent())
        return base

    def _base(self) -> Factors:
        token = self._take()
        if token.kind == "name":
            return ((token.text, 1),)
        if token.kind != "open":
            shown = f'"{token.text}" stands' if token.text else "nothing stands"
            raise UnitError(f"{shown} where a unit is expected")
        inner = self.unit()
        if self._take().kind != "close":
            raise UnitError('")" is missing')
        return inner

    def _exponent(self) -> int:
        token = self._take()
        digits = token.text.translate(_SUPERSCRIPTS)
        if token.kind not in ("number", "raised") or len(digits.lstrip("+-")) > 1:
            raise UnitError(f"an exponent is a whole number from -{EXPONENT} to {EXPONENT}")
        if int(digits) == 0:
            raise UnitError("an exponent of 0 leaves no unit")
        return int(digits)


def _raise_to_power(base: Factors, exponent: int) -> Factors:
    raised = tuple((name, power * exponent) for name, power in base)
    if any(abs(power) > EXPONENT for _, power in raised):
        raise UnitError(f"no exponent is beyond {EXPONENT}")
    return raised


# The value in SI of a unit by its name, by the definitions of pint and a few additional ones.


ANGLE, TIME = "radian", "second"
_BASES = frozenset(["meter", "gram", TIME, "ampere", "kelvin", "mole", "candela", ANGLE])
"""What units are made of; an angle is a quantity of its own here."""
_SI = {"gram": "kilogram"}
_PLAIN = frozenset(["%", "‰", "percent", "permille", "ppm"])
"""Names of plain numbers; other plain numbers (pi, decades) are not units here."""
_FRACTIONS = ("yocto", "zepto", "atto", "femto", "pico", "nano", "micro", "milli")
_MULTIPLES = ("kilo", "mega", "giga", "tera", "peta", "exa", "zetta", "yotta")
_PREFIXES: Mapping[str, int] = {
    **dict(zip(_FRACTIONS, range(-24, 0, 3), strict=True)),
    **{"centi": -2, "deci": -1, "deca": 1, "deka": 1, "hecto": 2},
    **dict(zip(_MULTIPLES, range(3, 25, 3), strict=True)),
    **{"da": 1, "c": -2, "d": -1, "h": 2, "µ": -6},
    **dict(zip("afpnum", range(-18, 0, 3), strict=True)),
    **dict(zip("kMGTPE", range(3, 19, 3), strict=True)),
}
"""Powers of ten; those of more letters first."""
_OURS: Mapping[str, str] = {
    "C": "degC",
    "°C": "degC",
    "°F": "degF",
    "°": "degree",
    "'": "arcmin",
    "′": "arcmin",
    '"': "arcsec",
    "″": "arcsec",
    "‰": "permille",
    "MM": "mm",  # as measuring machines write it; a molar is no unit of theirs
    "µM": "um",
    "UM": "um",
    "INCH": "inch",
    "DEG": "degree",
    "mil": "thou",
    "mils": "thou",
    "rev": "turn",
    "r": "turn",
    "kgfm": "kgf m",
    "kgfcm": "kgf cm",
    "kgfmm": "kgf mm",
    "lbfin": "lbf in",
    "lbfft": "lbf ft",
    "ozfin": "ozf in",
}
"""Names that pint has not, or has for something else: a mil is an angle there, C a coulomb."""
_NEWTONS = ("n", "u", "µ", "m", "c", "d", "da", "", "h", "k", "M", "G")
_METRES = ("mm", "cm", "dm", "m")
_TORQUES: Mapping[str, str] = {f"{p}N{m}": f"{p}N {m}" for p in _NEWTONS for m in _METRES}
"""Torques in one word: kNm, Nmm. (Of pint's, "Nm" is a number times a length.)"""
MAX_UNIT_FACTOR = 1e150
"""SI units in a unit, or units in an SI unit, at most: a quotient of two is a number as well."""
_PLURALS = 3
"""Letters that a name has at least where an "s" may follow it: "mils", but not "mms"."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its factor to the SI unit, the powers of its base units, and where its zero lies in
    the SI unit (only of a temperature).
    """

    factor: Fraction
    dimensions: tuple[tuple[str, int], ...]
    zero: Fraction = Fraction(0)

    def power(self, base: str) -> int:
        """The exponent of `base`, 0 where it has none."""
        return dict(self.dimensions).get(base, 0)

    def without(self, base: str) -> tuple[tuple[str, int], ...]:
        """The powers of everything but `base`."""
        return tuple((name, power) for name, power in self.dimensions if name != base)


NUMBER = Unit(Fraction(1), ())
"""A plain number."""


@lru_cache(maxsize=1024)
def unit_of(text: str) -> Unit:
    """The unit that a text names; "" and "1" are a plain number.

    Raises UnitError, which says why, where it names none.
    """
    parts = _expand_factors(text)
    if len(parts) == 1 and parts[0][1] == 1:
        return _unit_named(parts[0][0])
    above = [name for name, power in parts if power > 0]
    if len(above) > 1 and not _PLAIN.isdisjoint(above):
        raise UnitError("a percentage of a unit is not a unit")
    product = NUMBER
    for name, power in parts:
        product = _multiply_units(product, _unit_named(name), power)
    if not 1.0 / MAX_UNIT_FACTOR < product.factor < MAX_UNIT_FACTOR:
        raise UnitError(f'"{text}" is beyond all that is measured')
    return product


def _expand_factors(text: str) -> Factors:
    """The factors of a text, none of a plain number, with abbreviations spelt out."""
    written_out: Factors = ()
    for name, power in factors(text) if text.strip() else ():
        longhand = _longhand(name)
        inner = ((name, 1),) if longhand == name else _expand_factors(longhand)
        written_out += tuple((part, exponent * power) for part, exponent in inner)
    return written_out


def _longhand(name: str) -> str:
    """What a name stands for: "kN m" for "kNm", "N/mm" for "N_per_mm", as names of keys end."""
    name = name.replace("μ", "µ")
    above, per, below = name.rpartition("_per_")
    if per and name not in RATES:
        return f"{above}/{below}"
    return _TORQUES.get(name) or _OURS.get(name, name)


def _multiply_units(unit: Unit, factor: Unit, power: int) -> Unit:
    """The product with a power of another unit; a temperature counts as a difference."""
    powers = dict(unit.dimensions)
    for base, exponent in factor.dimensions:
        powers[base] = powers.get(base, 0) + exponent * power
    dimensions = tuple(sorted((base, total) for base, total in powers.items() if total))
    return Unit(unit.factor * factor.factor**power, dimensions)


@lru_cache(maxsize=1)
def _registry() -> Any:
    from pint import UnitRegistry

    exact: Any = Fraction  # pint takes any kind of number, and declares float
    return UnitRegistry(non_int_type=exact)


@lru_cache(maxsize=1)
def _names() -> frozenset[str]:
    """Every name that pint defines a unit by, without prefixes."""
    return frozenset(_registry())


@lru_cache(maxsize=1024)
def _unit_named(name: str) -> Unit:
    """The unit of a single name, with or without a prefix or a plural's s."""
    if name in COMMON:
        return Unit(*COMMON[name], ZEROS.get(name, Fraction(0)))
    return look_up_unit(name)


def look_up_unit(name: str) -> Unit:
    """The unit of a single name by the definitions of pint."""
    prefix, stem = _split_prefix(name)
    unit = _defined_unit(stem)
    if prefix and unit.zero:
        raise UnitError(f'"{name}" is not a unit: what has a zero of its own takes no prefix')
    return Unit(unit.factor * Fraction(10) ** _PREFIXES.get(prefix, 0), unit.dimensions, unit.zero)


def _split_prefix(name: str) -> tuple[str, str]:
    """Prefix and defined name."""
    for whole in (name, name[:-1] if name.endswith("s") and len(name) > _PLURALS else name):
        if whole in _names():
            return "", whole
        for prefix in _PREFIXES:
            if whole.startswith(prefix) and whole.removeprefix(prefix) in _names():
                return prefix, whole.removeprefix(prefix)
    raise UnitError(f'"{name}" is not a unit')


def _defined_unit(name: str) -> Unit:
    """A unit of pint's, without a prefix."""
    from pint.util import to_units_container

    registry = _registry()
    canonical = registry.get_name(name)
    single = registry.UnitsContainer({canonical: Fraction(1)})
    factor, root = registry.get_root_units(single, check_nonmult=False)
    container: Any = to_units_container(root)
    powers = {str(base): Fraction(power) for base, power in container.items()}
    whole = all(power.denominator == 1 for power in powers.values())
    if not set(powers) <= _BASES or not whole or not (powers or name in _PLAIN):
        raise UnitError(f'"{name}" is not a unit that is known here')
    size: Fraction = factor / Fraction(1000) ** int(powers.get("gram", 0))
    dimensions = sorted((_SI.get(base, base), int(power)) for base, power in powers.items())
    return Unit(Fraction(size), tuple(dimensions), _zero(canonical, root))


def _zero(name: str, root: Any) -> Fraction:
    """Where the zero of a unit lies in its SI unit `root`."""
    return Fraction(_registry().Quantity(Fraction(0), name).to(root).magnitude)


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

MAX_QUANTITY_CHARACTERS = 300
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
    message = f'must be a number or {wanted}, got "{shorten_text(text)}"'
    match = _QUANTITY.fullmatch(text.strip()) if len(text) <= MAX_QUANTITY_CHARACTERS else None
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


def shorten_text(text: str) -> str:
    """A text as messages repeat it."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def split_unit(name: str) -> tuple[str, str]:
    """`crank_bearing_um` as ("crank_bearing", "um"); the unit is empty where the name has none."""
    parts = name.split("_")
    for at in range(1, len(parts)):  # the longest unit first: N_per_mm is not mm
        stem, unit = "_".join(parts[:at]), "_".join(parts[at:])
        if stem and all(part in SUFFIXES for part in unit.split("_per_")):
            return stem, unit
    return name, ""


def dimension(unit: str) -> str:
    """What `unit` measures, as powers of SI units and of the radian; empty for a plain number.

    Raises ValueError where the unit is not known.
    """
    try:
        parsed = unit_of(unit)
    except UnitError as error:
        text = f'"{shorten_text(unit)}" is not a unit; write "mm", "N m", "rad", "rpm", ...'
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
        message = f'"{shorten_text(unit)}" is not a unit that can be stated in {shorten_text(to)}'
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
    parts = [unit_of(name) for name, _ in _expand_factors(unit)]
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
NO_ZONE = "\N{EN DASH}"
"""What stands for the zone of a feature that has none: it starts no formula of a spreadsheet, as a hyphen would."""


def drawing_number(value: float) -> str:
    """A number as a drawing has it, on pages, in tables and on the terminal: 36.05 and 112.0435,
    not 36.050000000000004 and 112.
    """
    return f"{float(f'{value:.{DRAWN_DIGITS}g}'):.{DRAWN_DIGITS}g}"


def plain_number(value: float, digits: int = 4) -> str:
    """A number in a sentence: 0.427, 12.35 and 12346, never 1.235e+04."""
    return f"{value:.0f}" if abs(value) >= 10.0**digits else f"{value:.{digits}g}"


# The unit that a number was probably meant in, where it is out of range in its stated unit.


COMMON_CONFUSIONS = (
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
        return {name: float(converted(1.0, name, unit)) for name in COMMON_CONFUSIONS if fits(name, unit)}
    except ValueError:
        return {}


def unit_hint(value: float, unit: str, low: float, high: float) -> str:
    """` (was m meant? "0.064 m" is 64 mm)`, empty where no common unit fits."""
    likely = likely_unit(value, unit, low, high)
    if not likely:
        return ""
    value_in_unit = converted(value, likely, unit)
    return f' (was {likely} meant? "{value:g} {likely}" is {value_in_unit:.6g} {unit})'
