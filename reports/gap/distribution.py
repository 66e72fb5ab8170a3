"""Populations: the measured units, the model's and the corrected model's, as distributions."""

from __future__ import annotations

from matplotlib.figure import Figure

from ...gap_records import GapResult
from ...records import Axis
from ..drawing import new_figure, plain
from .marks import AFTER, BEFORE, words

LINES = (
    ("measured", "measured", "black", "-", 2.2),
    ("before", "model before", BEFORE.colour, BEFORE.line, 1.5),
    ("after", "model after", AFTER.colour, "-.", 1.5),
)


def distribution_figure(result: GapResult, output: Axis) -> Figure | None:
    """Shares of units below a value; None where the model is of no population."""
    if output.name not in set(result.units.get("output", ())):
        return None
    rows = result.units[result.units["output"] == output.name].sort_values("share")
    figure = new_figure(height=3.6)
    axes = figure.add_subplot()
    for name, label, colour, style, width in LINES:
        axes.step(rows[name], rows["share"], where="mid", color=colour, linestyle=style,
                  linewidth=width, label=label)  # fmt: skip
    axes.set_xlabel(words(output.name, output.unit))
    axes.set_ylabel("share of units below")
    axes.legend(frameon=False, fontsize="small")
    plain(axes)
    return figure
