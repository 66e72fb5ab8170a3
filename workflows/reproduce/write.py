"""The files of a reproduction. Each appears whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from ...claim_records import ClaimsResult, ComputedTable
from ...csv_text import csv_text
from ...files import write_bytes, write_text
from ...reports.claims import claims_page, figures
from ...reports.drawing import as_png, as_svg
from .. import page_data
from ..as_json import as_json, records

TABLES, FIGURES = "tables", "figures"


def write(result: ClaimsResult, folder: Path) -> None:
    """Verdicts as CSV and JSON, the tables and figures of the calculations, and the page."""
    write_text(folder / "claims.csv", csv_text(flat(result.table)))
    write_text(folder / "claims.json", as_json(claims_record(result)))
    for stem, table in result.tables.items():
        (folder / TABLES).mkdir(exist_ok=True)
        write_text(folder / TABLES / f"{stem}.csv", csv_text(frame_of(table)))
    for drawing in figures(result):
        (folder / FIGURES).mkdir(exist_ok=True)
        write_bytes(folder / FIGURES / f"{drawing.name}.png", as_png(drawing.figure))
        write_bytes(folder / FIGURES / f"{drawing.name}.svg", as_svg(drawing.figure))
    write_text(folder / page_data.NAME, page_data.dumped(result))
    write_text(folder / "report.html", claims_page(result))


def flat(table: pd.DataFrame) -> pd.DataFrame:
    """The table without interpretations that are not shown; several numbers are joined by `; `."""
    flat_table = table.drop(columns="readings")
    for name in ("printed", "computed", "standard_error", "deviation"):
        flat_table[name] = ["; ".join(map(repr, values)) for values in flat_table[name]]
    return flat_table


def claims_record(result: ClaimsResult) -> dict[str, Any]:
    """`claims.json`."""
    claims = records(result.table)
    return {
        "documents": [
            {
                "document": document.name,
                "title": document.title,
                "reference": document.reference,
                "verdicts": {str(word): int(count) for word, count in row.items()},
                "claims": [claim for claim in claims if claim["document"] == document.name],
            }
            for document, (_, row) in zip(result.documents, result.counts.iterrows(), strict=True)
        ]
    }


def frame_of(table: ComputedTable) -> pd.DataFrame:
    """A table of a calculation, units in its names where they have one."""
    return pd.DataFrame(dict(zip((column.name for column in table.columns), table.values, strict=True)))
