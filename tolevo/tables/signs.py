"""Cells and what they can be: numbers by their decimal signs, dates and times, marks for missing values,
names of summary rows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import Fault

MISSING = frozenset(
    "- -- --- ---- – — . .. ... * ** *** ? ?? # n.i.o. nio n.i.o k.a. n.a. n/a na nan nil none "
    "null #n/a #na #nv #wert! #value! #div/0! #bezug! #ref! #zahl! #num! #name? fehlt missing "
    "invalid ungültig ungueltig n.b. n.g. n.m. error err fehler 无 無 缺失 无效 欠測 欠測値".split()
) | {"", "k. a.", "n. a.", "n. b.", "n. i. o.", "over range", "no data", "not measured"}
"""Marks for a value that is missing or not valid, in lower case."""

_MONTHS = "jan feb mar|mär apr may|mai jun jul aug sep oct|okt nov dec|dez".split()
"""The first letters of months, in English and German."""
_MONTH = rf"(?:{'|'.join(_MONTHS)})[a-zä]{{0,6}}"
_DATE = re.compile(
    r"\d{4}[-./]\d{1,2}[-./]\d{1,2}(?:[ T]\d.*)?|\d{1,2}[-./]\d{1,2}[-./]\d{2,4}(?:[ T/]\d.*)?"
    r"|\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AaPp][Mm])?"
    rf"|\d{{1,2}}[-. ]+{_MONTH}[-. ]+\d{{2,4}}(?:[ T]+\d.*)?|{_MONTH}\.? \d{{1,2}},? \d{{4}}(?:[ T]+\d.*)?",
    re.IGNORECASE,
)


def _sided(before: str, after: str, others: str) -> str:
    """Names of tolerances of one side: "uppertol", "tol+"."""
    stems = "tol tolerance toleranz deviation dev abmass abmaß abweichung abw".split()
    names = [begin + stem for begin in before.split() for stem in stems]
    return " ".join([*names, *(stem + end for end in after.split() for stem in stems), others])


def _ends(before: str, others: str) -> str:
    """Names of limits of one side: "upperlimit"."""
    stems = "limit lim spec speclimit specificationlimit tolerancelimit grenze grenzwert grenzmaß toleranzgrenze"
    return " ".join([*(begin + stem for begin in before.split() for stem in stems.split()), others])


LIMITS = {
    "nominal": "nominal nom nominalvalue nominalsize basic theoretical soll sollwert sollmaß sollmass nennmaß nennmass "
    "nennwert target theo nominale design designvalue 名义值 标准值 理论值 设计值 標準値 設計値 基準値",
    "upper": _sided(
        "upper up plus + ober obere oberes ob",
        "+ plus sup upper up oben",
        "ot otol maxtol tolmax 上公差 公差上限 上限公差",
    ),
    "lower": _sided(
        "lower low lo minus - unter untere unteres unt un",
        "- minus inf lower low unten",
        "ut utol ltol mintol tolmin 下公差 公差下限 下限公差",
    ),
    "usl": _ends("upper ober obere oberer oberes ob", "usl og ogw otg höchstmaß größtmaß 上限 规格上限"),
    "lsl": _ends("lower unter untere unterer unteres unt", "lsl ug ugw utg mindestmaß kleinstmaß 下限 规格下限"),
}
"""What nominal sizes, tolerances and limits are called, without blanks and points."""
SUMMARY = frozenset(
    "mittelwert mittel mw summe min max min. max. minimum maximum mean average avg std stdev "
    "stabw stabw. sigma range spannweite total sum count anzahl median cp cpk xq xquer x-quer "
    "toleranz tolerance ende end eof moyenne écarttype écart-type 平均 平均值 平均値 合计 合計 最大 最小 "
    "最大值 最小值 标准差 公差 上限 下限 pp ppk cpu cpl cg cgk variance varianz s(n-1) 6s 6sigma n stddev "
    "standardabweichung standarddeviation sd meanvalue mittelwerte maximalwert minimalwert statistics "
    "statistik endofreport endofdata s r sn-1".split()
) | {word.casefold() for words in LIMITS.values() for word in words.split()}
"""Names of rows at the top or the bottom of a table that are not measurements, in lower case."""


PLAIN = re.compile(r"[+-]?\d+(?:[.,]\d*)?").fullmatch
"""Matches what is a number at a glance, as most cells of long tables are."""


def bare(name: str) -> str:
    """A name in lower case, without blanks, points, brackets, and hyphens between two words."""
    return re.sub(r"[\s._:/()\[\]]|(?<=[^\W\d]{2})-(?=[^\W\d]{2})", "", name).casefold()


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or a mark for a value that is missing or invalid."""
    return cell.lower() in MISSING


