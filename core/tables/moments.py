"""Dates and times of day in tables: one format in a column, none guessed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone

_HOURS = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{1,2})(?::(?P<second>\d{1,2})(?:[.,](?P<fraction>\d{1,12}))?)?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?P<zone>[Zz]|(?:UTC|GMT)?[+-]\d\d(?::?\d\d)?|UTC|GMT))?"
)
_CLOCK = rf"(?:[/ .T]+{_HOURS})?"
_YEAR = r"(?P<y>\d{4}|\d\d)"
POINTS, SLASHES, TURNED, ISO = ("day.month.year", "month/day/year", "day/month/year", "year-month-day")
OF_DAY = "hour:minute"
_FORMS = {
    POINTS: re.compile(rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.{_YEAR}{_CLOCK}"),
    SLASHES: re.compile(rf"(?P<m>\d{{1,2}})/(?P<d>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    TURNED: re.compile(rf"(?P<d>\d{{1,2}})/(?P<m>\d{{1,2}})/{_YEAR}{_CLOCK}"),
    ISO: re.compile(rf"(?P<y>\d{{4}})[-/](?P<m>\d{{1,2}})[-/](?P<d>\d{{1,2}}){_CLOCK}"),
    OF_DAY: re.compile(rf"(?P<y>1900)?(?P<m>)(?P<d>){_HOURS}"),
}
ZONED = ", with the zone"


def moment(text: str, forms: Sequence[str] = (POINTS, SLASHES, ISO)) -> tuple[datetime, str]:
    """The time that a text states, and the name of its format, the first of `forms` that fits.

    A time with its zone (Z, +01:00) is in that zone. Raises ValueError where it is none.
    """
    time, _, name = _parsed(text, forms)
    return time, name


def _parsed(text: str, forms: Sequence[str]) -> tuple[datetime, float, str]:
    """The time to whole microseconds, the rest in seconds, and the name of the format."""
    for name in forms:
        if match := _FORMS[name].fullmatch(text.strip()):
            year = int(match["y"] or 1900)
            year += (2000 if year < 70 else 1900) if year < 100 else 0
            hour, minute, second = (int(match[part] or 0) for part in ("hour", "minute", "second"))
            fraction = (match["fraction"] or "").ljust(12, "0")
            if match["half"]:
                hour = hour % 12 + 12 * (match["half"] in "Pp") if 1 <= hour <= 12 else 24
            day, micro = (int(match["m"] or 1), int(match["d"] or 1)), int(fraction[:6])
            try:
                time = datetime(year, *day, hour, minute, second, micro, _zone(match["zone"]))
            except ValueError:
                continue
            return time, 1e-12 * int(fraction[6:]), name + (ZONED if match["zone"] else "")
    raise ValueError(f'"{text[:60]}" is not a time such as 31.12.2026/08:00:00 or 2026-12-31T08:00:00Z')


def _zone(text: str | None) -> timezone | None:
    """The zone that a time states: Z, +01:00, UTC-5."""
    if not text:
        return None
    match = re.search(r"([+-])(\d\d):?(\d\d)?", text)
    if match is None:
        return UTC
    return timezone(int(match[1] + "1") * timedelta(hours=int(match[2]), minutes=int(match[3] or 0)))


def seconds(texts: Sequence[str]) -> tuple[list[float], datetime]:
    """The times that a column states, in seconds since the earliest of them, which is the second
    result; NaN where a cell is empty.

    Raises ValueError where a cell is not a time, where times have several formats or only some a
    zone, and where dates with slashes can be read with the day or the month first.
    """
    filled = [text for text in texts if text]
    fitting = [name for name in _FORMS if all(_fits(text, name) for text in filled)]
    examples = {_parsed(text, fitting or tuple(_FORMS))[2]: text for text in reversed(filled)}
    if not fitting or len(examples) > 1:
        listed = " and ".join(f'{name} ("{text}")' for name, text in examples.items())
        raise ValueError(f"has times in two formats: {listed}")
    if {SLASHES, TURNED} <= set(fitting):
        raise ValueError(
            f'has dates such as "{filled[0]}" that can be read with the day or the '
            "month first: write them as 2026-12-31 or 31.12.2026"
        )
    times = [_parsed(text, fitting[:1])[:2] if text else None for text in texts]
    start, rest = min(time for time in times if time is not None)
    return [(time[0] - start).total_seconds() + (time[1] - rest) if time else float("nan") for time in times], start


def _fits(text: str, form: str) -> bool:
    try:
        moment(text, (form,))
    except ValueError:
        return False
    return True
