"""What backlash means in a run: one unit, the population, and the costs of assumptions."""

from __future__ import annotations

from html import escape
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from ..records import RunResult
from .document import bullets, picture, section
from .drawing import COLOURS, flags, new_axes, style_axes
from .tables import chosen, described, shown

COST = (
    "Least cost at {level} when one assumption is changed and all others stay: the allocation is "
    "solved again from the point above, at its grade, on the sample of the search. In the first row "
    "nothing is changed, so that the differences from it are those of the assumption. No "
    "value of an assumption is the worst case; measured parts would replace it."
)
TURN = (
    "One unit of this allocation over one turn of the output: the unit whose largest backlash is the median of "
    "the population. unit_turn.csv has the values."
)
POPULATION = (
    "The population of units of this allocation by their largest backlash, with the quantile that the run reports "
    "and the limit. population.csv has the values."
)
HEIGHT = 3.4
"""Height [inch] of either figure."""


def unit_sections(result: RunResult) -> tuple[str, ...]:
    """The sections on units, none where the problem has no units."""
    sections = []
    units = result.summary.get("units")
    if isinstance(units, dict) and result.unit_turn is not None and result.population is not None:
        sections.append(section("What backlash means here", _meaning(result, units)))
    if result.assumptions_cost is not None:
        cost = _cost(result.assumptions_cost, result.summary.get("assumptions_at"))
        sections.append(section("Assumptions and their costs", cost))
    if result.summary.get("validity"):
        limits = bullets([str(sentence) for sentence in result.summary["validity"]])
        sections.append(section("Limits of validity", limits))
    return tuple(sections)


def _meaning(result: RunResult, units: dict[str, Any]) -> str:
    words = bullets([str(sentence) for sentence in units.get("words") or ()])
    values = ", ".join(
        f"{name.replace('_', ' ')} {shown(units[name])}"
        for name in ("cost", "yield_percent", "interference_probability")
        if name in units
    )
    point = f"Shown for {units.get('chosen', 'one point')} (point {shown(units.get('point'))} of front.csv): {values}."
    drawn = [picture("unit", turn_figure(result), TURN), picture("population", population_figure(result), POPULATION)]
    return "\n".join([words, f"<p>{escape(point)}</p>", *drawn])


def turn_figure(result: RunResult) -> Figure:
    """Backlash of one unit over the turn, with marks at the positions that count."""
    turn = result.unit_turn
    assert turn is not None
    figure, axes = new_axes(HEIGHT)
    counts = pd.Series(flags(turn, "measured"), index=turn.index)
    axes.plot(turn["turn_deg"], turn["backlash_arcmin"], linewidth=0.7, color=COLOURS[0], label="backlash of the unit")
    counted = turn[counts]
    label = f"{len(counted)} positions"
    axes.plot(counted["turn_deg"], counted["backlash_arcmin"], "o", markersize=3.0, color=COLOURS[1], label=label)
    if len(counted):
        largest = float(counted["backlash_arcmin"].max())
        axes.axhline(largest, color=COLOURS[1], linestyle="--", linewidth=1.0, label="largest of them")
    axes.set_xlim(0.0, 360.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("turn of the output [deg]")
    axes.set_ylabel("backlash [arcmin]")
    figure.legend(frameon=False, fontsize="small", ncols=3, loc="outside lower center")
    style_axes(axes)
    return figure


def population_figure(result: RunResult) -> Figure:
    """Units by their largest backlash: percentages and their sums, with the quantile and the limit."""
    population, units = result.population, dict(result.summary.get("units") or {})
    assert population is not None
    figure, axes = new_axes(HEIGHT)
    edges, percent = population["backlash_max_arcmin"], population["share_percent"].iloc[1:]
    axes.stairs(percent, edges, fill=True, color=COLOURS[0], alpha=0.45, label="units per step")
    axes.set_xlabel("largest backlash of a unit over the turn [arcmin]")
    axes.set_ylabel("units per step [%]")
    sums = axes.twinx()
    sums.plot(edges, population["share_within_percent"], color=COLOURS[0], linewidth=1.5, label="units within")
    sums.set_ylim(0.0, 104.0)
    sums.set_ylabel("units within [%]")
    marks = (
        ("quantile", f"{shown(units.get('coverage_percent'))} % of the units", "--", 1),
        ("limit", "limit", ":", 2),
    )
    for name, words, style, colour in marks:
        if isinstance(units.get(name), int | float):
            label = f"{words}: {shown(units[name])} arcmin"
            sums.axvline(float(units[name]), linestyle=style, color=COLOURS[colour], linewidth=1.4, label=label)
    lines = [panel.get_legend_handles_labels() for panel in (axes, sums)]
    handles, labels = lines[0][0] + lines[1][0], lines[0][1] + lines[1][1]
    figure.legend(handles, labels, frameon=False, fontsize="small", ncols=2, loc="outside lower center")
    style_axes(axes)
    sums.spines[["top"]].set_visible(False)
    return figure


def _cost(costs: pd.DataFrame, level: object) -> str:
    """The table, in which the row of the problem itself is marked, and cells without a value are empty."""
    words = {name: [shown(cell) for cell in costs[name]] for name in ("assumption", "value", "remark") if name in costs}
    names = ("assumption", "value", "cost", "change_percent", "remark")
    marked = [True] + [False] * (len(costs) - 1)
    levels = level.items() if isinstance(level, dict) else ()
    values = ", ".join(f"{name} {shown(value)}" for name, value in levels)
    text = COST.format(level=values or "the backlash of the point above")
    return described(text, chosen(costs.assign(**words), names), marked)
