"""Page and figures of recomputed claims."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from html import escape
from itertools import starmap
from math import isfinite

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...page.document import declared_tables, described, document, package_scripts, picture, section, shown, table
from ...page.drawing import COLOURS, Named, axis_label, label_with_unit, new_axes, style_axes, words
from ...records import Axis
from .records import Chart, ClaimsResult, ComputedTable, Document

__all__ = ["claims_page", "figures"]

# The figures of the calculations behind the claims.


def figures(result: ClaimsResult) -> list[Named]:
    """One figure of every table with a chart."""
    return [
        Named(name, table_figure(table, table.chart), _caption(table, table.chart))
        for name, table in result.tables.items()
        if table.chart is not None
    ]


BAR_HEIGHT = 0.3
"""Height [inch] of the bars of one row."""


def table_figure(table: ComputedTable, chart: Chart) -> Figure:
    """The columns of a table, drawn as its chart describes."""
    if chart.kind == "bars":
        return _bars(table, chart)
    figure, axes = new_axes(height=3.8)
    columns = {
        axis.name: (axis, np.asarray(values, dtype=float))
        for axis, values in zip(table.columns, table.values, strict=True)
        if axis.name in (chart.x, *chart.y)
    }
    across, x = columns[chart.x]
    for at, name in enumerate(chart.y):
        _draw(axes, chart.kind, x, *columns[name], COLOURS[at % len(COLOURS)])
    for label, place in chart.marks.items():
        if isfinite(place):
            axes.axvline(place, color="black", linestyle="--", linewidth=1.0)
            axes.annotate(
                label,
                (place, 0.98),
                xycoords=("data", "axes fraction"),
                rotation=90,
                ha="right",
                va="top",
                fontsize="small",
                parse_math=False,
            )
    axes.set_xlabel(_label(across))
    axes.set_ylabel(_common_label([columns[name][0] for name in chart.y], chart.of))
    style_axes(axes, legend=len(chart.y) > 1)
    return figure


def _common_label(drawn: list[Axis], of: str) -> str:
    """The label of one column, or of what several are values of in one unit; empty where that is not said."""
    units = {axis.unit for axis in drawn}
    if len(drawn) == 1:
        return _label(drawn[0])
    return label_with_unit(of, units.pop()) if of and len(units) == 1 else ""


def _bars(table: ComputedTable, chart: Chart) -> Figure:
    """A group of horizontal bars for every row, one bar for each column."""
    by_name = dict(
        zip((axis.name for axis in table.columns), zip(table.columns, table.values, strict=True), strict=True)
    )
    (across, names), drawn = by_name[chart.x], [by_name[name] for name in chart.y]
    figure, axes = new_axes(height=max(3.8, BAR_HEIGHT * len(names)))
    place, size = np.arange(len(names)), 0.8 / len(drawn)
    for at, (axis, values) in enumerate(drawn):
        middle = place + (at + 0.5) * size - 0.4
        axes.barh(
            middle, np.asarray(values, dtype=float), size, color=COLOURS[at % len(COLOURS)], label=words(axis.name)
        )
    axes.set_yticks(place, [str(name).replace("_", " ") for name in names], fontsize="small")
    axes.invert_yaxis()
    axes.set_xlabel(_common_label([axis for axis, _ in drawn], chart.of))
    axes.set_ylabel(_label(across))
    style_axes(axes, legend=len(drawn) > 1)
    return figure


def _draw(axes: Axes, kind: str, x: np.ndarray, axis: Axis, y: np.ndarray, colour: str) -> None:
    label = _label(axis)
    if kind == "histogram":
        axes.bar(x[:-1], y[:-1], np.diff(x), align="edge", color=colour, alpha=0.8, label=label)
    elif kind == "points":
        axes.plot(x, y, "o", color=colour, markersize=4, label=label)
    else:
        axes.plot(x, y, color=colour, linewidth=1.4, label=label)


def _label(axis: Axis) -> str:
    """The label of an axis; a number without a dimension has the unit "1", which is not shown."""
    return axis_label(replace(axis, unit="") if axis.unit == "1" else axis)


def _caption(table: ComputedTable, chart: Chart) -> str:
    marks = f" Dashed: {', '.join(chart.marks)}." if chart.marks else ""
    return f"{table.meaning.rstrip('.')}.{marks}"


# The page of recomputed claims: a single HTML file that needs no network.


MAX_ROWS_SHOWN = 60
"""Rows of a calculation's table on the page; the file next to it has all."""
MEANING = (
    "Reproduced: the document is right in its literal interpretation. Reproduced under the stated reading: "
    "it is right in the stated interpretation. Not reproduced: it is right in no interpretation. Cannot be "
    "checked: the data for it are lost. Rows that are not reproduced are marked."
)


