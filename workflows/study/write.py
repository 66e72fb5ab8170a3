"""The files of the statistics of a study. Each appears whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...csv_text import csv_text
from ...files import write_bytes, write_text
from ...records import StudyResult, mechanism_lines
from ...reports.drawing import as_png, as_svg
from ...reports.study import figures, study_page
from .. import page_data
from ..as_json import as_json


def write(result: StudyResult, folder: Path) -> None:
    """`sensitivity.csv`, `tests.csv`, `medians.csv`, every figure and the page."""
    for name in ("sensitivity", "tests", "medians"):
        write_text(folder / f"{name}.csv", csv_text(getattr(result, name)))
    for named in figures(result):
        write_bytes(folder / f"{named.name}.png", as_png(named.figure))
        write_bytes(folder / f"{named.name}.svg", as_svg(named.figure))
    write_text(folder / "report.html", study_page(result))
    write_text(folder / page_data.NAME, page_data.dumped(result))


def study_record(result: StudyResult, more: Mapping[str, Any]) -> str:
    """`study.json`: recommendations, verdicts on readings, notes, and `more`."""
    record = {
        **({"mechanism": dict(result.mechanism)} if result.mechanism else {}),
        "recommendations": [asdict(recommendation) for recommendation in result.recommendations],
        "readings": [asdict(verdict) for verdict in result.verdicts],
        "notes": list(result.notes),
    }
    return as_json(record | dict(more))


def lines(result: StudyResult) -> tuple[str, ...]:
    """The lines of the result for the terminal."""
    sentences = mechanism_lines({"mechanism": result.mechanism})
    sentences += [f"recommended: {recommendation.sentence}" for recommendation in result.recommendations]
    sentences += [f"reading: {verdict.sentence}" for verdict in result.verdicts]
    return (*sentences, *(f"note: {note}" for note in result.notes))
