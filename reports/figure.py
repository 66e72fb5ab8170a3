"""The figure of a Pareto front and the references."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..records import RunResult
from .drawing import as_png, as_svg, axis_label, flags, new_figure, style_axes

FRONT_COLOUR = "#1f5fa8"
COLOURS = ("#c4501b", "#2b7a3d", "#7b3fa0", "#8a6d00", "#b0245f")
OVERLAY_COLOUR = "#555555"
OVERLAY_DASHES = ("--", ":", "-.")
MARKERS = "s^DvPX<>"
"""Eight markers and five colours: forty references before a pair repeats."""


def front_figure(result: RunResult) -> Figure:
    """The front in the plane of its first two objectives; one objective on a line."""
    figure = new_figure()
    axes = figure.add_subplot()
    if len(result.objectives) > 1:
        _draw_plane(axes, result)
    else:
        _draw_line(axes, result)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize="small")
    else:
        unfinished = result.summary.get("status") == "unfinished"
        words = "no front yet" if unfinished else "no feasible point"
        axes.text(0.5, 0.5, words, ha="center", transform=axes.transAxes)
    style_axes(axes)
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
    if result.before is not None and not result.before.empty:
        _draw_before(axes, result.before.sort_values([x.name, y.name]), x.name, y.name)
    exact = result.exact_front
    if exact is not None and len(result.objectives) == 2 and {x.name, y.name} <= set(exact):
        axes.plot(
            exact[x.name],
            exact[y.name],
            linestyle="-.",
            linewidth=2.5,
            color="#999999",
            zorder=1.5,
            label="exact front",
        )
    _draw_overlays(axes, result, x.name, y.name)
    if not result.front.empty:
        _draw_front(axes, result, x.name, y.name)
    for at, (_, row) in enumerate(result.references.iterrows()):
        _draw_reference(axes, row, at, float(row[x.name]), float(row[y.name]))


def _draw_front(axes: Axes, result: RunResult, x: str, y: str) -> None:
    front = result.front.sort_values([x, y])
    style = "-" if len(result.objectives) == 2 else "none"
    axes.plot(
        front[x],
        front[y],
        linestyle=style,
        linewidth=1.0,
        marker="o",
        markersize=3.0,
        color=FRONT_COLOUR,
        label=f"front, {len(front)} points",
    )
    _draw_bound(axes, front, x, y)
    knee = front[flags(front, "knee")]
    if not knee.empty:
        axes.plot(
            knee[x],
            knee[y],
            linestyle="none",
            marker="*",
            markersize=14,
            color=FRONT_COLOUR,
            markeredgecolor="white",
            label="knee",
        )


def _draw_before(axes: Axes, before: pd.DataFrame, x: str, y: str) -> None:
    """The front of the model without its effects."""
    axes.plot(
        before[x],
        before[y],
        linestyle=":",
        linewidth=1.0,
        marker="o",
        markersize=2.0,
        color="#777777",
        label=f"without effects, {len(before)} points",
    )


def _draw_overlays(axes: Axes, result: RunResult, x: str, y: str) -> None:
    """Fronts of other algorithms, thin and hollow behind that of the run."""
    for at, (label, overlay) in enumerate(result.overlays.items()):
        if overlay.empty or not {x, y} <= set(overlay):
            continue
        front = overlay.sort_values([x, y])
        style = OVERLAY_DASHES[at % len(OVERLAY_DASHES)] if len(result.objectives) == 2 else "none"
        axes.plot(
            front[x],
            front[y],
            linestyle=style,
            linewidth=0.8,
            marker="o",
            markersize=3.0,
            markerfacecolor="none",
            color=OVERLAY_COLOUR,
            zorder=1.8,
            label=_legend_text(f"{label}, {len(front)} points", feasible=True),
        )


def _draw_bound(axes: Axes, front: pd.DataFrame, x: str, y: str) -> None:
    """The proven bounds of the points' cost, where there are any: nothing lies left of or below."""
    if "cost" not in (x, y) or "bound" not in front or not front["bound"].notna().any():
        return
    ends = {"cost": front["bound"], (y if x == "cost" else x): front[y if x == "cost" else x]}
    axes.plot(
        ends[x], ends[y], linestyle="--", linewidth=1.0, color="black", zorder=3, label="proven bound of the cost"
    )


def _draw_line(axes: Axes, result: RunResult) -> None:
    """One objective: the optimum and the references one below the other."""
    if not result.objectives:
        return
    name = result.objectives[0].name
    rows = len(result.references)
    axes.set_xlabel(axis_label(result.objectives[0]))
    axes.set_yticks([])
    if not result.front.empty:
        axes.plot(
            result.front[name],
            [rows] * len(result.front),
            linestyle="none",
            marker="*",
            markersize=12,
            color=FRONT_COLOUR,
            label="best found",
        )
    for at, (_, row) in enumerate(result.references.iterrows()):
        _draw_reference(axes, row, at, float(row[name]), float(rows - 1 - at))


def _draw_reference(axes: Axes, row: pd.Series, at: int, x: float, y: float) -> None:
    """Filled where it meets the limits of the run, hollow where it breaks one."""
    feasible = flags(row.to_frame().T, "feasible")[0]
    colour = COLOURS[at % len(COLOURS)]
    axes.plot(
        [x],
        [y],
        linestyle="none",
        marker=MARKERS[at % len(MARKERS)],
        markersize=8,
        markerfacecolor=colour if feasible else "white",
        markeredgecolor=colour,
        label=_legend_text(str(row["label"]), feasible),
    )


def _legend_text(label: str, feasible: bool) -> str:
    shown = label.lstrip("_") or "reference"  # matplotlib hides labels that begin with _
    return shown if feasible else f"{shown} (breaks limits)"
