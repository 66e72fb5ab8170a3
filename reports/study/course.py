"""The course of a run at each level of a key, as the documents draw it, with bands."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...records import StudyResult
from ..drawing import new_figure, style_axes
from .words import level, short, wide

COLOURS = ("#1f5fa8", "#c4501b", "#2b7a3d", "#7b3fa0", "#8a6d00", "#b0245f")


def course_figure(result: StudyResult, key: str) -> Figure:
    """Median of the runs by generation with its interval, one line per level; the optimum."""
    figure = new_figure(height=3.8)
    axes = figure.add_subplot()
    course = result.courses[result.courses["key"] == key]
    for at, (name, part) in enumerate(course.groupby("level", sort=False)):
        colour = COLOURS[at % len(COLOURS)]
        axes.fill_between(
            part["generation"],
            part["low"].to_numpy(dtype=float),
            part["high"].to_numpy(dtype=float),
            color=colour,
            alpha=0.22,
            linewidth=0,
        )
        axes.plot(part["generation"], part["median"], color=colour, linewidth=1.3, label=f"{short(key)} {level(name)}")
    _draw_optimum(axes, course)
    low, high = course["median"].min(), course["median"].max()
    axes.set_yscale("log" if wide(low, high) else "linear")
    axes.set_xlabel("generation")
    axes.set_ylabel(result.course_of.replace("_", " "))
    axes.legend(frameon=False, fontsize="small")
    style_axes(axes)
    return figure


def _draw_optimum(axes: Axes, course: pd.DataFrame) -> None:
    known = np.unique(course["optimum"].dropna())
    for at, value in enumerate(known):
        axes.axhline(value, color="black", linestyle="--", linewidth=1.0, label="exact optimum" if not at else None)


def course_caption(result: StudyResult, key: str) -> str:
    """What the figure shows."""
    course = result.courses[result.courses["key"] == key]
    confidence = 100 * course["level_of_interval"].iloc[0]
    exact = "; the dashed line is the exact optimum" if course["optimum"].notna().any() else ""
    return (
        f"{result.course_of} by generation at {course['level'].nunique()} levels of {key}, the "
        f"other settings as in the run: median of {course['n'].max()} seeds and its "
        f"{confidence:.0f} % interval{exact}."
    )
