"""The course of a run at each level of a key, as the documents draw it, with intervals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ...records import StudyResult
from ..drawing import COLOURS, new_axes, style_axes
from .words import level, short, wide


def course_figure(result: StudyResult, key: str) -> Figure:
    """Median of the runs by generation with its interval, a line per level, and the optimum."""
    figure, axes = new_axes(height=3.8)
    course = result.courses[result.courses["key"] == key]
    for at, (name, part) in enumerate(course.groupby("level", sort=False)):
        colour = COLOURS[at % len(COLOURS)]
        low, high = (part[end].to_numpy(dtype=float) for end in ("low", "high"))
        axes.fill_between(part["generation"], low, high, color=colour, alpha=0.22, linewidth=0)
        axes.plot(part["generation"], part["median"], color=colour, linewidth=1.3, label=f"{short(key)} {level(name)}")
    for at, value in enumerate(np.unique(course["optimum"].dropna())):
        axes.axhline(value, color="black", linestyle="--", linewidth=1.0, label=None if at else "exact optimum")
    low, high = course["median"].min(), course["median"].max()
    axes.set_yscale("log" if wide(low, high) else "linear")
    axes.set_xlabel("generation")
    axes.set_ylabel(result.course_of.replace("_", " "))
    style_axes(axes, legend=True)
    return figure


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
