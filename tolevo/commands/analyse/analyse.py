"""`tolevo analyse`: every requirement of a stack at the tolerances of its drawing, and the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ... import page_data
from ...configuration.configuration import Configuration
from ...directory import own_folder
from ...errors import refuse
from ...files import WORKBOOK, write_bytes, write_text
from ...page_data import as_json
from ...problems.stack import Stack
from ...problems.stack.definition import Part
from ...records import AnalysisResult, limits_text, range_text, worst_case_text
from ...section import Array, Assumption, Variable
from ...units import plain_number
from ..run.tolerances import grades_of, notation
from .costs import costs_of
from .page import analysis_page, ranked, verdict_of

LINES = 8
"""Lines before the table of the terminal."""
LARGEST = 3
"""Contributions that the terminal names."""
OPEN = "it is to be searched: analysed at the loosest tolerance that it may have"


def stack_of(configuration: Configuration) -> Stack:
    """The stack of a configuration. Raises InputError where it has another problem, or none."""
    if not isinstance(configuration.problem, Stack):
        what = f"is {configuration.problem_name}" if configuration.problem_name else "is missing"
        raise refuse("problem", f'{what}: analyse takes problem = "stack"; evaluate takes designs of every problem')
    return configuration.problem


def analysis_of(configuration: Configuration) -> AnalysisResult:
    """The analysis of a stack, with everything that its page shows. Raises InputError where the
    configuration has no stack.
    """
    from ...problems.stack.analysis import analyse, analysed_design, quick_model

    stack = stack_of(configuration)
    design, loosest = analysed_design(stack)
    analysis, costs = analyse(stack, design), costs_of(stack, design, configuration.choice)
    parts, variables = stack.definition.parts, {variable.name: variable for variable in stack.variables}
    at_loosest = [part for part in parts if part.name in loosest]
    assumed = [*stack.assumptions()]
    for part in at_loosest:
        key, width = ("tolerance", part.high) if part.feature is None else ("zone", 2.0 * part.high)
        assumed.append(Assumption(f"{part.place}.{key}", width, part.unit, OPEN))
    summary = {
        "command": "analyse",
        "name": stack.title(),
        "mechanism": stack.mechanism(),
        "requirements": page_data.records(analysis.requirements),
        "shifted_rss": analysis.shifted,
        "joint_yield_percent": analysis.joint_yield_percent,
        "analysed_at_loosest": list(loosest),
        "units": stack.yields.reported.size,
        "cost": float(stack.cost_of(design[None])[0]) if costs.changes is not None else None,
        "loosen_first": costs.advice,
        "notes": [*analysis.notes, *costs.notes],
        "warnings": list(stack.warnings()),
        "assumptions": [asdict(one) for one in assumed],
    }
    quick = quick_model(stack, design)
    for one in quick.get("parts", ()):
        one["grades"] = grades_of(stack, variables[f"{one['name']}_t"])
    return AnalysisResult(
        stack.title() or "stack",
        analysis.requirements,
        analysis.contributions,
        analysis.histograms,
        pd.DataFrame([_tolerance(stack, part, variables[f"{part.name}_t"], design) for part in parts]),
        summary,
        quick,
        configuration.toml(),
        costs.prices,
        costs.budgets,
        costs.changes,
    )


def _tolerance(stack: Stack, part: Part, variable: Variable, design: Array) -> dict[str, object]:
    """The row of a part: its zone at a full design (all variables,), and what to write on the drawing."""
    half_width = float(design[stack.names.index(variable.name)])
    labels = (stack.drawn(variable.name).get(key, "") for key in ("class", "drawn_as"))
    return {
        "part": part.name,
        "unit": part.unit,
        "nominal": np.nan if part.nominal is None else part.nominal,
        "middle": part.mid,
        "half_width": half_width,
        "distribution": type(part.distribution).__name__,
        "searched": variable.name not in stack.fixed,
        "source": part.source,
        "on_the_drawing": notation(variable, *stack.zone(variable.name), half_width, *labels),
    }


def workbook_with_analysis(configuration: Configuration, workbook: bytes) -> bytes:
    """The workbook of the configuration with sheets of the result; empty where it is no workbook."""
    if not workbook:
        return b""
    from ...configuration.workbook import with_result
    from ...problems.stack.analysis import analysed_design

    stack = stack_of(configuration)
    return with_result(workbook, stack, analysed_design(stack)[0])


def write_analysis(result: AnalysisResult, folder: Path, overwrite: bool, workbook: bytes = b"") -> None:
    """Write every file of an analysis into a directory, with the bytes of a `workbook` where they are
    given. Raises InputError where it holds another result.
    """
    with own_folder(folder, "analyse", False, overwrite) as place:
        place.begin()
        write_text(folder / "config.toml", result.configuration)
        page_data.write_tables(result, folder)
        write_text(folder / page_data.NAME, page_data.dump_result(result))
        write_text(folder / "summary.json", as_json(dict(result.summary)))
        write_text(folder / "report.html", analysis_page(result))
        if workbook:
            write_bytes(folder / WORKBOOK, workbook)
        place.complete()


def lines_of(result: AnalysisResult) -> tuple[str, ...]:
    """The summary that the terminal shows: a verdict, the table, what contributes most."""
    rows = page_data.records(result.requirements)
    table = pd.DataFrame([_short_row(row) for row in rows]).to_string(index=False)
    largest = [line for row in rows if (line := _largest_line(result, str(row["requirement"])))]
    assumed = result.summary["analysed_at_loosest"]
    joint = result.summary["joint_yield_percent"]
    together = [] if np.isnan(joint) else [f"all requirements together: {joint:.6g} % of the units"]
    loosest = f"at the loosest tolerance, for none is stated beside the range: {', '.join(assumed)}"
    more = [*largest, *together, *([loosest] if assumed else [])]
    return (*_verdicts(rows), *table.splitlines(), *more)


def _verdicts(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The verdict on each requirement; of more than `LINES` in how many words, and on those that are not kept."""
    if len(rows) <= LINES:
        return [verdict_of(row) for row in rows]
    limited = [row for row in rows if limits_text(row["lower"], row["upper"])]
    broken = [row for row in limited if not (row["kept_worst_case"] and row["kept_statistical"])]
    which = f"{len(limited)} requirements" + (" with limits" if len(limited) < len(rows) else "")
    whole = f"{len(limited) - len(broken)} of {which}: kept in the worst case and by mean +- 3 sigma"
    whole += f"; {len(rows) - len(limited)} have no limits" if len(limited) < len(rows) else ""
    more = [f"and {len(broken) - LINES + 2} more that are not kept in at least one way"] if len(broken) >= LINES else []
    return [whole, *(verdict_of(row) for row in broken[: LINES - 1 - len(more)]), *more]


def _short_row(row: dict[str, Any]) -> dict[str, str]:
    return {
        "requirement": str(row["requirement"]),
        "unit": str(row["unit"]),
        "nominal": _number(row["nominal"]),
        "worst case": worst_case_text(row),
        "mean +- 3 sigma": range_text(row["rss_least"], row["rss_greatest"]),
        "Cpk": _number(row["cpk"], 3),
        "yield %": _number(row["yield_percent"], 7),
        "ppm outside": "-" if np.isnan(row["ppm"]) else plain_number(row["ppm"]),
    }


def _number(value: float, digits: int = 5) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}g}"


def _largest_line(result: AnalysisResult, requirement: str) -> str:
    own = result.contributions[result.contributions["requirement"] == requirement]
    first = ranked(own).head(LARGEST) if len(own) else own
    shares = [f"{part} {share:.3g} %" for part, share in zip(first["part"], first["variance_percent"], strict=True)]
    return f"largest shares in the variance of {requirement}: {', '.join(shares)}" if shares else ""
