"""Tables as HTML, numbers rounded for reading; the files next to the page have all digits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import isinf
from numbers import Integral, Real
from typing import Any

import numpy as np
import pandas as pd

from ..units import split_unit
from .glossary import link

CARDS, CELLS = 14, 1500
"""Columns and cells up to which a table becomes cards on a narrow screen; others are scrolled."""
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
    head = "".join(f'<th scope="col" title="{escape(str(name))}">{heading(str(name))}</th>' for name in frame.columns)
    heads = _heads(frame)
    columns = [frame[name].tolist() for name in frame.columns]
    body = "\n".join(_row(cells, mark, heads) for cells, mark in zip(zip(*columns, strict=True), marks, strict=True))
    label = caption or "table of " + ", ".join(str(n).replace("_", " ") for n in frame.columns[:3])
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="scroll" tabindex="0" role="group" aria-label="{escape(label)}">'
        f"<table{' class=cards' if heads else ''}>{title}<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def described(text: str, frame: pd.DataFrame, marked: Sequence[bool] = ()) -> str:
    """A paragraph, and below it the table that it explains."""
    return f"<p>{escape(text)}</p>\n{table(frame, marked)}"


def listed(records: Iterable[object], columns: str) -> pd.DataFrame:
    """A row per record with its attributes `columns`, which are separated by commas; the column of
    "low: from" has the attribute `low` under the name "from".
    """
    pairs = [column.partition(": ")[::2] for column in columns.split(", ")]
    rows = [[getattr(record, attribute) for attribute, _ in pairs] for record in records]
    return pd.DataFrame(rows, columns=[name or attribute for attribute, name in pairs])


def chosen(frame: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The columns of `names` that the table has, in that order."""
    return frame[[name for name in dict.fromkeys(names) if name in frame]]


def heading(name: str) -> str:
    """A column in words with its unit, linked to the explanation of its term."""
    stem, unit = split_unit(name)
    stem, unit = (name.removesuffix("_percent"), "%") if name.endswith("_percent") else (stem, unit)
    return link(stem.replace("_", " ") + (f" [{unit}]" if unit and unit != name else ""))


def _heads(frame: pd.DataFrame) -> list[str]:
    """The heads of the cells where a row becomes a card; none for a table that is too large."""
    if len(frame.columns) > CARDS or frame.size > CELLS:
        return []
    return [str(name).replace("_", " ") for name in frame.columns]


def _row(cells: Sequence[Any], mark: bool, heads: Sequence[str]) -> str:
    body = "".join(map(_cell, cells, heads or [""] * len(cells)))
    return f"<tr{' class=mark' if mark else ''}>{body}</tr>"


def _cell(value: Any, head: str) -> str:
    text = shown(value)  # an empty text comes back from a file as no number: both are empty
    number = bool(text) and isinstance(value, Real) and not isinstance(value, bool)
    kind, named = " class=n" if number else "", f' data-head="{escape(head)}"' if head else ""
    return f"<td{kind}{named}>{escape(text)}</td>"
