"""From checked claims to the table of verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ...claim_records import ClaimsResult, ComputedTable
from .claims import Claim
from .plan import ReproducePlan
from .task import Checked, ClaimTask
from .verdict import Word

Pairs = Sequence[tuple[ClaimTask, Checked]]


def assembled(plan: ReproducePlan, pairs: Pairs) -> ClaimsResult:
    """The result of all claims."""
    documents = tuple(source.file.document for source in plan.sources)
    table = pd.DataFrame([row(documents[task.document].name, task.claim, checked) for task, checked in pairs])
    counts = pd.crosstab(table["document"], table["verdict"])
    counts = counts.reindex(index=[document.name for document in documents], columns=list(map(str, Word)), fill_value=0)
    return ClaimsResult(documents, table, counts.rename_axis(columns=None), tables_of(pairs))


def row(document: str, claim: Claim, checked: Checked) -> dict[str, Any]:
    """A row of `claims.csv`; several numbers of one claim are a list."""
    verdict = checked.verdict
    shown = verdict.outcome
    return {
        "document": document,
        "id": claim.id,
        "place": claim.place,
        "quantity": claim.quantity,
        "printed": list(claim.printed),
        "printed_as": claim.printed_as,
        "unit": claim.unit,
        "relation": claim.relation,
        "tolerance": claim.tolerance,
        "tolerance_reason": claim.tolerance_reason,
        "computed": list(shown.computed) if shown else [],
        "standard_error": list(shown.standard_error) if shown else [],
        "deviation": list(shown.deviation) if shown else [],
        "verdict": str(verdict.word),
        "reading": shown.states if shown else "",
        "reason": verdict.reason,
        "ambiguous": claim.ambiguous,
        "lost": claim.lost,
        "recomputed_by": shown.by if shown else "",
        "readings": [
            {
                "reading": outcome.states,
                "recomputed_by": outcome.by,
                "computed": list(outcome.computed),
                "standard_error": list(outcome.standard_error),
                "deviation": list(outcome.deviation),
                "holds": outcome.holds,
            }
            for outcome in verdict.outcomes
        ],
    }


def tables_of(pairs: Pairs) -> dict[str, ComputedTable]:
    """Every different table by the stem of its file; equal names are distinguished by the claim."""
    tables: dict[str, ComputedTable] = {}
    for task, checked in pairs:
        for name, table in checked.tables.items():
            same_name = [earlier for stem, earlier in tables.items() if stem.split(".")[0] == name]
            if not any(_equal(table, earlier) for earlier in same_name):
                tables[f"{name}.{task.claim.id}" if name in tables else name] = table
    return tables


def _equal(a: ComputedTable, b: ComputedTable) -> bool:
    return a.columns == b.columns and all(
        np.array_equal(first, second) for first, second in zip(a.values, b.values, strict=True)
    )


def lines(result: ClaimsResult) -> tuple[str, ...]:
    """The summary that the terminal shows."""
    messages = [f"done: {len(result.table)} claims of {len(result.documents)} documents"]
    for name, counts in result.counts.iterrows():
        verdicts = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
        messages.append(f"{name}: {verdicts}")
    return tuple(messages)
