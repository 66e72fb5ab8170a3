"""The page of a study: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Hashable
from html import escape
from typing import Any

import pandas as pd

from ...records import StudyResult
from ..document import about, bullets, document, folded, picture, section
from ..drawing import Named
from ..scripts import data, package_scripts
from ..tables import chosen, described, table
from .figures import figures
from .words import short

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
        section("Medians", folded("Table", _medians(result))),
        section("Failed runs", _failed(result.table)) if (result.table["status"] == "failed").any() else "",
        section("Configuration", folded("study.toml", f"<pre>{escape(result.configuration)}</pre>")),
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


def _failed(runs: pd.DataFrame) -> str:
    failed = runs[runs["status"] == "failed"]
    rest = len(failed) - FAILED
    more = f"<p>{rest} more failed runs are in study.csv.</p>" if rest > 0 else ""
    return table(failed.head(FAILED)) + more
