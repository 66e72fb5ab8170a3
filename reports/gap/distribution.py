"""Populations: the measured units, the model's and the corrected model's, as distributions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ...gap_records import GapResult
from ...records import Axis
from ..drawing import new_figure, plain
from .marks import AFTER, BEFORE, words
from .residuals import thinned


def distribution_figure(result: GapResult, output: Axis) -> Figure | None:
    """Shares of units below a value; None where a column of it is missing."""
    lines = (
        (output.name, "measured", "black", "-", 2.2),
        (f"{output.name}_predicted", "model before", BEFORE.colour, BEFORE.line, 1.5),
        (f"{output.name}_corrected", "model after", AFTER.colour, "-.", 1.5),
    )
    if any(name not in result.residuals for name, *_ in lines):
        return None
    figure = new_figure(height=3.6)
    axes = figure.add_subplot()
    for name, label, colour, style, width in lines:
        values = thinned(result.residuals[[name]].dropna().sort_values(name))[name].to_numpy()
        axes.step(values, (np.arange(len(values)) + 0.5) / max(len(values), 1), where="mid",
                  color=colour, linestyle=style, linewidth=width, label=label)  # fmt: skip
    axes.set_xlabel(words(output.name, output.unit))
    axes.set_ylabel("share of units below")
    axes.legend(frameon=False, fontsize="small")
    plain(axes)
    return figure
