"""The page of an analysis: requirements, histograms, what-if, contributions."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
import pandas as pd

from ...page.document import (
    about,
    bullets,
    data,
    described,
    document,
    folded_section,
    package_scripts,
    section,
    table,
)
from ...page_data import records
from ...records import AnalysisResult, range_text

CONTRIBUTIONS = (
    "What each part contributes to each requirement: the change of the requirement per unit of the part, its share in "
    "the variance, and its share in the worst case."
)
WHAT_IF = (
    "Type a half-width, a shift of the mean, a change of the nominal size or a Cp: the requirements follow at once. They "
    "are calculated to second order in the deviations and as if the requirement were normal; the table above is the "
    "full model."
)
TOLERANCES = "The zones that were analysed. A searched part is analysed at the loosest tolerance that it may have."


def analysis_page(result: AnalysisResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    notes = [*result.summary.get("notes", ()), *result.summary.get("warnings", ())]
    assumed = [_assumption(one) for one in result.summary.get("assumptions", ())]
    quick = dict(result.quick)
    parts = [
        section("Requirements", table(_shown(result.requirements), caption=_caption(result))),
        section("Units against the limits", '<div id="histograms" class="many"></div>') if len(result.histograms) else "",
        section("What if", f'<p>{escape(WHAT_IF)}</p><div id="whatif"></div>') if quick else "",
        section("Contributions", described(CONTRIBUTIONS, _ranked(result.contributions))),
        section("Notes", bullets(notes)) if notes else "",
        section("Tolerances", described(TOLERANCES, result.tolerances)),
        section("Assumptions", bullets(assumed)) if assumed else "",
        section("Configuration", folded_section("config.toml", f"<pre>{escape(result.configuration)}</pre>")),
    ]
    content = {"quick": quick, "requirements": records(result.requirements), "bars": _bars(result)}
    head = about(result.summary) + _verdicts(result.requirements)
    scripts = (package_scripts("common.js", "chart.js", "analysis.js"),)
    return document(result.title, [*parts, data(content)], scripts, head)


def _verdicts(requirements: pd.DataFrame) -> str:
    """Which requirements are kept, a sentence each."""
    lines = []
    for row in records(requirements):
        limited = not (np.isnan(row["lower"]) and np.isnan(row["upper"]))
        worst, spread = ("kept" if row[f"kept_{how}"] else "not kept" for how in ("worst_case", "statistical"))
        outside = f"; {row['ppm']:.4g} units in a million are outside" if not np.isnan(row["ppm"]) else ""
        kept = f"{worst} in the worst case, {spread} by mean ± 3 standard deviations{outside}"
        lines.append(f"{row['requirement']}: {kept if limited else 'has no limits'}")
    body = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<p class="asked">Are the requirements kept?</p>\n<ul class="answers">{body}</ul>'


def _caption(result: AnalysisResult) -> str:
    units = result.summary.get("units")
    return f"each requirement at the tolerances below; yields of formulas by {units} units"


def _shown(requirements: pd.DataFrame) -> pd.DataFrame:
    """The table of requirements with ranges in a single column each."""
    rows = records(requirements)
    bound = {"bound": " (outer bound)"}
    return pd.DataFrame(
        {
            "requirement": [row["requirement"] for row in rows],
            "unit": [row["unit"] for row in rows],
            "limits": [_limits(row) for row in rows],
            "nominal": [row["nominal"] for row in rows],
            "mean": [row["mean"] for row in rows],
            "standard deviation": [row["std"] for row in rows],
            "worst case": [
                range_text(row["worst_case_least"], row["worst_case_greatest"]) + bound.get(row["worst_case_kind"], "")
                for row in rows
            ],
            "mean ± 3 standard deviations": [range_text(row["rss_least"], row["rss_greatest"]) for row in rows],
            "Cp": [row["cp"] for row in rows],
            "Cpk": [row["cpk"] for row in rows],
            "yield_percent": [_digits(row["yield_percent"]) for row in rows],
            "ppm outside": [_ppm(row) for row in rows],
        }
    )


def _limits(row: dict[str, Any]) -> str:
    lower, upper = row["lower"], row["upper"]
    if np.isnan(lower) and np.isnan(upper):
        return "none"
    if np.isnan(lower):
        return f"at most {upper:.6g}"
    return f"at least {lower:.6g}" if np.isnan(upper) else range_text(lower, upper)


def _digits(percent: float) -> str:
    """A yield with enough digits to tell 99.99 from 99.9999."""
    return "" if np.isnan(percent) else f"{percent:.7g}"


def _ppm(row: dict[str, Any]) -> str:
    if np.isnan(row["ppm"]):
        return ""
    error = f" ± {row['ppm_error']:.2g}" if row["ppm_error"] >= 0.5 else ""
    return f"{row['ppm']:.4g}{error}"


def _ranked(contributions: pd.DataFrame) -> pd.DataFrame:
    """By requirement, in its order, the largest share first."""
    groups = contributions.groupby("requirement", sort=False)
    return pd.concat(
        [own.sort_values("variance_percent", ascending=False, kind="stable") for _, own in groups], ignore_index=True
    )


def _assumption(one: dict[str, Any]) -> str:
    value = one.get("value")
    number = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"{one['name']} = {number} {one['unit']}".rstrip() + f": {one['reason']}"


def _bars(result: AnalysisResult) -> dict[str, dict[str, list[float]]]:
    """Edges and heights of the histogram of each requirement."""
    return {
        str(name): {"edges": [*own["from"].tolist(), own["to"].iloc[-1]], "percent": own["units_percent"].tolist()}
        for name, own in result.histograms.groupby("requirement", sort=False)
    }
