"""The chosen points of a run: what they are, what rounding does, and how sure the choice is."""

from __future__ import annotations

from html import escape

import pandas as pd

from ..records import RunResult
from .document import folded, section
from .orders import orders
from .tables import chosen, table

CHOICES = (
    "Points of the front by named rules; [choice] in the configuration sets weights, limits and a "
    "budget. rounded_...: the same point with every value rounded to what can be ordered, computed "
    "again by the full model; rounding_loss_...: what that changes. unchanged_percent: in how many "
    "of the cases with one cost curve 20 % lower or higher the same point is chosen."
)
SURE = (
    "What each rule would choose with one cost curve 20 % lower or higher, among the points of "
    "this front: what that point, and the choice of the run, cost then. Cases that change nothing "
    "are left out."
)
ROUNDED = (
    "How each variable was rounded. What the configuration does not set under [rounding] is an "
    "assumption: grades of ISO 286 where the nominal size is known, else preferred numbers."
)


def choice_sections(result: RunResult) -> tuple[str, ...]:
    """The sections on choices, none where nothing was chosen."""
    if result.choices is None:
        return ()
    axes = [axis.name for axis in result.objectives]
    names = ["choice", "meaning", "point"]
    for name in axes:
        names += [name, f"rounded_{name}", f"rounding_loss_{name}_percent"]
    names += ["rounded_feasible", "rounded_violated_limits", "unchanged_percent", "model"]
    parts = [f"<p>{escape(CHOICES)}</p>\n{table(chosen(result.choices, names))}"]
    if result.choice_sensitivity is not None:
        moved = result.choice_sensitivity[~result.choice_sensitivity["same"].astype(bool)]
        shown = table(moved.drop(columns="same"))
        parts.append(folded("With other costs", f"<p>{escape(SURE)}</p>\n{shown}"))
    if result.allocation is not None:
        rules = pd.DataFrame(list(result.summary.get("rounding") or ()))
        text = f"<p>{escape(ROUNDED)}</p>\n{table(rules)}"
        parts += [
            folded(f"For the drawing: {order.title}", f"<p>{escape(order.note)}</p>\n{table(order.table)}")
            for order in orders(result)
        ]
        parts.append(folded("Rounding", text))
    return (section("Choices", "\n".join(parts)),)
