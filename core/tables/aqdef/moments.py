"""Times of a Q-DAS file (K0004), and the one format that a file keeps."""

from __future__ import annotations

import re
from datetime import datetime

_CLOCK = r"[/ .T](\d{1,2}):(\d{1,2})(?::(\d{1,2}))?"
_FORMS = {
    "day.month.year": re.compile(
        rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.(?P<y>\d{{4}}|\d\d){_CLOCK}"
    ),
    "month/day/year": re.compile(rf"(?P<m>\d{{1,2}})/(?P<d>\d{{1,2}})/(?P<y>\d{{4}}|\d\d){_CLOCK}"),
    "year-month-day": re.compile(rf"(?P<y>\d{{4}})-(?P<m>\d{{1,2}})-(?P<d>\d{{1,2}}){_CLOCK}"),
}


def moment(text: str) -> tuple[datetime, str]:
    """The time that a text states, and the name of its format.

    Raises ValueError where it is none.
    """
    for name, form in _FORMS.items():
        if match := form.fullmatch(text):
            year = int(match["y"])
            year += (2000 if year < 70 else 1900) if year < 100 else 0
            hour, minute, second = (int(one or 0) for one in match.groups()[3:])
            return datetime(year, int(match["m"]), int(match["d"]), hour, minute, second), name
    raise ValueError(f'"{text}" is no time such as 31.12.2026/08:00:00')
