"""The page of a study: a single HTML file that needs no network."""

from __future__ import annotations

from html import escape

import pandas as pd

from ...records import StudyResult
from ..document import bullets, document, picture, section
from ..tables import chosen, table
from .figures import Named, figures

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
        section("Recommended settings", bullets([o.sentence for o in result.recommendations])),
        section("In words", bullets(result.notes)),
        *_courses(result, drawn),
        section("Responses", "\n".join(map(_drawing, _of(drawn, "response_")))),
        section("Sensitivities", _sensitivities(result, drawn)),
        section("Tests", _tests(result.tests)),
        section("Medians", _medians(result)),
        section("Failed runs", _failed(result.table)),
        section("Configuration", f"<pre>{escape(result.configuration)}</pre>"),
    ]
    return document(result.title, "\n".join(parts))


def _of(drawn: list[Named], start: str) -> list[Named]:
    return [one for one in drawn if one.name.startswith(start)]


def _drawing(one: Named) -> str:
    return picture(one.name, one.figure, one.caption)


def _courses(result: StudyResult, drawn: list[Named]) -> list[str]:
    """Each course, with what is read from it and whether that holds; then all other readings."""
    parts, shown = [], {one.key for one in drawn if one.key}
    for one in _of(drawn, "course_"):
        read = [verdict.sentence for verdict in result.verdicts if verdict.key == one.key]
        parts.append(_drawing(one) + (bullets(read) if read else ""))
    rest = [verdict.sentence for verdict in result.verdicts if verdict.key not in shown]
    found = [section("Courses", "\n".join(parts))] if parts else []
    return found + ([section("Readings", bullets(rest))] if rest else [])


def _sensitivities(result: StudyResult, drawn: list[Named]) -> str:
    if result.sensitivity.empty:
        return "<p>None.</p>"
    pictures = "\n".join(map(_drawing, _of(drawn, "sensitivity")))
    marks = [bool(one) for one in result.sensitivity["distinct"]]
    return f"{pictures}\n<p>{escape(SENSITIVITY)}</p>\n{table(result.sensitivity, marks)}"


def _tests(tests: pd.DataFrame) -> str:
    if tests.empty:
        return "<p>None: this design compares no levels side by side.</p>"
    marks = [bool(one) for one in tests["significant"]]
    return f"<p>{escape(TESTS)}</p>\n{table(tests, marks)}"


def _medians(result: StudyResult) -> str:
    joined = result.medians.merge(result.design, left_on="point", right_index=True)
    names = ["response", "point", *map(str, result.design.columns)]
    return table(chosen(joined, [*names, *map(str, result.medians.columns)]))


def _failed(runs: pd.DataFrame) -> str:
    return table(runs[runs["status"] == "failed"])
