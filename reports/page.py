"""The page of one run: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from ..records import Bars, RunResult, model_lines
from .bars import bars_figure
from .choices import choice_sections
from .convergence import RATIO, convergence_figure, drawn_column
from .document import about, bullets, document, folded, picture, remarked, section
from .drawing import flags
from .explorer import explorer, interactive, scripts
from .figure import front_figure
from .machine import machine_sections
from .plugin_sections import plugin_sections
from .promise import promise_sections
from .requirements import requirement_sections
from .summary import summary_table
from .tables import chosen, described, table
from .units import unit_sections

STILL = "This page shows the front by its scripts; front.png and front.svg are pictures of it."
LISTED = 60
"""Points of the front in the table at most."""
ASSUMPTION_COLUMNS = ("name", "value", "unit", "reason", "set_by")
GAINS = (
    "The references against the front. distance_to_front is the distance to the nearest point, in sides of the "
    "problem's box from ideal to nadir; cost_saving_percent states how much less the front costs where "
    "every other objective is at least as good, and ..._gain_percent how much better the front is at "
    "no more cost. relaxed_... is the same against a front whose broken limits are relaxed to the value "
    "of the reference; it is empty where no limit is broken."
)

MOVED = (
    "The change of the allocation by the effects in the model. For every level of the second objective the "
    "table has the cheapest point of the front without the effects (before), the values of the same design "
    "with them (kept), and the cheapest point with them (after). front_without_effects.csv has the "
    "whole front, allocation_moved.csv this table."
)


def page(result: RunResult, remarks: Sequence[str] = ()) -> str:
    """The whole page; every text that comes from outside is escaped.

    `remarks` report what is wrong with the files that it is built from.
    """
    scripted = interactive(result)
    parts = (
        *remarked(remarks),
        _model(result.summary),
        _front(result, scripted),
        section("In words", bullets(result.notes)) if result.notes else "",
        *unit_sections(result),
        *machine_sections(result.summary),
        *promise_sections(result),
        *requirement_sections(result),
        *choice_sections(result),
        *plugin_sections(result),
        section("Effects", _moved(result.moved)) if result.moved is not None else "",
        section("References", _references(result)) if len(result.references) else "",
        section("Points of the front", folded("Table", _points(result))) if len(result.front) else "",
        section("Convergence", _convergence(result.convergence)) if len(result.convergence) > 1 else "",
        section("Sensitivity", _bars(result.bars)) if result.bars else "",
        section("Assumptions", _assumptions(result.summary)) if result.summary.get("assumptions") else "",
        section("Summary", folded("summary.json", summary_table(result.summary))),
        section("Configuration", folded("config.toml", f"<pre>{escape(result.configuration)}</pre>")),
    )
    return document(result.title, parts, scripts() if scripted else (), _head(result))


def _head(result: RunResult) -> str:
    """The question and its answers in sentences."""
    answers = result.answers
    asked = f'<p class="asked">{escape(str(answers["asked"]))}</p>\n' if "asked" in answers else ""
    lines = about(result.summary)
    items = "".join(
        f'<li id="answer-{escape(name)}">{escape(str(text))}</li>' for name, text in answers.items() if name != "asked"
    )
    return f'{lines}{asked}<ul class="answers">{items}</ul>' if items else f"{lines}{asked}"


def _model(summary: Mapping[str, Any]) -> str:
    """The model that computes all results of the page; empty where there is only one."""
    lines = model_lines(summary)
    if not lines:
        return ""
    first = escape(lines[0].removeprefix("model: "))
    more = folded("The choices by other models", bullets(lines[1:])) if lines[1:] else ""
    return f'<p class="model"><strong>All numbers on this page are by {first}.</strong></p>\n{more}'


def _front(result: RunResult, scripted: bool) -> str:
    if scripted:
        return f"{explorer(result)}\n<noscript><p>{STILL}</p></noscript>"
    if not result.objectives:
        return ""
    return section("Front", picture("front", front_figure(result), _front_caption(result)))


def _bars(bars: Sequence[Bars]) -> str:
    return "\n".join(
        picture(f"bars{at}", bars_figure(chart), f"{chart.title} [{chart.unit}]") for at, chart in enumerate(bars)
    )


def _front_caption(result: RunResult) -> str:
    axes = " against ".join(axis.name for axis in result.objectives[:2])
    return (
        f"{axes}: {len(result.front)} points; references that meet the limits of the run are "
        "filled, those that break one are hollow."
    )


def _references(result: RunResult) -> str:
    endings = ("_saving_percent", "_gain_percent", "distance_to_front")
    gains = [name for name in map(str, result.references.columns) if name.endswith(endings)]
    axes = [axis.name for axis in result.objectives]
    short = chosen(result.references, ["label", "feasible", "violated_limits", *axes, *gains])
    full = f"<details><summary>All columns</summary>{table(result.references)}</details>"
    return f"{described(GAINS, short)}\n{full}"


def _moved(moved: pd.DataFrame) -> str:
    marked = [label == "after" for label in moved["allocation"]] if len(moved) else []
    return described(MOVED, moved, marked)


def _points(result: RunResult) -> str:
    first = [axis.name for axis in (*result.objectives, *result.variables)]
    ordered = chosen(result.front, [*first, *map(str, result.front.columns)])
    caption = "Rounded; front.csv has all digits."
    if len(ordered) > LISTED:
        some = np.linspace(0, len(ordered) - 1, LISTED).astype(int)
        kept = np.isin(np.arange(len(ordered)), some) | flags(ordered, "knee")
        ordered = ordered[kept]
        caption = f"{len(ordered)} of {len(result.front)} points, rounded; front.csv has all."
    return table(ordered, flags(ordered, "knee"), caption)


def _convergence(convergence: pd.DataFrame) -> str:
    caption = "Hypervolume in the fixed box of the problem, and fraction of feasible designs."
    if drawn_column(convergence) == RATIO:
        caption += " The dashed line is the exact front."
    return folded("Figure", picture("convergence", convergence_figure(convergence), caption))


def _assumptions(summary: Mapping[str, Any]) -> str:
    assumptions = pd.DataFrame(list(summary.get("assumptions") or ()))
    text = "These values are in use though nobody has stated them."
    return folded("Values in use", described(text, chosen(assumptions, ASSUMPTION_COLUMNS)))
