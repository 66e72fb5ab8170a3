"""The page of several runs: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...records import Axis, Comparison
from ..document import bullets, document, picture, remarked, section
from ..drawing import words
from ..explorer import MOST, thinned
from ..scripts import data, package_scripts
from ..tables import described, table
from .figure import comparison_figure

EQUAL = (
    "The cost of the cheapest point of every run at the same level of the other objective, for the "
    "levels that all runs reach."
)


def comparison_page(result: Comparison, remarks: Sequence[str] = ()) -> str:
    """The whole page; every text that comes from outside is escaped.

    `remarks` report what is wrong with the files that it is built from.
    """
    sections = (
        *remarked(remarks),
        section("Fronts", _fronts(result)),
        section("Hypervolume", table(result.table)),
        section("Cost at equal value", described(EQUAL, result.equal)),
        section("Notes", bullets(result.notes)),
    )
    scripts = (package_scripts("common.js", "chart.js", "comparison.js"),)
    return document(result.title, sections, scripts)


def _fronts(result: Comparison) -> str:
    caption = "The fronts in the plane of the first two objectives."
    still = picture("fronts", comparison_figure(result), caption)
    per_run = MOST // len(result.runs)
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
                    run.front.reset_index(drop=True).iloc[thinned(run.front, names, [], per_run)][n].tolist()
                    for n in names
                ],
            }
            for run in result.runs
        ],
    }


def _axis(axis: Axis) -> dict[str, str]:
    return {"name": axis.name, "label": words(axis.name), "unit": axis.unit}
