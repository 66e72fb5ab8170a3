"""The chosen allocations as a spreadsheet."""

from __future__ import annotations

import pandas as pd

from ..records import RunResult, mechanism_lines
from .orders import Order, comparison, orders
from .workbook import workbook


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
    sheets["Allocation"] = _without_repetitions(result.allocation, allocations)
    sheets["Choices"] = result.choices
    more = {"Promise": result.promise, "Next parts": result.next_parts, "Capability": result.capability}
    sheets |= {title: frame for title, frame in more.items() if frame is not None}
    if lines := mechanism_lines(result.summary):
        sheets["Mechanism"] = pd.DataFrame({"mechanism": lines})
    sheets["Rounding"] = pd.DataFrame(list(result.summary.get("rounding") or ()))
    return workbook(sheets)


def _without_repetitions(allocation: pd.DataFrame, allocations: list[Order]) -> pd.DataFrame:
    """The table of allocations without those that equal an earlier one, with all their rules."""
    if not allocations or "choice" not in allocation:
        return allocation
    rules = {order.points[0]: " ".join(order.rules) for order in allocations}
    kept = allocation[allocation["point"].isin(list(rules))]
    kept = kept.drop_duplicates(["point", "variable"])
    return kept.assign(choice=kept["point"].map(rules))
