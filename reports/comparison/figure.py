"""The figure of several fronts in one plane."""

from __future__ import annotations

from matplotlib.figure import Figure

from ...records import Comparison
from ..drawing import COLOURS, axis_label, new_axes, style_axes

MARKERS = "osD^vPX<>"
DASHES = ("-", "--", ":", "-.")


def comparison_figure(result: Comparison) -> Figure:
    """The fronts in the plane of the first two objectives, each with its own marker and line.

    With one objective, the best points of each run have a row.
    """
    figure, axes = new_axes()
    names = [axis.name for axis in result.objectives[:2]]
    for at, run in enumerate(result.runs):
        front = run.front.sort_values(names, kind="stable")
        y = front[names[1]] if len(names) > 1 else [float(at)] * len(front)
        line = DASHES[at % len(DASHES)] if len(result.objectives) == 2 else ""
        colour = COLOURS[at % len(COLOURS)]
        axes.plot(
            front[names[0]],
            y,
            MARKERS[at % len(MARKERS)] + line,
            linewidth=1.0,
            markersize=3.5,
            color=colour,
            markerfacecolor="white" if at % 2 else colour,
            label=f"{run.label}, {len(front)} points".lstrip("_"),
        )
    axes.set_xlabel(axis_label(result.objectives[0]))
    if len(names) > 1:
        axes.set_ylabel(axis_label(result.objectives[1]))
    else:
        axes.set_yticks([])
    style_axes(axes, legend=True)
    return figure
