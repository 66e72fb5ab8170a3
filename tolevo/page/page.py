"""The page of one run: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import starmap
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InputError
from ..records import SECTIONS, Bars, RunResult, model_lines, unit_of_cost
from ..registry import PLUGIN_FAULTS, origin
from ..section import Array
from ..units import split_unit
from .document import (
    about,
    bullets,
    chosen,
    declared_tables,
    described,
    document,
    folded_section,
    picture,
    remarks_section,
    requirements_view,
    section,
    shown,
    table,
)
from .drawing import COLOURS, bars_figure, flags, label_with_unit, new_figure, style_axes
from .explorer import configured, explorer, has_front, scripts
from .figures import (
    RATIO,
    contributions_figure,
    convergence_figure,
    drawn_column,
    front_figure,
    orders,
    population_figure,
    tolerances_figure,
    torque_figure,
    turn_figure,
    unit_sections,
)

# The chosen points of a run, their rounded values, and how sensitive the choices are to costs.


CHOICES = (
    "Points of the front that are chosen by rules; [choice] in the configuration sets weights, limits and a "
    "budget. rounded_... is the same point with every value rounded to one that can be ordered, computed "
    "again by the full model, and rounding_loss_... the change by it. unchanged_percent states in how many "
    "of the cases with one cost curve 20 % lower or higher the same point is chosen."
)
SENSITIVITY = (
    "The choices of the rules among the points of this front with one cost curve 20 % lower or "
    "higher, with the costs of that point and of the choice of the run in that case. Cases that "
    "change nothing are omitted."
)
ROUNDED = (
    "The rules by which the variables are rounded. A rule that the configuration does not set under "
    "[rounding] is an assumption."
)


def choice_sections(result: RunResult) -> tuple[str, ...]:
    """The sections on choices, none where nothing is chosen."""
    if result.choices is None:
        return ()
    names = ["choice", "meaning"]
    for name in (axis.name for axis in result.objectives):
        names += [name, f"rounded_{name}", f"rounding_loss_{name}_percent"]
    names += ["rounded_feasible", "rounded_violated_limits", "unchanged_percent", "model"]
    parts = [described(CHOICES, chosen(result.choices, names))]
    if result.choice_sensitivity is not None:
        moved = result.choice_sensitivity[~result.choice_sensitivity["same"].astype(bool)]
        parts.append(folded_section("With other costs", described(SENSITIVITY, moved.drop(columns="same"))))
    if result.allocation is not None:
        parts += [
            folded_section(f"For the drawing: {order.title}", described(order.note, order.drawn))
            for order in orders(result)
        ]
        rules = pd.DataFrame(list(result.summary.get("rounding") or ()))
        parts.append(folded_section("Rounding", described(ROUNDED, rules)))
    return (section("Choices", "\n".join(parts)),)


# The picture of a machine in its cell, its links and joints coloured by their share of R^2.


WIDTH, HEIGHT, EDGE = 640.0, 420.0, 46.0
VIEW = (np.radians(-60.0), np.radians(18.0))
"""Azimuth and elevation of the eye."""
PALE, DEEP = np.array([214.0, 222.0, 232.0]), np.array([178.0, 34.0, 34.0])
"""Colours of a share of zero and of the largest share."""
JOINT, LINK, TOOL = 14.0, 7.0, 3.0
READABLE = 0.35
"""Share, over the largest, from which on a number is white on its joint."""


def machine_sections(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """The section with the picture, none where the run has stored no machine."""
    stored = summary.get("machine")
    if not isinstance(stored, Mapping):
        return ()
    cost = float(stored["cost"])
    caption = (
        f"The machine in the middle of its poses (dots), at cost {cost:.4g}: links and "
        "joints by their share of the squared position error, from pale (none) to red (the "
        "largest). The shares are listed below."
    )
    body = f"<figure>{_drawing(stored, caption)}<figcaption>{escape(caption)}</figcaption></figure>"
    return (section("Where the error is made", body + _list_shares(stored["parts"])),)


def _drawing(stored: Mapping[str, Any], caption: str) -> str:
    parts: Sequence[Mapping[str, Any]] = stored["parts"]
    lines = [_project_points(part["points"]) for part in parts]
    poses = _project_points(stored["poses"])
    points = np.vstack([*lines, poses])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = float(np.min((np.array([WIDTH, HEIGHT]) - 2.0 * EDGE) / np.maximum(high - low, 1e-9)))
    shift = 0.5 * (np.array([WIDTH, HEIGHT]) - scale * (low + high))
    most = max(float(part["share"]) for part in parts) or 1.0
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.4" fill="#8a94a3"/>'
        for x, y in np.unique(np.round(scale * poses + shift, 1), axis=0)
    )
    shapes = [_shape(part, scale * line + shift, most) for part, line in zip(parts, lines, strict=True)]
    return (
        f'<svg role="img" aria-label="{escape(caption)}" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" '
        f'style="max-width:{WIDTH:g}px;width:100%">{dots}{"".join(shapes)}</svg>'
    )


def _project_points(points: Sequence[Sequence[float]]) -> Array:
    """Points (n, 3) [mm] projected as the eye sees them (n, 2), y down."""
    x, y, z = np.array(points, dtype=float).reshape(-1, 3).T
    azimuth, elevation = VIEW
    across = -np.sin(azimuth) * x + np.cos(azimuth) * y
    away = np.cos(azimuth) * x + np.sin(azimuth) * y
    return np.column_stack([across, np.sin(elevation) * away - np.cos(elevation) * z])


def _shape(part: Mapping[str, Any], points: Array, most: float) -> str:
    share = float(part["share"])
    colour = _colour(share / most)
    title = f"<title>{escape(str(part['name']))}: {share:.3g} %</title>"
    if part["kind"] == "joint":
        x, y = points[0]
        label = escape(str(part["name"]).rpartition(" ")[2])
        ink = "#fff" if share > READABLE * most else "#222"
        return (
            f'<g>{title}<circle cx="{x:.1f}" cy="{y:.1f}" r="{JOINT:g}" fill="{colour}" '
            f'stroke="#222" stroke-width="1.2"/><text x="{x:.1f}" y="{y + 5.5:.1f}" '
            f'text-anchor="middle" font-size="16" fill="{ink}">{label}</text></g>'
        )
    width = TOOL if part["kind"] == "tool" else LINK
    stroke = "#222" if part["kind"] == "tool" else colour
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return (
        f'<g>{title}<polyline points="{path}" fill="none" stroke="{stroke}" stroke-width='
        f'"{width:g}" stroke-linejoin="round" stroke-linecap="round"/></g>'
    )


def _colour(share: float) -> str:
    red, green, blue = np.rint(PALE + np.sqrt(max(share, 0.0)) * (DEEP - PALE)).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _list_shares(parts: Sequence[Mapping[str, Any]]) -> str:
    """The shares as text, the largest first, for readers who cannot rely on colours."""
    ranked = sorted((part for part in parts if float(part["share"]) >= 0.05), key=lambda part: -float(part["share"]))
    words = ", ".join(f"{escape(str(part['name']))} {float(part['share']):.3g} %" for part in ranked)
    return f"<p>{words}.</p>"


# The sections of plugins on the page of a run; a section that fails states the reason.


def _section(name: str, result: RunResult) -> str:
    try:
        plugin = SECTIONS[name]()
        body = plugin.body(result)
        return section(plugin.title, str(body)) if body else ""
    except InputError as error:
        reason = "; ".join(fault.message for fault in error.faults)
    except PLUGIN_FAULTS as error:
        reason = f"{type(error).__name__}: {error}"
    text = f'The section "{name}" of {origin("pages", name)} is omitted: {reason}'
    return section(name, f"<p>{escape(text)}</p>")


# Control charts of measured parts: single values in the order in which the parts were made.


COLUMNS = 3
CHARTS = 12
"""Characteristics that are drawn at most."""
CONTROL_HEIGHT = 1.9
"""Height [inch] of a row of charts."""
NATURAL = 2.66
"""Mean moving ranges from the mean to a control limit: 3/1.128."""


def control_figure(parts: Sequence[tuple[str, str, Sequence[float]]]) -> Figure:
    """A chart of single values for each name, unit and values, `CHARTS` at most.

    Control limits lie 2.66 mean moving ranges from the mean (Shewhart 1931; ISO 7870-2).
    """
    shown = parts[:CHARTS]
    rows = -(-len(shown) // COLUMNS)
    figure = new_figure(height=CONTROL_HEIGHT * rows + 0.3)
    grid: Any = figure.subplots(rows, min(COLUMNS, len(shown)), squeeze=False)
    for at, axes in enumerate(grid.ravel()):
        if at < len(shown):
            _chart(axes, *shown[at])
        else:
            axes.set_visible(False)
    return figure


def _chart(axes: Axes, name: str, unit: str, values: Sequence[float]) -> None:
    measurements = np.asarray(values, dtype=float)
    mean, reach = float(measurements.mean()), NATURAL * float(np.abs(np.diff(measurements)).mean())
    number = np.arange(1, len(measurements) + 1)
    axes.plot(number, measurements, color=COLOURS[0], marker="o", markersize=2.5, linewidth=0.8)
    beyond = np.abs(measurements - mean) > reach
    axes.plot(number[beyond], measurements[beyond], "x", color=COLOURS[1], markersize=6)
    axes.axhline(mean, color="#555555", linewidth=0.8)
    for side in (-1.0, 1.0):
        axes.axhline(mean + side * reach, color=COLOURS[1], linewidth=0.8, linestyle="--")
    axes.set_title(label_with_unit(name, unit), fontsize="small")
    axes.tick_params(labelsize="x-small")
    style_axes(axes)


# The promise of a run on its yield: cost by statement, the next measurements, the processes.


STATEMENTS = (
    "The least cost that keeps the promise, by the meaning of the promise. plug_in: the estimates of "
    "the samples count as true. predictive: the expected yield counts, given the uncertainty "
    "of the samples. assured: the yield is kept with the confidence. assurance_percent is the "
    "probability, over what is not known of the processes, that the promised fraction of units "
    "conforms (20,000 draws of the posterior). promise.csv has this table."
)
NEXT = (
    "The processes of which twenty more measured parts lower the cost of the assured promise most. "
    "shadow_gain is by the multiplier of the promise at the present tolerances; expected_gain, of the "
    "first three, is the expected fall of the least cost over the possible results of the next sample. "
    "next_parts.csv has this table."
)
CAPABILITY = (
    "Cp and Cpk of every measured characteristic with 95 % confidence limits, and the distribution "
    "type of ISO 22514-2 as far as the tests show it. Means are from the mid-limit; a characteristic with "
    "one limit has no Cp, and its mean is from the nominal. capability.csv has this table."
)
CHARTED = (
    "Single values in the order in which the parts were made, with their mean and the control limits at 2.66 mean "
    "moving ranges from it; a cross marks a value beyond them."
)


def promise_sections(result: RunResult) -> tuple[str, ...]:
    """The section on the promise, on measured parts alone where nothing is promised, or none."""
    if result.promise is None or result.promise.empty:
        known = _process_knowledge(result)
        return (section("Measured parts", "\n".join(known)),) if known else ()
    statements = result.promise
    unit = unit_of_cost(result.summary)
    bars = Bars("least cost", unit, tuple(map(str, statements["statement"])), tuple(map(float, statements["cost"])))
    chosen = (result.summary.get("promise") or {}).get("statement")
    marked = [name == chosen for name in statements["statement"]]
    parts = [
        described(STATEMENTS, statements, marked),
        picture("promise", bars_figure(bars), "Cost of assurance: the least cost by statement."),
    ]
    if result.next_parts is not None:
        parts.append(described(NEXT, result.next_parts))
    parts += _process_knowledge(result)
    return (section("Promise", "\n".join(parts)),)


def _process_knowledge(result: RunResult) -> list[str]:
    """What is known of the processes of measured parts, and their control charts."""
    parts = []
    if result.capability is not None:
        parts.append(folded_section("What is known of the processes", described(CAPABILITY, result.capability)))
    charts = measured_parts(result.configuration)
    if charts:
        more = f" The first {CHARTS} of {len(charts)}." if len(charts) > CHARTS else ""
        parts.append(folded_section("Control charts", picture("control", control_figure(charts), CHARTED + more)))
    return parts


def measured_parts(configuration: str) -> list[tuple[str, str, list[float]]]:
    """Name, unit and values of every measured part or variable of a resolved configuration."""
    content: Any = configured(configuration)
    parts = content.get("part")
    owners = [
        (str(part.get("name", "")), part.get("unit"), part) for part in (parts if isinstance(parts, list) else ())
    ]
    variables = content.get("variables")
    owners += [
        (name, split_unit(name)[1], variable)
        for name, variable in (variables if isinstance(variables, dict) else {}).items()
        if isinstance(variable, dict)
    ]
    return [
        (name, str(measured.get("unit") or unit or ""), measured["values"])
        for name, unit, owner in owners
        if isinstance(measured := owner.get("measured"), dict) and len(measured.get("values") or ()) > 1
    ]


# The requirements that determine the tolerance of each part, and the saving by relaxing them.


RELAXED = (
    "The requirements at the knee of the front, or at its only point. The multiplier states by how "
    "much the least cost falls per unit of the limit. saves_at_least and saves_at_most hold for a limit "
    "that is relaxed by the given percentage while all others stay: the first by a computed allocation, "
    "the second because nothing can cost less than the bound there. drives names the parts "
    "that contribute most, and row which limit of a yield it is. requirements.csv has all digits."
)
DRIVEN = (
    "The requirements that limit the tolerance of each part: at the least cost the slope of its cost "
    "curve is the sum of multiplier times sensitivity over the requirements, and the table has their "
    "fractions of it. A part without any is as loose as its range allows. drivers.csv has this table."
)


def requirement_sections(result: RunResult) -> tuple[str, ...]:
    """The section on requirements, none for a single requirement or without proven bounds."""
    if result.requirements is None or result.drivers is None:
        return ()
    binding = [float(value) > 0.0 for value in result.requirements["multiplier_cost_per_unit"]]
    parts = described(RELAXED, result.requirements, binding), described(DRIVEN, _short_drivers(result.drivers))
    return (section("Requirements", "\n".join(parts)),)


def _short_drivers(drivers: pd.DataFrame) -> pd.DataFrame:
    """The table of drivers without requirements that limit no tolerance."""
    idle = [name for name in drivers if str(name).endswith("_percent") and not (drivers[name] != 0.0).any()]
    return drivers.drop(columns=idle)


# The summary of a result as a table.


ELSEWHERE = frozenset(
    {
        "assumptions",
        "notes",
        "choices",
        "rounding",
        "axes",
        "bars",
        "files",
        "units",
        "validity",
        "assumptions_at",
        "mechanism",
    }
)
"""Keys that the page shows in other places, or uses itself."""


def summary_table(summary: Mapping[str, Any]) -> str:
    """`summary.json` by name and value, without the keys that are shown elsewhere."""
    rows = [(name, _flat(value)) for name, value in summary.items() if name not in ELSEWHERE]
    return table(pd.DataFrame(rows, columns=["name", "value"], dtype=object))


def _flat(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_flat(part)}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_flat, value))
    return shown(value)


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


def page(result: RunResult, remarks: Sequence[str] = ()) -> str:
    """The whole page; every text that comes from outside is escaped.

    `remarks` report what is wrong with the files that it is built from.
    """
    scripted = has_front(result)
    parts = (
        *remarks_section(remarks),
        _model(result.summary),
        *analysis_sections(result),
        _front(result, scripted),
        section("In words", bullets(result.notes)) if result.notes else "",
        *unit_sections(result),
        *machine_sections(result.summary),
        *promise_sections(result),
        *requirement_sections(result),
        *choice_sections(result),
        *(html for name in SECTIONS if (html := _section(name, result))),
        *starmap(section, declared_tables(result).items()),
        section("References", _references(result)) if len(result.references) else "",
        section("Points of the front", folded_section("Table", _points(result))) if len(result.front) else "",
        section("Convergence", _convergence(result.convergence)) if len(result.convergence) > 1 else "",
        section("Sensitivity", _bars(result.bars)) if result.bars else "",
        section("Assumptions", _assumptions(result.summary)) if result.summary.get("assumptions") else "",
        section("Summary", folded_section("summary.json", summary_table(result.summary))),
        section("Configuration", folded_section("config.toml", f"<pre>{escape(result.configuration)}</pre>")),
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
    more = folded_section("The choices by other models", bullets(lines[1:])) if lines[1:] else ""
    return f'<p class="model"><strong>All numbers on this page are by {first}.</strong></p>\n{more}'


def analysis_sections(result: RunResult) -> tuple[str, ...]:
    """The requirements of a stack before and after the choice of tolerances, none of other problems."""
    if result.analysis is None:
        return ()
    return (section("Requirements", table(requirements_view(result.analysis))),)


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
    return folded_section("Figure", picture("convergence", convergence_figure(convergence), caption))


def _assumptions(summary: Mapping[str, Any]) -> str:
    assumptions = pd.DataFrame(list(summary.get("assumptions") or ()))
    text = "These values are in use though nobody has stated them."
    return folded_section("Values in use", described(text, chosen(assumptions, ASSUMPTION_COLUMNS)))


# The figures of a run for a paper, in a common style.


def figures(result: RunResult) -> dict[str, Figure]:
    """Figures by the stem of their files; those without data are omitted."""
    drawn = {
        "front": front_figure(result) if result.objectives else None,
        "convergence": None if result.convergence.empty else convergence_figure(result.convergence),
        "contributions": contributions_figure(result),
        "tolerances": tolerances_figure(result),
        "unit_turn": None if result.unit_turn is None else turn_figure(result),
        "population": None if result.population is None else population_figure(result),
        "torque_rotation": None if result.torque_rotation is None else torque_figure(result),
    }
    return {name: figure for name, figure in drawn.items() if figure is not None}
