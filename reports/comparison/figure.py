"""The figure of several fronts in one plane."""

from __future__ import annotations

from matplotlib.figure import Figure

from ...records import Comparison
from ..drawing import COLOURS, axis_label, new_figure, style_axes

MARKERS = "osD^vPX<>"
DASHES = ("-", "--", ":", "-.")


def comparison_figure(result: Comparison) -> Figure:
    """The fronts in the plane of the first two objectives, each with its own marker and line.

    With one objective, the best of each run on a line.
    """
    figure = new_figure()
    axes = figure.add_subplot()
    names = [axis.name for axis in result.objectives[:2]]
    for at, run in enumerate(result.runs):
        front = run.front.sort_values(names, kind="stable")
        y = front[names[1]] if len(names) > 1 else [float(at)] * len(front)
        line = DASHES[at % len(DASHES)] if len(result.objectives) == 2 else "none"
        axes.plot(
            front[names[0]],
            y,
            linestyle=line,
            linewidth=1.0,
            markersize=3.5,
            marker=MARKERS[at % len(MARKERS)],
            color=COLOURS[at % len(COLOURS)],
            markerfacecolor="white" if at % 2 else COLOURS[at % len(COLOURS)],
            label=f"{run.label}, {len(front)} points".lstrip("_"),
        )
    axes.set_xlabel(axis_label(result.objectives[0]))
    if len(names) > 1:
        axes.set_ylabel(axis_label(result.objectives[1]))
    else:
        axes.set_yticks([])
    axes.legend(frameon=False, fontsize="small")
    style_axes(axes)
    return figure
