"""The grammar of units: names, products, quotients and small powers; nothing is evaluated.

    unit    = product { "/" divisor }
    product = "1" | power { ("*" | "·" | a space) power }
    divisor = power
    power   = (name | "(" unit ")") [ ["^" | "**"] exponent ]

An exponent is a whole number of one digit, with or without a sign, or a superscript. What is
divided by several units needs brackets, as "J/kg K" is ambiguous.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

LONGEST = 200
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
    if len(text) > LONGEST:
        raise UnitError(f"no unit has more than {LONGEST} characters")
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
            return _raised(base, self._exponent())
        if self.next.kind in ("number", "raised") and not self.next.apart:
            return _raised(base, self._exponent())
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


def _raised(base: Factors, exponent: int) -> Factors:
    raised = tuple((name, power * exponent) for name, power in base)
    if any(abs(power) > EXPONENT for _, power in raised):
        raise UnitError(f"no exponent is beyond {EXPONENT}")
    return raised
