"""`drawing.html`: a page to print for every chosen allocation, for the drawing office."""

from __future__ import annotations

from html import escape

from ..records import RunResult, mechanism_lines, unit_of_cost
from .document import document
from .orders import Order, orders
from .tables import shown, table


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
