"""The residual before and after, against every input, with the place where it was located."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ...gap_records import GapResult, Region
from ...records import Axis
from ..drawing import flags, new_figure, style_axes, with_unit
from .marks import AFTER, BEFORE, TAKEN, Mark, legend, shade, words

DRAWN = 600
"""Measurements drawn per panel: every k-th, so that a page of a million rows stays small."""
ROW, MARGIN = 1.75, 0.9
"""Height [inch] of a row of panels, and of what is above and below them."""
MEANS, LEAST = 16, 4
"""Intervals of an input whose means are drawn, and measurements in each of them at least."""
MARKS = (BEFORE, AFTER, TAKEN)
"""The columns of panels."""
FEW = 3
"""Values up to which an input is drawn as labels."""
TICKS = 4
"""Intervals between ticks at most: panels are small, and ticks take most of their time."""
MEAN = "mean of neighbours"
GOLDEN = 0.618033988749895


def residuals_figure(result: GapResult, output: Axis) -> Figure | None:
    """One row per input: before, after, and what the correction removed, on the same scale.

    None where rows have no residuals (a population).
    """
    inputs = [axis for axis in result.inputs if axis.name in result.residuals]
    if f"{output.name}_before" not in result.residuals or not inputs:
        return None
    frame = thinned(result.residuals)
    ends = (f"{output.name}_{mark.word}" for mark in (BEFORE, AFTER))
    before, after = (frame[name] for name in ends)
    frame = frame.assign(**{f"{output.name}_{TAKEN.word}": before - after})
    figure = new_figure(height=MARGIN + ROW * len(inputs))
    panels = figure.subplots(len(inputs), len(MARKS), sharey=True, sharex="row", squeeze=False)
    for row, axis in zip(panels, inputs, strict=True):
        regions = _regions(result.where, output.name, axis.name)
        for axes, mark in zip(row, MARKS, strict=True):
            _panel(axes, frame, axis, output, mark, regions)
        row[0].set_ylabel(with_unit("residual", output.unit))
    limit = _limit(frame, output)
    panels[0][0].set_ylim(-limit, limit)
    _titles(panels[0], result, output)
    legend(figure, panels.ravel())
    for axes in panels.ravel():
        style_axes(axes)
    return figure


def thinned(frame: pd.DataFrame) -> pd.DataFrame:
    """Every k-th row, at most DRAWN of them."""
    return frame.iloc[:: max(1, -(-len(frame) // DRAWN))]


def _regions(where: Sequence[Region], output: str, variable: str) -> list[Region]:
    return [
        region
        for region in where
        if region.output == output and region.variable == variable and isfinite(region.low + region.high)
    ]


def _panel(axes: Axes, frame: pd.DataFrame, axis: Axis, output: Axis, mark: Mark, regions: list[Region]) -> None:
    for region in regions:
        shade(axes, region.low, region.high)
    places, ticks = _places(frame[axis.name])
    outlier = _outliers(frame, output)
    rest = frame[f"{output.name}_{mark.word}"].to_numpy(dtype=float)
    limit = _limit(frame, output)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.plot(
        places[~outlier],
        rest[~outlier],
        mark.marker,
        markersize=3.0,
        color=mark.colour,
        markerfacecolor=mark.face,
        markeredgewidth=0.7,
        label=mark.word,
    )
    if outlier.any():
        at_most, label = np.clip(rest[outlier], -limit, limit), "outlier (at the edge: beyond it)"
        axes.plot(places[outlier], at_most, "+", markersize=7.0, color="black", label=label)
    if ticks:
        _means_of_labels(axes, np.rint(places[~outlier]), rest[~outlier])
    else:
        _means(axes, places[~outlier], rest[~outlier])
    _noise(axes, frame, output)
    axes.yaxis.set_major_locator(MaxNLocator(TICKS, symmetric=True))
    if ticks:
        axes.set_xticks(range(len(ticks)), ticks, fontsize="small")
        axes.set_xlim(-0.5, len(ticks) - 0.5)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(TICKS))
    axes.set_xlabel(words(axis.name, axis.unit))


def _outliers(frame: pd.DataFrame, output: Axis) -> NDArray[np.bool_]:
    return np.array(flags(frame, f"{output.name}_outlier"), dtype=bool)


def _limit(frame: pd.DataFrame, output: Axis) -> float:
    """Half the height of the panels, in which all measurements but the outliers lie."""
    good = frame[~_outliers(frame, output)]
    both = good[[f"{output.name}_{mark.word}" for mark in MARKS]].to_numpy(dtype=float)
    return 1.1 * float(np.nanmax(np.abs(both), initial=0.0)) or 1.0


def _means(axes: Axes, places: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
    """Means of neighbouring measurements, in which a systematic residual shows first."""
    order = np.argsort(places, kind="stable")
    groups = [group for group in np.array_split(order, MEANS) if len(group) >= LEAST]
    if len(groups) == MEANS and len(np.unique(places)) > MEANS:
        axes.plot(
            [places[group].mean() for group in groups],
            [rest[group].mean() for group in groups],
            color="black",
            linewidth=1.6,
            label=MEAN,
        )


def _means_of_labels(axes: Axes, codes: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
    """The mean of the measurements of each label."""
    levels = np.unique(codes)
    means = [float(rest[codes == level].mean()) for level in levels]
    axes.hlines(means, levels - 0.3, levels + 0.3, color="black", linewidth=1.6, label=MEAN)


def _noise(axes: Axes, frame: pd.DataFrame, output: Axis) -> None:
    """Twice the noise on either side."""
    column = f"{output.name}_noise"
    level = float(np.nanmedian(frame[column])) if column in frame else np.nan
    for sign, label in ((1.0, "twice the noise"), (-1.0, None)) if isfinite(level) else ():
        axes.axhline(2.0 * sign * level, color="#555555", linestyle=":", linewidth=1.1, label=label)


def _places(column: pd.Series) -> tuple[NDArray[np.float64], list[str]]:
    """Places of measurements along an input; labels side by side in the order of appearance."""
    if pd.api.types.is_numeric_dtype(column):
        values = column.to_numpy(dtype=float)
        levels = np.unique(values)
        if len(levels) > FEW:
            return values, []
        return _spread_sideways(np.searchsorted(levels, values)), [f"{level:g}" for level in levels]
    codes, labels = pd.factorize(column.astype(str))
    shown = [str(label) for label in labels] if len(labels) <= 12 else []
    return _spread_sideways(codes) if shown else codes.astype(float), shown


def _spread_sideways(codes: NDArray[np.intp]) -> NDArray[np.float64]:
    """Places that spread the measurements of one label sideways instead of on one line."""
    shift = (np.arange(len(codes)) * GOLDEN) % 1.0
    return np.asarray(codes + 0.6 * (shift - 0.5))


def _titles(row: Sequence[Axes], result: GapResult, output: Axis) -> None:
    """The held-out RMSE of each column; none for a population, which has its distributions."""
    errors = [None if len(result.units) else gap.get(output.name) for gap in (result.gap_before, result.gap_after)]
    for axes, mark, error in zip(row, MARKS, (*errors, None), strict=True):
        text = "" if error is None else f": held-out {error:.3g} {output.unit}"
        axes.set_title(f"{mark.word}{text}", fontsize="small")
