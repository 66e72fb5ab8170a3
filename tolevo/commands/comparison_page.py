"""Page of several runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from ..page.document import (
    bullets,
    data,
    described,
    document,
    package_scripts,
    picture,
    remarks_section,
    section,
    table,
)
from ..page.drawing import COLOURS, axis_label, new_axes, style_axes, words
from ..page.explorer import MAX_POINTS, thin_points
from ..records import Axis, Comparison

__all__ = ["comparison_page"]

# The figure of several fronts in one plane.


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


# The page of several runs: a single HTML file that needs no network.


EQUAL_VALUE_TEXT = (
    "The cost of the cheapest point of every run at the same level of the other objective, for the "
    "levels that all runs reach."
)


def comparison_page(result: Comparison, remarks: Sequence[str] = ()) -> str:
    """The whole page; every text that comes from outside is escaped.

    `remarks` report what is wrong with the files that it is built from.
    """
    sections = (
        *remarks_section(remarks),
        section("Fronts", _fronts(result)),
        section("Hypervolume", table(result.table)),
        section("Cost at equal value", described(EQUAL_VALUE_TEXT, result.equal)),
        section("Notes", bullets(result.notes)),
    )
    scripts = (package_scripts("common.js", "chart.js", "comparison.js"),)
    return document(result.title, sections, scripts)


def _fronts(result: Comparison) -> str:
    caption = "The fronts in the plane of the first two objectives."
    still = picture("fronts", comparison_figure(result), caption)
    per_run = MAX_POINTS // len(result.runs)
    rule = f'<p class="hint">At most {per_run} points of each run, evenly along its front.</p>'
    plots = f'<div id="plots"></div>\n{data(_content(result, per_run))}'
    return f"{rule}{plots}\n<noscript>{still}</noscript>"


def _content(result: Comparison, per_run: int) -> dict[str, Any]:
    names = [axis.name for axis in result.objectives]
    return {
        "objectives": [_axis(axis) for axis in result.objectives],
        "runs": [
            {
                "label": run.label,
                "aims": [
                    run.front.reset_index(drop=True).iloc[thin_points(run.front, names, [], per_run)][n].tolist()
                    for n in names
                ],
            }
            for run in result.runs
        ],
    }


def _axis(axis: Axis) -> dict[str, str]:
    return {"name": axis.name, "label": words(axis.name), "unit": axis.unit}
