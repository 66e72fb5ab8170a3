"""The page of an analysis: requirements, histograms, what-if, contributions."""

from __future__ import annotations

from html import escape
from itertools import starmap
from typing import Any

import numpy as np
import pandas as pd

from ...page.document import (
    about,
    bullets,
    data,
    declared_tables,
    described,
    document,
    folded_section,
    package_scripts,
    requirements_view,
    section,
    table,
)
from ...page_data import records
from ...records import AnalysisResult, limits_text
from ...units import plain_number

CONTRIBUTIONS = (
    "What each part contributes to each requirement: the change of the requirement per unit of the part (of all its "
    "pieces together, where it is built in several times), its share in the variance, and its share in the worst case."
)
WHAT_IF = (
    "Type a half-width, a shift of the mean, a change of the nominal size or a Cp, or choose a grade: the requirements "
    "follow at once. "
    "They are calculated to second order in the deviations and as if the requirement were normal; the table above "
    "is of the full model."
)
COSTS = (
    "A requirement counts by its own method. Its ratio is that of the room from its middle to the nearer limit to its "
    "variation: 1 just keeps it, and by rss it is Cpk."
)
PRICES = (
    "What it saves when every limit of a requirement lies this step farther out, and costs when it lies nearer: the "
    "change of the least cost at which every ratio is 1."
)
BUDGETS = "The least cost at a least ratio, over all tolerances and processes together (budgets.csv has these)."
CHANGES = (
    "Each tolerance moved to the next value that can be ordered, or to another process, all others kept; a step breaks "
    "a requirement whose ratio falls below 1, or below what it is now."
)


def analysis_page(result: AnalysisResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    notes = [*result.summary.get("notes", ()), *result.summary.get("warnings", ())]
    assumed = [_assumption(one) for one in result.summary.get("assumptions", ())]
    quick = dict(result.quick)
    parts = [
        section("Requirements", table(_with_largest_share(result), caption=_caption(result))),
        section("Units against the limits", '<div id="histograms" class="many"></div>')
        if len(result.histograms)
        else "",
        section("What if", f'<p>{escape(WHAT_IF)}</p><div id="whatif"></div>') if quick else "",
        *_costs(result),
        section("Contributions", described(CONTRIBUTIONS, ranked(result.contributions))),
        section("Notes", bullets(notes)) if notes else "",
        *starmap(section, declared_tables(result).items()),
        section("Assumptions", bullets(assumed)) if assumed else "",
        section("Configuration", folded_section("config.toml", f"<pre>{escape(result.configuration)}</pre>")),
    ]
    content = {"quick": quick, "requirements": records(result.requirements), "bars": _bars(result)}
    content |= {"budgets": [] if result.budgets is None else records(result.budgets)}
    head = about(result.summary) + _verdicts(result.requirements)
    scripts = (package_scripts("common.js", "chart.js", "analysis.js"),)
    return document(result.title, [*parts, data(content)], scripts, head)


def verdict_of(row: dict[str, Any]) -> str:
    """Whether a requirement is kept, in a sentence: in the worst case and statistically."""
    limits = limits_text(row["lower"], row["upper"])
    if not limits:
        return f"{row['requirement']}: has no limits"
    worst, statistical = row["kept_worst_case"], row["kept_statistical"]
    if worst and statistical:
        kept = "kept in the worst case and by mean +- 3 sigma"
    elif worst or statistical:
        ways = ("in the worst case", "by mean +- 3 sigma")
        kept = "kept {}, not {}".format(*(ways if worst else ways[::-1]))
    else:
        kept = "kept neither in the worst case nor by mean +- 3 sigma"
    return f"{row['requirement']}, {limits} {row['unit']}".rstrip() + f": {kept}"


def _verdicts(requirements: pd.DataFrame) -> str:
    """Which requirements are kept, a sentence each."""
    lines = []
    for row in records(requirements):
        outside = f"; {plain_number(row['ppm'])} units in a million are outside" if not np.isnan(row["ppm"]) else ""
        lines.append(escape(verdict_of(row).replace("+-", "±") + outside))
    body = "".join(f"<li>{line}</li>" for line in lines)
    return f'<p class="asked">Are the requirements kept?</p>\n<ul class="answers">{body}</ul>'


def _costs(result: AnalysisResult) -> tuple[str, ...]:
    """What changes cost, where the stack has costs."""
    tables = [(PRICES, result.prices), (CHANGES, result.changes)]
    if result.budgets is not None:
        tables.insert(1, (BUDGETS, result.budgets[["cost", "room_over_variation", "weakest"]]))
    shown = [described(text, frame) for text, frame in tables if frame is not None]
    first = [f'<p id="first">{escape(str(text))}</p>' for text in (result.summary.get("loosen_first"),) if text]
    return (section("Costs", "\n".join([f"<p>{escape(COSTS)}</p>", *first, *shown])),) if shown else ()


def _with_largest_share(result: AnalysisResult) -> pd.DataFrame:
    """The requirements with the part that has the largest share in the variance of each."""
    first = ranked(result.contributions).drop_duplicates("requirement").set_index("requirement")
    largest = [
        f"{first['part'][name]}, {first['variance_percent'][name]:.3g} %" if name in first.index else ""
        for name in result.requirements["requirement"]
    ]
    return requirements_view(result.requirements).assign(**{"largest share": largest})


def _caption(result: AnalysisResult) -> str:
    units = result.summary.get("units")
    return f"each requirement at the tolerances below; yields of formulas by {units} units"


def ranked(contributions: pd.DataFrame) -> pd.DataFrame:
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
