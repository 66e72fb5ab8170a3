"""Dates and times of day in tables: one format in a column, none guessed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

_CLOCK = r"(?:[/ .T](\d{1,2}):(\d{1,2})(?::(\d{1,2})(?:[.,](\d{1,6}))?)?)?"
_YEAR = r"(?P<y>\d{4}|\d\d)"
POINTS, SLASHES, TURNED, ISO = ("day.month.year", "month/day/year", "day/month/year", "year-month-day")
_FORMS = {
    POINTS: re.compile(rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.{_YEAR}{_CLOCK}"),
    SLASHES: re.compile(rf"(?P<m>\d{{1,2}})/(?P<d>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    TURNED: re.compile(rf"(?P<d>\d{{1,2}})/(?P<m>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    ISO: re.compile(rf"(?P<y>\d{{4}})[-/](?P<m>\d{{1,2}})[-/](?P<d>\d{{1,2}}){_CLOCK}"),
}


def moment(text: str, forms: Sequence[str] = (POINTS, SLASHES, ISO)) -> tuple[datetime, str]:
    """The time that a text states, and the name of its format, the first of `forms` that fits.

    Raises ValueError where it is none.
    """
    for name in forms:
        if match := _FORMS[name].fullmatch(text.strip()):
            year = int(match["y"])
            year += (2000 if year < 70 else 1900) if year < 100 else 0
            hour, minute, second = (int(part or 0) for part in match.groups()[3:6])
            micro = int((match.groups()[6] or "0").ljust(6, "0"))
            try:
                return datetime(year, int(match["m"]), int(match["d"]), hour, minute, second, micro), name
            except ValueError:
                continue
    raise ValueError(f'"{text}" is not a time such as 31.12.2026/08:00:00')


def seconds(texts: Sequence[str]) -> tuple[list[float], datetime]:
    """The times that a column states, in seconds since the earliest of them, which is the second
    result; NaN where a cell is empty.

    Raises ValueError where a cell is not a time, where times have several formats, and where dates
    with slashes can be read with the day or the month first.
    """
    filled = [text for text in texts if text]
    fitting = [name for name in _FORMS if all(_fits(text, name) for text in filled)]
    if not fitting:
        examples = {moment(text, tuple(_FORMS))[1]: text for text in reversed(filled)}
        listed = " and ".join(f'{name} ("{text}")' for name, text in examples.items())
        raise ValueError(f"has times in two formats: {listed}")
    if {SLASHES, TURNED} <= set(fitting):
        raise ValueError(
            f'has dates such as "{filled[0]}" that can be read with the day or the '
            "month first: write them as 2026-12-31 or 31.12.2026"
        )
    times = [moment(text, fitting[:1])[0] if text else None for text in texts]
    start = min(time for time in times if time is not None)
    return [(time - start).total_seconds() if time else float("nan") for time in times], start


def _fits(text: str, form: str) -> bool:
    try:
        moment(text, (form,))
    except ValueError:
        return False
    return True
