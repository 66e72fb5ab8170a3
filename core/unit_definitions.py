"""The value in SI of a unit by its name, by the definitions of pint and a few additional ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from .common_units import COMMON, RATES, ZEROS
from .unit_grammar import Factors, UnitError, factors

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
LARGEST = 1e150
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
    parts = _written_out(text)
    if len(parts) == 1 and parts[0][1] == 1:
        return _unit_named(parts[0][0])
    above = [name for name, power in parts if power > 0]
    if len(above) > 1 and not _PLAIN.isdisjoint(above):
        raise UnitError("a percentage of a unit is not a unit")
    product = NUMBER
    for name, power in parts:
        product = _times(product, _unit_named(name), power)
    if not 1.0 / LARGEST < product.factor < LARGEST:
        raise UnitError(f'"{text}" is beyond all that is measured')
    return product


def _written_out(text: str) -> Factors:
    """The factors of a text, none of a plain number, with abbreviations spelt out."""
    written_out: Factors = ()
    for name, power in factors(text) if text.strip() else ():
        longhand = _longhand(name)
        inner = ((name, 1),) if longhand == name else _written_out(longhand)
        written_out += tuple((part, exponent * power) for part, exponent in inner)
    return written_out


def names_in(text: str) -> tuple[str, ...]:
    """The names that a unit is made of, abbreviations written out."""
    return tuple(name for name, _ in _written_out(text))


def _longhand(name: str) -> str:
    """What a name stands for: "kN m" for "kNm", "N/mm" for "N_per_mm", as names of keys end."""
    name = name.replace("μ", "µ")
    above, per, below = name.rpartition("_per_")
    if per and name not in RATES:
        return f"{above}/{below}"
    return _TORQUES.get(name) or _OURS.get(name, name)


def _times(unit: Unit, factor: Unit, power: int) -> Unit:
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
    return looked_up(name)


def looked_up(name: str) -> Unit:
    """The unit of a single name by the definitions of pint."""
    prefix, stem = _split(name)
    unit = _defined(stem)
    if prefix and unit.zero:
        raise UnitError(f'"{name}" is not a unit: what has a zero of its own takes no prefix')
    return Unit(unit.factor * Fraction(10) ** _PREFIXES.get(prefix, 0), unit.dimensions, unit.zero)


def _split(name: str) -> tuple[str, str]:
    """Prefix and defined name."""
    for whole in (name, name[:-1] if name.endswith("s") and len(name) > _PLURALS else name):
        if whole in _names():
            return "", whole
        for prefix in _PREFIXES:
            if whole.startswith(prefix) and whole.removeprefix(prefix) in _names():
                return prefix, whole.removeprefix(prefix)
    raise UnitError(f'"{name}" is not a unit')


def _defined(name: str) -> Unit:
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
