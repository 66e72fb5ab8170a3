"""Tables as HTML, numbers rounded for reading; the files beside the page have all digits."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import isinf
from numbers import Integral, Real
from typing import Any

import numpy as np
import pandas as pd

WHOLE = 1e4
"""From here on a number is shown without decimals."""


def shown(value: Any) -> str:
    """A cell as text: four digits, yes or no, empty where unknown."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None or value is pd.NA or value is pd.NaT:
        return ""
    if isinstance(value, Real):
        return _number(value)
    return str(value)


def _number(value: Real) -> str:
    number = float(value)
    if np.isnan(number):
        return ""
    if isinstance(value, Integral) or (abs(number) >= WHOLE and not isinf(number)):
        return f"{number:.0f}"
    return f"{number:.4g}"


def table(frame: pd.DataFrame, marked: Sequence[bool] = (), caption: str = "") -> str:
    """An HTML table; `marked` rows are emphasised."""
    if frame.empty:
        return "<p>None.</p>"
    marks = marked or [False] * len(frame)
    head = "".join(f'<th scope="col">{_heading(str(name))}</th>' for name in frame.columns)
    columns = [frame[name].tolist() for name in frame.columns]
    body = "\n".join(
        _row(cells, mark) for cells, mark in zip(zip(*columns, strict=True), marks, strict=True)
    )
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="scroll" tabindex="0"><table>{title}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def chosen(frame: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The columns of `names` that the table has, in that order."""
    return frame[[name for name in dict.fromkeys(names) if name in frame]]


def _heading(name: str) -> str:
    return escape(name).replace("_", "_<wbr>")


def _row(cells: Sequence[Any], mark: bool) -> str:
    return f"<tr{' class=mark' if mark else ''}>{''.join(map(_cell, cells))}</tr>"


def _cell(value: Any) -> str:
    number = isinstance(value, Real) and not isinstance(value, bool)
    return f"<td{' class=n' if number else ''}>{escape(shown(value))}</td>"
