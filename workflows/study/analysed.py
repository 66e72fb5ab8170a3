"""The statistics of a finished study, computed once."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ...csv_text import csv_text
from ...files import write_text
from .. import page_data
from .racing import LEADERS, leaders
from .records import StudyData, StudySettings

STREAM = (0, 1)
"""Spawn key of the generator of the resampling."""
RECORD = "study.json"
FILES = (RECORD, LEADERS, "sensitivity.csv", "tests.csv", "medians.csv", "report.html", page_data.NAME)


def analysed(settings: StudySettings, data: StudyData, out: Path) -> tuple[str, ...]:
    """Write the statistics of the study to `out`, and return them in lines for the terminal.

    Where `out` already holds the statistics of the same runs, nothing is done again.
    """
    if (known := known_lines(settings, data, out)) is not None:
        return known
    digest = _digest(settings, data)
    from .statistics import analyse  # statsmodels takes seconds to import
    from .statistics.runs import runs_of
    from .write import lines, study_record, write

    result = analyse(settings, data, np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=STREAM)))
    write(result, out)
    costs = [runs_of(data.table, name, len(data.design)).costs() for name in settings.responses]
    write_text(out / LEADERS, csv_text(leaders(data.design[[factor.key for factor in settings.factors]], costs)))
    terminal_lines = lines(result)
    write_text(out / RECORD, study_record(result, {"digest": digest, "lines": list(terminal_lines)}))
    return terminal_lines


def _digest(settings: StudySettings, data: StudyData) -> str:
    """A hash of all that the statistics depend on."""
    parts = (data.table, data.design, data.exact)
    text = [settings.configuration, version("tolevo"), *(table.to_csv(index=False) for table in parts)]
    return hashlib.sha256("\n".join([*text, *data.notes]).encode()).hexdigest()


def known_lines(settings: StudySettings, data: StudyData, out: Path) -> tuple[str, ...] | None:
    """The lines of the statistics of the same runs that `out` holds already, else None."""
    if not all((out / name).is_file() for name in FILES):
        return None
    try:
        record = json.loads((out / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(record, dict) or record.get("digest") != _digest(settings, data):
        return None
    return tuple(map(str, record.get("lines", ())))
