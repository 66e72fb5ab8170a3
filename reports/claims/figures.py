"""The figures of the calculations behind the claims."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...claim_records import Chart, ClaimsResult, ComputedTable
from ...records import Axis
from ..drawing import COLOURS, Named, axis_label, new_axes, style_axes


def figures(result: ClaimsResult) -> list[Named]:
    """One figure of every table with a chart."""
    return [
        Named(name, table_figure(table, table.chart), _caption(table, table.chart))
        for name, table in result.tables.items()
        if table.chart is not None
    ]


def table_figure(table: ComputedTable, chart: Chart) -> Figure:
    """The columns of a table, drawn as its chart describes."""
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
    axes.set_ylabel(_label(columns[chart.y[0]][0]) if len(chart.y) == 1 else "")
    style_axes(axes, legend=len(chart.y) > 1)
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
