"""Page and figures of a study."""

from __future__ import annotations

import re
from collections.abc import Hashable
from html import escape
from itertools import starmap
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...page.document import (
    about,
    bullets,
    chosen,
    data,
    declared_tables,
    described,
    document,
    folded_section,
    package_scripts,
    picture,
    section,
    table,
)
from ...page.drawing import COLOURS, Named, new_axes, new_figure, style_axes
from ...records import Response, StudyResult, Varied

__all__ = ["figures", "study_page"]

# Names as figures and sentences show them.


def short_key(key: str) -> str:
    """A key without its table: "crossover probability"."""
    return key.removeprefix("algorithm.").replace(".", " ").replace("_", " ")


def level(value: Any) -> str:
    """A level of a key."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def wide(low: float, high: float) -> bool:
    """Whether values span so much that a logarithmic axis shows them better."""
    return low > 0.0 and high / low > 30.0


# The course of a run at each level of a key, as the documents draw it, with intervals.


def course_figure(result: StudyResult, key: str) -> Figure:
    """Median of the runs by generation with its interval, a line per level, and the optimum."""
    figure, axes = new_axes(height=3.8)
    course = result.courses[result.courses["key"] == key]
    for at, (name, part) in enumerate(course.groupby("level", sort=False)):
        colour = COLOURS[at % len(COLOURS)]
        low, high = (part[end].to_numpy(dtype=float) for end in ("low", "high"))
        axes.fill_between(part["generation"], low, high, color=colour, alpha=0.22, linewidth=0)
        axes.plot(
            part["generation"], part["median"], color=colour, linewidth=1.3, label=f"{short_key(key)} {level(name)}"
        )
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


# A response against each setting: every run, medians and their intervals.


MAX_SETTINGS_SHOWN = 40
"""Settings up to which the single runs are drawn."""
COLUMNS = 3
COLOUR = "#1f5fa8"


def response_figure(result: StudyResult, response: Response) -> Figure:
    """One panel per key, in a design one at a time only of settings that change no other key."""
    rows = -(-len(result.varied) // COLUMNS)
    figure = new_figure(height=0.6 + 2.7 * rows)
    columns = min(COLUMNS, len(result.varied))
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    medians = result.medians[result.medians["response"] == response.name].set_index("point")
    known = medians["median"].dropna()
    scale = "log" if len(known) and wide(known.min(), known.max()) else "linear"
    for at, axes in enumerate(panels.flat):
        if at >= len(result.varied):
            axes.set_visible(False)
            continue
        _draw(axes, result, response, result.varied[at], medians)
        axes.set_yscale(scale)
        style_axes(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel(response.name.replace("_", " "))
    return figure


def _draw(axes: Axes, result: StudyResult, response: Response, key: Varied, medians: pd.DataFrame) -> None:
    points = _points(result, key)
    places, labels = _places(result.design.loc[points, key.key], key)
    if len(result.design) <= MAX_SETTINGS_SHOWN:
        runs = result.table[result.table["point"].isin(points)]
        x, y = places.loc[runs["point"]], runs[response.name]
        axes.plot(x, y, "o", markersize=2.2, color="#888888", alpha=0.5, markeredgewidth=0)
    some = medians.loc[points]
    order = places.sort_values(kind="stable").index
    joined = "-" if result.kind == "one_at_a_time" and not key.categorical else "none"
    reach = np.abs(some[["low", "high"]].to_numpy(dtype=float).T - some["median"].to_numpy())
    x, errors = places.loc[points], np.nan_to_num(reach)
    axes.errorbar(x, some["median"], errors, fmt="o", markersize=4, capsize=2.5, linewidth=1.1, color=COLOUR)
    axes.plot(places.loc[order], some.loc[order, "median"], linestyle=joined, linewidth=0.9, color=COLOUR)
    if some["median"].isna().any():
        text = "no median: half of the runs\ndid not reach the level"
        axes.text(0.5, 0.97, text, fontsize="small", ha="center", va="top", transform=axes.transAxes)
    if response.best is not None:
        axes.axhline(response.best, color="black", linestyle="--", linewidth=1.0)
    if labels:
        axes.set_xticks(range(len(labels)), labels, fontsize="small")
    low, high = float(places.min()), float(places.max())
    if key.log and not labels:
        axes.set_xscale("log")
        spread = (high / low) ** 0.05 if high > low else 2.0
        axes.set_xlim(low / spread, high * spread)
    else:
        margin = 0.05 * (high - low) or 0.5
        axes.set_xlim(low - margin, high + margin)
    axes.set_xlabel(short_key(key.key))


def _points(result: StudyResult, key: Varied) -> pd.Index:
    """The settings of a panel."""
    if result.kind != "one_at_a_time":
        return result.design.index
    others = [varied for varied in result.varied if varied.key != key.key]
    same = pd.DataFrame(
        {varied.key: result.design[varied.key] == varied.base for varied in others}, index=result.design.index
    )
    return result.design.index[same.all(axis=1)]


def _places(column: pd.Series, key: Varied) -> tuple[pd.Series, list[str]]:
    """The place of every setting on the axis, and the labels of the axis for levels without numbers."""
    if not key.categorical:
        return column.astype(float), []
    names = list(dict.fromkeys(column))
    return column.map({name: float(at) for at, name in enumerate(names)}), [*map(level, names)]


def response_caption(result: StudyResult, response: Response) -> str:
    """What the figure shows."""
    runs = "grey points are single runs, " if len(result.design) <= MAX_SETTINGS_SHOWN else ""
    best = "" if response.best is None else "; the dashed line is the best possible value"
    confidence = 100 * result.medians["level"].iloc[0]
    keys = ", ".join(varied.key for varied in result.varied)
    return (
        f"{response.name} against {keys}: {runs}circles are medians with {confidence:.0f} % bootstrap intervals{best}."
    )


# How much each key matters, with intervals, and the noise.


FIRST, SECOND, NOISE = "#1f5fa8", "#c4501b", "#666666"
LOOKS = MappingProxyType(
    {
        "S1": ("alone (S1)", FIRST),
        "ST": ("with all its interactions (ST)", SECOND),
        "mu_star": ("mean size of its effect (mu*)", FIRST),
        "sigma": ("spread of its effect (sigma)", SECOND),
        "anova_share": ("fraction of the variance of a run", FIRST),
        "noise_share": ("fraction of noise", NOISE),
    }
)
"""Label and colour of every statistic."""
HEIGHT = 0.3
"""Height [inch] of a row."""


def sensitivity_figure(result: StudyResult) -> Figure:
    """One panel per response; a bar that reaches 0 is not distinguishable from 0."""
    names = list(result.sensitivity["response"].unique())
    rows = result.sensitivity.groupby("response").size()
    figure = new_figure(height=1.0 + sum(0.6 + HEIGHT * int(rows[name]) for name in names))
    panels = figure.subplots(len(names), 1, squeeze=False, height_ratios=[rows[n] for n in names])
    for axes, name in zip(panels.flat, names, strict=True):
        sensitivities = result.sensitivity[result.sensitivity["response"] == name].reset_index(drop=True)
        for statistic, part in sensitivities.groupby("statistic", sort=False):
            sides = np.abs(part[["low", "high"]].to_numpy().T - part["value"].to_numpy())
            label, colour = LOOKS[str(statistic)]
            axes.errorbar(part["value"], part.index, xerr=sides, fmt="o", capsize=3, color=colour, label=label)
        labels = [short_key(key) or "noise" for key in sensitivities["key"]]
        axes.set_yticks(range(len(sensitivities)), labels, fontsize="small")
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.invert_yaxis()
        axes.set_title(name.replace("_", " "), fontsize="medium", loc="left")
        style_axes(axes, legend=True)
    return figure


def sensitivity_caption(result: StudyResult) -> str:
    """What the figure shows."""
    confidence = 100 * result.sensitivity["level"].iloc[0]
    return (
        f"Sensitivities with {confidence:.0f} % intervals, from which the noise of the runs is removed; it is "
        "shown separately. An effect whose interval contains 0 is not distinguishable from 0."
    )


# The figures of a study, by the names of their files.


def figures(result: StudyResult) -> list[Named]:
    """The course of every key, every response against the settings, and the sensitivities."""
    drawn = [
        Named(f"course_{stem(key)}", course_figure(result, key), course_caption(result, key), key)
        for key in result.courses["key"].unique()
    ]
    drawn += [
        Named(f"response_{stem(response.name)}", response_figure(result, response), response_caption(result, response))
        for response in result.responses
    ]
    if len(result.sensitivity):
        drawn.append(Named("sensitivity", sensitivity_figure(result), sensitivity_caption(result)))
    return drawn


def stem(key: str) -> str:
    """A key as part of a file name: `algorithm.crossover.probability` as crossover_probability."""
    return re.sub(r"\W+", "_", key.removeprefix("algorithm."))


# The page of a study: a single HTML file that needs no network.


KEYS, POINTS = 8, 300
"""Keys and settings on the page at most: medians.csv has all."""
FAILED = 60
"""Failed runs on the page at most."""
SUPPORTED = "A test supports it."
UNSUPPORTED = "No test supports it: the seeds are too few, or the settings too alike."
TESTS = (
    "Tests on common seeds. wilcoxon is the signed-rank test of two levels, with the rank-biserial "
    "correlation as effect and the median of a - b as difference; friedman is of all levels of a key, with "
    "Kendall's W as effect; anova has F. p_holm is corrected within a response and kind. Where the number of "
    "seeds cannot give significance, the table states the reason and claims none."
)
SENSITIVITY = (
    "S1 and ST are Sobol indices, mu_star and sigma elementary effects. anova_share is the fraction of the variance "
    "of one run (one at a time: over the levels of that key alone), noise_share the fraction that the seed "
    "alone causes. distinct states whether the interval lies above 0."
)


def study_page(result: StudyResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    drawn = figures(result)
    parts = [
        section("In words", bullets(result.notes)) if result.notes else "",
        _settings(result),
        *_courses(result, drawn),
        section("Responses", _pictures(drawn, "response_")),
        section("Sensitivities", _sensitivities(result, drawn)) if len(result.sensitivity) else "",
        section("Tests", _tests(result.tests)),
        section("Medians", folded_section("Table", _medians(result))),
        *starmap(section, declared_tables(result).items()),
        section("Failed runs", _failed_runs(result.table)) if (result.table["status"] == "failed").any() else "",
        section("Configuration", folded_section("study.toml", f"<pre>{escape(result.configuration)}</pre>")),
    ]
    scripts = (package_scripts("common.js", "study.js"),) if len(result.medians) else ()
    return document(result.title, parts, scripts, _head(result))


def _head(result: StudyResult) -> str:
    """The recommended settings, and whether a test supports them."""
    mechanism = about({"mechanism": result.mechanism})
    if not result.recommendations:
        return f'{mechanism}<p class="asked">No setting is recommended.</p>'
    lines = "".join(
        f"<li>{escape(recommendation.sentence)} {SUPPORTED if recommendation.shown else UNSUPPORTED}</li>"
        for recommendation in result.recommendations
    )
    return f'{mechanism}<p class="asked">Recommended settings</p>\n<ul class="answers">{lines}</ul>'


def _settings(result: StudyResult) -> str:
    """The settings, which the scripts filter and compare."""
    if result.medians.empty:
        return ""
    names = [response.name for response in result.responses]
    keys = [str(name) for name in result.design.columns][:KEYS]
    rows = {(str(row["response"]), int(row["point"])): row for row in result.medians.to_dict("records")}
    points = sorted({point for _, point in rows})[:POINTS]
    content = {
        "keys": [{"name": key, "label": short_key(key)} for key in keys],
        "responses": [
            {"name": response.name, "label": response.name.replace("_", " "), "larger": response.larger_is_better}
            for response in result.responses
        ],
        "points": [
            {
                "levels": [result.design[key].loc[point] for key in keys],
                "medians": [_interval(rows.get((name, point))) for name in names],
            }
            for point in points
        ],
    }
    rest = len({point for _, point in rows}) - len(points)
    more = f'<p class="hint">{rest} more settings are in medians.csv.</p>' if rest else ""
    return section("Settings", f'<div id="settings"></div>{more}\n{data(content)}')


def _interval(row: dict[Hashable, Any] | None) -> dict[str, Any] | None:
    return None if row is None else {name: row[name] for name in ("median", "low", "high")}


def _pictures(drawn: list[Named], start: str) -> str:
    return "\n".join(picture(item.name, item.figure, item.caption) for item in drawn if item.name.startswith(start))


def _courses(result: StudyResult, drawn: list[Named]) -> list[str]:
    """The courses with the verdicts on their interpretations; then the verdicts on all others."""
    parts, courses = [], [item for item in drawn if item.key]
    keys = {course.key for course in courses}
    for course in courses:
        verdicts = [verdict.sentence for verdict in result.verdicts if verdict.key == course.key]
        parts.append(picture(course.name, course.figure, course.caption) + (bullets(verdicts) if verdicts else ""))
    rest = [verdict.sentence for verdict in result.verdicts if verdict.key not in keys]
    sections = [section("Courses", "\n".join(parts))] if parts else []
    return sections + ([section("Interpretations", bullets(rest))] if rest else [])


def _sensitivities(result: StudyResult, drawn: list[Named]) -> str:
    marks = [bool(distinct) for distinct in result.sensitivity["distinct"]]
    return f"{_pictures(drawn, 'sensitivity')}\n{described(SENSITIVITY, result.sensitivity, marks)}"


def _tests(tests: pd.DataFrame) -> str:
    if tests.empty:
        return "<p>None: this design compares no levels side by side.</p>"
    marks = [bool(significant) for significant in tests["significant"]]
    return described(TESTS, tests, marks)


def _medians(result: StudyResult) -> str:
    joined = result.medians.merge(result.design, left_on="point", right_index=True)
    names = ["response", "point", *map(str, result.design.columns)]
    return table(chosen(joined, [*names, *map(str, result.medians.columns)]))


def _failed_runs(runs: pd.DataFrame) -> str:
    failed = runs[runs["status"] == "failed"]
    rest = len(failed) - FAILED
    more = f"<p>{rest} more failed runs are in study.csv.</p>" if rest > 0 else ""
    return table(failed.head(FAILED)) + more
