"""Control charts of measured parts: single values in the order in which the parts were made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .drawing import COLOURS, new_figure, style_axes, with_unit

COLUMNS = 3
CHARTS = 12
"""Characteristics that are drawn at most."""
HEIGHT = 1.9
"""Height [inch] of a row of charts."""
NATURAL = 2.66
"""Mean moving ranges from the mean to a control limit: 3/1.128."""


def control_figure(parts: Sequence[tuple[str, str, Sequence[float]]]) -> Figure:
    """A chart of single values for each name, unit and values, `CHARTS` at most.

    Control limits lie 2.66 mean moving ranges from the mean (Shewhart 1931; ISO 7870-2).
    """
    shown = parts[:CHARTS]
    rows = -(-len(shown) // COLUMNS)
    figure = new_figure(height=HEIGHT * rows + 0.3)
    grid: Any = figure.subplots(rows, min(COLUMNS, len(shown)), squeeze=False)
    for at, axes in enumerate(grid.ravel()):
        if at < len(shown):
            _chart(axes, *shown[at])
        else:
            axes.set_visible(False)
    return figure


def _chart(axes: Axes, name: str, unit: str, values: Sequence[float]) -> None:
    measurements = np.asarray(values, dtype=float)
    mean, reach = float(measurements.mean()), NATURAL * float(np.abs(np.diff(measurements)).mean())
    number = np.arange(1, len(measurements) + 1)
    axes.plot(number, measurements, color=COLOURS[0], marker="o", markersize=2.5, linewidth=0.8)
    beyond = np.abs(measurements - mean) > reach
    axes.plot(number[beyond], measurements[beyond], "x", color=COLOURS[1], markersize=6)
    axes.axhline(mean, color="#555555", linewidth=0.8)
    for side in (-1.0, 1.0):
        axes.axhline(mean + side * reach, color=COLOURS[1], linewidth=0.8, linestyle="--")
    axes.set_title(with_unit(name, unit), fontsize="small")
    axes.tick_params(labelsize="x-small")
    style_axes(axes)
