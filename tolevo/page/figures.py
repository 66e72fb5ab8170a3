"""The figures of a run: Pareto front, allocation, contributions, convergence and populations, with the
allocations to order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..records import RunResult
from ..units import drawing_number
from .document import bullets, chosen, described, picture, section, shown
from .drawing import COLOURS, as_png, as_svg, axis_label, flags, new_axes, new_figure, style_axes, words

FRONT_COLOUR, *REFERENCE_COLOURS = COLOURS
OVERLAY_COLOUR = "#555555"
OVERLAY_LINES = ("o--", "o:", "o-.")
MARKERS = "s^DvPX<>"
"""Eight markers and five colours: forty references before a pair repeats."""


def front_figure(result: RunResult) -> Figure:
    """The front in the plane of its first two objectives; one objective on a line."""
    figure, axes = new_axes()
    if len(result.objectives) > 1:
        _draw_plane(axes, result)
    else:
        _draw_line(axes, result)
    drawn = bool(axes.get_legend_handles_labels()[0])
    if not drawn:
        unfinished = result.summary.get("status") == "unfinished"
        message = "no front yet" if unfinished else "no feasible point"
        axes.text(0.5, 0.5, message, ha="center", transform=axes.transAxes)
    style_axes(axes, legend=drawn)
    return figure


def pictures(result: RunResult) -> dict[str, bytes]:
    """`front.svg` and `front.png`, by name."""
    figure = front_figure(result)
    return {"front.svg": as_svg(figure), "front.png": as_png(figure)}


def _draw_plane(axes: Axes, result: RunResult) -> None:
    x, y = result.objectives[:2]
    axes.set_xlabel(axis_label(x))
    axes.set_ylabel(axis_label(y))
    if len(result.objectives) > 2:
        axes.set_title("projection: there are further objectives", fontsize="small")
    if (before := result.before) is not None and not before.empty:  # the model without its effects
        front = before.sort_values([x.name, y.name])
        label = f"without effects, {len(front)} points"
        axes.plot(front[x.name], front[y.name], "o:", linewidth=1.0, markersize=2.0, color="#777777", label=label)
    exact = result.exact_front
    if exact is not None and len(result.objectives) == 2 and {x.name, y.name} <= set(exact):
        axes.plot(exact[x.name], exact[y.name], "-.", linewidth=2.5, color="#999999", zorder=1.5, label="exact front")
    _draw_overlays(axes, result, x.name, y.name)
    if not result.front.empty:
        _draw_front(axes, result, x.name, y.name)
    for at, (_, row) in enumerate(result.references.iterrows()):
        _draw_reference(axes, row, at, float(row[x.name]), float(row[y.name]))


def _draw_front(axes: Axes, result: RunResult, x: str, y: str) -> None:
    front = result.front.sort_values([x, y])
    line, label = "o-" if len(result.objectives) == 2 else "o", f"front, {len(front)} points"
    axes.plot(front[x], front[y], line, linewidth=1.0, markersize=3.0, color=FRONT_COLOUR, label=label)
    _draw_bound(axes, front, x, y)
    knee = front[flags(front, "knee")]
    if not knee.empty:
        axes.plot(knee[x], knee[y], "*", markersize=14, color=FRONT_COLOUR, markeredgecolor="white", label="knee")


def _draw_overlays(axes: Axes, result: RunResult, x: str, y: str) -> None:
    """Fronts of other algorithms, thin and hollow behind that of the run."""
    for at, (label, overlay) in enumerate(result.overlays.items()):
        if overlay.empty or not {x, y} <= set(overlay):
            continue
        front = overlay.sort_values([x, y])
        axes.plot(
            front[x],
            front[y],
            OVERLAY_LINES[at % len(OVERLAY_LINES)] if len(result.objectives) == 2 else "o",
            linewidth=0.8,
            markersize=3.0,
            markerfacecolor="none",
            color=OVERLAY_COLOUR,
            zorder=1.8,
            label=_legend_text(f"{label}, {len(front)} points", feasible=True),
        )


def _draw_bound(axes: Axes, front: pd.DataFrame, x: str, y: str) -> None:
    """The proven bounds of the costs, where there are any: no point can lie beyond them."""
    if "cost" not in (x, y) or "bound" not in front or not front["bound"].notna().any():
        return
    at_bound = front.assign(cost=front["bound"])
    label = "proven bound of the cost"
    axes.plot(at_bound[x], at_bound[y], "--", linewidth=1.0, color="black", zorder=3, label=label)


def _draw_line(axes: Axes, result: RunResult) -> None:
    """With one objective, the optimum and below it the references, a row for each."""
    if not result.objectives:
        return
    name = result.objectives[0].name
    rows = len(result.references)
    axes.set_xlabel(axis_label(result.objectives[0]))
    axes.set_yticks([])
    if not result.front.empty:
        heights = [rows] * len(result.front)
        axes.plot(result.front[name], heights, "*", markersize=12, color=FRONT_COLOUR, label="best found")
    for at, (_, row) in enumerate(result.references.iterrows()):
        _draw_reference(axes, row, at, float(row[name]), float(rows - 1 - at))


def _draw_reference(axes: Axes, row: pd.Series, at: int, x: float, y: float) -> None:
    """Filled where it meets the limits of the run, hollow where it breaks one."""
    feasible = flags(row.to_frame().T, "feasible")[0]
    colour = REFERENCE_COLOURS[at % len(REFERENCE_COLOURS)]
    axes.plot(
        [x],
        [y],
        MARKERS[at % len(MARKERS)],
        markersize=8,
        markerfacecolor=colour if feasible else "white",
        markeredgecolor=colour,
        label=_legend_text(str(row["label"]), feasible),
    )


def _legend_text(label: str, feasible: bool) -> str:
    shown = label.lstrip("_") or "reference"  # matplotlib hides labels that begin with _
    return shown if feasible else f"{shown} (breaks limits)"


# The figure of a chosen allocation in comparison with the allocation of a document.


TOLERANCES_HEIGHT = 0.3
"""Height [inch] of a variable."""


def first_choice(result: RunResult) -> int | None:
    """Row of the front that the first rule chooses."""
    if result.choices is None or result.choices.empty:
        return None
    return int(result.choices["point"].iloc[0])


def bar_places(axes: Axes, labels: Sequence[str]) -> None:
    """One label per bar, from the top."""
    axes.set_yticks(range(len(labels)), labels, fontsize="small")
    axes.invert_yaxis()


def tolerances_figure(result: RunResult) -> Figure | None:
    """Every positive number of the first choice over that of the first reference; without one, as
    it is, on a logarithmic axis. None where nothing is chosen.
    """
    point = first_choice(result)
    if point is None or point >= len(result.front):
        return None
    row, reference = result.front.iloc[point], None if result.references.empty else result.references.iloc[0]
    kept = [
        axis
        for axis in result.variables
        if _has_positive_value(row, axis.name) and (reference is None or _has_positive_value(reference, axis.name))
    ]
    if not kept:
        return None
    values = [float(row[axis.name]) for axis in kept]
    figure, axes = new_axes(height=1.1 + TOLERANCES_HEIGHT * len(kept))
    if reference is None:
        axes.barh(range(len(kept)), values, color=COLOURS[0], height=0.7)
        axes.set_xscale("log")
        axes.set_xlabel("value in the unit of the variable")
        bar_places(axes, [f"{words(axis.name)} [{axis.unit or '1'}]" for axis in kept])
    else:
        shares = [value / float(reference[axis.name]) for value, axis in zip(values, kept, strict=True)]
        axes.barh(range(len(kept)), shares, color=COLOURS[0], height=0.7)
        axes.axvline(1.0, color="black", linestyle="--", linewidth=1.0)
        axes.set_xlabel(
            f"{result.choices['choice'].iloc[0]} / {reference['label']}" if result.choices is not None else ""
        )
        bar_places(
            axes,
            [f"{words(axis.name)}, {value:.3g} {axis.unit}".rstrip() for value, axis in zip(values, kept, strict=True)],
        )
    style_axes(axes)
    return figure


def _has_positive_value(row: Any, name: str) -> bool:
    value = pd.to_numeric(row.get(name), errors="coerce")
    return bool(value > 0.0)


# The figure of what contributes to an objective at a chosen point.


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


# The allocations to order: chosen points that round to the same values share an order.


COLUMNS = {
    "variable": "tolerance",
    "meaning": "meaning",
    "notation": "on the drawing",
    "nominal": "nominal",
    "upper_deviation": "upper deviation",
    "lower_deviation": "lower deviation",
    "upper_limit": "upper limit",
    "lower_limit": "lower limit",
    "unit": "unit",
    "grade": "grade, class",
    "symbol": "symbol",
    "process": "process",
    "roughness_Ra_um": "Ra [um]",
    "cpk_wanted": "Cpk wanted",
    "inspection": "inspection",
    "unrounded": "before rounding",
    "rounded": "value",
    "drawing": "drawing",
    "characteristic": "characteristic",
    "source": "source",
}
"""Columns of an order by those of `allocation.csv`."""
SIZES = ("nominal", "upper deviation", "lower deviation", "upper limit", "lower limit", "value")
"""Columns whose numbers go on a drawing, with all their digits."""
DRAWN = (
    "tolerance",
    "on the drawing",
    "upper deviation",
    "lower deviation",
    "nominal",
    "unit",
    "grade, class",
    "symbol",
    "process",
    "Ra [um]",
    "Cpk wanted",
    "inspection",
    "source",
)
"""Columns of the sheet of an order."""
ALONE = "only"
"""The rule that chooses the one point of a run."""


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """A rounded allocation: the rules that choose it, the points of the front that round to it,
    a row per tolerance, and its cost and other values (a row of `choices.csv`).
    """

    rules: tuple[str, ...]
    points: tuple[int, ...]
    table: pd.DataFrame
    outcome: dict[str, object]

    @property
    def title(self) -> str:
        """The first rule in words, and how many more."""
        first = self.rules[0].replace("_", " ")
        more = len(self.rules) - 1
        if self.rules == (ALONE,):
            return "the allocation"
        return f"{first} and {more} more rules" if more > 1 else ", ".join(self.rules).replace("_", " ")

    @property
    def note(self) -> str:
        """All rules that choose it, and the points of the front."""
        if self.rules == (ALONE,):
            return "The one allocation of this run, rounded to what can be ordered."
        rules = ", ".join(rule.replace("_", " ") for rule in self.rules)
        points = " and ".join(str(point + 1) for point in self.points)
        if len(self.points) == 1:
            return f"Chosen by: {rules} (allocation {points} of the front)."
        return f"Chosen by: {rules}; the allocations {points} of the front round to this one."

    @property
    def verdict(self) -> str:
        """Whether the rounded allocation keeps all limits; empty where it is not known."""
        broken = self.outcome.get("rounded_violated_limits")
        if self.outcome.get("rounded_feasible"):
            return "; keeps all limits"
        return f"; breaks {broken}" if _has_value(broken) else ""

    @property
    def drawn(self) -> pd.DataFrame:
        """The table with every number that goes on a drawing as it is written there."""
        texts = self.table.copy()
        for name in set(SIZES) & set(texts):
            written: list[object] = [
                drawing_number(float(value)) if isinstance(value, Real) and _has_value(value) else value
                for value in texts[name]
            ]
            texts[name] = pd.Series(written, index=texts.index, dtype=object)
        return texts

    @property
    def sheet(self) -> pd.DataFrame:
        """What a drawing needs of every tolerance, its name in words."""
        parts = self.drawn[~self.table["tolerance"].astype(str).str.endswith("_process")]
        words = parts["tolerance"].map(lambda name: str(name).removesuffix("_t").replace("_", " "))
        return parts.assign(tolerance=words)[[name for name in DRAWN if name in parts]]


def orders(result: RunResult) -> list[Order]:
    """The orders of a run, in the order of its choices."""
    allocation, choices = result.allocation, result.choices
    if allocation is None or choices is None or not {"point", "variable", "rounded"} <= set(allocation):
        return []
    merged: dict[tuple[str, ...], list[int]] = {}
    for point, rows in allocation.groupby("point", sort=False):
        merged.setdefault(tuple(map(str, rows["rounded"])), []).append(int(str(point)))
    return [_order(points, allocation, choices) for points in merged.values()]


def _order(points: list[int], allocation: pd.DataFrame, choices: pd.DataFrame) -> Order:
    tolerances = allocation[allocation["point"] == points[0]]
    kept = [name for name in COLUMNS if name in tolerances and any(map(_has_value, tolerances[name]))]
    table = tolerances[kept].rename(columns=COLUMNS).reset_index(drop=True)
    rows = choices[choices["point"].isin(points)]
    outcome = {str(k): v for k, v in rows.iloc[0].items()} if len(rows) else {}
    rules = tuple(map(str, rows["choice"])) or (f"point {points[0]}",)
    return Order(rules, tuple(points), table, outcome)


def _has_value(value: object) -> bool:
    """Whether a cell is not empty."""
    return value is not None and value is not pd.NA and value == value and value != ""


def comparison(result: RunResult, allocations: list[Order]) -> pd.DataFrame:
    """The orders side by side, with their values before and after rounding."""
    rows = []
    for at, order in enumerate(allocations, start=1):
        row: dict[str, object] = {
            "sheet": f"{at} {order.title}"[:31],
            "chosen by": ", ".join(order.rules),
            "points": ", ".join(map(str, order.points)),
        }
        for axis in result.objectives:
            row[f"{axis.name} before"] = order.outcome.get(axis.name)
            row[f"{axis.name} rounded"] = order.outcome.get(f"rounded_{axis.name}")
        row["keeps all limits"] = order.outcome.get("rounded_feasible")
        row["breaks"] = order.outcome.get("rounded_violated_limits")
        rows.append(row)
    return pd.DataFrame(rows)


# The figure of how a run converged.


RATIO = "hypervolume_ratio"
"""Hypervolume over that of the exact front."""


def convergence_figure(table: pd.DataFrame) -> Figure:
    """Hypervolume (its ratio to the exact front where known) and feasible fraction, by evaluations."""
    figure = new_figure(height=3.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    name = drawn_column(table)
    if not table.empty:
        upper.plot(table["evaluations"], table[name], color="#1f5fa8", linewidth=1.2)
        lower.plot(table["evaluations"], table["feasible_fraction"], color="#c4501b", linewidth=1.2)
        if name == RATIO:
            upper.axhline(1.0, color="black", linestyle="--", linewidth=1.0)
    upper.set_ylabel(name.replace("_", " "))
    lower.set_ylabel("feasible fraction")
    lower.set_ylim(-0.05, 1.05)
    lower.set_xlabel("evaluations")
    for axes in (upper, lower):
        style_axes(axes)
    return figure


def drawn_column(table: pd.DataFrame) -> str:
    """Name of the column that is drawn."""
    return RATIO if RATIO in table and bool(table[RATIO].notna().any()) else "hypervolume"


# What backlash means in a run: one unit, the population, and the costs of assumptions.


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
TORQUE = (
    "Rotation of the output by its torque with the input held, mean over the turn: the torque-rotation curve of the "
    "unit of median lost motion and of that at the coverage; marks at +-3 % of the rated torque, between which lost "
    "motion is taken. Friction, which opens a measured curve to a loop, is not in it. torque_rotation.csv has the "
    "values."
)
UNITS_HEIGHT = 3.4
"""Height [inch] of either figure."""


def unit_sections(result: RunResult) -> tuple[str, ...]:
    """The sections on units, none where the problem has no units."""
    sections = []
    units = result.summary.get("units")
    if isinstance(units, dict) and result.unit_turn is not None and result.population is not None:
        sections.append(section("What backlash means here", _meaning(result, units)))
    if result.torque_rotation is not None:
        sections.append(section("Torque and rotation", picture("torque", torque_figure(result), TORQUE)))
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
    figure, axes = new_axes(UNITS_HEIGHT)
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
    figure, axes = new_axes(UNITS_HEIGHT)
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
    for name, meaning, style, colour in marks:
        if isinstance(units.get(name), int | float):
            label = f"{meaning}: {shown(units[name])} arcmin"
            sums.axvline(float(units[name]), linestyle=style, color=COLOURS[colour], linewidth=1.4, label=label)
    lines = [panel.get_legend_handles_labels() for panel in (axes, sums)]
    handles, labels = lines[0][0] + lines[1][0], lines[0][1] + lines[1][1]
    figure.legend(handles, labels, frameon=False, fontsize="small", ncols=2, loc="outside lower center")
    style_axes(axes)
    sums.spines[["top"]].set_visible(False)
    return figure


def torque_figure(result: RunResult) -> Figure:
    """Rotation by torque of two units, with marks at the torques of lost motion."""
    curve, units = result.torque_rotation, dict(result.summary.get("units") or {})
    assert curve is not None
    figure, axes = new_axes(UNITS_HEIGHT)
    coverage = shown(units.get("coverage_percent", "high"))
    marked = curve[pd.Series(flags(curve, "lost_motion"), index=curve.index)]
    for name, which, colour in (("median", "median", 0), ("high", f"{coverage} %", 1)):
        column = f"rotation_{name}_arcmin"
        lost = np.ptp(marked[column].to_numpy(dtype=float)) if len(marked) else np.nan
        label = f"unit of {which} lost motion: {shown(float(lost))} arcmin"
        axes.plot(curve["torque_Nm"], curve[column], linewidth=1.2, color=COLOURS[colour], label=label)
        axes.plot(marked["torque_Nm"], marked[column], "o", markersize=4.0, color=COLOURS[colour])
    axes.axhline(0.0, color="0.7", linewidth=0.6, zorder=0)
    axes.axvline(0.0, color="0.7", linewidth=0.6, zorder=0)
    axes.set_xlabel("torque of the output [N m]")
    axes.set_ylabel("rotation [arcmin]")
    figure.legend(frameon=False, fontsize="small", ncols=2, loc="outside lower center")
    style_axes(axes)
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
