"""The page of one run: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import pandas as pd

from ..records import Bars, RunResult
from .bars import bars_figure
from .convergence import convergence_figure
from .document import bullets, document, picture, section
from .drawing import flags
from .figure import front_figure
from .summary import summary_table
from .tables import chosen, table

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


def page(result: RunResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    sections = (
        section("Front", picture("front", front_figure(result), _front_caption(result))),
        section("In words", bullets(result.notes)),
        *(section("Effects", _moved(one)) for one in (result.moved,) if one is not None),
        section("References", _references(result)),
        section("Points of the front", _points(result)),
        section("Convergence", _convergence(result.convergence)),
        *(section("Sensitivity", _bars(result.bars)) for _ in result.bars[:1]),
        section("Assumptions", _assumptions(result.summary)),
        section("Summary", summary_table(result.summary)),
        section("Configuration", f"<pre>{escape(result.configuration)}</pre>"),
    )
    return document(result.title, "\n".join(sections))


def _bars(bars: Sequence[Bars]) -> str:
    pictures = [
        picture(f"bars{at}", bars_figure(one), f"{one.title} [{one.unit}]")
        for at, one in enumerate(bars)
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


def _moved(found: pd.DataFrame) -> str:
    marked = [label == "after" for label in found["allocation"]] if len(found) else []
    return f"<p>{escape(MOVED)}</p>\n{table(found, marked)}"


def _is_gain(name: str) -> bool:
    return name.endswith(("_saving_percent", "_gain_percent", "distance_to_front"))


def _points(result: RunResult) -> str:
    first = [axis.name for axis in (*result.objectives, *result.variables)]
    ordered = chosen(result.front, [*first, *map(str, result.front.columns)])
    return table(ordered, flags(ordered, "knee"), "Rounded; front.csv has all digits.")


def _convergence(found: pd.DataFrame) -> str:
    if found.empty:
        return "<p>None.</p>"
    caption = "Hypervolume in the fixed box of the problem, and share of feasible designs."
    return picture("convergence", convergence_figure(found), caption)


def _assumptions(summary: Mapping[str, Any]) -> str:
    found = pd.DataFrame(list(summary.get("assumptions") or ()))
    return "<p>Values in use that no document prints.</p>\n" + table(
        chosen(found, ASSUMPTION_COLUMNS)
    )
