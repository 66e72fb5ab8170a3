"""`[gear]`: the tooth numbers, or the orders, that effects over the angle follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..models.gear import BUILD, TEETH, Gear, contradictions
from ..section import POSITIVE, Range, Section
from .plugins import ModelClass

GEAR = "gear"
DECLARED = "declared"
"""Kind of a gear that is given by its orders."""


def read_gear(top: Section) -> Gear | None:
    """The gear of a table, None where none is given or it is at fault."""
    if GEAR not in top:
        return None
    section = top.section(GEAR)
    kind = section.text("kind", TEETH)
    if "orders" in section:
        return _of_orders(section, kind)
    if kind is None:
        if "kind" not in section:
            text = f"is missing: state one of {', '.join(TEETH)} with its tooth numbers"
            section.fault("kind", f'{text}, or orders = {{ "pin passing" = 45 }}')
        section.accept({name for names in TEETH.values() for name in names})
        section.finish()
        return None
    return _of_teeth(section, kind)


def _of_orders(section: Section, kind: str | None) -> Gear | None:
    """A gear by its orders, named after their causes."""
    inner = section.section("orders")
    numbers = {name: inner.number(name, "", POSITIVE) for name in inner.all_keys()}
    teeth = [name for names in TEETH.values() for name in names if name in section]
    if kind is not None or teeth:
        section.accept((*teeth, "kind"))
        section.fault("orders", "cannot be combined with kind or tooth numbers: leave one of them out")
        return None
    if not numbers:
        section.fault("orders", 'must name at least one order, such as { "pin passing" = 45 }')
    section.finish()
    orders = {name: order for name, order in numbers.items() if order is not None}
    return Gear(DECLARED, orders) if orders and len(orders) == len(numbers) else None


def _of_teeth(section: Section, kind: str) -> Gear | None:
    """A gear of a kind that has all its tooth numbers."""
    names = TEETH[kind]
    counts = {name: section.integer(name, Range(low=1, high=100_000), None) for name in names}
    section.finish()
    for name in names:
        if name not in section:
            section.fault(name, f'is missing: the effects of a gear of kind "{kind}" need {", ".join(names)}')
    teeth = {name: count for name, count in counts.items() if count is not None}
    if len(teeth) < len(names):
        return None
    wrong = contradictions(kind, teeth)
    for name, text in wrong.items():
        section.fault(name, text)
    return None if wrong else BUILD[kind](teeth)


def check_gear(top: Section, model: ModelClass | None, name: str) -> None:
    """Faults of a `[gear]` next to a model, whose parameters determine its gear."""
    gear = read_gear(top)
    if gear is None or model is None:
        return
    parameters = top.take("parameters")
    model_gear = model.gear_of(parameters if isinstance(parameters, Mapping) else {})
    if model_gear is None:
        top.fault(GEAR, f"has no effect: nothing that acts in {name} follows the orders of a gear; leave it out")
    elif not _agree(model_gear, gear):
        orders = ", ".join(f"{what} {order:g}" for what, order in model_gear.orders.items())
        text = f"contradicts {name}, whose parameters give {orders}; leave it out"
        top.fault(GEAR, f"{text}, or set the model's own tooth numbers in [parameters]")


def _agree(first: Gear, second: Gear) -> bool:
    """Whether the orders that both gears have are equal."""
    both = set(first.orders) & set(second.orders)
    return bool(both) and all(abs(first.orders[n] - second.orders[n]) < 1e-6 for n in both)


def resolved_gear(gear: Gear | None) -> dict[str, Mapping[str, Any]]:
    """The `[gear]` table with the orders of the gear, empty where there is none."""
    return {GEAR: {"orders": dict(gear.orders)}} if gear is not None else {}
