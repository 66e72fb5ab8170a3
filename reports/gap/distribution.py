"""Populations: the measured units, the model's and the corrected model's, as distributions."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...gap_records import GapResult
from ...records import Axis
from ..drawing import new_figure, style_axes
from .marks import AFTER, BEFORE, words

LINES = (
    ("measured", "measured", "black", "-", 2.2),
    ("before", "model before", BEFORE.colour, BEFORE.line, 1.5),
    ("after", "model after", AFTER.colour, "-.", 1.5),
)


def distribution_figure(result: GapResult, output: Axis) -> Figure | None:
    """Fractions of units below a value; None where the model describes no population."""
    if output.name not in set(result.units.get("output", ())):
        return None
    rows = result.units[result.units["output"] == output.name].sort_values("share")
    figure = new_figure(height=3.6)
    grid = figure.add_gridspec(1, 2, width_ratios=(3.0, 1.4))
    axes, distance_axes = (figure.add_subplot(grid[0, at]) for at in range(2))
    for name, label, colour, style, width in LINES:
        axes.step(rows[name], rows["share"], where="mid", color=colour, linestyle=style, linewidth=width, label=label)
    axes.set_xlabel(words(output.name, output.unit))
    axes.set_ylabel("fraction of units below")
    style_axes(axes, legend=True)
    _distances(distance_axes, result, output)
    return figure


def _distances(axes: Axes, result: GapResult, output: Axis) -> None:
    """The distance of the units from the model before and after, and the distance that chance causes."""
    distances = (result.gap_before[output.name], result.gap_after[output.name])
    axes.bar(["before", "after"], distances, width=0.5, color=[BEFORE.colour, AFTER.colour])
    axes.axhline(result.noise_floor[output.name], color="black", linestyle=":", linewidth=1.4, label="chance")
    axes.set_ylabel(words("distance from the population", output.unit))
    style_axes(axes, legend=True)