def is_date(cell: str) -> bool:
    """Whether a cell looks like a date or a time of day."""
    return _DATE.fullmatch(cell) is not None


def is_summary(cell: str) -> bool:
    """Whether a cell names a row that is not a measurement: a mean, a limit, the end."""
    if PLAIN(cell):
        return False
    return re.sub(r"^[±+-]?\d(?=sigma)", "", bare(cell.partition(":")[0])) in SUMMARY


# How one cell writes a number: which of its signs are decimal, which group thousands.
#
# "0,412" can only be a decimal comma, "1.234.567" only thousands; "1,234" is either.


OTHER_DECIMAL_SIGN = {".": ",", ",": "."}
_SPACES = " \u00a0\u202f\u2009'’"
_GROUPS = re.compile(f"[{_SPACES}]")
_NUMBERS = {
    decimal: re.compile(
        rf"[+\-−]?(?:(?:\d{{1,3}}(?:[{_SPACES}]\d{{3}})+(?:\{decimal}\d+)?|\d+(?:\{decimal}\d*)?|\{decimal}\d+)"
        rf"(?:[eE][+\-−]?\d+)?|[1-9]\d{{0,2}}(?:\{other}\d{{3}})+(?:\{decimal}\d+)?)"
    )
    for decimal, other in OTHER_DECIMAL_SIGN.items()
}
"""Numbers by their decimal sign: with digits in groups of three, or without groups."""
MAX_NUMBER_CHARACTERS = 400
"""Characters of a number at most: a double written out has 330."""


@dataclass(frozen=True, slots=True)
class Notation:
    """How a cell writes a number: the decimal signs by which it is one, those that stand in it, and
    the space or apostrophe between its groups of digits.
    """

    decimals: tuple[str, ...]
    signs: tuple[str, ...] = ()
    group: str = ""

    @property
    def proven(self) -> str:
        """The only decimal sign that it can have, empty where both are possible."""
        return self.decimals[0] if len(self.decimals) == 1 else ""


@lru_cache(maxsize=4096)  # cells are looked at for the delimiter, the layout and their sign
def notation(cell: str) -> Notation | None:
    """How a cell writes a number; None where it is none in any notation."""
    decimals = tuple(decimal for decimal in _NUMBERS if _is_number(cell, decimal))
    if not decimals:
        return None
    spaced = _GROUPS.search(cell)
    return Notation(decimals, tuple(sign for sign in _NUMBERS if sign in cell), spaced[0] if spaced else "")


def _is_number(cell: str, decimal: str) -> bool:
    return len(cell) <= MAX_NUMBER_CHARACTERS and _NUMBERS[decimal].fullmatch(cell) is not None


def canonical_number(cell: str, decimal: str) -> str | None:
    """The number in plain notation where `decimal` is its decimal sign; None where it is none."""
    if not _is_number(cell, decimal):
        return None
    return _GROUPS.sub("", cell).replace(OTHER_DECIMAL_SIGN[decimal], "").replace(decimal, ".").replace("−", "-")


# The decimal sign of every column of a file: what its numbers prove, and what must be stated.
#
# A column is read by its own evidence; a column without evidence is read by that of the file: its other
# columns, or the delimiter (who separates columns by semicolons needs the comma for decimals). Where
# numbers fit two interpretations still, the one near the nominal size is meant; without a nominal the
# fault names `--decimal`.


