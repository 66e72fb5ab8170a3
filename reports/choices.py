"""The chosen points of a run, their rounded values, and how sensitive the choices are to costs."""

from __future__ import annotations

import pandas as pd

from ..records import RunResult
from .document import folded, section
from .orders import orders
from .tables import chosen, described

CHOICES = (
    "Points of the front that are chosen by rules; [choice] in the configuration sets weights, limits and a "
    "budget. rounded_... is the same point with every value rounded to one that can be ordered, computed "
    "again by the full model, and rounding_loss_... the change by it. unchanged_percent states in how many "
    "of the cases with one cost curve 20 % lower or higher the same point is chosen."
)
SENSITIVITY = (
    "The choices of the rules among the points of this front with one cost curve 20 % lower or "
    "higher, with the costs of that point and of the choice of the run in that case. Cases that "
    "change nothing are omitted."
)
ROUNDED = (
    "The rules by which the variables are rounded. A rule that the configuration does not set under "
    "[rounding] is an assumption: grades of ISO 286 where the nominal size is known, else preferred numbers."
)


def choice_sections(result: RunResult) -> tuple[str, ...]:
    """The sections on choices, none where nothing is chosen."""
    if result.choices is None:
        return ()
    names = ["choice", "meaning"]
    for name in (axis.name for axis in result.objectives):
        names += [name, f"rounded_{name}", f"rounding_loss_{name}_percent"]
    names += ["rounded_feasible", "rounded_violated_limits", "unchanged_percent", "model"]
    parts = [described(CHOICES, chosen(result.choices, names))]
    if result.choice_sensitivity is not None:
        moved = result.choice_sensitivity[~result.choice_sensitivity["same"].astype(bool)]
        parts.append(folded("With other costs", described(SENSITIVITY, moved.drop(columns="same"))))
    if result.allocation is not None:
        parts += [
            folded(f"For the drawing: {order.title}", described(order.note, order.drawn)) for order in orders(result)
        ]
        rules = pd.DataFrame(list(result.summary.get("rounding") or ()))
        parts.append(folded("Rounding", described(ROUNDED, rules)))
    return (section("Choices", "\n".join(parts)),)
