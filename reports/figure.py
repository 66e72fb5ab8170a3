"""The figure of a Pareto front and the references."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..records import RunResult
from .drawing import COLOURS, as_png, as_svg, axis_label, flags, new_axes, style_axes

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