PROBES = 64
"""Cells of a column, evenly spread, that say whether it holds numbers at all."""


class Exact(str):
    """A number that a file stores as a number, not as text: its sign need not be decided."""

    __slots__ = ()


@dataclass(slots=True)
class Evidence:
    """What the cells of one column prove: `proven` are the decimal signs that some must have,
    `grouping` the signs that group thousands in some, `either` those that can do both in one, of which
    `doubt` is the first.
    """

    proven: set[str] = field(default_factory=set)
    grouping: set[str] = field(default_factory=set)
    either: set[str] = field(default_factory=set)
    group: str = ""
    doubt: str = ""
    numbers: int = 0
    values: int = 0

    @property
    def numeric(self) -> bool:
        """Whether at least half of its values are numbers."""
        return self.numbers > 0 and 2 * self.numbers >= self.values

    def doubtful(self, decimal: str) -> bool:
        """Whether a cell can be another number where `decimal` is the decimal sign."""
        return OTHER_DECIMAL_SIGN[decimal] in self.either - self.grouping

    def add(self, cell: str, number: Notation) -> None:
        """Take note of the number in a cell."""
        self.numbers += 1
        if number.signs and not number.proven:
            self.either.update(number.signs)
            self.doubt = self.doubt or cell
        elif number.signs:
            self.proven.add(number.proven)
            self.grouping.update(sign for sign in number.signs if sign != number.proven)
        self.group = self.group or number.group


def evidence(cells: Sequence[str]) -> Evidence:
    """What the cells of a column prove; for a column of text only that it holds no number."""
    proof = Evidence()
    places: list[int] = np.linspace(0, len(cells) - 1, PROBES).astype(int).tolist()
    if len(cells) > 2 * PROBES and not any(notation(cells[at]) for at in places):
        proof.values = len(cells)
        return proof
    missing = 0
    for cell in cells:
        if isinstance(cell, Exact):
            proof.numbers += 1
        elif (number := notation(cell)) is not None:
            proof.add(cell, number)
        elif is_missing(cell):
            missing += 1
    proof.values = len(cells) - missing
    return proof


def decide(
    columns: Mapping[str, Evidence],
    stated: str | None,
    delimiter: str,
    place: str,
    near: Callable[[str, float], bool] = lambda _column, _value: False,
) -> tuple[dict[str, str], list[Fault]]:
    """The decimal sign by column ("" where none is used), and what must be stated instead.

    `near` says whether a value of a column is near its nominal size, where that is known.
    """
    numeric = {name: proof for name, proof in columns.items() if proof.numeric}
    if stated is not None:
        text = f'its numbers have decimal signs that are not "{stated}": state another --decimal'
        wrong = [name for name, proof in numeric.items() if proof.proven == {OTHER_DECIMAL_SIGN[stated]}]
        return dict.fromkeys(numeric, stated), [Fault(f"{place}: column {name}", text) for name in wrong]
    of_file = {sign for proof in numeric.values() for sign in proof.proven}
    usual = {",": ".", ";": ","}.get(delimiter)  # who separates columns by commas has points for decimals
    if not of_file and usual and not any(OTHER_DECIMAL_SIGN[usual] in proof.either for proof in numeric.values()):
        of_file = {usual}
    signs, faults, doubts = {}, [], []
    for name, proof in numeric.items():
        possible = proof.proven or of_file
        if len(proof.proven) > 1:
            faults.append(Fault(f"{place}: column {name}", _MIXED))
        elif not proof.proven and not proof.either:
            signs[name] = ""
        elif len(possible) == 1 and not proof.doubtful(min(possible)):
            signs[name] = min(possible)
        elif (sign := _sign_by_size(name, proof.doubt, near)) and sign in (proof.proven or sign):
            signs[name] = sign
        else:
            decimal, grouped = proof.doubt.replace(",", "."), proof.doubt.replace(",", "").replace(".", "")
            text = f'"{proof.doubt}" can be {decimal} or {grouped}, and nothing in the file decides'
            doubts.append(Fault(f"{place}: column {name}", f"{text}: state --decimal . or --decimal ,"))
    return signs, faults + doubts


