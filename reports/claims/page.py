"""The page of recomputed claims: a single HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from html import escape

import pandas as pd

from ...claim_records import ClaimsResult, ComputedTable, Document
from ..document import document, picture, section
from ..scripts import own
from ..tables import shown, table
from .figures import figures

MOST = 60
"""Rows of a calculation's table on the page; the file beside it has all."""
MEANING = (
    "Reproduced: the document, read literally, comes out. Reproduced under the stated reading: it "
    "comes out when it is read as stated. Not reproduced: it comes out under no reading. Cannot be "
    "checked: what is needed is lost. Rows that are not reproduced are marked."
)


def claims_page(result: ClaimsResult) -> str:
    """The whole page; every text that comes from outside is escaped."""
    drawn = {
        one.name: picture(one.name.replace(".", "_"), one.figure, one.caption)
        for one in figures(result)
    }
    parts = [section("Verdicts", f"<p>{escape(MEANING)}</p>\n{_counts(result)}")]
    # tables in `detail` have their whole height: their reasons are long
    failed = _failed(result.table)
    if not failed.startswith("<p>"):
        parts.append(section("Not reproduced", failed))
    documents = [_document(one, result.table) for one in result.documents]
    parts.append('<div id="detail" data-filter="verdict">\n' + "\n".join(documents) + "\n</div>")
    parts += [
        section(name.replace("_", " "), _calculation(one, drawn.get(name, "")))
        for name, one in result.tables.items()
    ]
    scripts = (own("common.js", "filter.js"),)
    return document("Claims recomputed", "\n".join(parts), scripts)


def _counts(result: ClaimsResult) -> str:
    return table(result.counts.rename_axis("document").reset_index())


def _failed(claims: pd.DataFrame) -> str:
    """The claims that do not hold, in short."""
    own = claims[claims["verdict"] == "not reproduced"]
    return table(
        pd.DataFrame(
            {
                "document": own["document"],
                "claim": own["id"],
                "printed": [_printed(row) for row in own.to_dict("records")],
                "computed": own["computed"].map(_numbers),
                "unit": own["unit"],
                "reason": own["reason"],
            }
        )
    )


def _document(one: Document, claims: pd.DataFrame) -> str:
    own = claims[claims["document"] == one.name]
    frame = pd.DataFrame(
        {
            "claim": own["id"],
            "place": own["place"],
            "quantity": own["quantity"],
            "printed": [_printed(row) for row in own.to_dict("records")],
            "computed": own["computed"].map(_numbers),
            "standard error": [
                _numbers(errors) if any(errors) else "" for errors in own["standard_error"]
            ],
            "deviation": own["deviation"].map(_numbers),
            "unit": own["unit"],
            "tolerance": [
                f"{shown(row['tolerance'])}: {row['tolerance_reason']}"
                if row["tolerance_reason"]
                else ""
                for row in own.to_dict("records")
            ],
            "verdict": own["verdict"],
            "reason": own["reason"],
            "ambiguous": own["ambiguous"],
        }
    )
    marks = [word == "not reproduced" for word in own["verdict"]]
    about = f"<p>{escape(one.reference)}</p>\n" if one.reference else ""
    return section(f"Document {one.name}: {one.title}", about + table(frame, marks))


def _printed(row: Mapping[Hashable, object]) -> str:
    values = row["printed"]
    assert isinstance(values, list)
    if row["printed_as"]:
        return str(row["printed_as"])
    return " to ".join(map(shown, values)) if row["relation"] == "within" else _numbers(values)


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(map(shown, values))


def _calculation(one: ComputedTable, drawn: str) -> str:
    frame = pd.DataFrame(
        {axis.name: values for axis, values in zip(one.columns, one.values, strict=True)}
    )
    rest = len(frame) - MOST
    more = f"<p>{rest} more rows are in the file.</p>" if rest > 0 else ""
    return f"<p>{escape(one.meaning)}</p>\n{drawn}\n{table(frame.head(MOST))}{more}"