def claims_page(result: ClaimsResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    drawn = {
        named.name: picture(named.name.replace(".", "_"), named.figure, named.caption) for named in figures(result)
    }
    parts = [section("Verdicts", described(MEANING, result.counts.rename_axis("document").reset_index()))]
    # tables in `detail` have their whole height, because their reasons are long
    failed = _failed_claims(result.table)
    if not failed.startswith("<p>"):
        parts.append(section("Not reproduced", failed))
    documents = [_document(source, result.table) for source in result.documents]
    parts.append('<div id="detail" data-filter="verdict">\n' + "\n".join(documents) + "\n</div>")
    parts += starmap(section, declared_tables(result).items())
    parts += [
        section(name.replace("_", " "), _calculation(computed, drawn.get(name, "")))
        for name, computed in result.tables.items()
    ]
    scripts = (package_scripts("common.js", "filter.js"),)
    return document("Claims recomputed", parts, scripts)


def _failed_claims(claims: pd.DataFrame) -> str:
    """The claims that are not reproduced, in short."""
    failed = claims[claims["verdict"] == "not reproduced"]
    return table(
        pd.DataFrame(
            {
                "document": failed["document"],
                "claim": failed["id"],
                "printed": [_printed(row) for row in failed.to_dict("records")],
                "computed": failed["computed"].map(_numbers),
                "unit": failed["unit"],
                "reason": failed["reason"],
            }
        )
    )


def _document(source: Document, claims: pd.DataFrame) -> str:
    rows = claims[claims["document"] == source.name]
    frame = pd.DataFrame(
        {
            "claim": rows["id"],
            "place": rows["place"],
            "quantity": rows["quantity"],
            "printed": [_printed(row) for row in rows.to_dict("records")],
            "computed": rows["computed"].map(_numbers),
            "standard error": [_numbers(errors) if any(errors) else "" for errors in rows["standard_error"]],
            "deviation": rows["deviation"].map(_numbers),
            "unit": rows["unit"],
            "tolerance": [
                f"{shown(row['tolerance'])}: {row['tolerance_reason']}" if row["tolerance_reason"] else ""
                for row in rows.to_dict("records")
            ],
            "verdict": rows["verdict"],
            "reason": rows["reason"],
            "ambiguous": rows["ambiguous"],
        }
    )
    marks = [verdict == "not reproduced" for verdict in rows["verdict"]]
    reference = f"<p>{escape(source.reference)}</p>\n" if source.reference else ""
    return section(f"Document {source.name}: {source.title}", reference + table(frame, marks))


def _printed(row: Mapping[Hashable, object]) -> str:
    values = row["printed"]
    assert isinstance(values, list)
    if row["printed_as"]:
        return str(row["printed_as"])
    return " to ".join(map(shown, values)) if row["relation"] == "within" else _numbers(values)


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(map(shown, values))


def _calculation(computed: ComputedTable, drawn: str) -> str:
    frame = pd.DataFrame({axis.name: values for axis, values in zip(computed.columns, computed.values, strict=True)})
    rest = len(frame) - MAX_ROWS_SHOWN
    more = f"<p>{rest} more rows are in the file.</p>" if rest > 0 else ""
    return f"<p>{escape(computed.meaning)}</p>\n{drawn}\n{table(frame.head(MAX_ROWS_SHOWN))}{more}"
