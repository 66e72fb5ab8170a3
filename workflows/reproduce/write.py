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
from ..as_json import as_json

TABLES, FIGURES = "tables", "figures"


def write(result: ClaimsResult, folder: Path) -> None:
    """Verdicts as CSV and JSON, the tables and figures of the calculations, and the page."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "claims.csv", csv_text(flat(result.table)))
    write_text(folder / "claims.json", as_json(told(result)))
    for stem, table in result.tables.items():
        (folder / TABLES).mkdir(exist_ok=True)
        write_text(folder / TABLES / f"{stem}.csv", csv_text(frame_of(table)))
    for one in figures(result):
        (folder / FIGURES).mkdir(exist_ok=True)
        write_bytes(folder / FIGURES / f"{one.name}.png", as_png(one.figure))
        write_bytes(folder / FIGURES / f"{one.name}.svg", as_svg(one.figure))
    write_text(folder / page_data.NAME, page_data.dumped(result))
    write_text(folder / "report.html", claims_page(result))


def flat(table: pd.DataFrame) -> pd.DataFrame:
    """The table without the readings that are not shown, several numbers joined by semicolons."""
    found = table.drop(columns="readings")
    for name in ("printed", "computed", "standard_error", "deviation"):
        found[name] = ["; ".join(map(repr, values)) for values in found[name]]
    return found


def told(result: ClaimsResult) -> dict[str, Any]:
    """`claims.json`."""
    claims = [
        {str(key): value for key, value in row.items()} for row in result.table.to_dict("records")
    ]
    return {
        "documents": [
            {
                "document": one.name,
                "title": one.title,
                "reference": one.reference,
                "verdicts": {str(word): int(count) for word, count in row.items()},
                "claims": [claim for claim in claims if claim["document"] == one.name],
            }
            for one, (_, row) in zip(result.documents, result.counts.iterrows(), strict=True)
        ]
    }


def frame_of(table: ComputedTable) -> pd.DataFrame:
    """A table of a calculation, units in its names where they have one."""
    return pd.DataFrame(dict(zip((one.name for one in table.columns), table.values, strict=True)))
