"""A response against each setting: every run, medians and their intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...records import Response, StudyResult, Varied
from ..drawing import new_figure, style_axes
from .words import level, short, wide

MOST = 40
"""Settings up to which the single runs are drawn."""
COLUMNS = 3
COLOUR = "#1f5fa8"


def response_figure(result: StudyResult, response: Response) -> Figure:
    """One panel per key, in a design one at a time only of settings that change no other key."""
    rows = -(-len(result.varied) // COLUMNS)
    figure = new_figure(height=0.6 + 2.7 * rows)
    columns = min(COLUMNS, len(result.varied))
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    medians = result.medians[result.medians["response"] == response.name].set_index("point")
    known = medians["median"].dropna()
    scale = "log" if len(known) and wide(known.min(), known.max()) else "linear"
    for at, axes in enumerate(panels.flat):
        if at >= len(result.varied):
            axes.set_visible(False)
            continue
        _draw(axes, result, response, result.varied[at], medians)
        axes.set_yscale(scale)
        style_axes(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel(response.name.replace("_", " "))
    return figure


def _draw(axes: Axes, result: StudyResult, response: Response, key: Varied, medians: pd.DataFrame) -> None:
    points = _points(result, key)
    places, labels = _places(result.design.loc[points, key.key], key)
    if len(result.design) <= MOST:
        runs = result.table[result.table["point"].isin(points)]
        x, y = places.loc[runs["point"]], runs[response.name]
        axes.plot(x, y, "o", markersize=2.2, color="#888888", alpha=0.5, markeredgewidth=0)
    some = medians.loc[points]
    order = places.sort_values(kind="stable").index
    joined = "-" if result.kind == "one_at_a_time" and not key.categorical else "none"
    reach = np.abs(some[["low", "high"]].to_numpy(dtype=float).T - some["median"].to_numpy())
    x, errors = places.loc[points], np.nan_to_num(reach)
    axes.errorbar(x, some["median"], errors, fmt="o", markersize=4, capsize=2.5, linewidth=1.1, color=COLOUR)
    axes.plot(places.loc[order], some.loc[order, "median"], linestyle=joined, linewidth=0.9, color=COLOUR)
    if some["median"].isna().any():
        text = "no median: half of the runs\ndid not reach the level"
        axes.text(0.5, 0.97, text, fontsize="small", ha="center", va="top", transform=axes.transAxes)
    if response.best is not None:
        axes.axhline(response.best, color="black", linestyle="--", linewidth=1.0)
    if labels:
        axes.set_xticks(range(len(labels)), labels, fontsize="small")
    low, high = float(places.min()), float(places.max())
    if key.log and not labels:
        axes.set_xscale("log")
        spread = (high / low) ** 0.05 if high > low else 2.0
        axes.set_xlim(low / spread, high * spread)
    else:
        margin = 0.05 * (high - low) or 0.5
        axes.set_xlim(low - margin, high + margin)
    axes.set_xlabel(short(key.key))


def _points(result: StudyResult, key: Varied) -> pd.Index:
    """The settings of a panel."""
    if result.kind != "one_at_a_time":
        return result.design.index
    others = [varied for varied in result.varied if varied.key != key.key]
    same = pd.DataFrame(
        {varied.key: result.design[varied.key] == varied.base for varied in others}, index=result.design.index
    )
    return result.design.index[same.all(axis=1)]


def _places(column: pd.Series, key: Varied) -> tuple[pd.Series, list[str]]:
    """The place of every setting on the axis, and the labels of the axis for levels without numbers."""
    if not key.categorical:
        return column.astype(float), []
    names = list(dict.fromkeys(column))
    return column.map({name: float(at) for at, name in enumerate(names)}), [*map(level, names)]


def response_caption(result: StudyResult, response: Response) -> str:
    """What the figure shows."""
    runs = "grey points are single runs, " if len(result.design) <= MOST else ""
    best = "" if response.best is None else "; the dashed line is the best possible value"
    confidence = 100 * result.medians["level"].iloc[0]
    keys = ", ".join(varied.key for varied in result.varied)
    return (
        f"{response.name} against {keys}: {runs}circles are medians with {confidence:.0f} % bootstrap intervals{best}."
    )
