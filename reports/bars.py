"""Bar charts of a problem: which source matters how much."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..records import Bars
from .drawing import new_figure, style_axes

HEIGHT = 0.22
"""Height [inch] of a bar with its distance from the next."""


def bars_figure(bars: Bars) -> Figure:
    """One horizontal bar per label, in the order given, from the top."""
    figure = new_figure(height=1.2 + HEIGHT * len(bars.labels))
    axes = figure.add_subplot()
    places = range(len(bars.labels))
    axes.barh(places, bars.values, color="#1f5fa8", height=0.7)
    axes.set_yticks(places, [label.replace("_", " ") for label in bars.labels], fontsize="small")
    axes.invert_yaxis()
    axes.set_xlabel(f"{bars.title} [{bars.unit}]" if bars.unit else bars.title)
    style_axes(axes)
    return figure
