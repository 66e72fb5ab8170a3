"""The figure of what contributes to an objective at a chosen point."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..records import RunResult
from .drawing import COLOURS, new_figure, style_axes, words
from .tolerances import bar_places, first_choice

HEIGHT = 0.24
"""Height [inch] of a bar with its distance from the next."""


def contributions_figure(result: RunResult) -> Figure | None:
    """Shares of every free tolerance at the first choice, one panel per objective but the cost.

    A bar that reaches to the left is of a tolerance that is better when wider. None where the run
    has no choice or no contributions.
    """
    point, contributions = first_choice(result), result.contributions
    if point is None or contributions is None or contributions.empty:
        return None
    names = [str(n) for n in contributions.columns if n not in ("point", "output", "explained")]
    nearest = (contributions["point"] - point).abs()
    rows = contributions[nearest == nearest.min()]
    figure = new_figure(height=1.0 + len(rows) * (0.6 + HEIGHT * len(names)))
    panels = figure.subplots(len(rows), 1, squeeze=False)
    for axes, row in zip(panels.flat, rows.to_dict("records"), strict=True):
        shares = [float(row[name]) for name in names]
        axes.barh(range(len(names)), shares, color=COLOURS[0], height=0.7)
        bar_places(axes, [words(name) for name in names])
        by = "" if row["explained"] == row["output"] else f", by {words(row['explained'])}"
        axes.set_xlabel(f"share in {words(row['output'])}{by} [%]")
        axes.axvline(0.0, color="black", linewidth=0.8)
        style_axes(axes)
    return figure
