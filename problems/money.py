"""Costs with their currency, and the assumed curves among them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ..declarations import Output
from ..models.costs import CostCurve, Table
from .settings import Money


def unit_of_cost(money: Money) -> str:
    """The unit of a cost: "EUR", or "EUR, partly assumed"."""
    return f"{money.currency}, partly assumed" if money.assumed else money.currency


def with_currency(outputs: Iterable[Output], money: Money) -> tuple[Output, ...]:
    """The outputs with the unit of the cost, and which curves behind it are assumed."""
    unit = unit_of_cost(money)
    more = f"; assumed: {', '.join(money.assumed)}" if money.assumed else ""
    return tuple(
        replace(output, unit=unit, meaning=output.meaning.replace("relative ", "") + more)
        if output.name == "cost"
        else output
        for output in outputs
    )


def rising(name: str, curve: CostCurve | None) -> str:
    """A note that prices of a table rise with the tolerance, empty where none does."""
    if not isinstance(curve, Table) or not curve.rising:
        return ""
    where = ", ".join(f"{t:g}" for t in curve.rising)
    return (
        f"the prices of {name} do not fall with the tolerance (at t = {where}): the lower price of a tighter "
        "tolerance counts there"
    )
