"""The chosen allocations as a spreadsheet."""

from __future__ import annotations

from html import escape

import pandas as pd

from ..records import RunResult, mechanism_lines, unit_of_cost
from ..tables.workbook import written
from .document import document, shown, table
from .figures import Order, comparison, orders


def allocation_sheet(result: RunResult) -> bytes | None:
    """`allocation.xlsx`: a summary that compares the allocations, a sheet for each (those that
    round to the same values share a sheet) with deviations as numbers, a table of all, the choices
    with their losses, the mechanism where the configuration describes it, the rules of rounding.

    None where nothing is chosen.
    """
    if result.allocation is None or result.choices is None:
        return None
    allocations = orders(result)
    together = comparison(result, allocations)
    sheets = {"Summary": together}
    for at, order in enumerate(allocations):
        sheets[str(together["sheet"].iloc[at])] = order.table
    sheets["Allocation"] = _drop_repetitions(result.allocation, allocations)
    sheets["Choices"] = result.choices
    more = {"Promise": result.promise, "Next parts": result.next_parts, "Capability": result.capability}
    sheets |= {title: frame for title, frame in more.items() if frame is not None}
    if lines := mechanism_lines(result.summary):
        sheets["Mechanism"] = pd.DataFrame({"mechanism": lines})
    sheets["Rounding"] = pd.DataFrame(list(result.summary.get("rounding") or ()))
    return written(sheets)


def _drop_repetitions(allocation: pd.DataFrame, allocations: list[Order]) -> pd.DataFrame:
    """The table of allocations without those that equal an earlier one, with all their rules."""
    if not allocations or "choice" not in allocation:
        return allocation
    rules = {order.points[0]: " ".join(order.rules) for order in allocations}
    kept = allocation[allocation["point"].isin(list(rules))]
    kept = kept.drop_duplicates(["point", "variable"])
    return kept.assign(choice=kept["point"].map(rules))


# `drawing.html`: a page to print for every chosen allocation, for the drawing office.


def drawing_page(result: RunResult) -> str | None:
    """The pages, None where nothing is chosen."""
    allocations = orders(result)
    if not allocations:
        return None
    lines = "".join(f"<p>{escape(line)}</p>" for line in mechanism_lines(result.summary))
    sheets = (_sheet(result, order) for order in allocations)
    return document(f"{result.title}: for the drawing", sheets, head=lines)


def _sheet(result: RunResult, order: Order) -> str:
    cost = unit_of_cost(result.summary)
    values = ", ".join(
        f"{axis.name.replace('_', ' ')} {shown(order.outcome.get(f'rounded_{axis.name}'))} "
        f"{cost if axis.name == 'cost' else ''}".strip()
        for axis in result.objectives
    )
    statement = f"Verified by the full model: {values}{order.verdict}."
    return (
        f'<section class="sheet">\n<h2>{escape(order.title)}</h2>\n<p>{escape(order.note)}</p>'
        f"\n<p>{escape(statement)}</p>\n{table(order.sheet)}\n</section>"
    )
