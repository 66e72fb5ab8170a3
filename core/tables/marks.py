"""Cells that are not values: marks for missing or invalid measurements, dates, summary rows."""

from __future__ import annotations

import re

MISSING = frozenset(
    "- -- --- ---- – — . .. ... * ** *** ? ?? # n.i.o. nio n.i.o k.a. n.a. n/a na nan nil none "
    "null #n/a #na #nv #wert! #value! #div/0! #bezug! #ref! #zahl! #num! #name? fehlt missing "
    "invalid ungültig ungueltig n.b. n.g. n.m. error err fehler 无 無 缺失 无效 欠測 欠測値".split()
) | {"", "k. a.", "n. a.", "n. b.", "n. i. o.", "over range", "no data", "not measured"}
"""Marks for a value that is missing or not valid, in lower case."""

_DATE = re.compile(
    r"\d{4}[-./]\d{1,2}[-./]\d{1,2}(?:[ T]\d.*)?|\d{1,2}[-./]\d{1,2}[-./]\d{2,4}(?:[ T/]\d.*)?"
    r"|\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AaPp][Mm])?"
)
SUMMARY = frozenset(
    "mittelwert mittel mw summe min max min. max. minimum maximum mean average avg std stdev "
    "stabw stabw. sigma range spannweite total sum count anzahl median cp cpk xq x-quer xquer "
    "nennmaß nennmass nennwert sollwert soll nominal ot ut otg utg og ug usl lsl toleranz "
    "tolerance ende end eof moyenne écart-type 平均 平均值 平均値 合计 合計 最大 最小 "
    "最大值 最小值 标准差 公差 上限 下限".split()
)
"""Names of rows at the top or the bottom of a table that are not measurements, in lower case."""


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or a mark for a value that is missing or invalid."""
    return cell.lower() in MISSING


def is_date(cell: str) -> bool:
    """Whether a cell looks like a date or a time of day."""
    return _DATE.fullmatch(cell) is not None


def is_summary(cell: str) -> bool:
    """Whether a cell names a row that is not a measurement: a mean, a limit, the end."""
    return cell.lower().rstrip(":") in SUMMARY
