"""Bar charts of a problem: which source matters how much."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..records import Bars
from .drawing import new_axes, style_axes, with_unit

HEIGHT = 0.22
"""Height [inch] of a bar with its distance from the next."""


def bars_figure(bars: Bars) -> Figure:
    """One horizontal bar per label, in the order given, from the top."""
    figure, axes = new_axes(height=1.2 + HEIGHT * len(bars.labels))
    places = range(len(bars.labels))
    axes.barh(places, bars.values, color="#1f5fa8", height=0.7)
    axes.set_yticks(places, [label.replace("_", " ") for label in bars.labels], fontsize="small")
    axes.invert_yaxis()
    axes.set_xlabel(with_unit(bars.title, bars.unit))
    style_axes(axes)
    return figure
