"""The page of one run: a single HTML file that needs no network."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from ..records import Bars, RunResult
from .bars import bars_figure
from .convergence import convergence_figure
from .drawing import as_svg, flags
from .figure import front_figure
from .style import STYLE
from .tables import chosen, shown, table

ASSUMPTION_COLUMNS = ("name", "value", "unit", "reason", "set_by")
GAINS = (
    "Each reference against the front. cost_saving_percent: how much less the front costs where "
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
        _section("Front", _picture("front", front_figure(result), _front_caption(result))),
        _section("In words", _notes(result.notes)),
        *(_section("Effects", _moved(one)) for one in (result.moved,) if one is not None),
        _section("References", _references(result)),
        _section("Points of the front", _points(result)),
        _section("Convergence", _convergence(result.convergence)),
        *(_section("Sensitivity", _bars(result.bars)) for _ in result.bars[:1]),
        _section("Assumptions", _assumptions(result.summary)),
        _section("Summary", _summary(result.summary)),
        _section("Configuration", f"<pre>{escape(result.configuration)}</pre>"),
    )
    return _document(result.title, "\n".join(sections))


def _document(title: str, body: str) -> str:
    name = escape(title)
    policy = "default-src 'none'; style-src 'unsafe-inline'"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<h1>{name}</h1>\n{body}\n</body>\n</html>\n"
    )


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>"


def _picture(name: str, figure: Figure, caption: str) -> str:
    drawing = as_svg(figure).decode()
    drawing = drawing[drawing.index("<svg") :]
    # Two drawings on one page must not share identifiers.
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = re.sub(r'href="#', f'href="#{name}-', drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-")
    drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{escape(caption)}" ', 1)
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def _bars(bars: Sequence[Bars]) -> str:
    pictures = [
        _picture(f"bars{at}", bars_figure(one), f"{one.title} [{one.unit}]")
        for at, one in enumerate(bars)
    ]
    return "\n".join(pictures)


def _front_caption(result: RunResult) -> str:
    axes = " against ".join(axis.name for axis in result.objectives[:2])
    return (
        f"{axes}: {len(result.front)} points; references that meet the limits of the run are "
        "filled, those that break one are hollow."
    )


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return "<p>None.</p>"
    return "<ul>\n" + "\n".join(f"<li>{escape(note)}</li>" for note in notes) + "\n</ul>"


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
    return name.endswith(("_saving_percent", "_gain_percent"))


def _points(result: RunResult) -> str:
    first = [axis.name for axis in (*result.objectives, *result.variables)]
    ordered = chosen(result.front, [*first, *map(str, result.front.columns)])
    return table(ordered, flags(ordered, "knee"), "Rounded; front.csv has all digits.")


def _convergence(found: pd.DataFrame) -> str:
    if found.empty:
        return "<p>None.</p>"
    caption = "Hypervolume in the fixed box of the problem, and share of feasible designs."
    return _picture("convergence", convergence_figure(found), caption)


def _assumptions(summary: Mapping[str, Any]) -> str:
    found = pd.DataFrame(list(summary.get("assumptions") or ()))
    return "<p>Values in use that no document prints.</p>\n" + table(
        chosen(found, ASSUMPTION_COLUMNS)
    )


def _summary(summary: Mapping[str, Any]) -> str:
    rows = [(name, _flat(value)) for name, value in summary.items() if name != "assumptions"]
    return table(pd.DataFrame(rows, columns=["name", "value"], dtype=object))


def _flat(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_flat(part)}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_flat, value))
    return shown(value)
