"""Units in column names ("Spiel [arcmin]") and in rows of units."""

from __future__ import annotations

import re
from functools import lru_cache

from ..units import dimension

_SPELLINGS = {
    "rpm": "U/min",
    "degC": "℃",
    "degF": "℉",
    "deg": "度 °",
    "arcmin": "Bogenminuten Winkelminuten Bogenmin ′ ' 角分 分",
    "arcsec": "Bogensekunden Winkelsekunden Bogensek ″ '' \" 角秒",
    "mm": "毫米 ㎜ ミリ",
    "um": "微米 μm µm ㎛ mym",
    "N m": "Nm N·m N*m 牛米",
    "s": "秒 sec sek Sek",
    "min": "minute",
    "h": "Std",
}
"""What measuring rooms write, by the name of the unit in the units module."""
ALIASES = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
UNKNOWN = frozenset(["grad", "Grad", "GRAD", "min.", "分", "B", "d", "a", "l", "r", "h."])
"""Words that are ambiguous: no unit is read from them."""
_BRACKETS = re.compile(r"(?P<name>.*?)\s*[\[(（［【〔](?P<unit>[^\[\]()（）［］【】]+)[\])）］】〕]\s*")
_SLASH = re.compile(r"(?P<name>.*\S)\s+(?:/|in)\s*(?P<unit>\S+)")


@lru_cache(maxsize=4096)
def known_unit(text: str) -> str | None:
    """The unit that a text states, None where it is none."""
    text = text.strip()
    text = ALIASES.get(text, text)
    if not text or text in UNKNOWN or (text.isdecimal() and text != "1"):
        return None
    try:
        dimension(text)
    except ValueError:
        return None
    return text


def split_header(header: str) -> tuple[str, str]:
    """A column name without its unit, and the unit; empty where the name states none."""
    for pattern in (_BRACKETS, _SLASH):
        match = pattern.fullmatch(header)
        if match and match["name"] and (unit := known_unit(match["unit"])):
            if unit == "1" and "[" not in header:
                break  # "pos (1)" is the first of several
            return match["name"].strip(), "" if unit == "1" else unit
    return header, ""


def names_of(header: list[str]) -> dict[str, str]:
    """Column names without their units; whole where two would then be the same."""
    short = {name: split_header(name)[0] for name in header}
    taken = list(short.values()) + list(short)
    return {
        name: short_name if short_name == name or taken.count(short_name) == 1 else name
        for name, short_name in short.items()
    }


def is_unit_cell(cell: str) -> bool:
    """Whether a cell of a row of units is a unit: "mm", "[mm]", "-"."""
    text = cell.strip().strip("[]()（）［］【】").strip()
    return text in ("-", "--", "–", "1", "Text", "text") or known_unit(text) is not None


def unit_of_cell(cell: str) -> str:
    """The unit that a cell of a row of units states; empty where it states none."""
    unit = known_unit(cell.strip().strip("[]()（）［］【】").strip())
    return "" if unit in (None, "1") else str(unit)
