"""The page of a study: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Hashable
from html import escape
from typing import Any

import pandas as pd

from ...records import StudyResult, mechanism_lines
from ..document import bullets, document, folded, picture, section
from ..scripts import data, package_scripts
from ..tables import chosen, table
from .figures import Named, figures
from .words import short

KEYS, POINTS = 8, 300
"""Keys and settings on the page at most: medians.csv has all."""
FAILED = 60
"""Failed runs on the page at most."""
SHOWN = "A test supports it."
NOT_SHOWN = "No test supports it: the seeds are too few, or the settings too alike."
TESTS = (
    "Tests on common seeds. wilcoxon: signed-rank test of two levels, effect is the rank-biserial "
    "correlation, difference the median of a - b; friedman: all levels of a key, effect is "
    "Kendall's W; anova: F. p_holm is corrected within a response and kind. Where the number of "
    "seeds cannot give significance, the reason is named and none is claimed."
)
SENSITIVITY = (
    "S1, ST: Sobol indices; mu_star, sigma: elementary effects; anova_share: share of the variance "
    "of one run (one at a time: over the levels of that key alone); noise_share: what the seed "
    "alone changes. distinct: the interval lies above 0."
)


def study_page(result: StudyResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    drawn = figures(result)
    parts = [
        section("In words", bullets(result.notes)) if result.notes else "",
        _settings(result),
        *_courses(result, drawn),
        section("Responses", "\n".join(map(_drawing, _of(drawn, "response_")))),
        section("Sensitivities", _sensitivities(result, drawn)) if len(result.sensitivity) else "",
        section("Tests", _tests(result.tests)),
        section("Medians", folded("Table", _medians(result))),
        section("Failed runs", _failed(result.table)) if (result.table["status"] == "failed").any() else "",
        section("Configuration", folded("study.toml", f"<pre>{escape(result.configuration)}</pre>")),
    ]
    body = "\n".join(part for part in parts if part)
    scripts = (package_scripts("common.js", "study.js"),) if len(result.medians) else ()
    return document(result.title, body, scripts, _head(result))


def _head(result: StudyResult) -> str:
    """What is recommended, and how sure that is."""
    about = "".join(f"<p>{escape(line)}</p>\n" for line in mechanism_lines({"mechanism": result.mechanism}))
    if not result.recommendations:
        return f'{about}<p class="asked">No setting is recommended.</p>'
    lines = "".join(
        f"<li>{escape(recommendation.sentence)} {SHOWN if recommendation.shown else NOT_SHOWN}</li>"
        for recommendation in result.recommendations
    )
    return f'{about}<p class="asked">Recommended settings</p>\n<ul class="answers">{lines}</ul>'


def _settings(result: StudyResult) -> str:
    """Settings to filter and to compare, which the scripts fill."""
    if result.medians.empty:
        return ""
    names = [response.name for response in result.responses]
    keys = [str(name) for name in result.design.columns][:KEYS]
    rows = {(str(row["response"]), int(row["point"])): row for row in result.medians.to_dict("records")}
    points = sorted({point for _, point in rows})[:POINTS]
    content = {
        "keys": [{"name": key, "label": short(key)} for key in keys],
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


def _of(drawn: list[Named], start: str) -> list[Named]:
    return [named for named in drawn if named.name.startswith(start)]


def _drawing(named: Named) -> str:
    return picture(named.name, named.figure, named.caption)


def _courses(result: StudyResult, drawn: list[Named]) -> list[str]:
    """Each course with the verdicts on its interpretation; then the verdicts on all others."""
    parts, shown = [], {named.key for named in drawn if named.key}
    for named in _of(drawn, "course_"):
        read = [verdict.sentence for verdict in result.verdicts if verdict.key == named.key]
        parts.append(_drawing(named) + (bullets(read) if read else ""))
    rest = [verdict.sentence for verdict in result.verdicts if verdict.key not in shown]
    sections = [section("Courses", "\n".join(parts))] if parts else []
    return sections + ([section("Readings", bullets(rest))] if rest else [])


def _sensitivities(result: StudyResult, drawn: list[Named]) -> str:
    if result.sensitivity.empty:
        return "<p>None.</p>"
    pictures = "\n".join(map(_drawing, _of(drawn, "sensitivity")))
    marks = [bool(distinct) for distinct in result.sensitivity["distinct"]]
    return f"{pictures}\n<p>{escape(SENSITIVITY)}</p>\n{table(result.sensitivity, marks)}"


def _tests(tests: pd.DataFrame) -> str:
    if tests.empty:
        return "<p>None: this design compares no levels side by side.</p>"
    marks = [bool(significant) for significant in tests["significant"]]
    return f"<p>{escape(TESTS)}</p>\n{table(tests, marks)}"


def _medians(result: StudyResult) -> str:
    joined = result.medians.merge(result.design, left_on="point", right_index=True)
    names = ["response", "point", *map(str, result.design.columns)]
    return table(chosen(joined, [*names, *map(str, result.medians.columns)]))


def _failed(runs: pd.DataFrame) -> str:
    failed = runs[runs["status"] == "failed"]
    rest = len(failed) - FAILED
    more = f"<p>{rest} more failed runs are in study.csv.</p>" if rest > 0 else ""
    return table(failed.head(FAILED)) + more
