"""The page of recomputed claims: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from html import escape

import pandas as pd

from ...claim_records import ClaimsResult, ComputedTable, Document
from ..document import document, picture, section
from ..scripts import package_scripts
from ..tables import described, shown, table
from .figures import figures

MOST = 60
"""Rows of a calculation's table on the page; the file next to it has all."""
MEANING = (
    "Reproduced: the document is right in its literal interpretation. Reproduced under the stated reading: "
    "it is right in the stated interpretation. Not reproduced: it is right in no interpretation. Cannot be "
    "checked: the data for it are lost. Rows that are not reproduced are marked."
)


def claims_page(result: ClaimsResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    drawn = {
        named.name: picture(named.name.replace(".", "_"), named.figure, named.caption) for named in figures(result)
    }
    parts = [section("Verdicts", described(MEANING, result.counts.rename_axis("document").reset_index()))]
    # tables in `detail` have their whole height, because their reasons are long
    failed = _failed(result.table)
    if not failed.startswith("<p>"):
        parts.append(section("Not reproduced", failed))
    documents = [_document(source, result.table) for source in result.documents]
    parts.append('<div id="detail" data-filter="verdict">\n' + "\n".join(documents) + "\n</div>")
    parts += [
        section(name.replace("_", " "), _calculation(computed, drawn.get(name, "")))
        for name, computed in result.tables.items()
    ]
    scripts = (package_scripts("common.js", "filter.js"),)
    return document("Claims recomputed", parts, scripts)


def _failed(claims: pd.DataFrame) -> str:
    """The claims that are not reproduced, in short."""
    failed = claims[claims["verdict"] == "not reproduced"]
    return table(
        pd.DataFrame(
            {
                "document": failed["document"],
                "claim": failed["id"],
                "printed": [_printed(row) for row in failed.to_dict("records")],
                "computed": failed["computed"].map(_numbers),
                "unit": failed["unit"],
                "reason": failed["reason"],
            }
        )
    )


def _document(source: Document, claims: pd.DataFrame) -> str:
    rows = claims[claims["document"] == source.name]
    frame = pd.DataFrame(
        {
            "claim": rows["id"],
            "place": rows["place"],
            "quantity": rows["quantity"],
            "printed": [_printed(row) for row in rows.to_dict("records")],
            "computed": rows["computed"].map(_numbers),
            "standard error": [_numbers(errors) if any(errors) else "" for errors in rows["standard_error"]],
            "deviation": rows["deviation"].map(_numbers),
            "unit": rows["unit"],
            "tolerance": [
                f"{shown(row['tolerance'])}: {row['tolerance_reason']}" if row["tolerance_reason"] else ""
                for row in rows.to_dict("records")
            ],
            "verdict": rows["verdict"],
            "reason": rows["reason"],
            "ambiguous": rows["ambiguous"],
        }
    )
    marks = [verdict == "not reproduced" for verdict in rows["verdict"]]
    reference = f"<p>{escape(source.reference)}</p>\n" if source.reference else ""
    return section(f"Document {source.name}: {source.title}", reference + table(frame, marks))


def _printed(row: Mapping[Hashable, object]) -> str:
    values = row["printed"]
    assert isinstance(values, list)
    if row["printed_as"]:
        return str(row["printed_as"])
    return " to ".join(map(shown, values)) if row["relation"] == "within" else _numbers(values)


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(map(shown, values))


def _calculation(computed: ComputedTable, drawn: str) -> str:
    frame = pd.DataFrame({axis.name: values for axis, values in zip(computed.columns, computed.values, strict=True)})
    rest = len(frame) - MOST
    more = f"<p>{rest} more rows are in the file.</p>" if rest > 0 else ""
    return f"<p>{escape(computed.meaning)}</p>\n{drawn}\n{table(frame.head(MOST))}{more}"
