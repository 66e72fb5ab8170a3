"""The files of a run. Each appears whole or not at all."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from ...csv_text import csv_text
from ...files import write_bytes, write_text
from ...records import RunResult
from ..as_json import as_json, records
from .choices import TABLES
from .front import labelled


def write(result: RunResult, folder: Path) -> None:
    """Write everything that the contract lists into `folder`, the summary last."""
    # Figures take longer to import than a configuration to read, which imports this package.
    from ...reports.figure import pictures
    from ...reports.page import page
    from ...reports.sheet import allocation_sheet
    from ...reports.sheets import drawing_page

    sheet, texts = allocation_sheet(result), _texts(result)
    _write_texts(texts, folder)
    write_bytes(folder / "front.parquet", result.front.to_parquet(index=False))
    write_text(folder / "front.json", as_json(records(result.front)))
    if sheet is not None:
        write_bytes(folder / "allocation.xlsx", sheet)
    for name, content in pictures(result).items():
        write_bytes(folder / name, content)
    write_text(folder / "report.html", page(result))
    if (drawing := drawing_page(result)) is not None:
        write_text(folder / "drawing.html", drawing)
    _write_summary(result, texts, folder)


def write_tables(result: RunResult, folder: Path) -> None:
    """Write the tables and the summary alone, as far as a result has them."""
    texts = _texts(result)
    _write_texts(texts, folder)
    _write_summary(result, texts, folder)


def _write_texts(texts: Mapping[str, str], folder: Path) -> None:
    for name, text in texts.items():
        write_text(folder / name, text)


def _write_summary(result: RunResult, texts: Mapping[str, str], folder: Path) -> None:
    summary = dict(result.summary) | {"files": {n: digest(t) for n, t in texts.items()}}
    write_text(folder / "summary.json", as_json(summary))


def digest(text: str) -> str:
    """SHA-256 of a text file, by which edits are detected."""
    return hashlib.sha256(text.encode()).hexdigest()


def _texts(result: RunResult) -> dict[str, str]:
    """The files from which the page can be rebuilt, by name."""
    tables = {name: getattr(result, field) for field, name in TABLES.items()}
    tables[TABLES["overlays"]] = labelled(result.overlays)
    texts = {n: csv_text(frame) for n, frame in tables.items() if frame is not None}
    if result.tolerances:
        texts["tolerances.json"] = as_json(list(result.tolerances))
    return {"config.toml": result.configuration} | texts
