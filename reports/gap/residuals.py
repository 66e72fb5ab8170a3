"""The residual before and after, against every input, with the place where it was located."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...gap_records import GapResult, Region
from ...records import Axis
from ..drawing import flags, new_figure, plain
from .marks import AFTER, BEFORE, Mark, shade, words

DRAWN = 600
"""Readings drawn per panel: every k-th, so that a page of a million rows stays small."""
ROW, MARGIN = 1.75, 0.6
"""Height [inch] of a row of panels, and of what is above and below them."""


def residuals_figure(result: GapResult, output: Axis) -> Figure | None:
    """One row per input, before on the left and after on the right, on the same scale.

    None where the residuals are not row by row (a population).
    """
    inputs = [one for one in result.inputs if one.name in result.residuals]
    if f"{output.name}_before" not in result.residuals or not inputs:
        return None
    frame = thinned(result.residuals)
    figure = new_figure(height=MARGIN + ROW * len(inputs))
    panels = figure.subplots(len(inputs), 2, sharey=True, sharex="row", squeeze=False)
    for row, axis in zip(panels, inputs, strict=True):
        found = _regions(result.where, output.name, axis.name)
        for axes, mark in zip(row, (BEFORE, AFTER), strict=True):
            _panel(axes, frame, axis, output, mark, found)
        row[0].set_ylabel(f"residual [{output.unit}]" if output.unit else "residual")
    _titles(panels[0], result, output)
    for axes in panels.ravel():
        plain(axes)
    return figure


def thinned(frame: pd.DataFrame) -> pd.DataFrame:
    """Every k-th row, at most DRAWN of them."""
    return frame.iloc[:: max(1, -(-len(frame) // DRAWN))]


def _regions(where: Sequence[Region], output: str, variable: str) -> list[Region]:
    return [
        one for one in where
        if one.output == output and one.variable == variable and isfinite(one.low + one.high)
    ]  # fmt: skip


def _panel(
    axes: Axes, frame: pd.DataFrame, axis: Axis, output: Axis, mark: Mark, found: list[Region]
) -> None:
    for at, one in enumerate(found):
        shade(axes, one.low, one.high, None if at else "located here")
    places, ticks = _places(frame[axis.name])
    wrong = np.array(flags(frame, "outlier"), dtype=bool)
    rest = frame[f"{output.name}_{mark.word}"].to_numpy(dtype=float)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.plot(places[~wrong], rest[~wrong], linestyle="none", marker=mark.marker, markersize=3.0,
              color=mark.colour, markerfacecolor=mark.face, markeredgewidth=0.7)  # fmt: skip
    if wrong.any():
        axes.plot(places[wrong], rest[wrong], linestyle="none", marker="+", markersize=7.0,
                  color="black", label="outlier")  # fmt: skip
    if ticks:
        axes.set_xticks(range(len(ticks)), ticks, fontsize="small")
    axes.set_xlabel(words(axis.name, axis.unit))
    if found or wrong.any():
        axes.legend(frameon=False, fontsize="x-small", loc="upper left")


def _places(column: pd.Series) -> tuple[NDArray[np.float64], list[str]]:
    """Where readings stand along an input; labels one beside the other in order of appearance."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(dtype=float), []
    codes, labels = pd.factorize(column.astype(str))
    shown = [str(one) for one in labels] if len(labels) <= 12 else []
    return codes.astype(float), shown


def _titles(row: Sequence[Axes], result: GapResult, output: Axis) -> None:
    """Each column's RMSE on rows that the fit never saw."""
    for axes, mark, gaps in zip(row, (BEFORE, AFTER), (result.gap_before, result.gap_after),
                                strict=True):  # fmt: skip
        error = gaps.get(output.name)
        text = "" if error is None else f": held-out RMSE {error:.3g} {output.unit}"
        axes.set_title(f"{mark.word} ({mark.marker}){text}", fontsize="small")