def _sign_by_size(column: str, cell: str, near: Callable[[str, float], bool]) -> str:
    """The decimal sign by which a cell in doubt is near the nominal size, empty where none or both are."""
    fitting = [
        sign for sign in OTHER_DECIMAL_SIGN if (text := canonical_number(cell, sign)) and near(column, float(text))
    ]
    return fitting[0] if len(fitting) == 1 else ""


_MIXED = (
    "has decimal points in some cells and decimal commas in others; state --decimal where one of "
    "them groups thousands, or correct the cells"
)


def canonical(cells: Sequence[str], decimal: str) -> list[str]:
    """The cells with their numbers in plain notation."""
    return [cell if isinstance(cell, Exact) else canonical_number(cell, decimal) or cell for cell in cells]


# Dates and times of day in tables: one format in a column, none guessed.


_HOURS = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{1,2})(?::(?P<second>\d{1,2})(?:[.,](?P<fraction>\d{1,12}))?)?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?P<zone>[Zz]|(?:UTC|GMT)?[+-]\d\d(?::?\d\d)?|UTC|GMT))?"
)
_CLOCK = rf"(?:[/ .T]+{_HOURS})?"
_YEAR = r"(?P<y>\d{4}|\d\d)"
POINTS, SLASHES, TURNED, ISO = ("day.month.year", "month/day/year", "day/month/year", "year-month-day")
NAMED, NAMED_FIRST = "day month year", "month day, year"
OF_DAY = "hour:minute"
_FORMS = {
    POINTS: re.compile(rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.{_YEAR}{_CLOCK}"),
    SLASHES: re.compile(rf"(?P<m>\d{{1,2}})/(?P<d>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    TURNED: re.compile(rf"(?P<d>\d{{1,2}})/(?P<m>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    ISO: re.compile(rf"(?P<y>\d{{4}})[-/](?P<m>\d{{1,2}})[-/](?P<d>\d{{1,2}}){_CLOCK}"),
    NAMED: re.compile(rf"(?P<d>\d{{1,2}})[-. ]+(?P<m>{_MONTH})[-. ]+{_YEAR}{_CLOCK}", re.IGNORECASE),
    NAMED_FIRST: re.compile(rf"(?P<m>{_MONTH})\.? (?P<d>\d{{1,2}}),? {_YEAR}{_CLOCK}", re.IGNORECASE),
    OF_DAY: re.compile(rf"(?P<y>1900)?(?P<m>)(?P<d>){_HOURS}"),
}
ZONED = ", with the zone"


def moment(text: str, forms: Sequence[str] = (POINTS, SLASHES, ISO)) -> tuple[datetime, float, str]:
    """The time that a text states to whole microseconds, the rest in seconds, and the name of its format,
    the first of `forms` that fits.

    A time with its zone (Z, +01:00) is in that zone. Raises ValueError where it is none.
    """
    for name in forms:
        if match := _FORMS[name].fullmatch(text.strip()):
            year = int(match["y"] or 1900)
            year += (2000 if year < 70 else 1900) if year < 100 else 0
            hour, minute, second = (int(match[part] or 0) for part in ("hour", "minute", "second"))
            fraction, zone = (match["fraction"] or "").ljust(12, "0"), match["zone"] or ""
            if match["half"]:
                hour = hour % 12 + 12 * (match["half"] in "Pp") if 1 <= hour <= 12 else 24
            named = (at for at, names in enumerate(_MONTHS, 1) if match["m"][:3].lower() in names.split("|"))
            month = next(named, 0) or int(match["m"] or 1)
            day = f"{year:04}-{month:02}-{int(match['d'] or 1):02}"
            offset = (zone.upper().lstrip("UTCGMZ") or "Z") if zone else ""
            try:
                time = datetime.fromisoformat(f"{day}T{hour:02}:{minute:02}:{second:02}.{fraction[:6]}{offset}")
            except ValueError:
                continue
            return time, 1e-12 * int(fraction[6:]), name + (ZONED if zone else "")
    raise ValueError(f'"{text[:60]}" is not a time such as 31.12.2026/08:00:00 or 2026-12-31T08:00:00Z')


def seconds(texts: Sequence[str]) -> tuple[list[float], datetime]:
    """The times that a column states, in seconds since the earliest of them, which is the second
    result; NaN where a cell is empty.

    Raises ValueError where a cell is not a time, where times have several formats or only some a
    zone, and where dates with slashes can be read with the day or the month first.
    """
    filled = [text for text in texts if text]
    fitting = []
    for name in _FORMS:
        with suppress(ValueError):
            if all(moment(text, (name,)) for text in filled):
                fitting.append(name)
    examples = {moment(text, fitting or tuple(_FORMS))[2]: text for text in reversed(filled)}
    if not fitting or len(examples) > 1:
        listed = " and ".join(f'{name} ("{text}")' for name, text in examples.items())
        raise ValueError(f"has times in two formats: {listed}")
    if {SLASHES, TURNED} <= set(fitting):
        raise ValueError(
            f'has dates such as "{filled[0]}" that can be read with the day or the '
            "month first: write them as 2026-12-31 or 31.12.2026"
        )
    times = [moment(text, fitting[:1])[:2] if text else None for text in texts]
    start, rest = min(time for time in times if time is not None)
    return [(time[0] - start).total_seconds() + (time[1] - rest) if time else float("nan") for time in times], start


# Cells of numbers as numbers.


LONGEST_NUMBER = 15
"""Digits of a whole number that a double holds; longer ones are serial numbers."""


def integers_if_whole(values: NDArray[np.float64], whole_numbers: bool = True) -> NDArray[Any]:
    """Numbers, as integers where all are whole and may be; None where one is missing."""
    bad = np.isnan(values)
    if bad.any():
        column = values.astype(object)
        column[bad] = None
        return column
    if not whole_numbers:
        return values
    whole: NDArray[np.int64] = values.astype(np.int64)
    return whole if (whole == values).all() else values


def typed_column(cells: NDArray[Any], numeric: bool) -> NDArray[Any]:
    """The cells of a column as numbers or as text, None where one is missing or invalid."""
    if not numeric:
        if cells.dtype != object:
            return cells
        column = cells.copy()
        column[np.asarray((cells == "") | pd.isna(cells), dtype=bool)] = None
        return column
    if cells.dtype.kind in "fiu":
        return cells
    if all(map(_is_whole, cells)):
        return cells.astype(np.int64)
    numbers = numbers_in(cells)
    return integers_if_whole(np.where(np.isfinite(numbers), numbers, math.nan), False)


def _is_whole(cell: Any) -> bool:
    return isinstance(cell, str) and cell.lstrip("+-").isdecimal() and cell.isascii()


def numbers_in(cells: NDArray[Any]) -> NDArray[np.float64]:
    """The numbers in cells, NaN where there is none."""
    if cells.dtype.kind in "fiu":
        return cells.astype(float)
    if {type(cell) for cell in cells} == {str} and not any("_" in cell for cell in cells):
        with suppress(ValueError):
            return cells.astype(float)
    return np.array([number_in(cell) for cell in cells], dtype=float)


def number_in(cell: Any) -> float:
    """The number in a cell, NaN where it is none, as 1_000 is not, which Python reads as one."""
    try:
        return math.nan if isinstance(cell, bool) or (isinstance(cell, str) and "_" in cell) else float(cell)
    except (TypeError, ValueError):
        return math.nan


def is_label(cell: str) -> bool:
    """Whether digits are a label: with a zero in front, or too many for a number."""
    digits = cell.lstrip("+-−")
    return digits.isdecimal() and len(digits) > 1 and (digits[0] == "0" or len(digits) > LONGEST_NUMBER)
