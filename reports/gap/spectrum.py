"""Orders in the residual before and after: waves per turn of the output."""

from __future__ import annotations

from math import isfinite

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...gap_records import GapResult
from ...records import Axis
from ..drawing import new_figure, style_axes, with_unit
from .marks import AFTER, BEFORE, legend, shade

HIGHEST = 5
"""Peaks that are labelled with their order."""
WIDE = 0.75
"""Half-width of the mark at an order that was located."""


def spectrum_figure(result: GapResult, output: Axis) -> Figure | None:
    """Amplitude over order, before above and after below; None where there is no angle."""
    if result.spectrum.empty or "order" not in result.spectrum:
        return None
    rows = result.spectrum[result.spectrum["output"] == output.name].sort_values("order")
    if rows.empty:
        return None
    figure = new_figure(height=4.4)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    located = [region.order for region in result.where if region.output == output.name and isfinite(region.order)]
    for axes, mark in zip(panels, (BEFORE, AFTER), strict=True):
        for order in located:
            shade(axes, order - WIDE, order + WIDE)
        axes.vlines(rows["order"], 0.0, rows[mark.word], color=mark.colour, linewidth=1.0)
        if rows["threshold"].notna().any():
            label = "largest amplitude of noise alone"
            axes.plot(rows["order"], rows["threshold"], ":", color="black", linewidth=1.2, label=label)
        _label_peaks(axes, rows["order"].tolist(), rows[mark.word].tolist(), rows["threshold"].tolist())
        axes.set_ylabel(with_unit(mark.word, output.unit))
    panels[1].set_xlabel("order [waves per turn]")
    legend(figure, panels)
    for axes in panels:
        style_axes(axes)
    return figure


def _label_peaks(axes: Axes, orders: list[float], sizes: list[float], limits: list[float]) -> None:
    """The highest local peaks above the threshold."""
    inner = range(len(sizes))
    peaks = [at for at in inner if sizes[at] > limits[at] and sizes[at] == max(sizes[max(0, at - 4) : at + 5])]
    for at in sorted(peaks, key=lambda peak: -sizes[peak])[:HIGHEST]:
        axes.annotate(
            f"{orders[at]:g}",
            (orders[at], sizes[at]),
            fontsize="small",
            ha="center",
            va="bottom",
            xytext=(0, 1),
            textcoords="offset points",
        )
