"""The page of one run: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from ..records import Bars, RunResult, mechanism_lines, model_lines
from .bars import bars_figure
from .choices import choice_sections
from .convergence import RATIO, convergence_figure, drawn_column
from .document import bullets, document, folded, picture, remarked, section
from .drawing import flags
from .explorer import explorer, interactive, scripts
from .figure import front_figure
from .machine import machine_sections
from .plugin_sections import plugin_sections
from .promise import promise_sections
from .requirements import requirement_sections
from .summary import summary_table
from .tables import chosen, table
from .units import unit_sections

STILL = "This page needs its scripts to show the front; front.png and front.svg are still pictures."
LISTED = 60
"""Points of the front in the table at most."""
ASSUMPTION_COLUMNS = ("name", "value", "unit", "reason", "set_by")
GAINS = (
    "Each reference against the front. distance_to_front: to its nearest point, in sides of the "
    "problem's box from ideal to nadir; cost_saving_percent: how much less the front costs where "
    "every other objective is at least as good; ..._gain_percent: how much better the front is at "
    "no more cost. relaxed_...: the same against a front whose broken limits are relaxed to the "
    "reference's own value; empty where nothing is broken."
)

MOVED = (
    "How the effects in the model move the allocation. At each level of the second objective the "
    "cheapest point of the front without the effects (before), what the same design comes to with "
    "them (kept), and the cheapest point with them (after). front_without_effects.csv has the "
    "whole front, allocation_moved.csv this table."
)


def page(result: RunResult, remarks: Sequence[str] = ()) -> str:
    """The whole page; every text that comes from outside is escaped.

    `remarks` are what was wrong with the files that it is built from.
    """
    scripted = interactive(result)
    more = (
        section("In words", bullets(result.notes)) if result.notes else "",
        *unit_sections(result),
        *machine_sections(result.summary),
        *promise_sections(result),
        *requirement_sections(result),
        *choice_sections(result),
        *plugin_sections(result),
        *(section("Effects", _moved(moved)) for moved in (result.moved,) if moved is not None),
        section("References", _references(result)) if len(result.references) else "",
        section("Points of the front", folded("Table", _points(result))) if len(result.front) else "",
        section("Convergence", folded("Figure", _convergence(result.convergence)))
        if len(result.convergence) > 1
        else "",
        *(section("Sensitivity", _bars(result.bars)) for _ in result.bars[:1]),
        section("Assumptions", folded("Values in use", _assumptions(result.summary)))
        if result.summary.get("assumptions")
        else "",
        section("Summary", folded("summary.json", summary_table(result.summary))),
        section("Configuration", folded("config.toml", _verbatim(result.configuration))),
    )
    sections = (*remarked(remarks), _model(result.summary), _front(result, scripted), *more)
    body = "\n".join(part for part in sections if part)
    return document(result.title, body, scripts() if scripted else (), _head(result))


def _head(result: RunResult) -> str:
    """What was asked and what was found, in sentences."""
    answers = result.answers
    asked = f'<p class="asked">{escape(str(answers["asked"]))}</p>\n' if "asked" in answers else ""
    lines = "".join(f"<p>{escape(line)}</p>\n" for line in mechanism_lines(result.summary))
    items = "".join(
        f'<li id="answer-{escape(name)}">{escape(str(text))}</li>' for name, text in answers.items() if name != "asked"
    )
    return f'{lines}{asked}<ul class="answers">{items}</ul>' if items else f"{lines}{asked}"


def _model(summary: Mapping[str, Any]) -> str:
    """The one of several models that computed everything below; empty where there is only one."""
    lines = model_lines(summary)
    if not lines:
        return ""
    first = escape(lines[0].removeprefix("model: "))
    more = folded("What other models say of the choices", bullets(lines[1:])) if lines[1:] else ""
    return f'<p class="model"><strong>Every number here is of {first}.</strong></p>\n{more}'


def _verbatim(text: str) -> str:
    return f"<pre>{escape(text)}</pre>"


def _front(result: RunResult, scripted: bool) -> str:
    if scripted:
        return f"{explorer(result)}\n<noscript><p>{STILL}</p></noscript>"
    if not result.objectives:
        return ""
    return section("Front", picture("front", front_figure(result), _front_caption(result)))


def _bars(bars: Sequence[Bars]) -> str:
    pictures = [
        picture(f"bars{at}", bars_figure(chart), f"{chart.title} [{chart.unit}]") for at, chart in enumerate(bars)
    ]
    return "\n".join(pictures)


def _front_caption(result: RunResult) -> str:
    axes = " against ".join(axis.name for axis in result.objectives[:2])
    return (
        f"{axes}: {len(result.front)} points; references that meet the limits of the run are "
        "filled, those that break one are hollow."
    )


def _references(result: RunResult) -> str:
    if result.references.empty:
        return "<p>None.</p>"
    gains = [name for name in map(str, result.references.columns) if _is_gain(name)]
    axes = [axis.name for axis in result.objectives]
    names = ["label", "feasible", "violated_limits", *axes, *gains]
    short = table(chosen(result.references, names))
    full = f"<details><summary>All columns</summary>{table(result.references)}</details>"
    return f"<p>{escape(GAINS)}</p>\n{short}\n{full}"


def _moved(moved: pd.DataFrame) -> str:
    marked = [label == "after" for label in moved["allocation"]] if len(moved) else []
    return f"<p>{escape(MOVED)}</p>\n{table(moved, marked)}"


def _is_gain(name: str) -> bool:
    return name.endswith(("_saving_percent", "_gain_percent", "distance_to_front"))


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
    if convergence.empty:
        return "<p>None.</p>"
    caption = "Hypervolume in the fixed box of the problem, and fraction of feasible designs."
    if drawn_column(convergence) == RATIO:
        caption += " Dashed: the exact front."
    return picture("convergence", convergence_figure(convergence), caption)


def _assumptions(summary: Mapping[str, Any]) -> str:
    assumptions = pd.DataFrame(list(summary.get("assumptions") or ()))
    return "<p>Values in use that nobody has stated.</p>\n" + table(chosen(assumptions, ASSUMPTION_COLUMNS))
